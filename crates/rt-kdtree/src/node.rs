//! [`Node`] and [`KdTree`]: the tree.

use bytemuck::{Pod, Zeroable};
use rt_accel::{Bounded, Invalid, Mailing, Sah};
use rt_bounds::Aabb;
use rt_geom::Axis;
use rt_geom::glam::{DVec3, Vec3A};

/// The greatest number of splits on a way from the root to a leaf.
pub const MAX_DEPTH: usize = 60;

/// A split or a leaf, in 8 bytes; its box is implied.
///
/// The child below a split is the next node, the child above is named. A child without primitives is not stored: node 0, the root,
/// is nobody's child, so a split that names it has nothing above; and one that names the next node as the child above has nothing
/// below. Often more than half of all leaves are empty.
///
/// Source: Wald, *Realtime Ray Tracing and Interactive Global Illumination*, PhD thesis, Saarland University (2004), section 7.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(8))]
pub struct Node {
    /// The bits of the split's position, or the leaf's first reference.
    place: u32,
    /// Low two bits: the axis, or 3 for a leaf. The others: the child above or 0, or how many references.
    link: u32,
}

/// What a node says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum View {
    /// Children are missing where there are no primitives.
    Split {
        axis: Axis,
        position: f32,
        children: [Option<usize>; 2],
    },
    Leaf {
        first: u32,
        count: usize,
    },
}

impl Node {
    /// The greatest child number and the greatest leaf.
    pub(crate) const MOST: usize = (1 << 30) - 1;

    pub(crate) fn split(axis: Axis, position: f32, above: usize) -> Node {
        Node { place: position.to_bits(), link: (above as u32) << 2 | axis.index() as u32 }
    }

    pub(crate) fn leaf(first: usize, count: usize) -> Node {
        Node { place: first as u32, link: (count as u32) << 2 | 3 }
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.link & 3 == 3
    }

    /// The child above or 0, or how many references.
    #[inline(always)]
    pub(crate) fn far(self) -> usize {
        (self.link >> 2) as usize
    }

    #[inline(always)]
    pub(crate) fn position(self) -> f32 {
        f32::from_bits(self.place)
    }

    #[inline(always)]
    pub(crate) fn first(self) -> u32 {
        self.place
    }

    #[inline(always)]
    pub(crate) fn axis(self) -> Axis {
        // A look-up, since a branch on the axis would be guessed wrong too often.
        const AXES: [Axis; 4] = [Axis::X, Axis::Y, Axis::Z, Axis::Z];
        AXES[(self.link & 3) as usize]
    }

    /// What this node says as node `index`.
    pub(crate) fn view(self, index: usize) -> View {
        let far = self.far();
        if self.is_leaf() {
            return View::Leaf { first: self.first(), count: far };
        }
        let children = [(far != index + 1).then_some(index + 1), (far != 0).then_some(far)];
        View::Split { axis: self.axis(), position: self.position(), children }
    }

    /// The same node where nodes and references begin later.
    pub(crate) fn shifted(self, nodes: usize, refs: usize) -> Node {
        match self.far() {
            count if self.is_leaf() => Node::leaf(self.first() as usize + refs, count),
            0 => self,
            above => Node::split(self.axis(), self.position(), above + nodes),
        }
    }
}

/// A kd-tree with planes in `f32`, for rays of both precisions. 8 bytes a node and 4 a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct KdTree {
    pub(crate) origin: DVec3,
    pub(crate) bound: Aabb,
    /// Depth first; empty only when there is nothing to hit.
    pub(crate) nodes: Vec<Node>,
    pub(crate) prims: Vec<u32>,
    pub(crate) skipped: Vec<u32>,
    pub(crate) repeats: bool,
    pub(crate) mailing: Mailing,
    pub(crate) sah: Sah,
}

/// What a tree is made of, as the literature counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Splits.
    pub splits: usize,
    /// Leaves with primitives.
    pub leaves: usize,
    /// Leaves without, which are not stored.
    pub empty_leaves: usize,
    /// Primitives in leaves, each as often as it stands in one.
    pub references: usize,
    /// The largest leaf.
    pub largest_leaf: usize,
    /// Splits on the longest way.
    pub depth: usize,
    /// Nodes, leaves with primitives, and tests that a line through the bound meets on average, uniform and stopped by nothing:
    /// sums of surface areas over the bound's.
    ///
    /// Source: MacDonald and Booth, "Heuristics for ray tracing using space subdivision", The Visual Computer 6 (1990).
    pub expected: [f64; 3],
}

impl KdTree {
    /// The nodes, the root first, depth first: `bytemuck` casts them to bytes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The primitive numbers that leaves refer to.
    pub fn references(&self) -> &[u32] {
        &self.prims
    }

    /// What the tree is made of. `O(n)`.
    pub fn statistics(&self) -> Statistics {
        let mut s = Statistics::default();
        let whole = area(&self.bound);
        self.each(&mut |view, cell, depth| {
            let share = if whole > 0.0 { area(cell) / whole } else { 1.0 };
            s.depth = s.depth.max(depth);
            match view {
                View::Split { children, .. } => {
                    s.splits += 1;
                    s.expected[0] += share;
                    if children.contains(&None) {
                        s.empty_leaves += 1;
                        s.depth = s.depth.max(depth + 1);
                    }
                }
                View::Leaf { count: 0, .. } => s.empty_leaves += 1,
                View::Leaf { count, .. } => {
                    s.leaves += 1;
                    s.references += count;
                    s.largest_leaf = s.largest_leaf.max(count);
                    s.expected[1] += share;
                    s.expected[2] += share * count as f64;
                }
            }
        });
        s
    }

    /// The expected cost of a line through the bound by the surface area heuristic, in the unit of the build's [`Sah`]. `O(n)`.
    pub fn sah_cost(&self) -> f64 {
        let [splits, _, tests] = self.statistics().expected;
        self.sah.traverse as f64 * splits + self.sah.intersect as f64 * tests
    }

    /// Calls `see` for every node, depth first, with its cell and the number of splits above.
    pub(crate) fn each(&self, see: &mut dyn FnMut(View, &Aabb, usize)) {
        let mut stack = vec![(0, self.bound, 0)];
        while let Some((index, cell, depth)) = stack.pop() {
            let Some(&node) = self.nodes.get(index) else { continue };
            let view = node.view(index);
            see(view, &cell, depth);
            if let View::Split { axis, position, children: [below, above] } = view {
                let (low, high) = cut(&cell, axis, position);
                stack.extend(above.map(|above| (above, high, depth + 1)));
                stack.extend(below.map(|below| (below, low, depth + 1)));
            }
        }
    }

    pub(crate) fn check(&self, source: &dyn Bounded) -> Result<(), Invalid> {
        let fail = |what: String| Err(Invalid(what));
        let mut times = vec![0u32; source.prim_count()];
        let (mut next_ref, mut seen, mut trouble) = (0usize, 0usize, None);
        self.each(&mut |view, cell, depth| {
            seen += 1;
            let mut say = |what: String| trouble = trouble.take().or(Some(what));
            match view {
                View::Split { axis, position, children } => {
                    let a = axis.index();
                    if !(cell.min[a] <= position && position <= cell.max[a]) {
                        say(format!("a plane at {position} lies outside its cell {cell:?}"));
                    }
                    for child in children.into_iter().flatten().filter(|child| *child >= self.nodes.len()) {
                        say(format!("a child is node {child}, which is none"));
                    }
                    if children == [None; 2] {
                        say("a split has no children".into());
                    }
                    if depth >= MAX_DEPTH {
                        say(format!("the tree has {depth} splits on one way"));
                    }
                }
                View::Leaf { first, count } => {
                    // Depth first, leaves take the references one after another.
                    if count > 0 && first as usize != next_ref {
                        say(format!(
                            "a leaf begins at reference {first}, the one before it ended at {next_ref}"
                        ));
                    }
                    next_ref += count;
                    for &prim in self.prims.get(first as usize..first as usize + count).unwrap_or(&[]) {
                        match times.get_mut(prim as usize) {
                            Some(times) => *times += 1,
                            None => say(format!("a leaf names primitive {prim}, which is none")),
                        }
                        if source.bound_from(prim, self.origin).overlap(*cell).is_empty() {
                            say(format!("primitive {prim} does not reach into its leaf {cell:?}"));
                        }
                    }
                }
            }
        });
        if let Some(trouble) = trouble {
            return fail(trouble);
        }
        if seen != self.nodes.len() || next_ref != self.prims.len() {
            return fail(format!("{seen} nodes and {next_ref} references hang in the tree"));
        }
        for &prim in &self.skipped {
            if core::mem::replace(&mut times[prim as usize], 1) != 0 {
                return fail(format!("primitive {prim} is both skipped and in the tree"));
            }
        }
        match times.iter().position(|times| *times == 0) {
            Some(prim) => fail(format!("primitive {prim} is missing")),
            None => Ok(()),
        }
    }
}

/// The parts of a cell below and above a plane; both hold the plane.
#[inline]
pub(crate) fn cut(cell: &Aabb, axis: Axis, position: f32) -> (Aabb, Aabb) {
    let (mut low, mut high) = (*cell, *cell);
    low.max[axis.index()] = position;
    high.min[axis.index()] = position;
    (low, high)
}

/// Half the surface area, in `f64`, where boxes of `f32` stay in range; infinite sides count as the largest finite ones.
#[inline]
pub(crate) fn area(b: &Aabb) -> f64 {
    let s = b.size().min(Vec3A::splat(f32::MAX)).as_dvec3();
    s.x * s.y + s.y * s.z + s.z * s.x
}

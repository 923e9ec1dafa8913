//! [`Node`] and [`Bsp`]: the tree.

use crate::cell::Cell;
use crate::plane::{Plane, Scale, cut_box};
use bytemuck::{Pod, Zeroable};
use rt_accel::{Bounded, Invalid, Mailing};
use rt_bounds::Aabb;
use rt_geom::Axis;
use rt_geom::glam::{DVec3, Vec3};

/// The greatest number of splits on a way from the root to a leaf.
pub const MAX_DEPTH: usize = 64;

/// 8 bytes of a tree: a leaf, an axis-aligned split, or the first of the four that a slanted split takes.
///
/// The child below a split comes right after it, the child above is named. A slanted split goes on with the normal in three `f32`,
/// 4 bytes that are zero, and the shift in `f64`.
///
/// Source of the short form: Wald, *Realtime Ray Tracing and Interactive Global Illumination*, PhD thesis, Saarland University
/// (2004), section 7.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(8))]
pub struct Node {
    /// The bits of the split's position or of the plane's room, or the leaf's first reference.
    place: u32,
    /// Low three bits: the axis, 3 for a leaf, or 4 for a slanted split. Above: the child above, or how many references.
    link: u32,
}

const LEAF: u32 = 3;
const SLANTED: u32 = 4;
/// What a slanted split takes.
pub(crate) const WIDE: usize = 4;

/// What a node says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum View {
    Axis { axis: Axis, position: f32, above: usize },
    Slanted { plane: Plane, above: usize },
    Leaf { first: u32, count: usize },
}

impl Node {
    /// The greatest child number and the greatest leaf.
    pub(crate) const MOST: usize = (1 << 29) - 1;

    /// Adds the nodes for a view.
    pub(crate) fn push(nodes: &mut Vec<Node>, view: View) {
        match view {
            View::Axis { axis, position, above } => {
                nodes.push(Node {
                    place: position.to_bits(),
                    link: (above as u32) << 3 | axis.index() as u32,
                });
            }
            View::Leaf { first, count } => {
                nodes.push(Node { place: first, link: (count as u32) << 3 | LEAF });
            }
            View::Slanted { plane, above } => {
                let (n, shift) = (plane.normal.to_array().map(f32::to_bits), plane.shift.to_bits());
                nodes.push(Node { place: plane.room.to_bits(), link: (above as u32) << 3 | SLANTED });
                nodes.push(Node { place: n[0], link: n[1] });
                nodes.push(Node { place: n[2], link: 0 });
                nodes.push(Node { place: shift as u32, link: (shift >> 32) as u32 });
            }
        }
    }

    /// The low bits: below 3 the axis.
    #[inline(always)]
    pub(crate) fn kind(self) -> u32 {
        self.link & 7
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.kind() == LEAF
    }

    /// The child above, or how many references.
    #[inline(always)]
    pub(crate) fn far(self) -> usize {
        (self.link >> 3) as usize
    }

    #[inline(always)]
    pub(crate) fn position(self) -> f32 {
        f32::from_bits(self.place)
    }

    #[inline(always)]
    pub(crate) fn first(self) -> u32 {
        self.place
    }

    /// The plane of a slanted split.
    #[inline(always)]
    pub(crate) fn plane([head, xy, z, shift]: [Node; WIDE]) -> Plane {
        Plane {
            normal: Vec3::new(f32::from_bits(xy.place), f32::from_bits(xy.link), f32::from_bits(z.place)),
            shift: f64::from_bits(shift.place as u64 | (shift.link as u64) << 32),
            room: f32::from_bits(head.place),
        }
    }

    /// Names another child above.
    pub(crate) fn hang(&mut self, above: usize) {
        self.link = self.link & 7 | (above as u32) << 3;
    }
}

#[inline(always)]
pub(crate) fn axis_of(kind: u32) -> Axis {
    match kind {
        0 => Axis::X,
        1 => Axis::Y,
        _ => Axis::Z,
    }
}

impl View {
    /// What stands at a place, and how many nodes it takes.
    pub(crate) fn at(nodes: &[Node], at: usize) -> Option<(View, usize)> {
        let node = *nodes.get(at)?;
        Some(match node.kind() {
            LEAF => (View::Leaf { first: node.first(), count: node.far() }, 1),
            SLANTED => {
                let plane = Node::plane(*nodes[at..].first_chunk()?);
                (View::Slanted { plane, above: node.far() }, WIDE)
            }
            kind => (View::Axis { axis: axis_of(kind), position: node.position(), above: node.far() }, 1),
        })
    }

    /// The same where nodes and references begin later.
    pub(crate) fn shifted(self, nodes: usize, refs: usize) -> View {
        match self {
            View::Leaf { first, count } => View::Leaf { first: first + refs as u32, count },
            View::Axis { axis, position, above } => View::Axis { axis, position, above: above + nodes },
            View::Slanted { plane, above } => View::Slanted { plane, above: above + nodes },
        }
    }
}

/// A BSP tree with planes along the axes and planes of the scene's own triangles, for rays of both precisions. 8 bytes an
/// axis-aligned split or a leaf, 32 a slanted one, 4 a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Bsp {
    pub(crate) origin: DVec3,
    pub(crate) bound: Aabb,
    /// Depth first; empty only when there is nothing to hit.
    pub(crate) nodes: Vec<Node>,
    pub(crate) prims: Vec<u32>,
    pub(crate) skipped: Vec<u32>,
    pub(crate) repeats: bool,
    pub(crate) mailing: Mailing,
    /// What an axis-aligned split, a slanted one and a test cost.
    pub(crate) prices: [f32; 3],
}

/// What a tree is made of, as the literature counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Splits along an axis.
    pub axis_splits: usize,
    /// Splits by planes of triangles and of their edges.
    pub slanted_splits: usize,
    /// Leaves with primitives.
    pub leaves: usize,
    /// Leaves without.
    pub empty_leaves: usize,
    /// References in all leaves.
    pub references: usize,
    /// The most splits on a way.
    pub depth: usize,
    /// The mean number of splits above a leaf, empty ones included.
    pub mean_depth: f64,
    /// The most references in a leaf.
    pub largest_leaf: usize,
    /// How many axis-aligned splits, slanted splits, leaves with primitives and references a line is expected to pass that meets
    /// the bound and that nothing stops: the sums of their cells' shares of the bound's surface.
    pub expected: [f64; 4],
}

impl Bsp {
    /// The nodes, the root first, depth first: `bytemuck` casts them to bytes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The primitive numbers that leaves refer to.
    pub fn references(&self) -> &[u32] {
        &self.prims
    }

    /// What the tree is made of. `O(n)`, but every cell is cut again.
    pub fn statistics(&self) -> Statistics {
        let mut s = Statistics::default();
        let root = Cell::of_box(&self.bound);
        let (whole, mut depths, mut heights) = (root.area(), 0usize, Vec::new());
        let mut cut = |cell: &Cell, view: &View| {
            let (normal, shift) = match *view {
                View::Axis { axis, position, .. } => (unit_of(axis), position as f64),
                View::Slanted { plane, .. } => (plane.normal.as_dvec3(), plane.shift),
                View::Leaf { .. } => return [cell.clone(), cell.clone()],
            };
            cell.heights(normal, shift, &mut heights);
            cell.split(&heights)
        };
        self.each(root, &mut cut, &mut |view, cell, depth| {
            let share = if whole > 0.0 { cell.area() / whole } else { 1.0 };
            s.depth = s.depth.max(depth);
            match view {
                View::Axis { .. } => {
                    s.axis_splits += 1;
                    s.expected[0] += share;
                }
                View::Slanted { .. } => {
                    s.slanted_splits += 1;
                    s.expected[1] += share;
                }
                View::Leaf { count: 0, .. } => s.empty_leaves += 1,
                View::Leaf { count, .. } => {
                    s.leaves += 1;
                    s.references += count;
                    s.largest_leaf = s.largest_leaf.max(count);
                    s.expected[2] += share;
                    s.expected[3] += share * count as f64;
                }
            }
            if let View::Leaf { .. } = view {
                depths += depth;
            }
        });
        s.mean_depth = depths as f64 / (s.leaves + s.empty_leaves).max(1) as f64;
        s
    }

    /// The expected cost of a line through the bound by the surface area heuristic, in the unit of the build's prices. `O(n)`, as
    /// [`Bsp::statistics`].
    pub fn sah_cost(&self) -> f64 {
        let [axis, slanted, _, tests] = self.statistics().expected;
        let [a, s, t] = self.prices.map(f64::from);
        // A tree without slanted splits may have given them no finite price.
        a * axis + if slanted > 0.0 { s * slanted } else { 0.0 } + t * tests
    }

    /// Calls `see` for every node, with its region and the number of splits above.
    pub(crate) fn each<T>(
        &self,
        root: T,
        cut: &mut dyn FnMut(&T, &View) -> [T; 2],
        see: &mut dyn FnMut(View, &T, usize),
    ) {
        let mut stack = vec![(0, root, 0)];
        while let Some((index, region, depth)) = stack.pop() {
            let Some((view, size)) = View::at(&self.nodes, index) else { continue };
            see(view, &region, depth);
            if let View::Axis { above, .. } | View::Slanted { above, .. } = view {
                let [low, high] = cut(&region, &view);
                stack.push((above, high, depth + 1));
                stack.push((index + size, low, depth + 1));
            }
        }
    }

    /// The boxes of both children of a split, which hold their closed cells, room included.
    pub(crate) fn cut(&self, bound: &Aabb, view: &View) -> [Aabb; 2] {
        match (*view, Scale::of(&self.bound)) {
            (View::Axis { axis, position, .. }, _) => cut_box(bound, axis, position),
            (View::Slanted { plane, .. }, Some(scale)) => plane.cut(bound, scale),
            _ => [*bound; 2],
        }
    }

    pub(crate) fn check(&self, source: &dyn Bounded) -> Result<(), Invalid> {
        let fail = |what: String| Err(Invalid(what));
        let mut times = vec![0u32; source.prim_count()];
        let (mut next_ref, mut seen, mut trouble) = (0usize, 0usize, None);
        self.each(self.bound, &mut |b, view| self.cut(b, view), &mut |view, cell, depth| {
            let mut say = |what: String| trouble = trouble.take().or(Some(what));
            match view {
                View::Axis { above, .. } | View::Slanted { above, .. } => {
                    seen += if let View::Slanted { .. } = view { WIDE } else { 1 };
                    if let View::Axis { axis, position, .. } = view
                        && !(cell.min[axis.index()] <= position && position <= cell.max[axis.index()])
                    {
                        say(format!("a plane at {position} lies outside its cell {cell:?}"));
                    }
                    if let View::Slanted { plane, .. } = view
                        && !(plane.room > 0.0 && (plane.normal.length() - 1.0).abs() < 1e-6)
                    {
                        say(format!("{plane:?} is no plane"));
                    }
                    if above >= self.nodes.len() {
                        say(format!("a child is node {above}, which is none"));
                    }
                    if depth >= MAX_DEPTH {
                        say(format!("the tree has {depth} splits on one way"));
                    }
                }
                View::Leaf { first, count } => {
                    seen += 1;
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

/// The direction of an axis.
pub(crate) fn unit_of(axis: Axis) -> DVec3 {
    DVec3::AXES[axis.index()]
}

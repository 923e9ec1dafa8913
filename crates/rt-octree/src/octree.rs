//! [`Octree`] and [`Node`]: the tree.

use crate::linear::{level, run_of};
use crate::params::{OctreeParams, Storage};
use crate::planes::{child, middle, share};
use bytemuck::{Pod, Zeroable};
use rt_accel::{Bounded, Invalid, Mailing, Sah};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

/// The greatest number of splits on a way from the root to a leaf: as many as there is room for in a Morton code of 64
/// bits.
pub const MAX_DEPTH: usize = 21;

/// Entries on the stack of a walk that opens one node after another: seven are left behind at each.
pub(crate) const STACK: usize = 7 * MAX_DEPTH + 8;

/// Marks a link to a leaf.
pub(crate) const LEAF: u32 = 1 << 31;

/// Three planes, and where its children are, in 32 bytes, two to a line of cache; its box is implied. Child `c` lies
/// above the plane of x where bit 0 of `c` is set, of y where bit 1, of z where bit 2. Inner children are consecutive
/// nodes, and leaves that are not empty consecutive leaves.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Node {
    pub(crate) planes: [f32; 3],
    /// The first inner child.
    pub(crate) nodes: u32,
    /// The first child that is a leaf.
    pub(crate) leaves: u32,
    /// Bit `c` is set where child `c` is not empty.
    pub(crate) full: u8,
    /// Bit `c` is set where child `c` is an inner node.
    pub(crate) inner: u8,
    rest: [u8; 10],
}

/// How many bits are set in a byte.
const RANK: [u8; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        table[byte] = (byte as u32).count_ones() as u8;
        byte += 1;
    }
    table
};

impl Node {
    pub(crate) fn new(planes: [f32; 3], nodes: u32, leaves: u32, full: u8, inner: u8) -> Node {
        Node { planes, nodes, leaves, full, inner, rest: [0; 10] }
    }

    /// A child that is not empty: a node, or a leaf with [`LEAF`].
    #[inline(always)]
    pub(crate) fn link(&self, c: usize) -> u32 {
        // Without branches: which of both it is a walk cannot foresee.
        let before = (1u32 << (c & 7)) - 1;
        let (full, inner) = (self.full as u32, self.inner as u32);
        let leaf = (inner >> (c & 7) & 1).wrapping_sub(1);
        let among = (inner ^ full & leaf) & before;
        let first = self.nodes ^ (self.nodes ^ self.leaves) & leaf;
        (first + RANK[among as usize & 255] as u32) | leaf & LEAF
    }
}

/// An octree with planes in `f32`, for rays of both precisions. 32 bytes a node, or none; 4 (linear: 12) a leaf that is
/// not empty, 4 a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Octree {
    pub(crate) origin: DVec3,
    pub(crate) bound: Aabb,
    /// A box around all finite coordinates.
    pub(crate) core: Aabb,
    /// The root first, depth first but for siblings, which are together. None where the root is a leaf, or by
    /// [`Storage::Linear`].
    pub(crate) nodes: Vec<Node>,
    /// The Morton code of each leaf, ascending; only by [`Storage::Linear`].
    pub(crate) keys: Vec<u64>,
    /// Where the references of each leaf that is not empty begin; one more, where the last ends. By
    /// [`Storage::Linear`] in the order of their Morton codes, else in that of their nodes.
    pub(crate) starts: Vec<u32>,
    pub(crate) prims: Vec<u32>,
    pub(crate) skipped: Vec<u32>,
    /// How many primitives are in the tree.
    pub(crate) held: usize,
    pub(crate) repeats: bool,
    pub(crate) mailing: Mailing,
    pub(crate) sah: Sah,
    pub(crate) storage: Storage,
}

/// What a tree is made of, as the literature counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Inner nodes.
    pub splits: usize,
    /// Leaves with primitives.
    pub leaves: usize,
    /// Leaves without.
    pub empty_leaves: usize,
    /// Primitives in the tree.
    pub prims: usize,
    /// Primitives in leaves, each as often as it stands in one.
    pub references: usize,
    /// The largest leaf.
    pub largest_leaf: usize,
    /// How many leaves have `i` primitives; in the last place, how many have more.
    pub occupancy: [usize; 18],
    /// Splits on the longest way.
    pub depth: usize,
    /// Splits on the way to a leaf with primitives, on average.
    pub mean_depth: f64,
    /// Nodes, leaves with primitives, and tests that a line through the bound meets on average, uniform and stopped by
    /// nothing: sums of surface areas over the bound's.
    ///
    /// Source: MacDonald and Booth, "Heuristics for ray tracing using space subdivision", The Visual Computer 6 (1990).
    pub expected: [f64; 3],
}

/// A node, by either storage.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    Link(u32),
    Run(Run),
}

/// A node as the leaves under it: numbers `first..last`, whose Morton codes share `level` digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub(crate) first: u32,
    pub(crate) last: u32,
    pub(crate) prefix: u64,
    pub(crate) level: u32,
}

/// What a node is.
#[expect(clippy::large_enum_variant, reason = "it lives for a moment, on the stack")]
pub(crate) enum View {
    Leaf(u32),
    Split { planes: [f32; 3], children: [Option<Place>; 8] },
}

impl Octree {
    /// The nodes, the root first: `bytemuck` casts them to bytes. None when the root is a leaf, and none by
    /// [`Storage::Linear`].
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The Morton codes of the leaves that are not empty, ascending, by [`Storage::Linear`]: the numbers of the
    /// children on the way to the leaf, three bits each from the highest on, and a 1 behind them.
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }

    /// The primitive numbers that leaves refer to.
    pub fn references(&self) -> &[u32] {
        &self.prims
    }

    /// The primitives of a leaf, and the name they go by; nothing of a leaf that is none.
    #[inline(always)]
    pub(crate) fn leaf(&self, number: u32) -> (u32, &[u32]) {
        match self.starts.get(number as usize..number as usize + 2) {
            Some(&[first, end]) => (first, self.prims.get(first as usize..end as usize).unwrap_or(&[])),
            _ => (0, &[]),
        }
    }

    pub(crate) fn root(&self) -> Option<Place> {
        let leaves = self.starts.len().saturating_sub(1) as u32;
        if leaves == 0 {
            return None;
        }
        Some(match self.storage {
            Storage::Linear => Place::Run(Run { first: 0, last: leaves, prefix: 0, level: 0 }),
            Storage::Nodes if self.nodes.is_empty() => Place::Link(LEAF),
            Storage::Nodes => Place::Link(0),
        })
    }

    /// What a node with this cell is.
    pub(crate) fn view(&self, place: Place, cell: &Aabb) -> View {
        match place {
            Place::Link(link) if link & LEAF != 0 => View::Leaf(link & !LEAF),
            Place::Link(link) => {
                let Some(node) = self.nodes.get(link as usize) else { return View::Leaf(!LEAF) };
                let children =
                    core::array::from_fn(|c| (node.full >> c & 1 == 1).then(|| Place::Link(node.link(c))));
                View::Split { planes: node.planes, children }
            }
            Place::Run(run) => {
                if run.last - run.first == 1 && level(self.keys[run.first as usize]) <= run.level {
                    return View::Leaf(run.first);
                }
                let children = core::array::from_fn(|c| run_of(&self.keys, &run, c as u64).map(Place::Run));
                View::Split { planes: middle(cell, &self.core), children }
            }
        }
    }

    /// What the tree is made of. `O(n)`.
    pub fn statistics(&self) -> Statistics {
        let mut s = Statistics { prims: self.held, ..Statistics::default() };
        let mut depths = 0usize;
        self.each(&mut |view, cell, depth| {
            let share = share(cell, &self.bound);
            s.depth = s.depth.max(depth);
            match view {
                View::Split { children, .. } => {
                    s.splits += 1;
                    s.empty_leaves += children.iter().filter(|child| child.is_none()).count();
                    s.expected[0] += share;
                }
                View::Leaf(number) => {
                    let count = self.leaf(*number).1.len();
                    s.leaves += 1;
                    s.references += count;
                    s.largest_leaf = s.largest_leaf.max(count);
                    s.occupancy[count.min(17)] += 1;
                    depths += depth;
                    s.expected[1] += share;
                    s.expected[2] += share * count as f64;
                }
            }
        });
        s.occupancy[0] = s.empty_leaves;
        s.mean_depth = if s.leaves > 0 { depths as f64 / s.leaves as f64 } else { 0.0 };
        s
    }

    /// The expected cost of a line through the bound by the surface area heuristic, in the unit of the build's [`Sah`]:
    /// for nodes and leaves visited, and tests. `O(n)`.
    pub fn sah_cost(&self) -> f64 {
        let [splits, leaves, tests] = self.statistics().expected;
        self.sah.traverse as f64 * (splits + leaves) + self.sah.intersect as f64 * tests
    }

    /// Calls `see` for every node and every leaf that is not empty, with its cell and the number of splits above, depth
    /// first.
    pub(crate) fn each(&self, see: &mut dyn FnMut(&View, &Aabb, usize)) {
        let mut stack: Vec<(Place, Aabb, usize)> =
            self.root().map(|root| (root, self.bound, 0)).into_iter().collect();
        while let Some((place, cell, depth)) = stack.pop() {
            let view = self.view(place, &cell);
            see(&view, &cell, depth);
            if let View::Split { planes, children } = view
                && depth < MAX_DEPTH
            {
                for (c, place) in children.into_iter().enumerate().rev() {
                    stack.extend(place.map(|place| (place, child(&cell, planes, c), depth + 1)));
                }
            }
        }
    }

    pub(crate) fn check(&self, source: &dyn Bounded) -> Result<(), Invalid> {
        let fail = |what: String| Err(Invalid(what));
        let leaves = self.starts.len().saturating_sub(1);
        if self.starts.windows(2).any(|pair| pair[0] >= pair[1])
            || self.starts.last().map_or(0, |end| *end as usize) != self.prims.len()
        {
            return fail("leaves do not take the references one after another".to_string());
        }
        if self.storage == Storage::Linear
            && (self.keys.len() != leaves || !self.keys.is_sorted_by(|a, b| a < b))
        {
            return fail(format!("{} keys of {leaves} leaves do not ascend", self.keys.len()));
        }
        let mut times = vec![0u32; source.prim_count()];
        let mut seen = vec![false; leaves];
        let (mut found, mut splits, mut trouble) = (0usize, 0usize, None);
        self.each(&mut |view, cell, depth| {
            let mut say = |what: String| trouble = trouble.take().or(Some(what));
            match view {
                View::Split { planes, children } => {
                    splits += 1;
                    for a in 0..3 {
                        if !(cell.min[a] <= planes[a] && planes[a] <= cell.max[a]) {
                            say(format!("a plane at {} lies outside its cell {cell:?}", planes[a]));
                        }
                    }
                    if depth >= MAX_DEPTH {
                        say(format!("the tree has more than {depth} splits on one way"));
                    }
                    if children.iter().all(|child| child.is_none()) {
                        say(format!("the node of {cell:?} is empty"));
                    }
                }
                View::Leaf(number) => {
                    found += 1;
                    if seen.get_mut(*number as usize).is_none_or(|seen| core::mem::replace(seen, true)) {
                        say(format!("leaf {number} is none, or hangs in two places"));
                    }
                    for &prim in self.leaf(*number).1 {
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
        if found != leaves || self.storage == Storage::Nodes && splits != self.nodes.len() {
            return fail(format!("{splits} nodes and {found} leaves hang in the tree"));
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

impl Octree {
    /// A tree without anything in it.
    pub(crate) fn empty(params: &OctreeParams) -> Octree {
        Octree {
            origin: DVec3::ZERO,
            bound: Aabb::EMPTY,
            core: Aabb::EMPTY,
            nodes: Vec::new(),
            keys: Vec::new(),
            starts: Vec::new(),
            prims: Vec::new(),
            skipped: Vec::new(),
            held: 0,
            repeats: false,
            mailing: Mailing::None,
            sah: params.sah,
            storage: params.storage,
        }
    }
}

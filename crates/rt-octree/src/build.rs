//! The build: cells split in eight while it pays, or while there is too much in them.

use crate::linear::keys;
use crate::octree::{LEAF, Node, Octree};
use crate::params::{OctreeParams, Split, Stop, Storage};
use crate::planes::{Bins, Part, child, middle, share};
use rt_accel::{
    Bounded, Boxes, BuildError, Clip, HashedMailbox, Invalid, InverseMailbox, Leaf, Mailing, NoMailbox,
    Structure, Visitor, Watch,
};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real};

/// Cells with up to this many references are built by one thread, away from the others, and larger ones looked at in
/// pieces of so many: fixed, so that the tree does not depend on the number of threads.
const ALONE: usize = 1 << 13;

impl Structure for Octree {
    type Params = OctreeParams;

    fn build_watched(
        source: &dyn Bounded,
        params: &OctreeParams,
        watch: Watch<'_>,
    ) -> Result<Octree, BuildError> {
        params.check()?;
        let len = source.prim_count();
        let max = LEAF as usize - 1;
        if len > max {
            return Err(BuildError::TooManyPrimitives { len, max });
        }
        // Boxes, twice over while they are dealt out.
        let needed = len.saturating_mul(2 * size_of::<Part>() + size_of::<u32>());
        if let Some(limit) = params.memory_limit.filter(|&limit| needed > limit) {
            return Err(BuildError::OutOfMemory { needed, limit });
        }
        if watch(0.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        let Boxes { origin, prims: parts, skipped, world } = Boxes::read(source)?;
        let held = parts.len();
        let core = finite(parts.iter().map(|(_, part)| part));
        let mut octree = Octree { origin, bound: world, core, skipped, held, ..Octree::empty(params) };
        if !parts.is_empty() {
            let splitter =
                Splitter { source, params, origin, core: &octree.core, max_depth: params.depth(held) };
            let tree = splitter.tree(parts, world, watch)?;
            octree.repeats = tree.prims.len() > held;
            octree.mailing = if octree.repeats { params.mailing } else { Mailing::None };
            match params.storage {
                Storage::Nodes => {
                    // Once more as large, or nearly.
                    splitter.within_limit(2 * tree.bytes())?;
                    (octree.nodes, octree.starts, octree.prims) = packed(&tree);
                }
                Storage::Linear => {
                    octree.keys = keys(&tree.nodes, tree.starts.len() - 1);
                    (octree.starts, octree.prims) = (tree.starts, tree.prims);
                }
            }
        }
        if watch(1.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        Ok(octree)
    }

    fn origin(&self) -> DVec3 {
        self.origin
    }

    fn local_bound(&self) -> Aabb {
        self.bound
    }

    fn skipped(&self) -> &[u32] {
        &self.skipped
    }

    fn repeats(&self) -> bool {
        self.repeats
    }

    fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + self.keys.capacity() * size_of::<u64>()
            + (self.starts.capacity() + self.prims.capacity() + self.skipped.capacity()) * size_of::<u32>()
    }

    #[inline]
    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        match self.mailing {
            Mailing::None => self.walk::<R, NoMailbox>(ray, visit),
            Mailing::Hashed => self.walk::<R, HashedMailbox<16>>(ray, visit),
            Mailing::Inverse => self.walk::<R, InverseMailbox<8>>(ray, visit),
        }
    }

    fn gather(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        self.gather_under(keep, each);
    }

    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid> {
        self.check(prims)
    }
}

/// Three planes and eight links, while they are made.
#[derive(Clone, Copy)]
pub(crate) struct Draft {
    pub(crate) planes: [f32; 3],
    /// Bit `c` is set where child `c` is not empty.
    pub(crate) full: u8,
    /// Nodes, or leaves with [`LEAF`]; 0 for an empty child.
    pub(crate) links: [u32; 8],
}

/// A finished part of a tree; its nodes, leaves and references numbered from 0, depth first.
#[derive(Default)]
struct Tree {
    nodes: Vec<Draft>,
    starts: Vec<u32>,
    prims: Vec<u32>,
}

impl Tree {
    fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Draft>() + (self.starts.len() + self.prims.len()) * size_of::<u32>()
    }
}

/// A cell still to be split.
struct Task {
    cell: Aabb,
    parts: Vec<Part>,
    depth: u32,
    bad: u32,
    /// How many references may come of it.
    most: f64,
}

/// A cell split.
struct Halved {
    planes: [f32; 3],
    /// Children that are not empty, and which share of the lines through the cell meets each.
    children: [Option<(Task, f64)>; 8],
}

/// The top of a tree while parts are built apart.
enum Top {
    Split { planes: [f32; 3], children: [Option<usize>; 8] },
    Part(usize),
}

struct Splitter<'a> {
    source: &'a dyn Bounded,
    params: &'a OctreeParams,
    origin: DVec3,
    core: &'a Aabb,
    max_depth: u32,
}

impl Splitter<'_> {
    fn tree(&self, parts: Vec<Part>, cell: Aabb, watch: Watch<'_>) -> Result<Tree, BuildError> {
        let count = parts.len();
        let most = self.params.most_references as f64 * count as f64;
        let root = Task { cell, parts, depth: 0, bad: 0, most };
        // The top here, down to cells that one thread builds alone.
        let mut top = Vec::new();
        let mut parts = Vec::new();
        let mut tasks = vec![(root, None::<(usize, usize)>)];
        let work = (count as f32 / ALONE as f32).max(2.0).log2() * count as f32;
        let (mut done, mut held) = (0.0, count);
        while let Some((task, hangs)) = tasks.pop() {
            let here = top.len();
            if let Some((parent, c)) = hangs
                && let Some(Top::Split { children, .. }) = top.get_mut(parent)
            {
                children[c] = Some(here);
            }
            let large = task.parts.len() > ALONE;
            if large {
                done += task.parts.len() as f32 * 0.5 / work;
                if watch(done.min(0.5)).is_break() {
                    return Err(BuildError::Cancelled);
                }
            }
            match if large { self.halved(&task) } else { None } {
                None => {
                    top.push(Top::Part(parts.len()));
                    parts.push(task);
                }
                Some(Halved { planes, children }) => {
                    top.push(Top::Split { planes, children: [None; 8] });
                    held -= task.parts.len();
                    for (c, child) in children.into_iter().enumerate().rev() {
                        if let Some((child, _)) = child {
                            held += child.parts.len();
                            tasks.push((child, Some((here, c))));
                        }
                    }
                    self.within_limit(held * size_of::<Part>())?;
                }
            }
        }
        // The parts, some at a time, on all cores.
        let total = parts.len();
        let mut built = Vec::with_capacity(total);
        let mut waiting = parts.into_iter();
        let mut finished = 0;
        loop {
            let batch: Vec<Task> = waiting.by_ref().take(16).collect();
            if batch.is_empty() {
                break;
            }
            held -= batch.iter().map(|task| task.parts.len()).sum::<usize>();
            let others = held * size_of::<Part>() + finished;
            for part in grow(batch, |task| {
                let mut tree = Tree::default();
                self.grown(task, &mut tree, others).map(|(root, _)| (tree, root))
            }) {
                let part = part?;
                finished += part.0.bytes();
                built.push(part);
            }
            self.within_limit(held * size_of::<Part>() + finished)?;
            if watch((0.5 + 0.5 * built.len() as f32 / total as f32).min(0.999)).is_break() {
                return Err(BuildError::Cancelled);
            }
        }
        assemble(&top, built)
    }

    /// Builds what is in a cell onto a tree; its link, and what it costs a ray that meets the cell. `others` is how
    /// many bytes are in use elsewhere. As deep as the tree.
    fn grown(&self, task: Task, tree: &mut Tree, others: usize) -> Result<(u32, f64), BuildError> {
        let price = self.leaf_price(task.parts.len());
        if let Some(Halved { planes, children }) = self.halved(&task) {
            let (here, leaves, refs) = (tree.nodes.len(), tree.starts.len(), tree.prims.len());
            tree.nodes.push(Draft { planes, full: 0, links: [0; 8] });
            let others = others + task.parts.len() * size_of::<Part>();
            self.within_limit(others + tree.bytes())?;
            let mut cost = self.params.sah.traverse as f64;
            for (c, child) in children.into_iter().enumerate() {
                let Some((child, share)) = child else { continue };
                let (link, below) = self.grown(child, tree, others)?;
                cost += share * below;
                tree.nodes[here].full |= 1 << c;
                tree.nodes[here].links[c] = link;
            }
            if self.params.stop == Stop::Count || cost < price {
                return Ok((here as u32, cost));
            }
            tree.nodes.truncate(here);
            tree.starts.truncate(leaves);
            tree.prims.truncate(refs);
        }
        let leaf = tree.starts.len() as u32;
        tree.starts.push(tree.prims.len() as u32);
        // In ascending order: parts are dealt out in it.
        tree.prims.extend(task.parts.iter().map(|(prim, _)| *prim));
        Ok((leaf | LEAF, price))
    }

    fn leaf_price(&self, count: usize) -> f64 {
        self.params.sah.traverse as f64 + self.params.sah.intersect as f64 * count as f64
    }

    /// Splits a cell, if it shall be.
    fn halved(&self, task: &Task) -> Option<Halved> {
        let count = task.parts.len();
        if task.depth >= self.max_depth || count <= self.params.max_prims as usize {
            return None;
        }
        let ahead = match self.params.stop {
            Stop::Count => u32::MAX,
            // What does not pay is not undone in the top.
            Stop::Cost { .. } if count > ALONE => 0,
            Stop::Cost { ahead } => ahead,
        };
        let centre = middle(&task.cell, self.core);
        let mut planes = match self.params.split {
            Split::Centre => centre,
            Split::Cost => self.cheapest(task),
        };
        let upper = task.cell.max.to_array();
        if planes == upper && task.bad < ahead {
            planes = centre;
        }
        if planes == upper {
            return None;
        }
        let dealt = self.dealt(task, planes)?;
        let total = dealt.iter().map(Vec::len).sum::<usize>();
        let cells: [Aabb; 8] = core::array::from_fn(|c| child(&task.cell, planes, c));
        let shares = cells.map(|cell| share(&cell, &task.cell));
        let mut cost = self.params.sah.traverse as f64;
        for (share, parts) in shares.iter().zip(&dealt) {
            if !parts.is_empty() {
                cost += share * self.leaf_price(parts.len());
            }
        }
        let bad = task.bad + (cost >= self.leaf_price(count)) as u32;
        if bad > ahead {
            return None;
        }
        let mut c = 0;
        let children = dealt.map(|parts| {
            let (cell, share) = (cells[c], shares[c]);
            c += 1;
            let most = task.most * parts.len() as f64 / total.max(1) as f64;
            let child = Task { cell, parts, depth: task.depth + 1, bad, most };
            (!child.parts.is_empty()).then_some((child, share))
        });
        Some(Halved { planes, children })
    }

    /// The planes that the surface area heuristic chooses: first the best along any axis, then the best along another
    /// with that one in place, then along the third; then the first two once more, with the others in place.
    fn cheapest(&self, task: &Task) -> [f32; 3] {
        let core = finite(task.parts.iter().map(|(_, part)| part));
        let mut planes = task.cell.max.to_array();
        let mut left = [0, 1, 2].map(Some);
        let mut order = [0; 3];
        for i in 0..3 {
            let mut best = None::<(usize, f32, f64)>;
            for a in left.into_iter().flatten() {
                let (plane, cost) = self.best_along(task, a, &core, planes);
                if best.is_none_or(|best| cost < best.2) {
                    best = Some((a, plane, cost));
                }
            }
            let Some((a, plane, _)) = best else { break };
            (planes[a], order[i], left[a]) = (plane, a, None);
        }
        for i in 0..2 {
            // Where nothing else was placed since, nothing has changed.
            if order[i + 1..].iter().any(|a| planes[*a] != task.cell.max[*a]) {
                planes[order[i]] = self.best_along(task, order[i], &core, planes).0;
            }
        }
        planes
    }

    fn best_along(&self, task: &Task, axis: usize, core: &Aabb, planes: [f32; 3]) -> (f32, f64) {
        let mut bins = Bins::new(axis, task.parts.len(), core, planes);
        if task.parts.len() <= ALONE {
            bins.count(&task.parts);
        } else {
            let empty = bins.clone();
            let counted = |parts: &[Part]| {
                let mut bins = empty.clone();
                bins.count(parts);
                bins
            };
            grow(task.parts.chunks(ALONE).collect(), counted).iter().for_each(|some| bins.add(some));
        }
        bins.cheapest(&task.cell, self.params)
    }

    /// Deals the parts of a cell out to its children, unless there come too many of it.
    fn dealt(&self, task: &Task, planes: [f32; 3]) -> Option<[Vec<Part>; 8]> {
        let mut all: [Vec<Part>; 8] = Default::default();
        let mut total = 0;
        for some in task.parts.chunks(16 * ALONE) {
            let pieces = some.chunks(ALONE).collect();
            for mut dealt in grow(pieces, |parts| self.deal(&task.cell, planes, parts)) {
                total += dealt.iter().map(Vec::len).sum::<usize>();
                for (all, some) in all.iter_mut().zip(&mut dealt) {
                    if all.is_empty() {
                        core::mem::swap(all, some);
                    } else {
                        all.append(some);
                    }
                }
            }
            if total as f64 > task.most {
                return None;
            }
        }
        Some(all)
    }

    fn deal(&self, cell: &Aabb, planes: [f32; 3], parts: &[Part]) -> [Vec<Part>; 8] {
        let mut children: [Vec<Part>; 8] = Default::default();
        let at = Vec3A::from_array(planes);
        for &(prim, part) in parts {
            // What ends at a plane is below it, what begins there and ends above is above.
            let under = part.max.cmple(at);
            let above = !under & part.min.cmpge(at);
            let (under, above) = (under.bitmask() as usize, above.bitmask() as usize);
            let both = !(under | above) & 7;
            if both == 0 {
                children[above].push((prim, part));
                continue;
            }
            for c in (0..8).filter(|c| c & !both == above) {
                let cell = child(cell, planes, c);
                let reaches = match self.params.clip {
                    Clip::Exact => self.source.clipped_bound(prim, &cell, self.origin).overlap(part),
                    Clip::Box => part,
                };
                let reaches = reaches.overlap(cell);
                if reaches.is_valid() {
                    children[c].push((prim, reaches));
                }
            }
        }
        children
    }

    fn within_limit(&self, needed: usize) -> Result<(), BuildError> {
        match self.params.memory_limit {
            Some(limit) if needed > limit => Err(BuildError::OutOfMemory { needed, limit }),
            _ => Ok(()),
        }
    }
}

/// A box around the finite coordinates of some boxes; empty along an axis where there are none.
fn finite<'b>(boxes: impl Iterator<Item = &'b Aabb>) -> Aabb {
    let mut all = Aabb::EMPTY;
    for b in boxes {
        for corner in [b.min, b.max] {
            let finite = corner.abs().cmple(Vec3A::splat(f32::MAX));
            all.min = Vec3A::select(finite, all.min.min(corner), all.min);
            all.max = Vec3A::select(finite, all.max.max(corner), all.max);
        }
    }
    all
}

/// Top and parts as one tree, depth first.
fn assemble(top: &[Top], parts: Vec<(Tree, u32)>) -> Result<Tree, BuildError> {
    let sum = |len: fn(&Tree) -> usize| parts.iter().map(|(tree, _)| len(tree)).sum::<usize>();
    let nodes = sum(|tree| tree.nodes.len()) + top.len();
    let (leaves, refs) = (sum(|tree| tree.starts.len()), sum(|tree| tree.prims.len()));
    let most = LEAF as usize - 1;
    if nodes.max(leaves) > most || refs >= u32::MAX as usize {
        return Err(BuildError::TooManyPrimitives { len: nodes.max(refs), max: most });
    }
    let mut tree = Tree {
        nodes: Vec::with_capacity(nodes),
        starts: Vec::with_capacity(leaves + 1),
        prims: Vec::with_capacity(refs),
    };
    let mut parts: Vec<Option<(Tree, u32)>> = parts.into_iter().map(Some).collect();
    let mut stack = vec![(0usize, None::<(usize, usize)>)];
    while let Some((at, hangs)) = stack.pop() {
        let nodes = tree.nodes.len() as u32;
        let link = match &top[at] {
            Top::Split { planes, children } => {
                tree.nodes.push(Draft { planes: *planes, full: 0, links: [0; 8] });
                for (c, child) in children.iter().enumerate().rev() {
                    stack.extend(child.map(|child| (child, Some((nodes as usize, c)))));
                }
                nodes
            }
            Top::Part(part) => {
                let Some((part, root)) = parts[*part].take() else { continue };
                let (leaves, refs) = (tree.starts.len() as u32, tree.prims.len() as u32);
                let moved = |link: u32| link + if link & LEAF != 0 { leaves } else { nodes };
                tree.nodes.extend(part.nodes.iter().map(|node| {
                    let links = core::array::from_fn(|c| match node.full >> c & 1 {
                        1 => moved(node.links[c]),
                        _ => 0,
                    });
                    Draft { links, ..*node }
                }));
                tree.starts.extend(part.starts.iter().map(|start| start + refs));
                tree.prims.extend(part.prims);
                moved(root)
            }
        };
        if let Some((parent, c)) = hangs {
            tree.nodes[parent].full |= 1 << c;
            tree.nodes[parent].links[c] = link;
        }
    }
    tree.starts.push(tree.prims.len() as u32);
    Ok(tree)
}

/// Nodes with siblings together, where the leaves of each begin and their references, in the order of the nodes.
fn packed(tree: &Tree) -> (Vec<Node>, Vec<u32>, Vec<u32>) {
    let mut nodes = Vec::with_capacity(tree.nodes.len());
    let mut starts = Vec::with_capacity(tree.starts.len());
    let mut prims = Vec::with_capacity(tree.prims.len());
    let mut leaf = |number: usize, starts: &mut Vec<u32>| {
        starts.push(prims.len() as u32);
        prims.extend_from_slice(&tree.prims[tree.starts[number] as usize..tree.starts[number + 1] as usize]);
    };
    if tree.nodes.is_empty() {
        leaf(0, &mut starts);
    } else {
        nodes.push(Node::new([0.0; 3], 0, 0, 0, 0));
    }
    // Drafts, and where they go.
    let mut stack: Vec<(u32, usize)> = nodes.iter().map(|_| (0, 0)).collect();
    while let Some((at, to)) = stack.pop() {
        let Draft { planes, full, links } = tree.nodes[at as usize];
        let (first, leaves) = (nodes.len(), starts.len() as u32);
        let mut inner = 0u8;
        for (c, link) in links.into_iter().enumerate().filter(|(c, _)| full >> c & 1 == 1) {
            if link & LEAF != 0 {
                leaf((link & !LEAF) as usize, &mut starts);
            } else {
                inner |= 1 << c;
                nodes.push(Node::new([0.0; 3], 0, 0, 0, 0));
            }
        }
        nodes[to] = Node::new(planes, first as u32, leaves, full, inner);
        for (i, c) in (0..8).filter(|c| inner >> c & 1 == 1).enumerate() {
            stack.push((links[c], first + i));
        }
        // The first child's part comes next.
        let pushed = stack.len() - inner.count_ones() as usize;
        stack[pushed..].reverse();
    }
    starts.push(prims.len() as u32);
    (nodes, starts, prims)
}

/// Does some work for each item, on all cores where that is enabled; results in order.
#[cfg(feature = "parallel")]
fn grow<T: Send, U: Send>(items: Vec<T>, work: impl Fn(T) -> U + Sync + Send) -> Vec<U> {
    use rayon::prelude::*;
    if items.len() < 2 {
        return items.into_iter().map(work).collect();
    }
    items.into_par_iter().map(work).collect()
}

#[cfg(not(feature = "parallel"))]
fn grow<T, U>(items: Vec<T>, work: impl Fn(T) -> U) -> Vec<U> {
    items.into_iter().map(work).collect()
}

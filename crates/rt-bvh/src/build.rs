//! The build: a work list of ranges, split by the surface area heuristic until leaves are cheaper.

use crate::node::{Bvh, Child, MAX_DEPTH, Node, area};
use core::ops::Range;
use rt_accel::{Bounded, Boxes, BuildError, Invalid, Leaf, Sah, Structure, Visitor, Watch};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Axis, Ray, Real};

/// How a range of primitives is split in two.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Builder {
    /// At the best of `bins - 1` planes an axis, `bins` in `2..=64`: `O(n log n)`, within a few per cent of the best split.
    ///
    /// Source: Wald, "On fast construction of SAH-based bounding volume hierarchies", RT 2007.
    Binned {
        /// Bins an axis. More cost build time and win little trace time.
        bins: u32,
    },
}

/// The knobs of a [`Bvh`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhParams {
    /// How ranges are split.
    pub builder: Builder,
    /// What opening a node and testing a primitive cost.
    pub sah: Sah,
    /// The largest leaf, in `1..=255`. Larger leaves save memory and build time and cost tests.
    pub leaf_prims: u32,
    /// Ranges of up to this many primitives are split at the best of all planes instead of bins, in `0..=256`.
    pub sweep_below: u32,
    /// Bytes the build may use, working memory included; `None` is no limit.
    pub memory_limit: Option<usize>,
}

impl Default for BvhParams {
    fn default() -> BvhParams {
        BvhParams {
            builder: Builder::Binned { bins: 32 },
            sah: Sah { traverse: 1.0, intersect: 1.0 },
            leaf_prims: 8,
            sweep_below: 24,
            memory_limit: None,
        }
    }
}

impl BvhParams {
    fn check(&self) -> Result<u32, BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        let Builder::Binned { bins } = self.builder;
        if !(2..=MAX_BINS as u32).contains(&bins) {
            return bad("builder.bins", "must lie in 2..=64");
        }
        if !(1..=255).contains(&self.leaf_prims) {
            return bad("leaf_prims", "must lie in 1..=255");
        }
        if self.sweep_below > MAX_SWEEP as u32 {
            return bad("sweep_below", "must lie in 0..=256");
        }
        if !(self.sah.traverse >= 0.0 && self.sah.traverse.is_finite()) {
            return bad("sah.traverse", "must be finite and not negative");
        }
        if !(self.sah.intersect > 0.0 && self.sah.intersect.is_finite()) {
            return bad("sah.intersect", "must be finite and positive");
        }
        Ok(bins)
    }
}

const MAX_BINS: usize = 64;
const MAX_SWEEP: usize = 256;
/// Ranges up to this size are built by one thread, away from the others: large enough to be worth handing over, and fixed, so
/// that the tree does not depend on the number of threads.
const ALONE: usize = 1 << 14;

/// One primitive on its way into a leaf.
#[derive(Clone, Copy, Debug)]
struct Reference {
    bound: Aabb,
    center: Vec3A,
    prim: u32,
}

impl Structure for Bvh {
    type Params = BvhParams;

    fn build_watched(source: &dyn Bounded, params: &BvhParams, watch: Watch<'_>) -> Result<Bvh, BuildError> {
        let bins = params.check()?;
        let needed = source.prim_count().saturating_mul(
            size_of::<(u32, Aabb)>() + size_of::<Reference>() + size_of::<Node>() + size_of::<u32>(),
        );
        if let Some(limit) = params.memory_limit.filter(|&limit| needed > limit) {
            return Err(BuildError::OutOfMemory { needed, limit });
        }
        if watch(0.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        let Boxes { origin, prims, skipped, world } = Boxes::read(source)?;
        let mut refs: Vec<Reference> =
            prims.iter().map(|&(prim, bound)| Reference { bound, center: bound.center(), prim }).collect();
        drop(prims);
        let splitter = Splitter { bins: bins as usize, params };
        let nodes = if refs.is_empty() { Vec::new() } else { splitter.tree(&mut refs, world, watch)? };
        let mut bvh = Bvh {
            origin,
            bound: world,
            nodes,
            prims: refs.iter().map(|r| r.prim).collect(),
            skipped,
            sah: params.sah,
            built_cost: 0.0,
        };
        bvh.built_cost = bvh.sah_cost();
        if watch(1.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        Ok(bvh)
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
        false
    }

    fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>()
            + (self.prims.capacity() + self.skipped.capacity()) * size_of::<u32>()
    }

    #[inline]
    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        self.walk::<R, false>(ray, visit);
    }

    #[inline]
    fn traverse_any<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        self.walk::<R, true>(ray, visit);
    }

    fn gather(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        self.gather_under(keep, each);
    }

    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid> {
        self.check(prims)
    }
}

/// A range still to be split, and the slot of the node it hangs in.
struct Task {
    range: Range<usize>,
    bound: Aabb,
    /// Nodes above.
    depth: usize,
    parent: usize,
    side: usize,
}

struct Splitter<'a> {
    bins: usize,
    params: &'a BvhParams,
}

impl Splitter<'_> {
    /// The nodes over all references, which end up in leaf order.
    fn tree(&self, refs: &mut [Reference], world: Aabb, watch: Watch<'_>) -> Result<Vec<Node>, BuildError> {
        let total = refs.len();
        let work = total as f32 * (total as f32 / ALONE as f32).max(2.0).log2();
        let mut done = 0.0;
        let mut report = |more: usize, share: f32| {
            done += more as f32 * share / work;
            if watch(done.min(0.999)).is_break() { Err(BuildError::Cancelled) } else { Ok(()) }
        };
        // A holder for the root while it grows.
        let mut nodes = vec![Node::blank()];
        // The top of the tree here, down to ranges that one thread builds alone.
        let mut top = vec![Task { range: 0..total, bound: world, depth: 0, parent: 0, side: 0 }];
        let mut alone = Vec::new();
        while let Some(task) = top.pop() {
            if task.range.len() <= ALONE {
                alone.push(task);
            } else {
                report(task.range.len(), 0.5)?;
                self.split_task(&task, refs, &mut nodes, &mut top);
            }
        }
        // They were met left to right: each is the next slice.
        let mut slices = Vec::with_capacity(alone.len());
        let mut rest = refs;
        for task in alone {
            let (slice, after) = rest.split_at_mut(task.range.len());
            slices.push((task, slice));
            rest = after;
        }
        while !slices.is_empty() {
            let batch = slices.drain(..slices.len().min(16)).collect();
            for (task, subtree) in grow(batch, |(task, slice)| {
                let nodes = self.subtree(slice, &task);
                (task, nodes)
            }) {
                let (before, first) = (nodes.len() as u32 - 1, task.range.start as u32);
                let holder = subtree[0].shifted(before, first);
                nodes[task.parent].set_child(task.side, holder.child(0));
                nodes.extend(subtree[1..].iter().map(|node| node.shifted(before, first)));
                report(task.range.len(), 0.5)?;
            }
        }
        if nodes[0].child(0).is_leaf() {
            nodes[0].set_boxes(&world, &Aabb::EMPTY);
        } else {
            nodes.remove(0);
            for node in &mut nodes {
                *node = node.shifted(u32::MAX, 0); // one less
            }
        }
        Ok(nodes)
    }

    /// The nodes over `refs`, their root hung left in a holder, numbered from 0; references too.
    fn subtree(&self, refs: &mut [Reference], task: &Task) -> Vec<Node> {
        let mut nodes = Vec::with_capacity(refs.len() / 2 + 2);
        nodes.push(Node::blank());
        let mut tasks = vec![Task { range: 0..refs.len(), parent: 0, side: 0, ..*task }];
        while let Some(task) = tasks.pop() {
            self.split_task(&task, refs, &mut nodes, &mut tasks);
        }
        nodes
    }

    /// Makes a leaf of a range, or a node with two more ranges to split.
    fn split_task(&self, task: &Task, refs: &mut [Reference], nodes: &mut Vec<Node>, tasks: &mut Vec<Task>) {
        let slice = &mut refs[task.range.clone()];
        let Some((middle, left, right)) = self.split(slice, &task.bound, task.depth) else {
            nodes[task.parent].set_child(task.side, Child::leaf(task.range.start, slice.len()));
            return;
        };
        let index = nodes.len();
        let mut node = Node::blank();
        node.set_boxes(&left, &right);
        nodes.push(node);
        nodes[task.parent].set_child(task.side, Child::node(index));
        let middle = task.range.start + middle;
        let depth = task.depth + 1;
        tasks.push(Task { range: middle..task.range.end, bound: right, depth, parent: index, side: 1 });
        tasks.push(Task { range: task.range.start..middle, bound: left, depth, parent: index, side: 0 });
    }

    /// Reorders a range and says where its right part begins, with both bounds; `None` to leave it a leaf.
    fn split(&self, refs: &mut [Reference], bound: &Aabb, depth: usize) -> Option<(usize, Aabb, Aabb)> {
        let len = refs.len();
        let leaf_prims = self.params.leaf_prims as usize;
        if len <= 1 {
            return None;
        }
        // Below here there must be room for a balanced tree.
        let levels = len.div_ceil(leaf_prims).next_power_of_two().trailing_zeros() as usize;
        if depth + levels + 2 >= MAX_DEPTH {
            return (len > leaf_prims).then(|| self.halve(refs));
        }
        let plane = if len <= self.params.sweep_below as usize { sweep(refs) } else { self.bin(refs) };
        let leaf_cost = self.params.sah.intersect as f64 * len as f64 * area(bound);
        match plane {
            Some((cost, plane)) => {
                let cost =
                    self.params.sah.traverse as f64 * area(bound) + self.params.sah.intersect as f64 * cost;
                if len <= leaf_prims && cost >= leaf_cost {
                    return None;
                }
                let middle = partition(refs, |r| plane.left(r));
                if middle == 0 || middle == len {
                    return Some(self.halve(refs));
                }
                let (left, right) = refs.split_at(middle);
                Some((middle, bound_of(left), bound_of(right)))
            }
            None => (len > leaf_prims).then(|| self.halve(refs)),
        }
    }

    /// The best plane between bins: its cost in primitives times area, and the plane.
    fn bin(&self, refs: &[Reference]) -> Option<(f64, Plane)> {
        let centers = centers_of(refs);
        let bins = self.bins;
        let size = centers.size();
        let scale = Vec3A::splat(bins as f32 * (1.0 - 1e-6)) / size;
        let usable = Axis::ALL
            .map(|a| size[a.index()] > 0.0 && scale[a.index()].is_finite() && scale[a.index()] > 0.0);
        if !usable.contains(&true) {
            return None;
        }
        let scale = Vec3A::from_array([0, 1, 2].map(|a| if usable[a] { scale[a] } else { 0.0 }));
        let mut counts = [[0u32; MAX_BINS]; 3];
        let mut bounds = [[Aabb::EMPTY; MAX_BINS]; 3];
        let slots = Slots { first: centers.min, scale, last: bins as u32 - 1 };
        for r in refs {
            let slot = slots.of(r.center);
            for a in 0..3 {
                let slot = slot[a] as usize % MAX_BINS;
                counts[a][slot] += 1;
                bounds[a][slot] = bounds[a][slot].union(r.bound);
            }
        }
        let mut best = Best::default();
        for axis in Axis::ALL {
            let a = axis.index();
            if !usable[a] {
                continue;
            }
            let mut right = [0.0; MAX_BINS];
            let (mut b, mut n) = (Aabb::EMPTY, 0);
            for i in (1..bins).rev() {
                b = b.union(bounds[a][i]);
                n += counts[a][i];
                right[i] = area(&b) * n as f64;
            }
            let (mut b, mut n) = (Aabb::EMPTY, 0);
            for i in 0..bins - 1 {
                b = b.union(bounds[a][i]);
                n += counts[a][i];
                if n == 0 || n as usize == refs.len() {
                    continue;
                }
                let cost = area(&b) * n as f64 + right[i + 1];
                best.offer(cost, n as usize, refs.len(), || Plane::Bin { slots, axis, last_left: i as u32 });
            }
        }
        best.found()
    }

    /// Two halves by the centres along the longest axis; of equal centres by number.
    fn halve(&self, refs: &mut [Reference]) -> (usize, Aabb, Aabb) {
        let a = centers_of(refs).longest_axis().index();
        let middle = refs.len() / 2;
        refs.select_nth_unstable_by(middle, |p, q| {
            p.center[a].total_cmp(&q.center[a]).then(p.prim.cmp(&q.prim))
        });
        let (left, right) = refs.split_at(middle);
        (middle, bound_of(left), bound_of(right))
    }
}

/// Where a range is cut.
#[derive(Clone, Copy)]
enum Plane {
    /// After a bin.
    Bin { slots: Slots, axis: Axis, last_left: u32 },
    /// After a reference, in order of centre and number.
    Reference { axis: Axis, center: f32, prim: u32 },
}

/// The cheapest plane so far; of equals, which flat and coincident things produce, the more balanced one.
#[derive(Default)]
struct Best(Option<(f64, usize, Plane)>);

impl Best {
    #[inline(always)]
    fn offer(&mut self, cost: f64, left: usize, len: usize, plane: impl FnOnce() -> Plane) {
        let uneven = (2 * left).abs_diff(len);
        if self.0.is_none_or(|(least, tilt, _)| cost < least || cost == least && uneven < tilt) {
            self.0 = Some((cost, uneven, plane()));
        }
    }

    fn found(self) -> Option<(f64, Plane)> {
        self.0.map(|(cost, _, plane)| (cost, plane))
    }
}

impl Plane {
    /// The very decision the cost was computed with, so that no rounding moves a reference to the other side.
    #[inline]
    fn left(&self, r: &Reference) -> bool {
        match *self {
            Plane::Bin { slots, axis, last_left } => slots.of(r.center)[axis.index()] <= last_left,
            Plane::Reference { axis, center, prim } => {
                r.center[axis.index()].total_cmp(&center).then(r.prim.cmp(&prim)).is_le()
            }
        }
    }
}

/// Which bin a centre falls into.
#[derive(Clone, Copy)]
struct Slots {
    first: Vec3A,
    scale: Vec3A,
    last: u32,
}

impl Slots {
    #[inline(always)]
    fn of(&self, center: Vec3A) -> [u32; 3] {
        let slot = (center - self.first) * self.scale;
        // Casts saturate, and NaN becomes 0.
        [(slot.x as u32).min(self.last), (slot.y as u32).min(self.last), (slot.z as u32).min(self.last)]
    }
}

/// The best of all planes between references: for few.
fn sweep(refs: &[Reference]) -> Option<(f64, Plane)> {
    let n = refs.len();
    let mut order = [0u16; MAX_SWEEP];
    let mut right = [0.0; MAX_SWEEP];
    let mut best = Best::default();
    let size = centers_of(refs).size();
    for axis in Axis::ALL {
        let a = axis.index();
        if size[a] <= 0.0 {
            continue;
        }
        let order = &mut order[..n];
        for (i, slot) in order.iter_mut().enumerate() {
            *slot = i as u16;
        }
        let key = |i: u16| &refs[i as usize];
        order.sort_unstable_by(|&p, &q| {
            let (p, q) = (key(p), key(q));
            p.center[a].total_cmp(&q.center[a]).then(p.prim.cmp(&q.prim))
        });
        let mut b = Aabb::EMPTY;
        for i in (1..n).rev() {
            b = b.union(key(order[i]).bound);
            right[i] = area(&b) * (n - i) as f64;
        }
        let mut b = Aabb::EMPTY;
        for i in 0..n - 1 {
            b = b.union(key(order[i]).bound);
            let cost = area(&b) * (i + 1) as f64 + right[i + 1];
            best.offer(cost, i + 1, n, || {
                let last = key(order[i]);
                Plane::Reference { axis, center: last.center[a], prim: last.prim }
            });
        }
    }
    best.found()
}

/// Moves what belongs left to the front, and says how much that is.
fn partition(refs: &mut [Reference], left: impl Fn(&Reference) -> bool) -> usize {
    let (mut i, mut j) = (0, refs.len());
    while i < j {
        if left(&refs[i]) {
            i += 1;
        } else {
            j -= 1;
            refs.swap(i, j);
        }
    }
    i
}

fn bound_of(refs: &[Reference]) -> Aabb {
    refs.iter().fold(Aabb::EMPTY, |b, r| b.union(r.bound))
}

fn centers_of(refs: &[Reference]) -> Aabb {
    refs.iter().fold(Aabb::EMPTY, |b, r| b.grow(r.center))
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

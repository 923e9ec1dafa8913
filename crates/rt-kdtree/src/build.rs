//! The build: cells split by the surface area heuristic until leaves are cheaper.

use crate::node::{KdTree, MAX_DEPTH, Node, cut};
use crate::sweep::{Event, Events, Kind, Plane, cheapest};
use rt_accel::{
    Bounded, Boxes, BuildError, Clip, HashedMailbox, Invalid, InverseMailbox, Leaf, Mailing, NoMailbox, Sah,
    Structure, Visitor, Watch,
};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Axis, Ray, Real};

/// The knobs of a [`KdTree`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KdTreeParams {
    /// What passing a split and testing a primitive cost.
    pub sah: Sah,
    /// By which share of its cost a split that cuts off empty space counts as cheaper, in `[0, 1)`. More cuts off more.
    pub empty_bonus: f32,
    /// How many splits on a way may each cost more than a leaf would, in the hope of better ones below.
    pub bad_splits: u32,
    /// Most splits on a way, in `0..=60`; `None` for `8 + 1.3 log2 n` (Pharr and Humphreys 2004, section 4.4).
    pub max_depth: Option<u32>,
    /// What of a primitive counts in a cell.
    ///
    /// Source: Havran and Bittner, "On improving kd-trees for ray shooting", WSCG 2002 ("perfect splits").
    pub clip: Clip,
    /// Whether rays remember whom they were tested against.
    pub mailing: Mailing,
    /// Bytes the build may use, working memory included; `None` is no limit.
    pub memory_limit: Option<usize>,
}

impl Default for KdTreeParams {
    fn default() -> KdTreeParams {
        KdTreeParams {
            sah: Sah { traverse: 1.0, intersect: 1.5 },
            empty_bonus: 0.2,
            bad_splits: 0,
            max_depth: None,
            clip: Clip::Exact,
            mailing: Mailing::None,
            memory_limit: None,
        }
    }
}

impl KdTreeParams {
    fn check(&self) -> Result<(), BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        if !(self.sah.traverse >= 0.0 && self.sah.traverse.is_finite()) {
            return bad("sah.traverse", "must be finite and not negative");
        }
        if !(self.sah.intersect > 0.0 && self.sah.intersect.is_finite()) {
            return bad("sah.intersect", "must be finite and positive");
        }
        if !(0.0..1.0).contains(&self.empty_bonus) {
            return bad("empty_bonus", "must lie in 0..1");
        }
        if self.max_depth.is_some_and(|depth| depth as usize > MAX_DEPTH) {
            return bad("max_depth", "must lie in 0..=60");
        }
        Ok(())
    }

    fn depth(&self, prims: usize) -> u32 {
        let usual = 8.0 + 1.3 * (prims.max(1) as f64).log2();
        self.max_depth.unwrap_or((usual.round() as u32).min(MAX_DEPTH as u32))
    }
}

/// Cells with up to this many references are built by one thread, away from the others: fixed, so that the tree does not depend on
/// the number of threads.
const ALONE: usize = 1 << 13;

impl Structure for KdTree {
    type Params = KdTreeParams;

    fn build_watched(
        source: &dyn Bounded,
        params: &KdTreeParams,
        watch: Watch<'_>,
    ) -> Result<KdTree, BuildError> {
        params.check()?;
        let len = source.prim_count();
        if len > Event::MOST {
            return Err(BuildError::TooManyPrimitives { len, max: Event::MOST });
        }
        // Boxes, two events an axis twice over while they are dealt out, a side.
        let needed = len
            .saturating_mul(size_of::<(u32, Aabb)>() + 12 * size_of::<Event>() + 2 * size_of::<Node>() + 1);
        if let Some(limit) = params.memory_limit.filter(|&limit| needed > limit) {
            return Err(BuildError::OutOfMemory { needed, limit });
        }
        if watch(0.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        let boxes = Boxes::read(source)?;
        let splitter = Splitter { source, boxes: &boxes, params, max_depth: params.depth(boxes.prims.len()) };
        let Tree { nodes, prims } =
            if boxes.prims.is_empty() { Tree::default() } else { splitter.tree(watch)? };
        let repeats = prims.len() > boxes.prims.len();
        let tree = KdTree {
            origin: boxes.origin,
            bound: boxes.world,
            nodes,
            prims,
            skipped: boxes.skipped,
            repeats,
            mailing: if repeats { params.mailing } else { Mailing::None },
            sah: params.sah,
        };
        if watch(1.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        Ok(tree)
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
            + (self.prims.capacity() + self.skipped.capacity()) * size_of::<u32>()
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

/// A finished part of a tree.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    prims: Vec<u32>,
}

/// A cell still to be split.
struct Task {
    cell: Aabb,
    events: Events,
    count: usize,
    depth: u32,
    bad: u32,
    /// The split of which this is the part above, if it is one.
    above_of: Option<usize>,
}

/// The top of a tree while parts are built apart.
enum Top {
    Split { axis: Axis, position: f32, children: [Option<usize>; 2] },
    Part(usize),
}

/// Where a reference goes.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Both,
    Below,
    Above,
}

struct Splitter<'a> {
    source: &'a dyn Bounded,
    boxes: &'a Boxes,
    params: &'a KdTreeParams,
    max_depth: u32,
}

impl Splitter<'_> {
    fn tree(&self, watch: Watch<'_>) -> Result<Tree, BuildError> {
        let count = self.boxes.prims.len();
        let mut events = Events::default();
        for (slot, (_, bound)) in (0..).zip(&self.boxes.prims) {
            events.push(slot, bound);
        }
        events.sort();
        let root = Task { cell: self.boxes.world, events, count, depth: 0, bad: 0, above_of: None };
        // The top here, down to cells that one thread builds alone.
        let mut sides = vec![Side::Both; count];
        let mut top = Vec::new();
        let mut parts = Vec::new();
        let mut tasks = vec![(root, None::<(usize, usize)>)];
        let work = (count as f32 / ALONE as f32).max(2.0).log2() * count as f32;
        let mut done = 0.0;
        while let Some((task, hangs)) = tasks.pop() {
            if let Some((parent, side)) = hangs {
                let here = top.len();
                if let Some(Top::Split { children, .. }) = top.get_mut(parent) {
                    children[side] = Some(here);
                }
            }
            if task.count <= ALONE {
                top.push(Top::Part(parts.len()));
                parts.push(task);
                continue;
            }
            done += task.count as f32 * 0.5 / work;
            if watch(done.min(0.5)).is_break() {
                return Err(BuildError::Cancelled);
            }
            match self.plane(&task) {
                None => {
                    top.push(Top::Part(parts.len()));
                    parts.push(task);
                }
                Some(plane) => {
                    let here = top.len();
                    top.push(Top::Split { axis: plane.axis, position: plane.position, children: [None; 2] });
                    let [below, above] = self.split(task, &plane, &mut sides);
                    let stored = stored(&below, &above);
                    tasks.extend(stored[1].then_some((above, Some((here, 1)))));
                    tasks.extend(stored[0].then_some((below, Some((here, 0)))));
                }
            }
            self.within_limit(tasks.iter().map(|(task, _)| task).chain(&parts), 0)?;
        }
        drop(sides);
        // The parts, some at a time, on all cores.
        let total = parts.len();
        let mut built = Vec::with_capacity(total);
        let mut waiting = parts.into_iter();
        let (mut nodes, mut refs) = (0, 0);
        loop {
            let batch: Vec<Task> = waiting.by_ref().take(16).collect();
            if batch.is_empty() {
                break;
            }
            for part in grow(batch, |task| self.part(task)) {
                let part = part?;
                nodes += part.nodes.len();
                refs += part.prims.len();
                built.push(part);
            }
            self.within_limit(core::iter::empty(), nodes * size_of::<Node>() + refs * 4)?;
            if watch((0.5 + 0.5 * built.len() as f32 / total as f32).min(0.999)).is_break() {
                return Err(BuildError::Cancelled);
            }
        }
        let most = Node::MOST.min(u32::MAX as usize);
        if nodes + top.len() > most || refs > u32::MAX as usize {
            return Err(BuildError::TooManyPrimitives { len: nodes.max(refs), max: most });
        }
        Ok(assemble(&top, built, nodes, refs))
    }

    /// The nodes and references of one cell, numbered from 0.
    fn part(&self, task: Task) -> Result<Tree, BuildError> {
        let mut sides = vec![Side::Both; self.boxes.prims.len()];
        let mut tree = Tree::default();
        let mut tasks = vec![task];
        while let Some(task) = tasks.pop() {
            let here = tree.nodes.len();
            if let Some(parent) = task.above_of
                && let node = &mut tree.nodes[parent]
            {
                *node = Node::split(node.axis(), node.position(), here);
            }
            match self.plane(&task) {
                None => {
                    let first = tree.prims.len();
                    tree.prims.extend(self.members(&task));
                    tree.prims[first..].sort_unstable();
                    tree.nodes.push(Node::leaf(first, tree.prims.len() - first));
                }
                Some(plane) => {
                    tree.nodes.push(Node::split(plane.axis, plane.position, 0));
                    let [below, mut above] = self.split(task, &plane, &mut sides);
                    above.above_of = Some(here);
                    let stored = stored(&below, &above);
                    tasks.extend(stored[1].then_some(above));
                    tasks.extend(stored[0].then_some(below));
                }
            }
            if tree.nodes.len() % 4096 == 0 {
                self.within_limit(tasks.iter(), tree.nodes.len() * size_of::<Node>() + tree.prims.len() * 4)?;
            }
        }
        Ok(tree)
    }

    /// The primitives of a cell: each has one event along x that is not its end.
    fn members(&self, task: &Task) -> impl Iterator<Item = u32> {
        let once = task.events.0[0].iter().filter(|event| event.kind() != Kind::End);
        once.map(|event| self.boxes.prims[event.slot() as usize].0)
    }

    /// The plane to split a cell by; `None` to leave it a leaf.
    fn plane(&self, task: &Task) -> Option<Plane> {
        if task.depth >= self.max_depth || task.count == 0 {
            return None;
        }
        let plane = cheapest(&task.events, task.count, &task.cell, self.params)?;
        let leaf = self.params.sah.intersect as f64 * task.count as f64;
        (plane.cost < leaf || task.bad < self.params.bad_splits && task.count > 1).then_some(plane)
    }

    /// Deals the events of a cell out to both sides of a plane, in order.
    fn split(&self, task: Task, plane: &Plane, sides: &mut [Side]) -> [Task; 2] {
        let Task { cell, events, count, depth, bad, .. } = task;
        let (axis, at) = (plane.axis, plane.position);
        let along = &events.0[axis.index()];
        for event in along {
            sides[event.slot() as usize] = Side::Both;
        }
        for event in along {
            let side = match event.kind() {
                Kind::End if event.position <= at => Side::Below,
                Kind::Start if event.position >= at => Side::Above,
                Kind::Planar if event.position < at || event.position == at && plane.planar_below => {
                    Side::Below
                }
                Kind::Planar => Side::Above,
                _ => continue,
            };
            sides[event.slot() as usize] = side;
        }
        let (low, high) = cut(&cell, axis, at);
        // What reaches into both is looked at again in each.
        let mut halves = [(low, Events::default(), 0usize), (high, Events::default(), 0usize)];
        let mut one_sided = [0usize; 2];
        for event in along.iter().filter(|event| event.kind() != Kind::End) {
            let slot = event.slot();
            match sides[slot as usize] {
                Side::Below => one_sided[0] += 1,
                Side::Above => one_sided[1] += 1,
                Side::Both => {
                    let (prim, bound) = self.boxes.prims[slot as usize];
                    for (cell, events, count) in &mut halves {
                        let part = match self.params.clip {
                            Clip::Exact => {
                                self.source.clipped_bound(prim, cell, self.boxes.origin).overlap(bound)
                            }
                            Clip::Box => bound,
                        };
                        let part = part.overlap(*cell);
                        if part.is_valid() {
                            events.push(slot, &part);
                            *count += 1;
                        }
                    }
                }
            }
        }
        let leaf = self.params.sah.intersect as f64 * count as f64;
        let bad = bad + (plane.cost >= leaf) as u32;
        let mut fresh = halves.map(|(cell, mut events, count)| {
            events.sort();
            (cell, events, count)
        });
        let mut dealt = [Events::default(), Events::default()];
        for (a, old) in events.0.into_iter().enumerate() {
            for (side, half) in [Side::Below, Side::Above].into_iter().enumerate() {
                let new = core::mem::take(&mut fresh[side].1.0[a]);
                let kept = old.iter().copied().filter(|event| sides[event.slot() as usize] == half);
                dealt[side].0[a] = merged(kept, &new, 2 * one_sided[side]);
            }
        }
        let mut dealt = dealt.into_iter();
        [0, 1].map(|side| Task {
            cell: fresh[side].0,
            events: dealt.next().unwrap_or_default(),
            count: one_sided[side] + fresh[side].2,
            depth: depth + 1,
            bad,
            above_of: None,
        })
    }

    fn within_limit<'t>(
        &self,
        tasks: impl Iterator<Item = &'t Task>,
        finished: usize,
    ) -> Result<(), BuildError> {
        let Some(limit) = self.params.memory_limit else { return Ok(()) };
        let boxes = self.boxes.prims.capacity() * (size_of::<(u32, Aabb)>() + 1);
        let needed = tasks.map(|task| task.events.bytes()).sum::<usize>() + boxes + finished;
        if needed > limit { Err(BuildError::OutOfMemory { needed, limit }) } else { Ok(()) }
    }
}

/// Which of two children are stored: those with primitives, at least one.
fn stored(below: &Task, above: &Task) -> [bool; 2] {
    [below.count > 0 || above.count == 0, above.count > 0]
}

/// Two sorted runs as one.
fn merged(kept: impl Iterator<Item = Event>, new: &[Event], expected: usize) -> Vec<Event> {
    let mut out = Vec::with_capacity(expected + new.len());
    let mut new = new.iter().copied().peekable();
    for event in kept {
        while let Some(next) = new.next_if(|next| next.key() < event.key()) {
            out.push(next);
        }
        out.push(event);
    }
    out.extend(new);
    out
}

/// Top and parts as one tree, depth first.
fn assemble(top: &[Top], parts: Vec<Tree>, nodes: usize, refs: usize) -> Tree {
    let mut tree = Tree { nodes: Vec::with_capacity(nodes + top.len()), prims: Vec::with_capacity(refs) };
    let mut parts: Vec<Option<Tree>> = parts.into_iter().map(Some).collect();
    let mut stack = vec![(0usize, None::<usize>)];
    while let Some((at, above_of)) = stack.pop() {
        let here = tree.nodes.len();
        if let Some(parent) = above_of {
            let node = tree.nodes[parent];
            tree.nodes[parent] = Node::split(node.axis(), node.position(), here);
        }
        match &top[at] {
            Top::Split { axis, position, children } => {
                tree.nodes.push(Node::split(*axis, *position, 0));
                stack.extend(children[1].map(|above| (above, Some(here))));
                stack.extend(children[0].map(|below| (below, None)));
            }
            Top::Part(part) => {
                if let Some(part) = parts[*part].take() {
                    let first = tree.prims.len();
                    tree.nodes.extend(part.nodes.iter().map(|node| node.shifted(here, first)));
                    tree.prims.extend(part.prims);
                }
            }
        }
    }
    tree.nodes.shrink_to_fit();
    tree.prims.shrink_to_fit();
    tree
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

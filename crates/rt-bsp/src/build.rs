//! The build: cells split by the cheapest plane, across an axis or of the scene's own, until leaves are cheaper.

use crate::cell::Cell;
use crate::node::{Bsp, MAX_DEPTH, Node, View, unit_of};
use crate::part::{Crowd, Part, Parts, Tally};
use crate::plane::{Plane, Scale, Side, cut_box};
use crate::sweep::{Across, Prices, Region, cheapest};
use rt_accel::{
    Bounded, Boxes, BuildError, HashedMailbox, Invalid, InverseMailbox, Leaf, Mailing, NoMailbox, Sah,
    Structure, Visitor, Watch,
};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};

/// The knobs of a [`Bsp`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BspParams {
    /// What passing an axis-aligned split and testing a primitive cost.
    pub sah: Sah,
    /// What passing a slanted split costs, in the same unit; not negative, and infinite for a tree without any. More than an
    /// axis-aligned one, so that those are preferred where they do nearly as well.
    pub slanted: f32,
    /// Cells with up to this many references consider the planes of all of them, and planes through all their edges: the build
    /// takes time in proportion to it. At least 0.
    pub exhaustive: u32,
    /// Larger cells consider the planes of so many references, evenly chosen; 0 for none.
    pub samples: u32,
    /// By which share of its cost a split that cuts off empty space counts as cheaper, in `[0, 1)`. More cuts off more.
    pub empty_bonus: f32,
    /// How many splits on a way may each cost more than a leaf would, in the hope of better ones below.
    pub bad_splits: u32,
    /// Most splits on a way, in `0..=64`; `None` for `12 + 2 log2 n`.
    pub max_depth: Option<u32>,
    /// Whether rays remember whom they were tested against.
    pub mailing: Mailing,
    /// Bytes the build may use, working memory included; `None` is no limit.
    pub memory_limit: Option<usize>,
}

impl Default for BspParams {
    fn default() -> BspParams {
        BspParams {
            sah: Sah { traverse: 1.0, intersect: 2.0 },
            slanted: 1.25,
            exhaustive: 32,
            samples: 16,
            empty_bonus: 0.0,
            bad_splits: 0,
            max_depth: None,
            mailing: Mailing::None,
            memory_limit: None,
        }
    }
}

impl BspParams {
    /// The default without slanted planes: a kd-tree, for comparison.
    pub fn axis_only() -> BspParams {
        BspParams { slanted: f32::INFINITY, ..BspParams::default() }
    }

    fn check(&self) -> Result<(), BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        if !(self.sah.traverse >= 0.0 && self.sah.traverse.is_finite()) {
            return bad("sah.traverse", "must be finite and not negative");
        }
        if !(self.sah.intersect > 0.0 && self.sah.intersect.is_finite()) {
            return bad("sah.intersect", "must be finite and positive");
        }
        if self.slanted.is_nan() || self.slanted < 0.0 {
            return bad("slanted", "must not be negative");
        }
        if !(0.0..1.0).contains(&self.empty_bonus) {
            return bad("empty_bonus", "must lie in 0..1");
        }
        if self.max_depth.is_some_and(|depth| depth as usize > MAX_DEPTH) {
            return bad("max_depth", "must lie in 0..=64");
        }
        Ok(())
    }

    fn depth(&self, prims: usize) -> u32 {
        let usual = 12.0 + 2.0 * (prims.max(1) as f64).log2();
        self.max_depth.unwrap_or((usual.round() as u32).min(MAX_DEPTH as u32))
    }
}

/// Cells with up to this many references are built by one thread, away from the others: fixed, so that the tree does not depend on
/// the number of threads.
const ALONE: usize = 1 << 11;

/// The most primitives: twice as many sides and kinds of events must be numbered.
const MOST: usize = (1 << 29) - 1;

impl Structure for Bsp {
    type Params = BspParams;

    fn build_watched(source: &dyn Bounded, params: &BspParams, watch: Watch<'_>) -> Result<Bsp, BuildError> {
        params.check()?;
        let len = source.prim_count();
        if len > MOST {
            return Err(BuildError::TooManyPrimitives { len, max: MOST });
        }
        // Boxes; parts twice over while they are dealt out, with their corners; events along one axis.
        let part = Parts::BYTES;
        let needed = len.saturating_mul(size_of::<(u32, Aabb)>() + 2 * part + 2 * size_of::<u64>());
        if let Some(limit) = params.memory_limit.filter(|&limit| needed > limit) {
            return Err(BuildError::OutOfMemory { needed, limit });
        }
        if watch(0.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        let boxes = Boxes::read(source)?;
        let splitter = Splitter {
            source,
            boxes: &boxes,
            params,
            prices: Prices {
                axis: params.sah.traverse as f64,
                slanted: params.slanted as f64,
                test: params.sah.intersect as f64,
                empty_bonus: params.empty_bonus as f64,
            },
            scale: Scale::of(&boxes.world),
            max_depth: params.depth(boxes.prims.len()),
        };
        let Tree { nodes, prims } =
            if boxes.prims.is_empty() { Tree::default() } else { splitter.tree(watch)? };
        let repeats = prims.len() > boxes.prims.len();
        let tree = Bsp {
            origin: boxes.origin,
            bound: boxes.world,
            nodes,
            prims,
            skipped: boxes.skipped,
            repeats,
            mailing: if repeats { params.mailing } else { Mailing::None },
            prices: [params.sah.traverse, params.slanted, params.sah.intersect],
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
    region: Region,
    parts: Parts,
    depth: u32,
    bad: u32,
    /// The split of which this is the part above, if it is one.
    above_of: Option<usize>,
}

impl Task {
    fn bytes(&self) -> usize {
        self.parts.bytes() + self.region.cell.as_ref().map_or(0, Cell::bytes)
    }
}

/// The top of a tree while parts are built apart.
enum Top {
    Split { view: View, children: [usize; 2] },
    Part(usize),
}

/// How to split a cell.
#[derive(Clone, Copy)]
enum Split {
    Across(Across),
    Slanted { plane: Plane, planar_below: bool, cost: f64 },
}

impl Split {
    fn cost(&self) -> f64 {
        match self {
            Split::Across(across) => across.cost,
            Split::Slanted { cost, .. } => *cost,
        }
    }

    fn view(&self) -> View {
        match *self {
            Split::Across(Across { axis, position, .. }) => View::Axis { axis, position, above: 0 },
            Split::Slanted { plane, .. } => View::Slanted { plane, above: 0 },
        }
    }
}

struct Splitter<'a> {
    source: &'a dyn Bounded,
    boxes: &'a Boxes,
    params: &'a BspParams,
    prices: Prices,
    /// None where there shall be no slanted planes, nor polygons.
    scale: Option<Scale>,
    max_depth: u32,
}

impl Splitter<'_> {
    fn tree(&self, watch: Watch<'_>) -> Result<Tree, BuildError> {
        let count = self.boxes.prims.len();
        let mut parts = Parts::with_capacity(count);
        for (slot, (prim, bound)) in (0..).zip(&self.boxes.prims) {
            let outline = self.scale.and_then(|_| self.source.outline(*prim, self.boxes.origin));
            let corners = outline.as_ref().filter(|corners| corners.iter().all(|c| c.is_finite()));
            parts.push(slot, *bound, corners.map_or(&[], |corners| corners));
        }
        let region = Region { bound: self.boxes.world, cell: None };
        let root = Task { region, parts, depth: 0, bad: 0, above_of: None };
        // The top here, down to cells that one thread builds alone.
        let mut top = Vec::new();
        let mut apart = Vec::new();
        let mut tasks = vec![(root, None::<(usize, usize)>)];
        let work = (count as f32 / ALONE as f32).max(2.0).log2() * count as f32;
        let mut done = 0.0;
        while let Some((task, hangs)) = tasks.pop() {
            if let Some((parent, side)) = hangs {
                let here = top.len();
                if let Some(Top::Split { children, .. }) = top.get_mut(parent) {
                    children[side] = here;
                }
            }
            let split = if task.parts.list.len() <= ALONE { None } else { self.split(&task) };
            done += if split.is_some() { task.parts.list.len() as f32 * 0.5 / work } else { 0.0 };
            if watch(done.min(0.5)).is_break() {
                return Err(BuildError::Cancelled);
            }
            match split {
                None => {
                    top.push(Top::Part(apart.len()));
                    apart.push(task);
                }
                Some(split) => {
                    let here = top.len();
                    top.push(Top::Split { view: split.view(), children: [0; 2] });
                    let [below, above] = self.deal(task, &split);
                    tasks.push((above, Some((here, 1))));
                    tasks.push((below, Some((here, 0))));
                }
            }
            self.within_limit(tasks.iter().map(|(task, _)| task).chain(&apart), 0)?;
        }
        // The parts, some at a time, on all cores.
        let total = apart.len();
        let mut built = Vec::with_capacity(total);
        let mut waiting = apart.into_iter();
        let (mut nodes, mut refs) = (0, 0);
        loop {
            let batch: Vec<Task> = waiting.by_ref().take(32).collect();
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
        let most = Node::MOST;
        if nodes + 4 * top.len() > most || refs > most {
            return Err(BuildError::TooManyPrimitives { len: nodes.max(refs), max: most });
        }
        Ok(assemble(&top, built, nodes, refs))
    }

    /// The nodes and references of one cell, numbered from 0.
    fn part(&self, task: Task) -> Result<Tree, BuildError> {
        let mut tree = Tree::default();
        let mut tasks = vec![task];
        let mut checked = 0;
        while let Some(task) = tasks.pop() {
            let here = tree.nodes.len();
            if let Some(parent) = task.above_of {
                tree.nodes[parent].hang(here);
            }
            match self.split(&task) {
                None => {
                    let first = tree.prims.len();
                    let prim = |slot: u32| self.boxes.prims[slot as usize].0;
                    tree.prims.extend(task.parts.list.iter().map(|part| prim(part.slot)));
                    tree.prims[first..].sort_unstable();
                    let count = tree.prims.len() - first;
                    Node::push(&mut tree.nodes, View::Leaf { first: first as u32, count });
                }
                Some(split) => {
                    Node::push(&mut tree.nodes, split.view());
                    let [below, mut above] = self.deal(task, &split);
                    above.above_of = Some(here);
                    tasks.push(above);
                    tasks.push(below);
                }
            }
            if tree.nodes.len() > checked + 4096 {
                checked = tree.nodes.len();
                self.within_limit(tasks.iter(), checked * size_of::<Node>() + tree.prims.len() * 4)?;
            }
        }
        Ok(tree)
    }

    /// How to split a cell; `None` to leave it a leaf.
    fn split(&self, task: &Task) -> Option<Split> {
        let count = task.parts.list.len();
        if task.depth >= self.max_depth || count == 0 {
            return None;
        }
        let across = cheapest(&task.parts, &task.region, &self.prices).map(Split::Across);
        let split = match self.slanted(task, across.map_or(f64::INFINITY, |across| across.cost())) {
            Some(slanted) => slanted,
            None => across?,
        };
        let leaf = self.prices.test * count as f64;
        (split.cost() < leaf || task.bad < self.params.bad_splits && count > 1).then_some(split)
    }

    /// The cheapest slanted plane, if it costs less than `limit` and less than a leaf; of equals the first.
    fn slanted(&self, task: &Task, limit: f64) -> Option<Split> {
        let (scale, parts) = (self.scale?, &task.parts);
        let count = parts.list.len();
        let mut best_cost = limit.min(self.prices.test * count as f64);
        let whole = task.region.area();
        let cheapest = self.prices.slanted * (1.0 - self.prices.empty_bonus);
        if cheapest >= best_cost || whole <= 0.0 {
            return None;
        }
        let (exhaustive, samples) = (self.params.exhaustive as usize, self.params.samples as usize);
        let considered = if count <= exhaustive { count } else { samples.min(count) };
        if considered == 0 {
            return None;
        }
        let crowd = Crowd::new(parts);
        let boxed = task.region.cell.is_none().then(|| Cell::of_box(&task.region.bound));
        let cell = task.region.cell.as_ref().or(boxed.as_ref())?;
        let mut best = None;
        let mut heights = Vec::new();
        let mut consider = |plane: Option<Plane>| {
            let Some(plane) = plane else { return };
            let [low, high] = cell.heights(plane.normal.as_dvec3(), plane.shift, &mut heights);
            if -low <= plane.room as f64 || high <= plane.room as f64 {
                return;
            }
            let Tally { below, above, both, planar } = crowd.tally(&plane, plane.touch(scale));
            let (below, above) = (below + both, above + both);
            // A cut adds to the surface: no plane costs less than this.
            let least = self.prices.test * below.min(above) as f64;
            if (self.prices.slanted + least) * (1.0 - self.prices.empty_bonus) >= best_cost {
                return;
            }
            let shares = cell.areas(&heights).map(|area| area / whole);
            for planar_below in [true, false] {
                let counts = if planar_below { [below + planar, above] } else { [below, above + planar] };
                let cost = self.prices.cost(self.prices.slanted, shares, counts, true);
                if cost < best_cost {
                    (best, best_cost) = (Some(Split::Slanted { plane, planar_below, cost }), cost);
                }
                if planar == 0 {
                    break;
                }
            }
        };
        for i in 0..considered {
            let part = &parts.list[i * count / considered];
            let prim = self.boxes.prims[part.slot as usize].0;
            let Some(corners) = self.source.outline(prim, self.boxes.origin) else { continue };
            let [a, b, c] = corners;
            let edges = [b - a, c - b, a - c];
            let normal = edges[0].cross(edges[1]);
            consider(Plane::through(&corners, normal, scale));
            for k in 0..3 {
                let ends = [corners[k], corners[(k + 1) % 3]];
                consider(Plane::through(&ends, edges[k].cross(normal), scale));
            }
        }
        best
    }

    /// Deals the parts of a cell out to both sides of a split.
    fn deal(&self, task: Task, split: &Split) -> [Task; 2] {
        let Task { region, parts, depth, bad, .. } = task;
        let bad = bad + (split.cost() >= self.prices.test * parts.list.len() as f64) as u32;
        let (normal, shift, room) = match split {
            Split::Across(across) => (unit_of(across.axis), across.position as f64, 0.0),
            Split::Slanted { plane, .. } => (plane.normal.as_dvec3(), plane.shift, plane.room as f64),
        };
        let boxes = match (split, self.scale) {
            (Split::Across(across), _) => cut_box(&region.bound, across.axis, across.position),
            _ => [region.bound; 2],
        };
        let side = |part: &Part| match *split {
            Split::Across(Across { axis, position, planar_below, .. }) => {
                let (min, max) = (part.bound.min[axis.index()], part.bound.max[axis.index()]);
                match (max <= position, min >= position) {
                    (true, true) if planar_below => Side::Below,
                    (true, true) => Side::Above,
                    (true, false) => Side::Below,
                    (false, true) => Side::Above,
                    (false, false) => Side::Both,
                }
            }
            Split::Slanted { plane, planar_below, .. } => {
                let touch = self.scale.map_or(0.0, |scale| plane.touch(scale));
                match parts.side(part, &plane, touch) {
                    Side::Planar if planar_below => Side::Below,
                    Side::Planar => Side::Above,
                    side => side,
                }
            }
        };
        let mut dealt = [Parts::default(), Parts::default()];
        for part in &parts.list {
            let both = match side(part) {
                Side::Below => [true, false],
                Side::Above => [false, true],
                _ => [true, true],
            };
            if both != [true, true] {
                let only = &mut dealt[usize::from(both[1])];
                only.push(part.slot, part.bound, parts.corners(part));
                continue;
            }
            for (half, towards) in [1.0, -1.0].into_iter().enumerate() {
                let within = match (split, self.scale) {
                    (Split::Slanted { plane, .. }, Some(scale)) if parts.corners(part).is_empty() => {
                        plane.cut(&part.bound, scale)[half]
                    }
                    _ => boxes[half],
                };
                let most = shift * towards + room;
                dealt[half].push_cut(&parts, part, normal * towards, most, &within, self.scale);
            }
        }
        drop(parts);
        let cells = match (&region.cell, split) {
            (None, Split::Across(_)) => [None, None],
            (cell, _) => {
                let mut heights = Vec::new();
                let boxed = cell.is_none().then(|| Cell::of_box(&region.bound));
                match cell.as_ref().or(boxed.as_ref()) {
                    Some(cell) => {
                        cell.heights(normal, shift, &mut heights);
                        cell.split(&heights).map(Some)
                    }
                    None => [None, None],
                }
            }
        };
        let ([low, high], [low_cell, high_cell]) = (dealt, cells);
        [(low, low_cell, boxes[0]), (high, high_cell, boxes[1])].map(|(parts, cell, bound)| Task {
            region: Region { bound, cell },
            parts,
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
        let boxes = self.boxes.prims.capacity() * size_of::<(u32, Aabb)>();
        let needed = tasks.map(Task::bytes).sum::<usize>() + boxes + finished;
        if needed > limit { Err(BuildError::OutOfMemory { needed, limit }) } else { Ok(()) }
    }
}

/// Top and parts as one tree, depth first.
fn assemble(top: &[Top], parts: Vec<Tree>, nodes: usize, refs: usize) -> Tree {
    let mut tree = Tree { nodes: Vec::with_capacity(nodes + top.len()), prims: Vec::with_capacity(refs) };
    let mut parts: Vec<Option<Tree>> = parts.into_iter().map(Some).collect();
    let mut stack = vec![(0usize, None::<usize>)];
    while let Some((at, above_of)) = stack.pop() {
        let here = tree.nodes.len();
        if let Some(parent) = above_of {
            tree.nodes[parent].hang(here);
        }
        match &top[at] {
            Top::Split { view, children } => {
                Node::push(&mut tree.nodes, *view);
                stack.push((children[1], Some(here)));
                stack.push((children[0], None));
            }
            Top::Part(part) => {
                if let Some(part) = parts[*part].take() {
                    let (first, mut at) = (tree.prims.len(), 0);
                    while let Some((view, size)) = View::at(&part.nodes, at) {
                        Node::push(&mut tree.nodes, view.shifted(here, first));
                        at += size;
                    }
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

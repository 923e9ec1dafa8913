//! The build: parts of primitives dealt out to cells; crowded cells again.

use crate::clouds::{GRID, LEAF, spread};
use crate::grid::Grid;
use crate::hug;
use crate::measure;
use crate::params::{GridParams, Nest, Resolution, Skip};
use crate::voxels::{Voxels, resolve, restrained};
use core::ops::Range;
use rt_accel::{
    Bounded, Boxes, BuildError, Clip, HashedMailbox, Invalid, InverseMailbox, Leaf, Mailing, NoMailbox,
    Structure, Visitor, Watch,
};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};

/// Parts that one thread deals out at a time: fixed, so that the grid does not depend on the number of threads.
const ALONE: usize = 1 << 12;
/// How many cells are filled together at least, and in how many lots all cells are filled at most: a lot stays in the nearer caches.
const LEAST_LOT: usize = 1 << 14;
const MOST_LOTS: usize = 128;
/// How many clusters are asked whether they enclose something.
const MOST_HOMES: usize = 64;
/// How many cells the box of a primitive may overlap on average, in the first grid and in those within.
pub(crate) const MOST_OVERLAPS: [u64; 2] = [256, 16];
/// What entering a grid costs, in cells passed.
const ENTER: f64 = 6.0;
/// Bytes for each reference while a grid is filled.
const PER_REFERENCE: usize = size_of::<(u32, u32)>() + 2 * size_of::<u32>();

impl Structure for Grid {
    type Params = GridParams;

    fn build_watched(
        source: &dyn Bounded,
        params: &GridParams,
        watch: Watch<'_>,
    ) -> Result<Grid, BuildError> {
        params.check()?;
        let len = source.prim_count();
        let needed = len.saturating_mul(2 * size_of::<Part>() + PER_REFERENCE);
        if let Some(limit) = params.memory_limit.filter(|&limit| needed > limit) {
            return Err(BuildError::OutOfMemory { needed, limit });
        }
        if watch(0.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        let Boxes { origin, prims, skipped, world } = Boxes::read(source)?;
        let valid = prims.len();
        let finite = |b: &Aabb| b.min.is_finite() && b.max.is_finite();
        let (parts, without_end): (Vec<Part>, Vec<Part>) = match prims.iter().all(|(_, b)| finite(b)) {
            true => (prims, Vec::new()),
            false => prims.into_iter().partition(|(_, b)| finite(b)),
        };
        let outside: Vec<u32> = without_end.iter().map(|(prim, _)| *prim).collect();
        let mut grid = Grid {
            origin,
            bound: world,
            grids: Vec::new(),
            kinds: Vec::new(),
            first_link: len as u32,
            starts: Vec::new(),
            outside: outside.len(),
            refs: outside,
            skipped,
            repeats: false,
            mailing: Mailing::None,
            overlaps: 0,
        };
        if !parts.is_empty() {
            Builder { source, origin, params, prims: valid, first_link: len as u32 }
                .build(parts, &mut grid, watch)?;
        }
        let links = grid.refs.iter().filter(|reference| **reference >= grid.first_link).count();
        // A grid in two cells shows its leaves twice to a ray that goes from one to the other.
        grid.repeats = grid.refs.len() - links > valid || links + 1 > grid.grids.len().max(1);
        grid.mailing = if grid.repeats { params.mailing } else { Mailing::None };
        if watch(1.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        Ok(grid)
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
        self.kinds.capacity()
            + (self.starts.capacity() + self.refs.capacity() + self.skipped.capacity()) * size_of::<u32>()
            + self.grids.capacity() * size_of::<Voxels>()
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
        self.gather_within(keep, each);
    }

    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid> {
        self.check(prims)
    }
}

/// A primitive, and the box of what of it lies in the grid at hand. From the number of primitives on, the first member is a grid.
pub(crate) type Part = (u32, Aabb);

/// Parts of one class of size that hang together.
struct Cluster {
    class: u32,
    bound: Aabb,
    slots: Vec<u32>,
}

/// A grid to be filled.
struct Task {
    bound: Aabb,
    parts: Vec<Part>,
    count: [u32; 3],
}

/// A grid that is filled: which parts lie in which cell.
struct Filled {
    voxels: Voxels,
    starts: Vec<u32>,
    /// Numbers of parts, cell after cell.
    slots: Vec<u32>,
    overlaps: u64,
    /// Cells to become grids, in ascending order.
    nested: Vec<(usize, Task)>,
    parts: Vec<Part>,
}

/// Which of some parts lie in which cells.
struct Found {
    /// A cell, and a part's number.
    pairs: Vec<(u32, u32)>,
    overlaps: u64,
    /// Once sorted by lots: where the pairs of each lot end.
    ends: Vec<u32>,
}

impl Found {
    /// Brings together the pairs of each lot of cells, in the order they have. `lot` is a power of two.
    fn sorted(mut self, lot: usize, cells: usize) -> Found {
        let lots = cells.div_ceil(lot);
        if lots == 1 {
            self.ends = vec![self.pairs.len() as u32];
            return self;
        }
        let shift = lot.trailing_zeros();
        self.ends = vec![0; lots];
        for (cell, _) in &self.pairs {
            self.ends[(cell >> shift) as usize] += 1;
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += core::mem::replace(end, sum);
        }
        let mut sorted = vec![(0, 0); self.pairs.len()];
        for pair in &self.pairs {
            let end = &mut self.ends[(pair.0 >> shift) as usize];
            sorted[*end as usize] = *pair;
            *end += 1;
        }
        self.pairs = sorted;
        self
    }
}

/// Fills a lot of cells: where each one's parts begin, and one more, where they end; and the parts, in ascending order for each.
fn deal(found: &[Found], lot: usize, cells: Range<usize>) -> (Vec<u32>, Vec<u32>) {
    let here = || {
        found.iter().flat_map(|some| {
            let from = lot.checked_sub(1).map_or(0, |before| some.ends[before]);
            some.pairs[from as usize..some.ends[lot] as usize].iter()
        })
    };
    let mut starts = vec![0u32; cells.len() + 1];
    for (cell, _) in here() {
        starts[*cell as usize - cells.start] += 1;
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += core::mem::replace(start, sum);
    }
    let mut slots = vec![0u32; sum as usize];
    for (cell, slot) in here() {
        let place = &mut starts[*cell as usize - cells.start];
        slots[*place as usize] = *slot;
        *place += 1;
    }
    // Each start has become the next one's.
    starts.copy_within(0..cells.len(), 1);
    starts[0] = 0;
    (starts, slots)
}

struct Builder<'a> {
    source: &'a dyn Bounded,
    origin: DVec3,
    params: &'a GridParams,
    prims: usize,
    first_link: u32,
}

impl Builder<'_> {
    fn build(&self, parts: Vec<Part>, grid: &mut Grid, watch: Watch<'_>) -> Result<(), BuildError> {
        let mut tasks = match self.params.nest {
            Nest::Sizes { classes, grown, least } => {
                self.arranged(parts, classes.min(self.params.depth + 1), grown, least)?
            }
            _ => vec![self.task(parts, self.params.resolution)],
        };
        let levels = match self.params.nest {
            Nest::Never | Nest::Sizes { .. } => 0,
            Nest::Above(_) | Nest::Cheaper => self.params.depth,
        };
        for level in 0..=levels {
            let (total, mut done) = (tasks.len(), 0);
            let first_below = grid.grids.len() + total;
            let mut below = Vec::new();
            let mut waiting = core::mem::take(&mut tasks).into_iter();
            loop {
                let batch: Vec<Task> = waiting.by_ref().take(64).collect();
                if batch.is_empty() {
                    break;
                }
                done += batch.len();
                for filled in grow(batch, |task| self.filled(task, level < levels, grid.bytes())) {
                    let filled = filled?;
                    self.append(grid, filled, first_below, &mut below)?;
                }
                // Half of what is left for each level.
                let before = 1.0 - 0.5f32.powi(level as i32);
                let progress = before + (1.0 - before) * 0.5 * done as f32 / total as f32;
                if watch(progress.min(0.999)).is_break() {
                    return Err(BuildError::Cancelled);
                }
            }
            tasks = below;
            if tasks.is_empty() {
                break;
            }
        }
        grid.starts.push(grid.refs.len() as u32);
        grid.kinds.shrink_to_fit();
        grid.starts.shrink_to_fit();
        grid.refs.shrink_to_fit();
        grid.grids.shrink_to_fit();
        Ok(())
    }

    /// A grid that is no cell.
    fn task(&self, parts: Vec<Part>, rule: Resolution) -> Task {
        let bound = parts.iter().fold(Aabb::EMPTY, |b, (_, part)| b.union(*part));
        let count = match rule {
            Resolution::Measured { rays } => measure::resolution(&bound, &parts, rays, self.params.sah),
            rule => resolve(rule, &bound, parts.len()),
        };
        let count = match rule {
            Resolution::Fixed(_) => count,
            _ => restrained(count, &bound, &parts, MOST_OVERLAPS[0]),
        };
        Task { bound, parts, count }
    }

    /// The grids of [`Nest::Sizes`], each before those that are objects of it.
    fn arranged(&self, parts: Vec<Part>, most: u32, grown: f32, least: u32) -> Result<Vec<Task>, BuildError> {
        // What the search for clusters takes.
        self.within(parts.len().saturating_mul(size_of::<Part>() * 3 + 27 * size_of::<(u64, u32)>()))?;
        let class = hug::classes(&parts, most);
        let largest = class.iter().copied().max().unwrap_or(0);
        let mut members = vec![Vec::new(); largest as usize + 1];
        for (slot, class) in class.iter().enumerate() {
            members[*class as usize].push(slot as u32);
        }
        let mut clusters: Vec<Cluster> = Vec::new();
        for (class, members) in (0..largest).zip(&members) {
            let found = hug::clusters(&parts, members, grown);
            clusters.extend(found.into_iter().filter(|some| some.len() >= least as usize).map(|slots| {
                let bound = slots.iter().fold(Aabb::EMPTY, |b, slot| b.union(parts[*slot as usize].1));
                Cluster { class, bound, slots }
            }));
        }
        if clusters.is_empty() {
            return Ok(vec![self.task(parts, self.params.resolution)]);
        }
        let (len, max) = (self.first_link as usize + clusters.len(), u32::MAX as usize - 1);
        if len > max {
            return Err(BuildError::TooManyPrimitives { len, max });
        }
        // Enclosing ones first; a stable sort.
        clusters.sort_by(|a, b| {
            let by_size = || hug::diagonal(&b.bound).total_cmp(&hug::diagonal(&a.bound));
            b.class.cmp(&a.class).then_with(by_size)
        });
        // The smallest cluster of a larger class around a box, found in a grid of clusters; the number of its own grid, or 0.
        let link = |i: usize| self.first_link + 1 + i as u32;
        let boxes = clusters.iter().enumerate().map(|(i, cluster)| (link(i), cluster.bound)).collect();
        let lookup = self.filled(self.task(boxes, Resolution::Density(1.0)), false, 0)?;
        let (ruler, strides) = (lookup.voxels.ruler(), lookup.voxels.strides());
        let home = |class: u32, bound: &Aabb| {
            let corner = ruler.ranges(&Aabb { min: bound.min, max: bound.min });
            let within = lookup.voxels.bound().contains(*bound);
            let cell: usize = (0..3).map(|a| corner[a][0] as usize * strides[a]).sum();
            let here = &lookup.slots[lookup.starts[cell] as usize..lookup.starts[cell + 1] as usize];
            let encloses = |i: &&u32| {
                let cluster = &clusters[**i as usize];
                cluster.class > class && cluster.bound.contains(*bound)
            };
            // Not to be had at any price.
            let near = here.iter().rev().take(MOST_HOMES);
            near.filter(|_| within).find(encloses).map_or(0, |i| *i as usize + 1)
        };
        let mut homes = vec![usize::MAX; parts.len()];
        for (i, cluster) in clusters.iter().enumerate() {
            for slot in &cluster.slots {
                homes[*slot as usize] = i + 1;
            }
        }
        let mut contents = vec![Vec::new(); clusters.len() + 1];
        for ((part, class), at) in parts.iter().zip(&class).zip(homes) {
            let at = if at == usize::MAX { home(*class, &part.1) } else { at };
            contents[at].push(*part);
        }
        for (i, cluster) in clusters.iter().enumerate() {
            contents[home(cluster.class, &cluster.bound)].push((link(i), cluster.bound));
        }
        drop(parts);
        let mut rules = core::iter::once(self.params.resolution).chain(core::iter::repeat(self.params.inner));
        Ok(contents.into_iter().filter_map(|parts| Some(self.task(parts, rules.next()?))).collect())
    }

    /// Puts a filled grid behind the others.
    fn append(
        &self,
        grid: &mut Grid,
        filled: Filled,
        first_below: usize,
        below: &mut Vec<Task>,
    ) -> Result<(), BuildError> {
        let Filled { mut voxels, starts, slots, overlaps, nested, parts } = filled;
        // Where no number is left out, a part's number is its primitive's.
        let numbered = parts.last().is_some_and(|(prim, _)| *prim as usize + 1 == parts.len());
        voxels.first = grid.kinds.len();
        let cells = starts.len() - 1;
        let most = u32::MAX as usize;
        if grid.refs.len() + slots.len() > most || voxels.first + cells > most {
            return Err(BuildError::TooManyPrimitives { len: grid.refs.len() + slots.len(), max: most });
        }
        if self.first_link as usize + first_below + below.len() + nested.len() > most {
            return Err(BuildError::TooManyPrimitives { len: self.first_link as usize, max: most });
        }
        self.within(grid.bytes() + cells * 5 + slots.len() * 4 + below.len() * size_of::<Task>())?;
        grid.overlaps += overlaps;
        let mut rest = 0;
        let mut leaves = |grid: &mut Grid, to: usize| {
            let base = (grid.refs.len() as u32).wrapping_sub(starts[rest]);
            grid.starts.extend(starts[rest..to].iter().map(|start| start.wrapping_add(base)));
            let ends = starts[rest..to].iter().zip(&starts[rest + 1..]);
            grid.kinds.extend(ends.map(|(start, end)| if start == end { 1 } else { LEAF }));
            let slots = &slots[starts[rest] as usize..starts[to] as usize];
            match numbered {
                true => grid.refs.extend_from_slice(slots),
                false => grid.refs.extend(slots.iter().map(|slot| parts[*slot as usize].0)),
            }
            rest = (to + 1).min(cells);
        };
        for (cell, task) in nested {
            leaves(grid, cell);
            grid.kinds.push(GRID);
            grid.starts.push(grid.refs.len() as u32);
            grid.refs.push(self.first_link + (first_below + below.len()) as u32);
            below.push(task);
        }
        leaves(grid, cells);
        // Objects that are grids come last, in the grid and in each cell.
        if parts.last().is_some_and(|(prim, _)| *prim >= self.first_link) {
            let ends = grid.starts[voxels.first + 1..].iter().copied().chain([grid.refs.len() as u32]);
            for (kind, end) in grid.kinds[voxels.first..].iter_mut().zip(ends) {
                if *kind == LEAF && grid.refs[end as usize - 1] >= self.first_link {
                    *kind = GRID;
                }
            }
        }
        if self.params.skip == Skip::Clouds {
            spread(&mut grid.kinds[voxels.first..], voxels.count);
        }
        grid.grids.push(voxels);
        Ok(())
    }

    /// Deals the parts of a grid out to its cells.
    fn filled(&self, task: Task, may_nest: bool, held: usize) -> Result<Filled, BuildError> {
        let voxels = Voxels::new(&task.bound, task.count, 0);
        let cells = voxels.cells();
        let held =
            held.saturating_add(cells.saturating_mul(9)).saturating_add(self.prims * size_of::<Part>());
        self.within(held)?;
        let most = self.params.memory_limit.map_or(usize::MAX, |limit| (limit - held) / PER_REFERENCE);
        let most = most.min(u32::MAX as usize - 1);
        // Which parts lie in which cells, some parts at a time, on all cores.
        let lot = cells.div_ceil(MOST_LOTS).next_power_of_two().max(LEAST_LOT);
        let chunks: Vec<(u32, &[Part])> =
            task.parts.chunks(ALONE).enumerate().map(|(i, chunk)| ((i * ALONE) as u32, chunk)).collect();
        let mut found = Vec::with_capacity(chunks.len());
        let (mut total, mut overlaps) = (0, 0u64);
        for some in chunks.chunks(16) {
            for some in grow(some.to_vec(), |(first, chunk)| {
                self.register(&voxels, first, chunk, most).sorted(lot, cells)
            }) {
                total += some.pairs.len();
                overlaps = overlaps.saturating_add(some.overlaps);
                found.push(some);
            }
            if total > most {
                let needed = held.saturating_add(total.saturating_mul(PER_REFERENCE));
                return match self.params.memory_limit {
                    Some(limit) => Err(BuildError::OutOfMemory { needed, limit }),
                    None => Err(BuildError::TooManyPrimitives { len: total, max: most }),
                };
            }
        }
        let lots: Vec<usize> = (0..cells.div_ceil(lot)).collect();
        let mut dealt = grow(lots, |i| deal(&found, i, i * lot..cells.min((i + 1) * lot))).into_iter();
        let (mut starts, mut slots) = dealt.next().unwrap_or_default();
        starts.reserve_exact(cells + 1 - starts.len());
        slots.reserve_exact(total - slots.len());
        for (more_starts, more_slots) in dealt {
            let base = starts.pop().unwrap_or(0);
            starts.extend(more_starts.iter().map(|start| start + base));
            slots.extend_from_slice(&more_slots);
        }
        drop(found);
        let mut filled = Filled { voxels, starts, slots, overlaps, nested: Vec::new(), parts: task.parts };
        if may_nest {
            filled.nested = self.nested(&filled);
        }
        Ok(filled)
    }

    /// The cells of each part, and the part's number.
    fn register(&self, voxels: &Voxels, first: u32, parts: &[Part], most: usize) -> Found {
        let (strides, ruler) = (voxels.strides(), voxels.ruler());
        let mut pairs = Vec::with_capacity(parts.len() * 4);
        let mut overlaps = 0u64;
        for (slot, (prim, part)) in (first..).zip(parts) {
            let whole = ruler.ranges(part);
            // Rows along the axis of most cells; stacks of them along that of fewest.
            let spans = whole.map(|[from, to]| to - from);
            if spans == [0; 3] {
                overlaps += 1;
                let cell: usize = (0..3).map(|a| whole[a][0] as usize * strides[a]).sum();
                pairs.push((cell as u32, slot));
                continue;
            }
            let boxes = spans.map(|span| span as u64 + 1).into_iter().product();
            overlaps = overlaps.saturating_add(boxes);
            let (mut stack, mut row) = (0, 0);
            for a in 1..3 {
                stack = if spans[a] < spans[stack] { a } else { stack };
                row = if spans[a] >= spans[row] { a } else { row };
            }
            let column = 3 - stack - row;
            // Along one axis there is nothing to cut: a part reaches through all of its box.
            let cut = self.params.clip == Clip::Exact && spans[column] > 0 && *prim < self.first_link;
            let cut_to = |within: &Aabb, a: usize, cell: u32| {
                let mut region = *within;
                let [low, high] = voxels.slab(a, cell);
                region.min[a] = low;
                region.max[a] = high;
                let part =
                    self.source.clipped_bound(*prim, &region, self.origin).overlap(*within).overlap(region);
                part.is_valid().then_some(part)
            };
            let mut run = |ranges: [u32; 2], at: usize| {
                let at = at + ranges[0] as usize * strides[row];
                let cells = (0..=(ranges[1] - ranges[0]) as usize).map(|i| at + i * strides[row]);
                if pairs.len() <= most {
                    pairs.extend(cells.map(|cell| (cell as u32, slot)));
                }
            };
            for i in whole[stack][0]..=whole[stack][1] {
                let at = i as usize * strides[stack];
                let layer = if cut && spans[stack] > 0 {
                    match cut_to(part, stack, i) {
                        Some(layer) => layer,
                        None => continue,
                    }
                } else {
                    *part
                };
                let [from, to] = if cut {
                    ruler.range(column, layer.min[column], layer.max[column])
                } else {
                    whole[column]
                };
                for j in from..=to {
                    let at = at + j as usize * strides[column];
                    if !cut {
                        run(whole[row], at);
                    } else if from == to {
                        run(ruler.range(row, layer.min[row], layer.max[row]), at);
                    } else if let Some(piece) = cut_to(&layer, column, j) {
                        run(ruler.range(row, piece.min[row], piece.max[row]), at);
                    }
                }
            }
        }
        Found { pairs, overlaps, ends: Vec::new() }
    }

    /// The cells of a grid that shall be grids.
    fn nested(&self, filled: &Filled) -> Vec<(usize, Task)> {
        let full: Vec<usize> =
            (0..filled.starts.len() - 1).filter(|c| filled.starts[*c] < filled.starts[c + 1]).collect();
        let chunks: Vec<&[usize]> = full.chunks(ALONE / 8).collect();
        let found = grow(chunks, |cells| {
            cells.iter().filter_map(|cell| Some((*cell, self.inner(filled, *cell)?))).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }

    /// The grid that a cell shall be, if it shall.
    fn inner(&self, filled: &Filled, cell: usize) -> Option<Task> {
        let voxels = &filled.voxels;
        let slots = &filled.slots[filled.starts[cell] as usize..filled.starts[cell + 1] as usize];
        let least = match self.params.nest {
            Nest::Never | Nest::Sizes { .. } => return None,
            Nest::Above(most) => most as usize + 1,
            Nest::Cheaper => 2,
        };
        if slots.len() < least {
            return None;
        }
        let region = voxels.cell(voxels.at(cell));
        let mut parts = Vec::with_capacity(slots.len());
        let mut bound = Aabb::EMPTY;
        for slot in slots {
            let (prim, whole) = filled.parts[*slot as usize];
            let part = match self.params.clip {
                _ if region.contains(whole) => whole,
                Clip::Exact => {
                    self.source.clipped_bound(prim, &region, self.origin).overlap(whole).overlap(region)
                }
                Clip::Box => whole.overlap(region),
            };
            // What only seemed to reach in may be left out.
            if part.is_valid() {
                parts.push((prim, part));
                bound = bound.union(part);
            }
        }
        if parts.is_empty() {
            return None;
        }
        let count = resolve(self.params.inner, &bound, parts.len());
        let count = match self.params.inner {
            Resolution::Fixed(_) => count,
            _ => restrained(count, &bound, &parts, MOST_OVERLAPS[1]),
        };
        if self.params.nest == Nest::Cheaper {
            let inner = Voxels::new(&bound, count, 0);
            let overlaps = inner.ruler().overlaps(parts.iter().map(|(_, part)| part)) as f64;
            let share = |part: f64, whole: f64| if whole > 0.0 { (part / whole).min(1.0) } else { 1.0 };
            let [area, of_cell] = inner.areas();
            let entered = share(area, voxels.areas()[1]);
            let (pass, test) = (self.params.sah.traverse as f64, self.params.sah.intersect as f64);
            let walk = (ENTER + inner.steps()) * pass + share(of_cell, area) * overlaps * test;
            if ENTER * pass + entered * walk >= slots.len() as f64 * test {
                return None;
            }
        }
        Some(Task { bound, parts, count })
    }

    fn within(&self, needed: usize) -> Result<(), BuildError> {
        match self.params.memory_limit {
            Some(limit) if needed > limit => Err(BuildError::OutOfMemory { needed, limit }),
            _ => Ok(()),
        }
    }
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

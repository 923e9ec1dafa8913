//! The traversal: cell after cell by integer planes, inner grids on a stack.

use crate::clouds::{GRID, LEAF};
use crate::grid::{Grid, MAX_DEPTH};
use crate::voxels::Voxels;
use arrayvec::ArrayVec;
use core::ops::ControlFlow;
use rt_accel::{Mailbox, Visitor};
use rt_geom::expansion::{two_product, two_sum};
use rt_geom::{Ray, Real, Vector};

/// Half a unit in the last place of 1.
const U: f64 = f64::EPSILON / 2.0;

/// Empty cells from here on are leapt over: a leap costs as much as some three steps.
const LEAP: u8 = 4;

/// A ray relative to the origin of a grid, its direction brought to a length of 1 to 2 by a power of two, and its interval in that
/// unit, rounded outward.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    origin: [f64; 3],
    dir: [f64; 3],
    /// Infinite: parallel.
    inverse: [f64; 3],
    pub(crate) near: f64,
    pub(crate) far: f64,
    pub(crate) unit: f64,
    /// Where `origin` lies on the ray that was given, and what was rounded off it.
    start: f64,
    lost: f64,
}

impl Line {
    #[inline(always)]
    pub(crate) fn new<R: Real>(ray: &Ray<R>, origin: [f64; 3]) -> Line {
        let wide = ray.widen();
        let (o, d) = (wide.origin.to_array(), wide.dir.to_array());
        let most = wide.dir.abs().max_element();
        // Clamped, so that it and its inverse are normal.
        let exponent = ((most.to_bits() >> 52) as i64 - 1023).clamp(-1000, 1000);
        let unit = f64::from_bits(((exponent + 1023) as u64) << 52);
        let inverse_unit = f64::from_bits(((1023 - exponent) as u64) << 52);
        let dir = d.map(|d| d * inverse_unit);
        let t_min: f64 = ray.t_min.next_down().into();
        let mut line = Line {
            origin: [0, 1, 2].map(|a| o[a] - origin[a]),
            dir,
            inverse: dir.map(|d| 1.0 / d),
            near: (t_min * unit).next_down().next_down(),
            far: 0.0,
            unit,
            start: 0.0,
            lost: 0.0,
        };
        line.shorten(ray.t_max);
        line
    }

    /// Ends it at `t_max`, with room for the rounding of a computed `t`.
    #[inline(always)]
    fn shorten<R: Real>(&mut self, t_max: R) {
        let t: f64 = t_max.next_up().into();
        let far = (t * self.unit).next_up().next_up();
        self.far = if self.start == 0.0 { far } else { (far - self.start).next_up() };
    }

    /// Where it enters and leaves a box, rounded outward, within `[near, far]`; `None` for a certain miss.
    #[inline(always)]
    pub(crate) fn span(&self, voxels: &Voxels, near: f64, far: f64) -> Option<[f64; 2]> {
        let (mut from, mut to) = (near, far);
        for a in 0..3 {
            let (o, i) = (self.origin[a], self.inverse[a]);
            let (low, high) = (voxels.low[a], voxels.high[a]);
            // For each of the two planes: a difference, a reciprocal, a product; and the rounding of the origin.
            let error = 8.0 * U * (o.abs() + low.abs() + high.abs()) + self.lost;
            if i.is_infinite() {
                if o < low - error || o > high + error {
                    return None;
                }
                continue;
            }
            let (first, last) = if i < 0.0 { (high, low) } else { (low, high) };
            let room = error * i.abs() + f64::MIN_POSITIVE;
            // `max` and `min` drop the NaN of an infinite crossing less infinite room.
            from = from.max((first - o) * i - room);
            to = to.min((last - o) * i + room);
        }
        (from <= to).then_some([from, to])
    }

    /// Whether [`Walk::enter`] errs by no more than cells allow.
    #[inline(always)]
    fn is_near(&self, voxels: &Voxels) -> bool {
        (0..3).all(|a| (voxels.low[a] - self.origin[a]).abs() <= voxels.limit[a])
    }

    /// The same line from the point at `start`, by arithmetic of twice the digits; `None` where they do not suffice either. `rest` is
    /// what the origin was rounded by.
    #[cold]
    fn moved(&self, start: f64, rest: [f64; 3], voxels: &Voxels) -> Option<Line> {
        let mut line = *self;
        let mut way: f64 = 0.0;
        for a in 0..3 {
            let (step, step_rest) = two_product(start, self.dir[a]);
            let (sum, sum_rest) = two_sum(self.origin[a], step);
            line.origin[a] = sum + (sum_rest + (step_rest + rest[a]));
            way = way.max(self.origin[a].abs().max(step.abs()));
        }
        // The rests are below `2u` of the way and rounded less than eight times; of the last rounding `is_near` takes account.
        line.lost = self.lost + way * (16.0 * U * U);
        let fine = (0..3).all(|a| {
            voxels.count[a] == 1
                || line.lost <= (voxels.high[a] - voxels.low[a]) * (1.0 / (1u64 << 28) as f64)
        });
        // Too early rather than too late, for that is how an end becomes too late rather than too early.
        line.start = if self.start == 0.0 { start } else { (self.start + start).next_down() };
        line.near = (self.near - start).next_down();
        line.far = (self.far - start).next_up();
        (fine && line.is_near(voxels)).then_some(line)
    }

    /// What the origin was rounded by when it was taken relative to the grid's own; nothing once it has been moved.
    fn rest<R: Real>(&self, ray: &Ray<R>, origin: [f64; 3]) -> [f64; 3] {
        let o = ray.origin.widen();
        [0, 1, 2].map(|a| if self.start == 0.0 { two_sum(o[a], -origin[a]).1 } else { 0.0 })
    }
}

/// A walk through one grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walk {
    /// The cell, among those of all grids.
    pub(crate) cell: usize,
    /// When the walk entered the cell, and when it leaves the grid or the outer cell.
    pub(crate) entered: f64,
    end: f64,
    /// When the cell's exit plane is crossed along each axis: plane `next`, at `next * pace + base`; never the grid's own border.
    exit: [f64; 3],
    next: [f64; 3],
    pace: [f64; 3],
    base: [f64; 3],
    step: [f64; 3],
    /// How many planes are still to be crossed.
    left: [u32; 3],
    /// To the next cell's index.
    stride: [isize; 3],
    /// How many of the grids in the cell are still to be walked.
    links: u32,
    line: Line,
}

impl Walk {
    /// Walks `line` through a grid between two times at which it is in the grid's box.
    #[inline(always)]
    pub(crate) fn enter(line: Line, voxels: &Voxels, from: f64, to: f64) -> Walk {
        let strides = voxels.strides();
        let mut walk = Walk {
            cell: voxels.first,
            entered: from,
            end: to,
            exit: [f64::INFINITY; 3],
            next: [0.0; 3],
            pace: [0.0; 3],
            base: [0.0; 3],
            step: [1.0; 3],
            left: [0; 3],
            stride: [0; 3],
            links: 0,
            line,
        };
        for a in 0..3 {
            let n = voxels.count[a];
            if n == 1 {
                continue;
            }
            let (o, d, i) = (line.origin[a], line.dir[a], line.inverse[a]);
            let guess = |p: f64| ((p - voxels.low[a]) / voxels.width[a]).clamp(0.0, (n - 1) as f64) as u32;
            if i.is_infinite() {
                walk.cell += guess(o) as usize * strides[a];
                continue;
            }
            let (pace, base) = (voxels.width[a] * i, (voxels.low[a] - o) * i);
            let crossed = |k: u32| k as f64 * pace + base;
            let mut c = guess(o + d * from);
            // The cell whose planes are crossed before and after `from`.
            if i > 0.0 {
                while c > 0 && crossed(c) > from {
                    c -= 1;
                }
                while c < n - 1 && crossed(c + 1) < from {
                    c += 1;
                }
                walk.next[a] = (c + 1) as f64;
                walk.left[a] = n - 1 - c;
                walk.stride[a] = strides[a] as isize;
            } else {
                while c < n - 1 && crossed(c + 1) > from {
                    c += 1;
                }
                while c > 0 && crossed(c) < from {
                    c -= 1;
                }
                walk.next[a] = c as f64;
                walk.step[a] = -1.0;
                walk.left[a] = c;
                walk.stride[a] = -(strides[a] as isize);
            }
            (walk.pace[a], walk.base[a]) = (pace, base);
            walk.exit[a] = if walk.left[a] > 0 { walk.next[a] * pace + base } else { f64::INFINITY };
            walk.cell += c as usize * strides[a];
        }
        walk
    }

    /// The axis along which the cell is left first.
    #[inline(always)]
    fn first(&self) -> usize {
        let [x, y, z] = self.exit;
        if x <= y {
            if x <= z { 0 } else { 2 }
        } else if y <= z {
            1
        } else {
            2
        }
    }

    /// Goes on to the next cell; `false` at the end.
    #[inline(always)]
    pub(crate) fn advance(&mut self) -> bool {
        let a = self.first();
        let at = self.exit[a];
        // Infinite where no plane is left.
        if !(at <= self.end && at <= self.line.far) || self.left[a] == 0 {
            return false;
        }
        self.entered = at;
        self.left[a] -= 1;
        self.next[a] += self.step[a];
        self.exit[a] =
            if self.left[a] > 0 { self.next[a] * self.pace[a] + self.base[a] } else { f64::INFINITY };
        self.cell = self.cell.wrapping_add_signed(self.stride[a]);
        true
    }

    /// Goes on to a cell that is `distance` away along some axis; `false` at the end.
    #[inline(always)]
    fn leap(&mut self, distance: u32) -> bool {
        // When the cube of empty cells is left.
        let (mut at, mut first) = (f64::INFINITY, 0);
        for a in 0..3 {
            if self.left[a] >= distance {
                let crossed =
                    (self.next[a] + self.step[a] * (distance - 1) as f64) * self.pace[a] + self.base[a];
                if crossed < at {
                    (at, first) = (crossed, a);
                }
            }
        }
        if !(at <= self.end && at <= self.line.far) || self.left[first] < distance {
            return false;
        }
        self.entered = at;
        for a in 0..3 {
            if self.left[a] == 0 {
                continue;
            }
            let (next, step, pace, base) = (self.next[a], self.step[a], self.pace[a], self.base[a]);
            let crossed = |n: u32| (next + step * n as f64) * pace + base;
            // How many planes are crossed before: estimated, then made to fit what the walk says.
            let n = if a == first {
                distance
            } else {
                let most = self.left[a].min(distance - 1);
                let guess = (at - self.exit[a]) / self.pace[a].abs();
                let mut n = (guess.max(-1.0) + 1.0).min(most as f64) as u32;
                while n > 0 && crossed(n - 1) >= at {
                    n -= 1;
                }
                while n < most && crossed(n) < at {
                    n += 1;
                }
                n
            };
            self.next[a] += self.step[a] * n as f64;
            self.left[a] -= n;
            self.exit[a] = if self.left[a] > 0 { crossed(n) } else { f64::INFINITY };
            self.cell = self.cell.wrapping_add_signed(self.stride[a] * n as isize);
        }
        true
    }
}

impl Grid {
    /// Shows `visit` the cells that the ray may touch, near to far.
    #[inline(always)]
    pub(crate) fn walk<R: Real, M: Mailbox>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if !ray.is_valid() {
            return;
        }
        if self.outside > 0 && visit.leaf(self.outside(), ray).is_break() {
            return;
        }
        let Some(top) = self.grids.first() else { return };
        let line = Line::new(ray, self.origin.to_array());
        let Some([from, to]) = line.span(top, line.near, line.far) else { return };
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<Walk, MAX_DEPTH>::new();
        let mut walk = match line.is_near(top) {
            true => Walk::enter(line, top, from, to),
            false => match line
                .moved(from, line.rest(ray, self.origin.to_array()), top)
                .and_then(|line| Some((line, line.span(top, line.near, line.far)?)))
            {
                Some((line, [from, to])) => Walk::enter(line, top, from, to),
                None => {
                    let _ = self.everything(0, ray, visit);
                    return;
                }
            },
        };
        loop {
            visit.node();
            let kind = self.kinds[walk.cell];
            let goes_on = match kind {
                LEAF => {
                    let before = ray.t_max;
                    if mailbox.show(self.leaf(walk.cell), ray, visit).is_break() {
                        return;
                    }
                    if ray.t_max != before {
                        walk.line.shorten(ray.t_max);
                    }
                    walk.advance()
                }
                GRID => {
                    walk.links = self.links(walk.cell) as u32;
                    let leaf = self.leaf(walk.cell);
                    if !leaf.prims.is_empty() && mailbox.show(leaf, ray, visit).is_break() {
                        return;
                    }
                    walk.line.shorten(ray.t_max);
                    match self.descend(&mut walk, ray, visit) {
                        ControlFlow::Break(()) => return,
                        ControlFlow::Continue(Some(inner)) => {
                            let _ = stack.try_push(walk);
                            walk = inner;
                            continue;
                        }
                        ControlFlow::Continue(None) => walk.advance(),
                    }
                }
                distance if distance < LEAP => walk.advance(),
                distance => walk.leap(distance as u32),
            };
            if goes_on {
                continue;
            }
            // Out of this grid, and on in those around it.
            loop {
                let Some(outer) = stack.pop() else { return };
                walk = outer;
                walk.line.shorten(ray.t_max);
                if walk.links > 0 {
                    match self.descend(&mut walk, ray, visit) {
                        ControlFlow::Break(()) => return,
                        ControlFlow::Continue(Some(inner)) => {
                            let _ = stack.try_push(walk);
                            walk = inner;
                            break;
                        }
                        ControlFlow::Continue(None) => {}
                    }
                }
                if walk.advance() {
                    break;
                }
            }
        }
    }

    /// The walk through the next grid in a cell that the ray does not miss, as far as the cell goes; none where no grid is left.
    #[inline(never)]
    fn descend<R: Real>(
        &self,
        walk: &mut Walk,
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) -> ControlFlow<(), Option<Walk>> {
        while walk.links > 0 {
            let inner = self.link(walk.cell, walk.links);
            walk.links -= 1;
            let found = self.enter(inner, walk, ray, visit)?;
            if found.is_some() {
                return ControlFlow::Continue(found);
            }
            walk.line.shorten(ray.t_max);
        }
        ControlFlow::Continue(None)
    }

    /// The walk through one of the grids in a cell; none where the ray misses it or has been shown all of it.
    #[inline(always)]
    fn enter<R: Real>(
        &self,
        inner: usize,
        walk: &Walk,
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) -> ControlFlow<(), Option<Walk>> {
        let Some(voxels) = self.grids.get(inner) else { return ControlFlow::Continue(None) };
        let line = walk.line;
        let leaves = walk.exit[walk.first()].min(walk.end).min(line.far);
        let Some([from, to]) = line.span(voxels, walk.entered, leaves) else {
            return ControlFlow::Continue(None);
        };
        if line.is_near(voxels) {
            return ControlFlow::Continue(Some(Walk::enter(line, voxels, from, to)));
        }
        let rest = line.rest(ray, self.origin.to_array());
        let Some(moved) = line.moved(from, rest, voxels) else {
            self.everything(inner, ray, visit)?;
            return ControlFlow::Continue(None);
        };
        let (entered, leaves) = ((walk.entered - from).next_down(), (leaves - from).next_up());
        let span = moved.span(voxels, entered.max(moved.near), leaves.min(moved.far));
        ControlFlow::Continue(span.map(|[from, to]| Walk::enter(moved, voxels, from, to)))
    }

    /// Shows all cells of a grid and of those within.
    #[cold]
    fn everything<R: Real>(
        &self,
        grid: usize,
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) -> ControlFlow<()> {
        // A grid may stand in several cells, and only in grids before it.
        let mut within = vec![false; self.grids.len()];
        within[grid] = true;
        for (g, voxels) in self.grids.iter().enumerate().skip(grid) {
            if !within[g] {
                continue;
            }
            for cell in voxels.first..voxels.first + voxels.cells() {
                visit.node();
                if !matches!(self.kinds[cell], LEAF | GRID) {
                    continue;
                }
                let leaf = self.leaf(cell);
                if !leaf.prims.is_empty() {
                    visit.leaf(leaf, ray)?;
                }
                if self.kinds[cell] == GRID {
                    self.inner(cell).for_each(|inner| within[inner] = true);
                }
            }
        }
        ControlFlow::Continue(())
    }
}

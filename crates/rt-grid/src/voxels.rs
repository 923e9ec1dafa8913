//! [`Voxels`]: a box in equal cells; where its planes are.

use crate::params::Resolution;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{f32_above, f32_below};

/// Most cells along an axis.
pub(crate) const MOST_ALONG: u32 = 1 << 20;
/// Most cells of a grid.
pub(crate) const MOST_CELLS: usize = 1 << 30;
/// By which share of the grid's side a primitive is registered beyond its own extent: twice what the walk may err by.
const PAD: f64 = 1.0 / (1u64 << 25) as f64;
/// How many sides away a ray may start so that the walk errs by no more.
const REACH: f64 = (1u64 << 23) as f64;

/// A box in equal cells: plane `k` along an axis lies at `low + k * width`, without rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Voxels {
    pub(crate) low: [f64; 3],
    pub(crate) high: [f64; 3],
    pub(crate) width: [f64; 3],
    pub(crate) count: [u32; 3],
    /// Where its cells begin among those of all grids.
    pub(crate) first: usize,
    /// How far from `low` a ray may start, along each axis, to be walked in `f64`.
    pub(crate) limit: [f64; 3],
}

impl Voxels {
    /// Cells in a finite box. Along an axis where they would be too thin for `f64` there is one.
    pub(crate) fn new(bound: &Aabb, mut count: [u32; 3], first: usize) -> Voxels {
        let (low, high) = (bound.min.as_dvec3().to_array(), bound.max.as_dvec3().to_array());
        let (mut width, mut limit) = ([0.0; 3], [f64::INFINITY; 3]);
        for a in 0..3 {
            let side = high[a] - low[a];
            let reach = REACH * side - low[a].abs();
            if side <= 0.0 || reach <= side {
                count[a] = 1;
            }
            width[a] = side / count[a] as f64;
            if count[a] > 1 {
                limit[a] = reach;
            }
        }
        Voxels { low, high, width, count, first, limit }
    }

    pub(crate) fn cells(&self) -> usize {
        self.count.iter().map(|n| *n as usize).product()
    }

    /// The box.
    pub(crate) fn bound(&self) -> Aabb {
        // Made from f32.
        Aabb { min: DVec3::from_array(self.low).as_vec3a(), max: DVec3::from_array(self.high).as_vec3a() }
    }

    /// Which cell along each axis the cell of this index is.
    pub(crate) fn at(&self, index: usize) -> [u32; 3] {
        let [_, per_row, per_layer] = self.strides();
        [index % per_row, index % per_layer / per_row, index / per_layer].map(|c| c as u32)
    }

    /// How far apart in memory the next cell along each axis is.
    #[inline(always)]
    pub(crate) fn strides(&self) -> [usize; 3] {
        [1, self.count[0] as usize, self.count[0] as usize * self.count[1] as usize]
    }

    /// Which cells intervals and boxes reach into.
    pub(crate) fn ruler(&self) -> Ruler {
        let mut ruler = Ruler { low: self.low, per: [0.0; 3], pad: [0.0; 3], last: [0.0; 3] };
        for a in (0..3).filter(|a| self.count[*a] > 1) {
            let n = self.count[a] as f64;
            (ruler.per[a], ruler.pad[a], ruler.last[a]) = (1.0 / self.width[a], n * PAD, n - 1.0);
        }
        ruler
    }

    /// The least and the greatest coordinate in a cell, by as much more as the walk errs.
    pub(crate) fn slab(&self, a: usize, cell: u32) -> [f32; 2] {
        if self.count[a] == 1 {
            return [self.low[a] as f32, self.high[a] as f32];
        }
        let pad = (self.high[a] - self.low[a]) * PAD;
        let plane = |k: u32| self.low[a] + k as f64 * self.width[a];
        [f32_below(plane(cell) - pad), f32_above(plane(cell + 1) + pad)]
    }

    /// A cell's box, larger by as much as the walk errs.
    pub(crate) fn cell(&self, at: [u32; 3]) -> Aabb {
        let mut b = Aabb::EMPTY;
        for a in 0..3 {
            [b.min[a], b.max[a]] = self.slab(a, at[a]);
        }
        b
    }

    /// The expected number of cells that an isotropic line through the box visits.
    ///
    /// A cell's planes across each axis are met as often as their area's share of the box's projected area, summed over directions.
    pub(crate) fn steps(&self) -> f64 {
        let s = [0, 1, 2].map(|a| self.high[a] - self.low[a]);
        let faces = [s[1] * s[2], s[0] * s[2], s[0] * s[1]];
        let all = faces[0] + faces[1] + faces[2];
        if all <= 0.0 {
            return 1.0;
        }
        1.0 + (0..3).map(|a| (self.count[a] - 1) as f64 * faces[a]).sum::<f64>() / all
    }

    /// Half the surface of the box, and of a cell.
    pub(crate) fn areas(&self) -> [f64; 2] {
        let half = |s: [f64; 3]| s[0] * s[1] + s[1] * s[2] + s[2] * s[0];
        [half([0, 1, 2].map(|a| self.high[a] - self.low[a])), half(self.width)]
    }
}

/// [`Voxels`] from the point of view of coordinates. Along an axis with one cell everything lies in that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ruler {
    low: [f64; 3],
    /// Cells in a unit of length.
    per: [f64; 3],
    /// By how much the walk errs, and as much again for the roundings here, in cells.
    pad: [f64; 3],
    last: [f64; 3],
}

impl Ruler {
    /// The first and the last cell that `[from, to]` reaches into, by as much as the walk errs.
    #[inline(always)]
    pub(crate) fn range(&self, a: usize, from: f32, to: f32) -> [u32; 2] {
        let along = |x: f32| (x as f64 - self.low[a]) * self.per[a];
        // Casts are to zero, which is down here.
        let cell = |x: f64| x.max(0.0).min(self.last[a]) as i32 as u32;
        [cell(along(from) - self.pad[a]), cell(along(to) + self.pad[a])]
    }

    /// [`Ruler::range`] along all axes.
    #[inline(always)]
    pub(crate) fn ranges(&self, b: &Aabb) -> [[u32; 2]; 3] {
        let (min, max) = (b.min.to_array(), b.max.to_array());
        [0, 1, 2].map(|a| self.range(a, min[a], max[a]))
    }

    /// How many cells the boxes overlap in all.
    pub(crate) fn overlaps<'b>(&self, boxes: impl Iterator<Item = &'b Aabb>) -> u64 {
        let each =
            boxes.map(|b| self.ranges(b).iter().map(|[from, to]| (to - from + 1) as u64).product::<u64>());
        each.fold(0, u64::saturating_add)
    }

    /// No less than [`Ruler::overlaps`], and several times as fast.
    fn overlaps_at_most(&self, parts: &[(u32, Aabb)]) -> f64 {
        let mut total = 0.0;
        for (_, b) in parts {
            let (min, max) = (b.min.to_array(), b.max.to_array());
            // An interval reaches into one cell more than it is long, and into one more; a millionth is for rounding.
            total += (0..3)
                .map(|a| {
                    let long = (max[a] as f64 - min[a] as f64) * self.per[a];
                    (long * 1.000001 + 2.000001 + 2.0 * self.pad[a]).min(self.last[a] + 1.0)
                })
                .product::<f64>();
        }
        total * 1.000001
    }
}

/// The number of cells along each axis that a rule asks for, for `n` primitives in a finite box.
pub(crate) fn resolve(rule: Resolution, bound: &Aabb, n: usize) -> [u32; 3] {
    let s = [0, 1, 2].map(|a| bound.max[a] as f64 - bound.min[a] as f64);
    let longest = s.iter().copied().fold(0.0, f64::max);
    let n = n as f64;
    let each = |f: &dyn Fn(f64) -> f64| {
        [0, 1, 2].map(|a| if s[a] > 0.0 { f(s[a] / longest).clamp(1.0, MOST_ALONG as f64) as u32 } else { 1 })
    };
    match rule {
        Resolution::Fixed(count) => [0, 1, 2].map(|a| if s[a] > 0.0 { count[a] } else { 1 }),
        Resolution::Root(d) => each(&|_| (d as f64 * n.cbrt()).round()),
        Resolution::Woo(d) => each(&|s| (d as f64 * n).cbrt() * s),
        Resolution::Pharr => each(&|s| (3.0 * n.cbrt() * s).round().min(64.0)),
        Resolution::Density(lambda) => dense(s, lambda as f64 * n),
        Resolution::Measured { .. } => dense(s, 5.0 * n),
    }
}

/// About `cells` cells, as near to cubes as can be.
fn dense(s: [f64; 3], cells: f64) -> [u32; 3] {
    let longest = s.iter().copied().fold(0.0, f64::max);
    let mut split = s.map(|s| s > 0.0);
    loop {
        let axes = split.iter().filter(|split| **split).count();
        // Sides in units of the longest, so that no product leaves the range of f64.
        let volume: f64 = (0..3).filter(|a| split[*a]).map(|a| s[a] / longest).product();
        let per = (cells / volume).powf(1.0 / axes.max(1) as f64);
        let short = (0..3).find(|a| split[*a] && s[*a] / longest * per < 1.0 && s[*a] < longest);
        match short {
            Some(a) => split[a] = false,
            None => {
                return [0, 1, 2].map(|a| {
                    let n = if split[a] { (s[a] / longest * per).round() } else { 1.0 };
                    n.clamp(1.0, MOST_ALONG as f64) as u32
                });
            }
        }
    }
}

/// Halves the longest axes until there are few enough cells and boxes overlap few enough of them.
pub(crate) fn restrained(mut count: [u32; 3], bound: &Aabb, parts: &[(u32, Aabb)], most: u64) -> [u32; 3] {
    loop {
        let voxels = Voxels::new(bound, count, 0);
        let few = voxels.count.iter().map(|n| *n as u64).product::<u64>() <= MOST_CELLS as u64;
        let most = most.saturating_mul(parts.len() as u64);
        let ruler = voxels.ruler();
        let sparse = || {
            ruler.overlaps_at_most(parts) <= most as f64
                || ruler.overlaps(parts.iter().map(|(_, part)| part)) <= most
        };
        if voxels.count == [1; 3] || few && sparse() {
            return voxels.count;
        }
        let longest = voxels.count.into_iter().fold(1, u32::max);
        count = voxels.count.map(|n| if n > longest / 2 { n.div_ceil(2) } else { n });
    }
}

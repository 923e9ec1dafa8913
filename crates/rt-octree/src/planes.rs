//! Where the planes of a cell lie, and what its parts are.

use crate::params::OctreeParams;
use rt_bounds::Aabb;
use rt_geom::glam::Vec3A;

/// A primitive, and the box of what of it lies in the cell at hand.
pub(crate) type Part = (u32, Aabb);

/// The child of a cell with this number: bits 0, 1 and 2 say above for x, y and z. A plane belongs to both its sides.
#[inline]
pub(crate) fn child(cell: &Aabb, planes: [f32; 3], number: usize) -> Aabb {
    let mut part = *cell;
    for a in 0..3 {
        if number >> a & 1 == 1 {
            part.min[a] = planes[a];
        } else {
            part.max[a] = planes[a];
        }
    }
    part
}

/// The planes in the middle of a cell, `core` being a box around all finite coordinates. Along an axis where there is
/// no middle the plane lies on the upper face: everything is below.
#[inline(always)]
pub(crate) fn middle(cell: &Aabb, core: &Aabb) -> [f32; 3] {
    let middle = cell.min * 0.5 + cell.max * 0.5;
    // Towards infinity, the ends of what is finite.
    let middle = if middle.is_finite() { middle } else { middle_of_infinite(cell, core) };
    let inside = cell.min.cmplt(middle) & middle.cmplt(cell.max);
    Vec3A::select(inside, middle, cell.max).to_array()
}

#[cold]
fn middle_of_infinite(cell: &Aabb, core: &Aabb) -> Vec3A {
    let mut middle = cell.min * 0.5 + cell.max * 0.5;
    for a in 0..3 {
        if !cell.min[a].is_finite() {
            middle[a] = core.min[a];
        } else if !cell.max[a].is_finite() {
            middle[a] = core.max[a];
        }
    }
    middle
}

/// Half the surface area, in `f64`, where boxes of `f32` stay in range; infinite sides count as the largest finite ones.
#[inline]
pub(crate) fn area(b: &Aabb) -> f64 {
    let s = b.size().min(Vec3A::splat(f32::MAX)).as_dvec3();
    s.x * s.y + s.y * s.z + s.z * s.x
}

/// Which share of the lines that meet a cell meet a part of it; of a cell without area, by length.
#[inline]
pub(crate) fn share(part: &Aabb, cell: &Aabb) -> f64 {
    let whole = area(cell);
    if whole > 0.0 {
        return area(part) / whole;
    }
    let length = |b: &Aabb| b.size().min(Vec3A::splat(f32::MAX)).as_dvec3().element_sum();
    if length(cell) > 0.0 { length(part) / length(cell) } else { 1.0 }
}

/// How finely positions are looked at along an axis, at most.
const BINS: usize = 32;

/// What begins and ends in one thirty-second of the extent of some parts along an axis, in each of the four regions
/// into which planes across the other axes part the cell.
#[derive(Clone, Copy, Debug)]
struct Bin {
    begin: [u32; 4],
    end: [u32; 4],
    /// The least and the greatest end of a part here.
    least: f32,
    greatest: f32,
}

impl Bin {
    const EMPTY: Bin = Bin { begin: [0; 4], end: [0; 4], least: f32::INFINITY, greatest: f32::NEG_INFINITY };
}

/// The ends of some parts along one axis, counted.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    axis: usize,
    /// The other axes, and the planes across them.
    others: [(usize, f32); 2],
    low: f32,
    scale: f32,
    last: usize,
    count: [u32; 4],
    bins: [Bin; BINS],
}

impl Bins {
    /// Nothing counted yet of about `parts` parts, along an axis of a cell in which they have their finite coordinates
    /// in `core`, with planes across the other axes.
    pub(crate) fn new(axis: usize, parts: usize, core: &Aabb, planes: [f32; 3]) -> Bins {
        let size = core.max[axis] - core.min[axis];
        // A few for each of a few parts.
        let bins = (2 * parts).clamp(4, BINS);
        // Of the smallest sizes there is no reciprocal.
        let scale = if size > 0.0 { (bins as f32 / size).min(f32::MAX) } else { 0.0 };
        let others = [(axis + 1) % 3, (axis + 2) % 3].map(|a| (a, planes[a]));
        Bins {
            axis,
            others,
            low: core.min[axis],
            scale,
            last: bins - 1,
            count: [0; 4],
            bins: [Bin::EMPTY; BINS],
        }
    }

    /// Counts some parts.
    pub(crate) fn count(&mut self, parts: &[Part]) {
        let [(b, at_b), (c, at_c)] = self.others;
        // Casts saturate, and NaN is 0. Monotone, so bins are in the order of the positions in them.
        let (low, scale, last) = (self.low, self.scale, self.last.min(BINS - 1));
        let bin = |x: f32| (((x - low) * scale) as usize).min(last);
        for (_, part) in parts {
            let (from, to) = (part.min[self.axis], part.max[self.axis]);
            let (first, last) = (bin(from), bin(to));
            let sides = |a: usize, at: f32| {
                let above = part.max[a] > at;
                (!above || part.min[a] < at, above)
            };
            let ((b_under, b_over), (c_under, c_over)) = (sides(b, at_b), sides(c, at_c));
            let regions =
                [b_under && c_under, b_over && c_under, b_under && c_over, b_over && c_over].map(u32::from);
            for (q, here) in regions.into_iter().enumerate() {
                self.bins[first].begin[q] += here;
                self.bins[last].end[q] += here;
                self.count[q] += here;
            }
            self.bins[first].least = self.bins[first].least.min(from);
            self.bins[first].greatest = self.bins[first].greatest.max(from);
            self.bins[last].least = self.bins[last].least.min(to);
            self.bins[last].greatest = self.bins[last].greatest.max(to);
        }
    }

    /// Counts what another one has counted too.
    pub(crate) fn add(&mut self, other: &Bins) {
        for (mine, theirs) in self.bins.iter_mut().zip(&other.bins) {
            for q in 0..4 {
                mine.begin[q] += theirs.begin[q];
                mine.end[q] += theirs.end[q];
            }
            mine.least = mine.least.min(theirs.least);
            mine.greatest = mine.greatest.max(theirs.greatest);
        }
        for (mine, theirs) in self.count.iter_mut().zip(other.count) {
            *mine += theirs;
        }
    }

    /// The plane along the axis at which passing what was counted costs least, and that cost; the upper face where none
    /// pays.
    pub(crate) fn cheapest(&self, cell: &Aabb, params: &OctreeParams) -> (f32, f64) {
        let (visit, test) = (params.sah.traverse as f64, params.sah.intersect as f64);
        let (low, high) = (cell.min[self.axis], cell.max[self.axis]);
        let shares = self.shares(cell);
        let price = |counts: [u32; 4], length: f64| {
            let mut price = 0.0;
            for (n, [flat, per_length]) in counts.into_iter().zip(shares) {
                let share = flat + per_length * length;
                price += if n == 0 { 0.0 } else { share * (visit + test * n as f64) };
            }
            price
        };
        let length = |from: f32, to: f32| (to - from).min(f32::MAX) as f64;
        let mut best = (high, price(self.count, length(low, high)));
        let mut consider = |position: f32, below: [u32; 4], above: [u32; 4]| {
            if low < position && position < high && position.is_finite() {
                let cost = price(below, length(low, position)) + price(above, length(position, high));
                if cost < best.1 {
                    best = (position, cost);
                }
            }
        };
        // Between bins: what begins before may reach below, what ends after above.
        let (mut below, mut above) = ([0; 4], self.count);
        let mut before = f32::NEG_INFINITY;
        for bin in &self.bins[..=self.last.min(BINS - 1)] {
            if bin.least > bin.greatest {
                continue;
            }
            consider(before, below, above);
            consider(bin.least, below, above);
            for q in 0..4 {
                below[q] += bin.begin[q];
                above[q] -= bin.end[q];
            }
            before = bin.greatest;
        }
        consider(before, below, above);
        best
    }

    /// The share of the lines through a cell that meet part of a region, as `[a, b]` of `a + b * length` along the axis.
    fn shares(&self, cell: &Aabb) -> [[f64; 2]; 4] {
        let side = |from: f32, to: f32| (to - from).clamp(0.0, f32::MAX) as f64;
        let [(b, at_b), (c, at_c)] = self.others;
        let whole = [
            side(cell.min[self.axis], cell.max[self.axis]),
            side(cell.min[b], cell.max[b]),
            side(cell.min[c], cell.max[c]),
        ];
        let [x, y, z] = whole;
        let (area, length) = (x * y + y * z + z * x, x + y + z);
        let ys = [side(cell.min[b], at_b), side(at_b, cell.max[b])];
        let zs = [side(cell.min[c], at_c), side(at_c, cell.max[c])];
        [0, 1, 2, 3].map(|q| {
            let (y, z) = (ys[q & 1], zs[q >> 1]);
            if area > 0.0 {
                [y * z / area, (y + z) / area]
            } else if length > 0.0 {
                [(y + z) / length, 1.0 / length]
            } else {
                [1.0, 0.0]
            }
        })
    }
}

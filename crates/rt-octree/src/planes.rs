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

/// The planes in the middle of a cell, `core` being a box around all finite coordinates. Along an axis where there is no middle
/// the plane lies on the upper face: everything is below.
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

/// How finely positions are looked at along an axis.
const BINS: usize = 32;

/// What begins and ends in one thirty-second of the extent of some parts along an axis.
#[derive(Clone, Copy, Debug)]
struct Bin {
    begin: u32,
    end: u32,
    /// The least and the greatest end of a part here.
    least: f32,
    greatest: f32,
}

impl Bin {
    const EMPTY: Bin = Bin { begin: 0, end: 0, least: f32::INFINITY, greatest: f32::NEG_INFINITY };

    fn see(&mut self, position: f32) {
        self.least = self.least.min(position);
        self.greatest = self.greatest.max(position);
    }
}

/// The ends of some parts along three axes, counted.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    low: Vec3A,
    scale: Vec3A,
    bins: [[Bin; BINS]; 3],
}

impl Bins {
    /// No parts yet, of a cell in which finite coordinates lie in `core`.
    pub(crate) fn new(core: &Aabb) -> Bins {
        let size = core.max - core.min;
        let usable = size.cmpgt(Vec3A::ZERO) & size.cmple(Vec3A::splat(f32::MAX));
        let scale = Vec3A::select(usable, BINS as f32 / size, Vec3A::ZERO);
        // Of the smallest sizes there is no reciprocal.
        let scale = scale.min(Vec3A::splat(f32::MAX));
        Bins { low: core.min, scale, bins: [[Bin::EMPTY; BINS]; 3] }
    }

    /// Counts a part.
    #[inline]
    pub(crate) fn count(&mut self, part: &Aabb) {
        // Casts saturate, and NaN is 0. Monotone, so bins are in the order of the positions in them.
        let at = |p: Vec3A| ((p - self.low) * self.scale).to_array().map(|x| (x as usize).min(BINS - 1));
        let (begin, end) = (at(part.min), at(part.max));
        for a in 0..3 {
            let bins = &mut self.bins[a];
            bins[begin[a]].begin += 1;
            bins[begin[a]].see(part.min[a]);
            bins[end[a]].end += 1;
            bins[end[a]].see(part.max[a]);
        }
    }

    /// Counts what another one has counted too.
    pub(crate) fn add(&mut self, other: &Bins) {
        for (mine, theirs) in self.bins.iter_mut().flatten().zip(other.bins.iter().flatten()) {
            mine.begin += theirs.begin;
            mine.end += theirs.end;
            mine.see(theirs.least);
            mine.see(theirs.greatest);
        }
    }

    /// The plane along each axis at which passing `count` parts costs least, with that cost; the upper face where none pays.
    pub(crate) fn planes(&self, cell: &Aabb, count: usize, params: &OctreeParams) -> [f32; 3] {
        let (visit, test) = (params.sah.traverse as f64, params.sah.intersect as f64);
        let mut planes = cell.max.to_array();
        for a in 0..3 {
            let (low, high) = (cell.min[a], cell.max[a]);
            let mut best = visit + test * count as f64;
            let mut consider = |position: f32, below: u32, above: u32| {
                if !(low < position && position < high && position.is_finite()) {
                    return;
                }
                let (mut under, mut over) = (*cell, *cell);
                under.max[a] = position;
                over.min[a] = position;
                let cost = |n: u32, part: &Aabb| {
                    if n == 0 { 0.0 } else { share(part, cell) * (visit + test * n as f64) }
                };
                let cost = cost(below, &under) + cost(above, &over);
                if cost < best {
                    (best, planes[a]) = (cost, position);
                }
            };
            // Between bins: what begins before may reach below, what ends after above.
            let (mut below, mut above) = (0, count as u32);
            let mut before = f32::NEG_INFINITY;
            for bin in &self.bins[a] {
                if bin.begin + bin.end == 0 {
                    continue;
                }
                consider(before, below, above);
                consider(bin.least, below, above);
                below += bin.begin;
                above -= bin.end;
                before = bin.greatest;
            }
            consider(before, below, above);
        }
        planes
    }
}

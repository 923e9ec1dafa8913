//! [`Parts`]: what of the primitives lies in a cell.

use crate::plane::{Plane, Scale, Side};
use arrayvec::ArrayVec;
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};

/// What of one primitive lies in a cell: a polygon, where it is known to be flat, in a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// Which primitive, by its place among those with bounds.
    pub(crate) slot: u32,
    first: u32,
    count: u32,
    pub(crate) bound: Aabb,
}

/// The parts of primitives in one cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) list: Vec<Part>,
    /// The corners of all polygons.
    corners: Vec<DVec3>,
}

impl Parts {
    /// What a triangle takes.
    pub(crate) const BYTES: usize = size_of::<Part>() + 3 * size_of::<DVec3>();

    pub(crate) fn with_capacity(parts: usize) -> Parts {
        Parts { list: Vec::with_capacity(parts), corners: Vec::with_capacity(3 * parts) }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.list.capacity() * size_of::<Part>() + self.corners.capacity() * size_of::<DVec3>()
    }

    /// Adds a part with these corners, none where only its box is known.
    pub(crate) fn push(&mut self, slot: u32, bound: Aabb, corners: &[DVec3]) {
        let first = self.corners.len() as u32;
        self.corners.extend(corners);
        self.list.push(Part { slot, first, count: corners.len() as u32, bound });
    }

    #[inline(always)]
    pub(crate) fn corners(&self, part: &Part) -> &[DVec3] {
        &self.corners[part.first as usize..(part.first + part.count) as usize]
    }

    /// Where a part lies.
    #[inline]
    pub(crate) fn side(&self, part: &Part, plane: &Plane, touch: f64) -> Side {
        let corners = self.corners(part);
        if corners.is_empty() {
            return plane.side_of_box(&part.bound, touch);
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &p in corners {
            let h = plane.height(p);
            (low, high) = (if h < low { h } else { low }, if h > high { h } else { high });
        }
        Side::of(low, high, touch)
    }

    /// Adds what of another's part has `normal . p <= most` and lies in `within`, if anything.
    ///
    /// Error: outward. Two grains more than `most` are kept, which outweighs how far corners and their heights are off.
    ///
    /// Source: Sutherland and Hodgman, "Reentrant polygon clipping", CACM 17(1) 1974.
    pub(crate) fn push_cut(
        &mut self,
        other: &Parts,
        part: &Part,
        normal: DVec3,
        most: f64,
        within: &Aabb,
        scale: Option<Scale>,
    ) {
        let old = other.corners(part);
        let first = self.corners.len();
        let mut bound = part.bound.overlap(*within);
        if let (Some(scale), [.., last]) = (scale, old) {
            let above = |p: DVec3| normal.dot(p) - most - 2.0 * scale.grain;
            let (mut p, mut hp) = (*last, above(*last));
            let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let mut keep = |p: DVec3| {
                self.corners.push(p);
                (min, max) = (min.min(p), max.max(p));
            };
            for &q in old {
                let hq = above(q);
                if (hp <= 0.0) != (hq <= 0.0) {
                    keep(p + (q - p) * (hp / (hp - hq)));
                }
                if hq <= 0.0 {
                    keep(q);
                }
                (p, hp) = (q, hq);
            }
            let grain = DVec3::splat(scale.grain);
            bound = if self.corners.len() == first {
                Aabb::EMPTY
            } else {
                bound.overlap(Aabb::from_f64(min - grain, max + grain, DVec3::ZERO))
            };
        } else if !old.is_empty() {
            self.corners.extend(old);
        }
        if bound.is_valid() {
            let count = (self.corners.len() - first) as u32;
            self.list.push(Part { slot: part.slot, first: first as u32, count, bound });
        } else {
            self.corners.truncate(first);
        }
    }
}

/// How many parts lie where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) below: usize,
    pub(crate) above: usize,
    pub(crate) both: usize,
    pub(crate) planar: usize,
}

impl Tally {
    #[inline(always)]
    fn add(&mut self, side: Side, count: usize) {
        match side {
            Side::Below => self.below += count,
            Side::Above => self.above += count,
            Side::Both => self.both += count,
            Side::Planar => self.planar += count,
        }
    }
}

/// The parts of a large cell in a tree of boxes, so that those on either side of a plane are counted without looking at each.
///
/// Source: Ize, Wald and Parker, "Ray tracing with the BSP tree", RT 2008.
#[derive(Debug)]
pub(crate) struct Crowd<'a> {
    parts: &'a Parts,
    /// In the order of the tree.
    order: Vec<u32>,
    knots: Vec<Knot>,
}

/// Some parts that are neighbours.
#[derive(Clone, Copy, Debug)]
struct Knot {
    bound: Aabb,
    first: u32,
    count: u32,
    /// The second half; the first is the next knot. None at the ends.
    second: u32,
}

/// Below this many parts each is looked at.
const FEW: usize = 8;

impl<'a> Crowd<'a> {
    /// `O(n log n)`.
    pub(crate) fn new(parts: &'a Parts) -> Crowd<'a> {
        let order = (0..parts.list.len() as u32).collect();
        let mut crowd = Crowd { parts, order, knots: Vec::new() };
        if parts.list.len() > 2 * FEW {
            crowd.knot(0, parts.list.len());
        }
        crowd
    }

    fn knot(&mut self, first: usize, count: usize) -> usize {
        let here = self.knots.len();
        let list = &self.parts.list;
        let some = &mut self.order[first..first + count];
        let bound = some.iter().fold(Aabb::EMPTY, |b, i| b.union(list[*i as usize].bound));
        self.knots.push(Knot { bound, first: first as u32, count: count as u32, second: 0 });
        if count > FEW {
            let twice = |i: &u32| -> Vec3A {
                let b = list[*i as usize].bound;
                b.min + b.max
            };
            let middles = Aabb::from_points(some.iter().map(twice));
            let a = middles.longest_axis().index();
            let half = count / 2;
            some.select_nth_unstable_by(half, |i, j| twice(i)[a].total_cmp(&twice(j)[a]).then(i.cmp(j)));
            self.knot(first, half);
            self.knots[here].second = self.knot(first + half, count - half) as u32;
        }
        here
    }

    /// How many parts lie where: as each is told apart by itself, but for parts that a grain decides.
    pub(crate) fn tally(&self, plane: &Plane, touch: f64) -> Tally {
        let mut tally = Tally::default();
        if self.knots.is_empty() {
            for part in &self.parts.list {
                tally.add(self.parts.side(part, plane, touch), 1);
            }
            return tally;
        }
        // Halves of halves: a way is never longer than the digits of the count.
        let mut stack = ArrayVec::<usize, 64>::new();
        stack.push(0);
        while let Some(at) = stack.pop() {
            let knot = self.knots[at];
            let side = plane.side_of_box(&knot.bound, touch);
            if matches!(side, Side::Below | Side::Above) {
                // Only what is all on one side and not near the plane: parts of it may still be planar.
                let clear = plane.side_of_box(&knot.bound, -touch);
                if clear == side {
                    tally.add(side, knot.count as usize);
                    continue;
                }
            }
            if knot.second == 0 {
                for &i in &self.order[knot.first as usize..(knot.first + knot.count) as usize] {
                    tally.add(self.parts.side(&self.parts.list[i as usize], plane, touch), 1);
                }
            } else {
                let _ = stack.try_push(knot.second as usize);
                let _ = stack.try_push(at + 1);
            }
        }
        tally
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crowd_is_counted_as_its_members_are() {
        let mut parts = Parts::default();
        let mut seed = 1u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f64 / (1u64 << 23) as f64 - 1.0
        };
        for slot in 0..500 {
            let middle = DVec3::new(noise(), noise(), noise());
            let corners = [0; 3].map(|_| middle + DVec3::new(noise(), noise(), noise()) * 0.05);
            let bound = Aabb::from_points(corners.map(|p| p.as_vec3a()));
            // Every fifth is known by its box only.
            parts.push(slot, bound, if slot % 5 == 0 { &[] } else { &corners });
        }
        let scale = Scale::of(&Aabb::new(Vec3A::splat(-1.1), Vec3A::splat(1.1))).unwrap();
        let crowd = Crowd::new(&parts);
        assert!(crowd.knots.len() > 50);
        for part in parts.list.iter().filter(|part| part.count > 0) {
            let [a, b, c] = *parts.corners(part) else { panic!("no triangle") };
            let plane = Plane::through(&[a, b, c], (b - a).cross(c - a), scale).unwrap();
            let mut tally = Tally::default();
            for other in &parts.list {
                tally.add(parts.side(other, &plane, plane.touch(scale)), 1);
            }
            assert!(tally.planar >= 1);
            assert_eq!(crowd.tally(&plane, plane.touch(scale)), tally);
        }
    }
}

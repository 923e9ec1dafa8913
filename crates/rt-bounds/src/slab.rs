//! The slab test: [`SlabRay`] and [`BoxPair`].

use crate::Aabb;
use rt_geom::glam::{DVec3, Vec3A, Vec4, Vec4Swizzles};
use rt_geom::{Axis, Ray, Real, Vector, f32_above, f32_below};

/// Beyond this size a coordinate of the ray's origin says nothing: that axis then never rejects.
const FAR: f64 = (1u128 << 126) as f64;
/// Below this size products of differences may underflow.
const NEAR: f64 = 1.0 / (1u128 << 100) as f64;
/// Added to the smallest origins, so that a product that underflows is still rounded outward. Four times the least normal.
const STEP: f64 = 1.0 / (1u128 << 124) as f64;
/// Relative slack of a reciprocal against the roundings of the slab test: five of `u = 2^-24`, and one for the reciprocal.
const SLACK: f64 = 6.0 / (1u64 << 24) as f64;

/// What a traversal derives from a ray, once: for each axis where and how steeply it meets planes, rounded outward.
///
/// It encloses the ray it is made from, of either precision, taken relative to the `origin` of a structure: a box that the
/// exact ray meets is never missed. Entry distances are rounded down, exit distances up:
///
/// * the reciprocal of the direction is shrunk for near planes and grown for far planes (by 6 roundings), which for
///   `t >= 0` outweighs the roundings of the difference and the product;
/// * the origin is rounded away from near planes and towards the direction's tail for far planes, as two vectors, equal for
///   most `f32` rays;
/// * a zero component gives an infinite far reciprocal and a far origin one step outside, so that `0 * inf` never occurs where
///   a box is met: a NaN, which kinds of CPU treat differently, arises only where the exact answer is a miss;
/// * distances are measured from `t_min` where that is negative, and in units of a power of two that brings the direction to
///   length 1 to 2, so that neither sign nor size of the caller's `t` matters.
///
/// Cost: three divisions a ray, in `f32` lanes for most rays of `f32`; two multiplications and three comparisons an axis and box.
///
/// Source: after Ize, "Robust BVH ray traversal", JCGT 2(2) 2013; the asymmetric reciprocals replace his padding of the exit
/// because they need no operation in the loop and hold for any reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    /// For each axis: near origin twice, far origin twice.
    pub(crate) origin: [Vec4; 3],
    /// For each axis: near reciprocal twice, negated far reciprocal twice.
    pub(crate) inverse: [Vec4; 3],
    /// Whether the direction is negative along each axis: then `max` is the near plane.
    pub(crate) negative: [bool; 3],
    /// `t` of the caller to distance here: `(t - start) * unit`.
    start: f64,
    unit: f64,
    pub(crate) near: f32,
    pub(crate) far: f32,
}

/// Two boxes side by side, in the order the slab test reads them: for each axis the two `min`, then the two `max`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[repr(C)]
pub struct BoxPair {
    /// `[left.min, right.min, left.max, right.max]` along x, y and z.
    pub planes: [[f32; 4]; 3],
}

impl BoxPair {
    /// Two boxes side by side.
    pub fn new(left: &Aabb, right: &Aabb) -> BoxPair {
        let planes = Axis::ALL.map(|axis| {
            let a = axis.index();
            [left.min[a], right.min[a], left.max[a], right.max[a]]
        });
        BoxPair { planes }
    }

    /// The two boxes.
    pub fn boxes(&self) -> [Aabb; 2] {
        let [x, y, z] = self.planes;
        [0, 1].map(|i| Aabb::new([x[i], y[i], z[i]].into(), [x[i + 2], y[i + 2], z[i + 2]].into()))
    }
}

impl SlabRay {
    /// Prepares `ray` for boxes given relative to `origin` that all lie in `world`, itself relative to `origin`.
    ///
    /// The ray must be [valid](Ray::is_valid); `world` matters only to rays with a negative `t_min`.
    #[inline(always)]
    pub fn new<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> SlabRay {
        match (ray.origin.as_f32(), ray.dir.as_f32()) {
            (Some(o), Some(d)) if origin == DVec3::ZERO => {
                Self::plain(ray, o, d).unwrap_or_else(|| Self::general(ray, origin, world))
            }
            _ => Self::general(ray, origin, world),
        }
    }

    /// The short way, in `f32` lanes, for an `f32` ray with `t_min >= 0` whose components are neither zero nor extreme. It
    /// yields what the general way yields, or a little more slack.
    #[inline(always)]
    fn plain<R: Real>(ray: &Ray<R>, o: Vec3A, d: Vec3A) -> Option<SlabRay> {
        let size = d.abs();
        let exponent = (size.max_element().to_bits() >> 23) as i32 - 127;
        let unit = f32::from_bits(((exponent.clamp(-100, 100) + 127) as u32) << 23);
        let inverse_unit = f32::from_bits(((127 - exponent.clamp(-100, 100)) as u32) << 23);
        let dir = d * inverse_unit;
        let steep = dir.abs().cmpge(Vec3A::splat(1.0 / (1u64 << 60) as f32)).all();
        let near_zero = o.abs().cmple(Vec3A::splat(FAR as f32)).all();
        let forward = ray.t_min >= R::ZERO;
        if !(steep && near_zero && forward && (-100..=100).contains(&exponent)) {
            return None;
        }
        let r = dir.recip();
        let near = r * (1.0 - SLACK as f32);
        let far = r * -(1.0 + SLACK as f32);
        // Lost in rounding unless the origin is tiny.
        let step = Vec3A::splat(STEP as f32).copysign(r);
        let (ahead, behind) = (o + step, o - step);
        let lanes = |near: f32, far: f32| Vec4::new(near, near, far, far);
        let t_min: f64 = ray.t_min.into();
        let mut slab = SlabRay {
            origin: [lanes(ahead.x, behind.x), lanes(ahead.y, behind.y), lanes(ahead.z, behind.z)],
            inverse: [lanes(near.x, far.x), lanes(near.y, far.y), lanes(near.z, far.z)],
            negative: [r.x < 0.0, r.y < 0.0, r.z < 0.0],
            start: 0.0,
            unit: unit as f64,
            near: (t_min * unit as f64) as f32 * (1.0 - SLACK as f32),
            far: 0.0,
        };
        slab.shorten(ray.t_max);
        Some(slab)
    }

    #[cold]
    fn general<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> SlabRay {
        let (o, d) = (ray.origin.widen(), ray.dir.widen());
        // A power of two that brings the largest component into [1, 2): the reciprocal then never underflows. Its exponent
        // is clamped so that it and its inverse are normal; beyond, the reciprocal saturates, outward.
        let exponent = ((d.abs().max_element().to_bits() >> 52) as i64 - 1023).clamp(-1000, 1000);
        let unit = f64::from_bits(((exponent + 1023) as u64) << 52);
        let dir = d * f64::from_bits(((1023 - exponent) as u64) << 52);
        let mut slab = SlabRay {
            origin: [Vec4::ZERO; 3],
            inverse: [Vec4::ZERO; 3],
            negative: [false; 3],
            start: 0.0,
            unit,
            near: 0.0,
            far: 0.0,
        };
        let t_min: f64 = ray.t_min.into();
        if t_min < 0.0 {
            slab.start = start_behind(t_min, o - origin, d, world);
        }
        let start = slab.start;
        for a in 0..3 {
            // Relative position, its rounding, and that of the shift along the ray.
            let shift = start * d[a];
            let moved = o[a] + shift;
            let x = moved - origin[a];
            let exact = start == 0.0 && (origin[a] == 0.0 || x + origin[a] == o[a] && o[a] - x == origin[a]);
            let error =
                if exact { 0.0 } else { (o[a].abs() + shift.abs() + origin[a].abs()) * (4.0 * f64::EPSILON) };
            let side = SlabSide::new(x, error, 1.0 / dir[a]);
            slab.origin[a] = Vec4::new(side.ahead, side.ahead, side.behind, side.behind);
            slab.inverse[a] = Vec4::new(side.near, side.near, -side.far, -side.far);
            slab.negative[a] = side.negative;
        }
        slab.near = f32_below((t_min.next_down() - start).max(0.0) * unit) * (1.0 - SLACK as f32);
        slab.shorten(ray.t_max);
        slab
    }

    /// Ends the ray at `t_max`, included, with room for the rounding of a computed `t`.
    #[inline(always)]
    pub fn shorten<R: Real>(&mut self, t_max: R) {
        let t: f64 = t_max.next_up().into();
        let t = if self.start == 0.0 { t } else { (t - self.start).next_up() };
        // Two units of f64 for the product and for a root that is off by as much.
        self.far = f32_above(t * self.unit * (1.0 + 2.0 * f64::EPSILON));
    }

    /// Where the ray enters the box, as a distance that orders boxes along this ray and compares with [`SlabRay::far`];
    /// `None` for a certain miss. The closed box of zero thickness counts.
    #[inline]
    pub fn entry(&self, b: &Aabb) -> Option<f32> {
        let (met, entry) = self.enter_pair(&BoxPair::new(b, b));
        (met & 1 == 1).then_some(entry[0])
    }

    /// Where the ray enters the box and where it leaves it or ends, rounded outward, in the unit of [`SlabRay::entry`]; `None` for
    /// a certain miss.
    #[inline]
    pub fn span(&self, b: &Aabb) -> Option<[f32; 2]> {
        let t = self.spans(&BoxPair::new(b, b));
        (t.x <= -t.z).then_some([t.x, -t.z])
    }

    /// Where the ray crosses the plane at `position` on `axis`, rounded down and up, in the unit of [`SlabRay::entry`]: for
    /// structures that split space. A crossing behind the ray's start is negative, by some amount. A ray parallel to the plane
    /// crosses it beyond everything (`[large, inf]`) or before (`[-large, -inf]`), and one within it all along (`[0, inf]`).
    #[inline(always)]
    pub fn crossing(&self, axis: Axis, position: f32) -> [f32; 2] {
        let (o, i) = (self.origin[axis.index()], self.inverse[axis.index()]);
        [(position - o.x) * i.x, (o.z - position) * i.z]
    }

    /// Whether the ray's direction is negative along each axis: it then meets the greater of two planes first.
    #[inline(always)]
    pub fn negative(&self) -> [bool; 3] {
        self.negative
    }

    /// The distance beyond which no box matters, in the unit of [`SlabRay::entry`].
    #[inline(always)]
    pub fn far(&self) -> f32 {
        self.far
    }

    /// What distances are: `(t - start) * unit`, as `[start, unit]`, `unit` a power of two that brings the largest component of
    /// the direction into `[1, 2)` (as far as its exponent lies within `-1000..=1000`). For structures that meet planes of their own.
    #[inline(always)]
    pub fn measure(&self) -> [f64; 2] {
        [self.start, self.unit]
    }

    /// The ray along an axis.
    #[inline(always)]
    pub(crate) fn side(&self, a: usize) -> SlabSide {
        let (origin, inverse) = (self.origin[a], self.inverse[a]);
        SlabSide {
            ahead: origin.x,
            behind: origin.z,
            near: inverse.x,
            far: -inverse.z,
            negative: self.negative[a],
        }
    }

    /// The least distance, the `t` it is measured from, and the power of two by which `t` becomes distance.
    #[inline(always)]
    pub(crate) fn scale(&self) -> (f32, f64, f64) {
        (self.near, self.start, self.unit)
    }

    /// [`SlabRay::entry`] of two boxes at once: which are met (bit 0 the left, bit 1 the right), and where.
    #[inline(always)]
    pub fn enter_pair(&self, pair: &BoxPair) -> (u32, [f32; 2]) {
        let t = self.spans(pair);
        let met = t.cmple(-t.zwzw()).bitmask() & 3;
        (met, [t.x, t.y])
    }

    /// Entries into two boxes, and exits negated, so that one maximum serves both.
    #[inline(always)]
    fn spans(&self, pair: &BoxPair) -> Vec4 {
        let mut t = Vec4::new(self.near, self.near, -self.far, -self.far);
        for a in 0..3 {
            let planes = Vec4::from_array(pair.planes[a]);
            let planes = if self.negative[a] { planes.zwxy() } else { planes };
            t = ((planes - self.origin[a]) * self.inverse[a]).max(t);
        }
        t
    }
}

/// A ray along one direction across slabs: what [`SlabRay`] holds for each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabSide {
    /// The origin for near planes.
    pub(crate) ahead: f32,
    /// The origin for far planes.
    pub(crate) behind: f32,
    /// The reciprocal for near planes, with its sign.
    pub(crate) near: f32,
    /// The reciprocal for far planes, with its sign.
    pub(crate) far: f32,
    /// Whether the ray descends: then the upper plane is the near one.
    pub(crate) negative: bool,
}

impl SlabSide {
    /// Encloses a ray that is at `x`, give or take `error`, and climbs by `1 / r` a unit of distance; `r` may be infinite.
    pub(crate) fn new(x: f64, error: f64, r: f64) -> SlabSide {
        let error = if x.abs() < NEAR { error + STEP } else { error };
        let (below, above) = if x.abs() + error <= FAR {
            (f32_below(x - error), f32_above(x + error))
        } else {
            (f32::NEG_INFINITY, f32::INFINITY)
        };
        let negative = r < 0.0;
        let near = ((r.abs() * (1.0 - SLACK)) as f32).min(f32::MAX);
        let far = (r.abs() * (1.0 + SLACK)) as f32;
        // Seen along the direction: the near origin lies ahead, the far origin behind.
        let (ahead, behind, sign) = if negative { (below, above, -1.0) } else { (above, below, 1.0) };
        let behind = match (far.is_infinite(), negative) {
            (false, _) => behind,
            (true, false) => behind.next_down(),
            (true, true) => behind.next_up(),
        };
        SlabSide { ahead, behind, near: near * sign, far: far * sign, negative }
    }
}

/// Where a ray with a negative `t_min` may start at the latest so that nothing of `world` lies behind it.
#[cold]
fn start_behind(t_min: f64, o: DVec3, d: DVec3, world: &Aabb) -> f64 {
    let a = Axis::longest_f64(d.abs()).index();
    let reach = o[a].abs() + (world.min[a].abs() as f64).max(world.max[a].abs() as f64);
    // Doubled for the roundings here; a world without end has nothing behind its own start but t_min itself.
    let behind = -2.0 * reach / d[a].abs();
    if behind.is_nan() { t_min } else { t_min.max(behind) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::Vec3A;

    fn entry(ray: &Ray, b: &Aabb) -> Option<f32> {
        SlabRay::new(ray, DVec3::ZERO, b).entry(b)
    }

    #[test]
    fn zeros_of_either_sign_in_box_faces_hit() {
        let b = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
        let zeros = [0.0f32, -0.0];
        for axis in 0..3 {
            for direction in [1.0f32, -1.0] {
                for z1 in zeros {
                    for z2 in zeros {
                        for p in [-1.0f32, -0.0, 0.0, 0.5, 1.0] {
                            for q in [-1.0f32, 0.0, 1.0] {
                                let mut d = Vec3A::ZERO;
                                let mut o = Vec3A::ZERO;
                                d[axis] = direction;
                                o[axis] = -5.0 * direction;
                                (d[(axis + 1) % 3], d[(axis + 2) % 3]) = (z1, z2);
                                (o[(axis + 1) % 3], o[(axis + 2) % 3]) = (p, q);
                                let t =
                                    entry(&Ray::new(o, d), &b).expect("a ray in a face is in the closed box");
                                assert!((3.99999..=4.0).contains(&t), "{o} {d} {t}");
                                // and beside it, by one unit in the last place more than the slack, it misses
                                o[(axis + 1) % 3] = 1.0f32.next_up().next_up();
                                assert_eq!(entry(&Ray::new(o, d), &b), None);
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn flat_and_point_boxes_are_hit() {
        let flat = Aabb::new(Vec3A::new(-1.0, -1.0, 1.0), Vec3A::ONE);
        assert!(entry(&Ray::new(Vec3A::ZERO, Vec3A::Z), &flat).is_some());
        let point = Aabb::new(Vec3A::splat(0.1), Vec3A::splat(0.1));
        assert!(entry(&Ray::new(Vec3A::ZERO, Vec3A::ONE), &point).is_some());
        // A point box at a subnormal coordinate.
        let tiny = Aabb::new(Vec3A::splat(5.7e-39), Vec3A::splat(5.7e-39));
        assert!(entry(&Ray::new(Vec3A::ZERO, Vec3A::ONE), &tiny).is_some());
        assert!(entry(&Ray::new(Vec3A::ZERO, Vec3A::ONE * 1e30), &tiny).is_some());
        // A ray in the plane of a flat box.
        let sheet = Aabb::new(Vec3A::new(-1e4, -5000.0, -1e4), Vec3A::new(1e4, -5000.0, 1e4));
        assert!(entry(&Ray::new(Vec3A::new(0.0, -5000.0, 0.0), Vec3A::new(0.6, 0.0, 0.8)), &sheet).is_some());
    }

    #[test]
    fn infinite_and_empty_boxes() {
        let ray = Ray::new(Vec3A::new(1.0, -3e38, 2.0), Vec3A::new(1e-30, 1.0, -0.0));
        assert!(entry(&ray, &Aabb::INFINITE).is_some());
        assert!(entry(&ray, &Aabb::EMPTY).is_none());
        let ground = Aabb::new(
            Vec3A::new(f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY),
            Vec3A::new(f32::INFINITY, 0.0, f32::INFINITY),
        );
        assert!(entry(&ray, &ground).is_some());
        assert!(entry(&Ray::new(Vec3A::Y, Vec3A::Y), &ground).is_none());
    }

    #[test]
    fn intervals_are_closed_and_may_be_negative() {
        let b = Aabb::new(Vec3A::new(-1.0, -1.0, 4.0), Vec3A::new(1.0, 1.0, 4.0));
        let ray = Ray::new(Vec3A::ZERO, Vec3A::Z);
        assert!(entry(&ray.between(0.0, 4.0), &b).is_some());
        assert!(entry(&ray.between(4.0, 5.0), &b).is_some());
        assert!(entry(&ray.between(4.0, 4.0), &b).is_some());
        assert!(entry(&ray.between(0.0, 3.9999), &b).is_none());
        assert!(entry(&ray.between(4.0001, 9.0), &b).is_none());
        let back = Ray::new(Vec3A::ZERO, -Vec3A::Z);
        for t_min in [-4.0, -5.0, -1e30, f32::NEG_INFINITY] {
            assert!(entry(&back.between(t_min, 0.0), &b).is_some(), "{t_min}");
            assert!(entry(&back.between(t_min, -4.0), &b).is_some(), "{t_min}");
        }
        assert!(entry(&back.between(-3.999, 0.0), &b).is_none());
        assert!(entry(&back.between(-9.0, -4.001), &b).is_none());
    }

    #[test]
    fn a_far_scene_is_met_through_its_own_origin() {
        let origin = DVec3::splat(1e7);
        let b = Aabb::from_f64(DVec3::splat(1e7), DVec3::splat(1e7 + 0.001), origin);
        let to = |x: f64| {
            let ray = Ray::new(DVec3::new(1e7 + x, 1e7 + 0.0005, 1e7 - 3.0), DVec3::Z);
            SlabRay::new(&ray, origin, &b).entry(&b)
        };
        assert!(to(0.0).is_some() && to(0.001).is_some());
        assert!(to(-1e-8).is_none() && to(0.001_000_1).is_none());
    }

    #[test]
    fn the_pair_answers_as_its_boxes() {
        let left = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
        let right = Aabb::new(Vec3A::splat(2.0), Vec3A::splat(3.0));
        let pair = BoxPair::new(&left, &right);
        assert_eq!(pair.boxes(), [left, right]);
        let ray = Ray::new(Vec3A::splat(4.0), Vec3A::splat(-1.0)).between(0.0, 2.5);
        let slab = SlabRay::new(&ray, DVec3::ZERO, &left.union(right));
        let (hit, entry) = slab.enter_pair(&pair);
        assert_eq!(hit, 2);
        assert!((0.999..=1.0).contains(&entry[1]));
    }
}

//! [`Aabb`]: axis-aligned boxes.

use rt_geom::expansion::two_sum;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Axis, Ray, Real, Transform, Vector, f32_below};

/// Beyond this size an outward-rounded coordinate becomes infinite: differences of two smaller ones never overflow.
const FAR: f64 = (1u128 << 126) as f64;

/// An axis-aligned box in `f32`: the points between `min` and `max`, both included.
///
/// A box may be flat or a point. It may be infinite on any side. It is [empty](Aabb::EMPTY) when a `min` exceeds its `max`,
/// and [not valid](Aabb::is_valid) when it is empty or holds a NaN.
///
/// ```
/// use rt_bounds::Aabb;
/// use rt_geom::glam::Vec3A;
/// let b = Aabb::from_points([Vec3A::ZERO, Vec3A::new(1.0, 2.0, 3.0)]);
/// assert_eq!(b.surface_area(), 22.0);
/// assert_eq!(b.union(Aabb::EMPTY), b);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The least corner.
    pub min: Vec3A,
    /// The greatest corner.
    pub max: Vec3A,
}

impl Default for Aabb {
    fn default() -> Aabb {
        Aabb::EMPTY
    }
}

impl Aabb {
    /// The box of nothing: neutral under [`Aabb::union`], hit by no ray whose origin lies within `2^126` of zero.
    pub const EMPTY: Aabb = Aabb { min: Vec3A::splat(f32::INFINITY), max: Vec3A::splat(f32::NEG_INFINITY) };

    /// All of space.
    pub const INFINITE: Aabb =
        Aabb { min: Vec3A::splat(f32::NEG_INFINITY), max: Vec3A::splat(f32::INFINITY) };

    /// The box between two corners.
    #[inline(always)]
    pub const fn new(min: Vec3A, max: Vec3A) -> Aabb {
        Aabb { min, max }
    }

    /// The box of some points; empty for none. A NaN in any point makes the box all NaN, so that no bad vertex hides.
    pub fn from_points(points: impl IntoIterator<Item = Vec3A>) -> Aabb {
        let mut b = Aabb::EMPTY;
        let mut poisoned = false;
        for p in points {
            poisoned |= p.is_nan();
            b = b.grow(p);
        }
        if poisoned { Aabb::new(Vec3A::NAN, Vec3A::NAN) } else { b }
    }

    /// The box between two corners given in `f64`, relative to `origin`, rounded outward. Coordinates beyond `2^126` become
    /// infinite.
    #[inline]
    pub fn from_f64(min: DVec3, max: DVec3, origin: DVec3) -> Aabb {
        let mut b = Aabb::EMPTY;
        for a in 0..3 {
            b.min[a] = offset_below(min[a], origin[a]);
            b.max[a] = offset_above(max[a], origin[a]);
        }
        b
    }

    /// The box relative to `origin`, rounded outward.
    #[inline]
    pub fn relative_to(self, origin: DVec3) -> Aabb {
        if origin == DVec3::ZERO && self.within_reach() {
            return self;
        }
        Aabb::from_f64(self.min.as_dvec3(), self.max.as_dvec3(), origin)
    }

    fn within_reach(self) -> bool {
        let far = Vec3A::splat(FAR as f32);
        (self.min.cmpge(-far) & self.max.cmple(far)).all()
    }

    /// The least box around both.
    ///
    /// A NaN yields to the number on the other side: after a union with a good box nothing shows that one was bad. So what may
    /// not be [valid](Aabb::is_valid) is checked before.
    #[inline(always)]
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The least box around this one and `p`.
    #[inline(always)]
    pub fn grow(self, p: Vec3A) -> Aabb {
        Aabb { min: self.min.min(p), max: self.max.max(p) }
    }

    /// What both boxes share; empty where they do not meet.
    #[inline(always)]
    pub fn overlap(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether every point of `other` lies in this box. True for an empty `other`, false when either holds a NaN.
    #[inline]
    pub fn contains(self, other: Aabb) -> bool {
        other.is_empty() || (self.min.cmple(other.min) & other.max.cmple(self.max)).all()
    }

    /// Whether a `min` exceeds its `max`. False when the box holds a NaN and is otherwise ordered.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Whether the box holds a point and no NaN. An infinite box is valid, but not one whose points are all at infinity.
    #[inline]
    pub fn is_valid(self) -> bool {
        self.min.cmple(self.max).all()
            && self.min.cmplt(Vec3A::INFINITY).all()
            && self.max.cmpgt(Vec3A::NEG_INFINITY).all()
    }

    /// The middle. Never overflows; 0 along an axis infinite on both sides, the finite end along one infinite on one.
    #[inline]
    pub fn center(self) -> Vec3A {
        let c = self.min * 0.5 + self.max * 0.5;
        if c.is_finite() { c } else { self.center_of_infinite() }
    }

    #[cold]
    fn center_of_infinite(self) -> Vec3A {
        let mut c = Vec3A::ZERO;
        for a in 0..3 {
            c[a] = match (self.min[a].is_finite(), self.max[a].is_finite()) {
                (true, true) => self.min[a] * 0.5 + self.max[a] * 0.5,
                (true, false) => self.min[a],
                (false, true) => self.max[a],
                (false, false) => 0.0,
            };
        }
        c
    }

    /// The side lengths; zero when empty.
    #[inline(always)]
    pub fn size(self) -> Vec3A {
        (self.max - self.min).max(Vec3A::ZERO)
    }

    /// The area of the six faces; 0 when empty, infinite when a side is (even of a flat box) or when it overflows.
    #[inline]
    pub fn surface_area(self) -> f32 {
        let s = self.size();
        let area = 2.0 * (s.x * s.y + s.y * s.z + s.z * s.x);
        if area.is_nan() { f32::INFINITY } else { area }
    }

    /// The volume; 0 when empty, infinite when a side is (even of a flat box) or when it overflows.
    #[inline]
    pub fn volume(self) -> f32 {
        let s = self.size().as_dvec3();
        let volume = s.x * s.y * s.z;
        if volume.is_nan() { f32::INFINITY } else { volume as f32 }
    }

    /// The eight corners: `x` changes fastest, the least first. Meaningless when empty.
    pub fn corners(self) -> [Vec3A; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
            let pick = |bit: usize, a: usize| if i >> bit & 1 == 0 { self.min[a] } else { self.max[a] };
            Vec3A::new(pick(0, 0), pick(1, 1), pick(2, 2))
        })
    }

    /// Whether the point lies in the box, on its faces too; false for NaN.
    #[inline]
    pub fn contains_point(self, p: Vec3A) -> bool {
        (self.min.cmple(p) & p.cmple(self.max)).all()
    }

    /// The point of the box nearest to `p`, exactly; `p` itself if it lies in the box. Meaningless when empty.
    #[inline]
    pub fn closest_point(self, p: Vec3A) -> Vec3A {
        p.max(self.min).min(self.max)
    }

    /// The squared distance from `p`, 0 inside and infinite from an empty box, within `5 u` relatively, `u = 2^-53`, as
    /// long as it neither under- nor overflows. NaN for a NaN.
    pub fn distance_squared(self, p: DVec3) -> f64 {
        if self.is_empty() {
            return f64::INFINITY;
        }
        let mut sum = 0.0;
        for a in 0..3 {
            let (below, above) = (self.min[a] as f64 - p[a], p[a] - self.max[a] as f64);
            // At most one of them is positive; NaN stays.
            let off = if below > 0.0 {
                below
            } else if above <= 0.0 {
                0.0
            } else {
                above
            };
            sum += off * off;
        }
        sum
    }

    /// The part of a ray that may lie in the box, its ends in units of the ray's `t`, rounded outward by a few `u =
    /// 2^-53`: it holds all `t` of the interval for which the exact point lies in the box. `None` where there are none.
    /// Segments are rays with an interval; for many boxes, a [`SlabRay`](crate::SlabRay) answers faster.
    ///
    /// ```
    /// # use rt_bounds::Aabb;
    /// # use rt_geom::{Ray, glam::Vec3A};
    /// let b = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
    /// let segment = Ray::new(Vec3A::new(-1.0, 0.5, 0.5), Vec3A::X * 4.0).between(0.0, 1.0);
    /// let [enter, leave] = b.clip(&segment).unwrap();
    /// assert!(enter <= 0.25 && 0.25 - enter < 1e-15 && leave >= 0.5 && leave - 0.5 < 1e-15);
    /// ```
    pub fn clip<R: Real>(self, ray: &Ray<R>) -> Option<[f64; 2]> {
        if !(self.is_valid() && ray.is_valid()) {
            return None;
        }
        let (o, d) = (ray.origin.widen(), ray.dir.widen());
        let (mut enter, mut leave): (f64, f64) = (ray.t_min.into(), ray.t_max.into());
        for a in 0..3 {
            let (below, above) = (self.min[a] as f64 - o[a], self.max[a] as f64 - o[a]);
            if d[a] == 0.0 {
                if below > 0.0 || above < 0.0 {
                    return None;
                }
                continue;
            }
            let (first, last) =
                if d[a] > 0.0 { (below / d[a], above / d[a]) } else { (above / d[a], below / d[a]) };
            // One rounding each of the difference and of the quotient, and no exact distance is infinite but to a side
            // that is.
            let slack = 2.0 * f64::EPSILON;
            enter = enter.max((first - first.abs() * slack).next_down().min(f64::MAX));
            leave = leave.min((last + last.abs() * slack).next_up().max(f64::MIN));
        }
        (enter <= leave).then_some([enter, leave])
    }

    /// The axis along which the box is longest; the first of equals.
    #[inline]
    pub fn longest_axis(self) -> Axis {
        Axis::longest(self.size())
    }

    /// A box around this one carried by `map`, given relative to `origin`: [`Aabb::carried`], rounded outward.
    pub fn transformed(self, map: &Transform, origin: DVec3) -> Aabb {
        if self.is_valid() { self.carried(map).relative_to(origin) } else { self }
    }
}

/// `x - origin` rounded down to `f32`, `-inf` beyond reach. NaN stays NaN.
#[inline]
fn offset_below(x: f64, origin: f64) -> f32 {
    let (mut d, error) = two_sum(x, -origin);
    if error < 0.0 {
        d = d.next_down();
    }
    if d < -FAR {
        f32::NEG_INFINITY
    } else if d > FAR {
        FAR as f32
    } else {
        f32_below(d)
    }
}

/// `x - origin` rounded up to `f32`, `inf` beyond reach. NaN stays NaN.
#[inline]
fn offset_above(x: f64, origin: f64) -> f32 {
    -offset_below(-x, -origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_geom::glam::DMat3;

    fn point(size: f32) -> impl Strategy<Value = Vec3A> {
        prop::array::uniform3(-size..size).prop_map(Vec3A::from_array)
    }

    fn any_box() -> impl Strategy<Value = Aabb> {
        (point(1e3), point(1e3)).prop_map(|(a, b)| Aabb::from_points([a, b]))
    }

    proptest! {
        #[test]
        fn union_is_commutative_and_contains(a in any_box(), b in any_box()) {
            let u = a.union(b);
            prop_assert_eq!(u, b.union(a));
            prop_assert!(u.contains(a) && u.contains(b));
            prop_assert!(a.contains(a.overlap(b)));
            prop_assert!(u.surface_area() >= a.surface_area());
        }

        #[test]
        fn a_carried_box_contains_its_carried_points(m in prop::array::uniform9(-3.0..3.0f64), b in any_box(),
                                                     t in prop::array::uniform3(-1e4..1e4f64),
                                                     w in prop::array::uniform3(0.0..=1.0f64)) {
            let map = Transform::new(rt_geom::glam::DAffine3 {
                matrix3: DMat3::from_cols_array(&m), translation: DVec3::from_array(t) });
            prop_assume!(map.is_ok());
            let map = map.unwrap();
            let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
            let p = map.point(min + (max - min) * DVec3::from_array(w));
            for origin in [DVec3::ZERO, DVec3::new(1e4, -3.0, 0.1)] {
                let carried = b.transformed(&map, origin);
                let q = p - origin;
                // The roundings of p itself, at most 3e4 in size.
                let off = 3e4 * 4.0 * f64::EPSILON;
                prop_assert!(carried.min.as_dvec3().cmple(q + off).all() && carried.max.as_dvec3().cmpge(q - off).all());
            }
        }

        #[test]
        fn offsets_round_outward(x in any::<f64>(), o in -1e8..1e8f64) {
            prop_assume!(!x.is_nan());
            let (lo, hi) = (offset_below(x, o), offset_above(x, o));
            prop_assert!(lo as f64 <= x - o && x - o <= hi as f64);
            prop_assert!(lo <= hi);
        }
    }

    #[test]
    fn a_box_far_away_is_tight_about_its_own_origin() {
        let b = Aabb::from_f64(DVec3::splat(1e7), DVec3::splat(1e7 + 0.001), DVec3::splat(1e7));
        assert!(b.size().max_element() < 0.001_001 && b.min == Vec3A::ZERO);
    }

    #[test]
    fn centers_do_not_overflow() {
        assert_eq!(Aabb::new(Vec3A::splat(-3e38), Vec3A::splat(3e38)).center(), Vec3A::ZERO);
        assert_eq!(Aabb::new(Vec3A::splat(3e38), Vec3A::splat(3e38)).center(), Vec3A::splat(3e38));
        assert_eq!(Aabb::INFINITE.center(), Vec3A::ZERO);
        let plane =
            Aabb::new(Vec3A::new(f32::NEG_INFINITY, 0.0, 1.0), Vec3A::new(f32::INFINITY, 0.0, f32::INFINITY));
        assert_eq!(plane.center(), Vec3A::new(0.0, 0.0, 1.0));
    }

    #[test]
    fn what_is_valid() {
        assert!(Aabb::INFINITE.is_valid());
        assert!(Aabb::new(Vec3A::ONE, Vec3A::ONE).is_valid());
        assert!(!Aabb::EMPTY.is_valid() && Aabb::EMPTY.is_empty());
        assert!(!Aabb::new(Vec3A::ONE, Vec3A::ZERO).is_valid());
        assert!(!Aabb::from_points([Vec3A::ONE, Vec3A::new(0.0, f32::NAN, 0.0), Vec3A::ZERO]).is_valid());
        assert!(!Aabb::new(Vec3A::INFINITY, Vec3A::INFINITY).is_valid());
        assert_eq!(Aabb::EMPTY.surface_area(), 0.0);
        assert_eq!(Aabb::INFINITE.surface_area(), f32::INFINITY);
    }

    #[test]
    fn a_quarter_turn_moves_a_box_onto_itself() {
        let b = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
        let mirror = Transform::scale(DVec3::new(-1.0, 2.0, 1.0)).unwrap();
        assert_eq!(
            b.transformed(&mirror, DVec3::ZERO),
            Aabb::new(Vec3A::new(-1.0, -2.0, -1.0), Vec3A::new(1.0, 2.0, 1.0))
        );
    }
}

//! [`Ray`]: a segment of a half-line.

use crate::{Real, Vector};

/// The points `origin + t * dir` for `t` in the closed interval `[t_min, t_max]`.
///
/// `dir` need not be unit: `t` counts lengths of `dir`. In `f32` a ray is 48 bytes; it carries no reciprocal, mask or
/// identity, because what a traversal derives from it, it derives once at entry.
///
/// ```
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// let ray = Ray::new(Vec3A::ZERO, Vec3A::X).between(0.0, 10.0);
/// assert!(ray.contains(10.0));
/// let fine = Ray::new(DVec3::ZERO, DVec3::X); // a Ray<f64>
/// assert_eq!(fine.t_max, f64::INFINITY);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<R: Real = f32> {
    /// The point at `t = 0`.
    pub origin: R::Vec3,
    /// The direction and the unit of `t`; any finite length but zero.
    pub dir: R::Vec3,
    /// The least `t`, included. May be negative; the default is 0.
    pub t_min: R,
    /// The greatest `t`, included. The default is infinity.
    pub t_max: R,
}

impl<R: Real> Ray<R> {
    /// The half-line from `origin` along `dir`: `t` in `[0, inf]`.
    #[inline]
    pub fn new<V: Vector<Real = R>>(origin: V, dir: V) -> Ray<R>
    where
        R: Real<Vec3 = V>,
    {
        Ray { origin, dir, t_min: R::ZERO, t_max: R::INFINITY }
    }

    /// The same line with `t` in `[t_min, t_max]`.
    #[inline]
    pub fn between(self, t_min: R, t_max: R) -> Ray<R> {
        Ray { t_min, t_max, ..self }
    }

    /// The point at `t`, rounded.
    #[inline(always)]
    pub fn at(&self, t: R) -> R::Vec3 {
        self.origin + self.dir * t
    }

    /// Whether `t` lies in `[t_min, t_max]`; false for NaN.
    #[inline(always)]
    pub fn contains(&self, t: R) -> bool {
        self.t_min <= t && t <= self.t_max
    }

    /// The root `t`, rounded to the precision of the ray, if it lies in the interval; `None` for NaN. A root beyond the range
    /// of the precision is its greatest number: still a hit, and still finite.
    ///
    /// The near end is compared before rounding and the far end after it: so a root keeps its side of the origin, and two
    /// roots that round to the same number tie, whichever of them shortened the ray first.
    #[inline(always)]
    pub fn admit(&self, t: f64) -> Option<R> {
        let rounded = R::nearest(t);
        let rounded = if rounded > R::MAX { R::MAX } else { rounded };
        let rounded = if rounded < -R::MAX { -R::MAX } else { rounded };
        (t >= self.t_min.into() && self.contains(rounded)).then_some(rounded)
    }

    /// The same ray in `f64`, exactly.
    #[inline(always)]
    pub fn widen(&self) -> Ray<f64> {
        Ray {
            origin: self.origin.widen(),
            dir: self.dir.widen(),
            t_min: self.t_min.into(),
            t_max: self.t_max.into(),
        }
    }

    /// Whether the ray can hit anything: origin and direction finite, direction not zero, `t_min <= t_max`.
    #[inline]
    pub fn is_valid(&self) -> bool {
        let (o, d) = (self.origin.widen(), self.dir.widen());
        o.is_finite() && d.is_finite() && d != glam::DVec3::ZERO && self.t_min <= self.t_max
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3A};

    #[test]
    fn a_ray_of_f32_is_48_bytes() {
        assert_eq!(size_of::<Ray>(), 48);
    }

    #[test]
    fn admitted_roots_are_finite_and_in_the_interval() {
        let ray = Ray::new(Vec3A::ZERO, Vec3A::X);
        assert_eq!(ray.admit(1e300), Some(f32::MAX));
        assert_eq!(ray.admit(f64::INFINITY), Some(f32::MAX));
        assert_eq!(ray.admit(-1e-300), None);
        assert_eq!(ray.admit(f64::NAN), None);
        assert_eq!(ray.between(f32::INFINITY, f32::INFINITY).admit(f64::INFINITY), None);
        assert_eq!(ray.between(f32::NEG_INFINITY, 0.0).admit(-1e300), Some(f32::MIN));
        // Compared before rounding at the near end, after rounding at the far end.
        assert_eq!(ray.between(1.0, 2.0).admit(1.0 - 1e-12), None);
        assert_eq!(ray.between(1.0, 2.0).admit(2.0 + 1e-12), Some(2.0));
    }

    #[test]
    fn validity() {
        let ray = Ray::new(Vec3A::ZERO, Vec3A::X);
        assert!(ray.is_valid());
        assert!(!Ray { dir: Vec3A::ZERO, ..ray }.is_valid());
        assert!(!Ray { dir: Vec3A::splat(-0.0), ..ray }.is_valid());
        assert!(!Ray { origin: Vec3A::new(f32::NAN, 0.0, 0.0), ..ray }.is_valid());
        assert!(!Ray { dir: Vec3A::new(f32::INFINITY, 0.0, 0.0), ..ray }.is_valid());
        assert!(!ray.between(f32::NAN, 1.0).is_valid());
        assert!(!ray.between(0.0, f32::NAN).is_valid());
        assert!(!ray.between(2.0, 1.0).is_valid());
        assert!(ray.between(1.0, 1.0).is_valid());
        assert!(Ray::new(DVec3::ZERO, DVec3::splat(1e300)).is_valid());
    }
}

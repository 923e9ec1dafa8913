//! [`Cone`]: a ray with a circular width.

use crate::direction::scaled;
use crate::invert::ldexp;
use crate::{Ray, Real, Vector, unit};
use core::f64::consts::{FRAC_PI_2, PI};
use core::fmt;
use glam::DVec3;

/// The points within an angle of an axis, or within a radius that grows evenly along it, between two distances.
///
/// With `t` the distance of a point along the axis from the origin and `D` its distance from the axis, the solid,
/// closed set `D cos(angle) <= t sin(angle) + radius cos(angle)`, `near <= t <= far`. So a cone of angle 0 is a ray or
/// a cylinder, one of a right angle a half space, and a wider one all but a cone the other way.
///
/// Source: Amanatides, "Ray tracing with cones" (1984).
///
/// ```
/// use rt_geom::{Cone, Ray, glam::DVec3};
/// let light = Cone::new(DVec3::ZERO, DVec3::Z, 0.5).unwrap();
/// assert!(light.contains(DVec3::new(0.5, 0.0, 1.0)) && !light.contains(DVec3::new(0.6, 0.0, 1.0)));
/// // What a pixel sees: as wide as the lens at the start, and 0.001 wider each unit of length on the way.
/// let pixel = Cone::around(&Ray::new(DVec3::ZERO, DVec3::Z), 0.1, 0.001).unwrap();
/// assert!((pixel.radius_at(100.0) - 0.2).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    origin: DVec3,
    axis: DVec3,
    sin: f64,
    cos: f64,
    radius: f64,
    near: f64,
    far: f64,
}

/// Why there is no such [`Cone`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ConeError {
    /// The origin is not finite.
    NotFinite,
    /// The axis is zero or not finite.
    NoAxis,
    /// The angle is not in `[0, pi]`, or the spread or the radius negative or not finite.
    Width,
    /// The interval of the ray is empty or NaN.
    Interval,
}

impl fmt::Display for ConeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ConeError::NotFinite => "the origin of the cone is not finite",
            ConeError::NoAxis => "the axis of the cone has no direction",
            ConeError::Width => "the width of the cone is negative, too large, or not finite",
            ConeError::Interval => "the ray of the cone has no interval",
        })
    }
}

impl core::error::Error for ConeError {}

impl Cone {
    /// The points seen from `apex` within `half_angle`, in `[0, pi]`, of `axis`, which need not be unit. At any
    /// distance: ahead of the apex up to a right angle, on both sides beyond.
    ///
    /// # Errors
    ///
    /// See [`ConeError`].
    pub fn new(apex: DVec3, axis: DVec3, half_angle: f64) -> Result<Cone, ConeError> {
        if !apex.is_finite() {
            return Err(ConeError::NotFinite);
        }
        let axis = unit(axis).ok_or(ConeError::NoAxis)?;
        if !(0.0..=PI).contains(&half_angle) {
            return Err(ConeError::Width);
        }
        let (sin, cos) = half_angle.sin_cos();
        // A right angle is one exactly, and its rounding is not a narrow cone.
        let cos = if half_angle == FRAC_PI_2 { 0.0 } else { cos };
        let near = if half_angle > FRAC_PI_2 { f64::NEG_INFINITY } else { 0.0 };
        Ok(Cone { origin: apex, axis, sin, cos, radius: 0.0, near, far: f64::INFINITY })
    }

    /// What lies within `radius + spread * distance` of a ray, for distances (not lengths of its direction) along it
    /// from its `t_min`, but not before its origin, to its `t_max`: a ray with the width of a pixel. The apex is
    /// virtual, behind the origin.
    ///
    /// # Errors
    ///
    /// See [`ConeError`]; a ray that is not [valid](Ray::is_valid) has no cone.
    pub fn around<R: Real>(ray: &Ray<R>, radius: f64, spread: f64) -> Result<Cone, ConeError> {
        let finite = 0.0..=f64::MAX;
        if !(finite.contains(&radius) && finite.contains(&spread)) {
            return Err(ConeError::Width);
        }
        let dir = ray.dir.widen();
        let (near, far): (f64, f64) = (ray.t_min.into(), ray.t_max.into());
        let cos = 1.0 / spread.hypot(1.0);
        let cone = Cone::new(ray.origin.widen(), dir, 0.0)?;
        let ordered = near <= far;
        if !ordered {
            return Err(ConeError::Interval);
        }
        // By a power of two first: neither the square of a direction nor `t` times a part of it leaves the range where
        // the distance does not.
        let (scaled, exponent) = scaled(dir).ok_or(ConeError::NoAxis)?;
        let distance = |t: f64| ldexp(t, exponent) * scaled.length();
        let (near, far) = (distance(near).max(0.0), distance(far));
        Ok(Cone { sin: spread.min(f64::MAX) * cos, cos, radius, near, far, ..cone })
    }

    /// The same cone between two distances along its axis, `near` and `far` included. NaN leaves an end where it is.
    pub fn between(self, near: f64, far: f64) -> Cone {
        let near = if near.is_nan() { self.near } else { near };
        let far = if far.is_nan() { self.far } else { far };
        Cone { near, far, ..self }
    }

    /// Where the axis starts: the apex, where the radius there is 0.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The direction of the axis, unit.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// The sine and the cosine of the half angle.
    pub fn sin_cos(&self) -> (f64, f64) {
        (self.sin, self.cos)
    }

    /// The radius at the origin.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The least and the greatest distance along the axis.
    pub fn range(&self) -> [f64; 2] {
        [self.near, self.far]
    }

    /// The radius at a distance along the axis; infinite from a right angle on.
    pub fn radius_at(&self, distance: f64) -> f64 {
        if self.cos > 0.0 { self.radius + distance * (self.sin / self.cos) } else { f64::INFINITY }
    }

    /// How far a point, given relative to the origin, lies outside the mantle, negative inside: its distance from the
    /// mantle, except behind the apex, where it may be farther. Changes by no more than the point moves.
    ///
    /// Error: at most `16 u` times the length of `p`, plus the radius.
    #[inline]
    pub fn outside(&self, p: DVec3) -> f64 {
        let t = p.dot(self.axis);
        let from_axis = (p - self.axis * t).length();
        from_axis * self.cos - t * self.sin - self.radius * self.cos
    }

    /// Whether a point lies in the cone, up to rounding.
    pub fn contains(&self, p: DVec3) -> bool {
        let p = p - self.origin;
        let t = p.dot(self.axis);
        self.near <= t && t <= self.far && self.outside(p) <= 0.0
    }
}

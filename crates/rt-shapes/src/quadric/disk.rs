//! [`Disk`]: flat disks and rings, whole or swept in part.

use super::form::Number;
use super::sweep::{Sweep, arc, direction, share};
use super::{LARGEST, QuadricError};
use crate::surface::unit;
use crate::{Partials, Shape, Surface, Uv};
use core::f64::consts::TAU;
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector};

const U: f64 = f64::EPSILON / 2.0;

/// A disk in the plane `z = height` around the z axis, or the ring between two radii, whole or swept from one angle to another.
///
/// In object space; an [`Instance`](rt_accel::Instance) places it. Its borders belong to it. The normal is `+z`; `u` goes around,
/// `v` from the outer to the inner border. Rays in its plane do not meet it.
///
/// The distance is the exact one rounded to `f64`; borders are decided by signs with twice the digits of `f64`, and what even
/// these leave open is a hit.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::Disk;
/// use std::f64::consts::PI;
/// // The half of a ring with y >= 0.
/// let arch = Disk::ring(0.0, 1.0, 2.0)?.swept(0.0, PI)?;
/// let at = |x, y| arch.intersect_p(&Ray::new(Vec3A::new(x, y, -1.0), Vec3A::Z));
/// assert!(at(0.0, 1.5) && at(2.0, 0.0) && !at(0.0, 0.5) && !at(0.0, -1.5));
/// assert!((arch.area() - 1.5 * PI).abs() < 1e-14);
/// # Ok::<(), rt_shapes::QuadricError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Disk {
    height: f64,
    inner: f64,
    outer: f64,
    angles: [f64; 2],
    sweep: Option<Sweep>,
}

impl Disk {
    /// The disk of a radius at a height.
    ///
    /// # Errors
    ///
    /// When the height is not finite or the radius not finite and positive.
    pub fn new(height: f64, radius: f64) -> Result<Disk, QuadricError> {
        Disk::ring(height, 0.0, radius)
    }

    /// The ring between two radii at a height.
    ///
    /// # Errors
    ///
    /// When the height is not finite, the outer radius not finite and positive, or the inner one not at least 0 and below it.
    pub fn ring(height: f64, inner: f64, outer: f64) -> Result<Disk, QuadricError> {
        if height.abs() > LARGEST || height.is_nan() {
            return Err(QuadricError::Height(height));
        }
        if !(outer > 0.0 && outer <= LARGEST) {
            return Err(QuadricError::Radius(outer));
        }
        if !(inner >= 0.0 && inner < outer) {
            return Err(QuadricError::Inner { inner, outer });
        }
        Ok(Disk { height, inner, outer, angles: [0.0, TAU], sweep: None })
    }

    /// Only the part from one angle counter-clockwise to another, in radians from the x axis; at most a full turn.
    /// Both ends belong to it, as those of a [`Quadric`](crate::Quadric).
    ///
    /// # Errors
    ///
    /// When the range is empty, or narrower than rounding, inverted, not finite, more than a turn, or an angle is beyond `2^20` either
    /// way: the rounding of such is no small angle.
    pub fn swept(self, from: f64, to: f64) -> Result<Disk, QuadricError> {
        Ok(Disk { angles: [from, to], sweep: Sweep::new([from, to])?, ..self })
    }

    /// The area, of a sweep by its angles as given.
    pub fn area(&self) -> f64 {
        0.5 * (self.angles[1] - self.angles[0]) * (self.outer - self.inner) * (self.outer + self.inner)
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`. Numbers
    /// outside are moved to the nearest inside, NaN to 0.
    pub fn sample(&self, xi: DVec2) -> Surface {
        let xi = unit(xi);
        let [a, b] = [self.outer * self.outer, self.inner * self.inner];
        let radius = (a + (b - a) * xi.y).max(b).sqrt().clamp(self.inner, self.outer);
        self.record(direction(self.angles[0] + (self.angles[1] - self.angles[0]) * xi.x) * radius)
    }

    fn record(&self, p: DVec2) -> Surface {
        let point = p.extend(self.height);
        // The point is in the plane; this keeps spawned rays clear of what underflow makes of the least distances.
        let error = DVec3::splat(2.0 * U * (self.outer + self.height.abs()));
        let v = ((self.outer - p.length()) / (self.outer - self.inner)).clamp(0.0, 1.0);
        Surface {
            point,
            error,
            normal: DVec3::Z,
            shading: DVec3::Z,
            uv: DVec2::new(share(self.angles, p), v),
        }
    }

    /// Whether the line meets the ring, and not only its plane; `None` if the digits do not tell. All in units of `1 / by`, the
    /// direction in whichever.
    #[inline(always)]
    fn decide<T: Number>(&self, o: DVec3, d: DVec3, by: f64) -> Option<bool> {
        let t = T::difference(self.height * by, o.z) / d.z.into();
        let [x, y] = [0, 1].map(|i| T::from(o[i]) + t * d[i].into());
        // Two roundings of the quotient, one each of product and sum; products of parts lost below are counted with them.
        let size = |i: usize| o[i].abs() + (t.value() * d[i]).abs();
        let off = 8.0 * T::U * size(0).max(size(1)) + f64::MIN_POSITIVE;
        let [inner, outer] = [self.inner, self.outer].map(|r| T::from(r * by));
        if x.value().abs() > 2.0 * outer.value() + off || y.value().abs() > 2.0 * outer.value() + off {
            return Some(false);
        }
        let square = x * x + y * y;
        let bound = |r: T| {
            2.0 * off * (x.value().abs() + y.value().abs() + 2.0 * off)
                + 8.0 * T::U * (square.value() + (r * r).value())
        };
        let mut open = false;
        let mut least = |value: f64, bound: f64| {
            open |= value.abs() <= bound || value.is_nan();
            value >= -bound || value.is_nan()
        };
        let mut met = least((outer * outer - square).value(), bound(outer));
        met = met && (self.inner == 0.0 || least((square - inner * inner).value(), bound(inner)));
        if let Some(sweep) = &self.sweep {
            let cross = |e: DVec2| (T::from(e.x) * y - T::from(e.y) * x).value();
            let [from, to] = sweep.ends;
            let (a, b) = (least(cross(from), 4.0 * off), least(-cross(to), 4.0 * off));
            met = met && if sweep.reflex { a || b } else { a && b };
        }
        (!open || !met).then_some(met)
    }

    /// The distance along the line, correctly rounded up to ties, if it meets.
    #[inline(always)]
    fn root(&self, o: DVec3, d: DVec3) -> Option<f64> {
        if d.z == 0.0 || !(o.is_finite() && d.is_finite()) {
            return None;
        }
        // In units of powers of two, so that products stay in range.
        let power = |x: f64| f64::from_bits((x.to_bits() >> 52).clamp(30, 2000) << 52);
        let unit = power(o.abs().max_element().max(self.height.abs()).max(self.outer));
        let pace = power(d.abs().max_element());
        let (by, p, v) = (1.0 / unit, o / unit, d / pace);
        let met = self.decide::<f64>(p, v, by).or_else(|| self.decide::<DoubleDouble>(p, v, by));
        // What twice the digits leave open is a hit.
        if met == Some(false) {
            return None;
        }
        let t = (DoubleDouble::difference(self.height * by, p.z) / v.z.into()).value();
        Some(if (t * unit).is_finite() { t * unit / pace } else { t / pace * unit })
    }
}

impl WorldBound for Disk {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let [mut min, mut max] = arc(self.sweep.as_ref(), DVec2::X, self.outer);
        let within = arc(self.sweep.as_ref(), DVec2::X, self.inner);
        (min, max) = (min.min(within[0]), max.max(within[1]));
        Aabb::from_f64(min.extend(self.height), max.extend(self.height), origin)
    }
}

impl<R: Real> Primitive<R> for Disk {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        let t = ray.admit(self.root(ray.origin.widen(), ray.dir.widen())?)?;
        Some(Hit { t, at: Uv::default() })
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        match self.intersect(ray) {
            Some(hit) => each(hit),
            None => ControlFlow::Continue(()),
        }
    }
}

impl<R: Real> Shape<R> for Disk {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        self.record(ray.widen().at(hit.t.into()).truncate())
    }

    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let p = self.surface(ray, hit).point.truncate();
        let dpdu = p.perp().extend(0.0) * (self.angles[1] - self.angles[0]);
        // In the centre every direction leads outward: along x as any.
        let out = p.try_normalize().unwrap_or(DVec2::X);
        let dpdv = (out * (self.inner - self.outer)).extend(0.0);
        Partials { dpdu, dpdv, ..Partials::default() }
    }
}

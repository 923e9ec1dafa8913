//! [`UnitRay`]: a ray made ready for volumes that are met by distances.

use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};

/// `2^-53`.
pub(crate) const U: f64 = f64::EPSILON / 2.0;
/// Beyond this size an origin says nothing: every volume is met.
const FAR: f64 = f64::from_bits((1023 + 400) << 52);
/// Added to every slack: `2^-500`, beside which nothing that underflow may take away matters and which is far below the least `f32`.
const TINY: f64 = f64::from_bits((1023 - 500) << 52);

/// A ray whose direction has length 1, in `f64`, as [`BoundingSphere`](crate::BoundingSphere) and [`Obb`](crate::Obb) read it.
///
/// Distances are lengths, not the caller's `t`: `t |d|`. The ends are rounded outward, and `slack` says how far the exact line
/// may be beside this one where it starts. A ray that is not [valid](Ray::is_valid) meets nothing.
///
/// Error, in `u = 2^-53`: the direction is off by at most `4 u`, the origin by at most `u |origin|` (the difference to the
/// structure's origin). An origin beyond `2^400` says nothing, and every volume is then met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitRay {
    pub(crate) origin: DVec3,
    pub(crate) dir: DVec3,
    pub(crate) near: f64,
    pub(crate) far: f64,
    /// Twice the error of the origin, and [`TINY`].
    pub(crate) slack: f64,
}

impl UnitRay {
    /// Prepares `ray` for volumes given relative to `origin`. Cost: one square root and three divisions.
    pub fn new<R: Real>(ray: &Ray<R>, origin: DVec3) -> UnitRay {
        if !ray.is_valid() {
            let (near, far) = (f64::INFINITY, f64::NEG_INFINITY);
            return UnitRay { origin: DVec3::ZERO, dir: DVec3::ZERO, near, far, slack: 0.0 };
        }
        let (o, d) = (ray.origin.widen() - origin, ray.dir.widen());
        // A power of two that brings the largest component near 1, so that the length neither over- nor underflows.
        let exponent = ((d.abs().max_element().to_bits() >> 52) as i64 - 1023).clamp(-1000, 1000);
        let power = |e: i64| f64::from_bits(((e + 1023) as u64) << 52);
        let scaled = d * power(-exponent);
        let length = scaled.length();
        let distance = |t: f64| t * power(exponent) * length;
        // Room for the product, for the length, and at the far end for the rounding of a computed `t`.
        let outward = |x: f64| if x.is_finite() { x.abs() * (8.0 * U) + TINY } else { 0.0 };
        let (near, far) = (distance(ray.t_min.into()), distance(ray.t_max.next_up().into()));
        let (near, far) = (near - outward(near), far + outward(far));
        let size = o.length();
        if size <= FAR {
            UnitRay { origin: o, dir: scaled / length, near, far, slack: 2.0 * U * size + TINY }
        } else {
            UnitRay { origin: DVec3::ZERO, dir: DVec3::ZERO, near, far, slack: f64::INFINITY }
        }
    }
}

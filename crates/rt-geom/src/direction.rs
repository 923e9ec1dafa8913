//! Unit vectors and the angles between directions.

use crate::invert::{exponent, ldexp};
use glam::DVec3;

/// `v` in length 1, within `4 u`, whatever its length; `None` for zero and for what is not finite.
///
/// ```
/// use rt_geom::{unit, glam::DVec3};
/// assert_eq!(unit(DVec3::X * 1e-320), Some(DVec3::X));
/// assert_eq!(unit(DVec3::ZERO), None);
/// ```
pub fn unit(v: DVec3) -> Option<DVec3> {
    let (scaled, _) = scaled(v)?;
    Some(scaled / scaled.length())
}

/// `v` times a power of two that brings its square into range, and the exponent that takes it back.
pub(crate) fn scaled(v: DVec3) -> Option<(DVec3, i32)> {
    let largest = v.abs().max_element();
    if !v.is_finite() || largest == 0.0 {
        return None;
    }
    let e = exponent(largest);
    Some((DVec3::new(ldexp(v.x, -e), ldexp(v.y, -e), ldexp(v.z, -e)), e))
}

/// The length of a finite vector, however short.
pub(crate) fn length(v: DVec3) -> f64 {
    scaled(v).map_or(0.0, |(v, e)| ldexp(v.length(), e))
}

/// The angle between two directions of any length, in `[0, pi]`, within some 10 roundings, relatively at angles near 0
/// and absolutely near `pi`: where the arc cosine of the dot product has lost half of the digits. NaN if a direction is
/// zero or not finite.
///
/// Source: Kahan, *How Futile are Mindless Assessments of Roundoff in Floating-Point Computation?* (2006), section 12.
///
/// ```
/// use rt_geom::{angle_between, glam::DVec3};
/// let angle = angle_between(DVec3::X, DVec3::new(1.0, 1e-8, 0.0));
/// assert!((angle - 1e-8).abs() < 1e-23);
/// ```
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    match (unit(a), unit(b)) {
        (Some(a), Some(b)) => 2.0 * length(a - b).atan2(length(a + b)),
        _ => f64::NAN,
    }
}

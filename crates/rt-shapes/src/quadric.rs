//! Quadrics: surfaces of revolution given by equations of the second degree.

mod form;
mod frustum;
mod part;
mod solve;
mod surface;
#[allow(dead_code)]
mod sweep;

pub use frustum::Frustum;

use core::fmt;
use rt_geom::expansion::two_sum;
use rt_geom::glam::DVec3;

/// A root of the equation that a line meets a surface by: the exact root is within `error` of `t`, if there is one. There is
/// none where a line misses the surface by so little that twice the digits of `f64` do not show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// In lengths of the line's direction.
    pub t: f64,
    /// Bound on the absolute error of `t`.
    pub error: f64,
}

/// Why numbers do not make a quadric.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum QuadricError {
    /// A point that is not finite, or too far from its partner.
    Point(DVec3),
    /// A radius that is negative or not finite, or zero where it must not be.
    Radius(f64),
    /// Base and top are the same point.
    NoAxis(DVec3),
}

impl fmt::Display for QuadricError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            QuadricError::Point(p) => write!(f, "point {p} is not finite, or too far from its partner"),
            QuadricError::Radius(r) => write!(f, "radius {r} is not a positive number"),
            QuadricError::NoAxis(p) => write!(f, "there is no axis from {p} to itself"),
        }
    }
}

impl core::error::Error for QuadricError {}

/// `center - half` rounded down and `center + half` rounded up.
fn outward(center: f64, half: f64) -> (f64, f64) {
    let below = |c: f64| match two_sum(c, -half) {
        (x, e) if e < 0.0 => x.next_down(),
        (x, _) => x,
    };
    (below(center), -below(-center))
}

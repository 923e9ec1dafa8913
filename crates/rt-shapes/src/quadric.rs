//! Quadrics: surfaces of revolution given by equations of the second degree.

mod disk;
mod form;
mod frustum;
mod partials;
mod revolved;
mod solve;
mod surface;
mod sweep;

pub use disk::Disk;
pub use frustum::Frustum;
pub use revolved::Quadric;
pub(crate) use sweep::{direction, share};

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
    /// A point that is not finite, or beyond `1e290`, or as far from its partner.
    Point(DVec3),
    /// A radius that is negative, NaN or beyond `1e290`, or zero where it must not be.
    Radius(f64),
    /// Base and top are the same point.
    NoAxis(DVec3),
    /// A height that is NaN or beyond `1e290`, or not positive where it must be.
    Height(f64),
    /// A range of heights that is empty, inverted, NaN, beyond `1e290`, or not on the surface.
    Range {
        /// The lower end, as given.
        min: f64,
        /// The upper end, as given.
        max: f64,
    },
    /// A range of angles that is empty or narrower than rounding, inverted, not finite, beyond `2^20` radians either way, or more than
    /// a full turn.
    Sweep {
        /// The first angle, in radians.
        from: f64,
        /// The last angle, in radians.
        to: f64,
    },
    /// An inner radius that is not between 0 and the outer one.
    Inner {
        /// The inner radius, as given.
        inner: f64,
        /// The outer radius, as given.
        outer: f64,
    },
}

impl fmt::Display for QuadricError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            QuadricError::Point(p) => {
                write!(f, "point {p}, or its distance from its partner, is not a number up to 1e290")
            }
            QuadricError::Radius(r) => write!(f, "radius {r} is not a positive number up to 1e290"),
            QuadricError::NoAxis(p) => write!(f, "there is no axis from {p} to itself"),
            QuadricError::Height(h) => {
                write!(f, "height {h} is not a number up to 1e290, or not a positive one")
            }
            QuadricError::Range { min, max } => {
                write!(f, "heights from {min} to {max} are no part of the surface with an extent")
            }
            QuadricError::Sweep { from, to } => {
                write!(
                    f,
                    "angles from {from} to {to} are no range of up to a full turn, within 2^20 either way"
                )
            }
            QuadricError::Inner { inner, outer } => {
                write!(f, "inner radius {inner} is not at least 0 and below the outer radius {outer}")
            }
        }
    }
}

impl core::error::Error for QuadricError {}

/// Beyond this size double-double products overflow.
const LARGEST: f64 = 1e290;

/// `center - half` rounded down and `center + half` rounded up.
fn outward(center: f64, half: f64) -> (f64, f64) {
    let below = |c: f64| match two_sum(c, -half) {
        (x, e) if e < 0.0 => x.next_down(),
        (x, _) => x,
    };
    (below(center), -below(-center))
}

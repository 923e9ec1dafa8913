//! The exact oracle: what a line meets, decided by integers of any length.
//!
//! Coordinates come as arrays of `f64`, so that `f32` data widen exactly: every finite one is an integer times a power of two,
//! hence every decision here is the sign of an integer. A filter in `f64` with a proven error bound settles the clear cases
//! (tens of nanoseconds); the rest costs microseconds. No code is shared with what is judged: neither the expansions of
//! `rt-geom` nor anybody's triangle test.
//!
//! # Conventions
//!
//! Lines are whole: `t` may be negative, and the caller applies the ray's interval. Sets are closed: edges, corners, tangents
//! and box faces are met. A triangle without area is never met, nor one in whose plane the line lies. A direction of zero, and
//! anything that is not finite, meets nothing.
//!
//! ```
//! use rt_measure::exact;
//! let corners = [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 3.0, 1.0]];
//! // Through the middle of the edge from (3, 0) to (0, 3).
//! let root = exact::triangle([0.0; 3], [1.5, 1.5, 1.0], corners).unwrap();
//! assert_eq!(root.nearest::<f32>(), 1.0);
//! assert!(exact::triangle([0.0; 3], [1.5, 1.5f64.next_up(), 1.0], corners).is_none());
//! ```

mod aabb;
mod ball;
mod plane;
mod quadric;
mod rational;
mod slabs;
mod sphere;
mod triangle;

pub use aabb::{Span, aabb};
pub use ball::{ball_holds, ball_meets, smallest_ball};
pub use plane::{Plane, convex, convex_met, side};
pub use quadric::{frustum, quadratic, revolved};
pub use rational::Rational;
pub use slabs::{Slab, slabs, slabs_hold};
pub use sphere::sphere;
pub use triangle::{Closest, Corners, Root, closest, crosses, crossings, triangle};

use num_bigint::BigInt;

/// A point or direction.
pub type Vec3 = [f64; 3];

/// A vector of integers.
type Vector = [BigInt; 3];

/// Below this size no product of three numbers overflows, and what underflow may add to one is far below [`TINY`].
const LARGE: f64 = f64::from_bits((1023 + 200) << 52);
/// Added to every error bound of a product of three numbers: 2^-800.
const TINY: f64 = f64::from_bits((1023 - 800) << 52);
/// `8 u` twice over, `u = 2^-53`: the relative error of a sum of products of three rounded differences is `gamma(7)`, and
/// the bound itself is rounded as often.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// Whether a filter may look at these numbers; false for NaN.
fn filterable(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.abs() <= LARGE)
}

/// Whether origin and direction span a line.
fn is_line(origin: &Vec3, dir: &Vec3) -> bool {
    origin.iter().chain(dir).all(|x| x.is_finite()) && *dir != [0.0; 3]
}

/// A finite number as an integer and a power of two.
fn parts(x: f64) -> (i64, i64) {
    let bits = x.to_bits();
    let (field, low) = ((bits >> 52 & 0x7ff) as i64, (bits & ((1 << 52) - 1)) as i64);
    let (mantissa, exp) = if field == 0 { (low, -1074) } else { (low | 1 << 52, field - 1075) };
    (if x < 0.0 { -mantissa } else { mantissa }, exp)
}

/// Finite vectors as integers in a common unit `2^exp`, and `exp`.
fn integers<const N: usize>(vectors: [Vec3; N]) -> ([Vector; N], i64) {
    let exp = vectors.iter().flatten().filter(|x| **x != 0.0).map(|x| parts(*x).1).min().unwrap_or(0);
    let integer = |x: f64| {
        let (mantissa, e) = parts(x);
        if mantissa == 0 { BigInt::ZERO } else { BigInt::from(mantissa) << (e - exp) }
    };
    (vectors.map(|v| v.map(integer)), exp)
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    [&a[0] - &b[0], &a[1] - &b[1], &a[2] - &b[2]]
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    let minor = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

fn dot(a: &Vector, b: &Vector) -> BigInt {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

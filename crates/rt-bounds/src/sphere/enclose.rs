//! The least `f32` radius about a given centre, decided exactly.

use super::{BoundingSphere, FAR};
use crate::unit_ray::U;
use rt_geom::expansion::Expansion;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Vector, f32_above, f32_below};

/// Factors whose products the expansions hold exactly lie between `1 / RANGE` and `RANGE`.
const RANGE: f64 = f64::from_bits((1023 + 300) << 52);

/// The sphere about `center`, rounded to `f32`, that holds all `points` less `origin`, with the least `f32` radius that
/// does.
///
/// A distance computed in `f64` is off by at most `u |p - origin| + 4 u |p - origin - c|` and settles the radius unless
/// an `f32` lies within that error; then expansions decide. Where a coordinate is not zero but below `2^-300`, the
/// error is granted.
pub(super) fn enclose<V: Vector>(center: DVec3, points: &[V], origin: DVec3) -> BoundingSphere {
    let c = center.as_vec3a();
    let from = c.as_dvec3();
    let (mut farthest, mut reach) = (0.0f64, 0.0f64);
    for p in points {
        let x = p.widen() - origin;
        farthest = farthest.max(x.distance_squared(from));
        reach = reach.max(x.length_squared());
    }
    let distance = farthest.sqrt();
    // Squares below 2^-1022 are lost: less than 2^-500 of the distance.
    let error = (reach.sqrt() + 5.0 * distance) * (1.01 * U) + f64::from_bits((1023 - 500) << 52);
    let mut radius = f32_above(distance + error);
    let reached = radius <= FAR && c.abs().max_element() <= FAR;
    if !reached {
        return BoundingSphere::INFINITE;
    }
    // The greatest radius that is too small for certain: below it nothing needs to be tried.
    let least = (distance - error).max(0.0);
    let mut small = f32_below(least);
    if small as f64 == least {
        small = small.next_down();
    }
    while small.next_up() < radius {
        // Half way in units in the last place: mostly one step, more only where points coincide but for rounding.
        let tried = match small < 0.0 {
            true => 0.0,
            false => f32::from_bits(small.to_bits() + (radius.to_bits() - small.to_bits()) / 2),
        };
        let clear = (tried as f64 - error).max(0.0);
        let clear = clear * clear * (1.0 - 8.0 * U);
        let fits = |p: &V| {
            let p = p.widen();
            (p - origin).distance_squared(from) < clear || holds(p, origin, c, tried)
        };
        match points.iter().all(fits) {
            true => radius = tried,
            false => small = tried,
        }
    }
    BoundingSphere { center: c, radius }
}

/// Whether `|p - origin - c| <= r`, exactly; false where a coordinate is out of the range of the expansions.
#[cold]
fn holds(p: DVec3, origin: DVec3, c: Vec3A, r: f32) -> bool {
    let numbers = p.to_array().into_iter().chain(origin.to_array());
    if numbers.into_iter().any(|x| x != 0.0 && !(1.0 / RANGE..=RANGE).contains(&x.abs())) {
        return false;
    }
    let [x, y, z] = [0, 1, 2].map(|a| {
        let q: Expansion<3> =
            Expansion::<2>::difference(p[a], origin[a]).minus(&Expansion::<1>::new(c[a] as f64));
        q.times::<3, 18>(&q)
    });
    let square: Expansion<54> = x.plus::<18, 36>(&y).plus(&z);
    // The square of an f32 is an f64.
    square.minus::<1, 55>(&Expansion::new(r as f64 * r as f64)).sign() <= 0
}

/// Whether the ball about `c` holds the ball about `d`, exactly: `|c - d| <= R - r`.
pub(super) fn holds_ball(c: Vec3A, big: f32, d: Vec3A, small: f32) -> bool {
    if small > big {
        return false;
    }
    let square = |a: f32, b: f32| {
        let q = Expansion::<2>::difference(a as f64, b as f64);
        q.times::<2, 8>(&q)
    };
    let apart: Expansion<24> = square(c.x, d.x).plus::<8, 16>(&square(c.y, d.y)).plus(&square(c.z, d.z));
    apart.minus::<8, 32>(&square(big, small)).sign() <= 0
}

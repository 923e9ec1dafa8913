//! Numbers that are the same on every machine.

use rt_geom::Real;
use rt_shapes::TriangleMesh;
use std::f64::consts::TAU;

/// Random numbers from a seed.
///
/// Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014 (SplitMix64).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Random {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 64 bits that belong to a place on a grid.
    pub(crate) fn at(seed: u64, x: u32, y: u32) -> u64 {
        Random(seed ^ (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0xd6e8_feb8_6659_fd93)).next()
    }

    /// Uniform in `[-1, 1)`, with 53 bits.
    pub(crate) fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }

    /// Uniform in `[0, n)`; 0 for an `n` of 0.
    pub(crate) fn below(&mut self, n: u64) -> u64 {
        ((self.next() as u128 * n as u128) >> 64) as u64
    }
}

/// Sine and cosine of `i / n` of a full turn, of few operations, each rounded correctly: libraries' own differ by machine.
///
/// Error below `2^-51`; exact at quarter turns, and of exact symmetry between octants. `n` above 0.
pub(crate) fn turn(i: u64, n: u64) -> (f64, f64) {
    // Eighths of a turn, and the rest, in units of 1 / (8 n).
    let i = i % n * 8;
    let (octant, rest) = (i / n, i % n);
    let rest = if octant % 2 == 1 { n - rest } else { rest };
    in_octant(octant, rest as f64 / n as f64)
}

/// Sine and cosine of `x` full turns, as [`turn`] of few operations. Exact at quarter turns; `(NaN, NaN)` for what is not finite.
pub(crate) fn turns(x: f64) -> (f64, f64) {
    // Exact: a fraction of a turn has no more digits than `x`, or is within a rounding of a whole one.
    let eighths = (x - x.floor()) * 8.0;
    let octant = eighths.floor();
    let rest = eighths - octant;
    in_octant(octant as u64 % 8, if octant as u64 % 2 == 1 { 1.0 - rest } else { rest })
}

/// Sine and cosine in an octant, at a `share` of an eighth of a turn from the quarter turn beside it.
fn in_octant(octant: u64, share: f64) -> (f64, f64) {
    let x = share * (TAU / 8.0);
    let xx = x * x;
    // Taylor series to x^17 and x^18: below 2^-60 for a quarter of pi.
    let (mut s, mut c) = (0.0, 0.0);
    for k in (1..=9).rev() {
        let k = 2.0 * k as f64;
        s = (1.0 + s) * -xx / (k * (k + 1.0));
        c = (1.0 + c) * -xx / (k * (k - 1.0));
    }
    let (s, c) = (x + x * s, 1.0 + c);
    // Odd octants are measured back from the next boundary.
    match octant {
        0 => (s, c),
        1 => (c, s),
        2 => (c, -s),
        3 => (s, -c),
        4 => (-s, -c),
        5 => (-c, -s),
        6 => (-c, s),
        _ => (-s, c),
    }
}

/// `e^x` for moderate `x`, of few operations. Relative error below `2^-50` for `|x| < 10`.
pub(crate) fn exp(x: f64) -> f64 {
    // What is left after 20 terms is below 2^-60; each factor of e adds two roundings.
    let whole = x.round();
    let rest = x - whole;
    let series = (1..=20).rev().fold(1.0, |sum, k| 1.0 + sum * rest / f64::from(k));
    let base = if whole < 0.0 { 1.0 / std::f64::consts::E } else { std::f64::consts::E };
    (0..whole.abs() as u32).fold(series, |product, _| product * base)
}

/// The natural logarithm of a positive finite number, of few operations. Error below `2^-50`, absolute near 1.
pub(crate) fn ln(x: f64) -> f64 {
    // x = m 2^e with m within a factor sqrt(2) of 1; ln m = 2 artanh((m - 1) / (m + 1)).
    let (mut m, mut e) = (x, 0.0);
    while m > std::f64::consts::SQRT_2 {
        (m, e) = (m * 0.5, e + 1.0);
    }
    while m < std::f64::consts::FRAC_1_SQRT_2 {
        (m, e) = (m * 2.0, e - 1.0);
    }
    let z = (m - 1.0) / (m + 1.0);
    // z^2 < 0.0295: what is left after 13 terms is below 2^-60.
    let series = (0..13).rev().fold(0.0, |sum, k| sum * (z * z) + 1.0 / f64::from(2 * k + 1));
    2.0 * z * series + e * std::f64::consts::LN_2
}

/// `2^i`, exactly; 0 or infinite out of range.
pub(crate) fn pow2(i: i32) -> f64 {
    (0..i.unsigned_abs()).fold(1.0, |x, _| if i < 0 { x * 0.5 } else { x * 2.0 })
}

/// A mesh whose indices a generator made.
pub(crate) fn mesh<V: Real>(vertices: Vec<[V; 3]>, triangles: Vec<[u32; 3]>) -> TriangleMesh<V> {
    TriangleMesh::new(vertices, triangles).expect("generators name vertices they made")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_turns() {
        for n in [1, 3, 5, 8, 24, 72, 360, 1000] {
            for i in 0..2 * n {
                let (s, c) = turn(i, n);
                let (ls, lc) = (i as f64 / n as f64 * TAU).sin_cos();
                assert!((s - ls).abs() < 2e-15 && (c - lc).abs() < 2e-15, "{i}/{n}: {s} {ls}, {c} {lc}");
            }
        }
        assert_eq!([0, 1, 2, 3].map(|i| turn(i, 4)), [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]);
    }

    #[test]
    fn functions_are_those_of_the_library() {
        for i in -300..=300 {
            let x = f64::from(i) * 0.0173;
            let ((s, c), (ls, lc)) = (turns(x), (x * TAU).sin_cos());
            // The library's argument is rounded too.
            let off = 1e-15 + 4.0 * f64::EPSILON * x.abs();
            assert!((s - ls).abs() < 8.0 * off && (c - lc).abs() < 8.0 * off, "{x}: {s} {ls}, {c} {lc}");
            assert!((exp(x) / x.exp() - 1.0).abs() < 4e-15, "{x}");
            assert!((ln(x.exp()) - x.exp().ln()).abs() < 2e-15, "{x}");
        }
        assert_eq!([0.0, 0.25, -0.5, 2.75].map(turns), [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)]);
        assert_eq!((exp(0.0), ln(1.0)), (1.0, 0.0));
        assert!(turns(f64::NAN).0.is_nan());
    }

    #[test]
    fn random_numbers_are_those_of_the_paper() {
        let mut random = Random::new(1234567);
        assert_eq!([random.next(), random.next()], [6457827717110365317, 3203168211198807973]);
        let mut random = Random::new(0);
        assert!((0..1000).all(|_| (-1.0..1.0).contains(&random.signed()) && random.below(7) < 7));
    }
}

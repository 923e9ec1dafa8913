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
    let x = rest as f64 / n as f64 * (TAU / 8.0);
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
    fn random_numbers_are_those_of_the_paper() {
        let mut random = Random::new(1234567);
        assert_eq!([random.next(), random.next()], [6457827717110365317, 3203168211198807973]);
        let mut random = Random::new(0);
        assert!((0..1000).all(|_| (-1.0..1.0).contains(&random.signed()) && random.below(7) < 7));
    }
}

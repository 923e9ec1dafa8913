//! One step of subdivision: even vertices, odd vertices, four faces for one.

use super::Weights;
use super::net::{Net, PLAIN, Ring, next, prev};
use rt_geom::glam::DVec3;

/// By which rule an even vertex moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    Smooth,
    Crease,
    Corner,
}

impl Net {
    /// The net one level finer. Even vertices keep their numbers. Face `f` becomes `4 f + k` at its corner `k`, with corners
    /// (vertex `k`, middle of the edge that leaves it, middle of the edge that comes in), and `4 f + 3` between these, whose
    /// corners are the middles of the edges 0, 1, 2.
    pub(super) fn subdivided(&self) -> Net {
        let halves = self.corners.len();
        let mut odd = vec![0u32; halves];
        let mut count = self.points.len() as u32;
        for h in 0..halves {
            let twin = self.twin[h] as usize;
            if twin >= h {
                (odd[h], odd[twin]) = (count, count);
                count += 1;
            }
        }
        let mut points = Vec::with_capacity(count as usize);
        let mut ring = Ring::default();
        for (v, &start) in self.starts().iter().enumerate() {
            self.ring(start, &mut ring);
            points.push(self.even(self.points[v], &ring));
        }
        points.extend((0..halves as u32).filter(|&h| self.twin[h as usize] >= h).map(|h| self.odd(h)));

        let mut fine = Net {
            points,
            corners: Vec::with_capacity(4 * halves),
            twin: Vec::with_capacity(4 * halves),
            rules: self.rules,
            ..Net::default()
        };
        for f in 0..halves as u32 / 3 {
            let corner = |k: u32| self.corners[(3 * f + k) as usize];
            let middle = |k: u32| odd[(3 * f + k) as usize];
            for k in 0..3 {
                let (out, into) = (3 * f + k, 3 * f + (k + 2) % 3);
                fine.corners.extend([corner(k), middle(k), middle((k + 2) % 3)]);
                let here = 12 * f + 3 * k;
                let (beyond_out, beyond_into) = (self.twin[out as usize], self.twin[into as usize]);
                // The other half of the same edge: in the corner face where the neighbour's half-edge ends; or starts.
                let to_end = 12 * (beyond_out / 3) + 3 * (next(beyond_out) % 3) + 2;
                let to_start = 12 * (beyond_into / 3) + 3 * (beyond_into % 3);
                fine.twin.extend([
                    if beyond_out == out { here } else { to_end },
                    12 * f + 9 + (k + 2) % 3,
                    if beyond_into == into { here + 2 } else { to_start },
                ]);
            }
            fine.corners.extend([middle(0), middle(1), middle(2)]);
            fine.twin.extend((0..3).map(|j| 12 * f + 3 * ((j + 1) % 3) + 1));
        }
        if self.sharp.iter().any(|&s| s > 1.0) {
            let left = |h: u32| (self.sharp[h as usize] - 1.0).max(0.0);
            let of = |f: u32| {
                let corner = move |k: u32| [left(3 * f + k), 0.0, left(3 * f + (k + 2) % 3)];
                (0..3).flat_map(corner).chain([0.0; 3])
            };
            fine.sharp = (0..halves as u32 / 3).flat_map(of).collect();
        }
        if !self.pull.is_empty() {
            let of = |f: u32| {
                let corner = move |k: u32| [self.pull[(3 * f + k) as usize], PLAIN, PLAIN];
                (0..3).flat_map(corner).chain([PLAIN; 3])
            };
            fine.pull = (0..halves as u32 / 3).flat_map(of).collect();
        }
        fine
    }

    /// Where an even vertex goes. Where its rule changes with the next level, because edges cease to be sharp, both rules
    /// have their share.
    fn even(&self, p: DVec3, ring: &Ring) -> DVec3 {
        let (now, then) = (self.rule(ring, 0.0), self.rule(ring, 1.0));
        let here = self.moved(p, ring, now, 0.0);
        if now == then {
            return here;
        }
        let ceasing = || ring.spokes.iter().map(|spoke| spoke.sharp).filter(|&s| s > 0.0 && s <= 1.0);
        let share = (ceasing().sum::<f32>() / ceasing().count().max(1) as f32) as f64;
        here * share + self.moved(p, ring, then, 1.0) * (1.0 - share)
    }

    /// The rule for edges sharper than `than`.
    fn rule(&self, ring: &Ring, than: f32) -> Rule {
        match ring.sharper(than) {
            _ if self.is_fixed(ring) => Rule::Corner,
            0 | 1 => Rule::Smooth,
            2 => Rule::Crease,
            _ => Rule::Corner,
        }
    }

    fn moved(&self, p: DVec3, ring: &Ring, rule: Rule, than: f32) -> DVec3 {
        match rule {
            Rule::Smooth => {
                let n = ring.spokes.len();
                let b = ring_weight(n, self.rules.weights);
                p * (1.0 - n as f64 * b) + sum(ring.spokes.iter().map(|spoke| spoke.at)) * b
            }
            Rule::Crease => {
                let sharp = ring.spokes.iter().filter(|spoke| spoke.sharp > than);
                p * 0.75 + sum(sharp.map(|spoke| spoke.at)) * 0.125
            }
            Rule::Corner => p,
        }
    }

    /// The new vertex on an edge.
    fn odd(&self, h: u32) -> DVec3 {
        let at = |h: u32| self.points[self.corners[h as usize] as usize];
        let (p, q) = (at(h), at(next(h)));
        let middle = (p + q) * 0.5;
        let sharpness = self.sharpness(h);
        if sharpness >= 1.0 {
            return middle;
        }
        let twin = self.twin[h as usize];
        let beside = (at(prev(h)) + at(prev(twin))) * 0.125;
        let (from_p, from_q) = (self.far_weight(h), self.far_weight(twin));
        let smooth = match (from_p == PLAIN, from_q == PLAIN) {
            (false, true) => p * (0.75 - from_p) + q * from_p + beside,
            (true, false) => q * (0.75 - from_q) + p * from_q + beside,
            // Two wishes cancel; one level on, no edge has two.
            _ => (p + q) * PLAIN + beside,
        };
        if sharpness == 0.0 {
            return smooth;
        }
        middle * sharpness as f64 + smooth * (1.0 - sharpness as f64)
    }
}

/// What each of `n` neighbours weighs in the even rule.
pub(super) fn ring_weight(n: usize, weights: Weights) -> f64 {
    match (n, weights) {
        (3, _) => 3.0 / 16.0,
        (6, _) => 1.0 / 16.0,
        (n, Weights::Warren) => 3.0 / (8.0 * n as f64),
        (n, Weights::Loop) => {
            let c = 0.375 + turn(1, n).0 / 4.0;
            (0.625 - c * c) / n as f64
        }
    }
}

/// Cosine and sine of `k / n` of a turn, exact where they are 0, 1/2 or 1.
pub(super) fn turn(k: usize, n: usize) -> (f64, f64) {
    const H: f64 = 0.866_025_403_784_438_6; // the square root of 3/4
    const TWELFTHS: [(f64, f64); 12] = [
        (1.0, 0.0),
        (H, 0.5),
        (0.5, H),
        (0.0, 1.0),
        (-0.5, H),
        (-H, 0.5),
        (-1.0, 0.0),
        (-H, -0.5),
        (-0.5, -H),
        (0.0, -1.0),
        (0.5, -H),
        (H, -0.5),
    ];
    let k = k % n;
    if (12 * k).is_multiple_of(n) {
        return TWELFTHS[12 * k / n];
    }
    let (sin, cos) = (core::f64::consts::TAU * k as f64 / n as f64).sin_cos();
    (cos, sin)
}

/// The sum, the same in whatever order and on whichever side of a mirror: that is why symmetric nets stay symmetric bit for bit.
///
/// Each number is cut at two places that depend on the largest alone; sums of such pieces are exact. Error: one rounding, and
/// `n^2 2^-100` of the largest term.
///
/// Source: Demmel and Nguyen, "Fast reproducible floating-point summation" (2013).
pub(super) fn sum(points: impl Iterator<Item = DVec3> + Clone) -> DVec3 {
    let top = points.clone().fold(DVec3::ZERO, |m, p| m.max(p.abs()));
    let n = points.clone().count().max(1) as u64;
    let room = (64 - (n - 1).leading_zeros()) as i64;
    DVec3::from_array([0, 1, 2].map(|i| {
        // The terms are below 2^e.
        let e = (top[i].to_bits() >> 52) as i64 - 1022;
        let cut = |k: i64| 1.5 * f64::from_bits(((k + 1023).clamp(1, 2046) as u64) << 52);
        let (coarse, fine) = (cut(e + 1 + room), cut(e + 2 + 2 * room - 53));
        let (mut high, mut low) = (0.0, 0.0);
        for x in points.clone().map(|p| p[i]) {
            let head = (coarse + x) - coarse;
            high += head;
            low += (fine + (x - head)) - fine;
        }
        high + low
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn weights_agree_where_they_should() {
        for weights in [Weights::Loop, Weights::Warren] {
            assert_eq!([3, 6].map(|n| ring_weight(n, weights)), [3.0 / 16.0, 1.0 / 16.0]);
            assert!(
                (2..2000).all(|n| n as f64 * ring_weight(n, weights) < 1.0 && ring_weight(n, weights) > 0.0)
            );
        }
        assert!((ring_weight(4, Weights::Loop) - (0.625 - 0.375 * 0.375) / 4.0).abs() < 1e-17);
        assert_eq!((turn(7, 6), turn(1, 4), turn(5, 2)), (turn(1, 6), (0.0, 1.0), (-1.0, 0.0)));
    }

    proptest! {
        #[test]
        fn sums_have_no_order(parts in prop::collection::vec((any::<i32>(), -1000..900i32), 1..40), cut in 0..40usize) {
            let all: Vec<DVec3> = parts.iter().map(|&(m, e)| DVec3::splat(m as f64) * (2f64).powi(e)).collect();
            let mut turned = all.clone();
            turned.rotate_left(cut % all.len());
            turned.reverse();
            let s = sum(all.iter().copied());
            prop_assert_eq!(s, sum(turned.iter().copied()));
            prop_assert_eq!(-s, sum(turned.iter().map(|p| -*p)));
            let top = all.iter().fold(0.0, |m: f64, p| m.max(p.x.abs()));
            let plain: f64 = all.iter().map(|p| p.x).sum();
            prop_assert!((s.x - plain).abs() <= top * 40.0 * f64::EPSILON * all.len() as f64);
        }
    }
}

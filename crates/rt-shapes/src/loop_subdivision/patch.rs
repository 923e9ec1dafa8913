//! The limit surface anywhere: subdivision around the point until its patch is regular, then the box spline.

use super::LimitPoint;
use super::limit::unit_cross;
use super::net::{Net, PLAIN, Ring, prev};
use rt_geom::glam::DVec3;

/// `(coefficient, exponents of the three weights)`.
type Term = (f64, [usize; 3]);

/// The quartic box spline over a triangle of the regular net, times 12: what weighs the first corner; the rest by symmetry.
const CORNER: [Term; 15] = [
    (6.0, [4, 0, 0]),
    (24.0, [3, 1, 0]),
    (24.0, [3, 0, 1]),
    (24.0, [2, 2, 0]),
    (60.0, [2, 1, 1]),
    (24.0, [2, 0, 2]),
    (8.0, [1, 3, 0]),
    (36.0, [1, 2, 1]),
    (36.0, [1, 1, 2]),
    (8.0, [1, 0, 3]),
    (1.0, [0, 4, 0]),
    (6.0, [0, 3, 1]),
    (12.0, [0, 2, 2]),
    (6.0, [0, 1, 3]),
    (1.0, [0, 0, 4]),
];
/// The vertex opposite, beyond the edge of the first two corners.
const BEYOND: [Term; 9] = [
    (1.0, [4, 0, 0]),
    (6.0, [3, 1, 0]),
    (2.0, [3, 0, 1]),
    (12.0, [2, 2, 0]),
    (6.0, [2, 1, 1]),
    (6.0, [1, 3, 0]),
    (6.0, [1, 2, 1]),
    (1.0, [0, 4, 0]),
    (2.0, [0, 3, 1]),
];
/// The neighbour of the first corner alone that is nearer to the second.
const OUTER: [Term; 2] = [(1.0, [4, 0, 0]), (2.0, [3, 1, 0])];

/// The twelve control points of a regular patch: each corner with the three neighbours that come after the third corner,
/// counter-clockwise: two of its own, and the one beyond the edge to the next corner.
pub(super) struct Regular {
    corners: [DVec3; 3],
    outer: [[DVec3; 2]; 3],
    beyond: [DVec3; 3],
}

impl Regular {
    /// The point, and its derivatives by each of the three weights.
    pub(super) fn at(&self, w: [f64; 3]) -> (DVec3, [DVec3; 3]) {
        let mut powers = [[1.0; 5]; 3];
        for (powers, w) in powers.iter_mut().zip(w) {
            for k in 1..5 {
                powers[k] = powers[k - 1] * w;
            }
        }
        let (mut point, mut slopes) = (DVec3::ZERO, [DVec3::ZERO; 3]);
        // Weights in the order that makes this corner the first.
        let mut add = |terms: &[Term], order: [usize; 3], p: DVec3| {
            let (mut value, mut slope) = (0.0, [0.0; 3]);
            for &(c, [i, j, k]) in terms {
                let [x, y, z] = order.map(|a| &powers[a]);
                value += c * x[i] * y[j] * z[k];
                slope[0] += if i > 0 { c * i as f64 * x[i - 1] * y[j] * z[k] } else { 0.0 };
                slope[1] += if j > 0 { c * j as f64 * x[i] * y[j - 1] * z[k] } else { 0.0 };
                slope[2] += if k > 0 { c * k as f64 * x[i] * y[j] * z[k - 1] } else { 0.0 };
            }
            point += p * (value / 12.0);
            for (slope, a) in slope.into_iter().zip(order) {
                slopes[a] += p * (slope / 12.0);
            }
        };
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            add(&CORNER, [i, j, k], self.corners[i]);
            add(&BEYOND, [i, j, k], self.beyond[i]);
            add(&OUTER, [i, k, j], self.outer[i][0]);
            add(&OUTER, [i, j, k], self.outer[i][1]);
        }
        (point, slopes)
    }
}

impl Net {
    /// The limit surface at a point of a face with these weights of its corners, which add to 1.
    pub(super) fn limit_at(&self, face: u32, weights: [f64; 3]) -> LimitPoint {
        self.patch(face).evaluate(weights)
    }

    /// A face with what surrounds it, as face 0.
    pub(super) fn patch(&self, face: u32) -> Net {
        self.around(&[3 * face, 3 * face + 1, 3 * face + 2])
    }

    /// The limit at a point of face 0 of a patch.
    pub(super) fn evaluate(&self, weights: [f64; 3]) -> LimitPoint {
        if let Some(regular) = self.regular() {
            return local(&regular, weights, (DVec3::ZERO, 1.0), [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]);
        }
        let mut net = self.clone();
        let mut w = weights;
        // Where the net's own origin is, in what unit it is kept, and how the weights move with u and v, times that unit.
        let (mut origin, mut unit) = (DVec3::ZERO, 1.0);
        let mut moves = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];
        loop {
            if let Some(regular) = net.regular() {
                return local(&regular, w, (origin, unit), moves);
            }
            if let Some(k) = (0..3).find(|&k| w[(k + 1) % 3] == 0.0 && w[(k + 2) % 3] == 0.0) {
                let (point, normal) = net.limit(k as u32);
                return LimitPoint {
                    point: origin + point * unit,
                    dpdu: DVec3::ZERO,
                    dpdv: DVec3::ZERO,
                    normal,
                };
            }
            let near = (0..3).find(|&k| w[k] >= 0.5);
            w = in_child(near, w);
            moves = moves.map(|m| in_child(near, m));
            if let Some(k) = near {
                // The net shrinks towards the corner, by about a half a level: kept around the origin, and enlarged as much, it
                // loses no digits.
                let here = net.points[net.corners[k] as usize];
                origin += here * unit;
                unit *= 0.5;
                net.points.iter_mut().for_each(|p| *p = (*p - here) * 2.0);
                moves = moves.map(|m| m.map(|m| m * 0.5));
            }
            net = net.subdivided().patch(near.unwrap_or(3) as u32);
        }
    }

    /// The control points of face 0, where none but regular rules will ever work on it. Past boundaries and creases with three
    /// faces the net is continued by parallelograms, which their rules amount to.
    pub(super) fn regular(&self) -> Option<Regular> {
        let corner = |k: usize| self.points[self.corners[k] as usize];
        let mut regular = Regular {
            corners: [0, 1, 2].map(corner),
            outer: [[DVec3::ZERO; 2]; 3],
            beyond: [DVec3::ZERO; 3],
        };
        let mut ring = Ring::default();
        for k in 0..3 {
            self.ring(k as u32, &mut ring);
            let rest = self.hexagon(&ring, k as u32, corner(k))?;
            (regular.outer[k], regular.beyond[k]) = ([rest[0], rest[1]], rest[2]);
        }
        Some(regular)
    }

    /// The last three of the six neighbours, counted counter-clockwise from the spoke along `h`.
    fn hexagon(&self, ring: &Ring, h: u32, p: DVec3) -> Option<[DVec3; 3]> {
        let forever = |s: f32| s == 0.0 || s == f32::INFINITY;
        if !ring.spokes.iter().all(|spoke| forever(spoke.sharp)) {
            return None;
        }
        if ring.outs.iter().any(|&out| self.far_weight(out) != PLAIN || self.far_weight(prev(out)) != PLAIN) {
            return None;
        }
        let place = ring.place(h);
        match ring.sharper(0.0) {
            0 if ring.spokes.len() == 6 => Some([3, 4, 5].map(|i| ring.spoke(place + i).at)),
            2 => {
                let (sector, place) = ring.sector(place);
                let [a, b, c, d] = <[DVec3; 4]>::try_from(sector).ok()?;
                // Differences first: near an irregular vertex all of them are small.
                let all = [a, b, c, d, d + (p - c), a + (p - b)];
                Some([3, 4, 5].map(|i| all[(place + i) % 6]))
            }
            _ => None,
        }
    }
}

/// Weights of a face's corners as weights of the corners of its part at corner `near`, or of the part between. Linear, so that it
/// also says how weights move.
fn in_child(near: Option<usize>, w: [f64; 3]) -> [f64; 3] {
    match near {
        Some(k) => {
            let (after, before) = (w[(k + 1) % 3], w[(k + 2) % 3]);
            [w[k] - after - before, 2.0 * after, 2.0 * before]
        }
        None => [w[0] + w[1] - w[2], w[1] + w[2] - w[0], w[2] + w[0] - w[1]],
    }
}

/// The box spline as a function of u and v.
fn local(regular: &Regular, w: [f64; 3], (origin, unit): (DVec3, f64), moves: [[f64; 3]; 2]) -> LimitPoint {
    let (point, slopes) = regular.at(w);
    let [dpdu, dpdv] = moves.map(|m| slopes[0] * m[0] + slopes[1] * m[1] + slopes[2] * m[2]);
    LimitPoint { point: origin + point * unit, dpdu, dpdv, normal: unit_cross(dpdu, dpdv) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_of_the_patch_add_to_one_and_its_slopes_to_nothing() {
        let ones = [DVec3::ONE; 3];
        let flat = Regular { corners: ones, outer: [[DVec3::ONE; 2]; 3], beyond: ones };
        for (u, v) in [(0.0, 0.0), (0.25, 0.5), (0.1, 0.05), (0.0, 1.0)] {
            let at =
                local(&flat, [1.0 - u - v, u, v], (DVec3::ZERO, 1.0), [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]);
            assert!((at.point - DVec3::ONE).length() < 1e-15);
            assert!(at.dpdu.length() + at.dpdv.length() < 1e-14);
        }
    }
}

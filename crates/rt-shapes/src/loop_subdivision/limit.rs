//! Limit points and limit normals at vertices.

use super::net::{Net, PLAIN, Ring, prev};
use super::step::{ring_weight, sum, turn};
use rt_geom::glam::DVec3;

/// Steps after which a dart's ring has its limit shape.
const POWERS: usize = 48;

impl Net {
    /// The limit of the vertex that `h` leaves, and the unit normal there, of the sector that holds the face of `h`; zero where
    /// the tangents span no plane.
    pub(super) fn limit(&self, h: u32) -> (DVec3, DVec3) {
        let mut ring = Ring::default();
        self.ring(h, &mut ring);
        self.limit_in(h, &mut ring)
    }

    /// [`Net::limit`] where the ring is known already.
    pub(super) fn limit_in(&self, h: u32, ring: &mut Ring) -> (DVec3, DVec3) {
        if self.is_settled(ring) {
            return self.settled_limit(h, ring);
        }
        let (mut net, mut out) = (self.around(&[h]), h % 3);
        loop {
            // The same vertex, one level finer, in the first face's corner.
            net = net.subdivided();
            net = net.around(&[3 * out]);
            out = 0;
            net.ring(out, ring);
            if net.is_settled(ring) {
                return net.settled_limit(out, ring);
            }
        }
    }

    /// Whether the rules at this vertex are those of all levels to come.
    fn is_settled(&self, ring: &Ring) -> bool {
        ring.spokes.iter().all(|spoke| spoke.sharp == 0.0 || spoke.sharp == f32::INFINITY)
            && ring.outs.iter().all(|&out| self.far_weight(prev(out)) == PLAIN)
    }

    fn settled_limit(&self, h: u32, ring: &Ring) -> (DVec3, DVec3) {
        let p = self.points[self.corners[h as usize] as usize];
        let n = ring.spokes.len();
        let sharp = ring.sharper(0.0);
        if sharp == 0 {
            let g = 1.0 / (n as f64 + 3.0 / (8.0 * ring_weight(n, self.rules.weights)));
            let point = p * (1.0 - n as f64 * g) + sum(ring.spokes.iter().map(|spoke| spoke.at)) * g;
            return (point, smooth_normal(p, ring));
        }
        if sharp == 1 {
            return self.dart_limit(h);
        }
        let (sector, _) = ring.sector(ring.place(h));
        if sharp > 2 || self.is_fixed(ring) {
            return (p, corner_normal(p, &sector));
        }
        let creased = ring.spokes.iter().filter(|spoke| spoke.sharp > 0.0);
        let point = p * (2.0 / 3.0) + sum(creased.map(|spoke| spoke.at)) * (1.0 / 6.0);
        (point, crease_normal(p, &sector, self.far_weight(inner_spoke(ring, h))))
    }

    /// Where a crease ends there is no closed form: the ring is subdivided until it has its limit shape. Error of the point
    /// below `2^-47` of the ring's size, of the normal below `1e-9`.
    fn dart_limit(&self, h: u32) -> (DVec3, DVec3) {
        let (mut net, mut out) = (self.around(&[h]), h % 3);
        let mut point = DVec3::ZERO;
        let mut ring = Ring::default();
        for _ in 0..POWERS {
            let here = net.points[net.corners[out as usize] as usize];
            point += here;
            net.shift(here);
            net = net.subdivided().around(&[3 * out]);
            out = 0;
        }
        net.ring(out, &mut ring);
        let here = net.points[net.corners[out as usize] as usize];
        let points: Vec<DVec3> =
            ring.spokes.iter().chain(ring.spokes.first()).map(|spoke| spoke.at).collect();
        (point + here, turning(here, &points))
    }
}

/// An inner spoke of the sector that holds the face of `h`; `h` itself where there is none.
fn inner_spoke(ring: &Ring, h: u32) -> u32 {
    let n = ring.outs.len();
    let place = ring.place(h);
    match (ring.spokes[place].sharp, ring.outs.get((place + 1) % n)) {
        (0.0, _) => h,
        (_, Some(&out)) if ring.spoke(place + 1).sharp == 0.0 => out,
        _ => h,
    }
}

/// The cross product, of unit length, of vectors of any length; zero for parallel ones.
pub(super) fn unit_cross(a: DVec3, b: DVec3) -> DVec3 {
    let unit = |v: DVec3| v / v.abs().max_element();
    let n = unit(a).cross(unit(b));
    if n.is_finite() { unit(n).normalize_or_zero() } else { DVec3::ZERO }
}

/// Twice the area vector of the fan of triangles between `p` and these points, of unit length.
fn turning(p: DVec3, points: &[DVec3]) -> DVec3 {
    let size = points.iter().fold(DVec3::ZERO, |m, &q| m.max((q - p).abs())).max_element();
    let area: DVec3 = points.windows(2).map(|w| ((w[0] - p) / size).cross((w[1] - p) / size)).sum();
    let n = area / area.abs().max_element();
    if n.is_finite() { n.normalize_or_zero() } else { DVec3::ZERO }
}

/// Where no triangle turns against another, `turning` has the sense of the normal; where the tangents are parallel it is the
/// next best.
fn agreed(n: DVec3, p: DVec3, points: &[DVec3]) -> DVec3 {
    if n == DVec3::ZERO { turning(p, points) } else { n }
}

fn smooth_normal(p: DVec3, ring: &Ring) -> DVec3 {
    let n = ring.spokes.len();
    let (mut along, mut across) = (DVec3::ZERO, DVec3::ZERO);
    for (k, spoke) in ring.spokes.iter().enumerate() {
        let (cos, sin) = turn(k, n);
        along += (spoke.at - p) * cos;
        across += (spoke.at - p) * sin;
    }
    let closed: Vec<DVec3> = ring.spokes.iter().chain(ring.spokes.first()).map(|spoke| spoke.at).collect();
    agreed(unit_cross(along, across), p, &closed)
}

/// From the left eigenvectors of the sector's subdivision matrix.
fn crease_normal(p: DVec3, sector: &[DVec3], far: f64) -> DVec3 {
    let along = sector[sector.len() - 1] - sector[0];
    let (_, end, inner) = across_weights(sector.len() - 1, far);
    let mut across = (sector[0] - p + (sector[sector.len() - 1] - p)) * end;
    for (q, w) in sector[1..].iter().zip(inner) {
        across += (*q - p) * w;
    }
    agreed(unit_cross(across, along), p, sector)
}

/// The tangent across a boundary or crease, as weights of the vertex, of the two neighbours along it, and of those between, for
/// a sector of so many faces. They add to zero.
///
/// With `t = pi / faces` and `w` the weight of the far end of an inner edge, the inner weights `sin(k t)` belong to the eigenvalue
/// `l = w + cos(t) / 4`. The rows of the vertex and its neighbours, which move by 3/4, 1/8, 1/8 and by 1/2, 1/2, leave
///
/// ```text
/// (l - 1/2) end = (sin t + own) / 8        (l - 3/4) own = end + (3/4 - w) cot(t / 2)
/// ```
///
/// The masks in print for five neighbours and more belong to odd weights of 5/8, 3/8 on the boundary (Hoppe et al. 1994), not to
/// these.
pub(super) fn across_weights(faces: usize, far: f64) -> (f64, f64, Vec<f64>) {
    if faces == 1 {
        // No edge between: what is left is the bend of the boundary.
        return (-2.0, 1.0, Vec::new());
    }
    let (cos, sin) = turn(1, 2 * faces);
    let l = far + cos / 4.0;
    let between = (0.75 - far) * (1.0 + cos) / sin;
    let end = (between + (l - 0.75) * sin) / (8.0 * (l - 0.75) * (l - 0.5) - 1.0);
    let own = 8.0 * (l - 0.5) * end - sin;
    (own, end, (1..faces).map(|k| turn(k, 2 * faces).1).collect())
}

fn corner_normal(p: DVec3, sector: &[DVec3]) -> DVec3 {
    let sense = turning(p, sector);
    let n = unit_cross(sector[0] - p, sector[sector.len() - 1] - p);
    // Beyond half a turn the cross product has the other sense.
    let n = if n.dot(sense) < 0.0 { -n } else { n };
    agreed(n, p, sector)
}

#[cfg(test)]
mod tests {
    use super::super::net::far_weight;
    use super::super::{Boundaries, Corners, LoopRules, Weights};
    use super::*;

    const ALL_WEIGHTS: [Weights; 2] = [Weights::Loop, Weights::Warren];

    /// A vertex, number 0, with `n` neighbours around it; or with a fan of `n - 1` faces.
    fn fan(n: usize, open: bool, rules: LoopRules, at: impl Fn(usize) -> DVec3) -> (Net, u32) {
        let points = (0..=n).map(at).collect();
        let faces = if open { n - 1 } else { n };
        let triangles: Vec<[u32; 3]> =
            (0..faces).map(|k| [0, k as u32 + 1, (k as u32 + 1) % n as u32 + 1]).collect();
        let (net, starts) = Net::new(points, &triangles, rules).unwrap();
        (net, starts[0])
    }

    /// Coordinates without any pattern, vertex 0 in their midst.
    fn rough(i: usize) -> DVec3 {
        let x = i as f64;
        DVec3::new((1.3 * x).cos() * x.sqrt(), (1.3 * x).sin() + 0.1 * x, (x * x * 0.7).sin())
    }

    fn spokes(net: &Net, h: u32) -> (DVec3, Vec<DVec3>) {
        let mut ring = Ring::default();
        net.ring(h, &mut ring);
        (net.points[net.corners[h as usize] as usize], ring.spokes.iter().map(|spoke| spoke.at).collect())
    }

    #[test]
    fn subdominant_eigenvalues_are_those_in_print() {
        for (weights, n) in ALL_WEIGHTS.into_iter().flat_map(|w| (3..13).map(move |n| (w, n))) {
            let rules = LoopRules { weights, boundaries: Boundaries::Plain, corners: Corners::Round };
            let (net, h) = fan(n, false, rules, |i| {
                let (cos, sin) = turn(i.wrapping_sub(1) % n, n);
                if i == 0 { DVec3::ZERO } else { DVec3::new(cos, sin, 0.0) }
            });
            let (v, ring) = spokes(&net.subdivided(), 3 * h);
            let value = 0.375 + turn(1, n).0 / 4.0;
            assert!(v.length() < 1e-15);
            for (k, q) in ring.iter().enumerate() {
                let (cos, sin) = turn(k, n);
                assert!((*q - DVec3::new(cos, sin, 0.0) * value).length() < 1e-15, "{weights:?} {n}");
            }
        }
        assert_eq!([3, 4, 6].map(|n| 0.375 + turn(1, n).0 / 4.0), [0.25, 0.375, 0.5]);
    }

    #[test]
    fn limit_masks_do_not_change_under_subdivision() {
        for (weights, n) in ALL_WEIGHTS.into_iter().flat_map(|w| (2..40).map(move |n| (w, n))) {
            let rules = LoopRules { weights, boundaries: Boundaries::Plain, ..LoopRules::default() };
            for open in [false, true] {
                let (net, h) = fan(n, open, rules, rough);
                let (fine, g) = (net.subdivided(), 3 * h);
                let ((p, m), (q, n)) = (net.limit(h), fine.limit(g));
                assert!((p - q).length() < 1e-14, "{p} {q}");
                assert!((m - n).length() < 1e-11, "{} {open} {m} {n}", net.points.len());
            }
        }
    }

    #[test]
    fn tangents_are_left_eigenvectors() {
        for faces in 1..12 {
            for boundaries in [Boundaries::Plain, Boundaries::Smooth] {
                let rules = LoopRules { boundaries, ..LoopRules::default() };
                let (net, h) = fan(faces + 1, true, rules, rough);
                let far = if boundaries == Boundaries::Plain { PLAIN } else { far_weight(faces, false) };
                let (own, end, inner) = across_weights(faces, far);
                assert!((own + 2.0 * end + inner.iter().sum::<f64>()).abs() < 1e-13);
                // Neighbours wish, too: they are asked for once only, so one level is skipped.
                let net = net.subdivided();
                let h = 3 * h;
                let across = |net: &Net, h: u32| {
                    let (v, ring) = spokes(net, h);
                    let sum = ring.iter().skip(1).zip(&inner).map(|(q, w)| *q * *w).sum::<DVec3>();
                    v * own + (ring[0] + ring[faces]) * end + sum
                };
                let along = |net: &Net, h: u32| {
                    let (_, ring) = spokes(net, h);
                    ring[faces] - ring[0]
                };
                let fine = net.subdivided();
                let value = match (faces, boundaries) {
                    (1, _) => 0.25,
                    (_, Boundaries::Plain) => 0.375 + turn(1, 2 * faces).0 / 4.0,
                    (_, Boundaries::Smooth) => 0.5,
                };
                assert!(
                    (across(&fine, 3 * h) - across(&net, h) * value).length() < 1e-13,
                    "{faces} {boundaries:?}"
                );
                assert!((along(&fine, 3 * h) - along(&net, h) * 0.5).length() < 1e-13);
            }
        }
    }

    #[test]
    fn printed_masks_of_small_boundary_rings_agree() {
        let normal = |weights: (f64, f64, Vec<f64>)| {
            let scale = weights.2[0];
            (weights.0 / scale, weights.1 / scale, weights.2.iter().map(|w| w / scale).collect::<Vec<f64>>())
        };
        let (own, end, inner) = normal(across_weights(2, PLAIN));
        assert!((own + 1.0).abs() + end.abs() < 1e-15 && inner == [1.0]);
        let (own, end, inner) = normal(across_weights(3, PLAIN));
        assert!((own + 1.0).abs() + (end + 0.5).abs() + (inner[1] - 1.0).abs() < 1e-15);
    }
}

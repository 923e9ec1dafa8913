//! What of a triangle lies in a box: for builders that split space.

use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

/// A triangle cut by six planes has at most this many corners.
const MOST: usize = 9;

/// A box around the part of a triangle inside `cell`, both relative to `origin`; empty where nothing is.
///
/// Error: outward. A part that lies in the closed cell is never lost, because each cut keeps a little more than its side: by
/// [`slack`], which outweighs the roundings of the origin and of all cuts. The result is cut to `cell`.
///
/// Source: Sutherland and Hodgman, "Reentrant polygon clipping", CACM 17(1) 1974; for split clipping: Havran and Bittner, "On
/// improving kd-trees for ray shooting", WSCG 2002.
pub(crate) fn clipped_bound(corners: [DVec3; 3], cell: &Aabb, origin: DVec3) -> Aabb {
    let whole = Aabb::from_f64(
        corners[0].min(corners[1]).min(corners[2]),
        corners[0].max(corners[1]).max(corners[2]),
        origin,
    );
    let inside = whole.overlap(*cell);
    // Nothing to gain within the cell, nor where arithmetic leaves its range.
    if !inside.is_valid() || cell.contains(whole) || !whole.min.is_finite() || !whole.max.is_finite() {
        return inside;
    }
    let local = corners.map(|corner| corner - origin);
    let slack = slack(corners, origin);
    let (low, high) = (cell.min.as_dvec3() - slack, cell.max.as_dvec3() + slack);
    let mut polygon = [DVec3::ZERO; MOST];
    polygon[..3].copy_from_slice(&local);
    let mut count = 3;
    for a in 0..3 {
        for (side, plane) in [(1.0, low[a]), (-1.0, -high[a])] {
            if !plane.is_finite() {
                continue;
            }
            let above = |p: DVec3| side * p[a] - plane;
            let mut kept = [DVec3::ZERO; MOST];
            let mut n = 0;
            for i in 0..count {
                let (p, q) = (polygon[i], polygon[(i + 1) % count]);
                let (above_p, above_q) = (above(p), above(q));
                if above_p >= 0.0 {
                    kept[n.min(MOST - 1)] = p;
                    n += 1;
                }
                if (above_p >= 0.0) != (above_q >= 0.0) {
                    let mut cut = p + (q - p) * (above_p / (above_p - above_q));
                    cut[a] = side * plane;
                    kept[n.min(MOST - 1)] = cut;
                    n += 1;
                }
            }
            // Rounding may bend a sliver so that a plane cuts it more than twice: then the box must do.
            if n > MOST {
                return inside;
            }
            (polygon, count) = (kept, n);
        }
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in &polygon[..count] {
        (min, max) = (min.min(*p), max.max(*p));
    }
    if count == 0 {
        Aabb::EMPTY
    } else {
        Aabb::from_f64(min - slack, max + slack, DVec3::ZERO).overlap(inside)
    }
}

/// Room for all roundings: the shift to the origin moves a corner by one rounding, and each of at most six cuts a new one by at
/// most ten, all of the triangle's largest coordinate; that is 61 of `u = 2^-53`, and here are twice as many.
fn slack(corners: [DVec3; 3], origin: DVec3) -> DVec3 {
    let largest = corners.iter().fold(DVec3::ZERO, |m, c| m.max((*c - origin).abs())).max_element();
    DVec3::splat(largest * (64.0 * f64::EPSILON))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_geom::glam::Vec3A;

    fn point() -> impl Strategy<Value = [f64; 3]> {
        // On a coarse lattice, so that corners, edges and faces often meet exactly, or anywhere.
        let coordinate = prop_oneof![(-4..=4i32).prop_map(|i| i as f64 * 0.5), -2.0..2.0f64];
        prop::array::uniform3(coordinate)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn nothing_in_the_cell_is_lost(corners in prop::array::uniform3(point()), a in point(), b in point(), far in 0..3u8,
                                       w in prop::collection::vec((0..=8u8, 0..=8u8), 40)) {
            let origin = DVec3::splat([0.0, 1e7, -3e12][far as usize]);
            let corners = corners.map(|c| DVec3::from_array(c) + origin);
            let cell = Aabb::from_points([a, b].map(|p| DVec3::from_array(p).as_vec3a()));
            let part = clipped_bound(corners, &cell, origin);
            prop_assert!(part.is_empty() || cell.contains(part));
            for (u, v) in w {
                let (u, v) = if u + v > 8 { (8 - u, 8 - v) } else { (u, v) };
                // Weights in eighths of lattice points: mostly exact.
                let (u, v) = (u as f64 / 8.0, v as f64 / 8.0);
                let p = (corners[0] - origin) * (1.0 - u - v) + (corners[1] - origin) * u + (corners[2] - origin) * v;
                let p32 = p.as_vec3a();
                if p32.as_dvec3() == p && cell.contains(Aabb::new(p32, p32)) {
                    prop_assert!(part.contains(Aabb::new(p32, p32)), "{} not in {:?}", p, part);
                }
            }
        }
    }

    #[test]
    fn a_diagonal_triangle_is_cut_to_its_part() {
        let corners = [DVec3::ZERO, DVec3::new(8.0, 8.0, 0.0), DVec3::new(8.0, 8.0, 1.0)];
        let cell = Aabb::new(Vec3A::new(2.0, 0.0, 0.0), Vec3A::new(3.0, 8.0, 8.0));
        let part = clipped_bound(corners, &cell, DVec3::ZERO);
        let near = |x: f32, y: f32| (x - y).abs() < 1e-6;
        assert!(near(part.min.y, 2.0) && near(part.max.y, 3.0) && near(part.max.z, 0.375), "{part:?}");
        let beside = Aabb::new(Vec3A::new(2.0, 4.0, 0.0), Vec3A::new(3.0, 8.0, 8.0));
        assert!(clipped_bound(corners, &beside, DVec3::ZERO).is_empty());
    }
}

//! What of a shape lies in a box: for builders that split space.

use crate::Triangle;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

impl Triangle {
    /// A box around the part of it inside `cell`, both relative to `origin`; empty where nothing is, or a corner is not finite.
    pub fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        match self.corners.iter().all(|c| c.is_finite()) {
            true => clipped_bound(self.corners, cell, origin),
            false => Aabb::EMPTY,
        }
    }
}

/// Whether the surface of a ball stays out of `cell`, which is relative to `origin`: the cell lies outside the ball, or inside.
/// `false` where rounding leaves it open.
///
/// Error: a difference is off by at most 3 roundings of the largest number in it, its square by 2 more, and sums of three by 2:
/// here is room for sixteen.
///
/// Source: Arvo, "A simple method for box-sphere intersection testing", Graphics Gems (1990).
pub(crate) fn sphere_avoids(center: DVec3, radius: f64, cell: &Aabb, origin: DVec3) -> bool {
    let (low, high, c) = (cell.min.as_dvec3(), cell.max.as_dvec3(), center - origin);
    let slack = (center.abs() + origin.abs() + low.abs().max(high.abs())) * ROOM;
    let nearest = ((low - c).max(c - high) - slack).max(DVec3::ZERO);
    let farthest = (low - c).abs().max((high - c).abs()) + slack;
    let square = radius * radius;
    // False for what is not a number, and where squares leave the range.
    nearest.length_squared() * (1.0 - ROOM) > square * (1.0 + ROOM)
        || (farthest.length_squared() * (1.0 + ROOM) < square * (1.0 - ROOM) && square.is_finite())
}

/// Whether a direction separates `cell`, which is relative to `origin`, from the hull of two circles with `ends` for middles,
/// perpendicular to the line between them: along that line, or away from it towards the cell. `false` where rounding leaves it
/// open.
///
/// Error: any direction is as good as another, so its own rounding does not matter; products along it are off by at most eight
/// roundings of their largest term, and here is room for sixteen.
///
/// Source: Gottschalk, Lin and Manocha, "OBBTree", SIGGRAPH 1996 (separating axes).
pub(crate) fn frustum_avoids(ends: [DVec3; 2], radii: [f64; 2], cell: &Aabb, origin: DVec3) -> bool {
    let (low, high) = (cell.min.as_dvec3(), cell.max.as_dvec3());
    let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let [base, top] = ends.map(|end| end - origin);
    let axis = top - base;
    let size = ends[0].abs().max(ends[1].abs()) + origin.abs() + low.abs().max(high.abs());
    // `reach`: how far a circle of radius 1 extends along the direction.
    let separates = |dir: DVec3, reach: f64| {
        let ends = [(base.dot(dir), radii[0] * reach), (top.dot(dir), radii[1] * reach)];
        let [from, to] = [
            ends.iter().fold(f64::INFINITY, |m, (at, r)| m.min(at - r)),
            ends.iter().fold(f64::NEG_INFINITY, |m, (at, r)| m.max(at + r)),
        ];
        let (at, r) = (center.dot(dir), half.dot(dir.abs()));
        let slack = (size.dot(dir.abs()) + radii[0].max(radii[1]) * reach) * ROOM;
        at - r > to + slack || at + r < from - slack
    };
    // What rounding leaves of a circle's extent along its own axis.
    if separates(axis, axis.length() * ROOM + size.max_element() * ROOM) {
        return true;
    }
    let away = (center - base) - axis * ((center - base).dot(axis) / axis.length_squared());
    separates(away, away.length() * (1.0 + ROOM))
}

/// Sixteen roundings.
const ROOM: f64 = 8.0 * f64::EPSILON;

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
            // Nothing to cut off.
            if polygon[..count].iter().all(|p| above(*p) >= 0.0) {
                continue;
            }
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        /// Points of the surfaces stand in cells that are not avoided; cells far away are.
        #[test]
        fn cells_with_a_point_of_the_surface_are_not_avoided(
            p in point(), q in point(), r in 0.01..2.0f64, s in 0.0..2.0f64, way in point(), v in 0.0..=1.0f64,
            size in prop_oneof![Just(0.0f32), 1e-6..1.0f32], far in 0..3u8,
        ) {
            let origin = DVec3::splat([0.0, 1e7, -3e12][far as usize]);
            let (base, top) = (DVec3::from_array(p) + origin, DVec3::from_array(q) + origin);
            let dir = DVec3::from_array(way).normalize_or(DVec3::X);
            // What the shift rounds off is part of the shape.
            let around = |point: DVec3, tolerance: f64| {
                let at = (point - origin).as_vec3a();
                let room = Vec3A::splat(size + 1e-6 + tolerance as f32);
                Aabb::new(at - room, at + room)
            };
            let tolerance = origin.abs().max_element() * 1e-15;
            let cell = around(base + dir * r, tolerance);
            prop_assert!(!sphere_avoids(base, r, &cell, origin));
            let axis = top - base;
            if axis.length() > 1e-3 {
                let across = dir.cross(axis).try_normalize().unwrap_or(axis.any_orthonormal_vector());
                let point = base + axis * v + across * (r + (s - r) * v);
                prop_assert!(!frustum_avoids([base, top], [r, s], &around(point, tolerance), origin));
                let beyond = around(base - axis.normalize() * 0.5 - axis * 0.01, 0.0);
                prop_assert!(far == 2 || size > 0.2 || frustum_avoids([base, top], [r, s], &beyond, origin));
            }
            let outside = around(base + dir * (r + 2.0), 0.0);
            let inside = around(base, 0.0);
            prop_assert!(far == 2 || size > 0.9 || sphere_avoids(base, r, &outside, origin));
            prop_assert!(far == 2 || r < 0.1 || size > 0.05 || sphere_avoids(base, r, &inside, origin));
        }
    }
}

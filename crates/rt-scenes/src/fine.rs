//! Meshes of `f64` whose features `f32` cannot tell apart.

use crate::numbers::{Random, mesh};
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// `n` triangles of a few millimetres within a metre of `center`, when lengths are metres: at a distance of `1e7`, where `f32` counts in
/// metres, a planet's radius. At most a million.
///
/// ```
/// use rt_geom::glam::DVec3;
/// let far = rt_scenes::fine::rubble(10, DVec3::splat(1e7), 1);
/// let [x, y, z] = far.vertices()[0];
/// assert!((x - 1e7).abs() < 1.1 && x != 1e7);
/// ```
pub fn rubble(n: u32, center: DVec3, seed: u64) -> TriangleMesh<f64> {
    let n = n.min(1_000_000);
    let mut random = Random::new(seed);
    let mut point = || {
        let (x, y, z) = (random.signed(), random.signed(), random.signed());
        DVec3::new(x, y, z)
    };
    let mut vertices = Vec::with_capacity(3 * n as usize);
    for _ in 0..n {
        let middle = point();
        vertices.extend([0; 3].map(|_| (center + (middle + point() * 0.005)).to_array()));
    }
    mesh(vertices, (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// `n` squares, each `2^-29` (about two nanometres) above the last, at a height of `1e7`, where that is the last digit of `f64`: each of
/// two triangles. At most a million.
pub fn stairs(n: u32) -> TriangleMesh<f64> {
    let n = n.min(1_000_000);
    let step = 1.0 / f64::from(1 << 29);
    let mut vertices = Vec::with_capacity(4 * n as usize);
    for i in 0..n {
        let (x, z) = (f64::from(i), 1e7 + f64::from(i) * step);
        // Treads overlap, so that a ray down on them must tell two heights apart.
        vertices.extend([[x, 0.0, z], [x + 2.0, 0.0, z], [x + 2.0, 1.0, z], [x, 1.0, z]]);
    }
    mesh(vertices, (0..n).map(|i| 4 * i).flat_map(|a| [[a, a + 1, a + 2], [a, a + 2, a + 3]]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_accel::Geometry;
    use rt_geom::Ray;

    #[test]
    fn neighbouring_heights_are_told_apart() {
        let stairs = stairs(10);
        let ray = Ray::new(DVec3::new(1.5, 0.25, 2e7), -DVec3::Z);
        let t = [0, 2].map(|prim| stairs.intersect(prim, &ray).map(|hit| hit.t));
        assert!(t[1].unwrap() < t[0].unwrap(), "{t:?}");
        assert_eq!(stairs.degenerate() + rubble(100, DVec3::splat(1e7), 3).degenerate(), 0);
    }
}

//! [`balls`]: the sphereflake.

use super::SKY;
use crate::numbers::turn;
use crate::scene::sized;
use crate::soup::{self, Soup};
use crate::{Light, Material, Scene, SceneError, SceneGeometry, Solid, View};
use rt_geom::glam::DVec3;
use rt_shapes::{Polygon, Sphere, TriangleMesh};

/// The sphereflake, `balls`: a ball that wears nine balls of a third its size, each of which wears nine, `size` times; on a
/// floor.
///
/// Primitive 0 is the floor, the `(9^(size + 1) - 1) / 8` spheres follow, each before those it wears: 7381 at the default
/// size of 4, at most 5 380 840 at size 7, of 64 bytes or less. The lowest dip into the floor, as intended. Its box is
/// `[-12, 12]^2 x [-0.5, 0.83057]`.
///
/// Source: Haines, *Standard Procedural Databases*, `balls`.
///
/// # Errors
///
/// Beyond size 7.
pub fn balls(size: u32) -> Result<Scene, SceneError> {
    let depth = sized("balls", size, 0, 7)?;
    let mut solids: Vec<Solid> = Vec::with_capacity((9usize.pow(depth + 1) - 1) / 8 + 1);
    let floor = [(12.0, 12.0), (-12.0, 12.0), (-12.0, -12.0), (12.0, -12.0)];
    solids.extend(Polygon::new(&floor.map(|(x, y)| DVec3::new(x, y, -0.5))).map(Solid::from));
    flake(&mut solids, &worn(), depth, DVec3::ZERO, 0.5, DVec3::Z);
    let material_of = (0..solids.len()).map(|i| u32::from(i > 0)).collect();
    let floor = Material { color: [1.0, 0.75, 0.33], kd: 0.8, ..Material::default() };
    let ball = Material { color: [1.0, 0.9, 0.7], kd: 0.5, ks: 0.5, shine: 3.0827, ..Material::default() };
    Ok(Scene {
        name: "balls".to_string(),
        geometry: SceneGeometry::Solids(solids),
        materials: vec![floor, ball],
        material_of,
        lights: Light::shared(&[[4.0, 3.0, 2.0], [1.0, -4.0, 4.0], [-3.0, 1.0, 5.0]]),
        view: View {
            from: DVec3::new(2.1, 1.3, 1.7),
            at: DVec3::ZERO,
            up: DVec3::Z,
            angle: std::f64::consts::FRAC_PI_4,
        },
        background: SKY,
        warnings: Vec::new(),
    })
}

/// The balls as icospheres of 80 triangles, without the floor: a trial for structures.
pub(crate) fn balls_of_triangles(depth: u32) -> TriangleMesh {
    let mut solids = Vec::new();
    flake(&mut solids, &worn(), depth, DVec3::ZERO, 0.5, DVec3::Z);
    let ball = soup::icosphere(1);
    let mut soup = Soup::new(80 * solids.len() as u32);
    for solid in solids {
        if let Solid::Sphere(s) = solid {
            (0..80).for_each(|i| soup.push(ball.triangle(i).corners.map(|p| s.center() + p * s.radius())));
        }
    }
    soup.mesh()
}

/// The directions in which a ball wears others when it is itself worn towards +z: three trios, each of one at the latitude
/// whose sine is `sqrt(2/3)` and two on the equator.
fn worn() -> [DVec3; 9] {
    let (up, out) = ((2.0f64 / 3.0).sqrt(), (1.0f64 / 3.0).sqrt());
    let mut worn = [DVec3::Z; 9];
    for trio in 0..3 {
        // In units of 15 degrees; a trio is a third of a turn from the last.
        for (k, azimuth, z, xy) in [(0, 3, up, out), (1, 1, 0.0, 1.0), (2, 5, 0.0, 1.0)] {
            let (sin, cos) = turn(azimuth + 8 * trio as u64, 24);
            worn[3 * trio + k] = DVec3::new(xy * cos, xy * sin, z);
        }
    }
    worn
}

fn flake(solids: &mut Vec<Solid>, worn: &[DVec3; 9], depth: u32, center: DVec3, radius: f64, outward: DVec3) {
    solids.extend(Sphere::new(center, radius).map(Solid::from));
    if depth == 0 {
        return;
    }
    for &w in worn {
        let w = from_z(outward, w);
        flake(solids, worn, depth - 1, center + w * (4.0 / 3.0 * radius), radius / 3.0, w);
    }
}

/// `v` under the least rotation that takes +z to the unit vector `d`.
fn from_z(d: DVec3, v: DVec3) -> DVec3 {
    if d.z >= 0.9999 {
        return v;
    }
    if d.z <= -0.9999 {
        return DVec3::new(-v.x, v.y, -v.z);
    }
    // Rodrigues' formula with the axis z x d, whose length is the sine.
    let axis = DVec3::Z.cross(d);
    let turned = v * d.z + axis.cross(v) + axis * (axis.dot(v) / (1.0 + d.z));
    turned.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_box() {
        for (size, spheres) in [(0, 1), (1, 10), (2, 91), (3, 820), (4, 7381), (5, 66430)] {
            let scene = balls(size).unwrap();
            assert_eq!(scene.prim_count(), spheres + 1, "size {size}");
            assert_eq!(scene.material_of.len(), spheres + 1);
        }
        let bound = balls(4).unwrap().world_bound();
        assert_eq!((bound.min.to_array(), bound.max.x, bound.max.y), ([-12.0, -12.0, -0.5], 12.0, 12.0));
        assert!((bound.max.z - 0.83057).abs() < 1e-5, "{}", bound.max.z);
        let error = balls(8).unwrap_err();
        assert_eq!(error.to_string(), "scene balls comes in sizes 0 to 7, not 8");
    }

    #[test]
    fn every_ball_touches_the_one_it_is_worn_by() {
        let SceneGeometry::Solids(solids) = balls(2).unwrap().geometry else { panic!() };
        let spheres: Vec<Sphere> =
            solids.iter().filter_map(|s| if let Solid::Sphere(s) = s { Some(*s) } else { None }).collect();
        for (i, child) in spheres.iter().enumerate().skip(1) {
            let parent = spheres[..i].iter().rfind(|p| p.radius() > 2.0 * child.radius()).unwrap();
            let apart = parent.center().distance(child.center());
            assert!((apart - parent.radius() - child.radius()).abs() < 1e-15);
        }
    }
}

//! [`tetra`]: a tetrahedral fractal.

use super::SKY;
use crate::numbers::mesh;
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError, SceneGeometry, View};
use rt_geom::glam::DVec3;

/// Alternate corners of a cube.
const CORNERS: [DVec3; 4] = [
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.0, -1.0, -1.0),
    DVec3::new(-1.0, 1.0, -1.0),
    DVec3::new(-1.0, -1.0, 1.0),
];

/// The faces of a tetrahedron with these corners, seen from outside turning left.
const FACES: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];

/// The tetrahedral fractal, `tetra`: `4^size` triangles, 4096 at the default size of 6, at most 16 777 216 at size 12.
///
/// Neighbouring tetrahedra touch in corners, which they share exactly: all coordinates are small multiples of a power of two.
/// They are in `[-1, 1]`.
///
/// Source: Haines, *Standard Procedural Databases*, `tetra`.
///
/// # Errors
///
/// For size 0 and beyond size 12.
pub fn tetra(size: u32) -> Result<Scene, SceneError> {
    let depth = sized("tetra", size, 1, 12)?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::with_capacity(4usize.pow(depth)));
    grow(&mut vertices, &mut triangles, depth, DVec3::ZERO, 1.0);
    Ok(Scene {
        name: "tetra".to_string(),
        geometry: SceneGeometry::Mesh(mesh(vertices, triangles)),
        materials: vec![Material { color: [1.0, 0.2, 0.2], ..Material::default() }],
        material_of: Vec::new(),
        lights: Light::shared(&[[2.0, -18.0, -5.0]]),
        view: View {
            from: DVec3::new(1.022846, -3.177154, -2.174512),
            at: DVec3::new(-0.004103, -0.004103, 0.216539),
            up: DVec3::new(-0.816497, -0.816497, 0.816497),
            angle: std::f64::consts::FRAC_PI_4,
        },
        background: SKY,
        warnings: Vec::new(),
    })
}

fn grow(vertices: &mut Vec<[f32; 3]>, triangles: &mut Vec<[u32; 3]>, depth: u32, center: DVec3, half: f64) {
    if depth <= 1 {
        let first = vertices.len() as u32;
        vertices.extend(CORNERS.map(|corner| (center + corner * half).as_vec3().to_array()));
        triangles.extend(FACES.map(|face| face.map(|i| first + i)));
        return;
    }
    for corner in CORNERS {
        grow(vertices, triangles, depth - 1, center + corner * (half * 0.5), half * 0.5);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_box() {
        for (size, triangles) in [(1, 4), (2, 16), (6, 4096), (8, 65536)] {
            assert_eq!(tetra(size).unwrap().prim_count(), triangles, "size {size}");
        }
        let bound = tetra(6).unwrap().world_bound();
        assert_eq!((bound.min.to_array(), bound.max.to_array()), ([-1.0; 3], [1.0; 3]));
        assert!(tetra(0).is_err() && tetra(13).is_err());
    }

    #[test]
    fn faces_look_outward() {
        let SceneGeometry::Mesh(mesh) = tetra(1).unwrap().geometry else { panic!() };
        for prim in 0..4 {
            let [a, b, c] = mesh.triangle(prim).corners;
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }
}

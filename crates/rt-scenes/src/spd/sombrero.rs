//! [`sombrero`]: a hat of triangles.

use super::{SKY, view};
use crate::numbers::{exp, mesh, turns};
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError, SceneGeometry};

/// The surface `cos(2 pi r) e^-r` over a square, `sombrero`, of `2 (n - 1)^2` triangles, `n = 32 * 2^(size - 1)`: 1922 at the default
/// size of 1, at most 8 380 418 at size 7. Height is along y.
///
/// Source: Haines, *Standard Procedural Databases*, `sombrero`, after Enzmann.
///
/// # Errors
///
/// For size 0 and beyond size 7.
pub fn sombrero(size: u32) -> Result<Scene, SceneError> {
    let n = 16u32 << sized("sombrero", size, 1, 7)?;
    let sample = |i: u32| -4.0 + 8.0 * f64::from(i) / f64::from(n);
    // The samples end a step before the edge, and are drawn to it.
    let place = |i: u32| -4.0 + 8.0 * f64::from(i) / f64::from(n - 1);
    let mut vertices = Vec::with_capacity((n * n) as usize);
    for i in 0..n {
        for j in 0..n {
            let (x, y) = (sample(j), sample(i));
            let r = (x * x + y * y).sqrt();
            vertices.push([place(j) as f32, (-3.0 + turns(r).1 * exp(-r)) as f32, place(i) as f32]);
        }
    }
    let mut triangles = Vec::with_capacity((2 * (n - 1) * (n - 1)) as usize);
    for i in 0..n - 1 {
        for j in 0..n - 1 {
            let v = |i: u32, j: u32| i * n + j;
            triangles
                .extend([[v(i, j), v(i + 1, j + 1), v(i, j + 1)], [v(i, j), v(i + 1, j), v(i + 1, j + 1)]]);
        }
    }
    Ok(Scene {
        name: "sombrero".to_string(),
        geometry: SceneGeometry::Mesh(mesh(vertices, triangles)),
        materials: vec![Material { color: [1.0, 0.1, 0.1], ..Material::default() }],
        material_of: Vec::new(),
        lights: Light::shared(&[[10.0, 10.0, -10.0]]),
        view: view([0.0, 5.0, -8.0], [0.0; 3], [0.0, 0.0, 1.0], 40.0),
        background: SKY,
        warnings: Vec::new(),
    })
}

//! [`rings`]: dodecahedral rings in a pyramid.

use super::{Pile, SKY, view};
use crate::numbers::turn;
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::DVec3;

/// Half the thickness of a ring.
const THIN: f64 = 0.07412;

/// A pyramid of interlocked rings before a wall, `rings`: `size (size + 1) (2 size + 1) / 6` objects of six pentagonal rings, each
/// of five cylinders and five spheres.
///
/// Primitive 0 is the wall. Each object follows, ring by ring, a cylinder and then the sphere at its end: 4200 of each at the
/// default size of 7, at most 664 200 of each at size 40. Its box is `[-10.8389, 8.83895] x [1.65358, 20.905] x
/// [-9.33895, 10.3389]` at size 7.
///
/// Source: Haines, *Standard Procedural Databases*, `rings`.
///
/// # Errors
///
/// For size 0 and beyond size 40.
pub fn rings(size: u32) -> Result<Scene, SceneError> {
    let size = sized("rings", size, 1, 40)?;
    let n = size as usize;
    let mut pile = Pile::new(10 * n * (n + 1) * (2 * n + 1) + 1);
    // 1 / sin(pi / 8), and tan(pi / 8).
    let apart = (4.0 + 8f64.sqrt()).sqrt();
    let tan = std::f64::consts::SQRT_2 - 1.0;
    let from = DVec3::new(-1.0, -apart, 0.5);
    let far = apart * f64::from(size + 1);
    let half = 1.01 * (far + apart) * tan;
    let wall = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
    pile.polygon(&wall.map(|(x, z)| DVec3::new(from.x + half * x, far, from.z + half * z)), 0);
    let object = pentagons();
    for depth in 0..size {
        for x in 0..=depth {
            for z in 0..=depth {
                let place = |i: u32| 2.0 * f64::from(i) - f64::from(depth);
                let middle = DVec3::new(place(x), apart * f64::from(depth + 1), place(z));
                for (ring, points) in (1..).zip(&object) {
                    for i in 0..5 {
                        let (point, last) = (middle + points[i], middle + points[(i + 4) % 5]);
                        pile.frustum([last, point], [THIN; 2], ring);
                        pile.sphere(point, THIN, ring);
                    }
                }
            }
        }
    }
    let colors = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
    ];
    let mut materials = vec![Material { color: [1.0; 3], ..Material::default() }];
    materials.extend(colors.map(|color| Material {
        color,
        kd: 0.5,
        ks: 0.2,
        shine: 4.8188,
        ..Material::default()
    }));
    Ok(Scene {
        lights: Light::shared(&[[3.0, -apart, 3.0], [-4.0, -apart, 1.0], [2.0, -apart, -4.0]]),
        view: view(from.to_array(), (from + DVec3::Y).to_array(), [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("rings", materials)
    })
}

/// The six rings of an object: one flat, five that stand around it at the angle of two faces of a dodecahedron seen from its middle.
fn pentagons() -> [[DVec3; 5]; 6] {
    let flat: [DVec3; 5] = core::array::from_fn(|i| {
        let (sin, cos) = turn(i as u64, 5);
        DVec3::new(cos, sin, 0.0) / (1.0 + THIN)
    });
    // The cosine and sine of 63.4349 degrees.
    let (cos, sin) = (0.2f64.sqrt(), 0.8f64.sqrt());
    core::array::from_fn(|k| {
        if k == 0 {
            return flat;
        }
        let (s, c) = turn(2 * k as u64 - 1, 10);
        flat.map(|p| {
            let tilted = DVec3::new(p.x, p.y * cos - p.z * sin, p.y * sin + p.z * cos);
            DVec3::new(tilted.x * c - tilted.y * s, tilted.x * s + tilted.y * c, tilted.z)
        })
    })
}

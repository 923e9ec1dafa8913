//! [`shells`]: a sea shell of overlapping spheres.

use super::{Pile, SKY, view};
use crate::numbers::{exp, turns};
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::DVec3;
use std::f64::consts::TAU;

/// A logarithmic spiral of spheres that overlap heavily, `shells`: `180 * 2^size + 1` of them, 5761 at the default size of 5, at
/// most 737 281 at size 12.
///
/// What defeats structures that tell things apart by place: most rays enter many spheres' boxes.
///
/// Source: Haines, *Standard Procedural Databases*, `shells`; Pickover, "A short recipe for seashell synthesis", *IEEE Computer
/// Graphics and Applications* 9(6), 1989.
///
/// # Errors
///
/// Beyond size 12.
pub fn shells(size: u32) -> Result<Scene, SceneError> {
    let steps = 180i64 << sized("shells", size, 0, 12)?;
    let mut pile = Pile::new(steps as usize + 1);
    for i in -2 * steps / 3..=steps / 3 {
        // Nine turns in all.
        let wound = 9.0 * i as f64 / steps as f64;
        let (sin, cos) = turns(wound);
        let radius = exp(0.15 * (wound * TAU));
        pile.sphere(DVec3::new(radius * sin, radius * cos, -2.0 * radius), radius, 0);
    }
    let shell = Material { color: [1.0, 0.8, 0.6], kd: 0.7, ks: 0.3, shine: 4.8188, ..Material::default() };
    Ok(Scene {
        lights: Light::shared(&[[-100.0, -100.0, 100.0]]),
        view: view([-6.0, -60.0, 35.0], [0.0, 8.0, -15.0], [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("shells", vec![shell])
    })
}

//! [`lattice`]: balls and sticks on a cubic grid.

use super::{Pile, SKY, view};
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::DVec3;

/// A cubic grid of `(size + 1)^3` balls with sticks between neighbours, `lattice`, seen from within.
///
/// Each ball is followed by its sticks towards +x, +y and +z, as far as there are neighbours: 2197 balls and 6084 sticks at the
/// default size of 12, at most 531 441 and 1 574 640 at size 80. Its box is the unit cube and the radius of a ball, `1 / (4 size)`.
///
/// Source: Haines, *Standard Procedural Databases*, `lattice`, after Costa.
///
/// # Errors
///
/// For size 0 and beyond size 80.
pub fn lattice(size: u32) -> Result<Scene, SceneError> {
    let n = sized("lattice", size, 1, 80)?;
    let cell = 1.0 / f64::from(n);
    let radius = cell * 0.25;
    // A stick's end is a little inside its ball.
    let hidden = 0.99 * radius * 0.5;
    let mut pile = Pile::new(((n + 1).pow(3) + 3 * n * (n + 1).pow(2)) as usize);
    for x in 0..=n {
        for y in 0..=n {
            for z in 0..=n {
                let place = |i: u32| f64::from(i) / f64::from(n);
                let at = DVec3::new(place(x), place(y), place(z));
                pile.sphere(at, radius, 0);
                for (i, axis, material) in [(x, DVec3::X, 1), (y, DVec3::Y, 2), (z, DVec3::Z, 3)] {
                    if i < n {
                        pile.frustum(
                            [at + axis * hidden, at + axis * (cell - hidden)],
                            [cell / 16.0; 2],
                            material,
                        );
                    }
                }
            }
        }
    }
    let ball = Material { color: [0.9; 3], kd: 0.5, ks: 0.5, shine: 3.0827, ..Material::default() };
    let stick = |color| Material { color, ..Material::default() };
    let middle = [0.5; 3];
    let lights = [0, 1, 2, 3, 4, 5].map(|face| {
        let mut light = middle;
        light[face / 2] += if face % 2 == 0 { 1.5 } else { -1.5 };
        light
    });
    let (beside, below) = ((f64::from(n / 2) + 0.5) * cell, 0.5 * cell);
    Ok(Scene {
        lights: Light::shared(&lights),
        view: view([beside, 1.0, 1.0 - below], [beside, -1.0, -1.0 - below], [0.2, 1.0, 0.0], 60.0),
        background: SKY,
        ..pile.scene(
            "lattice",
            vec![ball, stick([1.0, 0.0, 0.0]), stick([0.0, 1.0, 0.0]), stick([0.0, 0.0, 1.0])],
        )
    })
}

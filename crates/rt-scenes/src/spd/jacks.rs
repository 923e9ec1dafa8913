//! [`jacks`]: jacks of jacks.

use super::{Pile, view};
use crate::numbers::turn;
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::{DMat3, DVec3};

/// A jack, three rods with balls at their ends, with eight of half its size between its arms, each of which has eight, `jacks`:
/// `9 (8^size - 1) / 7` primitives, 657 at the default size of 3, at most 2 696 337 at size 7.
///
/// Each jack is its rods along x, y and z, then its balls, then the smaller jacks.
///
/// Source: Haines, *Standard Procedural Databases*, `jacks`, after Enzmann.
///
/// # Errors
///
/// For size 0 and beyond size 7.
pub fn jacks(size: u32) -> Result<Scene, SceneError> {
    let depth = sized("jacks", size, 1, 7)?;
    let mut pile = Pile::new(9 * (8usize.pow(depth) - 1) / 7);
    // 20 degrees back about y, then 30 about x.
    let ((ys, yc), (xs, xc)) = (turn(340, 360), turn(330, 360));
    let about_y = DMat3::from_cols(DVec3::new(yc, 0.0, -ys), DVec3::Y, DVec3::new(ys, 0.0, yc));
    let about_x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, xc, xs), DVec3::new(0.0, -xs, xc));
    jack(&mut pile, about_x * about_y, DVec3::ZERO, 1.0, depth);
    let rod = Material { color: [0.9, 0.5, 0.2], kd: 0.6, ks: 0.4, shine: 4.8188, ..Material::default() };
    let ball = Material { color: [0.9, 0.9, 0.3], ..rod };
    Ok(Scene {
        lights: Light::shared(&[[-10.0, 3.0, -20.0]]),
        view: view([0.0, 0.0, -8.0], [0.0; 3], [0.0, 1.0, 0.0], 25.0),
        background: [0.2, 0.05, 0.2],
        ..pile.scene("jacks", vec![rod, ball])
    })
}

fn jack(pile: &mut Pile, turned: DMat3, middle: DVec3, size: f64, depth: u32) {
    let axes = [turned.x_axis, turned.y_axis, turned.z_axis].map(|axis| axis * (0.75 * size));
    for arm in axes {
        pile.frustum([middle - arm, middle + arm], [0.075 * size; 2], 0);
    }
    for arm in axes {
        pile.sphere(middle - arm, 0.15 * size, 1);
        pile.sphere(middle + arm, 0.15 * size, 1);
    }
    if depth > 1 {
        for corner in 0..8 {
            let side = |bit: u32| if corner >> bit & 1 == 1 { 0.5 * size } else { -0.5 * size };
            let between = middle + turned * DVec3::new(side(0), side(1), side(2));
            jack(pile, turned, between, 0.5 * size, depth - 1);
        }
    }
}

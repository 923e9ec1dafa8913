//! [`julia`]: sets that no equation solves.

use super::{Pile, glazed, lamps, matt, place, view};
use crate::scene::sized;
use crate::{Material, Scene, SceneError};
use rt_geom::glam::{DVec3, DVec4};
use rt_shapes::{Julia, JuliaParams};

/// Constants of sets worth a look.
const SETS: [[f64; 4]; 6] = [
    [-0.2, 0.6, 0.2, 0.2],
    [-0.291, -0.399, 0.339, 0.437],
    [-0.125, -0.256, 0.847, 0.0895],
    [-0.213, -0.041, -0.563, -0.56],
    [-0.45, -0.447, 0.181, 0.306],
    [-0.137, -0.63, -0.475, -0.046],
];

/// `size` quaternion Julia sets over a dim mirror, to a thousandth of their size; from 1 to 6, of which 3 are the default.
///
/// # Errors
///
/// For size 0 and beyond size 6.
pub fn julia(size: u32) -> Result<Scene, SceneError> {
    let n = sized("julia", size, 1, 6)?;
    let mut pile = Pile::new(n as usize + 1);
    pile.polygon(
        &[[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| DVec3::new(x, y, 0.0)),
        0,
    );
    let places = [
        [0.0, -0.6, 1.15],
        [-1.75, 1.3, 1.1],
        [1.75, 1.3, 1.1],
        [0.0, 3.4, 1.2],
        [-3.4, 3.6, 1.2],
        [3.4, 3.6, 1.2],
    ];
    for (k, (set, to)) in (1..).zip(SETS.into_iter().zip(places)).take(n as usize) {
        let params = JuliaParams { c: DVec4::from_array(set), tolerance: 1e-3, ..JuliaParams::default() };
        let set = Julia::new(params).expect("a generator's set");
        pile.placed("a Julia set", set, place(0.1, 0.2, 1.0, DVec3::from_array(to)), k);
    }
    let floor = Material { kd: 0.5, ks: 0.3, ..matt([0.35, 0.37, 0.42]) };
    let set = |color| Material { kd: 0.85, ks: 0.08, shine: 40.0, ..glazed(color) };
    let materials = vec![
        floor,
        set([0.85, 0.55, 0.25]),
        set([0.35, 0.65, 0.55]),
        set([0.55, 0.45, 0.8]),
        set([0.8, 0.35, 0.35]),
        set([0.75, 0.75, 0.4]),
        set([0.4, 0.55, 0.85]),
    ];
    let lights = lamps([-5.0, -8.0, 10.0], [7.0, -4.0, 6.0]);
    Ok(pile.exhibition("julia", materials, lights, view([0.0, -6.6, 3.6], [0.0, 0.3, 0.85], 40.0)))
}

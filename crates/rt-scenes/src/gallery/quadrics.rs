//! [`quadrics`]: surfaces of revolution, cut open.

use super::{Pile, glazed, lamps, matt, place, view};
use crate::scene::sized;
use crate::{Material, Scene, SceneError};
use rt_geom::glam::DVec3;
use rt_shapes::{Disk, Quadric, QuadricError};
use std::f64::consts::TAU;

/// Nine quadrics on a board, cut at heights and swept through `size` twelfths of a turn, which shows them from inside: a full turn at
/// 12; 9 is the default. In the back row a sphere without its cap, a cylinder and a cone; in the middle a paraboloid, a hyperboloid and
/// a ring of a disk; in front a bowl, an hourglass (a hyperboloid through the axis: a double cone) and a disk that leans.
///
/// # Errors
///
/// For size 0 and beyond size 12.
pub fn quadrics(size: u32) -> Result<Scene, SceneError> {
    let sweep = f64::from(sized("quadrics", size, 1, 12)?) / 12.0 * TAU;
    let mut pile = Pile::new(9 + 144);
    pile.board(6, 1.0, 0.0, [0, 1]);
    exhibits(&mut pile, sweep).expect("a generator's quadrics");
    let board =
        |grey: f32| Material { kd: 0.6, ks: 0.2, shine: 100_000.0, ..glazed([grey, grey, grey * 0.95]) };
    let colors = [
        [0.9, 0.25, 0.2],
        [0.95, 0.6, 0.15],
        [0.9, 0.85, 0.3],
        [0.3, 0.7, 0.3],
        [0.25, 0.65, 0.75],
        [0.3, 0.4, 0.85],
        [0.6, 0.35, 0.75],
        [0.85, 0.45, 0.6],
    ];
    let metal = Material { kd: 0.25, ks: 0.6, shine: 200.0, ..matt([0.9, 0.85, 0.75]) };
    let materials = [board(0.85), board(0.35)].into_iter().chain(colors.map(glazed)).chain([metal]).collect();
    let lights = lamps([-6.0, -9.0, 12.0], [9.0, -6.0, 9.0]);
    Ok(pile.exhibition("quadrics", materials, lights, view([0.0, -9.2, 8.2], [0.0, 0.05, 0.55], 38.0)))
}

fn exhibits(pile: &mut Pile, sweep: f64) -> Result<(), QuadricError> {
    let swept = |quadric: Quadric| quadric.swept(0.0, sweep);
    let point = DVec3::new;
    let all = [
        (swept(Quadric::sphere(1.0)?.cut(-0.85, 0.7)?)?, [-2.7, 2.4, 0.85]),
        (swept(Quadric::cylinder(0.8, 0.0, 1.9)?)?, [0.0, 2.4, 0.0]),
        (swept(Quadric::cone(2.0, 1.0)?)?, [2.7, 2.4, 0.0]),
        (swept(Quadric::paraboloid(1.0, 0.1, 1.6)?)?, [-2.7, 0.0, -0.1]),
        (swept(Quadric::hyperboloid(point(1.0, -0.35, 0.0), point(0.35, 0.75, 1.9))?)?, [0.0, 0.0, 0.0]),
        (swept(Quadric::sphere(0.9)?.cut(-0.8, 0.0)?)?, [-2.4, -2.3, 0.8]),
        (swept(Quadric::hyperboloid(point(0.7, 0.0, 0.0), point(-0.7, 0.0, 1.6))?)?, [0.0, -2.3, 0.0]),
    ];
    let mut material = 2;
    for (quadric, to) in all {
        // The opening towards the eye.
        let turned = 0.75 - sweep / TAU + 0.5 * (1.0 - sweep / TAU);
        let to = place(turned + sweep / TAU, 0.0, 1.0, DVec3::from_array(to));
        pile.placed("a quadric", quadric, to, material);
        material += 1;
    }
    let ring = Disk::ring(0.0, 0.45, 1.0)?.swept(0.0, sweep)?;
    pile.placed("a disk", ring, place(0.75, 0.2, 1.0, DVec3::new(2.7, 0.0, 1.0)), material);
    let mirror = Disk::new(0.0, 0.9)?.swept(0.0, sweep)?;
    pile.placed("a disk", mirror, place(0.25, 0.215, 1.0, DVec3::new(2.4, -2.2, 0.85)), material + 1);
    Ok(())
}

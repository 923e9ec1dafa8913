//! Sets of points, seeded: what volumes are fitted to.

use rt_geom::glam::{DQuat, DVec3, Vec3A};
use rt_measure::rays::Seeded;

/// A rotation, uniform.
pub(crate) fn turn(seeded: &mut Seeded) -> DQuat {
    let axis = seeded.direction();
    DQuat::from_axis_angle(axis, seeded.between(-3.2, 3.2))
        * DQuat::from_rotation_arc(DVec3::X, seeded.direction())
}

/// The corners of a box from zero, turned.
pub(crate) fn turned_box(seeded: &mut Seeded, size: DVec3) -> Vec<DVec3> {
    let turn = turn(seeded);
    (0..8).map(|i| turn * (DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * size)).collect()
}

/// Random points of one of several shapes about zero, of size about 1.
pub(crate) fn shape(seeded: &mut Seeded, kind: usize, n: usize) -> Vec<DVec3> {
    let line = seeded.direction();
    let squash = DVec3::new(1.0, seeded.between(0.0, 1.0), seeded.between(0.0, 0.3));
    let turn = turn(seeded);
    let mut one = |_| match kind {
        0 => seeded.inside(-DVec3::ONE, DVec3::ONE),
        1 => seeded.direction(),
        2 => turn * (seeded.direction() * squash),
        3 => turn * (seeded.inside(-DVec3::ONE, DVec3::ONE) * squash.with_z(0.0)),
        4 => line * seeded.between(-1.0, 1.0),
        5 => DVec3::new(seeded.below(3) as f64, seeded.below(3) as f64, seeded.below(3) as f64),
        6 => seeded.direction() * seeded.unit().powi(8),
        _ => line,
    };
    (0..n).map(&mut one).collect()
}

/// How many kinds [`shape`] knows.
pub(crate) const KINDS: usize = 8;

/// Sizes and offsets: about 1, far away, huge, tiny, subnormal.
pub(crate) const PLACES: [(f64, f64); 7] =
    [(1.0, 0.0), (1.0, 3.0), (1.0, 1e7), (1e30, 0.0), (1e-30, 0.0), (1e-40, 0.0), (1e-3, 1e4)];

pub(crate) fn narrow(points: &[DVec3]) -> Vec<Vec3A> {
    points.iter().map(|p| p.as_vec3a()).collect()
}

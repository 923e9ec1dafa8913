//! The grid answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_geom::Real;
use rt_geom::glam::DVec3;
use rt_grid::{Grid, GridParams, Mailing, Nest, Overlap, Resolution, Skip};
use rt_measure::conform;
use rt_measure::rays::troublesome;
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default; a plain one; grids in grids, and all the way down.
fn params() -> [GridParams; 4] {
    let plain = GridParams {
        resolution: Resolution::Fixed([7, 2, 64]),
        overlap: Overlap::Box,
        mailing: Mailing::Hashed,
        skip: Skip::None,
        ..GridParams::default()
    };
    let deep = GridParams {
        resolution: Resolution::Fixed([3, 1, 2]),
        inner: Resolution::Fixed([2, 3, 2]),
        nest: Nest::Above(4),
        depth: 3,
        mailing: Mailing::Inverse,
        ..GridParams::default()
    };
    [GridParams::default(), plain, GridParams::nested(), deep]
}

/// Where hundreds of primitives coincide a grid tests them again and again, with exact arithmetic.
const SLOW: [&str; 3] =
    ["300 times one triangle", "150 pairs, back to back", "boxes nested from 2^-60 to 2^60"];

/// Every trial with the default, or with one of the others in turn; all of them in the long run.
fn check<V: Real + Into<R>, R: Real>(trials: &[Trial<V>], turn: usize) {
    for (i, trial) in trials.iter().enumerate() {
        let mut rays = troublesome::<R>(&trial.mesh, &trial.points());
        let mut chosen = vec![params()[i.wrapping_add(turn) % 4]];
        if turn == ALL {
            chosen = params().to_vec();
        } else if SLOW.contains(&trial.name.as_str()) {
            rays.truncate(8);
            chosen = vec![GridParams { resolution: Resolution::Fixed([2, 2, 2]), ..GridParams::default() }];
        }
        conform::conform_all::<Grid, R, _>(&trial.name, &trial.mesh, &chosen, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

const ALL: usize = usize::MAX;

#[test]
#[ignore = "three minutes"]
fn on_every_trial_with_all_parameters() {
    check::<f32, f32>(&rt_scenes::trials(), ALL);
    check::<f32, f64>(&rt_scenes::trials(), ALL);
}

#[test]
fn on_every_trial_in_f32() {
    check::<f32, f32>(&rt_scenes::trials(), 0);
}

#[test]
fn on_every_trial_in_f64() {
    check::<f32, f64>(&rt_scenes::trials(), 2);
    check::<f64, f64>(&rt_scenes::fine_trials(), ALL);
}

#[test]
fn on_spheres_and_polygons() {
    let scene = rt_scenes::by_name("balls", Some(2)).unwrap();
    let SceneGeometry::Solids(solids) = scene.geometry else { panic!("balls are solids") };
    let points: Vec<DVec3> = solids
        .iter()
        .filter_map(|solid| match solid {
            Solid::Sphere(ball) => Some(ball.center() + DVec3::X * ball.radius()),
            _ => None,
        })
        .collect();
    for params in params() {
        let rays = troublesome::<f32>(&solids, &points);
        conform::conform::<Grid, f32, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
        let rays = troublesome::<f64>(&solids, &points);
        conform::conform::<Grid, f64, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

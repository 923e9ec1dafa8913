//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Mailing, Sah};
use rt_bsp::{Bsp, BspParams};
use rt_geom::Real;
use rt_geom::glam::DVec3;
use rt_measure::conform;
use rt_measure::rays::troublesome;
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default, and trees as deep as the parameters can make them.
fn params() -> [BspParams; 2] {
    let deep = BspParams {
        sah: Sah { traverse: 0.0, intersect: 1.0 },
        bad_splits: 2,
        empty_bonus: 0.9,
        max_depth: Some(10),
        mailing: Mailing::Hashed,
        ..BspParams::default()
    };
    [BspParams::default(), deep]
}

fn check<V: Real + Into<R>, R: Real>(trial: &Trial<V>) {
    let rays = troublesome::<R>(&trial.mesh, &trial.points());
    conform::conform_all::<Bsp, R, _>(&trial.name, &trial.mesh, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

#[test]
fn on_every_trial_in_f32() {
    for trial in rt_scenes::trials() {
        check::<f32, f32>(&trial);
    }
}

#[test]
fn on_every_trial_in_f64() {
    for trial in rt_scenes::trials() {
        check::<f32, f64>(&trial);
    }
    for trial in rt_scenes::fine_trials() {
        check::<f64, f64>(&trial);
    }
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
        conform::conform::<Bsp, f32, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
        let rays = troublesome::<f64>(&solids, &points);
        conform::conform::<Bsp, f64, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

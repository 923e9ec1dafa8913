//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Clip, Mailing, Sah};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};
use rt_kdtree::{KdTree, KdTreeParams};
use rt_measure::conform;
use rt_measure::rays::troublesome;
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default, and trees as deep as the parameters can make them.
fn params() -> [KdTreeParams; 2] {
    let deep = KdTreeParams {
        sah: Sah { traverse: 0.0, intersect: 1.0 },
        bad_splits: 2,
        empty_bonus: 0.9,
        max_depth: Some(10),
        clip: Clip::Box,
        mailing: Mailing::Hashed,
        ..KdTreeParams::default()
    };
    [KdTreeParams::default(), deep]
}

/// With one of so many troublesome rays.
fn check<V: Real + Into<R>, R: Real>(trial: &Trial<V>, of: usize) {
    let rays = troublesome::<R>(&trial.mesh, &trial.points());
    let rays: Vec<Ray<R>> = rays.into_iter().step_by(of).collect();
    conform::conform_all::<KdTree, R, _>(&trial.name, &trial.mesh, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

#[test]
fn on_every_trial_in_f32() {
    for trial in rt_scenes::trials() {
        check::<f32, f32>(&trial, 1);
    }
}

#[test]
fn on_every_trial_in_f64() {
    for trial in rt_scenes::trials() {
        check::<f32, f64>(&trial, 3);
    }
    for trial in rt_scenes::fine_trials() {
        check::<f64, f64>(&trial, 1);
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
        conform::conform::<KdTree, f32, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
        let rays = troublesome::<f64>(&solids, &points);
        conform::conform::<KdTree, f64, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

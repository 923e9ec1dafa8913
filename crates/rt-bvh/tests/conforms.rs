//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::Instance;
use rt_bvh::{Builder, Bvh, BvhParams};
use rt_geom::glam::DVec3;
use rt_geom::{Real, Transform};
use rt_measure::conform;
use rt_measure::rays::troublesome;
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default, and trees as bad as the parameters can make them.
fn params() -> [BvhParams; 2] {
    let deep = BvhParams {
        builder: Builder::Binned { bins: 2 },
        leaf_prims: 1,
        sweep_below: 0,
        ..BvhParams::default()
    };
    [BvhParams::default(), deep]
}

fn check<V: Real + Into<R>, R: Real>(trial: &Trial<V>) {
    let rays = troublesome::<R>(&trial.mesh, &trial.points());
    conform::conform_all::<Bvh, R, _>(&trial.name, &trial.mesh, &params(), &rays)
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
        conform::conform::<Bvh, f32, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
        let rays = troublesome::<f64>(&solids, &points);
        conform::conform::<Bvh, f64, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

#[test]
fn on_instances_of_instances() {
    use rt_accel::Aggregate;
    use std::sync::Arc;
    let torus = Arc::new(
        Aggregate::<Bvh, _>::build(rt_scenes::soup::torus(24, 12, 0.3), &BvhParams::default()).unwrap(),
    );
    let at = |x: f64, turn: f64, stretch: f64| {
        Transform::rotation(DVec3::new(1.0, 2.0, 0.5), turn)
            .and_then(|t| t.then(&Transform::scale(DVec3::new(stretch, 1.0, -0.5))?))
            .and_then(|t| t.then(&Transform::translation(DVec3::new(x, -x, 0.25 * x))))
            .unwrap()
    };
    let row: Vec<_> =
        (0..9).map(|i| Instance::new(torus.clone(), at(2.0 * i as f64, i as f64, 1.0 + i as f64))).collect();
    let row = Arc::new(Aggregate::<Bvh, _>::build(row, &BvhParams::default()).unwrap());
    let field: Vec<_> =
        (0..5).map(|i| Instance::new(row.clone(), at(i as f64, -0.3 * i as f64, 2.0))).collect();
    for params in params() {
        let rays = troublesome::<f32>(&field, &[DVec3::ZERO, DVec3::ONE]);
        conform::conform::<Bvh, f32, _>("field of rows", &field, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
        let rays = troublesome::<f64>(&field, &[DVec3::ZERO, DVec3::ONE]);
        conform::conform::<Bvh, f64, _>("field of rows", &field, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

#[test]
fn after_a_refit() {
    let before = rt_scenes::soup::uniform(500, 3);
    let mut after = before.clone();
    for [x, y, z] in after.vertices_mut() {
        (*x, *y, *z) = (*y - 0.5 * *z, 2.0 * *x, *z + 3.0);
    }
    let points = Trial { name: String::new(), mesh: after.clone() }.points();
    let rays = troublesome::<f32>(&after, &points);
    conform::conform_refit::<Bvh, f32, _>("soup of 500", &before, &after, &BvhParams::default(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

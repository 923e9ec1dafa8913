//! The grid answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Aggregate, Clip, Exhaustive, Mailing, Primitive, Structure};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};
use rt_grid::{Grid, GridParams, Nest, Resolution, Skip};
use rt_measure::conform;
use rt_measure::rays::troublesome;
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default; a plain one; grids in grids, and all the way down; grids as objects of grids.
fn params() -> [GridParams; 5] {
    let plain = GridParams {
        resolution: Resolution::Fixed([7, 2, 64]),
        clip: Clip::Box,
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
    let heaps = GridParams {
        nest: Nest::Sizes { classes: 4, grown: 0.1, least: 2 },
        mailing: Mailing::None,
        inner: Resolution::Density(1.0),
        ..deep
    };
    [GridParams::default(), plain, GridParams::nested(), deep, heaps]
}

/// Where hundreds of primitives coincide a grid tests them again and again, by exact arithmetic: few rays will do.
const SLOW: [&str; 8] = [
    "300 times one triangle",
    "150 pairs, back to back",
    "300 equal centroids",
    "coordinates 2^i, i from -126 to 126",
    "coordinates 3^-i about a corner",
    "boxes nested from 2^-60 to 2^60",
    "huge triangle over a small soup",
    "one point, 300 times",
];

/// Every trial with one set of parameters in turn, or with all.
fn check<V: Real + Into<R>, R: Real>(trials: &[Trial<V>], turn: usize) {
    for (i, trial) in trials.iter().enumerate() {
        let slow = turn != ALL && SLOW.contains(&trial.name.as_str());
        let points = trial.points();
        let rays = troublesome::<R>(&trial.mesh, if slow { &points[..4] } else { &points });
        let chosen = match turn {
            ALL => params().to_vec(),
            _ => vec![params()[(i + turn) % 5]],
        };
        if slow {
            few::<V, R>(trial, &rays[..rays.len().min(16)], &chosen[0]);
            continue;
        }
        conform::conform_all::<Grid, R, _>(&trial.name, &trial.mesh, &chosen, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

/// Closest hits of some rays.
fn few<V: Real + Into<R>, R: Real>(trial: &Trial<V>, rays: &[Ray<R>], params: &GridParams) {
    let grid = Aggregate::<Grid, _>::build(&trial.mesh, params).unwrap();
    let all = Aggregate::<Exhaustive, _>::build(&trial.mesh, &()).unwrap();
    grid.structure().validate(&trial.mesh).unwrap_or_else(|why| panic!("{}: {why}", trial.name));
    for ray in rays {
        assert_eq!(grid.intersect(ray), all.intersect(ray), "{}: {}", trial.name, conform::paste(ray));
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

//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Instance, WorldBound};
use rt_bvh::{Builder, Bvh, BvhParams};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use rt_measure::conform;
use rt_measure::rays::{self, troublesome};
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
fn on_solids_of_every_kind() {
    let plain = [("balls", 2), ("rings", 1), ("tree", 4), ("mount", 2), ("teapot", 1)];
    let placed = [("patches", 1), ("quadrics", 9), ("loop", 0), ("mountains", 4)];
    for (name, size) in plain.into_iter().chain(placed) {
        let scene = rt_scenes::by_name(name, Some(size)).unwrap();
        let SceneGeometry::Solids(solids) = scene.geometry else { panic!("{name} are solids") };
        let points: Vec<DVec3> = solids
            .iter()
            .filter_map(|solid| match solid {
                Solid::Sphere(ball) => Some(ball.center() + DVec3::X * ball.radius()),
                Solid::Frustum(frustum) => Some(frustum.ends()[0]),
                Solid::Facet(facet) => Some(facet.corners()[0]),
                Solid::Placed(placed) => Some(placed.shape().world_bound().max.as_dvec3()),
                _ => None,
            })
            .collect();
        for params in params() {
            let rays = troublesome::<f32>(&solids, &points);
            conform::conform::<Bvh, f32, _>(name, &solids, &params, &rays)
                .unwrap_or_else(|why| panic!("{why}"));
            let rays = troublesome::<f64>(&solids, &points);
            conform::conform::<Bvh, f64, _>(name, &solids, &params, &rays)
                .unwrap_or_else(|why| panic!("{why}"));
        }
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
fn on_turned_instances_seen_from_very_far() {
    use rt_accel::{Aggregate, Exhaustive, Primitive};
    use std::sync::Arc;
    let torus = rt_scenes::soup::torus(6, 5, 0.3);
    let corners = Trial { name: String::new(), mesh: torus.clone() }.points();
    let torus = Arc::new(Aggregate::<Bvh, _>::build(torus, &BvhParams::default()).unwrap());
    let maps: Vec<Transform> = (0..3)
        .map(|i| {
            let turn = if i == 0 { std::f64::consts::FRAC_PI_2 } else { 0.7 * i as f64 };
            Transform::rotation(DVec3::new(1.0, 0.3 * i as f64, 0.0), turn)
                .and_then(|t| {
                    t.then(&Transform::translation(DVec3::new(30.0 * i as f64, 20.0 * i as f64, 9.1)))
                })
                .unwrap()
        })
        .collect();
    let field: Vec<_> = maps.iter().map(|map| Instance::new(torus.clone(), *map)).collect();
    let tree =
        Aggregate::<Bvh, _>::build(field.clone(), &BvhParams { leaf_prims: 1, ..BvhParams::default() })
            .unwrap();
    let each = Aggregate::<Exhaustive, _>::build(field, &()).unwrap();
    // Beside the outline of each instance, by less than the ray inside is off.
    let mut seeded = rays::Seeded::new(9);
    let mut hits = 0;
    for case in 0..4000 {
        let (map, axis) = (&maps[case % 3], case / 3 % 3);
        let sign = [1.0, -1.0][case / 9 % 2];
        let carried = corners.iter().map(|p| map.point(*p));
        let outer = carried.max_by(|p, q| (sign * p[axis]).total_cmp(&(sign * q[axis]))).unwrap();
        let along = (axis + 1 + case / 18 % 2) % 3;
        let distance = [1e8, -1e10, 1e13][case / 36 % 3];
        let off = 10f64.powf(seeded.between(-18.0, -13.0)) * f64::abs(distance);
        let (mut origin, mut dir) = (outer, DVec3::ZERO);
        origin[axis] += if seeded.below(2) == 0 { sign * off } else { -sign * off };
        origin[3 - axis - along] += seeded.between(-off, off);
        origin[along] -= distance;
        dir[along] = f64::signum(distance);
        let ray = Ray::new(origin, dir);
        let found = each.intersect(&ray);
        assert_eq!(tree.intersect(&ray), found, "{}", conform::paste(&ray));
        assert_eq!(tree.intersect_p(&ray), found.is_some());
        hits += usize::from(found.is_some());
    }
    assert!(hits > 100, "{hits} hits");
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

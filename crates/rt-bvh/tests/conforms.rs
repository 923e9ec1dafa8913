//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Bounded, Instance, Structure};
use rt_bounds::Aabb;
use rt_bvh::{Builder, Bvh, BvhParams};
use rt_geom::Real;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Transform};
use rt_measure::{conform, rays};
use rt_scenes::{SceneGeometry, Solid};
use rt_shapes::TriangleMesh;

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

/// Rays that make trouble for this geometry: at its vertices, in the faces of its boxes, through all of it.
fn troublesome<R: Real>(source: &dyn Bounded, points: &[DVec3]) -> Vec<Ray<R>> {
    let finite = |b: &Aabb| b.is_valid() && b.min.is_finite() && b.max.is_finite();
    let bounds = (0..source.prim_count() as u32).map(|prim| source.bound(prim)).filter(finite);
    let world = bounds.fold(Aabb::EMPTY, Aabb::union);
    if !world.is_valid() {
        return Vec::new();
    }
    let some: Vec<DVec3> =
        points.iter().copied().filter(|p| p.is_finite()).step_by(1 + points.len() / 24).collect();
    let mut all = rays::uniform(1, &world, 60);
    all.extend(rays::aimed(2, &world, &some, 2));
    all.extend(rays::axis_parallel(&world, &some[..some.len().min(8)]));
    all.extend(rays::in_faces(3, &world, 24));
    all.extend(rays::inside(4, &world, 24));
    all
}

fn vertices<V: Real>(mesh: &TriangleMesh<V>) -> Vec<DVec3> {
    let widen = |v: &[V; 3]| DVec3::from_array(v.map(Into::into));
    let mut points: Vec<DVec3> = mesh.vertices().iter().map(widen).collect();
    for corners in mesh.triangles().iter().step_by(7) {
        let [a, b, _] = corners.map(|i| points[i as usize]);
        points.push((a + b) * 0.5);
    }
    points
}

fn check<S: Structure<Params = BvhParams>, V: Real + Into<R>, R: Real>(name: &str, mesh: &TriangleMesh<V>) {
    let rays = troublesome::<R>(mesh, &vertices(mesh));
    for params in params() {
        conform::conform::<S, R, _>(name, mesh, &params, &rays).unwrap_or_else(|why| panic!("{why}"));
    }
}

#[test]
fn on_every_trial_in_f32() {
    for trial in rt_scenes::trials() {
        check::<Bvh, f32, f32>(&trial.name, &trial.mesh);
    }
}

#[test]
fn on_every_trial_in_f64() {
    for trial in rt_scenes::trials() {
        check::<Bvh, f32, f64>(&trial.name, &trial.mesh);
    }
    for trial in rt_scenes::fine_trials() {
        check::<Bvh, f64, f64>(&trial.name, &trial.mesh);
    }
}

#[test]
fn on_solids_of_every_kind() {
    for (name, size) in [("balls", 2), ("rings", 1), ("tree", 4), ("mount", 2), ("teapot", 1)] {
        let scene = rt_scenes::by_name(name, Some(size)).unwrap();
        let SceneGeometry::Solids(solids) = scene.geometry else { panic!("{name} are solids") };
        let points: Vec<DVec3> = solids
            .iter()
            .filter_map(|solid| match solid {
                Solid::Sphere(ball) => Some(ball.center() + DVec3::X * ball.radius()),
                Solid::Frustum(frustum) => Some(frustum.ends()[0]),
                Solid::Facet(facet) => Some(facet.corners()[0]),
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
fn after_a_refit() {
    let before = rt_scenes::soup::uniform(500, 3);
    let mut after = before.clone();
    for [x, y, z] in after.vertices_mut() {
        (*x, *y, *z) = (*y - 0.5 * *z, 2.0 * *x, *z + 3.0);
    }
    let rays = troublesome::<f32>(&after, &vertices(&after));
    conform::conform_refit::<Bvh, f32, _>("soup of 500", &before, &after, &BvhParams::default(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

//! The tree answers as every quadric in turn does: their hits lie in their boxes.

use rt_accel::{Instance, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_bvh::{Bvh, BvhParams};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use rt_measure::conform::conform;
use rt_measure::rays::{self, Seeded};
use rt_shapes::{Disk, Frustum, Quadric, Shape, Uv};

/// Rays across, along the axes through tangent points of the boxes, in their faces and from within.
fn troublesome<R: Real, P: WorldBound>(shapes: &[P]) -> Vec<Ray<R>> {
    let world = shapes.iter().fold(Aabb::EMPTY, |b, p| b.union(p.world_bound()));
    let spots: Vec<DVec3> = shapes
        .iter()
        .step_by(3)
        .flat_map(|p| {
            let b = p.world_bound();
            let (min, max, mid) = (b.min.as_dvec3(), b.max.as_dvec3(), b.center().as_dvec3());
            [
                DVec3::new(min.x, mid.y, mid.z),
                DVec3::new(mid.x, max.y, mid.z),
                DVec3::new(mid.x, mid.y, max.z),
            ]
        })
        .collect();
    let mut all = rays::uniform(1, &world, 300);
    all.extend(rays::aimed(2, &world, &spots, 2));
    all.extend(rays::axis_parallel(&world, &spots[..spots.len().min(40)]));
    all.extend(rays::in_faces(3, &world, 60));
    all.extend(rays::inside(4, &world, 100));
    all
}

fn check<R: Real, P: Primitive<R, At = Uv>>(name: &str, shapes: Vec<P>) {
    let rays = troublesome::<R, P>(&shapes);
    conform::<Bvh, R, _>(name, &shapes, &BvhParams::default(), &rays).unwrap_or_else(|why| panic!("{why}"));
}

fn frusta(seed: u64, whole: bool) -> Vec<Frustum> {
    let mut seeded = Seeded::new(seed);
    let side = |seeded: &mut Seeded| seeded.inside(DVec3::ZERO, DVec3::splat(10.0));
    (0..150)
        .map(|_| {
            let (mut a, mut b) = (side(&mut seeded), side(&mut seeded));
            if whole {
                // On a grid and along an axis: boxes whose faces the surface touches exactly.
                (a, b) = (a.round(), a.round());
                b[seeded.below(3)] += 3.0;
            } else {
                b = a + (b - a) * 0.2;
            }
            let radius = |seeded: &mut Seeded| if whole { seeded.below(3) as f64 } else { seeded.unit() };
            Frustum::new(a, 1.0, b, radius(&mut seeded)).unwrap()
        })
        .collect()
}

fn mixed<R: Real>(seed: u64) -> Vec<Box<dyn Shape<R, At = Uv>>> {
    let mut seeded = Seeded::new(seed);
    let mut all: Vec<Box<dyn Shape<R, At = Uv>>> = Vec::new();
    for i in 0..150 {
        let h = seeded.between(0.1, 2.0);
        let mut side = || DVec3::new(seeded.between(-1.0, 1.0), seeded.between(-1.0, 1.0), 0.0);
        let (p, q) = (side(), side());
        let quadric = match i % 5 {
            0 => Quadric::sphere(1.0).unwrap().cut(-0.5 * h, 0.9).unwrap(),
            1 => Quadric::cylinder(1.0, -h, h).unwrap(),
            2 => Quadric::cone(h, 1.0).unwrap(),
            3 => Quadric::paraboloid(1.0, 0.0, h).unwrap(),
            _ => Quadric::hyperboloid(p, q + DVec3::Z * h).unwrap(),
        };
        let from = seeded.between(-3.0, 3.0);
        let to = from + seeded.between(0.5, 6.2);
        let quadric = if i % 3 == 0 { quadric } else { quadric.swept(from, to).unwrap() };
        let place = Transform::translation(seeded.inside(DVec3::ZERO, DVec3::splat(8.0)).round());
        let turn = Transform::rotation(seeded.direction(), if i % 2 == 0 { 0.0 } else { 1.0 }).unwrap();
        let map = turn.then(&place).unwrap();
        all.push(Box::new(Instance::new(quadric, map)));
        all.push(Box::new(Instance::new(Disk::ring(h, 0.2, 1.0).unwrap().swept(from, to).unwrap(), map)));
    }
    all
}

#[test]
fn on_frusta() {
    for seed in 1..4 {
        check::<f32, _>(&format!("frusta, seed {seed}"), frusta(seed, false));
        check::<f64, _>(&format!("frusta, seed {seed}"), frusta(seed, false));
        check::<f32, _>(&format!("frusta on a grid, seed {seed}"), frusta(seed, true));
        check::<f64, _>(&format!("frusta on a grid, seed {seed}"), frusta(seed, true));
    }
}

#[test]
fn on_mixed_quadrics() {
    for seed in 1..4 {
        check::<f32, _>(&format!("quadrics, seed {seed}"), mixed::<f32>(seed));
        check::<f64, _>(&format!("quadrics, seed {seed}"), mixed::<f64>(seed));
    }
}

//! Which bounding volume?
//!
//! One ray against 512 volumes about random rods, and what it costs to make a ray ready. Fit, and what fit is worth, are in the
//! records of `cargo xtask bench volumes`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_bounds::{Aabb, BoundingSphere, BoundingVolume, Hull, Kdop, Obb, Polytope};
use rt_geom::Ray;
use rt_geom::glam::{DVec3, Vec3A};
use rt_measure::rays::{Seeded, uniform};
use std::hint::black_box;

/// A rod of eight corners in the unit cube, in any direction.
fn rod(seeded: &mut Seeded) -> Vec<DVec3> {
    let at = seeded.inside(DVec3::ZERO, DVec3::ONE);
    let along = seeded.direction() * 0.2;
    let (p, q) = along.normalize_or(DVec3::X).any_orthonormal_pair();
    let corner = |i: i32| {
        let side = |bit: i32| f64::from(2 * (i >> bit & 1) - 1);
        at + along * side(0) + p * (0.008 * side(1)) + q * (0.008 * side(2))
    };
    (0..8).map(corner).collect()
}

fn one<V: BoundingVolume>(c: &mut Criterion, name: &str, rods: &[Vec<DVec3>], rays: &[Ray]) {
    let world = Aabb::new(Vec3A::splat(-0.3), Vec3A::splat(1.3));
    let volumes: Vec<V> = rods.iter().filter_map(|rod| V::around(rod, DVec3::ZERO)).collect();
    let ready = |ray: &Ray| V::ready(ray, DVec3::ZERO, &world);
    let mut turn = rays.iter().cycle();
    let mut group = c.benchmark_group(name);
    group.bench_function("ready", |b| {
        b.iter_with_setup(|| turn.next().map_or(rays[0], |ray| *ray), |ray| ready(black_box(&ray)));
    });
    group.throughput(Throughput::Elements(volumes.len() as u64));
    group.bench_function("512 volumes", |b| {
        b.iter_with_setup(
            || ready(turn.next().unwrap_or(&rays[0])),
            |ray| volumes.iter().filter(|v| v.entry(black_box(&ray)).is_some()).count(),
        );
    });
    group.finish();
}

fn volumes(c: &mut Criterion) {
    let mut seeded = Seeded::new(1);
    let rods: Vec<Vec<DVec3>> = (0..512).map(|_| rod(&mut seeded)).collect();
    let rays: Vec<Ray> = uniform(2, &Aabb::new(Vec3A::ZERO, Vec3A::ONE), 64);
    one::<Aabb>(c, "aabb", &rods, &rays);
    one::<BoundingSphere>(c, "sphere", &rods, &rays);
    one::<Obb>(c, "obb", &rods, &rays);
    one::<Kdop<14>>(c, "kdop-14", &rods, &rays);
    one::<Kdop<18>>(c, "kdop-18", &rods, &rays);
    one::<Kdop<26>>(c, "kdop-26", &rods, &rays);
    one::<Polytope>(c, "hull", &rods, &rays);
    // The hull of all corners, once.
    let corners: Vec<DVec3> = rods.concat();
    c.bench_function("wrap 4096 points", |b| b.iter(|| Hull::new(black_box(&corners))));
}

criterion_group!(benches, volumes);
criterion_main!(benches);

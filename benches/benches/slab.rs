//! Which box test?
//!
//! One ray against 512 boxes, and what it costs to make a ray ready. The errors of each test, on rays in faces, along axes and
//! through corners, are in the records of `cargo xtask bench slab`.
//!
//! Answer: the pair, of `SlabRay`. A box costs it 1.1 ns, a single box 2.6 ns, the textbook's test 3.5 ns; it never missed a
//! box in 98 304 judged tests, while the textbook's lost 46 % of the rays in faces, 35 % of those along axes, 18 % of those
//! through corners (9 % where its exit is padded). Making a ray ready costs 28 ns against 24. (The record of 2026-11-22, AMD
//! EPYC, two cores; the last from this program.)

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_bench::TextbookRay;
use rt_bounds::{Aabb, BoxPair, SlabRay};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::rays::{Seeded, uniform};
use std::hint::black_box;

fn slab(c: &mut Criterion) {
    let mut seeded = Seeded::new(1);
    let boxes: Vec<Aabb> = (0..512)
        .map(|_| {
            let center = seeded.inside(DVec3::ZERO, DVec3::ONE).as_vec3a();
            let half = seeded.inside(DVec3::splat(0.01), DVec3::splat(0.2)).as_vec3a();
            Aabb::new(center - half, center + half)
        })
        .collect();
    let pairs: Vec<BoxPair> = boxes.chunks_exact(2).map(|two| BoxPair::new(&two[0], &two[1])).collect();
    let world = boxes.iter().fold(Aabb::EMPTY, |world, b| world.union(*b));
    let rays: Vec<Ray> = uniform(2, &world, 64);
    let first = rays[0];
    let mut turn = rays.iter().copied().cycle();
    let mut next = || turn.next().unwrap_or(first);

    let mut group = c.benchmark_group("setup");
    group.bench_function("slab", |b| {
        b.iter_with_setup(&mut next, |ray| SlabRay::new(&ray, DVec3::ZERO, &world))
    });
    group.bench_function("textbook", |b| b.iter_with_setup(&mut next, |ray| TextbookRay::new(&ray)));
    group.finish();

    let mut group = c.benchmark_group("512 boxes");
    group.throughput(Throughput::Elements(boxes.len() as u64));
    group.bench_function("slab pair", |b| {
        b.iter_with_setup(
            || SlabRay::new(&next(), DVec3::ZERO, &world),
            |ray| pairs.iter().map(|pair| black_box(&ray).enter_pair(pair).0.count_ones()).sum::<u32>(),
        );
    });
    group.bench_function("slab entry", |b| {
        b.iter_with_setup(
            || SlabRay::new(&next(), DVec3::ZERO, &world),
            |ray| boxes.iter().filter(|b| black_box(&ray).entry(b).is_some()).count(),
        );
    });
    group.bench_function("textbook", |b| {
        b.iter_with_setup(
            || TextbookRay::new(&next()),
            |ray| boxes.iter().filter(|b| black_box(&ray).entry_fast(b).is_some()).count(),
        );
    });
    group.finish();
}

criterion_group!(benches, slab);
criterion_main!(benches);

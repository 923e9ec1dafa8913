//! How long does a tree take to build?
//!
//! By the number of bins and the size of leaves, over a soup of 10 000 triangles. What each knob does to rays is in the records
//! of `cargo xtask bench build`.
//!
//! Answer: 0.6 to 0.85 microseconds a triangle, on one thread. Of the knobs sweeping costs most: splitting small ranges by
//! bins alone takes 1.46 times as long, sweeping up to 64 primitives instead of 24 takes 1.16 times; 8 bins take 0.95, 64
//! bins 1.09. None of these changed rays by more than the noise, which is 2 per cent here. Leaves of one primitive slow rays
//! down, by 11 per cent, and 4, 8 or 16 lead to the same trees almost everywhere. (The record of 2026-11-22, AMD EPYC, two
//! cores: geometric means over five scenes.)

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rt_accel::Structure;
use rt_bvh::{Builder, Bvh, BvhParams};
use rt_scenes::soup;

fn build(c: &mut Criterion) {
    let mesh = soup::uniform(10_000, 1);
    let mut group = c.benchmark_group("build");
    group.throughput(Throughput::Elements(mesh.triangles().len() as u64));
    group.sample_size(20);
    for bins in [8, 16, 32, 64] {
        let params = BvhParams { builder: Builder::Binned { bins }, ..BvhParams::default() };
        group.bench_function(BenchmarkId::new("bins", bins), |b| b.iter(|| Bvh::build(&mesh, &params)));
    }
    for leaf_prims in [1, 2, 4, 8, 16] {
        let params = BvhParams { leaf_prims, ..BvhParams::default() };
        group.bench_function(BenchmarkId::new("leaf", leaf_prims), |b| b.iter(|| Bvh::build(&mesh, &params)));
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);

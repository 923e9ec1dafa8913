//! What does any hit cost?
//!
//! On a soup of 10 000 triangles, by the kind of rays; exact in `f32` and `f64`, and by the fast triangle test, which errs.
//! Larger scenes, and the errors beside the times, are in the records of `cargo xtask bench any`.
//!
//! Answer: 0.6 to 0.8 microseconds on a scanned mesh of 69 451 triangles, 2.3 to 2.7 on a soup of 100 000, `f32`, exact. The
//! fast test is 1.10 times as fast over six meshes, `f64` rays 0.81 times over seven scenes, on a machine where one cell may
//! be off by a sixth. (The record of 2026-11-22, AMD EPYC, two cores.)

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_accel::{Aggregate, Primitive};
use rt_bench::{FastMesh, Prims, RayKind, Subject, Trouble};
use rt_bvh::{Bvh, BvhParams};

fn any(c: &mut Criterion) -> Result<(), Trouble> {
    let subject = Subject::named("soup-10000")?;
    let Prims::Mesh(mesh) = &subject.prims else { return Ok(()) };
    let exact = Aggregate::<Bvh, _>::build(mesh.clone(), &BvhParams::default())?;
    let fast = Aggregate::<Bvh, _>::build(FastMesh(mesh.clone()), &BvhParams::default())?;
    for set in subject.rays(&[RayKind::Ambient, RayKind::Shadow], 1 << 12)? {
        let mut group = c.benchmark_group(set.kind.name());
        group.throughput(Throughput::Elements(set.rays.len() as u64));
        group.sample_size(20);
        group.bench_function("f32 exact", |b| {
            b.iter(|| set.rays.iter().filter(|ray| exact.intersect_p(ray)).count())
        });
        group.bench_function("f32 fast", |b| {
            b.iter(|| set.rays.iter().filter(|ray| fast.intersect_p(ray)).count())
        });
        group.bench_function("f64 exact", |b| {
            b.iter(|| set.wide.iter().filter(|ray| exact.intersect_p(ray)).count())
        });
        group.finish();
    }
    Ok(())
}

fn run(c: &mut Criterion) {
    // Such scenes are always made; should one not be, there is nothing to measure.
    let _ = any(c);
}

criterion_group!(benches, run);
criterion_main!(benches);

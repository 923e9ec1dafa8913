//! What does a closest hit cost?
//!
//! On a soup of 10 000 triangles, by the kind of rays; exact in `f32` and `f64`, and by the fast triangle test, which errs.
//! Larger scenes, and the errors beside the times, are in the records of `cargo xtask bench closest`.
//!
//! Answer: 0.17 to 1.0 microseconds on a scanned mesh of 69 451 triangles, 0.9 to 4.1 on a soup of 100 000, `f32`, exact. The
//! fast test is 1.06 times as fast over six meshes, `f64` rays 0.76 times over seven scenes, on a machine where one cell may
//! be off by a sixth. (The record of 2026-11-22, AMD EPYC, two cores.)

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rt_accel::{Aggregate, Primitive};
use rt_bench::{FastMesh, Prims, RayKind, Subject, Trouble};
use rt_bvh::{Bvh, BvhParams};

fn closest(c: &mut Criterion) -> Result<(), Trouble> {
    let subject = Subject::named("soup-10000")?;
    let Prims::Mesh(mesh) = &subject.prims else { return Ok(()) };
    let exact = Aggregate::<Bvh, _>::build(mesh.clone(), &BvhParams::default())?;
    let fast = Aggregate::<Bvh, _>::build(FastMesh(mesh.clone()), &BvhParams::default())?;
    for set in subject.rays(&[RayKind::Primary, RayKind::Chords, RayKind::Diffuse], 1 << 12)? {
        let mut group = c.benchmark_group(set.kind.name());
        group.throughput(Throughput::Elements(set.rays.len() as u64));
        group.sample_size(20);
        group.bench_function("f32 exact", |b| {
            b.iter(|| set.rays.iter().filter(|ray| exact.intersect(ray).is_some()).count())
        });
        group.bench_function("f32 fast", |b| {
            b.iter(|| set.rays.iter().filter(|ray| fast.intersect(ray).is_some()).count())
        });
        group.bench_function("f64 exact", |b| {
            b.iter(|| set.wide.iter().filter(|ray| exact.intersect(ray).is_some()).count())
        });
        group.finish();
    }
    Ok(())
}

fn run(c: &mut Criterion) {
    // Such scenes are always made; should one not be, there is nothing to measure.
    let _ = closest(c);
}

criterion_group!(benches, run);
criterion_main!(benches);

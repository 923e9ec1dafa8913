//! Parts of a turn that abut leave nothing of the whole out.

use crate::revolved::Part;
use core::ops::ControlFlow;
use rt_accel::Primitive;
use rt_geom::Ray;
use rt_geom::glam::{DVec2, DVec3};
use rt_measure::rays::Seeded;
use rt_shapes::{Disk, Quadric, Root};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Angles that together make a turn, and then some name for each border that a caller may compute.
fn cuts(seeded: &mut Seeded) -> Vec<f64> {
    match seeded.below(6) {
        0 => vec![0.0, PI, TAU],
        1 => vec![-PI, 0.0, PI],
        2 => vec![0.0, FRAC_PI_2, PI, PI + FRAC_PI_2, 2.0 * PI],
        3 => {
            let from = seeded.between(-10.0, 10.0);
            vec![from, from + PI, from + TAU]
        }
        4 => {
            let from = seeded.between(-1.0, 1.0) * 10f64.powf(seeded.between(-20.0, 3.0));
            vec![from, from + seeded.between(1e-3, 3.0), from + seeded.between(3.1, 6.2), from + TAU]
        }
        _ => {
            let mut inner: Vec<f64> = (0..4).map(|_| seeded.between(0.01, 6.27)).collect();
            inner.sort_by(f64::total_cmp);
            inner.insert(0, 0.0);
            inner.push(TAU);
            inner
        }
    }
}

fn along(d: DVec3) -> DVec3 {
    d.try_normalize().unwrap_or(DVec3::X)
}

/// A ray through `on`, as exactly as rounding lets it be, or just beside; from near, far, or `on` itself.
fn aimed(seeded: &mut Seeded, on: DVec3) -> Ray<f64> {
    let d = match seeded.below(4) {
        0 => along(on.with_z(0.0)),
        1 => [DVec3::X, DVec3::Y, DVec3::Z][seeded.below(3)],
        _ => seeded.direction(),
    };
    let on = match seeded.below(3) {
        0 => on + seeded.direction() * on.length() * 10f64.powf(seeded.between(-34.0, -14.0)),
        _ => on,
    };
    let far = [0.0, 1.0, 3.0, 1e6][seeded.below(4)];
    Ray::new(on - d * far, d).between(f64::NEG_INFINITY, f64::INFINITY)
}

fn met(shape: &impl Primitive<f64>, ray: &Ray<f64>) -> Vec<f64> {
    let mut all = Vec::new();
    let _ = shape.all_hits(ray, &mut |hit| {
        all.push(hit.t);
        ControlFlow::Continue(())
    });
    all
}

#[test]
fn no_hit_of_the_whole_is_lost_between_parts() {
    let mut seeded = Seeded::new(3);
    let (mut roots, mut shared) = (0, 0);
    for _ in 0..20_000 {
        let part = Part { sweep: None, ..Part::random(&mut seeded, 1.0) };
        let (whole, cuts) = (part.shape(), cuts(&mut seeded));
        let parts: Vec<Quadric> =
            cuts.windows(2).map(|ends| whole.clone().swept(ends[0], ends[1]).unwrap()).collect();
        let z = match seeded.below(4) {
            0 => part.z[seeded.below(2)],
            _ => seeded.between(part.z[0], part.z[1]),
        };
        let on = part.point(z, cuts[seeded.below(cuts.len())]);
        let ray = aimed(&mut seeded, on);
        let (o, d) = (ray.origin, ray.dir);
        let found: Vec<Root> = parts.iter().flat_map(|part| part.roots(o, d)).flatten().collect();
        for root in whole.roots(o, d).into_iter().flatten() {
            roots += 1;
            let count = found.iter().filter(|f| (f.t - root.t).abs() <= f.error + root.error).count();
            assert!(count > 0, "{root:?} of {part:?} between {cuts:?}: {ray:?} {found:?}");
            shared += usize::from(count > 1);
        }
        let near = |shape: &Quadric| shape.intersect(&Ray::new(o, d)).map_or(f64::INFINITY, |hit| hit.t);
        let (first, least) = (near(&whole), parts.iter().map(near).fold(f64::INFINITY, f64::min));
        let error = found.iter().map(|f| f.error).fold(0.0, f64::max);
        assert!(
            first == least || (first - least).abs() <= 2.0 * error,
            "{first:e} {least:e} {part:?} {ray:?}"
        );
    }
    assert!(roots > 20_000 && shared > 1000, "{roots} {shared}");
}

#[test]
fn no_hit_of_a_disk_is_lost_between_parts() {
    let mut seeded = Seeded::new(4);
    let (mut hits, mut shared) = (0, 0);
    for _ in 0..20_000 {
        let (inner, cuts) = ([0.0, 0.3][seeded.below(2)], cuts(&mut seeded));
        let whole = Disk::ring(seeded.between(-1.0, 1.0), inner, 1.0).unwrap();
        let radius = match seeded.below(4) {
            0 => inner,
            1 => 1.0,
            _ => seeded.between(inner, 1.0),
        };
        let on = DVec2::from_angle(cuts[seeded.below(cuts.len())]) * radius;
        let ray = aimed(&mut seeded, on.extend(whole.sample(DVec2::ZERO).point.z));
        let parts = cuts.windows(2).map(|ends| whole.clone().swept(ends[0], ends[1]).unwrap());
        let count = parts.filter(|part| met(part, &ray) == met(&whole, &ray)).count();
        if !met(&whole, &ray).is_empty() {
            hits += 1;
            assert!(count > 0, "{whole:?} between {cuts:?}: {ray:?}");
            shared += usize::from(count > 1);
        }
    }
    assert!(hits > 10_000 && shared > 1000, "{hits} {shared}");
}

#[test]
fn borders_a_quarter_turn_apart_are_the_axes() {
    let disk = Disk::new(0.0, 1.0).unwrap();
    let at = |part: &Disk, x: f64, y: f64| part.intersect_p(&Ray::new(DVec3::new(x, y, -1.0), DVec3::Z));
    for turns in [-2.0, -1.0, 0.0, 1.0] {
        let upper = disk.clone().swept(turns * TAU, turns * TAU + PI).unwrap();
        let lower = disk.clone().swept(turns * TAU + PI, (turns + 1.0) * TAU).unwrap();
        for x in [-0.5, 0.5] {
            assert!(at(&upper, x, 0.0) && at(&lower, x, 0.0), "{turns}");
            assert!(at(&upper, x, 1e-25) && !at(&lower, x, 1e-25), "{turns}");
            assert!(!at(&upper, x, -1e-25) && at(&lower, x, -1e-25), "{turns}");
        }
    }
    // The narrowest sweeps are lines, on one side of the axis; narrower ones are none.
    let mut none = 0;
    for i in 0..2000 {
        let from = f64::from(i) * 0.00314;
        match disk.clone().swept(from, from.next_up()) {
            Ok(line) => {
                let (y, x) = from.sin_cos();
                assert!(at(&line, 0.5 * x, 0.5 * y) && !at(&line, -0.5 * x, -0.5 * y), "{from}");
            }
            Err(_) => none += 1,
        }
    }
    assert!((1..2000).contains(&none), "{none}");
}

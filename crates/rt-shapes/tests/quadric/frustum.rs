//! Frusta against exact arithmetic.

use crate::judge::{Tally, size, unresolved};
use core::ops::ControlFlow;
use rt_accel::{Primitive, WorldBound};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::exact::{self, Rational};
use rt_measure::rays::Seeded;
use rt_shapes::{Frustum, Root, Shape};

#[derive(Clone, Copy, Debug)]
struct Case {
    base: DVec3,
    r0: f64,
    top: DVec3,
    r1: f64,
    o: DVec3,
    d: DVec3,
}

fn case(seeded: &mut Seeded) -> Case {
    let r0 = if seeded.below(8) == 0 { 0.0 } else { size(seeded) };
    let r1 = match seeded.below(4) {
        0 if r0 > 0.0 => 0.0,
        1 if r0 > 0.0 => r0,
        _ => r0.max(1e-6) * 10f64.powf(seeded.between(-1.0, 1.0)),
    };
    let length = r0.max(r1) * 10f64.powf(seeded.between(-2.0, 2.0));
    let place = seeded.direction() * [0.0, 1.0, 1e3][seeded.below(3)] * r0.max(r1);
    let along = match seeded.below(3) {
        0 => [DVec3::X, DVec3::Y, DVec3::Z][seeded.below(3)],
        _ => seeded.direction(),
    };
    let (base, top) = (place, place + along * length);
    let axis = top - base;
    let v = seeded.between(-0.05, 1.05);
    let radius = r0 + (r1 - r0) * v;
    let unit = axis.normalize();
    let (x, y) = unit.any_orthonormal_pair();
    let (sin, cos) = seeded.between(0.0, 6.3).sin_cos();
    let out = x * cos + y * sin;
    let on = base + axis * v + out * radius;
    let around = unit.cross(out);
    let ruling = (axis + out * (r1 - r0)).normalize();
    let far = length.max(r0 + r1) * 10f64.powf(seeded.between(-1.0, 7.0));
    let toward = match seeded.below(6) {
        // Tangents: around, along a ruling, and between.
        0 => around + ruling * seeded.between(-2.0, 2.0),
        1 => ruling + around * seeded.between(-1e-6, 1e-6),
        2 => around + seeded.direction() * 10f64.powf(seeded.between(-16.0, -2.0)),
        _ => seeded.direction(),
    };
    let d = toward * 10f64.powf(seeded.between(-2.0, 2.0));
    let target = match seeded.below(5) {
        0 => base + (on - base) * 10f64.powf(seeded.between(-15.0, 0.0)),
        1 => top,
        _ => on,
    };
    let o = match seeded.below(6) {
        0 => target,
        _ => target - toward * far,
    };
    Case { base, r0, top, r1, o, d }
}

/// Whether the root is one, or what [`unresolved`] allows.
fn near(case: &Case, root: Root) -> bool {
    let Case { base, r0, top, r1, o, d } = *case;
    let whole = |x: f64| Rational::from_f64(x).unwrap();
    let dot =
        |a: &[Rational; 3], b: &[Rational; 3]| &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2]);
    let e = [0, 1, 2].map(|i| &whole(top[i]) - &whole(base[i]));
    let at = |t: &Rational| [0, 1, 2].map(|i| &(&whole(o[i]) + &(t * &whole(d[i]))) - &whole(base[i]));
    let square = dot(&e, &e);
    // The squared distance from the axis without the squared radius there.
    let f = |t: &Rational| {
        let w = at(t);
        let v = &dot(&w, &e) / &square;
        let radius = &whole(r0) + &(&v * &(&whole(r1) - &whole(r0)));
        &(&dot(&w, &w) - &(&(&v * &v) * &square)) - &(&radius * &radius)
    };
    let size = (top - base).length_squared() + r0 * r0 + r1 * r1;
    unresolved((o - base, d), root, size, f, |t, play| {
        let (height, play) = (dot(&at(t), &e), whole(play * (top - base).length()));
        (&height + &play).sign() >= 0 && (&(&square - &height) + &play).sign() >= 0
    })
}

fn run(seed: u64, count: u64) -> Tally {
    let mut seeded = Seeded::new(seed);
    let mut tally = Tally::default();
    while tally.cases < count {
        let case = case(&mut seeded);
        let Case { base, r0, top, r1, o, d } = case;
        let Ok(shape) = Frustum::new(base, r0, top, r1) else { continue };
        let (oa, da) = (o.to_array(), d.to_array());
        let truth = exact::frustum(oa, da, base.to_array(), r0, top.to_array(), r1);
        // By how much a relative change of what is given moves t, relatively.
        let condition = |t: f64| {
            let (unit, w) = ((top - base).normalize(), o + d * t - base);
            let out = (w - unit * w.dot(unit)).normalize_or_zero();
            let normal = (out * (top - base).length() - unit * (r1 - r0)).normalize();
            ((o - base).length() + (d * t).length() + r0) / (normal.dot(d) * t).abs()
        };
        tally.judge(&truth, shape.roots(o, d), condition, |root| near(&case, root), case);
    }
    tally
}

#[test]
fn no_root_is_missed() {
    let tally = run(1, 10_000);
    assert_eq!((tally.missed, tally.beyond, tally.coarse, tally.invented), (0, 0, 0, 0), "{tally:?}");
    assert!(tally.roots > tally.cases / 2 && tally.worst < 1.0, "{tally:?}");
}

#[test]
#[ignore = "minutes in release; RT_SEED and RT_CASES choose what"]
fn no_root_is_missed_in_millions() {
    let number = |name, default| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    let tally = run(number("RT_SEED", 1), number("RT_CASES", 1_000_000));
    println!("{tally:?}");
    assert_eq!((tally.missed, tally.beyond, tally.coarse, tally.invented), (0, 0, 0, 0), "{tally:?}");
}

#[test]
fn spawned_rays_leave() {
    let mut seeded = Seeded::new(5);
    let mut spawned = 0;
    for _ in 0..20_000 {
        let scale = 10f64.powf(seeded.between(-3.0, 3.0));
        let mut inside = |size: f64| seeded.inside(DVec3::splat(-size), DVec3::splat(size));
        let place = inside(1e4);
        let (base, top) = (place + inside(scale), place + inside(scale));
        let target = place + inside(scale);
        let o = place + inside(5.0 * scale);
        let out = inside(1.0).normalize();
        let (r0, r1) = (scale * seeded.unit(), scale * seeded.unit());
        let shape = Frustum::new(base, r0, top, r1).unwrap();
        let ray = Ray::new(o, target - o);
        let Some(hit) = shape.intersect(&ray) else { continue };
        let surface = shape.surface(&ray, &hit);
        let there = ray.at(hit.t);
        assert!((surface.point - there).length() < 1e-6 * scale.max(1.0), "{} {there}", surface.point);
        if out.dot(surface.normal).abs() < 1e-3 {
            continue;
        }
        spawned += 1;
        let near = |t: f64| t.abs() < 1e-7 * scale;
        let leaving = surface.spawn(out);
        assert!(!shape.intersect(&leaving).is_some_and(|hit| near(hit.t)), "{shape:?} {leaving:?}");
        let leaving = surface.spawn(out.as_vec3a());
        assert!(!shape.intersect(&leaving).is_some_and(|hit| near(hit.t as f64)), "{shape:?} {leaving:?}");
    }
    assert!(spawned > 5000);
}

#[test]
fn all_queries_agree_and_hits_lie_in_the_bound() {
    let mut seeded = Seeded::new(9);
    let mut hits = 0;
    for _ in 0..20_000 {
        let Case { base, r0, top, r1, o, d } = case(&mut seeded);
        let shape = Frustum::new(base, r0, top, r1).unwrap();
        let bound = shape.world_bound();
        let ray = Ray::new(o, d);
        let mut all = Vec::new();
        let _ = shape.all_hits(&ray, &mut |hit| {
            all.push(hit.t);
            ControlFlow::Continue(())
        });
        let first = all.iter().copied().reduce(f64::min);
        assert_eq!(shape.intersect(&ray).map(|hit| hit.t), first);
        assert_eq!(shape.intersect_p(&ray), first.is_some());
        for t in all {
            hits += 1;
            let span = exact::aabb(
                o.to_array(),
                d.to_array(),
                bound.min.as_dvec3().to_array(),
                bound.max.as_dvec3().to_array(),
            );
            assert!(
                span.is_some_and(|span| span.meets(t.next_down(), t.next_up())),
                "{shape:?} {ray:?} {t:e}"
            );
            assert_eq!(shape.intersect(&ray.between(t, t)).map(|hit| hit.t), Some(t));
        }
    }
    assert!(hits > 10_000);
}

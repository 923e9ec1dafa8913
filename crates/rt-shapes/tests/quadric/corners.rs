//! Bad parameters, extreme sizes, and one surface said in two ways.

use crate::revolved::{Part, ray};
use rt_accel::Primitive;
use rt_geom::glam::{DVec2, DVec3, Vec3A};
use rt_geom::{Ray, Real};
use rt_measure::rays::Seeded;
use rt_shapes::{Disk, Frustum, Quadric, QuadricError, Shape, Sphere};
use std::f64::consts::{PI, TAU};

#[test]
fn what_is_no_quadric_says_why() {
    let (o, z, nan) = (DVec3::ZERO, DVec3::Z, f64::NAN);
    assert_eq!(Quadric::sphere(0.0), Err(QuadricError::Radius(0.0)));
    assert!(matches!(Quadric::sphere(nan), Err(QuadricError::Radius(_))));
    assert_eq!(Quadric::cylinder(1.0, 2.0, 2.0), Err(QuadricError::Range { min: 2.0, max: 2.0 }));
    assert_eq!(Quadric::cylinder(-1.0, 0.0, 2.0), Err(QuadricError::Radius(-1.0)));
    assert!(Quadric::cylinder(1.0, nan, 2.0).is_err() && Quadric::cylinder(1.0, 0.0, f64::INFINITY).is_err());
    assert_eq!(Quadric::cone(-2.0, 1.0), Err(QuadricError::Height(-2.0)));
    assert_eq!(Quadric::paraboloid(1.0, -1.0, 2.0), Err(QuadricError::Range { min: -1.0, max: 2.0 }));
    assert_eq!(Quadric::hyperboloid(z, z * 2.0), Err(QuadricError::Radius(0.0)));
    assert!(matches!(Quadric::hyperboloid(DVec3::X, DVec3::Y), Err(QuadricError::Range { .. })));
    assert!(matches!(Quadric::hyperboloid(DVec3::X, DVec3::NAN), Err(QuadricError::Point(_))));
    let ball = Quadric::sphere(1.0).unwrap();
    assert_eq!(ball.clone().cut(0.5, -0.5), Err(QuadricError::Range { min: 0.5, max: -0.5 }));
    assert!(ball.clone().cut(1.0, 2.0).is_err() && ball.clone().cut(nan, 1.0).is_err());
    assert_eq!(ball.clone().cut(-9.0, 9.0).unwrap(), ball);
    assert!(Quadric::sphere(2e290).is_err() && Frustum::cone(o, 2e290, z).is_err());
    let inf = f64::INFINITY;
    for (from, to) in [
        (1.0, 1.0),
        (1.0, 0.0),
        (0.0, 7.0),
        (nan, 1.0),
        (0.0, nan),
        (nan, nan),
        (0.0, inf),
        (-inf, 0.0),
        (-inf, inf),
        (inf, inf),
        (1e15, 1e15 + 1.0),
        (1e17, 1e17 + 64.0),
        (-1e17, 16.0 - 1e17),
        (f64::MIN, f64::MAX),
        (2f64.powi(20), 2f64.powi(20) + 1.0),
        ((-2f64.powi(20)).next_down(), 1.0 - 2f64.powi(20)),
    ] {
        assert!(matches!(ball.clone().swept(from, to), Err(QuadricError::Sweep { .. })), "{from} {to}");
        assert!(Disk::new(0.0, 1.0).unwrap().swept(from, to).is_err());
    }
    assert!(ball.clone().swept(-PI, PI).is_ok() && ball.swept(0.3, 0.3 + TAU).is_ok());
    // The largest angles still make the part that is meant.
    for from in [2f64.powi(20) - 1.0, -2f64.powi(20)] {
        let disk = Disk::new(0.0, 1.0).unwrap().swept(from, from + 1.0).unwrap();
        assert_eq!(disk.area(), 0.5);
        let meets = |phi: f64| {
            let (sin, cos) = phi.sin_cos();
            disk.intersect_p(&Ray::new(DVec3::new(0.5 * cos, 0.5 * sin, -1.0), DVec3::Z))
        };
        assert!(meets(from) && meets(from + 0.5) && meets(from + 1.0));
        assert!(!meets(from - 1e-8) && !meets(from + 1.0 + 1e-8) && !meets(from + 4.0));
    }
    assert_eq!(Disk::ring(0.0, 1.0, 1.0), Err(QuadricError::Inner { inner: 1.0, outer: 1.0 }));
    assert!(Disk::new(nan, 1.0).is_err() && Disk::new(0.0, f64::INFINITY).is_err());
    assert_eq!(Frustum::cylinder(o, o, 1.0), Err(QuadricError::NoAxis(o)));
    assert_eq!(Frustum::cylinder(o, z, 0.0), Err(QuadricError::Radius(0.0)));
    assert_eq!(Frustum::cone(o, -1.0, z), Err(QuadricError::Radius(-1.0)));
    assert!(Frustum::cone(DVec3::NAN, 1.0, z).is_err() && Frustum::cone(o, nan, z).is_err());
    assert_eq!(QuadricError::Radius(-1.0).to_string(), "radius -1 is not a positive number up to 1e290");
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let ball = Quadric::sphere(1.0).unwrap();
    let disk = Disk::new(0.0, 1.0).unwrap();
    let tube = Frustum::cylinder(DVec3::NEG_Z, DVec3::Z, 1.0).unwrap();
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::new(0.0, f64::NAN, -1.0), DVec3::new(0.0, 0.0, f64::INFINITY)]
    {
        let ray = Ray::new(DVec3::new(0.1, 0.2, 0.5), bad);
        assert!(!ball.intersect_p(&ray) && !disk.intersect_p(&ray) && !tube.intersect_p(&ray), "{bad}");
        let ray = Ray::new(DVec3::splat(f64::NAN), DVec3::X);
        assert!(!ball.intersect_p(&ray) && !disk.intersect_p(&ray) && !tube.intersect_p(&ray));
    }
    // In the plane of the disk, and along the rulings of the tube.
    assert!(!disk.intersect_p(&Ray::new(DVec3::NEG_X * 2.0, DVec3::X)));
    assert!(!tube.intersect_p(&Ray::new(DVec3::new(1.0, 0.0, -5.0), DVec3::Z)));
    assert!(tube.intersect_p(&Ray::new(DVec3::new(1.0, -3.0, 0.0), DVec3::Y)));
}

#[test]
fn sizes_and_speeds_beyond_any_product_are_met() {
    for size in [1e-300, 1e-165, 1e-30, 1.0, 1e30, 1e165, 1e289] {
        for speed in [1e-250, 1e-160, 1e-30, 1.0, 1e30, 1e160, 1e250] {
            let shapes = [
                Quadric::sphere(size).unwrap(),
                Quadric::cylinder(size, -size, size).unwrap(),
                Quadric::cone(size, 2.0 * size).unwrap().cut(0.0, size).unwrap(),
                Quadric::hyperboloid(DVec3::new(size, 0.0, -size), DVec3::new(size, 0.0, size)).unwrap(),
            ];
            let ray = |z: f64| Ray::new(DVec3::new(-5.0 * size, 0.0, z * size), DVec3::X * speed);
            let exact = 4.0 * size / speed;
            let mut met: Vec<_> = shapes[..2].iter().map(|s| s.intersect(&ray(0.0))).collect();
            met.push(shapes[2].intersect(&ray(0.5)));
            met.push(shapes[3].intersect(&ray(0.0)));
            let tube = Frustum::cylinder(DVec3::NEG_Z * size, DVec3::Z * size, size).unwrap();
            met.push(tube.intersect(&ray(0.0)));
            let disk = Disk::new(4.0 * size, size).unwrap();
            met.push(disk.intersect(&Ray::new(DVec3::ZERO, DVec3::Z * speed)));
            for (i, hit) in met.into_iter().enumerate() {
                let t = hit.unwrap_or_else(|| panic!("{i}: {size:e} {speed:e}")).t;
                if exact.is_normal() {
                    assert!((t / exact - 1.0).abs() < 1e-15, "{i}: {size:e} {speed:e} {t:e}");
                }
            }
            let past = ray(3.0);
            assert!(shapes.iter().all(|s| !s.intersect_p(&past)) && !tube.intersect_p(&past));
        }
    }
}

#[test]
fn one_surface_said_in_two_ways_is_one() {
    let mut seeded = Seeded::new(8);
    let (low, high) = (DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 1.5));
    let at = |r: f64, p: DVec3| DVec3::new(0.6 * r, 0.8 * r, p.z);
    let ball = Sphere::new(DVec3::ZERO, 0.7).unwrap();
    let whole = Quadric::sphere(0.7).unwrap();
    let pairs = [
        (Quadric::cylinder(0.5, low.z, high.z).unwrap(), Frustum::cylinder(low, high, 0.5).unwrap()),
        (
            Quadric::hyperboloid(at(0.5, low), at(0.5, high)).unwrap(),
            Frustum::cylinder(low, high, 0.5).unwrap(),
        ),
        (Quadric::hyperboloid(at(0.5, low), high).unwrap(), Frustum::cone(low, 0.5, high).unwrap()),
        (
            Quadric::hyperboloid(at(0.5, low), at(0.2, high)).unwrap(),
            Frustum::new(high, 0.2, low, 0.5).unwrap(),
        ),
        (Quadric::cone(1.5, 0.5).unwrap(), Frustum::cone(DVec3::ZERO, 0.5, high).unwrap()),
    ];
    let mut hits = 0;
    for _ in 0..5000 {
        let (o, to) = (seeded.direction() * 3.0, seeded.inside(DVec3::splat(-0.5), DVec3::splat(0.5)));
        let ray = Ray::new(o, to - o);
        let same = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-13,
            (a, b) => a.is_none() && b.is_none(),
        };
        assert!(same(ball.intersect(&ray).map(|h| h.t), whole.intersect(&ray).map(|h| h.t)));
        for (round, frustum) in &pairs {
            let (a, b) = (round.intersect(&ray).map(|h| h.t), frustum.intersect(&ray).map(|h| h.t));
            assert!(same(a, b), "{round:?} {ray:?} {a:?} {b:?}");
            assert_eq!(a.is_some(), round.intersect(&narrow(&ray)).is_some());
            hits += a.is_some() as u32;
        }
    }
    assert!(hits > 5000);
}

/// The two spheres describe each hit alike, wherever and however large they are, poles and seam included.
#[test]
fn both_spheres_have_the_same_parameters() {
    let mut seeded = Seeded::new(14);
    let mut hits = 0;
    for case in 0..4000 {
        let radius = 10f64.powf(seeded.between(-6.0, 6.0));
        let (ball, whole) = (Sphere::new(DVec3::ZERO, radius).unwrap(), Quadric::sphere(radius).unwrap());
        let target = match case % 8 {
            // The poles, the seam on either side, the equator.
            0 => DVec3::Z,
            1 => DVec3::NEG_Z,
            2 => DVec3::new(0.6, 0.0, 0.8),
            3 => DVec3::new(0.6, -1e-14, 0.8),
            4 => DVec3::new(0.6, -0.8, 0.0),
            5 => DVec3::new(1e-12, -2e-12, 1.0),
            _ => seeded.direction(),
        };
        let out = if case % 3 == 0 { target } else { seeded.direction() };
        let out = if out.dot(target) < 0.0 { -out } else { out };
        let ray = Ray::new((target + out * 3.0) * radius, -out * radius);
        let (Some(a), Some(b)) = (ball.intersect(&ray), whole.intersect(&ray)) else { continue };
        hits += 1;
        let (s, q) = (ball.surface(&ray, &a), whole.surface(&ray, &b));
        let (p, r) = (ball.partials(&ray, &a), whole.partials(&ray, &b));
        // Beside the axis angles are as uncertain as the point over its distance from it.
        let rho = s.normal.truncate().length();
        let turn = 1e-14 / rho.max(1e-14);
        let du = (s.uv.x - q.uv.x).abs();
        assert!((0.0..=1.0).contains(&s.uv.x) && (0.0..=1.0).contains(&s.uv.y), "{ray:?} {s:?}");
        assert!(du.min(1.0 - du) <= turn.min(0.5) && (s.uv.y - q.uv.y).abs() < 1e-14, "{ray:?} {s:?} {q:?}");
        let close = |a: DVec3, b: DVec3, size: f64| (a - b).length() <= 1e-13 * size;
        let bent = |a: DVec3, b: DVec3, size: f64| (a - b).length() <= (1e-13 + 8.0 * turn) * size;
        assert!(close(s.point, q.point, radius) && close(s.normal, q.normal, 1.0), "{ray:?} {s:?} {q:?}");
        assert!(close(p.dpdu, r.dpdu, radius) && bent(p.dpdv, r.dpdv, radius), "{ray:?} {p:?} {r:?}");
        assert!(close(p.dndu, r.dndu, 1.0) && bent(p.dndv, r.dndv, 1.0), "{ray:?} {p:?} {r:?}");
        // Both say what they mean: counter-clockwise and upward, which is dpdu x dpdv outward.
        assert!(rho < 1e-9 || p.dpdu.cross(p.dpdv).dot(s.normal) > 0.0, "{ray:?} {p:?}");
        assert!(p.dpdv.z >= 0.0 && p.dndv.length() > 3.0, "{ray:?} {p:?}");
    }
    assert!(hits > 3000);
}

fn narrow(ray: &Ray<f64>) -> Ray<f32> {
    Ray::new(ray.origin.as_vec3a(), ray.dir.as_vec3a())
}

/// The distance for `f32` is that for `f64`, rounded, up to the last place.
#[test]
fn both_precisions_agree() {
    let mut seeded = Seeded::new(21);
    let mut hits = 0;
    for _ in 0..20_000 {
        let part = Part::random(&mut seeded, 1.0);
        let (o, d) = ray(&mut seeded, &part);
        let thin = narrow(&Ray::new(o, d));
        let shape = part.shape();
        let (a, b) = (shape.intersect(&thin), shape.intersect(&thin.widen()));
        match (a, b) {
            (Some(a), Some(b)) => {
                hits += 1;
                let t = f32::nearest(b.t);
                assert!(
                    a.t == t || a.t.next_up() == t || a.t.next_down() == t,
                    "{part:?} {thin:?} {a:?} {b:?}"
                );
            }
            (a, b) => assert!(a.is_none() && b.is_none(), "{part:?} {thin:?} {a:?} {b:?}"),
        }
    }
    assert!(hits > 5000);
}

#[test]
fn borders_belong() {
    let ray = |x: f32, y: f32| Ray::new(Vec3A::new(x, y, -5.0), Vec3A::Z);
    let quarter = Disk::ring(0.0, 1.0, 2.0).unwrap().swept(0.0, PI / 2.0).unwrap();
    assert!(quarter.intersect_p(&ray(1.0, 0.0)) && quarter.intersect_p(&ray(2.0, 0.0)));
    assert!(
        !quarter.intersect_p(&ray(1.0f32.next_down(), 0.0))
            && !quarter.intersect_p(&ray(2.0f32.next_up(), 0.0))
    );
    assert!(!quarter.intersect_p(&ray(1.5, -1e-25)) && quarter.intersect_p(&ray(1.5, 1e-25)));
    let dome = Quadric::sphere(2.0).unwrap().cut(0.0, 2.0).unwrap().swept(0.0, PI).unwrap();
    let flat = |y: f64, z: f64| dome.intersect_p(&Ray::new(DVec3::new(-5.0, y, z), DVec3::X));
    assert!(flat(1.0, 0.0) && flat(0.0, 1.0) && !flat(1.0, -1e-25) && !flat(-1e-25, 1.0));
    assert_eq!(dome.heights(), [0.0, 2.0]);
    // Samples go around as u does.
    assert!((dome.sample(DVec2::new(0.25, 0.5)).uv.x - 0.25).abs() < 1e-15);
}

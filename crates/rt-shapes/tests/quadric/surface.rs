//! Records, derivatives, areas and samples, against finite differences and quadrature.

use crate::revolved::{Part, Plan};
use rt_accel::{Hit, Instance, Primitive};
use rt_geom::glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use rt_geom::{Ray, Transform};
use rt_measure::rays::Seeded;
use rt_shapes::{Disk, Frustum, Partials, Quadric, Shape, Surface, Uv};
use std::f64::consts::{PI, TAU};

/// The surface and its derivatives where `at` lies, asked from outside along the normal.
fn ask<S: Shape<f64, At = Uv>>(shape: &S, at: &Surface) -> Option<(Surface, Partials)> {
    let ray = Ray::new(at.point + at.normal * 0.01, -at.normal);
    let hit = shape.intersect(&ray).filter(|hit| (hit.t - 0.01).abs() < 1e-6)?;
    Some((shape.surface(&ray, &hit), shape.partials(&ray, &hit)))
}

/// `f'` by a difference whose error is of the fourth order.
fn slope(f: impl Fn(f64) -> DVec3) -> DVec3 {
    let h = 1e-3;
    ((f(h) - f(-h)) * 8.0 - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

/// The surface as the reference has it: `p(u, v)`.
fn reference(part: &Part, u: f64, v: f64) -> DVec3 {
    let [low, high] = part.z;
    let z = match part.plan {
        Plan::Sphere(r) => {
            let [a, b] = [low, high].map(|z| (z / r).acos());
            r * (a + (b - a) * v).cos()
        }
        _ => low + (high - low) * v,
    };
    let [from, to] = part.sweep.unwrap_or([0.0, TAU]);
    part.point(z, from + (to - from) * u)
}

/// Compares with differences of the reference, through `map`; `side` is 1 or -1 with the normal along `dpdu x dpdv` or against.
fn compare(
    shape: &impl Shape<f64, At = Uv>,
    at: &Surface,
    p: impl Fn(f64, f64) -> DVec3,
    what: &str,
) -> bool {
    let Some((surface, partials)) = ask(shape, at) else { return false };
    let DVec2 { x: u, y: v } = surface.uv;
    if !(0.02..0.98).contains(&u) || !(0.02..0.98).contains(&v) {
        return false;
    }
    let dpdu = |u: f64, v: f64| slope(|h| p(u + h, v));
    let dpdv = |u: f64, v: f64| slope(|h| p(u, v + h));
    let cross = dpdu(u, v).cross(dpdv(u, v));
    let side = cross.dot(surface.normal).signum();
    let normal = |u: f64, v: f64| dpdu(u, v).cross(dpdv(u, v)).normalize() * side;
    let size = dpdu(u, v).length().max(dpdv(u, v).length());
    let close = |a: DVec3, b: DVec3, size: f64| (a - b).length() <= 1e-6 * size;
    let bend = |x: DVec3| x.length().max(1.0);
    let (nu, nv) = (slope(|h| normal(u + h, v)), slope(|h| normal(u, v + h)));
    assert!(close(surface.point, p(u, v), size), "point of {what}: {surface:?} {}", p(u, v));
    assert!(close(surface.normal, normal(u, v), 1.0), "normal of {what}");
    assert!(close(partials.dpdu, dpdu(u, v), dpdu(u, v).length()), "dpdu of {what}");
    assert!(close(partials.dpdv, dpdv(u, v), dpdv(u, v).length()), "dpdv of {what}");
    assert!(close(partials.dndu, nu, bend(nu)), "dndu of {what}: {} {nu}", partials.dndu);
    assert!(close(partials.dndv, nv, bend(nv)), "dndv of {what}: {} {nv}", partials.dndv);
    true
}

fn squeezed(seeded: &mut Seeded) -> Transform {
    let turn = DMat3::from_quat(DQuat::from_axis_angle(seeded.direction(), 1.3));
    let squeeze = DMat3::from_diagonal(DVec3::new(1.3, -0.7, 0.9));
    Transform::new(DAffine3 { matrix3: turn * squeeze * turn, translation: DVec3::new(3.0, 4.0, 5.0) })
        .unwrap()
}

#[test]
fn derivatives_are_those_of_the_reference() {
    let mut seeded = Seeded::new(12);
    let mut compared = 0;
    for _ in 0..3000 {
        let part = Part::random(&mut seeded, 1.0);
        let [low, high] = part.z;
        let narrow = |z: f64| part.point(z, 0.0).truncate().length() < 0.02;
        // Away from poles, tips and waists, where steps of differences are too long.
        if narrow(low) || narrow(high) || narrow(0.5 * (low + high)) || !(0.05..5.0).contains(&(high - low)) {
            continue;
        }
        let shape = part.shape();
        let at = shape.sample(DVec2::new(seeded.unit(), seeded.unit()));
        let what = format!("{part:?}");
        compared += compare(&shape, &at, |u, v| reference(&part, u, v), &what) as u32;
        let map = squeezed(&mut seeded);
        let moved = Instance::new(shape, map);
        let at = Surface { point: map.point(at.point), normal: map.normal(at.normal).normalize(), ..at };
        compared +=
            compare(&moved, &at, |u, v| map.point(reference(&part, u, v)), &format!("moved {part:?}")) as u32;
    }
    assert!(compared > 1000, "{compared}");
    let (a, b) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 0.0, 4.0));
    let frustum = Frustum::new(a, 0.5, b, 1.5).unwrap();
    // Around its axis from where u is 0, found by asking.
    let axis = (b - a).normalize();
    let (x, y) = axis.any_orthonormal_pair();
    let p = |u: f64, v: f64| {
        let (s, c) = (TAU * u).sin_cos();
        a + (b - a) * v + (x * c + y * s) * (0.5 + v)
    };
    let ring = Disk::ring(2.0, 0.5, 1.5).unwrap().swept(-1.0, 2.0).unwrap();
    let flat = |u: f64, v: f64| {
        let (s, c) = (3.0 * u - 1.0).sin_cos();
        DVec3::new(c * (1.5 - v), s * (1.5 - v), 2.0)
    };
    for _ in 0..100 {
        let xi = DVec2::new(seeded.between(0.1, 0.9), seeded.between(0.1, 0.9));
        assert!(compare(&frustum, &frustum.sample(xi), p, "frustum"));
        assert!(compare(&ring, &ring.sample(xi), flat, "ring"));
    }
}

/// Gaussian and mean curvature from the derivatives: the normal's change is the second fundamental form.
fn curvature(shape: &impl Shape<f64, At = Uv>, at: &Surface) -> [f64; 2] {
    let (_, Partials { dpdu, dpdv, dndu, dndv }) = ask(shape, at).unwrap();
    let (ee, ff, gg) = (dpdu.dot(dpdu), dpdu.dot(dpdv), dpdv.dot(dpdv));
    let (e, f, g) = (-dndu.dot(dpdu), -dndu.dot(dpdv), -dndv.dot(dpdv));
    let area = ee * gg - ff * ff;
    [(e * g - f * f) / area, (e * gg - 2.0 * f * ff + g * ee) / (2.0 * area)]
}

#[test]
fn curvatures_are_the_known_ones() {
    let xi = DVec2::new(0.3, 0.6);
    let at = |shape: Quadric| curvature(&shape, &shape.sample(xi));
    let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-9 && (b.abs() - d).abs() < 1e-9;
    assert!(near(at(Quadric::sphere(2.0).unwrap()), [0.25, 0.5]));
    assert!(near(at(Quadric::cylinder(2.0, 0.0, 1.0).unwrap()), [0.0, 0.25]));
    assert!(at(Quadric::cone(2.0, 1.0).unwrap())[0].abs() < 1e-12);
    // At the waist of x^2 + y^2 = 1 + z^2 the principal curvatures are 1 and -1.
    let waist = Quadric::hyperboloid(DVec3::new(1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1.0)).unwrap();
    let middle = waist.sample(DVec2::new(0.3, 0.5));
    assert!(middle.point.z.abs() < 1e-12 && near(curvature(&waist, &middle), [-1.0, 0.0]));
    // K = 4 c^2 / (1 + 4 c z)^2 with z = c rho^2.
    let bowl = Quadric::paraboloid(1.0, 0.0, 2.0).unwrap();
    let spot = bowl.sample(xi);
    let expected = 16.0 / (1.0f64 + 8.0 * spot.point.z).powi(2);
    assert!((curvature(&bowl, &spot)[0] - expected).abs() < 1e-9);
    let disk = Disk::new(0.0, 1.0).unwrap();
    assert_eq!(curvature(&disk, &disk.sample(xi)), [0.0, 0.0]);
    let tube = Frustum::cylinder(DVec3::ZERO, DVec3::ONE, 0.5).unwrap();
    assert!(near(curvature(&tube, &tube.sample(xi)), [0.0, 1.0]));
}

#[test]
fn areas_agree_with_quadrature() {
    let mut seeded = Seeded::new(6);
    for _ in 0..300 {
        let part = Part::random(&mut seeded, 1.0);
        let [from, to] = part.sweep.unwrap_or([0.0, TAU]);
        let [low, high] = part.z;
        // Substituted so that vertical tangents at poles and vertices are no trouble: z in (1 - cos)^2 steps at both ends.
        let steps = 4000;
        let z = |x: f64| low + (high - low) * (x * x * x * (x * (6.0 * x - 15.0) + 10.0));
        let mut sum = 0.0;
        for i in 0..steps {
            let [a, b] = [i, i + 1].map(|i| z(i as f64 / steps as f64));
            // A narrow strip about the axis is the side of a cone: for twisted rulings by the meridian's radius.
            let [ra, rb] = [a, b].map(|z| part.point(z, 0.0).truncate().length());
            sum += 0.5 * (ra + rb) * (b - a).hypot(rb - ra);
        }
        let (area, expected) = (part.shape().area(), (to - from) * sum);
        assert!((area / expected - 1.0).abs() < 1e-5, "{part:?}: {area} {expected}");
    }
    // Known values: a paraboloid, a cone, a sphere's zone.
    let near = |shape: Quadric, area: f64| assert!((shape.area() / area - 1.0).abs() < 1e-14, "{shape:?}");
    near(Quadric::paraboloid(1.0, 0.0, 1.0).unwrap(), TAU / 12.0 * (5f64.powf(1.5) - 1.0));
    near(Quadric::cone(4.0, 3.0).unwrap(), 15.0 * PI);
    near(Quadric::sphere(2.0).unwrap().cut(-1.0, 0.5).unwrap(), 6.0 * PI);
    // A cone and a cylinder as hyperboloids.
    near(Quadric::hyperboloid(DVec3::new(3.0, 0.0, 0.0), DVec3::Z * 4.0).unwrap(), 15.0 * PI);
    near(Quadric::hyperboloid(DVec3::X, DVec3::new(1.0, 0.0, 2.0)).unwrap(), 4.0 * PI);
    near(Quadric::hyperboloid(DVec3::X, DVec3::new(1.0, 1e-9, 2.0)).unwrap(), 4.0 * PI);
    assert!((Frustum::new(DVec3::ZERO, 3.0, DVec3::Z * 4.0, 0.0).unwrap().area() - 15.0 * PI).abs() < 1e-12);
}

#[test]
fn samples_are_uniform_by_area() {
    let shapes = [
        Quadric::sphere(1.5).unwrap().cut(-0.5, 1.2).unwrap(),
        Quadric::cone(2.0, 1.0).unwrap(),
        Quadric::paraboloid(1.0, 0.2, 3.0).unwrap(),
        Quadric::hyperboloid(DVec3::new(1.0, 0.2, 0.0), DVec3::new(-0.6, 1.2, 2.0)).unwrap(),
        Quadric::cylinder(1.0, -1.0, 3.0).unwrap().swept(1.0, 4.0).unwrap(),
    ];
    let mut seeded = Seeded::new(77);
    let bins = 20;
    for shape in shapes {
        let [low, high] = shape.heights();
        let edges: Vec<f64> = (0..=bins).map(|i| low + (high - low) * i as f64 / bins as f64).collect();
        let mut counts = vec![0.0; bins];
        let count = 20_000;
        for _ in 0..count {
            let at = shape.sample(DVec2::new(seeded.unit(), seeded.unit()));
            let bin = edges.partition_point(|&z| z <= at.point.z).clamp(1, bins) - 1;
            counts[bin] += 1.0;
        }
        let mut chi = 0.0;
        for i in 0..bins {
            let strip = shape.clone().cut(edges[i], edges[i + 1]).unwrap();
            // A cut leaves the whole turn's share as it was.
            let expected = count as f64 * strip.area() / shape.area();
            chi += (counts[i] - expected) * (counts[i] - expected) / expected;
        }
        // 19 degrees of freedom: above 50 once in 7000.
        assert!(chi < 50.0, "{shape:?}: {chi}");
    }
    // Around and along: moments of the disk and of a frustum.
    let (disk, frustum) =
        (Disk::ring(0.0, 1.0, 2.0).unwrap(), Frustum::new(DVec3::ZERO, 1.0, DVec3::Z, 3.0).unwrap());
    let (mut square, mut height) = (0.0, 0.0);
    let count = 20_000;
    for _ in 0..count {
        let xi = DVec2::new(seeded.unit(), seeded.unit());
        square += disk.sample(xi).point.length_squared() / count as f64;
        height += frustum.sample(xi).point.z / count as f64;
    }
    assert!((square - 2.5).abs() < 0.03, "{square}");
    assert!((height - 7.0 / 12.0).abs() < 0.01, "{height}");
}

#[test]
fn any_numbers_pick_a_point() {
    let (ring, cone) =
        (Disk::ring(0.0, 1.0, 2.0).unwrap(), Frustum::cone(DVec3::ZERO, 1.0, DVec3::Z).unwrap());
    let half = Quadric::sphere(1.0).unwrap().swept(0.0, PI).unwrap();
    for wild in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -2.0, 7.0, 0.0, 1.0] {
        for xi in [DVec2::new(wild, 0.5), DVec2::new(0.25, wild), DVec2::splat(wild)] {
            let [x, y] = [xi.x, xi.y].map(|x| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) });
            let inside = DVec2::new(x, y);
            let (a, b, c) = (ring.sample(xi), cone.sample(xi), half.sample(xi));
            assert_eq!((a, b, c), (ring.sample(inside), cone.sample(inside), half.sample(inside)));
            assert!(a.point.is_finite() && b.point.is_finite() && c.point.y >= -1e-15, "{xi} {c:?}");
        }
    }
}

#[test]
fn a_mirrored_surface_faces_outward_still() {
    let map = Transform::scale(DVec3::new(-1.0, 1.0, 2.0)).unwrap();
    let ball = Instance::new(Quadric::sphere(1.0).unwrap(), map);
    let ray = Ray::new(DVec3::new(5.0, 0.3, 0.7), DVec3::NEG_X);
    let hit: Hit<Uv, f64> = ball.intersect(&ray).unwrap();
    let surface = ball.surface(&ray, &hit);
    let expected = (surface.point * DVec3::new(1.0, 1.0, 0.25)).normalize();
    assert!((surface.normal - expected).length() < 1e-14 && surface.normal.x > 0.0);
}

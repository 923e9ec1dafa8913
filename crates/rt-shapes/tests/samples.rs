//! Areas of spheres and polygons, and points spread evenly over them.

use rt_accel::Primitive;
use rt_geom::Ray;
use rt_geom::glam::{DVec2, DVec3};
use rt_measure::rays::Seeded;
use rt_shapes::{Polygon, PolygonError, Quadric, Shape, Sphere};
use std::f64::consts::{PI, TAU};

const COUNT: usize = 64_000;

/// Chi-square of bins that expect as much each.
fn chi_square(counts: &[usize]) -> f64 {
    let expected = COUNT as f64 / counts.len() as f64;
    counts.iter().map(|&n| (n as f64 - expected).powi(2) / expected).sum()
}

fn bin(share: f64, of: usize) -> usize {
    ((share * of as f64) as usize).min(of - 1)
}

#[test]
fn points_of_a_sphere_are_uniform_by_area() {
    let mut seeded = Seeded::new(5);
    for (center, radius) in [(DVec3::ZERO, 1.0), (DVec3::new(100.0, -3.0, 0.1), 0.01), (DVec3::ONE, 1e30)] {
        let ball = Sphere::new(center, radius).unwrap();
        assert!((ball.area() / (4.0 * PI * radius * radius) - 1.0).abs() < 1e-15);
        let mut counts = [0; 64];
        for _ in 0..COUNT {
            let xi = DVec2::new(seeded.unit(), seeded.unit());
            let at = ball.sample(xi);
            let out = (at.point - center) / radius;
            assert!((out.length() - 1.0).abs() * radius <= at.error.length(), "{at:?}");
            assert!((at.normal.length() - 1.0).abs() < 1e-15 && at.normal == at.shading);
            // Zones of one height have one area.
            counts[8 * bin(0.5 + 0.5 * at.normal.z, 8) + bin(at.uv.x, 8)] += 1;
            // What a ray from outside finds there.
            let ray = Ray::new(center + at.normal * (3.0 * radius), -at.normal);
            let met = Shape::<f64>::surface(&ball, &ray, &ball.intersect(&ray).unwrap());
            let rounding = 1e-14 * (1.0 + center.length() / radius);
            assert!((met.normal - at.normal).length() < rounding && (met.uv.y - at.uv.y).abs() < rounding);
        }
        // 63 degrees of freedom: above 120 once in 50000.
        assert!(chi_square(&counts) < 120.0, "{counts:?}");
    }
    // As the quadric's, which counts the same way.
    let (ball, quadric) = (Sphere::new(DVec3::ZERO, 2.0).unwrap(), Quadric::sphere(2.0).unwrap());
    for _ in 0..1000 {
        let xi = DVec2::new(seeded.unit(), seeded.unit());
        let (a, b) = (ball.sample(xi), quadric.sample(xi));
        assert!((a.point - b.point).length() < 1e-14 && (a.uv - b.uv).length() < 1e-7, "{a:?} {b:?}");
    }
    assert!((ball.area() / quadric.area() - 1.0).abs() < 1e-15);
}

/// A star in a plane of any slant: its wedges, from the middle to one side each, have one area.
fn star(points: usize, map: impl Fn(DVec2) -> DVec3) -> Vec<DVec3> {
    let corner = |i| DVec2::from_angle(PI * i as f64 / points as f64) * if i % 2 == 0 { 2.0 } else { 1.0 };
    (0..2 * points).map(corner).map(map).collect()
}

#[test]
fn points_of_a_polygon_are_uniform_by_area() {
    const POINTS: usize = 8;
    let mut seeded = Seeded::new(6);
    for scale in [1.0, 1e-150, 1e-30, 1e150] {
        let (x, y) = (DVec3::new(0.6, 0.0, 0.8) * scale, DVec3::new(0.0, 1.0, 0.0) * scale);
        let far = DVec3::new(3.0, -5.0, 7.0) * scale;
        let polygon = Polygon::new(&star(POINTS, |p| far + x * p.x + y * p.y)).unwrap();
        let wedge = PI / POINTS as f64;
        let area = 2.0 * POINTS as f64 * wedge.sin() * scale * scale;
        assert!((polygon.area() / area - 1.0).abs() < 1e-14, "{}", polygon.area());
        let mut counts = [0; 8 * POINTS];
        for _ in 0..COUNT {
            let at = polygon.sample(DVec2::new(seeded.unit(), seeded.unit()));
            let out = (at.point - far) / scale;
            // Corners are off the plane themselves: by four roundings of up to 10 in each component.
            let plane = (x / scale).cross(y / scale);
            assert!(out.dot(plane).abs() <= at.error.length() / scale + 40.0 * f64::EPSILON, "{at:?}");
            assert!((at.normal - polygon.normal()).length() < 1e-14);
            let p = DVec2::new(out.dot(x / scale), out.dot(y / scale));
            let turn = p.to_angle().rem_euclid(TAU) / wedge;
            // Within a wedge: the share of the way to the side, whose square area is even by.
            let (i, within) = (bin(turn / (2 * POINTS) as f64, 2 * POINTS), turn.fract() * wedge);
            let (r0, r1) = if i % 2 == 0 { (2.0, 1.0) } else { (1.0, 2.0) };
            let side = r0 * r1 * wedge.sin() / (r0 * within.sin() + r1 * (wedge - within).sin());
            let share = p.length() / side;
            assert!(share < 1.0 + 1e-14, "{p} is outside");
            counts[4 * i + bin(share * share, 4)] += 1;
        }
        // 63 degrees of freedom: above 120 once in 50000.
        assert!(chi_square(&counts) < 120.0, "{scale:e} {counts:?}");
    }
}

#[test]
fn any_numbers_pick_a_point() {
    let ball = Sphere::new(DVec3::ONE, 1.0).unwrap();
    let arrow = [(0.0, 0.0), (2.0, -1.0), (0.0, 3.0), (-2.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
    let polygon = Polygon::new(&arrow).unwrap();
    for wild in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -2.0, -0.0, 7.0, 0.0, 1.0] {
        for xi in [DVec2::new(wild, 0.5), DVec2::new(0.25, wild), DVec2::splat(wild)] {
            let [x, y] = [xi.x, xi.y].map(|x| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) });
            let inside = DVec2::new(x, y);
            assert_eq!((ball.sample(xi), polygon.sample(xi)), (ball.sample(inside), polygon.sample(inside)));
            let [a, b] = [ball.sample(xi), polygon.sample(xi)];
            assert!(a.point.is_finite() && a.uv.is_finite() && b.point.is_finite() && b.uv.is_finite());
        }
    }
    // What is too small or too large for its area is sampled all the same.
    for scale in [1e-200, 1e200] {
        let polygon = Polygon::new(&arrow.map(|p| p * scale)).unwrap();
        assert_eq!(polygon.area(), if scale < 1.0 { 0.0 } else { f64::INFINITY });
        let p = polygon.sample(DVec2::new(0.3, 0.7)).point / scale;
        assert!((p.z - 1.0).abs() < 1e-15 && (-2.0..2.0).contains(&p.x) && (-1.0..3.0).contains(&p.y), "{p}");
    }
    assert_eq!(Polygon::new(&[DVec3::ONE; 5]), Err(PolygonError::NoArea));
}

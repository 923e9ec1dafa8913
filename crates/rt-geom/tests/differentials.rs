//! Ray differentials against unfolded mirrors and against differences of traced rays.

use rt_geom::glam::DVec3;
use rt_geom::{Ray, RayDifferential, Transform};
use rt_measure::rays::Seeded;

/// A camera at zero; image points are in units of pixels.
fn primary(x: f64, y: f64) -> Ray<f64> {
    Ray::new(DVec3::ZERO, DVec3::new(0.1 + x * 1e-3, -0.2 + y * 1e-3, 1.0))
}

fn differential() -> RayDifferential {
    RayDifferential { origin: [DVec3::ZERO; 2], dir: [DVec3::X * 1e-3, DVec3::Y * 1e-3] }
}

#[test]
fn differences_of_a_linear_camera_are_its_derivatives() {
    let d = RayDifferential::between(&primary(0.0, 0.0), &primary(1.0, 0.0), &primary(0.0, 1.0));
    for i in 0..2 {
        assert!((d.dir[i] - differential().dir[i]).length() < 1e-16 && d.origin[i] == DVec3::ZERO);
    }
    assert_eq!(differential().scaled(0.5).dir[0], DVec3::X * 5e-4);
}

#[test]
fn a_plane_mirror_shows_the_unfolded_camera() {
    // Mirrors along the axes, and dyadic numbers: nothing rounds, so equal means equal.
    let ray = Ray::new(DVec3::new(0.5, 0.25, 0.0), DVec3::new(0.5, 0.25, 1.0));
    let d =
        RayDifferential { origin: [DVec3::X * 0.125, DVec3::ZERO], dir: [DVec3::X * 0.25, DVec3::Y * 0.5] };
    for (normal, offset) in [(DVec3::Z, 2.0), (-DVec3::Z, -2.0), (DVec3::X, 1.5), (-DVec3::Y, -0.75)] {
        let t = (offset - normal.dot(ray.origin)) / normal.dot(ray.dir);
        let at = d.footprint(&ray, t, normal).unwrap();
        let (dir, mirrored) = d.reflected(ray.dir, &at, normal, [DVec3::ZERO; 2]);
        // The camera behind the mirror, which looks through it.
        let mirror = Transform::scale(DVec3::ONE - 2.0 * normal.abs()).unwrap();
        let mirror = mirror.then(&Transform::translation(normal * (2.0 * offset))).unwrap();
        let (unfolded, expected) = (mirror.ray(&ray), d.transformed(&mirror));
        assert_eq!((dir, mirrored.dir), (unfolded.dir, expected.dir));
        assert_eq!(at, expected.footprint(&unfolded, t, normal).unwrap());
        // And on the next surface.
        let (wall, s) = (DVec3::Z * -2.0, 3.0);
        let next = Ray::new(unfolded.at(t), dir);
        assert_eq!(mirrored.footprint(&next, s, wall), expected.footprint(&unfolded, t + s, wall));
    }
    // Mirrors at any angle, within rounding.
    let mut seeded = Seeded::new(31);
    for _ in 0..1000 {
        let (ray, d) = (primary(0.0, 0.0), differential());
        let normal = seeded.direction();
        if normal.dot(ray.dir).abs() < 1e-2 {
            continue;
        }
        let t = seeded.between(0.5, 3.0);
        let at = d.footprint(&ray, t, normal).unwrap();
        let (_, mirrored) = d.reflected(ray.dir, &at, normal, [DVec3::ZERO; 2]);
        for i in 0..2 {
            let image = d.dir[i] - normal * (2.0 * d.dir[i].dot(normal));
            assert!((mirrored.dir[i] - image).length() < 1e-18);
        }
    }
}

/// A ball, and what a ray of the camera does there: point and direction after, reflected or refracted.
fn traced(ray: &Ray<f64>, center: DVec3, index: Option<f64>) -> Option<(DVec3, DVec3)> {
    let (o, d) = (ray.origin - center, ray.dir);
    let b = o.dot(d);
    let disc = b * b - d.length_squared() * (o.length_squared() - 1.0);
    let t = (-b - disc.sqrt()) / d.length_squared();
    let p = ray.at(t);
    let n = p - center;
    let after = match index {
        None => d - n * (2.0 * d.dot(n)),
        Some(index) => {
            let d = d.normalize();
            let (cos, k) = (-d.dot(n), 1.0 - index * index * (1.0 - d.dot(n).powi(2)));
            d * index + n * (index * cos - k.sqrt())
        }
    };
    (disc > 0.0).then_some((p, after))
}

#[test]
fn a_ball_agrees_with_differences_of_traced_rays() {
    let mut seeded = Seeded::new(32);
    let mut tried = 0;
    while tried < 500 {
        let center =
            DVec3::new(seeded.between(-0.6, 0.9), seeded.between(-1.1, 0.5), seeded.between(2.5, 5.0));
        for index in [None, Some(1.0 / 1.5), Some(1.2)] {
            // A small step of the pixel, both ways: errors go with its square.
            let h = 1e-2;
            let rays = [[-h, 0.0], [h, 0.0], [0.0, -h], [0.0, h]].map(|[x, y]| primary(x, y));
            let ray = primary(0.0, 0.0);
            let Some((p, after)) = traced(&ray, center, index) else { continue };
            let n = p - center;
            let slant = -ray.dir.dot(n);
            // Away from the outline and from total reflection, where derivatives go to infinity.
            if !after.is_finite() || slant < 0.2 || after.normalize().dot(n).abs() < 0.2 {
                continue;
            }
            let neighbours = rays.map(|r| traced(&r, center, index).unwrap());
            let d = differential();
            let t = (p - ray.origin).dot(ray.dir) / ray.dir.length_squared();
            let at = d.footprint(&ray, t, n).unwrap();
            // The unit normal of the unit ball turns as the point moves. By way of parameters, which must come to the
            // same.
            let (u, v) = n.any_orthonormal_pair();
            let (u, v) = (u * 2.0, v + u * 0.3);
            let bend = at.parameters(u, v).unwrap().map(|d| u * d.x + v * d.y);
            let (dir, next) = match index {
                None => d.reflected(ray.dir, &at, n, bend),
                Some(index) => d.refracted(ray.dir, &at, n, bend, index).unwrap(),
            };
            assert!((dir - after).length() < 1e-14);
            for i in 0..2 {
                let (a, b) = (neighbours[2 * i], neighbours[2 * i + 1]);
                let (point, turned) = ((b.0 - a.0) / (2.0 * h), (b.1 - a.1) / (2.0 * h));
                assert!(
                    (next.origin[i] - point).length() < 1e-6 * point.length(),
                    "{} {point}",
                    next.origin[i]
                );
                assert!(
                    (next.dir[i] - turned).length() < 1e-6 * turned.length().max(1e-3),
                    "{} {turned}",
                    next.dir[i]
                );
            }
            tried += 1;
        }
    }
}

#[test]
fn the_side_of_the_normal_does_not_matter() {
    let (ray, d, n) = (primary(0.0, 0.0), differential(), DVec3::new(0.6, 0.0, -0.8));
    let at = d.footprint(&ray, 2.0, n).unwrap();
    assert_eq!(d.footprint(&ray, 2.0, -n), Some(at));
    let bend = [DVec3::new(0.8, 0.0, 0.6) * 0.01, DVec3::Y * 0.02];
    let back = bend.map(|v| -v);
    assert_eq!(d.reflected(ray.dir, &at, n, bend), d.reflected(ray.dir, &at, -n, back));
    assert_eq!(d.refracted(ray.dir, &at, n, bend, 0.7), d.refracted(ray.dir, &at, -n, back, 0.7));
}

#[test]
fn what_is_not_known_is_none() {
    let (ray, d) = (primary(0.0, 0.0), differential());
    let grazing = ray.dir.cross(DVec3::X);
    assert!(d.footprint(&ray, 1.0, grazing * 0.0).is_none());
    assert!(d.footprint(&Ray::new(DVec3::ZERO, DVec3::Z), 1.0, DVec3::X).is_none());
    let at = d.footprint(&ray, 1.0, DVec3::Z).unwrap();
    assert!(
        at.parameters(DVec3::X, DVec3::X * 2.0).is_none() && at.parameters(DVec3::ZERO, DVec3::Y).is_none()
    );
    // Total reflection, from glass at a steep angle.
    assert!(d.refracted(DVec3::new(0.9, 0.0, 0.1), &at, DVec3::Z, [DVec3::ZERO; 2], 1.5).is_none());
    assert!(d.refracted(DVec3::ZERO, &at, DVec3::Z, [DVec3::ZERO; 2], 1.5).is_none());
}

//! Boxes against cones and beams: what meets is never missed, and what is said to meet does.
//!
//! `RT_CASES=100` asks a hundred times as many.

#![allow(clippy::print_stdout)] // Figures, for `--nocapture`.

use rt_bounds::{Aabb, BeamTest, ConeTest};
use rt_geom::glam::{DMat3, DQuat, DVec3, Vec3A};
use rt_geom::{Beam, Cone, ConeError, Ray};
use rt_measure::rays::Seeded;
use std::f64::consts::{FRAC_PI_2, PI};

fn cases(usual: usize) -> usize {
    usual * std::env::var("RT_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

/// The least value over a box of a convex function, by nested ternary searches: slow, and sharing nothing with what it
/// judges.
fn least(lo: DVec3, hi: DVec3, f: &dyn Fn(DVec3) -> f64) -> f64 {
    fn search(axis: usize, p: DVec3, lo: DVec3, hi: DVec3, f: &dyn Fn(DVec3) -> f64) -> f64 {
        if axis == 3 {
            return f(p);
        }
        let at = |x: f64| {
            let mut q = p;
            q[axis] = x;
            search(axis + 1, q, lo, hi, f)
        };
        let (mut a, mut b) = (lo[axis], hi[axis]);
        let mut best = at(a).min(at(b));
        for _ in 0..22 {
            let (x, y) = (a + (b - a) * 0.45, a + (b - a) * 0.55);
            let (fx, fy) = (at(x), at(y));
            best = best.min(fx).min(fy);
            if fx < fy { b = y } else { a = x }
        }
        best
    }
    search(0, lo, lo, hi, f)
}

/// A box whose outside is about as far from `near` as it is large, so that it is close which it is.
fn box_near(seeded: &mut Seeded, near: DVec3) -> Aabb {
    let b = any_box(seeded);
    let to = near + b.size().as_dvec3() * seeded.inside(DVec3::splat(-0.8), DVec3::splat(0.8))
        - b.center().as_dvec3();
    Aabb::new((b.min.as_dvec3() + to).as_vec3a(), (b.max.as_dvec3() + to).as_vec3a())
}

fn any_box(seeded: &mut Seeded) -> Aabb {
    let center = seeded.inside(DVec3::splat(-3.0), DVec3::splat(3.0));
    let mut half = seeded.inside(DVec3::ZERO, DVec3::ONE);
    // Flat ones, thin ones, points.
    for a in 0..3 {
        if seeded.below(5) == 0 {
            half[a] = 0.0;
        }
    }
    half *= 10f64.powf(seeded.between(-2.0, 0.3));
    Aabb::new((center - half).as_vec3a(), (center + half).as_vec3a())
}

/// Directions along axes and in planes of axes too.
fn any_direction(seeded: &mut Seeded) -> DVec3 {
    let mut d = seeded.direction();
    for a in 0..3 {
        if seeded.below(4) == 0 {
            d[a] = 0.0;
        }
    }
    if d == DVec3::ZERO { DVec3::Z } else { d }
}

fn any_cone(seeded: &mut Seeded) -> Cone {
    let origin = seeded.inside(DVec3::splat(-1.0), DVec3::ONE);
    let axis = any_direction(seeded);
    let cone = match seeded.below(4) {
        0 => Cone::new(origin, axis, seeded.between(0.0, FRAC_PI_2)).unwrap(),
        1 => {
            Cone::new(origin, axis, [0.0, 1e-9, 0.01, FRAC_PI_2 - 0.01, FRAC_PI_2][seeded.below(5)]).unwrap()
        }
        _ => {
            let radius = [0.0, 1e-3, 0.3][seeded.below(3)];
            Cone::around(&Ray::new(origin, axis), radius, [0.0, 1e-3, 0.2, 1.0, 30.0][seeded.below(5)])
                .unwrap()
        }
    };
    match seeded.below(3) {
        0 => cone,
        1 => cone.between(seeded.between(0.0, 2.0), 4.0),
        _ => cone.between(0.0, seeded.between(0.0, 3.0)),
    }
}

#[test]
fn cones_agree_with_a_search_for_the_least_excess() {
    let mut seeded = Seeded::new(1);
    let (mut met, mut wrong) = (0, 0);
    let n = cases(150);
    for case in 0..n {
        let cone = any_cone(&mut seeded);
        let t = cone.range()[0] + seeded.between(-0.2, 3.0);
        let aside = cone.axis().cross(seeded.direction()).normalize() * cone.radius_at(t).abs().min(3.0);
        let b = box_near(&mut seeded, cone.origin() + cone.axis() * t + aside);
        let (lo, hi) = (b.min.as_dvec3() - cone.origin(), b.max.as_dvec3() - cone.origin());
        let [near, far] = cone.range();
        let (axis, (sin, cos)) = (cone.axis(), cone.sin_cos());
        let excess = |p: DVec3| {
            let t = p.dot(axis);
            // By the cross product, unlike the library.
            let mantle = p.cross(axis).length() * cos - t * sin - cone.radius() * cos;
            mantle.max(near - t).max(t - far)
        };
        let value = least(lo, hi, &excess);
        let said = ConeTest::new(&cone).meets(&b);
        met += said as usize;
        assert!(said || value > -1e-13, "case {case}: missed {cone:?} {b:?} {value:e}");
        // What the search leaves undecided is a few millionths.
        if said && value > 1e-4 {
            wrong += 1;
            println!("case {case}: {cone:?} {b:?} {value:e}");
        }
    }
    println!("cones: {met} of {n} met, {wrong} wrongly");
    assert!(wrong == 0 && met > n / 10 && met < n * 9 / 10, "{met} {wrong}");
}

#[test]
fn boxes_around_points_of_a_cone_are_met() {
    let mut seeded = Seeded::new(2);
    for case in 0..cases(30_000) {
        let cone = any_cone(&mut seeded);
        let [near, far] = cone.range();
        // On the mantle, on the end discs, on the axis.
        let t = [near, far.min(5.0), seeded.between(near.max(0.0), far.min(5.0))][seeded.below(3)].max(0.0);
        let aside = cone.axis().cross(seeded.direction()).normalize();
        let radius = cone.radius_at(t).min(5.0) * [0.0, 1.0 - 1e-7, seeded.unit()][seeded.below(3)];
        let p = cone.origin() + cone.axis() * t + aside * radius;
        if !p.is_finite() {
            continue;
        }
        // The point rounds to f32 outward: it lies in the box, at a corner, an edge or a face of it, as may be.
        let around = Aabb::from_f64(p, p, DVec3::ZERO);
        let mut b = around;
        for a in 0..3 {
            match seeded.below(3) {
                0 => b.min[a] -= seeded.unit() as f32,
                1 => b.max[a] += seeded.unit() as f32,
                _ => {}
            }
        }
        assert!(ConeTest::new(&cone).meets(&b), "case {case}: {cone:?} {p} {b:?}");
    }
}

#[test]
fn wide_cones_miss_only_what_is_inside_the_opposite_cone() {
    let mut seeded = Seeded::new(3);
    for _ in 0..cases(20_000) {
        let origin = seeded.inside(DVec3::splat(-1.0), DVec3::ONE);
        let (axis, angle) = (any_direction(&mut seeded).normalize(), seeded.between(FRAC_PI_2, PI));
        let cone = Cone::new(origin, axis, angle).unwrap();
        let b = any_box(&mut seeded);
        // The opposite cone is convex: a box is in it if its corners are.
        let depth = |p: Vec3A| {
            let v = p.as_dvec3() - origin;
            -v.dot(axis) * angle.sin() - v.cross(axis).length() * -angle.cos()
        };
        let shallowest = b.corners().into_iter().map(depth).fold(f64::INFINITY, f64::min);
        let said = ConeTest::new(&cone).meets(&b);
        if shallowest.abs() > 1e-12 {
            assert_eq!(said, shallowest < 0.0, "{cone:?} {b:?} {shallowest:e}");
        }
    }
}

#[test]
fn degenerate_cones_and_boxes() {
    let unit = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
    let ray = ConeTest::new(&Cone::new(DVec3::new(-5.0, 1.0, 1.0), DVec3::X, 0.0).unwrap());
    assert!(ray.meets(&unit)); // along an edge
    let beside = Cone::new(DVec3::new(-5.0, 1.0f64.next_up() + 1e-9, 1.0), DVec3::X, 0.0).unwrap();
    assert!(!ConeTest::new(&beside).meets(&unit));
    let away = ConeTest::new(&Cone::new(DVec3::new(-5.0, 0.0, 0.0), -DVec3::X, 0.0).unwrap());
    assert!(!away.meets(&unit));
    assert!(ConeTest::new(&Cone::new(DVec3::ZERO, DVec3::Z, 0.0).unwrap().between(0.2, 0.3)).meets(&unit)); // inside
    assert!(!ConeTest::new(&Cone::new(DVec3::ZERO, DVec3::Z, 0.1).unwrap().between(3.0, 2.0)).meets(&unit));

    let half_space = ConeTest::new(&Cone::new(DVec3::Z, DVec3::Z, FRAC_PI_2).unwrap());
    assert!(half_space.meets(&unit)); // touching
    assert!(!half_space.meets(&Aabb { max: unit.max.with_z(0.999), ..unit }));
    assert!(ConeTest::new(&Cone::new(DVec3::Z * 9.0, DVec3::Z, PI).unwrap()).meets(&unit));

    for cone in [&ray, &away, &half_space] {
        assert!(!cone.meets(&Aabb::EMPTY));
        assert!(!cone.meets(&Aabb::new(Vec3A::NAN, Vec3A::NAN)));
        assert!(cone.meets(&Aabb::INFINITE));
    }
    // A ground plane, infinite on four sides, and a cone of finite length above it.
    let ground = Aabb::new(
        Vec3A::new(f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY),
        Vec3A::new(f32::INFINITY, 0.0, f32::INFINITY),
    );
    let down = Cone::new(DVec3::Y * 3.0, -DVec3::Y, 0.3).unwrap();
    assert!(ConeTest::new(&down).meets(&ground));
    assert!(ConeTest::new(&down.between(0.0, 3.0)).meets(&ground));
    assert!(!ConeTest::new(&down.between(0.0, 2.9)).meets(&ground));
    // Coordinates whose squares leave the range of f32, and apexes whose squares leave that of f64.
    let huge = Aabb::new(Vec3A::splat(-3e38), Vec3A::splat(3e38));
    assert!(ConeTest::new(&down).meets(&huge));
    assert!(ConeTest::new(&Cone::new(DVec3::X * 1e300, -DVec3::X, 0.1).unwrap()).meets(&unit));
    for angle in [-0.1, 3.2, f64::NAN] {
        assert!(Cone::new(DVec3::ZERO, DVec3::X, angle).is_err());
    }
    assert!(Cone::new(DVec3::ZERO, DVec3::ZERO, 0.1).is_err());
}

/// A convex polygon in the plane across `normal`, its corners on an ellipse.
fn polygon(seeded: &mut Seeded, center: DVec3, normal: DVec3, size: f64) -> Vec<DVec3> {
    let (u, v) = normal.normalize().any_orthonormal_pair();
    let n = 3 + seeded.below(4);
    let squeeze = seeded.between(0.02, 1.0);
    let turn = seeded.unit();
    let mut corners: Vec<DVec3> = (0..n)
        .map(|i| {
            let (sin, cos) = ((i as f64 + turn + seeded.between(-0.3, 0.3)) * 2.0 * PI / n as f64).sin_cos();
            center + (u * cos + v * sin * squeeze) * size
        })
        .collect();
    if seeded.below(2) == 0 {
        corners.reverse();
    }
    corners
}

fn any_beam(seeded: &mut Seeded) -> Option<Beam> {
    let from = seeded.inside(DVec3::splat(-1.0), DVec3::ONE);
    let dir = any_direction(seeded);
    let size = [0.01, 0.3, 1.5][seeded.below(3)];
    let beam = if seeded.below(2) == 0 {
        let normal = dir.normalize() + seeded.direction() * 0.7;
        let corners = polygon(seeded, from + dir, normal, size);
        Beam::from_apex(from, &corners)
    } else {
        let normal = dir.normalize() + seeded.direction() * 0.7;
        let corners = polygon(seeded, from, normal, size);
        Beam::parallel(&corners, dir)
    };
    let beam = beam.ok()?;
    Some(match seeded.below(3) {
        0 => beam,
        1 => beam.between(seeded.between(0.0, 2.0), 4.0),
        _ => beam.between(0.0, seeded.between(0.0, 3.0)),
    })
}

#[test]
fn beams_agree_with_a_search_for_the_least_excess() {
    let mut seeded = Seeded::new(4);
    let (mut met, mut wrong, mut made) = (0, 0, 0);
    let n = cases(150);
    for case in 0..n {
        let Some(beam) = any_beam(&mut seeded) else { continue };
        made += 1;
        let origin = beam.corners()[0].origin;
        let [near, far] = beam.range();
        let i = seeded.below(beam.corners().len());
        let depth = near + seeded.between(-0.2, 3.0);
        let b = box_near(&mut seeded, beam.corners()[i].at(depth));
        let excess = |p: DVec3| {
            let depth = (p - origin).dot(beam.depth());
            let sides = beam.sides().map(|(n, through)| n.dot(p - through)).fold(f64::NEG_INFINITY, f64::max);
            sides.max(near - depth).max(depth - far)
        };
        let value = least(b.min.as_dvec3(), b.max.as_dvec3(), &excess);
        let said = BeamTest::new(&beam).meets(&b);
        met += said as usize;
        assert!(said || value > -1e-13, "case {case}: missed {beam:?} {b:?} {value:e}");
        if said && value > 1e-4 {
            wrong += 1;
            println!("case {case}: {beam:?} {b:?} {value:e}");
        }
    }
    println!("beams: {met} of {made} met, {wrong} wrongly");
    assert!(wrong == 0 && made > n * 9 / 10 && met > n / 10 && met < n * 9 / 10, "{made} {met} {wrong}");
}

#[test]
fn boxes_around_points_of_a_beam_are_met() {
    let mut seeded = Seeded::new(5);
    for case in 0..cases(30_000) {
        let Some(beam) = any_beam(&mut seeded) else { continue };
        let corners = beam.corners();
        let [near, far] = beam.range();
        let depth = [near, far.min(1e3), seeded.between(near, far.min(5.0))][seeded.below(3)];
        // On a corner, on an edge, within.
        let i = seeded.below(corners.len());
        let weights = [[1.0, 0.0], [seeded.unit(), 0.0], [seeded.unit(), seeded.unit()]][seeded.below(3)];
        let at = |i: usize| corners[i % corners.len()].at(depth);
        let p = at(i).lerp(at(i + 1), 1.0 - weights[0]).lerp(at(i + 2), weights[1]);
        let mut b = Aabb::from_f64(p - 1e-9, p + 1e-9, DVec3::ZERO);
        for a in 0..3 {
            match seeded.below(3) {
                0 => b.min[a] -= seeded.unit() as f32,
                1 => b.max[a] += seeded.unit() as f32,
                _ => {}
            }
        }
        assert!(BeamTest::new(&beam).meets(&b), "case {case}: {beam:?} {p} {b:?}");
    }
}

#[test]
fn degenerate_beams_and_boxes() {
    let square =
        [[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]].map(DVec3::from_array);
    let beam = Beam::from_apex(DVec3::ZERO, &square).unwrap();
    let test = BeamTest::new(&beam);
    let unit = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
    assert!(test.meets(&unit)); // the apex inside
    assert!(
        test.meets(&Aabb::INFINITE)
            && !test.meets(&Aabb::EMPTY)
            && !test.meets(&Aabb::new(Vec3A::NAN, Vec3A::NAN))
    );
    assert!(!test.meets(&Aabb::new(Vec3A::splat(-2.0), Vec3A::splat(-1.0))));
    // A face in the plane of a side, and a point on an edge, far away.
    assert!(test.meets(&Aabb::new(Vec3A::splat(1e6), Vec3A::splat(1e6))));
    let behind = Aabb::new(Vec3A::NEG_INFINITY, Vec3A::new(f32::INFINITY, f32::INFINITY, -0.1));
    assert!(!test.meets(&behind));
    // The mirror image in the plane x = 1 meets the mirrored box, and keeps its winding.
    let mirror = rt_geom::Transform::scale(DVec3::new(-1.0, 1.0, 1.0))
        .unwrap()
        .then(&rt_geom::Transform::translation(DVec3::X * 2.0))
        .unwrap();
    let image = beam.transformed(&mirror).unwrap();
    assert!(image.contains(DVec3::new(2.5, 0.0, 1.0)) && !image.contains(DVec3::new(0.5, 0.0, 1.0)));
    assert!(BeamTest::new(&image).meets(&Aabb::new(Vec3A::new(2.9, 0.0, 1.0), Vec3A::new(3.5, 0.1, 1.1))));

    let crossed = [square[0], square[2], square[1], square[3]];
    assert_eq!(Beam::from_apex(DVec3::ZERO, &crossed), Err(rt_geom::BeamError::Flat));
    let dented = [square[0], square[1], DVec3::new(-0.5, -0.5, 1.0), square[3]];
    assert_eq!(Beam::from_apex(DVec3::ZERO, &dented), Err(rt_geom::BeamError::NotConvex));
    for flat in
        [&square[..2], &[], &[square[0]; 4], &[square[0], square[1], square[1] * 3.0 - square[0] * 2.0]]
    {
        assert_eq!(Beam::from_apex(DVec3::ZERO, flat), Err(rt_geom::BeamError::Flat));
        assert_eq!(Beam::parallel(flat, DVec3::Z), Err(rt_geom::BeamError::Flat));
    }
    assert_eq!(Beam::from_apex(DVec3::Z, &square), Err(rt_geom::BeamError::Flat));
    assert_eq!(Beam::parallel(&square, DVec3::X), Err(rt_geom::BeamError::Flat));
    assert_eq!(Beam::from_apex(DVec3::NAN, &square), Err(rt_geom::BeamError::NotFinite));
}

#[test]
fn cones_around_rays_of_any_length() {
    let unit = Cone::around(&Ray::new(DVec3::ZERO, DVec3::X).between(0.5, 10.0), 0.1, 0.1).unwrap();
    for e in [-1060, -700, -300, 300, 700, 1000] {
        // In two steps, for the range of the power itself.
        let power = |e: i32| 2f64.powi(e / 2) * 2f64.powi(e - e / 2);
        let ends = if e < -1000 {
            [0.5f64 * 2f64.powi(1000), 10.0 * 2f64.powi(1000)]
        } else {
            [0.5 * power(-e), 10.0 * power(-e)]
        };
        let ray = Ray::new(DVec3::ZERO, DVec3::X * power(e)).between(ends[0], ends[1]);
        let cone = Cone::around(&ray, 0.1, 0.1).unwrap();
        let expected = if e < -1000 { unit.range().map(|x| x * 2f64.powi(e + 1000)) } else { unit.range() };
        assert_eq!((cone.range(), cone.axis()), (expected, DVec3::X), "{e}");
    }
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    for (a, b) in [(f64::NAN, 1.0), (0.0, f64::NAN), (2.0, 1.0)] {
        assert_eq!(Cone::around(&ray.between(a, b), 1.0, 0.1), Err(ConeError::Interval));
    }
    assert_eq!(Cone::around(&Ray { dir: DVec3::ZERO, ..ray }, 1.0, 0.1), Err(ConeError::NoAxis));
    assert_eq!(Cone::around(&Ray { dir: DVec3::NAN, ..ray }, 1.0, 0.1), Err(ConeError::NoAxis));
    assert_eq!(Cone::around(&Ray { origin: DVec3::NAN, ..ray }, 1.0, 0.1), Err(ConeError::NotFinite));
}

#[test]
fn beams_through_polygons_of_any_size() {
    let corners = [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [-1.0, -1.0, 1.0]].map(DVec3::from_array);
    let dented = [corners[0], corners[1], DVec3::new(0.1, 0.1, 1.0), corners[2]];
    let (one, along) =
        (Beam::from_apex(DVec3::ZERO, &corners).unwrap(), Beam::parallel(&corners, DVec3::Z).unwrap());
    for e in [-1000, -600, -60, 60, 600, 1000] {
        let size = 2f64.powi(e);
        let beam = Beam::from_apex(DVec3::ZERO, &corners.map(|p| p * size)).unwrap();
        assert_eq!(beam, one, "{e}");
        let moved = Beam::from_apex(DVec3::splat(size), &corners.map(|p| (p + 1.0) * size)).unwrap();
        assert!(moved.sides().zip(one.sides()).all(|((a, _), (b, _))| a == b), "{e}");
        let beam = Beam::parallel(&corners.map(|p| p * size), DVec3::Z).unwrap();
        assert!(beam.sides().zip(along.sides()).all(|((a, p), (b, q))| a == b && p == q * size), "{e}");
        let error = Beam::from_apex(DVec3::ZERO, &dented.map(|p| p * size));
        assert_eq!(error, Err(rt_geom::BeamError::NotConvex), "{e}");
        let error = Beam::parallel(&dented.map(|p| p * size), DVec3::Z);
        assert_eq!(error, Err(rt_geom::BeamError::NotConvex), "{e}");
    }
}

#[test]
fn answers_do_not_depend_on_where_the_scene_is() {
    // A cone and a beam of the same outline, turned and moved far away, with boxes that move along.
    let mut seeded = Seeded::new(6);
    for _ in 0..cases(2000) {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(seeded.direction(), seeded.between(0.0, 6.0)));
        let far = (seeded.direction() * 1e6).round();
        let axis = turn * DVec3::Z;
        let here = ConeTest::new(&Cone::new(DVec3::ZERO, axis, 0.3).unwrap());
        let there = ConeTest::new(&Cone::new(far, axis, 0.3).unwrap());
        let p = (seeded.direction() * 4.0).round();
        let b = |o: DVec3| Aabb::new((o + p).as_vec3a(), (o + p + 1.0).as_vec3a());
        assert_eq!(here.meets(&b(DVec3::ZERO)), there.meets(&b(far)));
    }
}

#[test]
#[ignore = "a measurement: run in release"]
fn what_a_test_costs() {
    let mut seeded = Seeded::new(7);
    let boxes: Vec<Aabb> = (0..4096).map(|_| any_box(&mut seeded)).collect();
    let cones: Vec<_> = (0..64).map(|_| ConeTest::new(&any_cone(&mut seeded))).collect();
    let beams: Vec<_> = (0..80).filter_map(|_| any_beam(&mut seeded)).map(|b| BeamTest::new(&b)).collect();
    let time = |name: &str, n: usize, f: &dyn Fn(usize, &Aabb) -> bool| {
        let (mut met, mut best) = (0, 0.0);
        for i in 0..n {
            let mut least = f64::INFINITY;
            for _ in 0..9 {
                let start = std::time::Instant::now();
                met += boxes.iter().filter(|b| f(i, b)).count();
                least = least.min(start.elapsed().as_nanos() as f64 / boxes.len() as f64);
            }
            best += least / n as f64;
        }
        println!(
            "{name}: {best:.1} ns a box, {:.0} % met",
            100.0 * met as f64 / (9 * n * boxes.len()) as f64
        );
    };
    time("cone", cones.len(), &|i, b| cones[i].meets(b));
    time("beam", beams.len(), &|i, b| beams[i].meets(b));
}

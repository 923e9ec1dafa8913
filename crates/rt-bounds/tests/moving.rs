//! Boxes around moving boxes hold what moves, and little else.
//!
//! `RT_CASES=100` asks a hundred times as many.

#![allow(clippy::print_stdout)] // Figures, for `--nocapture`.

use rt_bounds::{Aabb, Obb};
use rt_geom::glam::{BVec3, DAffine3, DMat3, DVec3, Vec3A};
use rt_geom::{Motion, Transform};
use rt_measure::rays::Seeded;
use std::f64::consts::PI;

fn cases(usual: usize) -> usize {
    usual * std::env::var("RT_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

fn any_map(seeded: &mut Seeded) -> Transform {
    let turn = Transform::rotation(seeded.direction(), seeded.between(-PI, PI)).unwrap();
    let linear = turn.linear() * DMat3::from_diagonal(seeded.inside(DVec3::splat(0.2), DVec3::splat(2.0)));
    Transform::new(DAffine3 { matrix3: linear, translation: seeded.direction() * seeded.between(0.0, 5.0) })
        .unwrap()
}

#[test]
fn they_hold_all_points_at_all_times_and_are_tight() {
    let mut seeded = Seeded::new(41);
    let (mut loosest, mut ends_only) = (0.0f64, 0);
    let n = cases(100);
    for _ in 0..n {
        let motion = match seeded.below(3) {
            0 => {
                let turn = |a: f64| Transform::rotation(DVec3::new(0.3, 0.5, 0.8), a).unwrap();
                Motion::new(turn(0.0), turn([PI, 1e-6, 3.0][seeded.below(3)])).unwrap()
            }
            _ => Motion::new(any_map(&mut seeded), any_map(&mut seeded)).unwrap(),
        };
        let (p, q) = (seeded.direction(), seeded.direction());
        let b = Aabb::new(p.min(q).as_vec3a(), p.max(q).as_vec3a());
        let times = [[0.0, 1.0], [0.25, 0.5], [0.7, 0.7]][seeded.below(3)];
        let origin = [DVec3::ZERO, DVec3::new(1e3, -7.0, 0.1)][seeded.below(2)];
        let swept = b.moving(&motion, times, origin);
        let (lo, hi) = (swept.min.as_dvec3() + origin, swept.max.as_dvec3() + origin);
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let steps = 1000;
        for i in 0..=steps {
            let time = times[0] + (times[1] - times[0]) * i as f64 / steps as f64;
            let map = motion.at(time);
            for c in b.corners() {
                let x = map.point(c.as_dvec3());
                (least, most) = (least.min(x), most.max(x));
            }
            let inner = map.point(seeded.inside(b.min.as_dvec3(), b.max.as_dvec3()));
            (least, most) = (least.min(inner), most.max(inner));
        }
        assert!(lo.cmple(least).all() && most.cmple(hi).all(), "{motion:?} {b:?} {times:?}");
        // Far from its origin a box is as loose as f32 is there.
        if origin == DVec3::ZERO {
            loosest = loosest.max(((least - lo).max(hi - most) / (most - least)).max_element());
        }
        let both =
            b.transformed(&motion.at(times[0]), origin).union(b.transformed(&motion.at(times[1]), origin));
        ends_only +=
            !both.contains(Aabb::new((least - origin).as_vec3a(), (most - origin).as_vec3a())) as usize;
    }
    println!(
        "at most {loosest:.1e} of the size too wide; the boxes at both ends are not enough in {ends_only} of {n}"
    );
    assert!(loosest < 1e-4 && ends_only > 0);
}

#[test]
fn straight_motion_needs_no_more_than_both_ends() {
    let motion =
        Motion::new(Transform::IDENTITY, Transform::translation(DVec3::new(1.0, -2.0, 0.5))).unwrap();
    let b = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
    let swept = b.moving(&motion, [0.0, 1.0], DVec3::ZERO);
    let exact = Aabb::new(Vec3A::new(0.0, -2.0, 0.0), Vec3A::new(2.0, 1.0, 1.5));
    assert!(swept.contains(exact));
    assert!((swept.size() - exact.size()).max_element() < 1e-6);
    assert!(b.moving(&motion, [f64::NAN, 0.0], DVec3::ZERO).max.x < 1.0 + 1e-6);
    assert!(b.moving(&motion, [-3.0, f64::NAN], DVec3::ZERO).contains(exact));
}

#[test]
fn what_is_not_a_finite_box() {
    let motion = Motion::new(Transform::IDENTITY, Transform::rotation(DVec3::X, 1.0).unwrap()).unwrap();
    assert!(Aabb::EMPTY.moving(&motion, [0.0, 1.0], DVec3::ZERO).is_empty());
    assert_eq!(Aabb::INFINITE.moving(&motion, [0.0, 1.0], DVec3::ZERO), Aabb::INFINITE);
    let huge = Aabb::new(Vec3A::splat(-3e38), Vec3A::splat(3e38));
    assert!(huge.moving(&motion, [0.0, 1.0], DVec3::ZERO).contains(huge));
    assert!(!Aabb::new(Vec3A::NAN, Vec3A::NAN).moving(&motion, [0.0, 1.0], DVec3::ZERO).is_valid());
}

/// A turn about a far pivot, before and after which it moves: its matrix hides how far the pivot is.
fn about(pivot: DVec3, axis: DVec3, angle: f64) -> Transform {
    let turn = Transform::rotation(axis, angle).unwrap();
    let to = Transform::translation(pivot).inverse();
    to.then(&turn).unwrap().then(&Transform::translation(turn.point(pivot))).unwrap()
}

#[test]
fn oriented_and_moving_boxes_hold_what_turns_about_a_far_pivot() {
    let mut seeded = Seeded::new(44);
    let unit = Aabb::new(Vec3A::NEG_ONE, Vec3A::ONE);
    for i in 0..cases(2000) {
        let far = [1e3, 1e6, 1e9, 1e12][i % 4];
        let pivot = seeded.inside(DVec3::splat(-far), DVec3::splat(far));
        let (axis, angle) = (seeded.direction(), seeded.between(-3.0, 3.0));
        let map = about(pivot, axis, angle);
        let obb = Obb::carried(&unit, &map, DVec3::ZERO).unwrap();
        // A thin box shows the roundings that room for the rest would hide.
        let motion = Motion::new(map, about(pivot * 0.5, axis, angle + seeded.between(0.0, 0.5))).unwrap();
        let p = seeded.direction();
        let point = Aabb::new(p.as_vec3a(), p.as_vec3a());
        let swept = point.moving(&motion, [0.0, 1.0], DVec3::ZERO);
        for corner in unit.corners() {
            let x = map.point(corner.as_dvec3());
            for (normal, center, half) in obb.slabs() {
                assert!(
                    normal.dot(x - center).abs() <= half * (1.0 + 1e-15),
                    "{far:e} {normal} {}",
                    x - center
                );
            }
        }
        for time in [0.0, 1.0, seeded.unit()] {
            let x = motion.at(time).point(point.min.as_dvec3());
            let inside = swept.min.as_dvec3().cmple(x) & x.cmple(swept.max.as_dvec3());
            assert!(inside.all(), "{far:e} {time} {swept:?} {x}");
        }
    }
}

#[test]
fn moving_boxes_are_never_inverted() {
    let unit = Aabb::new(Vec3A::NEG_ONE, Vec3A::ONE);
    let turn = Transform::rotation(DVec3::ONE, 2.0).unwrap();
    for size in [1e-300, 1e300, 3e306] {
        let start = Transform::scale(DVec3::splat(size))
            .unwrap()
            .then(&Transform::translation(DVec3::splat(size)))
            .unwrap();
        let motion = Motion::new(start, start.then(&turn).unwrap()).unwrap();
        for b in [unit, Aabb::new(Vec3A::splat(-3e38), Vec3A::splat(3e38))] {
            let swept = b.moving(&motion, [0.0, 1.0], DVec3::ZERO);
            assert!(swept.is_valid(), "{size:e} {swept:?}");
        }
    }
}

#[test]
fn carried_boxes_are_the_boxes_of_carried_corners() {
    let mut seeded = Seeded::new(42);
    for _ in 0..cases(5000) {
        let m = [0; 9].map(|_| seeded.between(-2.0, 2.0));
        let translation = seeded.direction() * seeded.between(0.0, 100.0);
        let Ok(map) = Transform::new(DAffine3 { matrix3: DMat3::from_cols_array(&m), translation }) else {
            continue;
        };
        if map.condition() > 1e3 {
            continue;
        }
        let (p, q) = (seeded.direction(), seeded.direction());
        let b = Aabb::new(p.min(q).as_vec3a(), p.max(q).as_vec3a());
        let carried = b.transformed(&map, DVec3::ZERO);
        let corners = b.corners().map(|c| map.point_with_error(c.as_dvec3(), DVec3::ZERO));
        let (lo, hi) = corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), (c, e)| {
            (lo.min(*c - *e), hi.max(*c + *e))
        });
        assert!(carried.min.as_dvec3().cmple(lo).all() && hi.cmple(carried.max.as_dvec3()).all());
        for a in 0..3 {
            let (below, above) = ((lo[a] as f32).next_down().next_down(), (hi[a] as f32).next_up().next_up());
            assert!(carried.min[a] >= below && carried.max[a] <= above, "{map:?} {b:?}");
        }
    }
}

#[test]
fn a_stretch_does_not_blow_up_the_box() {
    let map = Transform::scale(DVec3::new(3e8, 1.1, 1.0)).unwrap();
    let b = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE).transformed(&map, DVec3::ZERO);
    assert!(b.max.y <= 1.1f32.next_up() && b.max.z <= 1f32.next_up());
}

#[test]
fn clipped_rays_corners_and_distances() {
    let mut seeded = Seeded::new(43);
    let b = Aabb::new(Vec3A::new(-1.0, 0.0, 0.5), Vec3A::new(1.0, 2.0, 0.5));
    for _ in 0..cases(5000) {
        let (o, p) = (
            seeded.inside(DVec3::splat(-3.0), DVec3::splat(3.0)),
            seeded.inside(b.min.as_dvec3(), b.max.as_dvec3()),
        );
        let ray = rt_geom::Ray::new(o, p - o);
        // The exact line passes within the rounding of p - o of a point of the flat box: so it must meet a slightly
        // grown one.
        let grown = Aabb::new(b.min - 1e-6, b.max + 1e-6);
        let [enter, leave] = grown.clip(&ray).unwrap();
        assert!(enter <= 1.0 && 1.0 <= leave && leave - enter < 10.0 / (p - o).length());
        assert!(grown.clip(&ray.between(leave + 1e-9, 9.0)).is_none());
        assert!(
            grown.clip(&rt_geom::Ray::new(o, o - p).between(1e-9, 9.0)).is_none()
                || grown.distance_squared(o) == 0.0
        );
        let near = b.closest_point(o.as_vec3a());
        assert!(b.contains_point(near));
        let off = (b.distance_squared(o.as_vec3a().as_dvec3()).sqrt()
            - near.as_dvec3().distance(o.as_vec3a().as_dvec3()))
        .abs();
        assert!(off < 1e-15 && b.distance_squared(o) <= o.distance_squared(p) * (1.0 + 1e-15));
    }
    let along = rt_geom::Ray::new(Vec3A::new(-2.0, 2.0, 0.5), Vec3A::X); // in a face, along an edge, of a flat box
    let [enter, leave] = b.clip(&along).unwrap();
    assert!((1.0 - 1e-15..=1.0).contains(&enter) && (3.0..3.0 + 1e-14).contains(&leave));
    assert_eq!(Aabb::INFINITE.clip(&along), Some([0.0, f64::INFINITY]));
    assert_eq!(Aabb::EMPTY.clip(&along), None);
    assert_eq!(Aabb::EMPTY.distance_squared(DVec3::ZERO), f64::INFINITY);
    assert!(b.distance_squared(DVec3::NAN).is_nan());
    assert_eq!(Aabb::INFINITE.distance_squared(DVec3::ONE), 0.0);
    assert_eq!((b.volume(), Aabb::EMPTY.volume(), Aabb::INFINITE.volume()), (0.0, 0.0, f32::INFINITY));
    assert_eq!(Aabb::new(Vec3A::ZERO, Vec3A::new(1.0, 2.0, 3.0)).volume(), 6.0);
    assert_eq!(b.corners().into_iter().fold(Aabb::EMPTY, Aabb::grow), b);
    assert_eq!(
        BVec3::TRUE,
        BVec3::new(b.corners()[7] == b.max, b.corners()[0] == b.min, b.corners()[1].x == b.max.x)
    );
}

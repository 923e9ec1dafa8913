//! Every volume holds every point it was made around, as real numbers.

use crate::points::{KINDS, PLACES, narrow, shape, turn};
use rt_bounds::{Aabb, BoundingSphere, BoundingVolume, Extremes, Obb};
use rt_geom::glam::{DAffine3, DMat3, DVec3, Vec3A};
use rt_geom::{Transform, Vector};
use rt_measure::exact::{Slab, ball_holds, slabs_hold, smallest_ball};
use rt_measure::rays::Seeded;

pub(crate) fn slabs_of(obb: &Obb) -> [Slab; 3] {
    obb.slabs().map(|(n, c, half)| Slab { normal: n.to_array(), middle: c.to_array(), half })
}

fn holds(ball: &BoundingSphere, p: DVec3, origin: DVec3) -> bool {
    ball_holds(ball.center.as_dvec3().to_array(), ball.radius as f64, p.to_array(), origin.to_array())
}

fn spheres<V: Vector>(points: &[V], origin: DVec3) -> [BoundingSphere; 5] {
    [
        BoundingSphere::ritter(points, origin),
        BoundingSphere::epos(points, origin, Extremes::Six),
        BoundingSphere::epos(points, origin, Extremes::Fourteen),
        BoundingSphere::epos(points, origin, Extremes::TwentySix),
        BoundingSphere::smallest(points, origin),
    ]
    .map(|ball| ball.expect("finite points have a ball"))
}

fn boxes<V: Vector>(points: &[V], origin: DVec3) -> [Obb; 3] {
    [Obb::pca(points, &[[0, 1, 2], [9, 9, 9]], origin), Obb::dito(points, origin), Obb::tight(points, origin)]
        .map(|b| b.expect("finite points have a box"))
}

fn check<V: Vector>(points: &[V], origin: DVec3) {
    for (i, ball) in spheres(points, origin).iter().enumerate() {
        for p in points {
            assert!(holds(ball, p.widen(), origin), "sphere {i}: {ball:?} {p:?} {origin}");
        }
        // No smaller radius will do.
        if ball.radius > 1e-37 && ball.radius.is_finite() {
            let less = BoundingSphere { radius: ball.radius.next_down(), ..*ball };
            assert!(points.iter().any(|p| !holds(&less, p.widen(), origin)), "sphere {i} {ball:?}");
        }
        let around = ball.aabb();
        let (c, r) = (ball.center.as_dvec3().to_array(), ball.radius as f64);
        for a in 0..3 {
            let mut at = c;
            at[a] = around.min[a] as f64;
            assert!(!ball_holds(c, r.next_down(), at, [0.0; 3]) || r == 0.0 || around.min[a].is_infinite());
        }
    }
    for (i, b) in boxes(points, origin).iter().enumerate() {
        let slabs = slabs_of(b);
        for p in points {
            assert!(
                slabs_hold(&slabs, p.widen().to_array(), origin.to_array()),
                "box {i}: {b:?} {p:?} {origin}"
            );
        }
        assert!(BoundingVolume::surface_area(b) >= 0.0);
        let aligned = <Aabb as BoundingVolume>::around(points, origin).unwrap();
        // No larger than the box along the axes, but for the rounding of a centre.
        let (c, size) = (aligned.center().as_dvec3().abs(), aligned.max.as_dvec3() - aligned.min.as_dvec3());
        let [x, y, z] = (size + (c + size) * 2f64.powi(-23) + 2f64.powi(-147)).to_array();
        let (area, most) = (b.surface_area(), 2.0 * (x * y + y * z + z * x));
        assert!(area <= most * (1.0 + 1e-6), "box {i}: {area} {most}");
    }
}

#[test]
fn volumes_hold_their_points() {
    let mut seeded = Seeded::new(7);
    for (size, offset) in PLACES {
        for kind in 0..KINDS {
            for n in [1, 2, 3, 4, 5, 9, 40] {
                let away = seeded.direction() * offset;
                let points: Vec<DVec3> =
                    shape(&mut seeded, kind, n).iter().map(|p| *p * size + away).collect();
                check(&points, DVec3::ZERO);
                check(&points, away);
                check(&narrow(&points), DVec3::ZERO);
                check(&narrow(&points), DVec3::new(0.1, -1.0 / 3.0, 1e3));
            }
        }
    }
}

#[test]
fn points_of_any_bits_are_held() {
    let mut seeded = Seeded::new(8);
    for round in 0..3000 {
        let n = 1 + seeded.below(6);
        let mut number = || loop {
            let x = f32::from_bits(seeded.bits() as u32);
            if x.is_finite() {
                return x;
            }
        };
        let points: Vec<Vec3A> = (0..n).map(|_| Vec3A::new(number(), number(), number())).collect();
        if round % 3 == 0 {
            let fine: Vec<DVec3> =
                points.iter().map(|p| p.as_dvec3() * 1.000_000_1 * 10f64.powi(round % 40 - 20)).collect();
            check(&fine, DVec3::ZERO);
        }
        check(&points, DVec3::ZERO);
    }
}

#[test]
fn no_volume_around_what_is_not_finite() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let points = [Vec3A::ZERO, Vec3A::new(0.0, bad, 1.0)];
        assert!(<BoundingSphere as BoundingVolume>::around(&points, DVec3::ZERO).is_none());
        assert!(<Obb as BoundingVolume>::around(&points, DVec3::ZERO).is_none());
        assert!(Obb::pca(&points, &[], DVec3::ZERO).is_none());
        assert!(BoundingSphere::epos(&points, DVec3::ZERO, Extremes::Six).is_none());
    }
    assert!(<BoundingSphere as BoundingVolume>::around::<Vec3A>(&[], DVec3::ZERO).is_none());
    assert!(<Obb as BoundingVolume>::around::<DVec3>(&[], DVec3::ZERO).is_none());
}

#[test]
fn the_smallest_ball_is_the_exact_one() {
    let mut seeded = Seeded::new(9);
    for round in 0..600 {
        let (size, kind) = ([1.0, 1e30, 1e-30][round % 3], round / 3 % KINDS);
        let n = 1 + seeded.below(8);
        let points: Vec<DVec3> =
            narrow(&shape(&mut seeded, kind, n)).iter().map(|p| p.as_dvec3() * size).collect();
        let exact =
            smallest_ball(&points.iter().map(|p| p.to_array()).collect::<Vec<_>>()).unwrap().to_f64().sqrt();
        let ball = BoundingSphere::smallest(&points, DVec3::ZERO).unwrap();
        // The centre, rounded in each coordinate by half a unit in the last place, and the radius by one.
        let rounding = ball.center.as_dvec3().length() * 2f64.powi(-24) + exact * 2f64.powi(-23);
        let radius = ball.radius as f64;
        assert!(
            exact <= radius * (1.0 + 1e-15) && radius <= exact + rounding * 1.01 + 1e-44,
            "{kind} {n} {exact} {ball:?}"
        );
    }
}

#[test]
fn unions_hold_both_and_are_least() {
    let mut seeded = Seeded::new(10);
    for _ in 0..20_000 {
        let size = 10f64.powi(seeded.below(60) as i32 - 30);
        let mut ball = || BoundingSphere {
            center: (seeded.direction() * size).as_vec3a(),
            radius: (size * seeded.unit() * [0.0, 1e-8, 1.0, 3.0][seeded.below(4)]) as f32,
        };
        let (a, b) = (ball(), ball());
        let u = a.union(b);
        assert_eq!(u, b.union(a));
        assert_eq!(a.union(a), a);
        assert!(u.contains(a) && u.contains(b) && u.radius >= a.radius.max(b.radius));
        let rounding = u.center.as_dvec3().length() * 2f64.powi(-24) + 2f64.powi(-148);
        let apart = a.center.as_dvec3().distance(b.center.as_dvec3());
        let least =
            ((apart + a.radius as f64 + b.radius as f64) * 0.5).max(a.radius as f64).max(b.radius as f64);
        assert!(u.radius as f64 <= least * (1.0 + 1.2e-7) + rounding, "{a:?} {b:?} {u:?}");
        // The poles of both, rounded inward, lie in the union.
        for s in [a, b] {
            let p = s.center.as_dvec3() + seeded.direction() * (s.radius as f64 * (1.0 - 1e-14));
            assert!(holds(&u, p, DVec3::ZERO) || s.radius == 0.0 || size < 1e-29, "{s:?} {u:?}");
        }
    }
}

#[test]
fn carried_boxes_hold_their_corners() {
    let mut seeded = Seeded::new(11);
    for round in 0..20_000 {
        let size = [1.0, 1e30, 1e-30, 1e3][round % 4];
        let mut corner = || seeded.inside(-DVec3::ONE, DVec3::ONE) * size;
        let b = Aabb::from_points(narrow(&[corner(), corner()]));
        let mut matrix3 = DMat3::from_quat(turn(&mut seeded));
        if round / 4 % 2 == 0 {
            matrix3 = DMat3::from_cols_array(&[0.0; 9].map(|_| seeded.between(-1.0, 1.0))) * matrix3;
            matrix3.y_axis *= 10f64.powi(seeded.below(9) as i32 - 4);
        }
        // Sometimes back to about zero from far away, where terms cancel.
        let translation = match round / 8 % 3 {
            0 => DVec3::ZERO,
            1 => seeded.direction() * size * 1e4,
            _ => -(matrix3 * b.center().as_dvec3()),
        };
        let Ok(map) = Transform::new(DAffine3 { matrix3, translation }) else { continue };
        for map in [map, map.inverse()] {
            let origin = seeded.direction() * [0.0, size, 1e5 * size][seeded.below(3)];
            let obb = Obb::carried(&b, &map, origin).unwrap();
            let around = obb.aabb();
            for i in 0..8 {
                let pick = |a: usize| if i >> a & 1 == 0 { b.min[a] } else { b.max[a] } as f64;
                let p = map.point(DVec3::new(pick(0), pick(1), pick(2)));
                assert!(
                    slabs_hold(&slabs_of(&obb), p.to_array(), origin.to_array()),
                    "{obb:?} {map:?} {p} {origin}"
                );
                let q = p - origin;
                assert!(around.min.as_dvec3().cmple(q).all() && q.cmple(around.max.as_dvec3()).all());
            }
        }
    }
}

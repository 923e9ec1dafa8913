//! No ray that meets the exact volume is missed.

use crate::containment::slabs_of;
use crate::points::{narrow, turn};
use rt_bounds::{Aabb, BoundingSphere, BoundingVolume, Obb};
use rt_geom::glam::{DAffine3, DMat3, DVec3, Vec3A};
use rt_geom::{Ray, Real, Transform, Vector};
use rt_measure::exact::{Slab, ball_meets, slabs};
use rt_measure::rays::Seeded;

/// What happened to some pairs of ray and volume.
#[derive(Default, Debug)]
struct Tally {
    pairs: u64,
    met: u64,
    missed: u64,
    invented: u64,
}

impl Tally {
    fn count(&mut self, truth: bool, found: bool) {
        self.pairs += 1;
        self.met += truth as u64;
        self.missed += (truth && !found) as u64;
        self.invented += (!truth && found) as u64;
    }
}

/// A ray towards a point of a surface: through it, along it, or along an axis past it; its ends often exactly where it
/// is.
///
/// `normal` points outward, and need only be roughly normal.
fn towards<R: Real>(seeded: &mut Seeded, point: DVec3, normal: DVec3, size: f64) -> Ray<R> {
    let round = |v: DVec3| R::Vec3::nearest(v).widen();
    let mut dir = match seeded.below(4) {
        0 => seeded.direction(),
        1 => normal.cross(seeded.direction()),
        2 => DVec3::from_array([0, 1, 2].map(|_| [-0.0, 0.0, 1.0, -1.0][seeded.below(4)])),
        _ => normal.cross([DVec3::X, DVec3::Y, DVec3::Z][seeded.below(3)]),
    };
    if dir == DVec3::ZERO {
        dir = DVec3::Z;
    }
    let stretch = [1.0, 3.0, 1e-20, 1e15][seeded.below(4)];
    let dir = round(dir * stretch);
    let back = [0.0, 1.0, 1e-3, 1e4, -2.0][seeded.below(5)] * size / stretch;
    let origin = round(point - dir * back);
    // Where it passes the point, near enough.
    let t = (point - origin).dot(dir) / dir.length_squared();
    let t: R = if t.is_finite() { R::nearest(t) } else { R::ZERO };
    let nudge = |t: R, by: usize| match by {
        0 => t,
        1 => t.next_up(),
        _ => t.next_down(),
    };
    let by = seeded.below(3);
    let (t_min, t_max) = match seeded.below(5) {
        0 => (R::ZERO, R::INFINITY),
        1 => (-R::INFINITY, nudge(t, by)),
        2 => (nudge(t, by), R::INFINITY),
        3 => (nudge(t, by), nudge(t, by)),
        _ => (-R::INFINITY, R::INFINITY),
    };
    Ray { origin: R::Vec3::nearest(origin), dir: R::Vec3::nearest(dir), t_min, t_max }
}

/// `2^-44` of the distances between a ray and a volume of some size and what stands for underflow, and the ray's
/// interval longer by that and by the rounding of a `t` at its far end.
fn trifle<R: Real>(ray: &Ray<R>, origin: DVec3, center: DVec3, size: f64) -> (f64, [f64; 2]) {
    let (o, d) = (ray.origin.widen(), ray.dir.widen());
    let far = o.length() + origin.length() + center.length() + size;
    let trifle = far * 2f64.powi(-44) + 2f64.powi(-498);
    let longest = d.abs().max_element();
    let [t_min, t_max]: [f64; 2] = [ray.t_min.into(), ray.t_max.next_up().into()];
    let more = |t: f64| trifle / longest + t.abs() * 2f64.powi(-44);
    let wider = |t: f64, sign: f64| if t.is_finite() { t + sign * more(t) } else { t };
    (trifle, [wider(t_min, -1.0), wider(t_max, 1.0)])
}

const SIZES: [f64; 6] = [1.0, 1e30, 1e-30, 1e-41, 1e3, 1e-3];

fn a_ball(seeded: &mut Seeded) -> (BoundingSphere, f64) {
    let size = SIZES[seeded.below(SIZES.len())];
    let whole = seeded.below(3) == 0;
    let far = [0.0, 1.0, 1e3, 1e7][seeded.below(4)];
    let (mut center, mut radius) =
        (seeded.direction() * far, seeded.unit() * [0.0, 1e-6, 1.0, 1e3][seeded.below(4)]);
    if whole {
        // Whole numbers: tangents that are exact.
        (center, radius) = (center.round(), (radius * 9.0).round());
    }
    let size = if whole && size < 1e-40 { 1.0 } else { size };
    let ball = BoundingSphere { center: (center * size).as_vec3a(), radius: (radius * size) as f32 };
    (ball, (ball.radius as f64).max(size * 1e-3))
}

fn ball_pair<R: Real>(seeded: &mut Seeded, tally: &mut Tally) {
    let (ball, size) = a_ball(seeded);
    let origin = match seeded.below(3) {
        0 => seeded.inside(-DVec3::ONE, DVec3::ONE) * size * 1e5,
        _ => DVec3::ZERO,
    };
    let normal = match seeded.below(2) {
        0 => seeded.direction(),
        _ => [DVec3::X, -DVec3::Y, DVec3::Z][seeded.below(3)],
    };
    let nearly = [1.0, 1.0, 1.0 + 1e-7, 1.0 - 1e-15, 2.0][seeded.below(5)];
    let point = ball.center.as_dvec3() + normal * (ball.radius as f64 * nearly) + origin;
    let ray: Ray<R> = towards(seeded, point, normal, size);
    let (o, d) = (ray.origin.widen(), ray.dir.widen());
    let t = [ray.t_min.into(), ray.t_max.into()];
    let c = ball.center.as_dvec3().to_array();
    let truth = ball_meets(o.to_array(), d.to_array(), t, origin.to_array(), c, ball.radius as f64);
    let ready = BoundingSphere::ready(&ray, origin, &ball.aabb());
    let found = ball.entry(&ready);
    assert!(!truth || found.is_some(), "{ball:?} {ray:?} {origin}");
    if found.is_some() && !truth {
        // What is invented is met by a ball and a segment that are a trifle larger.
        let (trifle, t) = trifle(&ray, origin, ball.center.as_dvec3(), ball.radius as f64);
        let radius = ball.radius as f64 + trifle;
        assert!(
            ball_meets(o.to_array(), d.to_array(), t, origin.to_array(), c, radius),
            "{ball:?} {ray:?} {origin}"
        );
    }
    tally.count(truth, found.is_some());
}

fn a_box(seeded: &mut Seeded) -> (Obb, f64) {
    let size = SIZES[seeded.below(SIZES.len())];
    let mut extent = || [0.0, 1.0, seeded.unit(), 1e-3][seeded.below(4)];
    let half = DVec3::new(extent(), extent(), extent());
    let middle = seeded.direction() * [0.0, 1.0, 1e3][seeded.below(3)];
    let corners = narrow(&[(middle - half) * size, (middle + half) * size]);
    let b = Aabb::from_points(corners);
    let obb = match seeded.below(3) {
        0 => Obb::of_aabb(&b),
        kind => {
            let mut matrix3 = DMat3::from_quat(turn(seeded));
            if kind == 2 {
                matrix3 *= DMat3::from_cols_array(&[0.0; 9].map(|_| seeded.between(-1.0, 1.0)));
            }
            let translation = seeded.direction() * size;
            Transform::new(DAffine3 { matrix3, translation })
                .ok()
                .and_then(|map| Obb::carried(&b, &map, DVec3::ZERO))
        }
    };
    (obb.unwrap_or(Obb::INFINITE), size)
}

fn box_pair<R: Real>(seeded: &mut Seeded, tally: &mut Tally) {
    let (obb, size) = a_box(seeded);
    let origin = match seeded.below(3) {
        0 => seeded.inside(-DVec3::ONE, DVec3::ONE) * size * 1e3,
        _ => DVec3::ZERO,
    };
    // A corner, a point of an edge or of a face, found from the slabs.
    let [a, b, c] = obb.slabs();
    let normals = DMat3::from_cols(a.0, b.0, c.0).transpose();
    let side = |seeded: &mut Seeded, half: f64| half * [1.0, -1.0, 0.3, 1.0 + 1e-7][seeded.below(4)];
    let across = DVec3::new(side(seeded, a.2), side(seeded, b.2), side(seeded, c.2));
    let point = a.1 + normals.inverse() * across + origin;
    let normal = [a.0, b.0, c.0][seeded.below(3)];
    if !point.is_finite() {
        return;
    }
    let ray: Ray<R> = towards(seeded, point, normal, size);
    let (o, d) = (ray.origin.widen(), ray.dir.widen());
    let truth = slabs(&slabs_of(&obb), o.to_array(), d.to_array(), origin.to_array())
        .is_some_and(|span| span.meets(ray.t_min.into(), ray.t_max.into()));
    let found = obb.entry(&Obb::ready(&ray, origin, &obb.aabb()));
    assert!(!truth || found.is_some(), "{obb:?} {ray:?} {origin}");
    if found.is_some() && !truth {
        // And the least radius that is not zero.
        let widest = obb.aabb().size().as_dvec3().length() + 2f64.powi(-149);
        let (trifle, t) = trifle(&ray, origin, a.1, widest);
        let larger = slabs_of(&obb).map(|slab| Slab { half: slab.half + trifle, ..slab });
        let met = slabs(&larger, o.to_array(), d.to_array(), origin.to_array());
        // Each slab may be met a trifle outside the others.
        assert!(met.is_some_and(|span| span.meets(t[0], t[1])), "{obb:?} {ray:?} {origin}");
    }
    tally.count(truth, found.is_some());
}

fn pairs(count: u64, seed: u64) -> [Tally; 4] {
    let mut tallies = [(); 4].map(|()| Tally::default());
    let [ball, fine_ball, obb, fine_obb] = &mut tallies;
    let mut seeded = Seeded::new(seed);
    for _ in 0..count / 2 {
        ball_pair::<f32>(&mut seeded, ball);
        ball_pair::<f64>(&mut seeded, fine_ball);
        box_pair::<f32>(&mut seeded, obb);
        box_pair::<f64>(&mut seeded, fine_obb);
    }
    tallies
}

#[test]
fn aimed_rays_are_never_missed() {
    for tally in pairs(40_000, 1) {
        assert!(tally.missed == 0 && tally.met > tally.pairs / 10 && tally.met < tally.pairs, "{tally:?}");
    }
}

/// `cargo test -p rt-bounds --release --test round -- --ignored --nocapture ten_million`
#[test]
#[ignore = "minutes"]
#[allow(clippy::print_stdout)]
fn ten_million_aimed_rays_are_never_missed() {
    let start = std::time::Instant::now();
    let names = ["sphere, f32", "sphere, f64", "box, f32", "box, f64"];
    for (name, tally) in names.iter().zip(pairs(10_000_000, 2)) {
        println!("{name}: {tally:?}");
        assert_eq!(tally.missed, 0);
    }
    println!("{:.0} s", start.elapsed().as_secs_f64());
}

#[test]
fn rays_that_are_not_valid_meet_nothing() {
    let points = [Vec3A::splat(-1.0), Vec3A::ONE, Vec3A::X, Vec3A::Y];
    let ball = BoundingSphere::smallest(&points, DVec3::ZERO).unwrap();
    let obb = Obb::tight(&points, DVec3::ZERO).unwrap();
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let good = Ray::new(Vec3A::new(-5.0, 0.0, -0.0), Vec3A::X);
    let mut bad = vec![good.between(1.0, 0.0), Ray { dir: Vec3A::ZERO, ..good }, good.between(f32::NAN, 1.0)];
    for x in odd {
        for a in 0..3 {
            let mut ray = good;
            ray.origin[a] = x;
            bad.push(ray);
            let mut ray = good;
            ray.dir[a] = x;
            bad.push(ray);
        }
        bad.push(good.between(x, f32::NAN));
    }
    for (volume_ball, volume_box) in [(ball, obb), (BoundingSphere::INFINITE, Obb::INFINITE)] {
        for ray in &bad {
            let ready = BoundingSphere::ready(ray, DVec3::ZERO, &Aabb::INFINITE);
            assert_eq!((volume_ball.entry(&ready), volume_box.entry(&ready)), (None, None), "{ray:?}");
        }
        let ready = Obb::ready(&good, DVec3::ZERO, &Aabb::INFINITE);
        assert!(volume_ball.entry(&ready).is_some() && volume_box.entry(&ready).is_some());
    }
    // From beyond all range every volume is met; the ends of the ray still count.
    let far = Ray::new(DVec3::splat(1e200), DVec3::NEG_ONE);
    let ready = Obb::ready(&far, DVec3::ZERO, &Aabb::INFINITE);
    assert!(ball.entry(&ready).is_some() && obb.entry(&ready).is_some());
}

#[test]
fn entries_order_and_shorter_rays_hit_less() {
    let mut seeded = Seeded::new(3);
    for _ in 0..20_000 {
        let point = seeded.direction() * 3.0;
        let ray = Ray::new((point + seeded.direction() * 20.0).as_vec3a(), seeded.direction().as_vec3a());
        let ball = BoundingSphere { center: point.as_vec3a(), radius: seeded.unit() as f32 };
        let (obb, _) = a_box(&mut seeded);
        let at = |t: f32| {
            let ready = BoundingSphere::ready(&ray.between(0.0, t), DVec3::ZERO, &Aabb::INFINITE);
            [ball.entry(&ready), obb.entry(&ready)]
        };
        let mut before = at(f32::INFINITY);
        for t in [100.0, 25.0, 20.0, 19.0, 5.0, 0.0] {
            let now = at(t);
            for (now, before) in now.iter().zip(before) {
                assert!(now.is_none() || *now == before);
                assert!(now.is_none_or(|entry| entry <= t * 1.000_001));
            }
            before = now;
        }
    }
}

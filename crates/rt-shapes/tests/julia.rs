//! Rays that leave Julia sets, and rays from anywhere at any pace.

// The long test, run by hand, says what it found.
#![allow(clippy::print_stdout)]

use rt_accel::{Hit, Instance, Primitive};
use rt_geom::glam::{DAffine3, DQuat, DVec3, DVec4};
use rt_geom::{Ray, Real, Transform, Vector};
use rt_measure::rays::{self, Seeded};
use rt_shapes::{Julia, JuliaCounts, JuliaParams, Shape, Surface, Traced, Uv};

/// Sets with arms, dust, a ball, and a slice off the middle.
const SETS: [([f64; 4], f64); 6] = [
    ([-0.2, 0.6, 0.2, 0.2], 0.0),
    ([-0.125, -0.256, 0.847, 0.0895], 0.0),
    ([-1.0, 0.2, 0.0, 0.0], 0.0),
    ([0.0, 0.0, 0.0, 0.0], 0.0),
    ([-0.445, 0.339, -0.0889, -0.562], 0.2),
    ([0.3, 0.5, 0.2, 0.1], 0.0),
];

fn set((c, w): ([f64; 4], f64), tolerance: f64) -> Julia {
    Julia::new(JuliaParams { c: DVec4::from_array(c), w, tolerance, ..JuliaParams::default() }).unwrap()
}

/// Rays spawned; of these those that hit something where they begin, within a hundredth of the tolerance, and within the
/// tolerance; and the hits they were sent off from.
#[derive(Debug, Default)]
struct Found {
    spawned: u64,
    at_once: u64,
    soon: u64,
    hits: u64,
    near: u64,
}

/// Sends rays off from every hit of `count` chords, to random directions of the hemisphere.
fn spawn<R: Real>(
    shape: &impl Shape<R, At = Uv>,
    scale: f64,
    tolerance: f64,
    count: usize,
    each: usize,
    found: &mut Found,
) {
    let mut seeded = Seeded::new(7);
    for ray in rays::uniform::<R>(5, &shape.world_bound(), count) {
        let Some(hit) = shape.intersect(&ray) else { continue };
        let surface: Surface = shape.surface(&ray, &hit);
        assert!((surface.normal.length() - 1.0).abs() < 1e-9 && surface.error.min_element() > 0.0);
        found.hits += 1;
        for _ in 0..each {
            let dir = loop {
                let dir = seeded.inside(-DVec3::ONE, DVec3::ONE);
                if dir.length() > 0.01 && dir.length() < 1.0 {
                    break dir * dir.dot(surface.normal).signum();
                }
            };
            let dir = R::Vec3::nearest(dir.normalize());
            if dir.widen().dot(surface.normal) <= 0.0 {
                continue;
            }
            let leaving = surface.spawn(dir);
            found.spawned += 1;
            if let Some(Hit { t, .. }) = shape.intersect(&leaving) {
                let t: f64 = t.into();
                found.at_once += (t == 0.0) as u64;
                found.soon += (t < 0.01 * tolerance * scale) as u64;
                found.near += (t < tolerance * scale) as u64;
            }
        }
    }
}

fn leave(count: usize, each: usize, tolerances: &[f64]) -> [Found; 3] {
    let mut all: [Found; 3] = Default::default();
    let scale = 5.0;
    let map = DAffine3::from_scale_rotation_translation(
        DVec3::splat(scale),
        DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.6),
        DVec3::new(1.0, 2.0, 3.0),
    );
    for of in SETS {
        for &tolerance in tolerances {
            let julia = set(of, tolerance);
            spawn::<f64>(&julia, 1.0, tolerance, count, each, &mut all[0]);
            spawn::<f32>(&julia, 1.0, tolerance, count, each, &mut all[1]);
            let moved = Instance::new(julia, Transform::new(map).unwrap());
            spawn::<f64>(&moved, scale, tolerance, count, each, &mut all[2]);
            println!(
                "{of:?} {tolerance:e} {:?}",
                all.each_ref().map(|f| (f.spawned, f.at_once, f.soon, f.near))
            );
        }
    }
    all
}

#[test]
fn rays_leave_what_they_hit() {
    for found in leave(100, 4, &[1e-2, 1e-4, 1e-7]) {
        assert!(found.spawned > 500 && found.at_once == 0, "{found:?}");
    }
}

#[test]
#[ignore = "millions of rays"]
fn millions_of_rays_leave_what_they_hit() {
    let [double, single, moved] = leave(16_000, 16, &[1e-2, 1e-3, 1e-4, 1e-5, 1e-6]);
    for found in [double, single] {
        assert!(found.spawned > 1_000_000 && found.at_once == 0, "{found:?}");
    }
    // Not promised: looked at for six lengths of the step, and every length that a turn may make of it is possible.
    assert!(moved.spawned > 400_000 && moved.at_once * 10_000 < moved.spawned, "{moved:?}");
}

#[test]
fn rays_from_anywhere_at_any_pace_meet_the_same() {
    let (mut hits, mut misses) = (0, 0);
    for of in SETS {
        let julia = set(of, 1e-5);
        let mut seeded = Seeded::new(3);
        for k in 0..60 {
            // Through a point by whole numbers of 2^-20, along an axis: the line is the same from any distance.
            let at =
                seeded.inside(-DVec3::ONE, DVec3::ONE).map(|x| (x * 2f64.powi(20)).round() / 2f64.powi(20));
            let (a, b) = ((k % 3) as usize, (k as usize + 1) % 3);
            let mut dir = DVec3::ZERO;
            dir[a] = [1.0, -1.0][k as usize / 3 % 2];
            let mut start = at;
            start[a] = -3.0 * dir[a];
            let near = Ray::new(start, dir);
            let wanted = julia.trace(&near, &mut JuliaCounts::default());
            for far in [1e4, 1e9, 1e18, 1e100, 1e300] {
                start[a] = -far * dir[a];
                for pace in [1.0, 1e-320, 1e-200, 1e120, 1e300] {
                    let ray = Ray::new(start, dir * pace);
                    match (wanted, julia.trace(&ray, &mut JuliaCounts::default())) {
                        (Traced::Missed, Traced::Missed) => misses += 1,
                        (Traced::Met(_), Traced::Met(t)) => {
                            hits += 1;
                            let off = (t * pace - (far - 3.0 + met(wanted))).abs() / far;
                            assert!(
                                t == f64::MAX || off < 1e-9 + 1e-5 / far || pace < 1e-300,
                                "{off} {ray:?}"
                            );
                            let hit = julia.intersect(&ray).unwrap();
                            let surface = julia.surface(&ray, &hit);
                            // On the same line, wherever `t` says it is.
                            let off = (surface.point - at) * (DVec3::ONE - dir.abs());
                            assert!(off.abs().max_element() < 1e-12, "{surface:?} {ray:?}");
                            assert!(
                                (surface.point[a] * dir[a] + 3.0 - met(wanted)).abs() < 1e-3,
                                "{surface:?} {wanted:?}"
                            );
                        }
                        // One more step or less at a graze.
                        (Traced::Unresolved(_), _) | (_, Traced::Unresolved(_)) => {}
                        (wanted, found) => panic!("{wanted:?} {found:?} {ray:?} {b}"),
                    }
                }
            }
        }
    }
    println!("{hits} hits, {misses} misses");
    assert!(hits > 500 && misses > 500, "{hits} {misses}");
}

fn met(traced: Traced) -> f64 {
    match traced {
        Traced::Met(t) | Traced::Unresolved(t) => t,
        Traced::Missed => f64::NAN,
    }
}

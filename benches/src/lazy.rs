//! What does it gain to refine surfaces only where rays come near?
//!
//! A hundred teapots on a floor, each a surface of its own, and rays at ten of them. Timed is all of it, from control points to
//! the last ray; and then rays alone, when everything they need has been refined.

use crate::contest::{Group, Measured, Mismatch, Weigh, mark_front};
use crate::patches::nobody_missed;
use crate::{Effort, Trouble, Watch, hear};
use core::hint::black_box;
use rt_accel::{Aggregate, BuildError, Hit, Member, Primitive};
use rt_bounds::Aabb;
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::clock::race;
use rt_measure::rays;
use rt_shapes::{BezierPatch, Lazy, Tessellation, Uv};
use std::time::Instant;

/// Pots a side.
const SIDE: usize = 10;
/// Segments of a patch: 4032 triangles a pot.
const SEGMENTS: u32 = 8;

type Pots = Aggregate<Bvh, Vec<Lazy<Bvh, Tessellation>>>;
type Answer = Option<Hit<Member<Uv>, f64>>;

/// The surfaces, none of them refined, under one tree.
fn pots(surfaces: &[Tessellation]) -> Result<Pots, BuildError> {
    let lazy = surfaces.iter().map(|surface| Lazy::new(surface.clone(), BvhParams::default()));
    Aggregate::build(lazy.collect(), &BvhParams::default())
}

/// The same, all of them refined.
fn eager(surfaces: &[Tessellation]) -> Result<Pots, BuildError> {
    let pots = pots(surfaces)?;
    for pot in pots.geometry() {
        pot.refine_now().map_err(BuildError::clone)?;
    }
    Ok(pots)
}

fn refined(pots: &Pots) -> usize {
    pots.geometry().iter().filter(|pot| pot.refined().is_some()).count()
}

fn bytes(pots: &Pots) -> usize {
    let mesh = |pot: &Lazy<Bvh, Tessellation>| match pot.refined() {
        // Nodes; vertices with normals and coordinates; triangles.
        Some(Ok(parts)) => {
            let mesh = parts.geometry();
            rt_accel::Structure::bytes(parts.structure())
                + mesh.vertices().len() * 44
                + mesh.triangles().len() * 12
        }
        _ => 0,
    };
    pots.geometry().iter().map(mesh).sum()
}

fn shoot(pots: &Pots, rays: &[Ray<f64>], answers: &mut [Answer]) {
    for (answer, ray) in answers.iter_mut().zip(rays) {
        *answer = pots.intersect(ray);
    }
    black_box(answers);
}

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    hear(watch, 0, 2)?;
    let surfaces: Vec<Tessellation> = (0..SIDE * SIDE)
        .map(|k| {
            let at = DVec3::new((k % SIDE) as f64 * 8.0, (k / SIDE) as f64 * 6.0, 0.0);
            let moved = |net: [DVec3; 16]| BezierPatch::new(net.map(|p| p + at)).ok();
            Tessellation { patches: rt_scenes::teapot_nets().filter_map(moved).collect(), segments: SEGMENTS }
        })
        .collect();
    // The first row: chords of its box, which stay near it for the length that counts.
    let row = surfaces[..SIDE]
        .iter()
        .fold(Aabb::EMPTY, |all, pot| all.union(rt_accel::WorldBound::world_bound(pot)));
    let rays: Vec<Ray<f64>> = rays::uniform::<f64>(1, &row, effort.rays() * 8)
        .into_iter()
        .filter_map(|ray| near(&ray, &row))
        .collect();
    let (lazy, full) = (pots(&surfaces)?, eager(&surfaces)?);
    let mut answers = [vec![None; rays.len()], vec![None; rays.len()]];
    let [a, b] = &mut answers;
    shoot(&lazy, &rays, a);
    shoot(&full, &rays, b);
    if a != b {
        let what = "answers differ".to_string();
        let outcome = Err(Mismatch { who: "lazy".into(), what });
        return Ok(vec![group(&lazy, "row", rays.len(), outcome)]);
    }
    let touched = refined(&lazy);
    let builds: [f64; 2] = [build_ms(|| pots(&surfaces)), build_ms(|| eager(&surfaces))];
    let row = |k: usize, race: &rt_measure::clock::Race, build: Option<f64>, pots: &Pots, params: String| {
        Measured {
            structure: ["eager", "lazy"][k].into(),
            params,
            build_ms: build,
            bytes_per_prim: Some(bytes(pots) as f64 / (SIDE * SIDE) as f64),
            ns_per_ray: race.median(k) / rays.len().max(1) as f64,
            spread: race.spread(k),
            speed: race.ratio(0, k),
            error: nobody_missed(rays.len()),
            ..Measured::default()
        }
    };
    let total = race(
        effort.builds(),
        &mut [
            &mut || {
                if let Ok(pots) = eager(&surfaces) {
                    shoot(&pots, &rays, b)
                }
            },
            &mut || {
                if let Ok(pots) = pots(&surfaces) {
                    shoot(&pots, &rays, a)
                }
            },
        ],
    );
    hear(watch, 1, 2)?;
    let after = race(effort.plan(), &mut [&mut || shoot(&full, &rays, b), &mut || shoot(&lazy, &rays, a)]);
    let mut groups = Vec::new();
    for (race, what, with_build) in [(total, "build and rays", true), (after, "rays alone", false)] {
        let build = |k: usize| with_build.then_some(builds[1 - k]);
        let name = |n: usize| format!("{what} segments={SEGMENTS} refined={n}");
        let mut measured = vec![
            row(0, &race, build(0), &full, name(SIDE * SIDE)),
            row(1, &race, build(1), &lazy, name(touched)),
        ];
        mark_front(&mut measured, Weigh::Error);
        groups.push(group(&lazy, "row", rays.len(), Ok(measured)));
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// The ray from where it enters the box to where it leaves it, so that it touches no other row.
fn near(ray: &Ray<f64>, b: &Aabb) -> Option<Ray<f64>> {
    let (mut from, mut to) = (0.0f64, f64::INFINITY);
    for a in 0..3 {
        let [p, q] = [b.min[a], b.max[a]].map(|x| (f64::from(x) - ray.origin[a]) / ray.dir[a]);
        (from, to) = (from.max(p.min(q)), to.min(p.max(q)));
    }
    (from < to).then(|| ray.between(from, to))
}

fn build_ms(build: impl Fn() -> Result<Pots, BuildError>) -> f64 {
    let mut times: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            black_box(build().is_ok());
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[1]
}

fn group(pots: &Pots, kind: &str, rays: usize, outcome: Result<Vec<Measured>, Mismatch>) -> Group {
    Group {
        scene: "pots-100".into(),
        prims: pots.geometry().len(),
        ray_kind: kind.into(),
        rays,
        judged: rays,
        outcome,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "builds two hundred pots"]
    fn a_tenth_is_refined() {
        let groups = ask(Effort::Quick, &mut |_| core::ops::ControlFlow::Continue(())).unwrap();
        for group in groups {
            let measured = group.outcome.unwrap();
            assert!(measured[1].params.ends_with("refined=10"), "{measured:?}");
        }
    }
}

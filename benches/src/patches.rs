//! Patches met directly, or triangles in their place?
//!
//! The knob is the number of segments; the errors are those against the patches themselves: rays that hit one and not the
//! other, and how far the triangles are, where they are hit, from the points of the patches whose parameters they share. That is
//! the distance from the surface or more, as a share of the size of the pot, the diagonal of its box.

use crate::contest::{Group, Measured, Weigh, mark_front};
use crate::{Effort, Trouble, Watch, hear};
use core::hint::black_box;
use rt_accel::{Aggregate, BuildError, Counts, Primitive, Structure, WorldBound};
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::clock::race;
use rt_measure::error::HitError;
use rt_measure::rays::{self, Pinhole};
use rt_measure::record::ErrorKind;
use rt_shapes::{BezierPatch, Refine, Shape, Tessellation};
use std::time::Instant;

/// Segments that are swept.
const SEGMENTS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];

/// No errors in as many rays.
pub(crate) fn nobody_missed(rays: usize) -> HitError {
    HitError { rays: rays as u64, ..HitError::default() }
}

/// What distances are, against those that are right: hits lost and made up, and the largest error in units of `f64`'s last
/// place. Primitives are not compared: a patch is not a triangle.
pub(crate) fn against(truth: &[Option<f64>], found: &[Option<f64>]) -> HitError {
    let mut error = nobody_missed(truth.len());
    for pair in truth.iter().zip(found) {
        match pair {
            (Some(t), Some(s)) => error.t_ulp = error.t_ulp.max((t - s).abs() / (t.abs() * f64::EPSILON)),
            (Some(_), None) => error.missed += 1,
            (None, Some(_)) => error.invented += 1,
            (None, None) => {}
        }
    }
    error
}

/// How far a ray goes, counted.
type Ask<'a> = Box<dyn Fn(&Ray<f64>, &mut Counts) -> Option<f64> + 'a>;
/// How far from the right surface a ray hits, as a share of its size.
type Off<'a> = Box<dyn Fn(&Ray<f64>) -> Option<f64> + 'a>;
/// Many rays at once, for the clock.
type Shoot<'a> = Box<dyn Fn(&[Ray<f64>]) + 'a>;

/// Someone who says how far rays go, with what was counted while building.
pub(crate) struct Contender<'a> {
    pub(crate) structure: String,
    pub(crate) params: String,
    pub(crate) build_ms: f64,
    pub(crate) bytes_per_prim: f64,
    pub(crate) ask: Ask<'a>,
    pub(crate) shoot: Shoot<'a>,
    pub(crate) off: Option<Off<'a>>,
}

impl<'a> Contender<'a> {
    pub(crate) fn new<P: Primitive<f64> + 'a>(
        (structure, params): (&str, String),
        (build_ms, bytes_per_prim): (f64, f64),
        shape: &'a P,
    ) -> Contender<'a> {
        Contender {
            structure: structure.into(),
            params,
            build_ms,
            bytes_per_prim,
            ask: Box::new(|ray, counts| shape.intersect_counted(ray, counts).map(|hit| hit.t)),
            shoot: Box::new(|rays| {
                for ray in rays {
                    black_box(shape.intersect(ray).map(|hit| hit.t));
                }
            }),
            off: None,
        }
    }

    /// Judged by the distance from the right surface, not by that along rays, which at a graze is any number.
    pub(crate) fn off_by(self, off: impl Fn(&Ray<f64>) -> Option<f64> + 'a) -> Contender<'a> {
        Contender { off: Some(Box::new(off)), ..self }
    }
}

/// Races contenders; the first one is right. Where one is judged by distances from it, all are.
pub(crate) fn compare(
    (scene, prims): (&str, usize),
    (kind, rays): (&str, &[Ray<f64>]),
    effort: Effort,
    contenders: &[Contender<'_>],
) -> Group {
    let mut said: Vec<Vec<Option<f64>>> = Vec::new();
    let mut work = Vec::new();
    for contender in contenders {
        let mut counts = Counts::default();
        said.push(rays.iter().map(|ray| (contender.ask)(ray, &mut counts)).collect());
        work.push(counts);
    }
    let mut shots: Vec<_> =
        contenders.iter().map(|contender| || (contender.shoot)(black_box(rays))).collect();
    let mut runs: Vec<&mut dyn FnMut()> = Vec::new();
    for shot in &mut shots {
        runs.push(shot);
    }
    let race = race(effort.plan(), &mut runs);
    let n = rays.len().max(1) as f64;
    let by_distance = contenders.iter().any(|contender| contender.off.is_some());
    let largest = |contender: &Contender<'_>| {
        let off = contender.off.as_ref().map(|off| rays.iter().filter_map(off).fold(0.0, f64::max));
        (ErrorKind::Distance, off.unwrap_or(0.0))
    };
    let measured = contenders.iter().enumerate().map(|(k, contender)| Measured {
        structure: contender.structure.clone(),
        params: contender.params.clone(),
        build_ms: Some(contender.build_ms),
        bytes_per_prim: Some(contender.bytes_per_prim),
        ns_per_ray: race.median(k) / n,
        spread: race.spread(k),
        speed: race.ratio(0, k),
        nodes_per_ray: Some(work[k].nodes as f64 / n),
        tests_per_ray: Some(work[k].prims as f64 / n),
        error: against(&said[0], &said[k]),
        has_t: !by_distance,
        off: by_distance.then(|| largest(contender)),
        ..Measured::default()
    });
    let mut measured: Vec<Measured> = measured.collect();
    mark_front(&mut measured, if by_distance { Weigh::Off } else { Weigh::Error });
    Group {
        scene: scene.into(),
        prims,
        ray_kind: kind.into(),
        rays: rays.len(),
        judged: rays.len(),
        outcome: Ok(measured),
    }
}

/// Milliseconds that something took, and what it made.
pub(crate) fn timed<T>(make: impl FnOnce() -> Result<T, BuildError>) -> Result<(f64, T), BuildError> {
    let start = Instant::now();
    let made = make()?;
    Ok((start.elapsed().as_secs_f64() * 1e3, made))
}

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    hear(watch, 0, 3)?;
    let params = BvhParams::default();
    let patches: Vec<BezierPatch> =
        rt_scenes::teapot_nets().filter_map(|net| BezierPatch::new(net).ok()).collect();
    let count = patches.len();
    // One patch a leaf: a patch costs as much as some tens of nodes.
    let alone = BvhParams { leaf_prims: 1, ..params };
    let (ms, direct) = timed(|| Aggregate::<Bvh, _>::build(patches.clone(), &alone))?;
    let size = |bytes: usize| bytes as f64 / count as f64;
    let mut meshes = Vec::new();
    for segments in SEGMENTS {
        let pot = Tessellation { patches: patches.clone(), segments };
        meshes.push((segments, timed(|| Aggregate::<Bvh, _>::build(pot.refine()?, &params))?));
    }
    let world = direct.world_bound();
    let extent = f64::from(world.size().length());
    let direct_bytes = size(direct.structure().bytes() + count * size_of::<BezierPatch>());
    let mut contenders = vec![Contender::new(("patches", "direct f64".into()), (ms, direct_bytes), &direct)];
    for (segments, (ms, mesh)) in &meshes {
        let (vertices, triangles) = (mesh.geometry().vertices().len(), mesh.geometry().triangles().len());
        let bytes = size(mesh.structure().bytes() + vertices * 44 + triangles * 12);
        let name = format!("segments={segments} f64 fast");
        let (patches, corners) = (&patches, ((segments + 1) * (segments + 1)) as usize);
        let off = move |ray: &Ray<f64>| {
            let hit = mesh.intersect(ray)?;
            let surface = mesh.surface(ray, &hit);
            let first = mesh.geometry().triangles()[hit.at.prim as usize][0];
            let patch = patches.get(first as usize / corners)?;
            Some(surface.point.distance(patch.point(surface.uv.x, surface.uv.y)) / extent)
        };
        contenders.push(Contender::new(("triangles", name), (*ms, bytes), mesh).off_by(off));
    }
    let side = (effort.rays() as f64).sqrt() as usize;
    let camera = Pinhole {
        eye: DVec3::new(4.0, -9.0, 6.0),
        target: DVec3::new(0.2, 0.0, 1.4),
        up: DVec3::Z,
        half_height: 0.36,
        width: side,
        height: side,
    };
    let sets = [
        ("primary", rays::primary::<f64>(&camera)),
        ("chords", rays::uniform::<f64>(1, &world, effort.rays())),
    ];
    let mut groups = Vec::new();
    for (k, (kind, rays)) in sets.iter().enumerate() {
        hear(watch, k + 1, 3)?;
        groups.push(compare(("teapot", count), (kind, rays), effort, &contenders));
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "a whole question"]
    fn more_segments_are_nearer() {
        for group in ask(Effort::Quick, &mut |_| core::ops::ControlFlow::Continue(())).unwrap() {
            let measured = group.outcome.unwrap();
            let wrong: Vec<f64> = measured.iter().map(|m| m.error.wrong_per_million()).collect();
            assert!(wrong[0] == 0.0 && wrong[1] > 20.0 * wrong[7], "{wrong:?}");
            let off: Vec<f64> = measured.iter().map(|m| m.off.unwrap().1).collect();
            assert!(off[0] == 0.0 && off[1..].windows(2).all(|pair| pair[1] < 0.5 * pair[0]), "{off:?}");
        }
    }
}

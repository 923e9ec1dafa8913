//! Terrains made where rays come near, or kept as triangles? And what do a terrain and a Julia set cost, how closely?
//!
//! Distances are shares of the extent. Of a terrain: how far above or below the finest level rays hit a coarser one, which is the
//! distance of the two or more. Of a Julia set: how large a ball around where a ray hits holds no point of the set, proved; the set
//! is no nearer, and by the estimate not four times as far.

use crate::patches::{Contender, compare, timed};
use crate::{Effort, Trouble, Watch, contest::Group, hear};
use rt_accel::{Aggregate, Primitive, Structure, WorldBound};
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::rays;
use rt_shapes::{Fractal, Julia, JuliaParams, Refine, Terrain, TerrainParams};

/// Levels of the terrain: half a million facets.
const LEVEL: u32 = 9;
/// How many of them are cached.
const CACHED: [u32; 4] = [0, 3, 6, 9];
/// Levels of the terrain that others are compared with: eight million facets; and up to which triangles are kept.
const FINEST: u32 = 11;
const KEPT: u32 = 9;
/// How closely it is met; 0 is exactly.
const RELIEF: [f64; 8] = [0.0, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3];
/// How closely the set is met; the first is taken for right.
const TOLERANCES: [f64; 6] = [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    hear(watch, 0, 3)?;
    let mut groups = vec![terrain(effort)?];
    hear(watch, 1, 3)?;
    groups.push(relief(effort)?);
    hear(watch, 2, 3)?;
    groups.push(julia(effort)?);
    hear(watch, 1, 1)?;
    Ok(groups)
}

fn terrain(effort: Effort) -> Result<Group, Trouble> {
    let make = |cached| {
        Terrain::new(Fractal::default(), TerrainParams { level: LEVEL, cached, ..Default::default() })
    };
    let plain = make(0)?;
    let facets = plain.facet_count() as usize;
    let (ms, mesh) = timed(|| Aggregate::<Bvh, _>::build(plain.refine()?, &BvhParams::default()))?;
    let bytes = mesh.structure().bytes() + mesh.geometry().vertices().len() * 24 + facets * 12;
    let mut made = Vec::new();
    for cached in CACHED {
        made.push((cached, timed(|| make(cached))?));
    }
    let size = |bytes: usize| bytes as f64 / facets as f64;
    let mut contenders = vec![Contender::new(("mesh", "explicit f64".into()), (ms, size(bytes)), &mesh)];
    for (cached, (ms, terrain)) in &made {
        let name = format!("cached={cached} f64");
        contenders.push(Contender::new(("terrain", name), (*ms, size(terrain.bytes())), terrain));
    }
    let rays = rays::uniform::<f64>(1, &plain.world_bound(), effort.rays() / 2);
    Ok(compare(("fractal-9", facets), ("chords", &rays), effort, &contenders))
}

/// What tolerance buys, and what the triangles of the same levels cost.
fn relief(effort: Effort) -> Result<Group, Trouble> {
    let mut terrains = Vec::new();
    for tolerance in RELIEF {
        let params = TerrainParams { level: FINEST, tolerance, ..Default::default() };
        terrains.push((tolerance, timed(|| Terrain::new(Fractal::default(), params))?));
    }
    let (_, (_, finest)) = &terrains[0];
    let mut meshes = Vec::new();
    for (_, (_, terrain)) in &terrains {
        let level = terrain.params().level;
        if level <= KEPT && meshes.last().is_none_or(|&(last, _)| last != level) {
            let build = || Aggregate::<Bvh, _>::build(terrain.refine()?, &BvhParams::default());
            meshes.push((level, timed(build)?));
        }
    }
    let extent = finest.params().size.max_element();
    let top = f64::from(finest.world_bound().max.z) + 1.0;
    let off = |hit: DVec3| {
        let down = finest.intersect(&Ray::new(hit.with_z(top), DVec3::NEG_Z))?;
        Some((hit.z - (top - down.t)).abs() / extent)
    };
    let size = |bytes: usize, facets: usize| bytes as f64 / facets as f64;
    let mut contenders = Vec::new();
    for (tolerance, (ms, terrain)) in &terrains {
        let name = format!("tolerance={tolerance} level={} f64", terrain.params().level);
        let bytes = size(terrain.bytes(), terrain.facet_count() as usize);
        let contender = Contender::new(("terrain", name), (*ms, bytes), terrain);
        // The first is right.
        contenders.push(match contenders.len() {
            0 => contender,
            _ => contender.off_by(|ray| off(ray.at(terrain.intersect(ray)?.t))),
        });
    }
    for (level, (ms, mesh)) in &meshes {
        let (vertices, facets) = (mesh.geometry().vertices().len(), mesh.geometry().triangles().len());
        let bytes = size(mesh.structure().bytes() + vertices * 24 + facets * 12, facets);
        let contender = Contender::new(("triangles", format!("level={level} f64")), (*ms, bytes), mesh);
        contenders.push(contender.off_by(|ray| off(ray.at(mesh.intersect(ray)?.t))));
    }
    let rays = rays::uniform::<f64>(1, &finest.world_bound(), effort.rays() / 2);
    let scene = format!("fractal-{FINEST}");
    Ok(compare((&scene, finest.facet_count() as usize), ("chords", &rays), effort, &contenders))
}

fn julia(effort: Effort) -> Result<Group, Trouble> {
    let mut sets = Vec::new();
    for tolerance in TOLERANCES {
        sets.push((
            tolerance,
            timed(|| Julia::new(JuliaParams { tolerance, steps: 1 << 16, ..Default::default() }))?,
        ));
    }
    let (_, (_, finest)) = &sets[0];
    let extent = f64::from(finest.world_bound().size().max_element());
    let mut contenders = Vec::new();
    for (tolerance, (ms, julia)) in &sets {
        let name = format!("tolerance={tolerance:e} fast f64");
        let off = |ray: &Ray<f64>| Some(finest.clearance(ray.at(julia.intersect(ray)?.t)) / extent);
        contenders.push(Contender::new(("julia", name), (*ms, 0.0), julia).off_by(off));
    }
    let rays = rays::uniform::<f64>(1, &finest.world_bound(), effort.rays() / 16);
    Ok(compare(("julia", 1), ("chords", &rays), effort, &contenders))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "a whole question"]
    fn terrains_are_exact_and_sets_are_never_missed() {
        let groups = ask(Effort::Quick, &mut |_| core::ops::ControlFlow::Continue(())).unwrap();
        let [terrain, relief, julia] = &groups[..] else { panic!("{groups:?}") };
        for measured in terrain.outcome.as_ref().unwrap() {
            assert!(measured.error.is_exact() && measured.error.t_ulp == 0.0, "{measured:?}");
        }
        for (measured, tolerance) in relief.outcome.as_ref().unwrap().iter().zip(RELIEF) {
            assert!(measured.off.unwrap().1 <= tolerance, "{measured:?}");
        }
        for (measured, tolerance) in julia.outcome.as_ref().unwrap().iter().zip(TOLERANCES) {
            assert_eq!(measured.error.missed, 0, "{measured:?}");
            assert!(measured.off.unwrap().1 <= tolerance, "{measured:?}");
        }
    }
}

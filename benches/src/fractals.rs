//! Terrains made where rays come near, or kept as triangles? And what does a Julia set cost, how closely?

use crate::patches::{Contender, compare, timed};
use crate::{Effort, Trouble, Watch, contest::Group, hear};
use rt_accel::{Aggregate, Structure, WorldBound};
use rt_bvh::{Bvh, BvhParams};
use rt_measure::rays;
use rt_shapes::{Fractal, Julia, JuliaParams, Refine, Terrain, TerrainParams};

/// Levels of the terrain: half a million facets.
const LEVEL: u32 = 9;
/// How many of them are cached.
const CACHED: [u32; 4] = [0, 3, 6, 9];
/// How closely the set is met; the first is taken for right.
const TOLERANCES: [f64; 6] = [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    hear(watch, 0, 2)?;
    let mut groups = vec![terrain(effort)?];
    hear(watch, 1, 2)?;
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

fn julia(effort: Effort) -> Result<Group, Trouble> {
    let mut sets = Vec::new();
    for tolerance in TOLERANCES {
        sets.push((
            tolerance,
            timed(|| Julia::new(JuliaParams { tolerance, steps: 1 << 16, ..Default::default() }))?,
        ));
    }
    let mut contenders = Vec::new();
    for (tolerance, (ms, julia)) in &sets {
        let name = format!("tolerance={tolerance:e} fast f64");
        contenders.push(Contender::new(("julia", name), (*ms, 0.0), julia));
    }
    let (_, (_, finest)) = &sets[0];
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
        let [terrain, julia] = &groups[..] else { panic!("{groups:?}") };
        for measured in terrain.outcome.as_ref().unwrap() {
            assert!(measured.error.is_exact() && measured.error.t_ulp == 0.0, "{measured:?}");
        }
        for measured in julia.outcome.as_ref().unwrap() {
            assert_eq!(measured.error.missed, 0, "{measured:?}");
        }
    }
}

//! Which structure for which scene?
//!
//! All rays of a picture, recursive and to the lights, sampled with equal shares. Beside the structures in their best forms stand
//! grids as published, with cells in primitives' boxes and no mailbox: those of the table that every course shows.
//!
//! Sources: Havran and Sixta, "Comparison of hierarchical grids", Ray Tracing News 12(1), 1999; Havran and Purgathofer, "On
//! comparing ray shooting algorithms", Computers & Graphics 27(4), 2003.

use crate::contest::{Group, Measured, Mismatch, Named, Weigh, build_all, mark_front};
use crate::field::{Fielded, Population, Truth, field, field_named};
use crate::subdivision;
use crate::subject::split_size;
use crate::{Effort, Options, Trouble, Watch, hear, roster};
use rt_accel::{Bounded, BuildError, Clip, Mailing};
use rt_grid::{Grid, GridParams, Nest, Resolution, Skip};
use rt_measure::clock::race;
use rt_measure::error::HitError;
use rt_scenes::{Scene, SceneGeometry};
use rt_shapes::Surfaced;

const SCENES: [&str; 9] =
    ["balls", "rings", "tree", "gears", "mount", "teapot", "tetra", "lattice", "stadium"];

/// A grid of the table, and what comes of it: cells without references, references, tests, steps and steps through empty cells by
/// ray; each primitive in the cells that its box overlaps, no mailbox, all rays averaged.
///
/// Recomputed by an independent program in `f64`; within 5 % of what Havran and Sixta give.
struct Known {
    scene: &'static str,
    name: &'static str,
    cells: [u32; 3],
    empty: f64,
    tests: f64,
    steps: f64,
    empty_steps: f64,
}

const fn known(
    scene: &'static str,
    name: &'static str,
    cells: [u32; 3],
    [empty, tests, steps, empty_steps]: [f64; 4],
) -> Known {
    Known { scene, name, cells, empty, tests, steps, empty_steps }
}

const KNOWN: [Known; 9] = [
    known("balls", "D=1", [46, 46, 3], [4208.0, 348.98, 5.74, 3.01]),
    known("balls", "D=10", [103, 103, 7], [63395.0, 68.85, 12.51, 9.30]),
    known("balls", "D=20", [152, 152, 9], [184191.0, 39.75, 17.49, 13.90]),
    known("rings", "D=1", [21, 20, 21], [6262.0, 46.18, 11.70, 7.27]),
    known("rings", "D=10", [44, 43, 44], [67367.0, 23.99, 24.35, 18.80]),
    known("rings", "D=20", [60, 60, 60], [178845.0, 22.46, 33.49, 26.96]),
    known("tree", "D=1", [52, 52, 3], [5400.0, 734.88, 7.64, 4.63]),
    known("tree", "D=10", [117, 118, 5], [55191.0, 248.23, 15.53, 12.05]),
    known("tree", "D=20", [60, 60, 60], [212177.0, 341.13, 54.98, 44.28]),
];

/// Grids as they were in 1999.
pub(crate) fn classic(resolution: Resolution) -> GridParams {
    GridParams {
        resolution,
        clip: Clip::Box,
        mailing: Mailing::None,
        skip: Skip::None,
        nest: Nest::Never,
        ..GridParams::default()
    }
}

/// The table's grids for a scene: those known, or of about as many cells.
fn table(scene: &str) -> Vec<(&'static str, GridParams)> {
    let of = |name: &'static str, density: f32| {
        let known = KNOWN.iter().find(|known| known.scene == scene && known.name == name);
        let resolution = known.map_or(Resolution::Density(density), |known| Resolution::Fixed(known.cells));
        (name, classic(resolution))
    };
    vec![of("D=1", 1.0), of("D=10", 10.0), of("D=20", 20.0), ("pbrt", classic(Resolution::Pharr))]
}

pub(crate) fn ask(options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let names: Vec<String> = match &options.scenes {
        Some(subjects) => subjects.iter().map(|subject| subject.name.clone()).collect(),
        None => SCENES.map(String::from).to_vec(),
    };
    let mut groups = Vec::new();
    for (i, name) in names.iter().enumerate() {
        hear(watch, i, names.len())?;
        let (scene, size) = split_size(name);
        let mut scene = rt_scenes::by_name(scene, size).map_err(|e| Trouble::Scene(e.to_string()))?;
        let geometry = core::mem::replace(&mut scene.geometry, SceneGeometry::Solids(Vec::new()));
        groups.push(match geometry {
            SceneGeometry::Mesh(mesh) => compare(name, &scene, &mesh, options.effort)?,
            SceneGeometry::Solids(solids) => compare(name, &scene, &solids, options.effort)?,
            _ => return Err(Trouble::Scene(format!("{name}: rays of f32 cannot see this scene"))),
        });
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// Builds a structure.
pub(crate) type Builder<'a> = Box<dyn FnMut() -> Result<Box<dyn Fielded + 'a>, BuildError> + 'a>;

fn compare<G>(name: &str, scene: &Scene, geometry: &G, effort: Effort) -> Result<Group, Trouble>
where
    G: Surfaced<f32> + Bounded,
    G::At: Named,
{
    let side = if effort == Effort::Quick { 128 } else { 512 };
    let rays = Population::of_picture(scene, geometry, side, effort.rays())?;
    let truth = Truth::of(geometry, &rays, effort.judged())?;
    let mut schemes: Vec<(String, String, Builder<'_>)> = Vec::new();
    for &name in roster::NAMES.iter().filter(|name| **name != "exhaustive") {
        schemes.push((name.into(), "f32".into(), Box::new(move || field_named(name, geometry))));
    }
    for (name, params) in table(name) {
        let build = Box::new(move || field::<Grid, G>(geometry, &params));
        schemes.push(("grid".into(), format!("{name} classic f32"), build));
    }
    let outcome = raced(name, geometry.prim_count(), &mut schemes, &rays, &truth, effort)?;
    Ok(Group {
        scene: name.into(),
        prims: geometry.prim_count(),
        ray_kind: "picture".into(),
        rays: rays.len(),
        judged: truth.len(),
        outcome,
    })
}

/// Builds schemes (a name, parameters, how), judges all answers and lets them race.
pub(crate) fn raced<'a>(
    scene: &str,
    prims: usize,
    schemes: &mut [(String, String, Builder<'a>)],
    rays: &Population,
    truth: &Truth,
    effort: Effort,
) -> Result<Result<Vec<Measured>, Mismatch>, Trouble> {
    let mut turns: Vec<&mut dyn FnMut() -> Result<Box<dyn Fielded + 'a>, BuildError>> = Vec::new();
    let mut labels = Vec::new();
    for (name, params, build) in schemes.iter_mut() {
        labels.push((name.clone(), params.clone()));
        turns.push(&mut **build);
    }
    let mut built = Vec::new();
    for (structure, ms) in build_all(effort.builds(), &mut turns) {
        built.push((structure?, ms));
    }
    let mut first: Option<(Vec<_>, Vec<_>)> = None;
    for ((name, params), (structure, _)) in labels.iter().zip(&built) {
        let (closest, any) = (structure.closest(&rays.closest), structure.any(&rays.any));
        let what = truth.differ(&closest, &any).or_else(|| {
            let (c, a) = first.as_ref()?;
            (*c != closest || *a != any).then(|| format!("differs from {} {}", labels[0].0, labels[0].1))
        });
        if let Some(what) = what {
            return Ok(Err(Mismatch { who: format!("{name} {params}"), what }));
        }
        first.get_or_insert((closest, any));
    }
    let mut closures: Vec<_> = built.iter().map(|(structure, _)| || structure.shoot(rays)).collect();
    let mut shots: Vec<&mut dyn FnMut()> = Vec::new();
    for closure in &mut closures {
        shots.push(closure);
    }
    let race = race(effort.plan(), &mut shots);
    let count = rays.len().max(1) as f64;
    let per_prim = |n: usize| n as f64 / prims.max(1) as f64;
    let mut measured: Vec<Measured> = Vec::new();
    for (i, ((name, params), (structure, ms))) in labels.iter().zip(&built).enumerate() {
        let counts = structure.counts(rays);
        let by_ray = |n: u64| n as f64 / count;
        let empty = by_ray(counts.nodes.saturating_sub(counts.leaves));
        let [leaves, references] = structure.leaves();
        let mut figures = vec![("refs", per_prim(references))];
        if name.starts_with("grid") {
            figures.push(("empty", empty));
        }
        let known = KNOWN.iter().find(|k| k.scene == scene && params.split(' ').next() == Some(k.name));
        if let Some(known) = known.filter(|_| params.contains("classic")) {
            let off = |is: f64, was: f64| 100.0 * (is / was - 1.0);
            figures.push(("tests_%", off(by_ray(counts.prims), known.tests)));
            figures.push(("steps_%", off(by_ray(counts.nodes), known.steps)));
            figures.push(("empty_%", off(empty, known.empty_steps)));
            let cells: u32 = known.cells.iter().product();
            figures.push(("empty_cells_%", off(cells as f64 - leaves as f64, known.empty)));
        }
        if let Some([tests, steps]) = side_of(params).and_then(|n| subdivision::known(scene, n)) {
            figures.push(("tests_%", 100.0 * (by_ray(counts.prims) / tests - 1.0)));
            figures.push(("steps_%", 100.0 * (by_ray(counts.nodes) / steps - 1.0)));
        }
        measured.push(Measured {
            structure: name.clone(),
            params: params.clone(),
            build_ms: Some(*ms),
            bytes_per_prim: Some(per_prim(structure.bytes())),
            ns_per_ray: race.median(i) / count,
            spread: race.spread(i),
            speed: race.ratio(0, i),
            nodes_per_ray: Some(by_ray(counts.nodes)),
            tests_per_ray: Some(by_ray(counts.prims)),
            error: HitError { rays: truth.len() as u64, ..HitError::default() },
            figures,
            ..Measured::default()
        });
    }
    to_the_best(&mut measured);
    mark_front(&mut measured, Weigh::BuildTime);
    Ok(Ok(measured))
}

/// The cells a side of a cube without mailbox, from its parameters.
fn side_of(params: &str) -> Option<u32> {
    params.strip_prefix("n=")?.strip_suffix(" mailing=none")?.parse().ok()
}

/// Each figure as a multiple of the least in the group.
fn to_the_best(measured: &mut [Measured]) {
    type Figure = fn(&Measured) -> Option<f64>;
    let columns: [(&str, Figure); 6] = [
        ("build_x", |m| m.build_ms),
        ("trace_x", |m| Some(m.ns_per_ray)),
        ("tests_x", |m| m.tests_per_ray),
        ("steps_x", |m| m.nodes_per_ray),
        ("refs_x", |m| m.figures.iter().find(|(name, _)| *name == "refs").map(|(_, x)| *x)),
        ("bytes_x", |m| m.bytes_per_prim),
    ];
    for (name, figure) in columns {
        let least = measured.iter().filter_map(figure).fold(f64::INFINITY, f64::min);
        for m in &mut *measured {
            if let Some(x) = figure(m) {
                m.figures.push((name, x / least));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_accel::{Geometry, Hit, Member};
    use rt_bounds::Aabb;
    use rt_geom::Ray;
    use rt_geom::glam::DVec3;
    use rt_scenes::Solid;
    use rt_shapes::Uv;

    /// Solids with cylinders and cones in the boxes of the balls at their ends, as those who made the table had them.
    struct Loose(Vec<Solid>);

    impl Bounded for Loose {
        fn prim_count(&self) -> usize {
            self.0.len()
        }
        fn bound(&self, prim: u32) -> Aabb {
            let Some(Solid::Frustum(frustum)) = self.0.get(prim as usize) else { return self.0.bound(prim) };
            let ends = frustum.ends().into_iter().zip(frustum.radii());
            ends.fold(Aabb::EMPTY, |all, (end, radius)| {
                all.union(Aabb::from_f64(end - radius, end + radius, DVec3::ZERO))
            })
        }
    }

    impl Geometry<f32> for Loose {
        type At = Member<Uv>;
        fn intersect(&self, prim: u32, ray: &Ray) -> Option<Hit<Member<Uv>>> {
            self.0.intersect(prim, ray)
        }
    }

    /// Tests, steps and empty steps of the nine grids within 5 % of those known, and empty cells within 0.5 %.
    #[test]
    fn the_table_comes_out() {
        for name in ["balls", "rings", "tree"] {
            let mut scene = rt_scenes::by_name(name, None).unwrap();
            let geometry = core::mem::replace(&mut scene.geometry, SceneGeometry::Solids(Vec::new()));
            let SceneGeometry::Solids(solids) = geometry else { panic!("{name} has solids") };
            let rays = Population::of_picture(&scene, &solids, 256, 30_000).unwrap();
            let loose = Loose(solids);
            for known in KNOWN.iter().filter(|known| known.scene == name) {
                let grid = field::<Grid, Loose>(&loose, &classic(Resolution::Fixed(known.cells))).unwrap();
                let counts = grid.counts(&rays);
                let by_ray = |n: u64| n as f64 / rays.len() as f64;
                let empty = (known.cells.iter().product::<u32>() as usize - grid.leaves()[0]) as f64;
                for (what, is, was, most) in [
                    ("tests", by_ray(counts.prims), known.tests, 0.05),
                    ("steps", by_ray(counts.nodes), known.steps, 0.05),
                    ("empty steps", by_ray(counts.nodes - counts.leaves), known.empty_steps, 0.05),
                    ("empty cells", empty, known.empty, 0.005),
                ] {
                    let off = is / was - 1.0;
                    assert!(off.abs() <= most, "{name} {} {what}: {is}, known {was}, {off:+.4}", known.name);
                }
            }
        }
    }
}

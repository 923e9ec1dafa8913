//! How finely should a grid divide space?
//!
//! The curve of Amanatides and Woo: cubes of `n` cells a side over a scene, in powers of two, without mailbox and with. Steps grow
//! with `n`, tests fall until primitives stand in many cells each, and the sum has a broad minimum near `n ~ N^(1/3)`. With a
//! mailbox that forgets nothing tests would never rise again. Last come the resolutions that the rules choose, so that their
//! regret can be read.
//!
//! Sources: Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987; Cleary and Wyvill, "Analysis
//! of an algorithm for fast ray tracing using uniform space subdivision", The Visual Computer 4, 1988.

use crate::contest::{Group, Named};
use crate::field::{Population, Truth, field};
use crate::schemes::{Builder, classic, raced};
use crate::subject::split_size;
use crate::{Effort, Options, Trouble, Watch, hear};
use rt_accel::{Bounded, Mailing};
use rt_grid::{Grid, GridParams, Resolution};
use rt_scenes::{Scene, SceneGeometry};
use rt_shapes::Surfaced;

/// Tests and steps by ray, recomputed by an independent program, for `2^k` cells a side, `k` from the first one named.
pub(crate) fn known(scene: &str, n: u32) -> Option<[f64; 2]> {
    const TETRA: [[f64; 2]; 9] = [
        [2675.43, 0.66],
        [732.71, 1.09],
        [216.30, 1.99],
        [69.85, 3.79],
        [30.30, 7.41],
        [19.86, 14.63],
        [12.38, 29.04],
        [10.96, 57.87],
        [12.82, 115.57],
    ];
    const MOUNT: [[f64; 2]; 6] =
        [[57.19, 3.59], [21.36, 6.48], [12.60, 12.23], [11.62, 23.75], [15.71, 46.79], [27.04, 92.86]];
    const RINGS: [[f64; 2]; 4] = [[62.21, 9.29], [27.72, 18.09], [20.09, 35.68], [20.22, 70.86]];
    let (first, all): (u32, &[[f64; 2]]) = match scene {
        "tetra" => (0, &TETRA),
        "mount" => (3, &MOUNT),
        "rings" => (4, &RINGS),
        _ => return None,
    };
    all.get(n.ilog2().checked_sub(first)? as usize).copied()
}

pub(crate) fn ask(options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let names: Vec<String> = match &options.scenes {
        Some(subjects) => subjects.iter().map(|subject| subject.name.clone()).collect(),
        None => ["tetra", "mount", "rings"].map(String::from).to_vec(),
    };
    let mut groups = Vec::new();
    for (i, name) in names.iter().enumerate() {
        hear(watch, i, names.len())?;
        let (scene, size) = split_size(name);
        let mut scene = rt_scenes::by_name(scene, size).map_err(|e| Trouble::Scene(e.to_string()))?;
        let geometry = core::mem::replace(&mut scene.geometry, SceneGeometry::Solids(Vec::new()));
        groups.push(match geometry {
            SceneGeometry::Mesh(mesh) => curve(name, &scene, &mesh, options.effort)?,
            SceneGeometry::Solids(solids) => curve(name, &scene, &solids, options.effort)?,
            _ => return Err(Trouble::Scene(format!("{name}: rays of f32 cannot see this scene"))),
        });
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

fn curve<G>(name: &str, scene: &Scene, geometry: &G, effort: Effort) -> Result<Group, Trouble>
where
    G: Surfaced<f32> + Bounded,
    G::At: Named,
{
    let (side, most) = match effort {
        Effort::Quick => (128, 64),
        Effort::Normal => (512, 128),
        Effort::Full => (512, 256),
    };
    let rays = Population::of_picture(scene, geometry, side, effort.rays())?;
    let truth = Truth::of(geometry, &rays, effort.judged())?;
    let mut grids: Vec<(String, GridParams)> = Vec::new();
    for mailing in [Mailing::None, Mailing::Hashed, Mailing::Inverse] {
        let mut n = if mailing == Mailing::None { 1 } else { 8 };
        while n <= most {
            let params = GridParams { mailing, ..classic(Resolution::Fixed([n; 3])) };
            grids.push((format!("n={n} mailing={mailing:?}").to_lowercase(), params));
            n *= 2;
        }
    }
    for (rule, resolution) in [
        ("density 1", Resolution::Density(1.0)),
        ("density 5", Resolution::Density(5.0)),
        ("root 1", Resolution::Root(1.0)),
        ("root 3", Resolution::Root(3.0)),
        ("woo 8", Resolution::Woo(8.0)),
        ("pbrt", Resolution::Pharr),
        ("measured", Resolution::Measured { rays: 500 }),
    ] {
        grids.push((rule.into(), classic(resolution)));
    }
    let mut schemes: Vec<(String, String, Builder<'_>)> = Vec::new();
    for (label, params) in grids {
        schemes.push(("grid".into(), label, Box::new(move || field::<Grid, G>(geometry, &params))));
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

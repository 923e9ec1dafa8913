//! What does each knob of a build buy, in build time and in time a ray?
//!
//! Values that lead to the same tree, as large leaves do wherever the surface area heuristic prefers small ones, are timed
//! all the same: what they differ by is noise, and no difference below it means anything.
//!
//! Two families are asked, the BVH and the kd-tree, each against its own default.

use crate::contest::{Contestant, Group, Label, Named, Weigh, build_all, contest, ours};
use crate::judge::Judge;
use crate::subject::{Prims, RayKind, RaySet, Subject};
use crate::{Effort, Options, Trouble, Watch, hear};
use rt_accel::{Aggregate, Bounded, BuildError, Clip, Geometry, Mailing, Sah, Structure};
use rt_bvh::{Builder, Bvh, BvhParams};
use rt_kdtree::{KdTree, KdTreeParams};
use rt_measure::clock::Plan;

/// A structure and what to try with it, the default first.
struct Family<S: Structure> {
    name: &'static str,
    values: Vec<(String, S::Params)>,
    /// The cost that the surface area heuristic expects, in the unit of the build: between prices it compares nothing.
    sah: fn(&S) -> f64,
    builds: Plan,
}

/// The BVH, one value of one knob at a time, the others at their defaults.
fn bvh(effort: Effort) -> Family<Bvh> {
    let base = BvhParams::default();
    let mut values = vec![("default".to_string(), base)];
    for bins in [8, 16, 32, 64] {
        values.push((format!("bins={bins}"), BvhParams { builder: Builder::Binned { bins }, ..base }));
    }
    for leaf_prims in [1, 2, 4, 8, 16] {
        values.push((format!("leaf={leaf_prims}"), BvhParams { leaf_prims, ..base }));
    }
    for traverse in [0.5, 1.0, 1.5, 2.0, 3.0] {
        values
            .push((format!("traverse={traverse}"), BvhParams { sah: Sah { traverse, ..base.sah }, ..base }));
    }
    for sweep_below in [0, 24, 64] {
        values.push((format!("sweep={sweep_below}"), BvhParams { sweep_below, ..base }));
    }
    // What equals the default is measured once, as that.
    values.retain(|(name, params)| name == "default" || *params != base);
    Family { name: "bvh", values, sah: |tree| tree.sah_cost() as f64, builds: effort.builds() }
}

/// The kd-tree, likewise. Its builds take so much longer that a quick answer times each once.
fn kdtree(effort: Effort) -> Family<KdTree> {
    let base = KdTreeParams::default();
    let mut values = vec![("default".to_string(), base)];
    for intersect in [0.5, 0.75, 1.0, 1.5, 2.0, 3.0] {
        let sah = Sah { intersect, ..base.sah };
        values.push((format!("intersect={intersect}"), KdTreeParams { sah, ..base }));
    }
    for empty_bonus in [0.0, 0.1, 0.2, 0.35, 0.5] {
        values.push((format!("empty_bonus={empty_bonus}"), KdTreeParams { empty_bonus, ..base }));
    }
    for bad_splits in [0, 1, 2] {
        values.push((format!("bad_splits={bad_splits}"), KdTreeParams { bad_splits, ..base }));
    }
    for depth in [16, 20, 24, 40] {
        values.push((format!("max_depth={depth}"), KdTreeParams { max_depth: Some(depth), ..base }));
    }
    values.push(("clip=box".into(), KdTreeParams { clip: Clip::Box, ..base }));
    values.push(("mailing=hashed".into(), KdTreeParams { mailing: Mailing::Hashed, ..base }));
    values.retain(|(name, params)| name == "default" || *params != base);
    let builds = if effort == Effort::Quick { Plan { warm_up: 0, rounds: 1 } } else { effort.builds() };
    Family { name: "kdtree", values, sah: KdTree::sah_cost, builds }
}

pub(crate) fn ask(options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let kinds = [RayKind::Primary, RayKind::Chords, RayKind::Diffuse];
    let made;
    let subjects = match &options.scenes {
        Some(scenes) => scenes,
        None => {
            let names: &[&str] = match options.effort {
                Effort::Quick => &["blob", "soup-100000"],
                Effort::Normal => &["blob", "soup-100000", "balls-4", "stadium-12", "tetra-8"],
                Effort::Full => &["blob", "soup-100000", "soup-1000000", "balls-6", "stadium-100", "tetra-8"],
            };
            made = names.iter().map(|name| Subject::named(name)).collect::<Result<Vec<_>, _>>()?;
            &made
        }
    };
    let (bvh, kdtree) = (bvh(options.effort), kdtree(options.effort));
    let steps = subjects.len() * 8;
    let mut groups = Vec::new();
    for (i, subject) in subjects.iter().enumerate() {
        hear(watch, i * 8, steps)?;
        let sets = subject.rays(&kinds, options.effort.rays())?;
        let mut tell = |done: usize| hear(watch, i * 8 + 1 + done, steps);
        groups.extend(match &subject.prims {
            Prims::Mesh(mesh) => sweep(&bvh, subject, mesh, &sets, options.effort, &mut tell)?,
            Prims::Solids(solids) => sweep(&bvh, subject, solids, &sets, options.effort, &mut tell)?,
        });
        let mut tell = |done: usize| hear(watch, i * 8 + 4 + done, steps);
        groups.extend(match &subject.prims {
            Prims::Mesh(mesh) => sweep(&kdtree, subject, mesh, &sets, options.effort, &mut tell)?,
            Prims::Solids(solids) => sweep(&kdtree, subject, solids, &sets, options.effort, &mut tell)?,
        });
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// All values of a family on one scene: builds race builds, then trees race trees.
fn sweep<'a, S, G>(
    family: &Family<S>,
    subject: &Subject,
    geometry: &'a G,
    sets: &[RaySet],
    effort: Effort,
    tell: &mut dyn FnMut(usize) -> Result<(), Trouble>,
) -> Result<Vec<Group>, Trouble>
where
    S: Structure,
    G: Geometry<f32> + Bounded + Clone,
    G::At: Named,
{
    let build = |params| move || Aggregate::build(geometry, params);
    let mut builders: Vec<_> = family.values.iter().map(|(_, params)| build(params)).collect();
    let mut turns: Vec<&mut dyn FnMut() -> Result<Aggregate<S, &'a G>, BuildError>> = Vec::new();
    for builder in &mut builders {
        turns.push(builder);
    }
    let mut scenes = Vec::new();
    for ((name, _), (scene, ms)) in family.values.iter().zip(build_all(family.builds, &mut turns)) {
        scenes.push((name, scene?, ms));
    }
    tell(0)?;
    let judge = Judge::new(&subject.prims);
    let mut groups = Vec::new();
    for (k, set) in sets.iter().enumerate() {
        tell(k)?;
        let sample = judge.sample(set, effort.judged());
        let mut contestants: Vec<Contestant<'_>> = Vec::new();
        for (name, scene, ms) in &scenes {
            let label = Label {
                structure: family.name,
                params: name.to_string(),
                build_ms: *ms,
                sah: Some((family.sah)(scene.structure())),
                exact: true,
            };
            contestants.push(ours::<f32, _, _>(scene, set, label));
        }
        let about = (subject.name.as_str(), subject.prims.count());
        groups.push(contest(about, set, (&judge, &sample), effort.plan(), Weigh::BuildTime, contestants));
    }
    Ok(groups)
}

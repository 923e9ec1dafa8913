//! What does each knob of a build buy, in build time and in time a ray?
//!
//! Values that lead to the same tree, as large leaves do wherever the surface area heuristic prefers small ones, are timed
//! all the same: what they differ by is noise, and no difference below it means anything.

use crate::contest::{Contestant, Group, Label, Named, Weigh, build_all, contest, ours};
use crate::judge::Judge;
use crate::subject::{Prims, RayKind, RaySet, Subject};
use crate::{Effort, Options, Trouble, Watch, hear};
use rt_accel::{Aggregate, Bounded, BuildError, Geometry, Sah, Structure};
use rt_bvh::{Builder, Bvh, BvhParams};

/// One value of one knob, the others at their defaults.
fn values() -> Vec<(String, BvhParams)> {
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
    values
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
    let mut groups = Vec::new();
    for (i, subject) in subjects.iter().enumerate() {
        hear(watch, i * 4, subjects.len() * 4)?;
        let sets = subject.rays(&kinds, options.effort.rays())?;
        let mut tell = |done: usize| hear(watch, i * 4 + 1 + done, subjects.len() * 4);
        groups.extend(match &subject.prims {
            Prims::Mesh(mesh) => sweep(subject, mesh, &sets, options.effort, &mut tell)?,
            Prims::Solids(solids) => sweep(subject, solids, &sets, options.effort, &mut tell)?,
        });
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// All values on one scene: builds race builds, then trees race trees.
fn sweep<G>(
    subject: &Subject,
    geometry: &G,
    sets: &[RaySet],
    effort: Effort,
    tell: &mut dyn FnMut(usize) -> Result<(), Trouble>,
) -> Result<Vec<Group>, Trouble>
where
    G: Geometry<f32> + Bounded + Clone,
    G::At: Named,
{
    let values = values();
    let mut builders: Vec<Box<dyn FnMut() -> Result<(), BuildError> + '_>> = Vec::new();
    for (_, params) in &values {
        builders.push(Box::new(move || Bvh::build(geometry, params).map(drop)));
    }
    let mut turns: Vec<&mut dyn FnMut() -> Result<(), BuildError>> = Vec::new();
    for builder in &mut builders {
        turns.push(&mut **builder);
    }
    let mut scenes = Vec::new();
    for ((name, params), (built, ms)) in values.iter().zip(build_all(effort.builds(), &mut turns)) {
        built?;
        scenes.push((name, Aggregate::<Bvh, _>::build(geometry, params)?, ms));
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
                structure: "bvh",
                params: name.to_string(),
                build_ms: *ms,
                // In the unit of the build: between values of `traverse` it compares nothing.
                sah: Some(scene.structure().sah_cost() as f64),
                exact: true,
            };
            contestants.push(ours::<f32, _, _>(scene, set, label));
        }
        let about = (subject.name.as_str(), subject.prims.count());
        groups.push(contest(about, set, (&judge, &sample), effort.plan(), Weigh::BuildTime, contestants));
    }
    Ok(groups)
}

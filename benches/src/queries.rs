//! What do closest hits and any hits cost, exact or fast, in `f32` and in `f64`?

use crate::contest::{Contestant, Group, Label, Weigh, build_all, contest, ours};
use crate::judge::Judge;
use crate::subject::{Prims, RayKind, RaySet, Subject, own};
use crate::{Effort, FastMesh, Options, Question, Trouble, Watch, hear};
use rt_accel::{Aggregate, Bounded, Exhaustive, Structure};
use rt_bvh::{Bvh, BvhParams};
use rt_measure::clock::Plan;
use rt_scenes::Solid;
use rt_shapes::TriangleMesh;

/// Up to so many primitives the exhaustive structure is asked too: it takes tens of nanoseconds each.
const TINY: usize = 128;

pub(crate) fn ask(question: Question, options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let kinds: &[RayKind] = match question {
        Question::Any => &[RayKind::Ambient, RayKind::Shadow],
        Question::Precision => &[RayKind::Chords, RayKind::Diffuse, RayKind::Aimed],
        _ => &[RayKind::Primary, RayKind::Chords, RayKind::Diffuse],
    };
    let made;
    let subjects = match &options.scenes {
        Some(scenes) => scenes,
        None => {
            made = scenes(question, options.effort)?;
            &made
        }
    };
    let mut groups = Vec::new();
    for (i, subject) in subjects.iter().enumerate() {
        let of = subjects.len() * kinds.len();
        hear(watch, i * kinds.len(), of)?;
        let sets = subject.rays(kinds, options.effort.rays())?;
        let fielded = Fielded::new(&subject.prims, options.effort.builds())?;
        let judge = Judge::new(&subject.prims);
        for (k, set) in sets.iter().enumerate() {
            hear(watch, i * kinds.len() + k, of)?;
            let sample = judge.sample(set, options.effort.judged());
            groups.push(contest(
                (&subject.name, subject.prims.count()),
                set,
                (&judge, &sample),
                options.effort.plan(),
                Weigh::Error,
                fielded.contestants(set),
            ));
        }
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

fn scenes(question: Question, effort: Effort) -> Result<Vec<Subject>, Trouble> {
    let mut subjects = own(effort)?;
    if question == Question::Precision {
        // The fast test is one of triangles.
        subjects.retain(|s| matches!(s.prims, Prims::Mesh(_)));
    } else {
        subjects.push(Subject::named("tetra-3")?);
    }
    Ok(subjects)
}

/// The structures over one scene, and what it took to build each.
#[expect(clippy::large_enum_variant, reason = "there is one at a time")]
enum Fielded {
    Mesh {
        exact: (Aggregate<Bvh, TriangleMesh>, f64),
        fast: (Aggregate<Bvh, FastMesh>, f64),
        exhaustive: Option<(Aggregate<Exhaustive, TriangleMesh>, f64)>,
    },
    Solids {
        exact: (Aggregate<Bvh, Vec<Solid>>, f64),
        exhaustive: Option<(Aggregate<Exhaustive, Vec<Solid>>, f64)>,
    },
}

impl Fielded {
    fn new(prims: &Prims, plan: Plan) -> Result<Fielded, Trouble> {
        let tiny = prims.count() <= TINY;
        Ok(match prims {
            Prims::Mesh(mesh) => Fielded::Mesh {
                exact: built(plan, mesh, &BvhParams::default())?,
                fast: built(plan, &FastMesh(mesh.clone()), &BvhParams::default())?,
                exhaustive: if tiny { Some(built(plan, mesh, &())?) } else { None },
            },
            Prims::Solids(solids) => Fielded::Solids {
                exact: built(plan, solids, &BvhParams::default())?,
                exhaustive: if tiny { Some(built(plan, solids, &())?) } else { None },
            },
        })
    }

    fn contestants<'a>(&'a self, set: &'a RaySet) -> Vec<Contestant<'a>> {
        let bvh = |exact, ms, cost: f32| Label {
            structure: "bvh",
            build_ms: ms,
            sah: Some(cost as f64),
            exact,
            ..Label::default()
        };
        let every = |ms| Label { structure: "exhaustive", build_ms: ms, exact: true, ..Label::default() };
        let mut all = Vec::new();
        match self {
            Fielded::Mesh { exact: (scene, ms), fast: (quick, quick_ms), exhaustive } => {
                let cost = scene.structure().sah_cost();
                all.push(ours::<f32, _, _>(scene, set, bvh(true, *ms, cost)));
                all.push(ours::<f32, _, _>(quick, set, bvh(false, *quick_ms, cost)));
                all.push(ours::<f64, _, _>(scene, set, bvh(true, *ms, cost)));
                if let Some((scene, ms)) = exhaustive {
                    all.push(ours::<f32, _, _>(scene, set, every(*ms)));
                }
            }
            Fielded::Solids { exact: (scene, ms), exhaustive } => {
                let cost = scene.structure().sah_cost();
                all.push(ours::<f32, _, _>(scene, set, bvh(true, *ms, cost)));
                all.push(ours::<f64, _, _>(scene, set, bvh(true, *ms, cost)));
                if let Some((scene, ms)) = exhaustive {
                    all.push(ours::<f32, _, _>(scene, set, every(*ms)));
                }
            }
        }
        all
    }
}

/// A structure over a copy of `source`; the time is that of the structure alone.
pub(crate) fn built<S: Structure, G: Bounded + Clone>(
    plan: Plan,
    source: &G,
    params: &S::Params,
) -> Result<(Aggregate<S, G>, f64), Trouble> {
    let mut turn = || S::build(source, params).map(drop);
    let mut ms = f64::NAN;
    for (outcome, median) in build_all(plan, &mut [&mut turn]) {
        outcome?;
        ms = median;
    }
    Ok((Aggregate::build(source.clone(), params)?, ms))
}

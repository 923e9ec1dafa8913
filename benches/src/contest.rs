//! A group of contestants: judged, then timed by turns.

use crate::judge::{Answers, Judge, Sample};
use crate::subject::RaySet;
use core::fmt;
use core::hint::black_box;
use rt_accel::{Aggregate, Counts, Geometry, Member, Primitive, Structure};
use rt_geom::{Ray, Real};
use rt_measure::clock::{Plan, race};
use rt_measure::error::HitError;
use rt_measure::front::{Point, front};
use rt_measure::record::{ErrorKind, Row};
use rt_shapes::Uv;

/// What all rows of a run share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// The day, as in 2026-01-31.
    pub date: String,
    /// The machine.
    pub machine: String,
    /// The commit measured.
    pub commit: String,
}

/// Some contestants on the same rays.
#[derive(Clone, Debug)]
pub struct Group {
    /// The scene.
    pub scene: String,
    /// How many primitives it has.
    pub prims: usize,
    /// The kind of rays.
    pub ray_kind: String,
    /// How many rays.
    pub rays: usize,
    /// How many of them were judged.
    pub judged: usize,
    /// What was measured, the first contestant first; or who broke a promise, and then no times.
    pub outcome: Result<Vec<Measured>, Mismatch>,
}

/// A contestant that promised exact answers and gave others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mismatch {
    /// Which one.
    pub who: String,
    /// What it said.
    pub what: String,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.who, self.what)
    }
}

/// One contestant's figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// The structure, or the rival.
    pub structure: String,
    /// Its parameters, precision, and whether it promises exactness.
    pub params: String,
    /// Milliseconds to build, the median.
    pub build_ms: Option<f64>,
    /// Heap bytes of the structure, by primitive.
    pub bytes_per_prim: Option<f64>,
    /// Nanoseconds a ray, the median.
    pub ns_per_ray: f64,
    /// The 90th percentile of rounds over the 10th.
    pub spread: f64,
    /// How many times as fast as the first contestant: the median over rounds.
    pub speed: f64,
    /// Nodes opened, by ray.
    pub nodes_per_ray: Option<f64>,
    /// Primitives tested, by ray.
    pub tests_per_ray: Option<f64>,
    /// What the surface area heuristic predicts.
    pub sah: Option<f64>,
    /// How wrong; of the rays judged.
    pub error: HitError,
    /// Whether distances were asked for.
    pub has_t: bool,
    /// An error that is not about hits: the void in a bounding volume, the distance of triangles from a smooth surface.
    pub off: Option<(ErrorKind, f64)>,
    /// What only this question tells, by name; in records behind the parameters.
    pub figures: Vec<(&'static str, f64)>,
    /// Whether nobody in the group beats it in both of what the question weighs: error and time, or build time and time.
    pub on_front: bool,
}

impl Group {
    /// The rows of a record; none if a promise was broken.
    pub fn rows(&self, stamp: &Stamp) -> Vec<Row> {
        let measured = self.outcome.as_deref().unwrap_or(&[]);
        let several = measured.len() > 1;
        let mut rows = Vec::new();
        for m in measured {
            let mut told: String =
                m.figures.iter().map(|(name, x)| format!(" {name}={}", tidy(*x))).collect();
            if several {
                told += &format!(" speed={:.3}", m.speed);
            }
            let row = |error_kind, error| Row {
                date: stamp.date.clone(),
                machine: stamp.machine.clone(),
                commit: stamp.commit.clone(),
                scene: self.scene.clone(),
                structure: m.structure.clone(),
                params: format!("{} judged={}{told}", m.params, self.judged),
                ray_kind: self.ray_kind.clone(),
                rays: self.rays as u64,
                build_ms: m.build_ms.map(tidy),
                bytes_per_prim: m.bytes_per_prim.map(tidy),
                ns_per_ray: tidy(m.ns_per_ray),
                spread: tidy(m.spread),
                nodes_per_ray: m.nodes_per_ray.map(tidy),
                tests_per_ray: m.tests_per_ray.map(tidy),
                sah: m.sah.map(tidy),
                error_kind,
                error,
            };
            if m.error.rays > 0 {
                rows.push(row(ErrorKind::Wrong, tidy(m.error.wrong_per_million())));
            }
            if m.has_t {
                rows.push(row(ErrorKind::TUlp, tidy(m.error.t_ulp)));
            }
            if let Some((kind, off)) = m.off {
                rows.push(row(kind, tidy(off)));
            }
            if !m.error.is_exact() {
                rows.push(row(ErrorKind::Missed, tidy(m.error.missed_per_million())));
                rows.push(row(ErrorKind::Invented, tidy(m.error.invented_per_million())));
            }
        }
        rows
    }
}

/// Four digits are more than any clock knows.
fn tidy(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// Someone who answers rays.
pub(crate) struct Contestant<'a> {
    pub(crate) structure: String,
    pub(crate) params: String,
    pub(crate) build_ms: Option<f64>,
    pub(crate) bytes_per_prim: Option<f64>,
    pub(crate) sah: Option<f64>,
    /// Work, over as many rays.
    pub(crate) counts: Option<(Counts, usize)>,
    /// Whether every answer is right, as promised.
    pub(crate) exact: bool,
    /// All answers.
    pub(crate) answers: Answers,
    /// Answers all rays, for the clock.
    pub(crate) shoot: Box<dyn FnMut() + 'a>,
}

/// What a question weighs against time.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Weigh {
    /// Wrong answers.
    Error,
    /// What is missed: what is made up costs time alone, and is in it.
    Misses,
    /// An error that is not about hits.
    Off,
    BuildTime,
}

/// Judges the contestants, and if nobody broke a promise, lets them race.
pub(crate) fn contest(
    (scene, prims): (&str, usize),
    set: &RaySet,
    (judge, sample): (&Judge<'_>, &Sample),
    plan: Plan,
    weigh: Weigh,
    mut contestants: Vec<Contestant<'_>>,
) -> Group {
    let outcome = judged(set, judge, sample, &contestants).map(|errors| {
        let mut shots: Vec<&mut dyn FnMut()> = Vec::new();
        for contestant in &mut contestants {
            shots.push(&mut *contestant.shoot);
        }
        let race = race(plan, &mut shots);
        let rays = set.rays.len().max(1) as f64;
        let measured = contestants.iter().zip(errors).enumerate().map(|(i, (c, error))| Measured {
            structure: c.structure.clone(),
            params: c.params.clone(),
            build_ms: c.build_ms,
            bytes_per_prim: c.bytes_per_prim,
            ns_per_ray: race.median(i) / rays,
            spread: race.spread(i),
            speed: race.ratio(0, i),
            nodes_per_ray: c.counts.map(|(counts, n)| counts.nodes as f64 / n.max(1) as f64),
            tests_per_ray: c.counts.map(|(counts, n)| counts.prims as f64 / n.max(1) as f64),
            sah: c.sah,
            error,
            has_t: matches!(c.answers, Answers::Closest32(_) | Answers::Closest64(_)),
            ..Measured::default()
        });
        let mut measured: Vec<Measured> = measured.collect();
        mark_front(&mut measured, weigh);
        measured
    });
    Group {
        scene: scene.to_string(),
        prims,
        ray_kind: set.kind.name().to_string(),
        rays: set.rays.len(),
        judged: sample.len(),
        outcome,
    }
}

pub(crate) fn mark_front(measured: &mut [Measured], weigh: Weigh) {
    let against = |m: &Measured| match weigh {
        Weigh::Error => m.error.wrong_per_million(),
        Weigh::Misses => m.error.missed_per_million(),
        Weigh::Off => m.off.map_or(f64::NAN, |(_, off)| off),
        Weigh::BuildTime => m.build_ms.unwrap_or(f64::NAN),
    };
    let points: Vec<Point> =
        measured.iter().map(|m| Point { error: against(m), time: m.ns_per_ray }).collect();
    for i in front(&points) {
        measured[i].on_front = true;
    }
}

/// The errors of all contestants, unless an exact one is not.
fn judged(
    set: &RaySet,
    judge: &Judge<'_>,
    sample: &Sample,
    contestants: &[Contestant<'_>],
) -> Result<Vec<HitError>, Mismatch> {
    let mut errors: Vec<HitError> = Vec::with_capacity(contestants.len());
    for (i, c) in contestants.iter().enumerate() {
        let who = || format!("{} {}", c.structure, c.params);
        let peer =
            (0..i).find(|&j| c.exact && contestants[j].exact && contestants[j].answers.alike(&c.answers));
        if let Some(j) = peer {
            if let Some(what) = c.answers.differ(&contestants[j].answers) {
                let what =
                    format!("differs from {} {}: {what}", contestants[j].structure, contestants[j].params);
                return Err(Mismatch { who: who(), what });
            }
            errors.push(errors[j]);
            continue;
        }
        let error = judge.judge(sample, set, &c.answers);
        if c.exact && !error.is_exact() {
            let HitError { rays, missed, invented, wrong, .. } = error;
            let what =
                format!("of {rays} hits judged, {missed} missed, {invented} invented, {wrong} on others");
            return Err(Mismatch { who: who(), what });
        }
        errors.push(error);
    }
    Ok(errors)
}

/// Which primitive a hit is on.
pub(crate) trait Named: Copy {
    fn prim(&self) -> u32;
}

impl Named for Uv {
    fn prim(&self) -> u32 {
        self.prim
    }
}

impl Named for Member<Uv> {
    fn prim(&self) -> u32 {
        self.prim
    }
}

/// A precision, and how answers of it are kept.
pub(crate) trait Bits: Real {
    const NAME: &'static str;
    fn rays(set: &RaySet) -> &[Ray<Self>];
    fn closest(hits: Vec<Option<(u32, Self)>>) -> Answers;
    fn any(hits: Vec<bool>) -> Answers;
}

impl Bits for f32 {
    const NAME: &'static str = "f32";
    fn rays(set: &RaySet) -> &[Ray<f32>] {
        &set.rays
    }
    fn closest(hits: Vec<Option<(u32, f32)>>) -> Answers {
        Answers::Closest32(hits)
    }
    fn any(hits: Vec<bool>) -> Answers {
        Answers::Any32(hits)
    }
}

impl Bits for f64 {
    const NAME: &'static str = "f64";
    fn rays(set: &RaySet) -> &[Ray<f64>] {
        &set.wide
    }
    fn closest(hits: Vec<Option<(u32, f64)>>) -> Answers {
        Answers::Closest64(hits)
    }
    fn any(hits: Vec<bool>) -> Answers {
        Answers::Any64(hits)
    }
}

/// What is said of one of our own structures beside its answers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Label {
    pub(crate) structure: &'static str,
    pub(crate) params: String,
    pub(crate) build_ms: f64,
    pub(crate) sah: Option<f64>,
    pub(crate) exact: bool,
}

/// One of our own structures as a contestant.
pub(crate) fn ours<'a, R: Bits, S: Structure, G: Geometry<R>>(
    scene: &'a Aggregate<S, G>,
    set: &'a RaySet,
    label: Label,
) -> Contestant<'a>
where
    G::At: Named,
{
    let rays = R::rays(set);
    let any = set.kind.is_any();
    let mut counts = Counts::default();
    let answers = if any {
        R::any(rays.iter().map(|ray| scene.intersect_p(ray)).collect())
    } else {
        R::closest(rays.iter().map(|ray| scene.intersect(ray).map(|hit| (hit.at.prim(), hit.t))).collect())
    };
    for ray in rays {
        if any {
            scene.intersect_p_counted(ray, &mut counts);
        } else {
            scene.intersect_counted(ray, &mut counts);
        }
    }
    let shoot: Box<dyn FnMut() + 'a> = if any {
        Box::new(move || {
            for ray in rays {
                black_box(scene.intersect_p(black_box(ray)));
            }
        })
    } else {
        Box::new(move || {
            for ray in rays {
                black_box(scene.intersect(black_box(ray)));
            }
        })
    };
    let structure = scene.structure();
    let mode = if label.exact { "exact" } else { "fast" };
    let params = if label.params.is_empty() { String::new() } else { format!("{} ", label.params) };
    Contestant {
        structure: label.structure.to_string(),
        params: format!("{params}{} {mode}", R::NAME),
        build_ms: Some(label.build_ms),
        bytes_per_prim: Some(structure.bytes() as f64 / scene.geometry().prim_count().max(1) as f64),
        sah: label.sah,
        counts: Some((counts, rays.len())),
        exact: label.exact,
        answers,
        shoot,
    }
}

/// Builds by turns; the last of each contestant's builds, and the median time of all in milliseconds.
pub(crate) fn build_all<T>(plan: Plan, builders: &mut [&mut dyn FnMut() -> T]) -> Vec<(T, f64)> {
    let mut built: Vec<Option<T>> = builders.iter().map(|_| None).collect();
    let mut turns: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for (slot, builder) in built.iter_mut().zip(builders) {
        // What was built before goes within the time of the next build; so does what any caller's would.
        turns.push(Box::new(move || *slot = Some(builder())));
    }
    let mut shots: Vec<&mut dyn FnMut()> = Vec::new();
    for turn in &mut turns {
        shots.push(&mut **turn);
    }
    let race = race(plan, &mut shots);
    drop(shots);
    drop(turns);
    let times = (0..).map(|i| race.median(i) / 1e6);
    built.into_iter().zip(times).filter_map(|(built, ms)| Some((built?, ms))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::{RayKind, Subject};
    use rt_measure::record::{HEADER, parse};

    fn liar(answers: Answers, exact: bool) -> Contestant<'static> {
        Contestant {
            structure: "liar".into(),
            params: "f32".into(),
            build_ms: None,
            bytes_per_prim: None,
            sah: None,
            counts: None,
            exact,
            answers,
            shoot: Box::new(|| {}),
        }
    }

    #[test]
    fn a_broken_promise_stops_the_clock() {
        let subject = Subject::named("tetra-3").unwrap();
        let set = &subject.rays(&[RayKind::Ambient], 200).unwrap()[0];
        let judge = Judge::new(&subject.prims);
        let sample = judge.sample(set, 100);
        let plan = Plan { warm_up: 0, rounds: 1 };
        let run =
            |contestants| contest(("tetra-3", 64), set, (&judge, &sample), plan, Weigh::Error, contestants);
        let never = || Answers::Any32(vec![false; set.rays.len()]);
        let group = run(vec![liar(never(), true)]);
        assert!(group.outcome.is_err() && group.rows(&stamp()).is_empty());

        // One who promises nothing may err, and his error stands beside his time.
        let group = run(vec![liar(never(), false)]);
        let rows = group.rows(&stamp());
        assert_eq!(
            rows.iter().map(|row| row.error_kind).collect::<Vec<_>>(),
            [ErrorKind::Wrong, ErrorKind::Missed, ErrorKind::Invented]
        );
        assert!(rows[0].error > 0.0 && rows[0].params == "f32 judged=100");
        let lines: Vec<String> = rows.iter().map(|row| row.to_csv().unwrap()).collect();
        assert_eq!(parse(&format!("{HEADER}\n{}\n", lines.join("\n"))).unwrap(), rows);

        // Two who promise and differ.
        let right = crate::ask(
            crate::Question::Any,
            &crate::Options {
                scenes: Some(vec![subject.clone()]),
                ..crate::Options::new(crate::Effort::Quick)
            },
            &mut |_| core::ops::ControlFlow::Continue(()),
        )
        .unwrap();
        assert!(right.iter().all(|group| group.outcome.is_ok()));
    }

    fn stamp() -> Stamp {
        Stamp { date: "2026-01-31".into(), machine: "m".into(), commit: "c".into() }
    }

    #[test]
    fn builds_are_timed_by_turns() {
        let mut order = std::cell::RefCell::new(Vec::new());
        let built = build_all(
            Plan { warm_up: 0, rounds: 2 },
            &mut [&mut || order.borrow_mut().push('a'), &mut || order.borrow_mut().push('b')],
        );
        assert_eq!((built.len(), order.get_mut().as_slice()), (2, ['a', 'b', 'b', 'a'].as_slice()));
    }
}

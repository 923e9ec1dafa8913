//! `cargo xtask stability`: stiff and extreme cases against exact arithmetic, as long as one likes.

use crate::failure::Failure;
use crate::output::{Json, Progress, catch_interrupts, interrupted, say, thousands};
use rayon::prelude::*;
use rt_accel::{Aggregate, Bounded, Geometry, Primitive, Structure};
use rt_bench::roster::{self, Job};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use rt_measure::error::HitError;
use rt_measure::exact::{self, Corners};
use rt_measure::rays;
use rt_shapes::{Sphere, TriangleMesh, Uv};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Ask structures about stiff and extreme cases, and judge every answer by exact arithmetic.
///
/// Rays go through, along and inside closed meshes, soups and hostile meshes of every scale: uniform chords, rays aimed exactly
/// at vertices and at middles of shared edges, axis-parallel rays, rays in the faces of boxes, rays from inside. A row falls
/// short if any hit is missed, invented or on the wrong triangle, if closest and any disagree, if crossings are miscounted,
/// or if a distance is off by more than 0.501 units in the last place. Every case is asked at least one round.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// How many rays, over all cases.
    #[arg(long, default_value_t = 1_000_000, value_name = "N", conflicts_with = "minutes")]
    rays: u64,
    /// How long, instead of how many rays.
    #[arg(long, value_name = "N")]
    minutes: Option<f64>,
    /// Where the random numbers start.
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Only cases whose name contains this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// The structure.
    #[arg(long, default_value = "bvh", value_name = "STRUCTURE")]
    with: String,
    /// No progress on stderr.
    #[arg(long)]
    quiet: bool,
    /// What to print.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Format {
    Text,
    Json,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask stability                            a million rays over all cases
  cargo xtask stability --rays 10000000            ten million
  cargo xtask stability --minutes 10 --seed 7      as many as fit
  cargo xtask stability --only 1e-20 --format json one kind of case, for a program to read";

/// How far a distance may be off, in units in the last place: correct rounding is 0.5.
const MOST_ULP: f64 = 0.501;

/// A mesh to ask about.
enum Mesh {
    Single(TriangleMesh),
    Double(TriangleMesh<f64>),
    Spheres(Vec<Sphere>),
}

struct Case {
    name: String,
    mesh: Mesh,
    /// Closed: a ray from here must hit, and crossings are odd.
    inside: Option<DVec3>,
}

/// What was found of one case in one precision.
#[derive(Clone, Default)]
struct Tally {
    hits: HitError,
    /// Rays from inside a closed mesh that hit nothing.
    leaks: u64,
    /// Rays for which closest and any disagree.
    any: u64,
    /// Rays whose crossings were counted, and miscounted.
    counted: u64,
    miscounted: u64,
    seconds: f64,
}

impl Tally {
    /// Of a structure that was not built, and so finds nothing.
    fn unbuilt() -> Tally {
        Tally { hits: HitError { rays: 1, missed: 1, ..HitError::default() }, ..Tally::default() }
    }

    fn falls_short(&self) -> bool {
        let HitError { missed, invented, wrong, t_ulp, .. } = self.hits;
        missed + invented + wrong + self.leaks + self.any + self.miscounted > 0
            || t_ulp.is_nan()
            || t_ulp > MOST_ULP
    }

    fn add(&mut self, other: Tally) {
        self.hits += other.hits;
        self.leaks += other.leaks;
        self.any += other.any;
        self.counted += other.counted;
        self.miscounted += other.miscounted;
        self.seconds += other.seconds;
    }
}

fn cases() -> Vec<Case> {
    let closed = rt_scenes::closed_meshes().into_iter().map(|closed| Case {
        name: format!("closed: {}", closed.name),
        mesh: Mesh::Single(closed.mesh),
        inside: Some(closed.inside),
    });
    let trials = rt_scenes::trials().into_iter().map(|trial| Case {
        name: trial.name,
        mesh: Mesh::Single(trial.mesh),
        inside: None,
    });
    let fine = rt_scenes::fine_trials().into_iter().map(|trial| Case {
        name: trial.name,
        mesh: Mesh::Double(trial.mesh),
        inside: None,
    });
    closed.chain(trials).chain(fine).chain(spheres()).collect()
}

/// Spheres of many sizes at many distances.
fn spheres() -> impl Iterator<Item = Case> {
    [("spheres", 1.0), ("spheres, scaled by 1e-20", 1e-20), ("spheres, scaled by 1e15", 1e15)]
        .into_iter()
        .map(|(name, scale)| {
            let mut seeded = rays::Seeded::new(5);
            let balls = (0..60).filter_map(|i| {
                let radius = (2f64).powi(-(i % 12));
                let center = (seeded.direction() * 4.0).as_vec3().as_dvec3();
                Sphere::new(center * scale, radius * scale).ok()
            });
            Case { name: name.to_string(), mesh: Mesh::Spheres(balls.collect()), inside: None }
        })
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if args.minutes.is_some_and(|minutes| !(minutes > 0.0 && minutes.is_finite())) {
        return Err(Failure::Usage("--minutes must be a positive number".to_string()));
    }
    catch_interrupts();
    let only = args.only.as_deref().unwrap_or("");
    let cases: Vec<Case> = cases().into_iter().filter(|case| case.name.contains(only)).collect();
    if cases.is_empty() {
        return Err(Failure::Usage(format!("no case has {only:?} in its name")));
    }
    let progress = Progress::new("stability", args.quiet);
    let start = Instant::now();
    let mut tallies: Vec<[Tally; 2]> = vec![Default::default(); cases.len()];
    let (mut asked, mut round) = (0, 0);
    loop {
        let seed = args.seed.wrapping_add(round);
        let more: Vec<[Tally; 2]> = cases
            .par_iter()
            .map(|case| match interrupted() {
                true => Ok(Default::default()),
                false => roster::with(&args.with, Ask { case, seed }),
            })
            .collect::<Result<_, _>>()
            .map_err(Failure::Usage)?;
        for (tallies, more) in tallies.iter_mut().zip(more) {
            for (tally, more) in tallies.iter_mut().zip(more) {
                asked += more.hits.rays;
                tally.add(more);
            }
        }
        round += 1;
        let done = match args.minutes {
            Some(minutes) => start.elapsed().as_secs_f64() / (60.0 * minutes),
            None => asked as f64 / args.rays.max(1) as f64,
        };
        if progress.hear(done.min(1.0) as f32).is_break() {
            drop(progress);
            return Err(Failure::Interrupted);
        }
        if done >= 1.0 {
            break;
        }
    }
    drop(progress);
    report(args, &cases, &tallies, start.elapsed())
}

/// One round of one case.
struct Ask<'a> {
    case: &'a Case,
    seed: u64,
}

impl Job for Ask<'_> {
    type Out = [Tally; 2];

    fn run<S: Structure + 'static>(self, params: &S::Params) -> [Tally; 2] {
        let inside = self.case.inside;
        match &self.case.mesh {
            Mesh::Single(mesh) => [
                ask_mesh::<S, f32, f32>(mesh, params, inside, self.seed),
                ask_mesh::<S, f32, f64>(mesh, params, inside, self.seed),
            ],
            Mesh::Double(mesh) => {
                [Tally::default(), ask_mesh::<S, f64, f64>(mesh, params, inside, self.seed)]
            }
            Mesh::Spheres(balls) => [
                ask_spheres::<S, f32>(balls, params, self.seed),
                ask_spheres::<S, f64>(balls, params, self.seed),
            ],
        }
    }
}

/// What is asked about a mesh or a list: everything that is known to make trouble.
fn troublesome<R: Real>(world: &Aabb, boxes: &[Aabb], points: &[DVec3], seed: u64) -> Vec<Ray<R>> {
    let mut seeded = rays::Seeded::new(seed);
    let some: Vec<DVec3> = (0..150).filter_map(|_| seeded.choose(points).copied()).collect();
    let mut all = rays::uniform(seeded.bits(), world, 300);
    all.extend(rays::aimed(seeded.bits(), world, &some, 2));
    all.extend(rays::axis_parallel(world, &some[..some.len().min(40)]));
    all.extend(rays::in_faces(seeded.bits(), world, 30));
    for _ in 0..5 {
        if let Some(b) = seeded.choose(boxes) {
            all.extend(rays::in_faces(seeded.bits(), b, 24));
        }
    }
    all.extend(rays::inside(seeded.bits(), world, 100));
    all
}

fn ask_mesh<S: Structure + 'static, V: Real + Into<R>, R: Real>(
    mesh: &TriangleMesh<V>,
    params: &S::Params,
    inside: Option<DVec3>,
    seed: u64,
) -> Tally {
    let start = Instant::now();
    let mut tally = Tally::default();
    let Ok(scene) = Aggregate::<S, _>::build(mesh.clone(), params) else { return Tally::unbuilt() };
    let corners: Vec<Corners> = (0..mesh.triangles().len() as u32)
        .map(|prim| mesh.triangle(prim).corners.map(|c| c.to_array()))
        .collect();
    let boxes: Vec<Aabb> =
        (0..corners.len() as u32).map(|prim| mesh.bound(prim)).filter(|b| b.is_valid()).collect();
    let world = boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union);
    if !world.is_valid() {
        // Nothing can be hit; the structure must know that too.
        let ray = Ray::new(R::Vec3::nearest(DVec3::ZERO), R::Vec3::nearest(DVec3::X));
        tally.hits.judge_triangles(&ray, &[], scene.intersect(&ray).map(|hit| (hit.at.prim, hit.t)));
        return tally;
    }
    let mut points: Vec<DVec3> =
        corners.iter().flatten().map(|c| DVec3::from_array(*c)).filter(|p| p.is_finite()).collect();
    let middles: Vec<DVec3> =
        points.chunks_exact(3).map(|c| R::Vec3::nearest((c[0] + c[1]) * 0.5).widen()).collect();
    points.extend(middles);
    let around = Around::new(&corners);
    let rays: Vec<Ray<R>> = troublesome(&world, &boxes, &points, seed);
    for (i, ray) in rays.iter().enumerate() {
        judge(&mut tally, &scene, ray, &corners, &around, i % 4 == 0);
    }
    if let Some(inside) = inside {
        let mut seeded = rays::Seeded::new(!seed);
        for i in 0..400 {
            let target = seeded.choose(&points).copied().filter(|_| i % 4 != 0);
            let dir = target.map_or_else(|| seeded.direction(), |target| target - inside);
            let ray: Ray<R> = Ray::new(R::Vec3::nearest(inside), R::Vec3::nearest(dir));
            let found = judge(&mut tally, &scene, &ray, &corners, &around, i % 4 == 0);
            tally.leaks += u64::from(!found);
        }
    }
    tally.seconds = start.elapsed().as_secs_f64();
    tally
}

/// Asks one ray, and says whether it hit.
fn judge<R: Real, G: Geometry<R, At = Uv>, S: Structure>(
    tally: &mut Tally,
    scene: &Aggregate<S, G>,
    ray: &Ray<R>,
    corners: &[Corners],
    around: &Around,
    count: bool,
) -> bool {
    let found = scene.intersect(ray).map(|hit| (hit.at.prim, hit.t));
    let (mut near, mut names) = (Vec::new(), Vec::new());
    around.near(&ray.widen(), &mut |prim| {
        names.push(prim);
        near.push(corners[prim as usize]);
    });
    // The answer by its place among the candidates; one that is none of them cannot be right.
    let placed = |prim| names.iter().position(|&name| name == prim).map_or(u32::MAX, |place| place as u32);
    tally.hits.judge_triangles(ray, &near, found.map(|(prim, t)| (placed(prim), t)));
    tally.any += u64::from(scene.intersect_p(ray) != found.is_some());
    if let Some((_, t)) = found.filter(|_| count) {
        // From the hit on, and the hit alone: a ray may begin and end just where it hits.
        for ends in [ray.between(t, ray.t_max), ray.between(t, t)] {
            let found = scene.intersect(&ends).map(|hit| (placed(hit.at.prim), hit.t));
            tally.hits.judge_triangles(&ends, &near, found);
            tally.any += u64::from(scene.intersect_p(&ends) != found.is_some());
        }
    }
    if count && ray.is_valid() {
        let mut crossings = 0;
        let _ = scene.all_hits(ray, &mut |_| {
            crossings += 1;
            ControlFlow::Continue(())
        });
        let exact = exact::crossings(
            ray.origin.widen().to_array(),
            ray.dir.widen().to_array(),
            ray.t_min.into(),
            ray.t_max.into(),
            near.iter().copied(),
        );
        tally.counted += 1;
        tally.miscounted += u64::from(crossings != exact);
    }
    found.is_some()
}

/// Which triangles a ray comes near: a generous test of boxes in `f64` that shares nothing with the one on trial, so that
/// exact arithmetic need not look at all of them.
struct Around(Vec<(DVec3, DVec3)>);

impl Around {
    fn new(corners: &[Corners]) -> Around {
        let padded = |c: &Corners| {
            let [a, b, c] = c.map(DVec3::from_array);
            let (min, max) = (a.min(b).min(c), a.max(b).max(c));
            let pad = (min.abs().max(max.abs())) * 1e-6;
            (min - pad, max + pad)
        };
        Around(corners.iter().map(padded).collect())
    }

    fn near(&self, ray: &Ray<f64>, each: &mut dyn FnMut(u32)) {
        let (o, d) = (ray.origin, ray.dir);
        for (prim, (min, max)) in (0..).zip(&self.0) {
            let (mut enter, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
            let mut beside = false;
            for a in 0..3 {
                let pad = o[a].abs() * 1e-9;
                if d[a] == 0.0 {
                    beside |= o[a] < min[a] - pad || o[a] > max[a] + pad;
                } else {
                    let (s, t) = ((min[a] - pad - o[a]) / d[a], (max[a] + pad - o[a]) / d[a]);
                    enter = enter.max(s.min(t));
                    exit = exit.min(s.max(t));
                }
            }
            // Written so that a NaN counts as near.
            let apart = beside || enter - enter.abs() * 1e-9 > exit + exit.abs() * 1e-9;
            if !apart {
                each(prim);
            }
        }
    }
}

fn ask_spheres<S: Structure + 'static, R: Real>(balls: &[Sphere], params: &S::Params, seed: u64) -> Tally {
    let start = Instant::now();
    let mut tally = Tally::default();
    let Ok(scene) = Aggregate::<S, _>::build(balls.to_vec(), params) else { return Tally::unbuilt() };
    let list = balls.to_vec();
    let boxes: Vec<Aabb> = (0..list.len() as u32).map(|prim| list.bound(prim)).collect();
    let world = boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union);
    // Points where axis-parallel rays touch.
    let points: Vec<DVec3> = balls
        .iter()
        .flat_map(|ball| DVec3::AXES.map(|axis| ball.center() + axis * ball.radius()))
        .map(|p| R::Vec3::nearest(p).widen())
        .collect();
    for ray in troublesome::<R>(&world, &boxes, &points, seed) {
        let (o, d) = (ray.origin.widen().to_array(), ray.dir.widen().to_array());
        let (t_min, t_max): (f64, f64) = (ray.t_min.into(), ray.t_max.into());
        let roots = balls.iter().map(|ball| exact::sphere(o, d, ball.center().to_array(), ball.radius()));
        let mut closest: Option<(u32, exact::Rational)> = None;
        for (prim, roots) in (0..).zip(roots) {
            let root = roots.and_then(|roots| roots.into_iter().find(|root| root.within(t_min, t_max)));
            if let Some(root) = root
                && closest.as_ref().is_none_or(|(_, best)| root.nearest::<R>() < best.nearest::<R>())
            {
                closest = Some((prim, root));
            }
        }
        let found = scene.intersect(&ray).map(|hit| (hit.at.prim, hit.t));
        tally.hits.judge(closest.as_ref().map(|(prim, root)| (*prim, root)), found);
        tally.any += u64::from(scene.intersect_p(&ray) != found.is_some());
    }
    tally.seconds = start.elapsed().as_secs_f64();
    tally
}

fn report(args: &Args, cases: &[Case], tallies: &[[Tally; 2]], elapsed: Duration) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for (case, pair) in cases.iter().zip(tallies) {
        for (precision, tally) in ["f32", "f64"].into_iter().zip(pair) {
            if tally.hits.rays > 0 {
                rows.push((case.name.as_str(), precision, tally));
            }
        }
    }
    let short: Vec<_> = rows.iter().filter(|(_, _, tally)| tally.falls_short()).collect();
    let asked: u64 = rows.iter().map(|(_, _, tally)| tally.hits.rays).sum();
    if args.format == Format::Json {
        let row = |(name, precision, tally): &(&str, &'static str, &Tally)| {
            Json::Object(vec![
                ("case", Json::Text(name.to_string())),
                ("precision", Json::Text(precision.to_string())),
                ("rays", Json::Whole(tally.hits.rays)),
                ("missed", Json::Whole(tally.hits.missed)),
                ("invented", Json::Whole(tally.hits.invented)),
                ("wrong", Json::Whole(tally.hits.wrong)),
                ("any_differs", Json::Whole(tally.any)),
                ("leaks", Json::Whole(tally.leaks)),
                ("counted", Json::Whole(tally.counted)),
                ("miscounted", Json::Whole(tally.miscounted)),
                ("t_ulp", Json::Number(tally.hits.t_ulp)),
                ("seconds", Json::Number(tally.seconds)),
            ])
        };
        let all = Json::Object(vec![
            ("version", Json::Whole(1)),
            ("structure", Json::Text(args.with.clone())),
            ("seed", Json::Whole(args.seed)),
            ("rays", Json::Whole(asked)),
            ("seconds", Json::Number(elapsed.as_secs_f64())),
            ("rows", Json::List(rows.iter().map(row).collect())),
        ]);
        say!("{all}");
    } else {
        let width = rows.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or(0);
        say!(
            "{:width$}  prec  {:>10} {:>7} {:>8} {:>6} {:>5} {:>6} {:>10} {:>6}",
            "case",
            "rays",
            "missed",
            "invented",
            "wrong",
            "any",
            "leaks",
            "miscounted",
            "t ulp"
        );
        for (name, precision, tally) in &rows {
            let HitError { rays, missed, invented, wrong, t_ulp } = tally.hits;
            let mark = if tally.falls_short() { "  <-- falls short" } else { "" };
            say!(
                "{name:width$}  {precision}   {:>10} {missed:>7} {invented:>8} {wrong:>6} {:>5} {:>6} {:>10} {t_ulp:>6.3}{mark}",
                thousands(rays),
                tally.any,
                tally.leaks,
                tally.miscounted,
            );
        }
        let counted: u64 = rows.iter().map(|(_, _, tally)| tally.counted).sum();
        say!(
            "{} rays, {} of them counted for crossings, {} rows, {} fall short; structure {}, seed {}, {:.1} s",
            thousands(asked),
            thousands(counted),
            rows.len(),
            short.len(),
            args.with,
            args.seed,
            elapsed.as_secs_f64()
        );
    }
    match short.len() {
        0 => Ok(()),
        n => Err(Failure::Check(format!("{n} rows fall short of exact answers"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_of_every_case_is_exact() {
        cases().par_iter().for_each(|case| {
            // Exhaustive search of large meshes takes long, and is asked by every conformance test already.
            let large = matches!(&case.mesh, Mesh::Single(mesh) if mesh.triangles().len() > 100);
            for structure in if large { &["bvh"][..] } else { &["bvh", "exhaustive"] } {
                let tallies = roster::with(structure, Ask { case, seed: 12 }).unwrap();
                for tally in tallies {
                    let HitError { missed, invented, wrong, t_ulp, .. } = tally.hits;
                    assert!(
                        !tally.falls_short(),
                        "{} in {structure}: missed {missed}, invented {invented}, wrong {wrong}, any {}, leaks {}, \
                         miscounted {}, t off by {t_ulp}",
                        case.name, tally.any, tally.leaks, tally.miscounted
                    );
                }
            }
        });
    }

    #[test]
    fn a_wrong_answer_is_noticed() {
        let mut tally = Tally::default();
        assert!(!tally.falls_short());
        tally.hits.judge_triangles(
            &Ray::new(DVec3::new(0.2, 0.2, -1.0), DVec3::Z),
            &[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]],
            None,
        );
        assert!(tally.falls_short());
    }
}

//! Which bounding volume, and when does it pay?
//!
//! Weghorst, Hooper and Greenberg (ACM TOG 3(1), 1984): `N` rays that reach an object cost `N c_o`; with a bound they cost
//! `N c_b + p N c_o`, where `p` is the share of the rays that meet the bound. Here every term is measured by itself, the sum is
//! predicted, and the prediction is compared with the time that bound and object take together.
//!
//! `p` is counted, `p_area` the ratio of surfaces that it should be; `c_b` is the bound's test over all rays, of which `hit_ns` and
//! `miss_ns` tell those that meet it and those that do not, each kind by itself and so without a mispredicted branch; `c_o` is the
//! object's over the rays that meet the bound. `off_%` compares within rounds, both sides measured in the same one, and is the median
//! of those; `predicted` is of the medians. What is done once a ray for all volumes, `ready_ns`, is in neither. `pays_from` is the
//! number of triangles from which on an object is worth its bound by the model, `seen_from` by the clock; 0 is always.

use crate::contest::{Group, Measured, Mismatch, Weigh, mark_front};
use crate::{Effort, Trouble, Watch, hear, part, space};
use core::hint::black_box;
use rt_bounds::{Aabb, BoundingSphere, BoundingVolume, Extremes, Hull, Kdop, Obb};
use rt_geom::Ray;
use rt_geom::glam::{DQuat, DVec3, Vec3A};
use rt_measure::clock::{Plan, Race, quantile, race};
use rt_measure::error::HitError;
use rt_measure::exact;
use rt_measure::rays::Seeded;
use rt_measure::record::ErrorKind;
use rt_shapes::Triangle;
use std::time::Instant;

/// Objects of a kind: few enough to stay in the cache.
const OBJECTS: usize = 32;
/// How many triangles of an object are kept, to see from how many on a bound pays.
const KEPT: [usize; 4] = [1, 2, 4, 8];
/// The radius of the sphere that all rays reach; objects fit in the unit sphere.
const REACH: f64 = 1.5;

/// A kind of object: triangles in the unit sphere about the origin, not yet turned.
struct Kind {
    name: &'static str,
    triangles: Vec<[DVec3; 3]>,
}

fn kinds() -> [Kind; 5] {
    let unit = |half: DVec3| half / half.length();
    [
        Kind { name: "cubes", triangles: brick(unit(DVec3::ONE)) },
        Kind { name: "rods", triangles: brick(unit(DVec3::new(1.0, 0.04, 0.04))) },
        Kind { name: "balls", triangles: lattice(12, 6, |u, v| ring(0.0, 1.0, u, v / 2.0 - 0.25)) },
        Kind { name: "tori", triangles: lattice(12, 6, |u, v| ring(0.75, 0.25, u, v)) },
        Kind {
            name: "slivers",
            triangles: vec![[DVec3::new(-1.0, 0.0, 0.0), DVec3::X, DVec3::new(0.0, 0.05, 0.0)]],
        },
    ]
}

/// The twelve triangles of a box about the origin.
fn brick(half: DVec3) -> Vec<[DVec3; 3]> {
    let corner = |i: usize| {
        half * DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64).map(|x| 2.0 * x - 1.0)
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|triangle| triangle.map(corner))
        .collect()
}

/// A point on a ring of radius `large`, as thick as `small`, at two turns.
fn ring(large: f64, small: f64, u: f64, v: f64) -> DVec3 {
    let (along, across) = ((u * std::f64::consts::TAU).sin_cos(), (v * std::f64::consts::TAU).sin_cos());
    let radius = large + small * across.1;
    DVec3::new(radius * along.1, radius * along.0, small * across.0)
}

/// Two triangles for each cell of a lattice over the unit square; those without area, at poles, left out.
fn lattice(nu: usize, nv: usize, at: impl Fn(f64, f64) -> DVec3) -> Vec<[DVec3; 3]> {
    let point = |i: usize, j: usize| at((i % nu) as f64 / nu as f64, j as f64 / nv as f64);
    let mut triangles = Vec::new();
    for i in 0..nu {
        for j in 0..nv {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let area = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).length();
    triangles.retain(|triangle| area(triangle) > 1e-9);
    triangles
}

/// One object of a kind, turned at random, its corners rounded to `f32`.
struct Object {
    triangles: Vec<Triangle>,
    corners: Vec<DVec3>,
}

impl Object {
    fn turned(kind: &Kind, seeded: &mut Seeded) -> Object {
        let turn = turn(seeded);
        let place = |p: DVec3| (turn * p).as_vec3().as_dvec3();
        let triangles: Vec<Triangle> =
            kind.triangles.iter().map(|corners| Triangle { corners: corners.map(place) }).collect();
        let mut corners: Vec<DVec3> = triangles.iter().flat_map(|t| t.corners).collect();
        corners.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap_or(core::cmp::Ordering::Equal));
        corners.dedup();
        Object { triangles, corners }
    }

    /// The closest hit by trying triangles, as an object without structure does: the first `kept` of them.
    #[inline(never)]
    fn intersect(&self, ray: &Ray, kept: usize) -> Option<f32> {
        let mut ray = *ray;
        let mut hit = None;
        for triangle in self.triangles.iter().take(kept) {
            if let Some(meeting) = triangle.intersect(&ray) {
                ray.t_max = meeting.t;
                hit = Some(meeting.t);
            }
        }
        hit
    }
}

/// A rotation, uniform. Source: Marsaglia, "Choosing a point from the surface of a sphere", Ann. Math. Stat. 43(2), 1972.
pub(crate) fn turn(seeded: &mut Seeded) -> DQuat {
    let mut pair = || loop {
        let (x, y) = (seeded.between(-1.0, 1.0), seeded.between(-1.0, 1.0));
        let s = x * x + y * y;
        if s < 1.0 {
            return (x, y, s);
        }
    };
    let ((a, b, s), (c, d, t)) = (pair(), pair());
    let rest = ((1.0 - s) / t).sqrt();
    DQuat::from_xyzw(a, b, c * rest, d * rest).normalize()
}

/// A volume around each object, and every way to spend time on it.
struct Entrant<'a> {
    name: &'static str,
    params: &'static str,
    build_ms: f64,
    bytes: f64,
    /// Mean surface area.
    area: f64,
    /// Which pairs of a ray and an object meet the bound, ray by ray.
    met: Vec<bool>,
    /// One pass over all pairs, or over those where the bound is met or missed: the bound alone.
    bound: [Box<dyn FnMut() + 'a>; 3],
    /// The object alone, where the bound is met.
    object: Box<dyn FnMut() + 'a>,
    /// The object alone, where the bound is missed; of the object so many triangles.
    spared: Box<dyn FnMut(usize) + 'a>,
    /// Both; of the object so many triangles.
    both: Box<dyn FnMut(usize) + 'a>,
    /// Making all rays ready.
    ready: Box<dyn FnMut() + 'a>,
}

/// Rays and objects, each with each.
struct Stage {
    objects: Vec<Object>,
    rays: Vec<Ray>,
    world: Aabb,
}

impl Stage {
    fn new(kind: &Kind, effort: Effort) -> Stage {
        let mut seeded = Seeded::new(7);
        let objects: Vec<Object> = (0..OBJECTS).map(|_| Object::turned(kind, &mut seeded)).collect();
        let count = match effort {
            Effort::Quick => 256,
            Effort::Normal => 1024,
            Effort::Full => 4096,
        };
        // Lines that reach a sphere, uniform: two points on it, uniform.
        let line = |_| {
            let (a, b) = (seeded.direction() * REACH, seeded.direction() * REACH);
            let outside = a - (b - a).normalize_or(DVec3::X) * REACH;
            Ray::new(outside.as_vec3a(), (b - a).normalize_or(DVec3::X).as_vec3a())
        };
        let rays = (0..count).map(line).collect();
        Stage { objects, rays, world: Aabb::new(Vec3A::splat(-1.01), Vec3A::splat(1.01)) }
    }

    fn pairs(&self) -> usize {
        self.objects.len() * self.rays.len()
    }

    /// Which pairs meet exactly, ray by ray.
    fn truth(&self) -> Vec<bool> {
        let met = |ray: &Ray, object: &Object| {
            let (origin, dir) = (ray.origin.as_dvec3().to_array(), ray.dir.as_dvec3().to_array());
            object
                .triangles
                .iter()
                .any(|t| exact::triangle(origin, dir, t.corners.map(|c| c.to_array())).is_some())
        };
        self.rays.iter().flat_map(|ray| self.objects.iter().map(move |object| met(ray, object))).collect()
    }

    fn entrant<'a, V: BoundingVolume + 'a>(
        &'a self,
        name: &'static str,
        params: &'static str,
        fit: fn(&Object) -> Option<V>,
    ) -> Option<Entrant<'a>> {
        let begin = Instant::now();
        let volumes: Vec<V> = self.objects.iter().map(fit).collect::<Option<_>>()?;
        let build_ms = begin.elapsed().as_secs_f64() * 1e3 / self.objects.len() as f64;
        let area = volumes.iter().map(V::surface_area).sum::<f64>() / volumes.len() as f64;
        let bytes = volumes.iter().map(V::bytes).sum::<usize>() as f64 / volumes.len() as f64;
        let make = move |ray: &Ray| V::ready(ray, DVec3::ZERO, &self.world);
        let ready: std::rc::Rc<Vec<V::Ready>> = std::rc::Rc::new(self.rays.iter().map(make).collect());
        let volumes = std::rc::Rc::new(volumes);
        let met: Vec<bool> =
            ready.iter().flat_map(|ray| volumes.iter().map(|v| v.entry(ray).is_some())).collect();
        let of = |keep: &dyn Fn(bool) -> bool| -> Vec<Vec<u32>> {
            let chosen = |row: &[bool]| (0..).zip(row).filter(|(_, m)| keep(**m)).map(|(i, _)| i).collect();
            met.chunks(volumes.len()).map(chosen).collect()
        };
        let alone = |pairs: Vec<Vec<u32>>| -> Box<dyn FnMut() + 'a> {
            let (volumes, ready) = (volumes.clone(), ready.clone());
            Box::new(move || {
                for (ray, pairs) in ready.iter().zip(&pairs) {
                    for &i in pairs {
                        if volumes[i as usize].entry(ray).is_some() {
                            black_box(i);
                        }
                    }
                }
            })
        };
        let bound = [alone(of(&|_| true)), alone(of(&|met| met)), alone(of(&|met| !met))];
        let hits = of(&|met| met);
        let object = Box::new(move || {
            for (ray, hits) in self.rays.iter().zip(&hits) {
                for &i in hits {
                    black_box(self.objects[i as usize].intersect(ray, usize::MAX));
                }
            }
        });
        let misses = of(&|met| !met);
        let spared = Box::new(move |kept| {
            for (ray, misses) in self.rays.iter().zip(&misses) {
                for &i in misses {
                    black_box(self.objects[i as usize].intersect(ray, kept));
                }
            }
        });
        let (mine, theirs, every) = (volumes.clone(), ready.clone(), of(&|_| true));
        let both = Box::new(move |kept| {
            for ((ray, ready), pairs) in self.rays.iter().zip(theirs.iter()).zip(&every) {
                for &i in pairs {
                    if mine[i as usize].entry(ready).is_some() {
                        black_box(self.objects[i as usize].intersect(ray, kept));
                    }
                }
            }
        });
        let readying = Box::new(move || {
            for ray in black_box(&self.rays) {
                black_box(make(ray));
            }
        });
        Some(Entrant {
            name,
            params,
            build_ms,
            bytes,
            area,
            met,
            bound,
            object,
            spared,
            both,
            ready: readying,
        })
    }
}

/// All volumes that are compared.
fn entrants(stage: &Stage) -> Vec<Entrant<'_>> {
    let all = [
        stage.entrant("aabb", "", |o| Aabb::around(&o.corners, DVec3::ZERO)),
        stage.entrant("sphere", "ritter", |o| BoundingSphere::ritter(&o.corners, DVec3::ZERO)),
        stage.entrant("sphere", "epos-26", |o| {
            BoundingSphere::epos(&o.corners, DVec3::ZERO, Extremes::TwentySix)
        }),
        stage.entrant("sphere", "smallest", |o| BoundingSphere::smallest(&o.corners, DVec3::ZERO)),
        stage.entrant("obb", "pca", |o| Obb::pca(&o.corners, &[], DVec3::ZERO)),
        stage.entrant("obb", "dito-14", |o| Obb::dito(&o.corners, DVec3::ZERO)),
        stage.entrant("obb", "tight", |o| Obb::tight(&o.corners, DVec3::ZERO)),
        stage.entrant("kdop-14", "", |o| Kdop::<14>::around(&o.corners, DVec3::ZERO)),
        stage.entrant("kdop-18", "", |o| Kdop::<18>::around(&o.corners, DVec3::ZERO)),
        stage.entrant("kdop-26", "", |o| Kdop::<26>::around(&o.corners, DVec3::ZERO)),
        stage.entrant("hull", "planes=8", |o| Some(Hull::new(&o.corners).ok()?.reduced(8, DVec3::ZERO))),
        stage.entrant("hull", "planes=16", |o| Some(Hull::new(&o.corners).ok()?.reduced(16, DVec3::ZERO))),
        stage.entrant("hull", "", |o| Some(Hull::new(&o.corners).ok()?.polytope(DVec3::ZERO))),
    ];
    all.into_iter().flatten().collect()
}

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let kinds = kinds();
    let mut groups = Vec::new();
    for (k, kind) in kinds.iter().enumerate() {
        // The last part is about spaces.
        hear(watch, k, kinds.len() + 1)?;
        let stage = Stage::new(kind, effort);
        // Short turns need many rounds.
        let Plan { warm_up, rounds } = effort.plan();
        groups.extend(weigh(kind, &stage, Plan { warm_up, rounds: 2 * rounds + 1 }));
    }
    groups.extend(space::ask(effort, &mut part(watch, kinds.len(), kinds.len() + 1))?);
    Ok(groups)
}

/// The fit of each volume against the time of its test; and the cost model.
fn weigh(kind: &Kind, stage: &Stage, plan: Plan) -> [Group; 2] {
    let truth = stage.truth();
    let mut entrants = entrants(stage);
    let group = |ray_kind: &str, outcome| Group {
        scene: kind.name.into(),
        prims: kind.triangles.len(),
        ray_kind: ray_kind.into(),
        rays: stage.pairs(),
        judged: stage.pairs(),
        outcome,
    };
    let lost = |e: &Entrant<'_>| truth.iter().zip(&e.met).filter(|(t, m)| **t && !**m).count();
    if let Some(liar) = entrants.iter().find(|e| lost(e) > 0) {
        let mismatch = Mismatch { who: liar.name.into(), what: format!("missed {}", lost(liar)) };
        return [group("bound", Err(mismatch.clone())), group("bound and object", Err(mismatch))];
    }
    let pays = pays_from(stage, plan, &mut entrants);
    let race = times(stage, plan, &mut entrants);
    let figures: Vec<Figures> =
        entrants.iter().enumerate().map(|(i, e)| Figures::of(&race, 1 + 6 * i, e, stage, &truth)).collect();
    let error = HitError { rays: stage.pairs() as u64, ..HitError::default() };
    let pairs = stage.pairs() as f64;
    let plain = |structure: &str, params: &str, who: usize, n: f64| Measured {
        structure: structure.into(),
        params: params.into(),
        ns_per_ray: race.median(who) / n,
        spread: race.spread(who),
        speed: 1.0,
        error,
        ..Measured::default()
    };
    let mut fit: Vec<Measured> = Vec::new();
    for (i, (e, f)) in entrants.iter().zip(&figures).enumerate() {
        let who = 1 + 6 * i;
        fit.push(Measured {
            build_ms: Some(e.build_ms),
            bytes_per_prim: Some(e.bytes),
            speed: race.ratio(1, who),
            off: Some((ErrorKind::Void, f.void)),
            figures: vec![("hit_ns", f.hit), ("miss_ns", f.miss), ("ready_ns", f.ready), ("area", e.area)],
            ..plain(e.name, e.params, who, pairs)
        });
    }
    mark_front(&mut fit, Weigh::Off);
    let mut cost = vec![Measured { figures: vec![("p", 1.0)], ..plain("none", "", 0, pairs) }];
    for (i, (e, f)) in entrants.iter().zip(&figures).enumerate() {
        let who = 1 + 6 * i + 4;
        cost.push(Measured {
            speed: race.ratio(0, who),
            tests_per_ray: Some(f.p),
            figures: [
                ("p", f.p),
                ("p_area", f.p_area),
                ("c_b", f.bound),
                ("c_o", f.object),
                ("predicted", f.predicted),
                ("off_%", f.off * 100.0),
            ]
            .into_iter()
            .chain(
                ["pays_from", "seen_from"]
                    .into_iter()
                    .zip(pays[i].map(|from| if from < 0.0 { 0.0 } else { from })),
            )
            .filter(|(_, figure)| figure.is_finite())
            .collect(),
            ..plain(e.name, e.params, who, pairs)
        });
    }
    [group("bound", Ok(fit)), group("bound and object", Ok(cost))]
}

impl Stage {
    /// All objects without a bound; of each so many triangles.
    fn bare(&self, kept: usize) {
        for ray in &self.rays {
            for object in &self.objects {
                black_box(object.intersect(ray, kept));
            }
        }
    }
}

/// Times of the objects without a bound, then six of each entrant.
fn times(stage: &Stage, plan: Plan, entrants: &mut [Entrant<'_>]) -> Race {
    let mut turns: Vec<Box<dyn FnMut() + '_>> = vec![Box::new(|| stage.bare(usize::MAX))];
    for e in entrants {
        let [all, hits, misses] = &mut e.bound;
        let (object, both, ready) = (&mut e.object, &mut e.both, &mut e.ready);
        turns.extend([all, hits, misses, object].map(|turn| Box::new(turn) as Box<dyn FnMut() + '_>));
        turns.push(Box::new(|| both(usize::MAX)));
        turns.push(Box::new(ready));
    }
    let mut shots: Vec<&mut dyn FnMut()> = Vec::new();
    for turn in &mut turns {
        shots.push(&mut **turn);
    }
    race(plan, &mut shots)
}

/// For each entrant: from how many triangles on objects are quicker with the bound than without, as the model says and as seen.
///
/// A bound costs `N c_b` and saves the object's time on the rays that miss the bound, `(1 - p) N c_o`, which grows linearly with
/// the triangles: all are timed for some numbers of triangles and fitted by a line. NaN for objects of fewer than two triangles.
fn pays_from(stage: &Stage, plan: Plan, entrants: &mut [Entrant<'_>]) -> Vec<[f64; 2]> {
    let most = stage.objects.first().map_or(0, |object| object.triangles.len());
    let kept: Vec<usize> = KEPT.into_iter().filter(|kept| *kept <= most).collect();
    let mut gains = vec![[const { Vec::new() }; 2]; entrants.len()];
    for &kept in &kept {
        let mut turns: Vec<Box<dyn FnMut() + '_>> = vec![Box::new(|| stage.bare(kept))];
        for e in entrants.iter_mut() {
            let [bound, ..] = &mut e.bound;
            turns.push(Box::new(bound));
            turns.push(Box::new(|| (e.spared)(kept)));
            turns.push(Box::new(|| (e.both)(kept)));
        }
        let mut shots: Vec<&mut dyn FnMut()> = Vec::new();
        for turn in &mut turns {
            shots.push(&mut **turn);
        }
        let race = race(plan, &mut shots);
        for (i, [model, seen]) in gains.iter_mut().enumerate() {
            let [bound, spared, both] = [1, 2, 3].map(|turn| race.median(3 * i + turn));
            model.push(spared - bound);
            seen.push(race.median(0) - both);
        }
    }
    gains.iter().map(|gains| [0, 1].map(|i| zero_of_line(&kept, &gains[i]))).collect()
}

/// Where the line of least squares through some points is zero; NaN for fewer than two points.
fn zero_of_line(x: &[usize], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let x = x.iter().map(|x| *x as f64);
    let (mean_x, mean_y) = (x.clone().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let rise: f64 = x.clone().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let run: f64 = x.map(|x| (x - mean_x).powi(2)).sum();
    mean_x - mean_y * run / rise
}

/// The terms of the cost model, in nanoseconds.
struct Figures {
    /// The bound's test: of all rays, of those that meet it, of those that do not.
    bound: f64,
    hit: f64,
    miss: f64,
    /// The object's test, of rays that meet the bound.
    object: f64,
    ready: f64,
    /// The share of rays that meet the bound, counted, and as the ratio of surface areas.
    p: f64,
    p_area: f64,
    void: f64,
    predicted: f64,
    /// How much longer bound and object took together than predicted, as a share: the median over rounds.
    off: f64,
}

impl Figures {
    fn of(race: &Race, first: usize, e: &Entrant<'_>, stage: &Stage, truth: &[bool]) -> Figures {
        let pairs = stage.pairs() as f64;
        let hits = e.met.iter().filter(|met| **met).count() as f64;
        let met = truth.iter().filter(|met| **met).count() as f64;
        let p = hits / pairs;
        let each = |who: usize, n: f64| race.median(first + who) / n.max(1.0);
        let (bound, hit, miss) = (each(0, pairs), each(1, hits), each(2, pairs - hits));
        let object = each(3, hits);
        let [bounds, objects, boths] = [0, 3, 4].map(|turn| &race.times[first + turn]);
        let off: Vec<f64> =
            bounds.iter().zip(objects).zip(boths).map(|((b, o), both)| both / (b + o) - 1.0).collect();
        Figures {
            bound,
            hit,
            miss,
            object,
            ready: each(5, stage.rays.len() as f64),
            p,
            p_area: e.area / (4.0 * std::f64::consts::PI * REACH * REACH),
            void: 1.0 - met / hits,
            predicted: bound + p * object,
            off: quantile(&off, 0.5),
        }
    }
}

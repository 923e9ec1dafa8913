//! The slab test, of one box, two and eight, against exact arithmetic: it may say *hit* too often, never *miss* wrongly.

use fearless_simd::Level;
use proptest::prelude::*;
use rt_bounds::{Aabb, BoxOctet, BoxPair, DAabb, Portable, SlabRay};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Vector};
use rt_measure::conform::paste;
use rt_measure::exact::{self, Span};
use rt_measure::rays::Seeded;

/// A number of any size up to `2^125`: often zero, of either sign, often small and whole, often subnormal.
fn coordinate(seeded: &mut Seeded) -> f32 {
    let wild = |seeded: &mut Seeded, low: i32, high: i32| {
        let exponent = low + seeded.below((high - low + 1) as usize) as i32;
        let x = (1.0 + seeded.unit()) * 2f64.powi(exponent);
        (if seeded.below(2) == 0 { x } else { -x }) as f32
    };
    match seeded.below(12) {
        0 => 0.0,
        1 => -0.0,
        2..=4 => seeded.below(9) as f32 - 4.0,
        5 => wild(seeded, -149, -120),
        6 => wild(seeded, -149, 124),
        7 => wild(seeded, 100, 124),
        8 => [f32::from_bits(1), -f32::from_bits(1), f32::MIN_POSITIVE, 4.253_529_6e37][seeded.below(4)],
        _ => wild(seeded, -4, 4),
    }
}

fn length(seeded: &mut Seeded) -> f64 {
    [1e-30, 1e-20, 1e-3, 1.0, 1.0, 1.0, 1e3, 1e20, 1e30][seeded.below(9)]
}

fn a_box(seeded: &mut Seeded) -> Aabb {
    let mut b = Aabb::EMPTY;
    for a in 0..3 {
        let (x, y) = (coordinate(seeded), coordinate(seeded));
        // Flat and thin ones, and some without end.
        let y = match seeded.below(6) {
            0 | 1 => x,
            2 => x.next_up(),
            _ => y,
        };
        b.min[a] = if seeded.below(24) == 0 { f32::NEG_INFINITY } else { x.min(y) };
        b.max[a] = if seeded.below(24) == 0 { f32::INFINITY } else { x.max(y) };
    }
    b
}

/// A place on the box's corners, edges and faces, in it or near it.
fn place(seeded: &mut Seeded, b: &Aabb) -> DVec3 {
    let mut p = DVec3::ZERO;
    for a in 0..3 {
        let (min, max) = (b.min[a].max(f32::MIN), b.max[a].min(f32::MAX));
        let x = match seeded.below(6) {
            0 | 1 => min,
            2 | 3 => max,
            4 => (min as f64 + (max as f64 - min as f64) * seeded.unit()) as f32,
            _ => coordinate(seeded),
        };
        p[a] = x.clamp(-4.253_529_6e37, 4.253_529_6e37) as f64;
    }
    p
}

fn a_ray<R: Real>(seeded: &mut Seeded, b: &Aabb) -> Ray<R> {
    let mut origin = if seeded.below(3) == 0 {
        place(seeded, b)
    } else {
        DVec3::new(coordinate(seeded) as f64, coordinate(seeded) as f64, coordinate(seeded) as f64)
    };
    // Beyond the reach of boxes, in f64 beyond that of f32.
    if seeded.below(10) == 0 {
        let (axis, scale) = (seeded.below(3), [4.0, 1e20, 1e250][seeded.below(3)]);
        origin[axis] *= scale;
    }
    let mut dir = match seeded.below(4) {
        0 => DVec3::new(coordinate(seeded) as f64, coordinate(seeded) as f64, coordinate(seeded) as f64),
        1 => seeded.direction() * length(seeded),
        _ => place(seeded, b) - origin,
    };
    if seeded.below(4) == 0 {
        let (target, scale) = (place(seeded, b), length(seeded));
        dir = (target - origin) * scale;
    }
    for a in 0..3 {
        if seeded.below(5) == 0 {
            dir[a] = if seeded.below(2) == 0 { 0.0 } else { -0.0 };
        }
        // Exactly on a plane of the box.
        if seeded.below(6) == 0 && b.min[a].is_finite() {
            origin[a] = b.min[a] as f64;
        }
    }
    if seeded.below(10) == 0 {
        dir *= [1e-300, 1e-200, 1e-40, 1e8, 1e50, 1e200][seeded.below(6)];
    }
    Ray::new(R::Vec3::nearest(origin), R::Vec3::nearest(dir))
}

fn span_of<R: Real>(ray: &Ray<R>, min: DVec3, max: DVec3) -> Option<Span> {
    let (o, d) = (ray.origin.widen().to_array(), ray.dir.widen().to_array());
    exact::aabb(o, d, min.to_array(), max.to_array())
}

/// Intervals around a span: without end, and ending at its ends as exactly as `R` can say.
fn intervals<R: Real>(seeded: &mut Seeded, span: &Span) -> Vec<(R, R)> {
    let below = R::ZERO - R::nearest(1.0);
    let mut intervals = vec![
        (R::ZERO, R::INFINITY),
        (-R::INFINITY, R::INFINITY),
        (below, R::INFINITY),
        (R::nearest(coordinate(seeded) as f64), R::INFINITY),
    ];
    let ends = |t: Option<&exact::Rational>, none: R| t.map_or(none, |t| t.nearest());
    let enter = ends(span.enter.as_ref(), -R::INFINITY);
    let exit = ends(span.exit.as_ref(), R::INFINITY);
    for t in [enter, exit] {
        for t in [t.next_down(), t, t.next_up()] {
            intervals.extend([(t, t), (R::ZERO, t), (t, R::INFINITY), (-R::INFINITY, t), (below, t)]);
        }
    }
    intervals.retain(|(a, b)| a <= b);
    intervals
}

/// The first wrong miss, of a test of one box or of eight.
fn wrong_miss<R: Real>(
    seeded: &mut Seeded,
    ray: &Ray<R>,
    origin: DVec3,
    b: &Aabb,
    world: &Aabb,
) -> Option<String> {
    let mut shortened = SlabRay::new(&ray.between(ray.t_min, R::INFINITY), origin, world);
    shortened.shorten(ray.t_max);
    let made = SlabRay::new(ray, origin, world);
    let place = seeded.below(8);
    let mut eight = BoxOctet::new(&[*world; 8]);
    eight.put(place, b);
    let of_one = |slab: &SlabRay| slab.entry(b).is_none();
    let of_eight = |slab: &SlabRay| slab.enter_eight(&eight).0 >> place & 1 == 0;
    let missed = [&made, &shortened].map(|slab| [of_one(slab), of_eight(slab)]);
    let corner = |v: Vec3A| v.to_array().map(f32::to_bits);
    missed
        .contains(&[true, true])
        .then_some("missed")
        .or(missed.as_flattened().contains(&true).then_some("unequal"))
        .map(|how| {
            format!(
                "{how}: {}\n box {b:?} bits {:x?} {:x?} origin {origin}",
                paste(ray),
                corner(b.min),
                corner(b.max)
            )
        })
}

/// Draws boxes and rays; returns the wrong misses and how many hits were asked about.
fn adversarial<R: Real>(seed: u64, cases: usize) -> (Vec<String>, usize) {
    let mut seeded = Seeded::new(seed);
    let (mut wrong, mut hits) = (Vec::new(), 0);
    for _ in 0..cases {
        let b = a_box(&mut seeded);
        let mut ray: Ray<R> = a_ray(&mut seeded, &b);
        if !ray.is_valid() || !b.is_valid() {
            continue;
        }
        let world = if seeded.below(2) == 0 { b } else { b.union(a_box(&mut seeded)) };
        let Some(span) = span_of(&ray, b.min.as_dvec3(), b.max.as_dvec3()) else { continue };
        for (t_min, t_max) in intervals(&mut seeded, &span) {
            ray = ray.between(t_min, t_max);
            // A computed hit may lie one unit in the last place before the box, and ends the ray there.
            if span.meets(t_min.into(), t_max.next_up().into()) {
                hits += 1;
                wrong.extend(wrong_miss(&mut seeded, &ray, DVec3::ZERO, &b, &world));
            }
        }
    }
    (wrong, hits)
}

/// Boxes far away, made relative to an origin near them.
fn far_away<R: Real>(seed: u64, cases: usize) -> (Vec<String>, usize) {
    let mut seeded = Seeded::new(seed);
    let (mut wrong, mut hits) = (Vec::new(), 0);
    for _ in 0..cases {
        let far = [1e3, 1e7, 1e12, 1e30][seeded.below(4)];
        let origin =
            DVec3::new(far, seeded.between(-far, far), if seeded.below(2) == 0 { 0.0 } else { -far });
        let size = far * [1e-15, 1e-9, 1e-6, 1e-3, 1.0][seeded.below(5)];
        let near = |seeded: &mut Seeded| {
            let p = origin + seeded.direction() * size;
            R::Vec3::nearest(p).widen()
        };
        let (p, q) = (near(&mut seeded), near(&mut seeded));
        let (min, mut max) = (p.min(q), p.max(q));
        let flat = seeded.below(6);
        if flat < 3 {
            max[flat] = min[flat];
        }
        let b = Aabb::from_f64(min, max, origin);
        let world = if seeded.below(2) == 0 { b } else { b.union(Aabb::from_f64(origin, q, origin)) };
        let start = if seeded.below(2) == 0 { near(&mut seeded) } else { seeded.direction() * far };
        let target = if seeded.below(2) == 0 { min } else { max };
        let mut dir = (target - start) * length(&mut seeded);
        let axis = seeded.below(9);
        if axis < 3 {
            dir[axis] = -0.0;
        }
        let mut ray: Ray<R> = Ray::new(R::Vec3::nearest(start), R::Vec3::nearest(dir));
        if !ray.is_valid() || !b.is_valid() {
            continue;
        }
        let Some(span) = span_of(&ray, min, max) else { continue };
        for (t_min, t_max) in intervals(&mut seeded, &span) {
            ray = ray.between(t_min, t_max);
            // A computed hit may lie one unit in the last place before the box, and ends the ray there.
            if span.meets(t_min.into(), t_max.next_up().into()) {
                hits += 1;
                wrong.extend(wrong_miss(&mut seeded, &ray, origin, &b, &world));
            }
        }
    }
    (wrong, hits)
}

fn none_wrong((wrong, hits): (Vec<String>, usize), least: usize) {
    assert!(hits >= least, "only {hits} hits");
    let first = wrong.iter().take(5).cloned().collect::<Vec<_>>().join("\n");
    assert!(wrong.is_empty(), "{} of {hits} hits missed:\n{first}", wrong.len());
}

/// The test that everybody writes first.
fn textbook(ray: &Ray<f32>, b: &Aabb) -> bool {
    let (p, q) = ((b.min - ray.origin) / ray.dir, (b.max - ray.origin) / ray.dir);
    p.min(q).max_element().max(ray.t_min) <= p.max(q).min_element().min(ray.t_max)
}

#[test]
fn the_cases_are_hostile_enough() {
    let mut seeded = Seeded::new(1);
    let (mut missed, mut hits) = (0, 0);
    for _ in 0..20_000 {
        let b = a_box(&mut seeded);
        let ray: Ray = a_ray(&mut seeded, &b);
        let span = if ray.is_valid() { span_of(&ray, b.min.as_dvec3(), b.max.as_dvec3()) } else { None };
        if span.is_some_and(|span| span.meets(0.0, f64::INFINITY)) {
            hits += 1;
            missed += usize::from(!textbook(&ray, &b));
        }
    }
    assert!(missed * 20 > hits, "the textbook misses {missed} of {hits} only");
}

#[test]
fn no_wrong_miss_in_f32() {
    none_wrong(adversarial::<f32>(1, 300_000), 500_000);
}

#[test]
fn no_wrong_miss_in_f64() {
    none_wrong(adversarial::<f64>(2, 300_000), 500_000);
}

/// Ten million pairs that meet, of each test of one box and of eight. Some minutes: run with `--release -- --ignored`.
#[test]
#[ignore = "takes minutes"]
fn no_wrong_miss_in_ten_million() {
    let mut hits = 0;
    for seed in 10.. {
        for (wrong, met) in [
            adversarial::<f32>(seed, 300_000),
            adversarial::<f64>(!seed, 300_000),
            far_away::<f32>(seed, 50_000),
            far_away::<f64>(!seed, 50_000),
        ] {
            hits += met;
            none_wrong((wrong, met), 1);
        }
        if hits >= 10_000_000 {
            break;
        }
    }
}

#[test]
fn no_wrong_miss_far_away_in_f32() {
    none_wrong(far_away::<f32>(3, 50_000), 50_000);
}

#[test]
fn no_wrong_miss_far_away_in_f64() {
    none_wrong(far_away::<f64>(4, 50_000), 50_000);
}

/// Which boxes are met and the bits of where, of all that are.
type Met = [Option<u32>; 8];

fn met((met, entry): (u32, [f32; 8])) -> Met {
    let mut places = [None; 8];
    for (i, place) in places.iter_mut().enumerate() {
        *place = (met >> i & 1 == 1).then(|| entry[i].to_bits());
    }
    places
}

/// What every set of instructions of this machine says.
fn at_every_level(slab: &SlabRay, boxes: &BoxOctet) -> Vec<(&'static str, Met)> {
    let mut said = vec![
        ("dispatched", met(slab.enter_eight(boxes))),
        ("portable", met(slab.wide(Portable).enter_eight(boxes))),
    ];
    let level = Level::new();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        said.extend(level.as_sse2().map(|lanes| ("sse2", met(slab.wide(lanes).enter_eight(boxes)))));
        said.extend(level.as_sse4_2().map(|lanes| ("sse4.2", met(slab.wide(lanes).enter_eight(boxes)))));
        said.extend(level.as_avx2().map(|lanes| ("avx2", met(slab.wide(lanes).enter_eight(boxes)))));
        said.extend(level.as_avx512().map(|lanes| ("avx512", met(slab.wide(lanes).enter_eight(boxes)))));
    }
    #[cfg(target_arch = "aarch64")]
    said.extend(level.as_neon().map(|lanes| ("neon", met(slab.wide(lanes).enter_eight(boxes)))));
    said
}

/// Draws rays and eight boxes each; returns how many boxes were met.
fn eight_like_one<R: Real>(seed: u64, cases: usize) -> usize {
    let mut seeded = Seeded::new(seed);
    let mut hits = 0;
    for _ in 0..cases {
        let boxes: Vec<Aabb> =
            (0..8).map(|_| if seeded.below(12) == 0 { Aabb::EMPTY } else { a_box(&mut seeded) }).collect();
        let world = boxes.iter().fold(Aabb::EMPTY, |world, b| world.union(*b));
        let aim = boxes[seeded.below(8)];
        let mut ray: Ray<R> = a_ray(&mut seeded, &aim);
        let (x, y) = (R::nearest(coordinate(&mut seeded) as f64), R::nearest(coordinate(&mut seeded) as f64));
        match seeded.below(4) {
            0 => ray = ray.between(if x < y { x } else { y }, if x < y { y } else { x }),
            1 => ray = ray.between(-R::INFINITY, R::INFINITY),
            _ => (),
        }
        if !ray.is_valid() {
            continue;
        }
        let slab = SlabRay::new(&ray, DVec3::ZERO, &world);
        let mut one: Met = [None; 8];
        for (place, b) in one.iter_mut().zip(&boxes) {
            *place = slab.entry(b).map(f32::to_bits);
        }
        for pair in 0..4 {
            let two = slab.enter_pair(&BoxPair::new(&boxes[2 * pair], &boxes[2 * pair + 1]));
            let (met, entry) = two;
            for side in 0..2 {
                let said = (met >> side & 1 == 1).then(|| entry[side].to_bits());
                assert_eq!(said, one[2 * pair + side], "{} {:?}", paste(&ray), boxes[2 * pair + side]);
            }
        }
        hits += one.iter().flatten().count();
        for (level, eight) in at_every_level(&slab, &BoxOctet::new(&boxes)) {
            assert_eq!(eight, one, "{level}: {} {boxes:?}", paste(&ray));
        }
    }
    hits
}

#[test]
fn eight_boxes_answer_as_one_at_every_level() {
    let hits = [eight_like_one::<f32>(5, 60_000), eight_like_one::<f64>(6, 60_000)];
    assert!(hits.iter().all(|&hits| hits > 40_000), "only {hits:?} boxes met");
}

#[test]
fn boxes_in_f64_are_met_exactly() {
    let mut seeded = Seeded::new(7);
    let (mut hits, mut asked) = (0, 0);
    for _ in 0..60_000 {
        let b = a_box(&mut seeded);
        let ray: Ray<f64> = a_ray(&mut seeded, &b);
        // Neighbours in f64 of what f32 can say.
        let step = |x: f64, up: usize| [x, x.next_up(), x.next_down()][up % 3];
        let [x, y, z] = ray.origin.to_array();
        let origin = DVec3::new(step(x, seeded.below(9)), step(y, seeded.below(9)), step(z, seeded.below(9)));
        let ray = Ray { origin, ..ray };
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let moderate =
            |v: DVec3| v.to_array().iter().all(|x| *x == 0.0 || (1e-130..1e130).contains(&x.abs()));
        if !ray.is_valid() || !b.is_valid() || !moderate(ray.origin) || !moderate(ray.dir) {
            continue;
        }
        let Some(span) = span_of(&ray, min, max) else {
            assert_eq!(DAabb { min, max }.span(&ray.between(f64::NEG_INFINITY, f64::INFINITY)), None);
            continue;
        };
        for (t_min, t_max) in intervals(&mut seeded, &span) {
            if [t_min, t_max].iter().any(|t: &f64| *t != 0.0 && t.abs() < 1e-130) {
                continue;
            }
            let met = span.meets(t_min, t_max);
            let said = DAabb { min, max }.span(&ray.between(t_min, t_max));
            asked += 1;
            hits += usize::from(met);
            assert_eq!(said.is_some(), met, "{} {b:?} {t_min:e} {t_max:e}", paste(&ray));
            let Some([near, far]) = said else { continue };
            let inside = |end: &exact::Rational| {
                let end: f64 = end.nearest();
                near.next_down() <= end.max(t_min) && end.min(t_max) <= far.next_up()
            };
            assert!(span.enter.as_ref().is_none_or(inside) && span.exit.as_ref().is_none_or(inside));
        }
    }
    assert!(hits > 100_000 && asked > 5 * hits / 4, "{hits} of {asked}");
}

proptest! {
    #[test]
    fn no_wrong_miss_at_all(corners: [[f32; 3]; 2], o: [f32; 3], d: [f32; 3], t_min: f32) {
        let reach = |v: [f32; 3]| Vec3A::from_array(v.map(|x| x.clamp(-4e37, 4e37)));
        let [p, q] = corners.map(reach);
        let b = Aabb::new(p.min(q), p.max(q));
        let ray = Ray::new(reach(o), reach(d)).between(t_min, f32::INFINITY);
        prop_assume!(ray.is_valid() && b.is_valid());
        let span = span_of(&ray, b.min.as_dvec3(), b.max.as_dvec3());
        if span.is_some_and(|span| span.meets(t_min.into(), f64::INFINITY)) {
            let wrong = wrong_miss(&mut Seeded::new(1), &ray, DVec3::ZERO, &b, &b);
            prop_assert!(wrong.is_none(), "{}", wrong.unwrap_or_default());
        }
    }
}

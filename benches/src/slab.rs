//! Which box test? Times are by ray and box, so that tests of one, two and eight boxes compare.

use crate::contest::{Group, Measured, Mismatch, Weigh, mark_front};
use crate::{Effort, TextbookRay, Trouble, Watch, hear};
use core::hint::black_box;
use rt_bounds::{Aabb, BoxOctet, BoxPair, Lanes, Portable, SlabRay};
use rt_geom::Ray;
use rt_geom::glam::{DVec3, Vec3A};
use rt_measure::clock::race;
use rt_measure::error::HitError;
use rt_measure::exact;
use rt_measure::rays::{self, Seeded};

/// Boxes that are timed, each against as many rays.
const TIMED: usize = 512;
/// Boxes that are judged.
const JUDGED: usize = 4096;
/// Rays at each of them.
const AT_EACH: usize = 6;

/// Boxes of all shapes, a quarter of them flat, in the unit cube.
fn boxes(count: usize) -> Vec<Aabb> {
    let mut seeded = Seeded::new(1);
    let make = |i: usize| {
        let center = seeded.inside(DVec3::ZERO, DVec3::ONE).as_vec3a();
        let mut half = seeded.inside(DVec3::splat(0.01), DVec3::splat(0.2)).as_vec3a();
        if i.is_multiple_of(4) {
            half[i / 4 % 3] = 0.0;
        }
        Aabb::new(center - half, center + half)
    };
    (0..count).map(make).collect()
}

fn corners(b: &Aabb) -> [DVec3; 8] {
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i: u32| {
        let side = |a: usize| if i >> a & 1 == 1 { b.max[a] } else { b.min[a] };
        Vec3A::new(side(0), side(1), side(2)).as_dvec3()
    })
}

/// Rays at one box, of one kind.
type Aim = fn(u64, &Aabb) -> Vec<Ray>;

const KINDS: [(&str, Aim); 4] = [
    ("chords", |seed, b| rays::uniform(seed, b, AT_EACH)),
    ("in_faces", |seed, b| rays::in_faces(seed, b, AT_EACH)),
    ("axis", |seed, b| rays::axis_parallel(b, &[corners(b)[seed as usize % 8]])),
    ("corners", |seed, b| rays::aimed(seed, b, &corners(b)[..AT_EACH], 1)),
];

/// A ray made ready for boxes.
struct Ready {
    slab: SlabRay,
    plain: TextbookRay,
}

/// One way to test a box.
struct Way {
    name: &'static str,
    /// Whether it promises never to miss what is met.
    never_misses: bool,
    test: fn(&Ready, &Aabb) -> bool,
}

const WAYS: [Way; 7] = [
    Way {
        name: "slab-pair",
        never_misses: true,
        test: |ready, b| ready.slab.enter_pair(&BoxPair::new(b, b)).0 == 3,
    },
    Way {
        name: "slab-eight",
        never_misses: true,
        test: |ready, b| ready.slab.enter_eight(&BoxOctet::new(&[*b; 8])).0 == 0xff,
    },
    Way {
        name: "slab-eight-by-test",
        never_misses: true,
        test: |ready, b| ready.slab.enter_eight(&BoxOctet::new(&[*b; 8])).0 == 0xff,
    },
    Way {
        name: "slab-eight-portable",
        never_misses: true,
        test: |ready, b| ready.slab.wide(Portable).enter_eight(&BoxOctet::new(&[*b; 8])).0 == 0xff,
    },
    Way { name: "slab-entry", never_misses: true, test: |ready, b| ready.slab.entry(b).is_some() },
    Way {
        name: "textbook-padded",
        never_misses: false,
        test: |ready, b| ready.plain.entry_padded_fast(b).is_some(),
    },
    Way { name: "textbook", never_misses: false, test: |ready, b| ready.plain.entry_fast(b).is_some() },
];

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let boxes = boxes(JUDGED);
    let mut groups = Vec::new();
    for (k, (kind, aim)) in KINDS.iter().enumerate() {
        hear(watch, k, KINDS.len())?;
        let sets: Vec<Vec<Ray>> = (0..).zip(&boxes).map(|(seed, b)| aim(seed, b)).collect();
        groups.push(group(effort, kind, &boxes, &sets));
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

fn group(effort: Effort, kind: &str, boxes: &[Aabb], sets: &[Vec<Ray>]) -> Group {
    let ready = |ray: &Ray, world: &Aabb| Ready {
        slab: SlabRay::new(ray, DVec3::ZERO, world),
        plain: TextbookRay::new(ray),
    };
    let mut errors = [HitError::default(); WAYS.len()];
    for (b, set) in boxes.iter().zip(sets) {
        for ray in set {
            let met = met(ray, b);
            let ready = ready(ray, b);
            for (error, way) in errors.iter_mut().zip(&WAYS) {
                let said = (way.test)(&ready, b);
                error.rays += 1;
                error.missed += (met && !said) as u64;
                error.invented += (!met && said) as u64;
            }
        }
    }
    let judged = errors[0].rays as usize;
    let liar = WAYS.iter().zip(&errors).find(|(way, error)| way.never_misses && error.missed > 0);
    let outcome = match liar {
        Some((way, error)) => {
            Err(Mismatch { who: way.name.into(), what: format!("missed {} of {judged}", error.missed) })
        }
        None => Ok(timed(effort, boxes, sets, &errors, &ready)),
    };
    Group { scene: "boxes".into(), prims: TIMED, ray_kind: kind.into(), rays: TIMED * TIMED, judged, outcome }
}

/// How many boxes the ray meets, with instructions chosen outside.
#[inline(always)]
fn count<L: Lanes>(lanes: L, ray: &SlabRay, octets: &[BoxOctet]) -> u32 {
    let ray = ray.wide(lanes);
    octets.iter().map(|eight| ray.enter_eight(eight).0.count_ones()).sum()
}

/// Each of some rays against each of some boxes. The loops are written out, because a call by pointer costs as much as a test.
fn timed(
    effort: Effort,
    boxes: &[Aabb],
    sets: &[Vec<Ray>],
    errors: &[HitError],
    ready: &dyn Fn(&Ray, &Aabb) -> Ready,
) -> Vec<Measured> {
    let boxes = &boxes[..TIMED.min(boxes.len())];
    let pairs: Vec<BoxPair> = boxes.chunks_exact(2).map(|two| BoxPair::new(&two[0], &two[1])).collect();
    let octets: Vec<BoxOctet> = boxes.chunks_exact(8).map(BoxOctet::new).collect();
    let world = boxes.iter().fold(Aabb::EMPTY, |world, b| world.union(*b));
    let rays: Vec<Ready> =
        sets.iter().flat_map(|set| set.first()).take(TIMED).map(|ray| ready(ray, &world)).collect();
    let mut pair = || {
        for ray in black_box(&rays) {
            let met: u32 = pairs.iter().map(|pair| ray.slab.enter_pair(pair).0.count_ones()).sum();
            black_box(met);
        }
    };
    let mut eight = || {
        for ray in black_box(&rays) {
            black_box(rt_bounds::dispatch!(lanes => count(lanes, &ray.slab, &octets)));
        }
    };
    let mut by_test = || {
        for ray in black_box(&rays) {
            let met: u32 = octets.iter().map(|eight| ray.slab.enter_eight(eight).0.count_ones()).sum();
            black_box(met);
        }
    };
    let mut portable = || {
        for ray in black_box(&rays) {
            black_box(count(Portable, &ray.slab, &octets));
        }
    };
    let mut entry = || {
        for ray in black_box(&rays) {
            black_box(boxes.iter().filter(|b| ray.slab.entry(b).is_some()).count());
        }
    };
    let mut padded = || {
        for ray in black_box(&rays) {
            black_box(boxes.iter().filter(|b| ray.plain.entry_padded_fast(b).is_some()).count());
        }
    };
    let mut textbook = || {
        for ray in black_box(&rays) {
            black_box(boxes.iter().filter(|b| ray.plain.entry_fast(b).is_some()).count());
        }
    };
    let mut contestants: [&mut dyn FnMut(); WAYS.len()] =
        [&mut pair, &mut eight, &mut by_test, &mut portable, &mut entry, &mut padded, &mut textbook];
    let race = race(effort.plan(), &mut contestants);
    let tests = (rays.len() * boxes.len()).max(1) as f64;
    let measured = WAYS.iter().zip(errors).enumerate().map(|(i, (way, error))| Measured {
        structure: way.name.into(),
        params: if way.never_misses { "conservative".into() } else { "fast".into() },
        build_ms: None,
        bytes_per_prim: None,
        ns_per_ray: race.median(i) / tests,
        spread: race.spread(i),
        speed: race.ratio(0, i),
        nodes_per_ray: None,
        tests_per_ray: None,
        sah: None,
        error: *error,
        has_t: false,
        void: None,
        figures: Vec::new(),
        on_front: false,
    });
    let mut measured: Vec<Measured> = measured.collect();
    mark_front(&mut measured, Weigh::Misses);
    measured
}

/// Whether the ray meets the closed box, exactly.
fn met(ray: &Ray, b: &Aabb) -> bool {
    let array = |v: Vec3A| v.as_dvec3().to_array();
    exact::aabb(array(ray.origin), array(ray.dir), array(b.min), array(b.max))
        .is_some_and(|span| span.meets(ray.t_min.into(), ray.t_max.into()))
}

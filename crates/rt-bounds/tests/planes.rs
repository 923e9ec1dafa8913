//! Volumes between planes against exact arithmetic: they hold every point, and never miss wrongly.

use rt_bounds::{Aabb, BoundingVolume, Hull, Kdop, Polytope, SlabRay};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Vector};
use rt_measure::conform::paste;
use rt_measure::exact::{self, Plane, Rational};
use rt_measure::rays::Seeded;

/// A volume whose planes the oracle can see.
trait Planes: BoundingVolume {
    fn planes(&self, origin: DVec3) -> Vec<Plane>;
}

fn plane(n: DVec3, d: f32, origin: DVec3) -> Plane {
    Plane { normal: n.to_array(), offset: d as f64, from: origin.to_array() }
}

impl<const K: usize> Planes for Kdop<K> {
    fn planes(&self, origin: DVec3) -> Vec<Plane> {
        let slab = |i| {
            let (n, (lo, hi)) = (Kdop::<K>::normal(i), self.extent(i));
            [plane(-n, -lo, origin), plane(n, hi, origin)]
        };
        (0..K / 2).flat_map(slab).collect()
    }
}

impl Planes for Polytope {
    fn planes(&self, origin: DVec3) -> Vec<Plane> {
        let plane = |[x, y, z, d]: [f32; 4]| plane(Vec3A::new(x, y, z).as_dvec3(), d, origin);
        self.planes().map(plane).collect()
    }
}

const KINDS: usize = 10;

/// Points of many kinds, all representable in `R`, and the origin of their volume.
fn points<R: Real>(seeded: &mut Seeded, kind: usize) -> (Vec<DVec3>, DVec3) {
    let count = 1 + seeded.below(20);
    let size = match kind {
        5 => 1e30,
        6 => 1e-30,
        8 => 1e-42,
        _ => [1e-3, 1.0, 1e3][seeded.below(3)],
    };
    let far = match kind {
        7 => DVec3::new(1e7, -1e7, 1e7 * seeded.unit()),
        _ => DVec3::ZERO,
    };
    let (u, v) = (seeded.direction(), seeded.direction());
    let base = seeded.direction();
    let mut draw = |_| {
        let p = match kind {
            // Flat, on a line, and in one place, as far as rounding allows.
            1 => u * seeded.between(-1.0, 1.0) + v * seeded.between(-1.0, 1.0),
            2 => base + u * seeded.between(-1.0, 1.0),
            3 => base,
            // Exactly flat, with many coincidences.
            4 => DVec3::new(seeded.below(5) as f64, seeded.below(5) as f64, 1.0),
            // Whole numbers: rays meet corners and edges exactly.
            9 => DVec3::new(seeded.below(5) as f64, seeded.below(5) as f64, seeded.below(5) as f64),
            _ => DVec3::new(seeded.between(-1.0, 1.0), seeded.between(-1.0, 1.0), seeded.between(-1.0, 1.0)),
        };
        let whole = matches!(kind, 4 | 9);
        R::Vec3::nearest(far + if whole { p } else { p * size }).widen()
    };
    let points: Vec<DVec3> = (0..count).map(&mut draw).collect();
    let origin = match (kind, seeded.below(3)) {
        (7, 0) => far,
        (7, 1) => points[0],
        (9, 0) => DVec3::new(0.1, 1e3, -0.3),
        _ => DVec3::ZERO,
    };
    (points, origin)
}

fn all_kinds<R: Real>(seed: u64, count: usize, mut test: impl FnMut(usize, Vec<DVec3>, DVec3)) {
    let mut seeded = Seeded::new(seed);
    for i in 0..count {
        let (points, origin) = points::<R>(&mut seeded, i % KINDS);
        test(i % KINDS, points, origin);
    }
}

fn holds<B: Planes>(b: &B, points: &[DVec3], origin: DVec3, what: &str) {
    let corners = b.aabb();
    for plane in b.planes(origin) {
        for p in points {
            assert!(plane.holds(p.to_array()), "{what}: {p} outside {plane:?}");
        }
    }
    assert!(corners.is_valid() && b.surface_area() >= 0.0, "{what}");
}

fn contains<R: Real>(seed: u64, count: usize) {
    all_kinds::<R>(seed, count, |kind, points, origin| {
        let what = format!("kind {kind} of {points:?} about {origin}");
        let points = &points[..];
        holds(&Kdop::<6>::around(points, origin).unwrap(), points, origin, &what);
        holds(&Kdop::<14>::around(points, origin).unwrap(), points, origin, &what);
        holds(&Kdop::<18>::around(points, origin).unwrap(), points, origin, &what);
        let dop = Kdop::<26>::around(points, origin).unwrap();
        holds(&dop, points, origin, &what);
        let (left, right) = points.split_at(points.len() / 2);
        let halves = [left, right].map(|half| Kdop::<26>::from_points(half.iter().copied(), origin));
        assert_eq!(halves[0].union(halves[1]), dop);
        assert!(dop.contains(&halves[0]) && dop.contains(&dop.overlap(halves[1])));

        let round = Polytope::around(points, origin).unwrap();
        holds(&round, points, origin, &what);
        let hull = Hull::new(points).unwrap();
        check(&hull, points);
        let full = hull.polytope(origin);
        holds(&full, points, origin, &what);
        holds(&hull.reduced(12, origin), points, origin, &what);
        if matches!(kind, 0 | 9) && hull.facets().len() > 3 {
            assert!(full.surface_area() <= dop.surface_area() * 1.000_01, "{what}");
            // Planes are as good as f32 allows: relative to coordinates, that is.
            let reach = points.iter().fold(0.0f64, |r, p| r.max((*p - origin).abs().max_element()));
            let size = hull.surface_area().sqrt();
            assert!(full.surface_area() <= hull.surface_area() + 1e-5 * size * reach, "{what}");
        }
    });
}

/// The hull closes, is convex, and holds all points, by exact signs.
fn check(hull: &Hull, points: &[DVec3]) {
    let at = |i: u32| hull.corners()[i as usize].to_array();
    let mut edges = std::collections::HashSet::new();
    for facet in hull.facets() {
        assert!(facet.len() >= 3);
        let mut proper = false;
        for (i, &u) in facet.iter().enumerate() {
            let (v, w) = (facet[(i + 1) % facet.len()], facet[(i + 2) % facet.len()]);
            assert!(edges.insert((u, v)), "an edge twice");
            for p in points {
                let side = exact::side(at(u), at(v), at(w), p.to_array());
                assert!(side.is_le(), "{p} is above a facet");
                proper |= side.is_lt();
            }
        }
        assert!(proper || hull.facets().len() == 2);
    }
    assert!(edges.iter().all(|(u, v)| edges.contains(&(*v, *u))), "an open edge");
    let (v, e, f) = (hull.corners().len(), hull.edge_count(), hull.facets().len());
    if f > 0 {
        assert_eq!(v + f, e + 2);
    } else {
        assert!(v == 1 && e == 0 || v == 2 && e == 1);
    }
    for (corner, number) in hull.corners().iter().zip(hull.numbers()) {
        assert_eq!(*corner, points[*number as usize]);
    }
}

#[test]
fn every_point_is_inside_in_f32() {
    contains::<f32>(1, 600);
}

#[test]
fn every_point_is_inside_in_f64() {
    contains::<f64>(2, 600);
}

/// Points that only the roundings keep from being in a plane, or in two: all decisions are close.
#[test]
fn turned_circles_and_cylinders_have_exact_hulls() {
    let mut seeded = Seeded::new(3);
    for count in [7, 40, 96] {
        let (x, z) = (seeded.direction(), seeded.direction());
        let (x, y) = (x, z.cross(x));
        let at = |i: usize| std::f64::consts::TAU * i as f64 / count as f64;
        let circle: Vec<DVec3> = (0..count).map(|i| x * at(i).cos() + y * at(i).sin()).collect();
        let hull = Hull::new(&circle).unwrap();
        check(&hull, &circle);
        assert!(hull.facets().len() > count / 2);
        let cylinder: Vec<DVec3> =
            (0..count).map(|i| x * at(i).cos() + y * at(i).sin() + z * (i % 2) as f64).collect();
        check(&Hull::new(&cylinder).unwrap(), &cylinder);
    }
}

#[test]
fn room_for_all_planes_means_all() {
    let mut seeded = Seeded::new(4);
    let points: Vec<DVec3> = (0..40).map(|_| seeded.direction()).collect();
    let hull = Hull::new(&points).unwrap();
    let full = hull.polytope(DVec3::ZERO);
    assert_eq!(hull.reduced(usize::MAX, DVec3::ZERO), full);
    assert_eq!(hull.reduced(full.plane_count(), DVec3::ZERO), full);
    let (box_alone, fewer) =
        (hull.reduced(0, DVec3::ZERO), hull.reduced(full.plane_count() - 1, DVec3::ZERO));
    assert!(fewer.plane_count() < full.plane_count());
    // Heap blocks are of four planes with four numbers each.
    assert_eq!(box_alone.bytes(), size_of::<Polytope>());
    assert_eq!(full.bytes(), size_of::<Polytope>() + (full.plane_count() - 6).div_ceil(4) * 64);
}

/// A ray at the points or past them.
fn a_ray<R: Real>(seeded: &mut Seeded, points: &[DVec3]) -> Ray<R> {
    let mut pick = |n: usize| points[seeded.below(n)];
    let n = points.len();
    // A corner, a place on an edge, or in a face, or inside.
    let corners = [pick(n), pick(n), pick(n)];
    let weights = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.25, 0.25]][seeded.below(3)];
    let target = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
    let size = points.iter().fold(0.0f64, |s, p| s.max((*p - points[0]).abs().max_element()));
    let size = if size == 0.0 { points[0].abs().max_element() } else { size };
    let reach = size * [0.5, 2.0, 4.0, 1e3, 1e6][seeded.below(5)];
    let mut origin = match seeded.below(4) {
        0 => points[seeded.below(n)],
        1 => target + DVec3::new(seeded.below(9) as f64 - 4.0, seeded.below(9) as f64 - 4.0, 2.0),
        _ => target + seeded.direction() * reach,
    };
    let mut dir = match seeded.below(6) {
        0 => seeded.direction(),
        1 => DVec3::new(
            seeded.below(3) as f64 - 1.0,
            seeded.below(3) as f64 - 1.0,
            seeded.below(3) as f64 - 1.0,
        ),
        // Along an edge, or in a face.
        2 => corners[1] - corners[0],
        _ => target - origin,
    };
    for a in 0..3 {
        if seeded.below(7) == 0 {
            dir[a] = if seeded.below(2) == 0 { 0.0 } else { -0.0 };
            origin[a] = target[a];
        }
    }
    if seeded.below(8) == 0 {
        dir *= [1e-40, 1e-20, 1e-3, 1e5, 1e30][seeded.below(5)];
    }
    let t_min = [0.0, 0.0, 0.0, -1.0, f64::NEG_INFINITY, 0.5][seeded.below(6)];
    let t_max = [f64::INFINITY, f64::INFINITY, 1.0, 1e3][seeded.below(4)];
    Ray::new(R::Vec3::nearest(origin), R::Vec3::nearest(dir)).between(R::nearest(t_min), R::nearest(t_max))
}

#[derive(Default, Debug)]
struct Tally {
    pairs: usize,
    hits: usize,
    /// Pairs that count as a hit though the exact ray misses the volume, of those looked at.
    judged: usize,
    invented: usize,
    wrong: Vec<String>,
}

/// How a volume is made around points, relative to an origin.
type Fit<B> = fn(&[DVec3], DVec3) -> B;

fn around<B: Planes>(points: &[DVec3], origin: DVec3) -> B {
    B::around(points, origin).unwrap()
}

fn all_facets(points: &[DVec3], origin: DVec3) -> Polytope {
    Hull::new(points).unwrap().polytope(origin)
}

fn some_facets(points: &[DVec3], origin: DVec3) -> Polytope {
    Hull::new(points).unwrap().reduced(12, origin)
}

/// Draws pairs of rays and volumes, and looks for wrong misses.
fn pairs<B: Planes, R: Real>(seed: u64, count: usize, fit: Fit<B>) -> Tally {
    let mut seeded = Seeded::new(seed);
    let mut tally = Tally::default();
    let mut kind = 0;
    while tally.pairs < count {
        kind += 1;
        let (points, origin) = points::<R>(&mut seeded, kind % KINDS);
        let volume = fit(&points, origin);
        let planes = volume.planes(origin);
        let world = volume.aabb();
        for _ in 0..50 {
            let ray: Ray<R> = a_ray(&mut seeded, &points);
            if !ray.is_valid() {
                tally.pairs += 1;
                assert!(volume.entry(&B::ready(&ray, origin, &world)).is_none(), "{}", paste(&ray));
                continue;
            }
            let (o, d) = (ray.origin.widen().to_array(), ray.dir.widen().to_array());
            let mut rays = vec![ray];
            if seeded.below(16) == 0 {
                // Intervals that end exactly at the ends of the volume, as far as R can say.
                let ends = exact::convex(o, d, &planes).map(|span| [span.enter, span.exit]);
                for t in ends.into_iter().flatten().flatten() {
                    let t = Rational::nearest::<R>(&t);
                    for t in [t.next_down(), t, t.next_up()] {
                        rays.extend([ray.between(t, t), ray.between(-R::INFINITY, t)]);
                        rays.extend([ray.between(t, R::INFINITY), ray.between(R::ZERO, t)]);
                    }
                }
            }
            for ray in rays.iter().filter(|ray| ray.is_valid()) {
                tally.pairs += 1;
                let found = volume.entry(&B::ready(ray, origin, &world)).is_some();
                tally.hits += usize::from(found);
                if found && !tally.hits.is_multiple_of(16) {
                    continue;
                }
                // A computed hit may lie one unit in the last place before the volume, and ends the ray there.
                let t_max = ray.t_max.next_up().into();
                let met = exact::convex_met(o, d, ray.t_min.into(), t_max, &planes);
                tally.judged += usize::from(found);
                tally.invented += usize::from(found && !met);
                if met && !found {
                    let what = format!("kind {} {}\n {points:?} about {origin}", kind % KINDS, paste(ray));
                    tally.wrong.push(what);
                }
            }
        }
    }
    tally
}

fn none_wrong<B: Planes>(seed: u64, count: usize, what: &str, fit: Fit<B>) -> String {
    let start = std::time::Instant::now();
    let (single, double) = (pairs::<B, f32>(seed, count / 2, fit), pairs::<B, f64>(seed + 1, count / 2, fit));
    let mut report = format!("{what}: {:.1} s", start.elapsed().as_secs_f64());
    for tally in [single, double] {
        let shown = tally.wrong.iter().take(3).cloned().collect::<Vec<_>>().join("\n");
        assert!(tally.wrong.is_empty(), "{what}: {} of {} missed:\n{shown}", tally.wrong.len(), tally.pairs);
        assert!(tally.hits * 5 > tally.pairs && tally.hits * 20 < tally.pairs * 19, "{tally:?}");
        let invented = tally.invented as f64 / tally.judged as f64;
        report += &format!("; {} pairs, {} hits, invented {invented:.1e} of them", tally.pairs, tally.hits);
    }
    report
}

#[test]
fn no_wrong_miss() {
    none_wrong::<Kdop<6>>(10, 20_000, "6-DOP", around);
    none_wrong::<Kdop<14>>(11, 20_000, "14-DOP", around);
    none_wrong::<Kdop<18>>(12, 20_000, "18-DOP", around);
    none_wrong::<Kdop<26>>(13, 20_000, "26-DOP", around);
    none_wrong::<Polytope>(14, 20_000, "polytope", around);
    none_wrong(15, 20_000, "polytope of all facets", all_facets);
    none_wrong(16, 20_000, "polytope of 12 planes", some_facets);
}

/// Minutes. Prints how many pairs were tried, and the share of hits that no exact ray makes.
#[test]
#[ignore]
#[allow(clippy::print_stdout)]
fn no_wrong_miss_in_ten_million() {
    println!("{}", none_wrong::<Kdop<6>>(20, 10_000_000, "6-DOP", around));
    println!("{}", none_wrong::<Kdop<14>>(21, 10_000_000, "14-DOP", around));
    println!("{}", none_wrong::<Kdop<18>>(22, 10_000_000, "18-DOP", around));
    println!("{}", none_wrong::<Kdop<26>>(23, 10_000_000, "26-DOP", around));
    println!("{}", none_wrong::<Polytope>(24, 10_000_000, "polytope", around));
    println!("{}", none_wrong(25, 10_000_000, "polytope of all facets", all_facets));
    println!("{}", none_wrong(26, 10_000_000, "polytope of 12 planes", some_facets));
}

#[test]
fn six_planes_answer_as_the_box_bit_for_bit() {
    let mut hits = 0;
    let mut seeded = Seeded::new(30);
    for i in 0..2_000 {
        let (points, origin) = points::<f32>(&mut seeded, i % KINDS);
        let b = <Aabb as BoundingVolume>::around(&points, origin).unwrap();
        let dop = Kdop::<6>::around(&points, origin).unwrap();
        assert_eq!((dop.aabb(), Kdop::from_aabb(&b)), (b, dop));
        for _ in 0..20 {
            let ray: Ray<f32> = a_ray(&mut seeded, &points);
            if ray.is_valid() {
                let of_box = SlabRay::new(&ray, origin, &b).entry(&b);
                let of_dop = dop.entry(&Kdop::ready(&ray, origin, &b));
                assert_eq!(of_box.map(f32::to_bits), of_dop.map(f32::to_bits), "{}", paste(&ray));
                hits += usize::from(of_box.is_some());
            }
        }
    }
    assert!(hits > 10_000);
}

#[test]
fn invalid_rays_meet_nothing() {
    let cube = [DVec3::splat(-1.0), DVec3::ONE, DVec3::new(1.0, -1.0, 1.0), DVec3::new(-1.0, 1.0, 1.0)];
    let world = Aabb::INFINITE;
    let (dop, polytope) =
        (Kdop::<26>::around(&cube, DVec3::ZERO).unwrap(), Polytope::around(&cube, DVec3::ZERO).unwrap());
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for a in 0..3 {
            let (mut o, mut d) = (Vec3A::ZERO, Vec3A::ZERO);
            (o[a], d[a]) = (bad, bad);
            let rays = [
                Ray::new(o, Vec3A::X),
                Ray::new(Vec3A::ZERO, d),
                Ray::new(Vec3A::ZERO, Vec3A::ZERO),
                Ray::new(Vec3A::ZERO, Vec3A::X).between(f32::NAN, 1.0),
                Ray::new(Vec3A::ZERO, Vec3A::X).between(0.0, f32::NAN),
                Ray::new(Vec3A::ZERO, Vec3A::X).between(1.0, 0.0),
            ];
            for ray in rays {
                let mut ready = Kdop::ready(&ray, DVec3::ZERO, &world);
                assert!(dop.entry(&ready).is_none());
                ready.shorten(1e9f32);
                assert!(dop.entry(&ready).is_none());
                let mut ready = Polytope::ready(&ray, DVec3::ZERO, &world);
                assert!(polytope.entry(&ready).is_none());
                ready.shorten(1e9f32);
                assert!(polytope.entry(&ready).is_none());
            }
        }
    }
}

#[test]
fn bad_points_are_answered() {
    let bad = [DVec3::ONE, DVec3::new(0.0, f64::NAN, 0.0)];
    assert!(Kdop::<14>::around(&bad, DVec3::ZERO).is_none() && Polytope::around(&bad, DVec3::ZERO).is_none());
    assert!(Kdop::<14>::around::<DVec3>(&[], DVec3::ZERO).is_none());
    assert!(Polytope::around::<DVec3>(&[], DVec3::ZERO).is_none());
    assert!(Kdop::<14>::from_points(bad, DVec3::ZERO).extent(6).0.is_nan());
    assert_eq!(Hull::new(&bad).unwrap_err(), rt_bounds::HullError::NotFinite(1));
    assert_eq!(Hull::new::<Vec3A>(&[]).unwrap_err(), rt_bounds::HullError::Empty);
    // Of sizes beyond f32, and further apart than exact signs reach.
    let wide = [DVec3::splat(1e-300), DVec3::new(1e300, 0.0, 2.0), DVec3::Y, DVec3::Z];
    assert_eq!(Hull::new(&wide).unwrap_err(), rt_bounds::HullError::TooFarApart);
    let wide = Polytope::around(&wide, DVec3::ZERO).unwrap();
    assert_eq!((wide.aabb().max.x, wide.surface_area()), (f32::INFINITY, f64::INFINITY));
    let ray = Ray::new(DVec3::new(1e290, 0.5, -1.0), DVec3::Z);
    assert!(wide.entry(&Polytope::ready(&ray, DVec3::ZERO, &wide.aabb())).is_some());
    let wide = Kdop::<26>::around(&[DVec3::splat(1e308), DVec3::splat(-1e308)], DVec3::ZERO).unwrap();
    assert!(wide.entry(&Kdop::ready(&ray, DVec3::ZERO, &wide.aabb())).is_some());
    assert_eq!(Kdop::<26>::EMPTY.surface_area(), 0.0);
    let nothing = Kdop::<26>::ready(&Ray::new(Vec3A::ONE, Vec3A::X), DVec3::ZERO, &Aabb::INFINITE);
    assert!(Kdop::EMPTY.entry(&nothing).is_none());
}

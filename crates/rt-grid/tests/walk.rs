//! The walk visits the right cells, as many as geometry says; and what cannot matter does not.

use core::ops::ControlFlow;
use rt_accel::{
    Aggregate, Bounded, BuildError, Clip, Counts, Exhaustive, Leaf, Mailing, Primitive, Structure, Visitor,
};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Vector};
use rt_grid::{Grid, GridParams, MAX_DEPTH, Nest, Resolution, Skip};
use rt_measure::rays::{Seeded, uniform};
use rt_scenes::soup;

/// Something small in the middle of each cell of side 4, and two points that make the box.
struct Bricks([u32; 3]);

impl Bounded for Bricks {
    fn prim_count(&self) -> usize {
        self.0.iter().product::<u32>() as usize + 2
    }
    fn bound(&self, prim: u32) -> Aabb {
        let [nx, ny, nz] = self.0;
        let point = |p: [u32; 3]| Vec3A::from_array(p.map(|x| 4.0 * x as f32));
        match prim.checked_sub(nx * ny * nz) {
            None => {
                let low = point([prim % nx, prim / nx % ny, prim / nx / ny]);
                Aabb::new(low + Vec3A::ONE, low + Vec3A::splat(3.0))
            }
            Some(0) => Aabb::new(Vec3A::ZERO, Vec3A::ZERO),
            Some(_) => Aabb::new(point(self.0), point(self.0)),
        }
    }
}

impl Bricks {
    fn grid(&self) -> Grid {
        let params = GridParams { resolution: Resolution::Fixed(self.0), ..GridParams::default() };
        Grid::build(self, &params).unwrap()
    }
}

/// Hears which cells are visited.
#[derive(Default)]
struct Path(Vec<u32>, u64);

impl<R: Real> Visitor<R> for Path {
    fn leaf(&mut self, leaf: Leaf<'_>, _: &mut Ray<R>) -> ControlFlow<()> {
        self.0.push(leaf.prims[0]);
        ControlFlow::Continue(())
    }
    fn node(&mut self) {
        self.1 += 1;
    }
}

/// When an integer ray is in a closed box, as integers over one denominator.
fn within(o: [i64; 3], d: [i64; 3], low: [i64; 3], high: [i64; 3], t: [i64; 2]) -> Option<[i128; 2]> {
    let denominator: i128 = d.iter().filter(|d| **d != 0).map(|d| d.unsigned_abs() as i128).product();
    let mut span = t.map(|t| t as i128 * denominator);
    for a in 0..3 {
        if d[a] == 0 {
            if o[a] < low[a] || o[a] > high[a] {
                return None;
            }
            continue;
        }
        let at = |p: i64| (p - o[a]) as i128 * (denominator / d[a] as i128);
        let (p, q) = (at(low[a]), at(high[a]));
        span = [span[0].max(p.min(q)), span[1].min(p.max(q))];
    }
    (span[0] <= span[1]).then_some(span)
}

/// Cells visited are touched, share faces one with the next, and cover all of the ray within the grid.
fn visited<R: Real>(count: [u32; 3], rays: usize, seed: u64) {
    let (bricks, mut random) = (Bricks(count), Seeded::new(seed));
    let grid = bricks.grid();
    let high = count.map(|n| 4 * n as i64);
    let mut met = 0;
    for round in 0..rays {
        let steep = [2, 5, 40][round % 3];
        let mut pick = |most: usize| random.below(2 * most + 1) as i64 - most as i64;
        let d = [pick(steep), pick(steep), pick(steep)];
        if d == [0; 3] {
            continue;
        }
        // From a corner, edge or face of a cell, or from anywhere; carried back along the ray by some of its length.
        let back = [0, 1, 7, 1000][round / 3 % 4];
        let mut place = |a: usize| match round % 2 {
            0 => 4 * random.below(count[a] as usize + 1) as i64,
            _ => random.below(high[a] as usize + 1) as i64,
        };
        let at = [place(0), place(1), place(2)];
        let o = [0, 1, 2].map(|a| at[a] - back * d[a]);
        let t = if round % 5 == 0 { [back, back + 2] } else { [0, 1 << 20] };
        let vector = |v: [i64; 3]| R::Vec3::nearest(DVec3::from_array(v.map(|x| x as f64)));
        let mut ray =
            Ray::new(vector(o), vector(d)).between(R::nearest(t[0] as f64), R::nearest(t[1] as f64));
        let mut path = Path::default();
        grid.traverse(&mut ray, &mut path);
        let whole = within(o, d, [0; 3], high, t);
        assert_eq!(path.0.is_empty(), whole.is_none(), "{o:?} {d:?} {t:?}");
        let Some([from, to]) = whole else { continue };
        met += 1;
        let cell = |prim: u32| {
            [prim % count[0], prim / count[0] % count[1], prim / count[0] / count[1]].map(i64::from)
        };
        let mut covered = from;
        for (i, prim) in path.0.iter().enumerate() {
            let c = cell(*prim);
            let span = within(o, d, c.map(|c| 4 * c), c.map(|c| 4 * c + 4), t);
            let [enter, leave] = span.unwrap_or_else(|| panic!("{c:?} is not touched by {o:?} {d:?} {t:?}"));
            assert!(enter <= covered, "nothing before {c:?} of {:?} on {o:?} {d:?} {t:?}", path.0);
            covered = covered.max(leave);
            if i > 0 {
                let before = cell(path.0[i - 1]);
                assert_eq!((0..3).map(|a| (c[a] - before[a]).abs()).sum::<i64>(), 1, "{before:?} to {c:?}");
            }
        }
        assert!(covered >= to, "{:?} ends too early on {o:?} {d:?} {t:?}", path.0);
    }
    assert!(met > rays / 3, "{met} of {rays} rays met the grid");
}

#[test]
fn cells_are_those_of_exact_arithmetic() {
    for (seed, count) in (1..).zip([[1, 1, 1], [2, 3, 1], [7, 5, 9], [16, 16, 16], [1, 200, 3]]) {
        visited::<f32>(count, 2000, seed);
        visited::<f64>(count, 2000, seed + 100);
    }
}

#[test]
#[ignore = "a million rays"]
fn cells_are_those_of_exact_arithmetic_at_length() {
    for (seed, count) in (1..).zip([[1, 1, 1], [2, 3, 1], [7, 5, 9], [16, 16, 16], [1, 200, 3]]) {
        visited::<f32>(count, 100_000, seed + 1000);
        visited::<f64>(count, 100_000, seed + 2000);
    }
}

/// Isotropic lines that meet a box visit `1 + ((nx-1) bc + (ny-1) ac + (nz-1) ab) / (ab + bc + ca)` cells on average.
#[test]
fn the_mean_number_of_cells_is_known() {
    let mesh = [Vec3A::ZERO, Vec3A::new(3.0, 2.0, 1.0)];
    for (count, expected) in [([7, 5, 9], 1.0 + (6.0 * 2.0 + 4.0 * 3.0 + 8.0 * 6.0) / 11.0), ([10; 3], 10.0)]
    {
        let ends = Ends(if count == [10; 3] { [Vec3A::ZERO, Vec3A::ONE] } else { mesh });
        let plain =
            GridParams { resolution: Resolution::Fixed(count), skip: Skip::None, ..GridParams::default() };
        let grid = Grid::build(&ends, &plain).unwrap();
        let (low, high) = (grid.local_bound().min.as_dvec3(), grid.local_bound().max.as_dvec3());
        let (center, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
        let (mut random, mut met, mut cells) = (Seeded::new(5), 0u64, 0u64);
        for _ in 0..300_000 {
            let dir = random.direction();
            let across = dir.any_orthonormal_vector();
            let (sin, cos) = random.between(0.0, core::f64::consts::TAU).sin_cos();
            let offset = (across * cos + dir.cross(across) * sin) * (radius * random.unit().sqrt());
            let mut path = Path::default();
            grid.traverse(&mut Ray::new(center + offset - dir * radius, dir), &mut path);
            met += (path.1 > 0) as u64;
            cells += path.1;
        }
        let mean = cells as f64 / met as f64;
        assert!((mean / expected - 1.0).abs() < 0.005, "{mean} cells, not {expected}");
    }
}

/// Two points.
struct Ends([Vec3A; 2]);

impl Bounded for Ends {
    fn prim_count(&self) -> usize {
        2
    }
    fn bound(&self, prim: u32) -> Aabb {
        Aabb::from_points(self.0.get(prim as usize).copied())
    }
}

#[test]
fn grids_do_not_depend_on_the_number_of_threads() {
    let mesh = soup::clusters(12_000, 3);
    let measured = GridParams { resolution: Resolution::Measured { rays: 100 }, ..GridParams::default() };
    let hug = GridParams::hug();
    for params in [GridParams::default(), GridParams::nested(), GridParams::two_level(), hug, measured] {
        let grids = [1, 2, 3, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Grid::build(&mesh, &params).unwrap())
        });
        assert!(grids.iter().all(|grid| *grid == grids[0]), "{params:?}");
    }
}

#[test]
fn mailboxes_and_leaps_change_no_answer() {
    let plain = GridParams { skip: Skip::None, ..GridParams::default() };
    let nested = GridParams { skip: Skip::None, ..GridParams::nested() };
    // Something long that is met again and again, and something hollow in much space.
    for (mesh, long) in [(soup::sticks(400, 100.0, 4), true), (soup::icosphere(4), false)] {
        for base in [plain, nested] {
            let scenes = [
                base,
                GridParams { mailing: Mailing::Hashed, ..base },
                GridParams { mailing: Mailing::Inverse, ..base },
                GridParams { skip: Skip::Clouds, ..base },
            ]
            .map(|params| Aggregate::<Grid, _>::build(&mesh, &params).unwrap());
            let mut counts = [Counts::default(); 4];
            for ray in uniform::<f32>(7, &scenes[0].structure().local_bound(), 3000) {
                let answers: Vec<_> =
                    (0..4).map(|i| scenes[i].intersect_counted(&ray, &mut counts[i])).collect();
                assert!(answers.iter().all(|answer| *answer == answers[0]), "{ray:?}: {answers:?}");
            }
            // Each does what it is for.
            for mailed in [1, 2] {
                assert_eq!(counts[mailed].prims + counts[mailed].spared, counts[0].prims);
                assert!(!long || counts[mailed].spared > counts[0].prims / 10, "{counts:?}");
            }
            assert!(long || base == nested || counts[3].nodes * 10 < counts[0].nodes * 9, "{counts:?}");
            assert_eq!((counts[3].prims, counts[3].leaves), (counts[0].prims, counts[0].leaves));
        }
    }
}

#[test]
fn exact_overlap_saves_references() {
    let mesh = soup::sticks(500, 100.0, 4);
    let exact = Grid::build(&mesh, &GridParams::default()).unwrap().statistics();
    let boxes = GridParams { clip: Clip::Box, ..GridParams::default() };
    let boxes = Grid::build(&mesh, &boxes).unwrap().statistics();
    assert_eq!(boxes.references as u64, boxes.box_references);
    assert_eq!(exact.box_references, boxes.box_references);
    assert!(exact.references * 2 < boxes.references, "{exact:?} {boxes:?}");
}

#[test]
fn grids_nest_no_deeper_than_they_may() {
    let mesh = soup::clusters(3000, 6);
    for depth in [0, 1, 2, 4, MAX_DEPTH as u32] {
        for nest in [Nest::Cheaper, Nest::Above(2)] {
            let grid = Grid::build(&mesh, &GridParams { depth, nest, ..GridParams::nested() }).unwrap();
            let found = grid.statistics().depth;
            assert!(found <= depth as usize, "{found} of {depth}");
            assert!(depth == 0 || found > 0, "nothing is nested");
        }
    }
}

/// What hangs together becomes a grid, in the grid of the larger thing around it; a ray that comes through many cells of the one meets
/// each cell of the other as often as it must.
#[test]
fn things_of_like_size_become_grids() {
    // Two rows of small boxes in one large shell of middling ones; and floors.
    let mut boxes = Vec::new();
    let mut cube = |x: f32, y: f32, z: f32, side: f32| {
        boxes.push(Aabb::new(Vec3A::new(x, y, z), Vec3A::new(x, y, z) + Vec3A::splat(side)));
    };
    for i in 0..20 {
        cube(10.0 + i as f32 * 0.1, 10.0, 10.0, 0.1);
        cube(15.0 + i as f32 * 0.1, 10.0, 10.0, 0.1);
    }
    for i in 0..30 {
        for (x, y) in [(0.0, i as f32), (29.0, i as f32), (i as f32, 0.0), (i as f32, 29.0)] {
            cube(x, y, 0.0, 1.0);
            cube(x, y, 19.0, 1.0);
        }
        for z in 0..20 {
            cube(0.0, i as f32, z as f32, 1.0);
        }
    }
    cube(-500.0, -500.0, -1000.0, 1000.0);
    cube(-500.0, -500.0, 30.0, 1000.0);
    let hug = GridParams { nest: Nest::Sizes { classes: 3, grown: 0.05, least: 8 }, ..GridParams::hug() };
    let grid = Grid::build(&Listed(&boxes), &hug).unwrap();
    grid.validate(&Listed(&boxes)).unwrap();
    let found = grid.statistics();
    assert_eq!((found.grids, found.depth), (4, 2), "{found:?}");
    assert!(grid.repeats());
    let one = GridParams { depth: 1, ..hug };
    assert_eq!(Grid::build(&Listed(&boxes), &one).unwrap().statistics().depth, 1);
    // Of things of one size nothing is made.
    assert_eq!(Grid::build(&Listed(&boxes[..20]), &hug).unwrap().statistics().grids, 1);
    for bad in [(0, 0.0, 1), (2, -1.0, 1), (2, f32::NAN, 1), (2, f32::INFINITY, 1), (2, 0.0, 0)] {
        let nest = Nest::Sizes { classes: bad.0, grown: bad.1, least: bad.2 };
        assert!(Grid::build(&Listed(&boxes), &GridParams { nest, ..hug }).is_err());
    }
}

/// Boxes, and nothing but.
struct Listed<'a>(&'a [Aabb]);

impl Bounded for Listed<'_> {
    fn prim_count(&self) -> usize {
        self.0.len()
    }
    fn bound(&self, prim: u32) -> Aabb {
        self.0.get(prim as usize).copied().unwrap_or(Aabb::EMPTY)
    }
}

#[test]
fn memory_is_refused_before_it_is_used() {
    let mesh = soup::uniform(1000, 1);
    let cells = |count| GridParams { resolution: Resolution::Fixed(count), ..GridParams::default() };
    for params in [
        GridParams { memory_limit: Some(1000), ..GridParams::default() },
        GridParams { memory_limit: Some(1 << 20), ..cells([1 << 20, 1, 1]) },
        cells([1 << 20, 1 << 20, 1]),
        cells([1_000_000_000, 1, 1]),
        cells([0, 1, 1]),
        GridParams { resolution: Resolution::Density(f32::NAN), ..GridParams::default() },
        GridParams { inner: Resolution::Measured { rays: 1 }, ..GridParams::default() },
        GridParams { depth: 13, ..GridParams::default() },
    ] {
        assert!(Grid::build(&mesh, &params).is_err(), "{params:?}");
    }
    // References are counted as they come.
    let sticks = soup::sticks(300, 100.0, 1);
    let tight = GridParams { memory_limit: Some(1 << 20), clip: Clip::Box, ..cells([32, 32, 32]) };
    assert!(matches!(Grid::build(&sticks, &tight), Err(BuildError::OutOfMemory { .. })));
    assert!(Grid::build(&sticks, &GridParams { memory_limit: Some(1 << 26), ..tight }).is_ok());
    // A rule that asks for too much gets less.
    for rule in [Resolution::Density(1e30), Resolution::Root(1e30), Resolution::Woo(1e30)] {
        let few = soup::uniform(2, 1);
        let grid = Grid::build(&few, &GridParams { resolution: rule, ..GridParams::default() }).unwrap();
        assert!(grid.statistics().box_references <= 512, "{:?}", grid.statistics());
    }
}

/// Through the middle of a ball, exactly, from up to 2^900 away; and through points beside it from where that is exact.
#[test]
fn rays_from_very_far_hit_what_they_hit() {
    let mesh = soup::icosphere(1);
    let truth = Aggregate::<Exhaustive, _>::build(&mesh, &()).unwrap();
    let fine = GridParams { resolution: Resolution::Fixed([12; 3]), ..GridParams::default() };
    for params in [fine, GridParams::nested(), GridParams::two_level()] {
        let scene = Aggregate::<Grid, _>::build(&mesh, &params).unwrap();
        let (mut random, mut hits) = (Seeded::new(9), 0);
        for i in 0..300 {
            let d = [0; 3].map(|_| random.below(9) as f64 - 4.0);
            let d = DVec3::from_array(d);
            if d == DVec3::ZERO {
                continue;
            }
            let through = [0; 3].map(|_| (random.below(513) as f64 - 256.0) / 256.0);
            let near = DVec3::from_array(through);
            let (through, away) = match i % 3 {
                0 => (near, [10, 20, 30, 40][i / 3 % 4]),
                _ => (DVec3::ZERO, [10, 22, 24, 30, 60, 75, 80, 110, 500, 900][i / 3 % 10]),
            };
            let o = through - d * 2f64.powi(away);
            let ray = Ray::new(o, d);
            let hit = scene.intersect(&ray);
            assert_eq!(hit, truth.intersect(&ray), "{o} {d}");
            assert_eq!(scene.intersect_p(&ray), hit.is_some());
            hits += hit.is_some() as u32;
            // The same in f32, where it is exact.
            if through == DVec3::ZERO && away < 120 {
                let ray = Ray::new(o.as_vec3a(), d.as_vec3a());
                assert_eq!(scene.intersect(&ray), truth.intersect(&ray), "{o} {d}");
            }
        }
        assert!(hits > 140, "{hits} hits");
    }
}

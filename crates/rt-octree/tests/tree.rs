//! What must hold of the tree itself: its statistics, its shape, the order of its walk, its bounds of depth and memory.

use core::ops::ControlFlow;
use rt_accel::{Aggregate, Bounded, BuildError, Clip, Leaf, Primitive, Structure, Visitor};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Vector};
use rt_measure::rays::{self, Seeded};
use rt_octree::{MAX_DEPTH, Octree, OctreeParams, Split, Stop, Storage};
use rt_scenes::soup;
use rt_shapes::TriangleMesh;
use std::collections::HashMap;

fn kinds() -> [OctreeParams; 4] {
    let centre = OctreeParams { split: Split::Centre, ..OctreeParams::default() };
    [OctreeParams::default(), centre, OctreeParams::linear(), OctreeParams::classic(4, 8)]
}

/// Hears what a line passes that nothing stops.
#[derive(Default)]
struct Passed {
    nodes: u64,
    tests: u64,
    leaves: Vec<(u32, Vec<u32>)>,
}

impl<R: Real> Visitor<R> for Passed {
    fn leaf(&mut self, leaf: Leaf<'_>, _ray: &mut Ray<R>) -> ControlFlow<()> {
        self.tests += leaf.prims.len() as u64;
        self.leaves.push((leaf.first, leaf.prims.to_vec()));
        ControlFlow::Continue(())
    }
    fn node(&mut self) {
        self.nodes += 1;
    }
}

fn passed<R: Real>(tree: &Octree, ray: &Ray<R>) -> Passed {
    let mut passed = Passed::default();
    tree.traverse(&mut { *ray }, &mut passed);
    passed
}

/// A uniform line meets a convex cell with the chance of its share of the surface: checks traversal, cells and
/// statistics at once.
#[test]
fn lines_visit_as_many_nodes_as_their_surfaces_say() {
    let mesh = soup::clusters(3000, 5);
    for params in kinds() {
        let tree = Octree::build(&mesh, &params).unwrap();
        let bound = tree.local_bound();
        let (mut sum, mut squares, mut lines) = ([0.0; 3], [0.0; 3], 0.0);
        for ray in rays::uniform::<f32>(3, &bound, 60_000) {
            let passed = passed(&tree, &ray);
            if passed.nodes > 0 {
                lines += 1.0;
                let counts = [passed.nodes, passed.leaves.len() as u64, passed.tests].map(|n| n as f64);
                for i in 0..3 {
                    sum[i] += counts[i];
                    squares[i] += counts[i] * counts[i];
                }
            }
        }
        let expected = tree.statistics().expected;
        for i in 0..3 {
            let mean = sum[i] / lines;
            let error = ((squares[i] / lines - mean * mean) / lines).sqrt();
            assert!(
                (mean - expected[i]).abs() < 4.0 * error,
                "{params:?} {i}: {mean} +- {error}, {}",
                expected[i]
            );
        }
    }
}

/// Points with whole coordinates in a cube of side 1024.
struct Points(Vec<[i64; 3]>);

impl Bounded for Points {
    fn prim_count(&self) -> usize {
        self.0.len()
    }
    fn bound(&self, prim: u32) -> Aabb {
        Aabb::from_points(self.0.get(prim as usize).map(|p| Vec3A::from_array(p.map(|x| x as f32))))
    }
}

/// When a ray of whole numbers is in a closed box, as whole numbers over one denominator.
fn within(o: [i64; 3], d: [i64; 3], b: &Aabb) -> Option<[i128; 2]> {
    let denominator: i128 = d.iter().filter(|d| **d != 0).map(|d| d.unsigned_abs() as i128).product();
    let mut span = [0, i128::MAX];
    for a in 0..3 {
        let [low, high] = [b.min[a], b.max[a]].map(|x| {
            assert_eq!(x.fract(), 0.0);
            x as i64
        });
        if d[a] == 0 {
            if o[a] < low || o[a] > high {
                return None;
            }
            continue;
        }
        let at = |p: i64| (p - o[a]) as i128 * (denominator / d[a] as i128);
        let (p, q) = (at(low), at(high));
        span = [span[0].max(p.min(q)), span[1].min(p.max(q))];
    }
    (span[0] <= span[1]).then_some(span)
}

/// The order of Revelles is that of the leaves' entries, by exact arithmetic; no leaf is missed, and few are visited in
/// vain.
fn in_order<R: Real>(params: &OctreeParams, seed: u64) {
    let mut random = Seeded::new(seed);
    let mut points: Vec<[i64; 3]> = vec![[0; 3], [1024; 3]];
    points.extend((0..600).map(|_| [0; 3].map(|_| random.below(1025) as i64)));
    points.extend((0..100).map(|_| [0; 3].map(|_| random.below(65) as i64)));
    let tree = Octree::build(&Points(points), params).unwrap();
    // Each leaf's cell is the last box that was asked for before it.
    let mut cells = HashMap::new();
    let last = core::cell::Cell::new(Aabb::EMPTY);
    tree.gather(
        &mut |cell| {
            last.set(*cell);
            true
        },
        &mut |leaf| {
            cells.insert(leaf.first, last.get());
        },
    );
    let (mut met, mut ordered, mut vain) = (0, 0, 0);
    for round in 0..2000 {
        let steep = [1, 3, 50][round % 3];
        let d = [0; 3].map(|_| random.below(2 * steep + 1) as i64 - steep as i64);
        if d == [0; 3] {
            continue;
        }
        // Half of the rays through corners of cells; all from some way back, or from inside.
        let unit = if round % 2 == 0 { 64 } else { 1 };
        let at = [0; 3].map(|_| unit * random.below(1024 / unit as usize + 1) as i64);
        let back = [0, 7, 1000][round / 3 % 3];
        let o = [0, 1, 2].map(|a| at[a] - back * d[a]);
        let vector = |v: [i64; 3]| R::Vec3::nearest(DVec3::from_array(v.map(|x| x as f64)));
        let visited: Vec<u32> =
            passed(&tree, &Ray::new(vector(o), vector(d))).leaves.iter().map(|leaf| leaf.0).collect();
        // Within a plane one side comes after the other.
        let in_plane = (0..3)
            .any(|a| d[a] == 0 && cells.values().any(|b| [b.min[a], b.max[a]].contains(&(o[a] as f32))));
        let mut entered = -1i128;
        let (mut seen, mut sorted) = (0, 0);
        for name in &visited {
            match within(o, d, &cells[name]) {
                Some([enter, _]) => {
                    assert!(in_plane || enter >= entered, "{o:?} {d:?}: {:?}", cells[name]);
                    entered = enter;
                    seen += 1;
                    sorted += !in_plane as usize;
                }
                None => vain += 1,
            }
        }
        let truth = cells.values().filter(|cell| within(o, d, cell).is_some()).count();
        assert_eq!(seen, truth, "{o:?} {d:?}");
        met += seen;
        ordered += sorted;
    }
    assert!(ordered > 5000 && vain * 100 < met, "{met} met, {ordered} in order, {vain} in vain");
}

#[test]
fn leaves_come_in_the_order_of_their_entries() {
    for storage in [Storage::Nodes, Storage::Linear] {
        let params = OctreeParams { storage, ..OctreeParams::classic(1, 9) };
        in_order::<f32>(&params, 1);
        in_order::<f64>(&params, 2);
    }
    in_order::<f32>(&OctreeParams::default(), 3);
}

#[test]
fn both_storages_visit_the_same_leaves() {
    for (mesh, stop) in [
        (soup::clusters(2000, 3), Stop::Count),
        (soup::sticks(300, 100.0, 3), Stop::Cost { ahead: 1 }),
        (soup::grid(12), Stop::Cost { ahead: 0 }),
    ] {
        let params = OctreeParams { stop, split: Split::Centre, ..OctreeParams::default() };
        let nodes = Octree::build(&mesh, &params).unwrap();
        let keys = Octree::build(&mesh, &OctreeParams { storage: Storage::Linear, ..params }).unwrap();
        assert_eq!(nodes.statistics(), keys.statistics());
        assert!(
            keys.nodes().is_empty() && keys.bytes() < nodes.bytes(),
            "{} {}",
            keys.bytes(),
            nodes.bytes()
        );
        for ray in rays::uniform::<f32>(4, &nodes.local_bound(), 2000) {
            let (one, other) = (passed(&nodes, &ray), passed(&keys, &ray));
            let prims = |passed: &Passed| passed.leaves.iter().map(|leaf| leaf.1.clone()).collect::<Vec<_>>();
            assert_eq!(prims(&one), prims(&other), "{ray:?}");
            assert_eq!(other.nodes, one.nodes);
        }
    }
}

/// Corners, and the middles of edges, where they are exact: one of the leaves that hold the point names the triangle.
#[test]
fn leaves_name_the_primitives_of_their_points() {
    for mesh in [soup::uniform(400, 8), soup::grid(8), soup::needles(60), soup::sticks(60, 1e4, 8)] {
        for params in kinds() {
            let tree = Octree::build(&mesh, &params).unwrap();
            let origin = tree.origin();
            for (prim, corners) in mesh.triangles().iter().enumerate() {
                let [a, b, c] =
                    corners.map(|i| DVec3::from_array(mesh.vertices()[i as usize].map(f64::from)));
                // Exact in f64 while the corners are within 2^28 of each other in size.
                for p in [a, b, c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5] {
                    let mut named = false;
                    tree.gather(
                        &mut |cell| cell.min.as_dvec3().cmple(p).all() && p.cmple(cell.max.as_dvec3()).all(),
                        &mut |leaf| named |= leaf.prims.contains(&(prim as u32)),
                    );
                    assert!(named, "{prim} at {p} of {params:?}, from {origin}");
                }
            }
        }
    }
}

#[test]
fn the_same_tree_on_any_number_of_threads() {
    let mesh = soup::uniform(20_000, 2);
    for params in kinds() {
        let build = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Octree::build(&mesh, &params).unwrap())
        };
        let one = build(1);
        for threads in 2..=8 {
            assert!(build(threads) == one, "{threads} threads, {params:?}");
        }
        one.validate(&mesh).unwrap();
    }
}

/// Two far cubes: the first splits cut off the void between them.
#[test]
fn empty_space_is_cut_off_first() {
    let corners = |x: f32| (0..8u32).map(move |i| [x + (i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32]);
    let faces = [[0u32, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]];
    let both = faces.iter().flat_map(|f| [*f, f.map(|i| i + 8)]);
    let mesh = TriangleMesh::new(corners(0.0).chain(corners(100.0)).collect(), both.collect()).unwrap();
    let tree = Octree::build(&mesh, &OctreeParams::default()).unwrap();
    let middle = passed(&tree, &Ray::new(Vec3A::new(50.0, 0.5, -1.0), Vec3A::Z));
    assert!(middle.nodes <= 2 && middle.leaves.is_empty(), "{} nodes", middle.nodes);
}

/// What no plane parts stays together; what there is too much of is not copied without end.
fn hostile(n: u32) {
    let triangle = vec![[0.0, 0.0, 0.0], [3.0, 1.0, 2.0], [1.0, 4.0, 5.0]];
    let one_place = TriangleMesh::new(triangle, vec![[0, 1, 2]; n as usize]).unwrap();
    let across = (n as f64).sqrt() as u32 / 2;
    let flat = soup::grid(across);
    let slivers = soup::sticks(n / 10, 1e5, 4);
    let nan = TriangleMesh::new(vec![[f32::NAN; 3]], vec![[0, 0, 0]; 50]);
    for params in kinds() {
        let params = OctreeParams { memory_limit: Some(n as usize * 1600), ..params };
        for mesh in [&one_place, &flat, &slivers] {
            let tree = Octree::build(mesh, &params).unwrap_or_else(|why| panic!("{params:?}: {why}"));
            let s = tree.statistics();
            assert!(
                s.references as f32 <= params.most_references * s.prims as f32 && s.depth <= MAX_DEPTH,
                "{s:?}"
            );
            assert_eq!(s.occupancy.iter().sum::<usize>(), s.leaves + s.empty_leaves);
            tree.validate(mesh).unwrap();
        }
        if let Ok(nan) = &nan {
            let tree = Octree::build(nan, &params).unwrap();
            assert_eq!((tree.skipped().len(), tree.references().len()), (50, 0));
        }
        let few = |n| soup::uniform(n, 1);
        for n in 0..20 {
            let scene = Aggregate::<Octree, _>::build(few(n), &params).unwrap();
            scene.structure().validate(scene.geometry()).unwrap();
            assert_eq!(scene.structure().statistics().prims, n as usize);
            assert!(n > 0 || !scene.intersect_p(&Ray::new(Vec3A::ZERO, Vec3A::X)));
        }
    }
    let boxes = OctreeParams { clip: Clip::Box, ..OctreeParams::default() };
    let tree = Octree::build(&one_place, &boxes).unwrap();
    assert_eq!((tree.nodes().len(), tree.statistics().largest_leaf), (0, n as usize));
}

#[test]
fn hostile_scenes_are_built() {
    hostile(10_000);
}

#[test]
#[ignore = "a minute"]
fn hostile_scenes_are_built_at_length() {
    hostile(1_000_000);
}

#[test]
fn parameters_have_ranges_and_memory_a_limit() {
    let mesh = soup::sticks(1000, 100.0, 1);
    let p = OctreeParams::default();
    let sah = |traverse, intersect| rt_accel::Sah { traverse, intersect };
    for (name, params) in [
        ("max_depth", OctreeParams { max_depth: Some(22), ..p }),
        ("max_prims", OctreeParams { max_prims: 0, ..p }),
        ("most_references", OctreeParams { most_references: 0.5, ..p }),
        ("most_references", OctreeParams { most_references: f32::NAN, ..p }),
        ("sah.traverse", OctreeParams { sah: sah(-1.0, 1.0), ..p }),
        ("sah.intersect", OctreeParams { sah: sah(1.0, 0.0), ..p }),
        ("storage", OctreeParams { storage: Storage::Linear, ..p }),
    ] {
        match Octree::build(&mesh, &params) {
            Err(BuildError::BadParam { name: said, .. }) => assert_eq!(said, name),
            other => panic!("{name}: {other:?}"),
        }
    }
    let leaf = Octree::build(&mesh, &OctreeParams { max_depth: Some(0), ..p }).unwrap();
    assert_eq!((leaf.nodes().len(), leaf.statistics().largest_leaf), (0, 1000));
    let little = OctreeParams { memory_limit: Some(150_000), ..p };
    assert!(matches!(Octree::build(&mesh, &little), Err(BuildError::OutOfMemory { .. })));
    for max_prims in [1, 2, 8, 100] {
        let classic = Octree::build(&mesh, &OctreeParams::classic(max_prims, 5)).unwrap();
        assert!(classic.statistics().depth <= 5);
    }
}

/// Planes where they pay beat planes in the middle; parts instead of boxes, too.
#[test]
fn knobs_do_what_they_are_for() {
    let cost = |mesh: &TriangleMesh, params| Octree::build(mesh, &params).unwrap().sah_cost();
    let clusters = soup::clusters(2000, 3);
    let centre = OctreeParams { split: Split::Centre, ..OctreeParams::default() };
    assert!(cost(&clusters, OctreeParams::default()) < 0.9 * cost(&clusters, centre));
    assert!(cost(&clusters, centre) < 0.9 * cost(&clusters, OctreeParams::classic(8, 4)));
    let sticks = soup::sticks(500, 100.0, 3);
    let boxes = OctreeParams { clip: Clip::Box, ..OctreeParams::default() };
    assert!(cost(&sticks, OctreeParams::default()) < 0.9 * cost(&sticks, boxes));
}

//! What must hold of the tree itself: its statistics, its shape, its bounds of depth and memory.

use core::ops::ControlFlow;
use rt_accel::{BuildError, Leaf, Sah, Structure, Visitor};
use rt_bounds::BeamTest;
use rt_bsp::{Bsp, BspParams, MAX_DEPTH, Order};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Beam, Ray};
use rt_kdtree::{KdTree, KdTreeParams};
use rt_measure::rays;
use rt_scenes::soup;
use rt_shapes::TriangleMesh;
use std::collections::HashMap;

/// Counts what a line passes that nothing stops.
#[derive(Default)]
struct Passed([u64; 3]);

impl Visitor for Passed {
    fn leaf(&mut self, leaf: Leaf<'_>, _ray: &mut Ray) -> ControlFlow<()> {
        self.0[1] += 1;
        self.0[2] += leaf.prims.len() as u64;
        ControlFlow::Continue(())
    }
    fn node(&mut self) {
        self.0[0] += 1;
    }
}

/// Writes down the names of the leaves that a line passes.
#[derive(Default)]
struct Leaves(Vec<u32>);

impl Visitor for Leaves {
    fn leaf(&mut self, leaf: Leaf<'_>, _ray: &mut Ray) -> ControlFlow<()> {
        self.0.extend((!leaf.prims.is_empty()).then_some(leaf.first));
        ControlFlow::Continue(())
    }
}

/// A uniform line meets a convex cell with the chance of its share of the surface: checks traversal, cells and statistics at once.
#[test]
fn lines_visit_as_many_nodes_as_their_surfaces_say() {
    for (name, mesh) in [("clusters", soup::clusters(1000, 5)), ("sticks", soup::sticks(200, 100.0, 2))] {
        for slanted in [0.0, 1.25, f32::INFINITY] {
            let params = BspParams { slanted, ..BspParams::default() };
            let tree = Bsp::build(&mesh, &params).unwrap();
            let bound = tree.local_bound();
            let (mut sum, mut squares, mut lines) = ([0.0; 3], [0.0; 3], 0.0);
            for ray in rays::uniform(3, &bound, 30_000) {
                let mut passed = Passed::default();
                tree.traverse(&mut { ray }, &mut passed);
                if passed.0[0] > 0 {
                    lines += 1.0;
                    for i in 0..3 {
                        let x = passed.0[i] as f64;
                        sum[i] += x;
                        squares[i] += x * x;
                    }
                }
            }
            let statistics = tree.statistics();
            assert_eq!(statistics.slanted_splits == 0, slanted == f32::INFINITY, "{statistics:?}");
            let [axis, slant, leaves, tests] = statistics.expected;
            for (i, expected) in [axis + slant, leaves, tests].into_iter().enumerate() {
                let mean = sum[i] / lines;
                let error = ((squares[i] / lines - mean * mean) / lines).sqrt();
                assert!(
                    (mean - expected).abs() < 4.0 * error,
                    "{name} {slanted} {i}: {mean} +- {error}, {expected}"
                );
            }
        }
    }
}

/// Without slanted planes it is a kd-tree: its lines pass the same nodes, leaves and references as those of one.
#[test]
fn with_planes_across_axes_only_it_is_the_kd_tree() {
    for mesh in [soup::clusters(3000, 5), soup::icosphere(3), soup::sticks(300, 10.0, 4)] {
        let sah = Sah { traverse: 1.0, intersect: 1.5 };
        let max_depth = Some(24);
        let bsp = BspParams { sah, max_depth, empty_bonus: 0.2, ..BspParams::axis_only() };
        let bsp = Bsp::build(&mesh, &bsp).unwrap();
        let kd = KdTree::build(&mesh, &KdTreeParams { sah, max_depth, ..KdTreeParams::default() }).unwrap();
        let (mut mine, mut theirs) = (Passed::default(), Passed::default());
        for ray in rays::uniform::<f32>(3, &bsp.local_bound(), 3000) {
            bsp.traverse(&mut { ray }, &mut mine);
            kd.traverse(&mut { ray }, &mut theirs);
        }
        for (m, t) in mine.0.iter().zip(&theirs.0) {
            // Parts are cut one after another here and afresh there, which differs by a few last places.
            assert!(m.abs_diff(*t) * 200 <= *t, "{:?} {:?}", mine.0, theirs.0);
        }
    }
}

#[test]
fn the_same_tree_on_any_number_of_threads() {
    let mesh = soup::uniform(4000, 2);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bsp::build(&mesh, &BspParams::default()).unwrap())
    };
    let one = build(1);
    for threads in [2, 3, 8] {
        assert!(build(threads) == one, "{threads} threads");
    }
    one.validate(&mesh).unwrap();
}

/// Needles along a diagonal: planes of their own part them, planes across axes cannot.
#[test]
fn diagonal_needles_stand_in_few_leaves() {
    let mesh = soup::needles(400);
    let cost = |params: &BspParams| {
        let tree = Bsp::build(&mesh, params).unwrap();
        tree.validate(&mesh).unwrap();
        let s = tree.statistics();
        (tree.sah_cost(), s.references)
    };
    let (own, axis) = (cost(&BspParams::default()), cost(&BspParams::axis_only()));
    assert!(own.0 < 0.3 * axis.0 && own.1 < axis.1, "{own:?} {axis:?}");
}

/// A triangle lies on one side of its own plane, and with it whatever shares that plane.
#[test]
fn a_turned_room_is_split_by_its_walls() {
    // A cube of many squares, turned: each side is one plane.
    let n = 8u32;
    let turn = rt_geom::glam::DMat3::from_rotation_y(0.7) * rt_geom::glam::DMat3::from_rotation_x(0.4);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for side in 0..6u32 {
        let (a, sign) = (side as usize % 3, if side < 3 { 1.0 } else { -1.0 });
        let first = vertices.len() as u32;
        for i in 0..=n {
            for j in 0..=n {
                let mut p = DVec3::ZERO;
                p[a] = sign;
                p[(a + 1) % 3] = f64::from(i) * 2.0 / f64::from(n) - 1.0;
                p[(a + 2) % 3] = f64::from(j) * 2.0 / f64::from(n) - 1.0;
                vertices.push((turn * p).as_vec3().to_array());
            }
        }
        let corner = |i: u32, j: u32| first + i * (n + 1) + j;
        for i in 0..n {
            for j in 0..n {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let mesh = TriangleMesh::new(vertices, triangles).unwrap();
    let tree = Bsp::build(&mesh, &BspParams::default()).unwrap();
    let s = tree.statistics();
    // Corners are rounded, so neighbours are off a wall's plane by their own rounding: most still count as in it.
    assert!(s.references < 2 * mesh.triangles().len(), "{s:?}");
    // From the middle a line passes the void and meets one leaf or two.
    let mut passed = Passed::default();
    for ray in rays::uniform::<f32>(5, &tree.local_bound(), 1000) {
        tree.traverse(&mut Ray::new(Vec3A::ZERO, ray.dir), &mut passed);
    }
    assert!(passed.0[2] < 4000, "{:?} {s:?}", passed.0);
}

#[test]
fn depth_and_memory_are_bounded() {
    let mesh = soup::sticks(300, 1e4, 1);
    let deepest = BspParams {
        max_depth: Some(MAX_DEPTH as u32),
        sah: Sah { traverse: 0.0, intersect: 1.0 },
        ..BspParams::default()
    };
    let tree = Bsp::build(&mesh, &deepest).unwrap();
    assert!(tree.statistics().depth <= MAX_DEPTH);
    let leaf = Bsp::build(&mesh, &BspParams { max_depth: Some(0), ..BspParams::default() }).unwrap();
    assert_eq!((leaf.nodes().len(), leaf.statistics().largest_leaf), (1, 300));
    let little = BspParams { memory_limit: Some(50_000), ..BspParams::default() };
    assert!(matches!(Bsp::build(&mesh, &little), Err(BuildError::OutOfMemory { .. })));
}

#[test]
fn parameters_outside_their_range_are_refused() {
    let mesh = soup::uniform(10, 1);
    let d = BspParams::default();
    let sah = |traverse, intersect| BspParams { sah: Sah { traverse, intersect }, ..d };
    for (params, expected) in [
        (sah(-1.0, 1.0), "sah.traverse"),
        (sah(f32::NAN, 1.0), "sah.traverse"),
        (sah(1.0, 0.0), "sah.intersect"),
        (sah(1.0, f32::INFINITY), "sah.intersect"),
        (BspParams { slanted: -0.5, ..d }, "slanted"),
        (BspParams { slanted: f32::NAN, ..d }, "slanted"),
        (BspParams { empty_bonus: 1.0, ..d }, "empty_bonus"),
        (BspParams { max_depth: Some(65), ..d }, "max_depth"),
    ] {
        match Bsp::build(&mesh, &params) {
            Err(BuildError::BadParam { name, .. }) => assert_eq!(name, expected),
            other => panic!("{expected}: {other:?}"),
        }
    }
    for params in [
        BspParams { exhaustive: 0, samples: 0, ..d },
        BspParams { exhaustive: u32::MAX, samples: u32::MAX, slanted: 0.0, ..d },
    ] {
        Bsp::build(&mesh, &params).unwrap().validate(&mesh).unwrap();
    }
}

/// Along any ray from the eye, what is named later lies behind.
#[test]
fn leaves_come_in_the_order_in_which_they_are_seen() {
    let meshes = [soup::uniform(400, 3), soup::sticks(100, 30.0, 5), soup::needles(60)];
    for mesh in &meshes {
        let tree = Bsp::build(mesh, &BspParams { slanted: 0.5, ..BspParams::default() }).unwrap();
        assert!(tree.statistics().slanted_splits > 0);
        let mut seeded = rays::Seeded::new(8);
        for eye in 0..30 {
            let far = if eye % 2 == 0 { 0.6 } else { 5.0 };
            let eye = (DVec3::splat(-far)..DVec3::splat(far), ());
            let eye = seeded.inside(eye.0.start, eye.0.end).as_vec3a();
            let listed = |order| {
                let mut leaves = Vec::new();
                let flow = tree.ordered(eye.as_dvec3(), order, &mut |_| true, &mut |leaf| {
                    leaves.push(leaf.first);
                    ControlFlow::Continue(())
                });
                assert!(flow.is_continue());
                leaves
            };
            let (front, mut back) = (listed(Order::FrontToBack), listed(Order::BackToFront));
            let rank: HashMap<u32, usize> = front.iter().copied().zip(0..).collect();
            assert_eq!(rank.len(), front.len());
            for _ in 0..100 {
                let mut passed = Leaves::default();
                tree.traverse(&mut Ray::new(eye, seeded.direction().as_vec3a()), &mut passed);
                let ranks: Vec<usize> = passed.0.iter().map(|leaf| rank[leaf]).collect();
                assert!(ranks.windows(2).all(|pair| pair[0] < pair[1]), "{eye}: {ranks:?}");
            }
            back.reverse();
            assert_eq!(front, back, "{eye}");
        }
    }
}

/// What a beam meets is among the leaves that are given under nodes it meets, near before far; a painter may stop.
#[test]
fn beams_are_given_what_they_meet() {
    let mesh = soup::uniform(500, 6);
    let tree = Bsp::build(&mesh, &BspParams::default()).unwrap();
    let eye = DVec3::new(0.1, 0.2, -3.0);
    let window = [[-0.2, -0.2, 0.0], [0.3, -0.2, 0.0], [0.1, 0.3, 0.0]].map(DVec3::from_array);
    let test = BeamTest::new(&Beam::from_apex(eye, &window).unwrap());
    let (mut found, mut all) = (Vec::new(), 0);
    let _ = tree.ordered(eye, Order::FrontToBack, &mut |b| test.meets(b), &mut |leaf| {
        found.extend(leaf.prims.to_vec());
        ControlFlow::Continue(())
    });
    let _ = tree.ordered(eye, Order::FrontToBack, &mut |_| true, &mut |leaf| {
        all += leaf.prims.len();
        if all > 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!((6..100).contains(&all));
    let geometry = rt_accel::Aggregate::<rt_accel::Exhaustive, _>::build(&mesh, &()).unwrap();
    let mut met = 0;
    for i in 0..400 {
        let (u, v) = (f64::from(i % 20) / 20.0, f64::from(i / 20) / 20.0);
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let at = window[0] * (1.0 - u - v) + window[1] * u + window[2] * v;
        let ray = Ray::new(eye, at - eye);
        if let Some(hit) = rt_accel::Primitive::<f64>::intersect(&geometry, &ray) {
            met += 1;
            assert!(found.contains(&hit.at.prim));
        }
    }
    assert!(met > 20 && found.len() < tree.references().len() / 2, "{met} {}", found.len());
    // An eye that is nowhere.
    let _ = tree.ordered(DVec3::NAN, Order::BackToFront, &mut |_| true, &mut |_| panic!("seen from nowhere"));
}

#[test]
fn input_that_hurts_is_built_in_bounded_memory() {
    let limit = |n: usize| BspParams { memory_limit: Some(n * 2000 + 100_000), ..BspParams::default() };
    let one = TriangleMesh::new(
        vec![[0.0f32, 0.0, 1.0], [1.0, 0.3, 1.0], [0.1, 1.0, 1.5]],
        vec![[0, 1, 2]; 20_000],
    );
    let flat = soup::grid(60);
    let turned: Vec<[f32; 3]> =
        flat.vertices().iter().map(|&[x, y, _]| [x + y, x - 2.0 * y, 0.5 * x + 0.25 * y]).collect();
    let turned = TriangleMesh::new(turned, flat.triangles().to_vec()).unwrap();
    for mesh in [one.unwrap(), flat, turned, soup::sticks(500, 1e5, 3)] {
        let n = mesh.triangles().len();
        let tree = Bsp::build(&mesh, &limit(n)).unwrap();
        tree.validate(&mesh).unwrap();
    }
}

/// A million triangles, within three gigabytes.
#[test]
#[ignore = "minutes"]
fn a_million() {
    let params = BspParams { memory_limit: Some(3 << 30), ..BspParams::default() };
    for mesh in [soup::uniform(1_000_000, 1), soup::grid(708)] {
        let tree = Bsp::build(&mesh, &params).unwrap();
        let per = tree.bytes() / mesh.triangles().len();
        assert!(per < 200);
    }
}

/// Slivers through all of space stand in hundreds of cells each: the tree stays within its limit or is refused.
#[test]
#[ignore = "a minute"]
fn many_slivers() {
    let limit = 100 << 20;
    let params = BspParams { memory_limit: Some(limit), ..BspParams::default() };
    match Bsp::build(&soup::sticks(100_000, 1000.0, 1), &params) {
        Ok(tree) => assert!(tree.bytes() < limit),
        Err(error) => assert!(matches!(error, BuildError::OutOfMemory { .. }), "{error}"),
    }
}

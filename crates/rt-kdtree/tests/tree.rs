//! What must hold of the tree itself: its statistics, its shape, its bounds of depth and memory.

use core::ops::ControlFlow;
use rt_accel::{BuildError, Clip, Leaf, Structure, Visitor};
use rt_geom::Ray;
use rt_geom::glam::Vec3A;
use rt_kdtree::{KdTree, KdTreeParams, MAX_DEPTH};
use rt_measure::rays;
use rt_scenes::soup;
use rt_shapes::TriangleMesh;

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

/// A uniform line meets a convex cell with the chance of its share of the surface: checks traversal, cells and statistics at once.
#[test]
fn lines_visit_as_many_nodes_as_their_surfaces_say() {
    let mesh = soup::clusters(3000, 5);
    for clip in [Clip::Exact, Clip::Box] {
        let tree = KdTree::build(&mesh, &KdTreeParams { clip, ..KdTreeParams::default() }).unwrap();
        let bound = tree.local_bound();
        let (mut sum, mut squares, mut lines) = ([0.0; 3], [0.0; 3], 0.0);
        for ray in rays::uniform(3, &bound, 200_000) {
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
        let expected = tree.statistics().expected;
        for i in 0..3 {
            let mean = sum[i] / lines;
            let error = ((squares[i] / lines - mean * mean) / lines).sqrt();
            assert!(
                (mean - expected[i]).abs() < 4.0 * error,
                "{clip:?} {i}: {mean} +- {error}, {}",
                expected[i]
            );
        }
    }
}

#[test]
fn the_same_tree_on_any_number_of_threads() {
    let mesh = soup::uniform(30_000, 2);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| KdTree::build(&mesh, &KdTreeParams::default()).unwrap())
    };
    let one = build(1);
    for threads in [2, 3, 8] {
        assert!(build(threads) == one, "{threads} threads");
    }
    one.validate(&mesh).unwrap();
}

/// A tree has one leaf more than splits; those without primitives are not stored.
#[test]
fn empty_leaves_are_not_stored() {
    let mesh = soup::clusters(3000, 5);
    for empty_bonus in [0.0, 0.9] {
        let params = KdTreeParams { empty_bonus, ..KdTreeParams::default() };
        let tree = KdTree::build(&mesh, &params).unwrap();
        let s = tree.statistics();
        assert_eq!(s.leaves + s.empty_leaves, s.splits + 1);
        assert_eq!(tree.nodes().len(), s.splits + s.leaves);
        assert!(s.empty_leaves > 1000, "{s:?}");
    }
}

/// Two far cubes: the first splits cut off the void between them.
#[test]
fn empty_space_is_cut_off_first() {
    let corners = |x: f32| (0..8u32).map(move |i| [x + (i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32]);
    let faces = [[0u32, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]];
    let both = faces.iter().flat_map(|f| [f.map(|i| i), f.map(|i| i + 8)]);
    let mesh = TriangleMesh::new(corners(0.0).chain(corners(100.0)).collect(), both.collect()).unwrap();
    let tree = KdTree::build(&mesh, &KdTreeParams::default()).unwrap();
    let mut middle = Passed::default();
    tree.traverse(&mut Ray::new(Vec3A::new(50.0, 0.5, -1.0), Vec3A::Z), &mut middle);
    assert!(middle.0[0] <= 2 && middle.0[1] == 0, "{:?}", middle.0);
}

#[test]
fn depth_and_memory_are_bounded() {
    let mesh = soup::sticks(2000, 1e4, 1);
    let deepest = KdTreeParams { max_depth: Some(MAX_DEPTH as u32), ..KdTreeParams::default() };
    let tree = KdTree::build(&mesh, &deepest).unwrap();
    assert!(tree.statistics().depth <= MAX_DEPTH);
    let leaf = KdTree::build(&mesh, &KdTreeParams { max_depth: Some(0), ..KdTreeParams::default() }).unwrap();
    assert_eq!((leaf.nodes().len(), leaf.statistics().largest_leaf), (1, 2000));
    let little = KdTreeParams { memory_limit: Some(100_000), ..KdTreeParams::default() };
    assert!(matches!(KdTree::build(&mesh, &little), Err(BuildError::OutOfMemory { .. })));
    let too_deep = KdTreeParams { max_depth: Some(61), ..KdTreeParams::default() };
    assert!(matches!(KdTree::build(&mesh, &too_deep), Err(BuildError::BadParam { name: "max_depth", .. })));
}

/// Parts instead of boxes save references, never add any.
#[test]
fn perfect_splits_save_references() {
    let mesh = soup::sticks(500, 100.0, 3);
    let references = |clip| {
        let params = KdTreeParams { clip, ..KdTreeParams::default() };
        KdTree::build(&mesh, &params).unwrap().sah_cost()
    };
    assert!(references(Clip::Exact) < 0.9 * references(Clip::Box));
}

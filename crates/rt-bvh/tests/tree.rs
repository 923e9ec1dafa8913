//! What must hold of the tree itself, whatever it is asked.

use rt_accel::{Aggregate, Bounded, BuildError, Exhaustive, Primitive, Refit, Structure};
use rt_bounds::Aabb;
use rt_bvh::{Builder, Bvh, BvhParams, MAX_DEPTH};
use rt_geom::Ray;
use rt_geom::glam::{DVec3, Vec3A};
use rt_shapes::TriangleMesh;
use std::ops::ControlFlow;

/// Boxes alone: all a builder sees.
struct Bounds(Vec<Aabb>);

impl Bounded for Bounds {
    fn prim_count(&self) -> usize {
        self.0.len()
    }
    fn bound(&self, prim: u32) -> Aabb {
        self.0[prim as usize]
    }
}

/// Numbers that look random and are the same everywhere (splitmix64), in -1..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }
    fn point(&mut self) -> Vec3A {
        Vec3A::new(self.next(), self.next(), self.next())
    }
}

fn soup(triangles: usize, size: f32) -> TriangleMesh {
    let mut noise = Noise(7);
    let mut vertices = Vec::new();
    for _ in 0..triangles {
        let center = noise.point();
        vertices.extend([0; 3].map(|_| (center + noise.point() * size).to_array()));
    }
    let corners = (0..triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh::new(vertices, corners).unwrap()
}

fn params() -> [BvhParams; 4] {
    let base = BvhParams::default();
    [
        base,
        BvhParams { builder: Builder::Binned { bins: 2 }, leaf_prims: 1, sweep_below: 0, ..base },
        BvhParams { leaf_prims: 255, sweep_below: 256, ..base },
        BvhParams { builder: Builder::Binned { bins: 64 }, leaf_prims: 2, sweep_below: 3, ..base },
    ]
}

#[test]
fn every_small_number_of_primitives_builds() {
    for n in 0..=70 {
        let mesh = soup(n, 0.2);
        for params in params() {
            let bvh = Bvh::build(&mesh, &params).unwrap();
            bvh.validate(&mesh).unwrap_or_else(|why| panic!("{n} primitives, {params:?}: {why}"));
            assert_eq!(bvh.references().len(), n);
        }
    }
}

#[test]
fn hard_shapes_of_input_stay_shallow() {
    let point = |p: Vec3A| Aabb::new(p, p);
    let infinite_plane = Aabb::new(
        Vec3A::new(f32::NEG_INFINITY, 0.0, f32::NEG_INFINITY),
        Vec3A::new(f32::INFINITY, 0.0, f32::INFINITY),
    );
    let mut noise = Noise(1);
    let cases: Vec<(&str, Vec<Aabb>)> = vec![
        ("coincident", vec![Aabb::new(Vec3A::ZERO, Vec3A::ONE); 10_000]),
        (
            "concentric",
            (1..5000).map(|i| Aabb::new(Vec3A::splat(-i as f32), Vec3A::splat(i as f32))).collect(),
        ),
        ("collinear", (0..5000).map(|i| point(Vec3A::X * i as f32)).collect()),
        ("progression", (-120..120).map(|i| point(Vec3A::X * (2f32).powi(i))).collect()),
        (
            "nested",
            (-60..60)
                .map(|i| Aabb::new(Vec3A::splat(-(2f32).powi(i)), Vec3A::splat((2f32).powi(i))))
                .collect(),
        ),
        ("planar", (0..5000).map(|_| point(noise.point() * Vec3A::new(1.0, 1.0, 0.0))).collect()),
        ("huge", (0..500).map(|_| point(noise.point() * 3e38)).collect()),
        ("tiny", (0..500).map(|_| point(noise.point() * 1e-44)).collect()),
        ("infinite", vec![Aabb::INFINITE; 10]),
        ("with a ground plane", (0..50).map(|_| point(noise.point())).chain([infinite_plane]).collect()),
    ];
    for (name, boxes) in cases {
        let n = boxes.len();
        let source = Bounds(boxes);
        for params in params() {
            let bvh = Bvh::build(&source, &params).unwrap();
            bvh.validate(&source).unwrap_or_else(|why| panic!("{name}, {params:?}: {why}"));
            assert!(bvh.depth() <= MAX_DEPTH);
            assert!(bvh.references().len() == n && bvh.skipped().is_empty(), "{name}");
            if matches!(name, "coincident" | "collinear") {
                assert!(bvh.depth() <= 2 * (n as f32).log2().ceil() as usize + 2, "{name}: {}", bvh.depth());
            }
        }
    }
}

#[test]
fn invalid_bounds_are_left_out_and_harm_no_other() {
    let mut boxes: Vec<Aabb> =
        (0..50).map(|i| Aabb::new(Vec3A::splat(i as f32), Vec3A::splat(i as f32 + 0.5))).collect();
    boxes[7].min.y = f32::NAN;
    boxes[9] = Aabb::EMPTY;
    boxes[30] = Aabb::new(Vec3A::ONE, Vec3A::ZERO);
    let source = Bounds(boxes);
    let bvh = Bvh::build(&source, &BvhParams::default()).unwrap();
    assert_eq!(bvh.skipped(), [7, 9, 30]);
    bvh.validate(&source).unwrap();
    let none = Bounds(vec![Aabb::EMPTY; 3]);
    let bvh = Bvh::build(&none, &BvhParams::default()).unwrap();
    assert!(bvh.nodes().is_empty() && bvh.skipped().len() == 3);
    bvh.validate(&none).unwrap();
}

#[test]
fn the_tree_is_the_same_on_any_number_of_threads() {
    let mesh = soup(100_000, 0.01);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh::build(&mesh, &BvhParams::default()).unwrap())
    };
    let one = build(1);
    one.validate(&mesh).unwrap();
    for threads in [2, 3, 8] {
        let other = build(threads);
        assert_eq!(bytemuck::cast_slice::<_, u8>(one.nodes()), bytemuck::cast_slice::<_, u8>(other.nodes()));
        assert_eq!(one, other);
    }
}

#[test]
fn a_small_stack_is_enough() {
    let source = Bounds(
        (0..100_000)
            .map(|i| Aabb::new(Vec3A::splat((2f32).powi(i % 120)), Vec3A::splat((2f32).powi(i % 120))))
            .collect(),
    );
    std::thread::Builder::new()
        .stack_size(64 << 10)
        .spawn(move || {
            let bvh = Bvh::build(&source, &BvhParams::default()).unwrap();
            bvh.validate(&source).unwrap();
            let mut leaves = 0;
            bvh.gather(&mut |_| true, &mut |_| leaves += 1);
            assert!(leaves > 100);
        })
        .unwrap()
        .join()
        .unwrap();
}

#[test]
fn a_build_can_be_watched_cancelled_and_limited() {
    let mesh = soup(50_000, 0.01);
    let mut heard = Vec::new();
    Bvh::build_watched(&mesh, &BvhParams::default(), &mut |progress| {
        heard.push(progress);
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(heard.windows(2).all(|w| w[0] <= w[1]), "{heard:?}");
    assert!(heard.first() == Some(&0.0) && heard.last() == Some(&1.0) && heard.len() > 4);
    for stop in 0..heard.len() {
        let mut calls = 0;
        let cancelled = Bvh::build_watched(&mesh, &BvhParams::default(), &mut |_| {
            calls += 1;
            if calls > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(cancelled.unwrap_err(), BuildError::Cancelled);
    }
    let tight = BvhParams { memory_limit: Some(1 << 20), ..BvhParams::default() };
    assert!(matches!(Bvh::build(&mesh, &tight), Err(BuildError::OutOfMemory { .. })));
    for bad in [
        BvhParams { leaf_prims: 0, ..BvhParams::default() },
        BvhParams { leaf_prims: 256, ..BvhParams::default() },
        BvhParams { builder: Builder::Binned { bins: 1 }, ..BvhParams::default() },
        BvhParams { sah: rt_accel::Sah { traverse: f32::NAN, intersect: 1.0 }, ..BvhParams::default() },
    ] {
        assert!(matches!(Bvh::build(&mesh, &bad), Err(BuildError::BadParam { .. })));
    }
}

#[test]
fn a_refitted_tree_answers_as_a_fresh_one() {
    let mut scene = Aggregate::<Bvh, _>::build(soup(2000, 0.1), &BvhParams::default()).unwrap();
    let built = scene.structure().sah_cost();
    assert_eq!(built, scene.structure().built_sah_cost());
    scene.update(|mesh| {
        for [x, y, z] in mesh.vertices_mut() {
            (*x, *y, *z) = (*x + 0.3 * *y, *y * 1.5, *z + 7.0);
        }
    });
    scene.structure().validate(scene.geometry()).unwrap();
    assert!(scene.structure().sah_cost() > 0.0);
    let fresh = Aggregate::<Exhaustive, _>::build(scene.geometry().clone(), &()).unwrap();
    let mut noise = Noise(3);
    let mut hits = 0;
    for _ in 0..2000 {
        let origin = noise.point() * 3.0 + Vec3A::Z * 7.0;
        let ray = Ray::new(origin, noise.point() + Vec3A::Z * 7.0 - origin);
        assert_eq!(scene.intersect(&ray), fresh.intersect(&ray));
        hits += scene.intersect_p(&ray) as usize;
    }
    assert!(hits > 500);
    let mut empty = Bvh::build(&Bounds(vec![]), &BvhParams::default()).unwrap();
    empty.refit(&Bounds(vec![]));
    assert_eq!(empty.local_bound(), Aabb::EMPTY);
}

#[test]
fn a_vertical_ray_over_a_grid_opens_few_nodes() {
    let n = 64u32;
    let vertices = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32, y as f32, 0.0])).collect();
    let at = |x, y| y * (n + 1) + x;
    let triangles = (0..n)
        .flat_map(|y| {
            (0..n).flat_map(move |x| {
                [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]]
            })
        })
        .collect();
    let scene = Aggregate::<Bvh, _>::build(
        TriangleMesh::<f32>::new(vertices, triangles).unwrap(),
        &BvhParams::default(),
    )
    .unwrap();
    for x in 0..=n {
        for zero in [0.0, -0.0] {
            let mut counts = Default::default();
            let ray = Ray::new(Vec3A::new(x as f32, 31.0, -5.0), Vec3A::new(zero, -zero, 1.0));
            assert_eq!(scene.intersect_counted(&ray, &mut counts).map(|hit| hit.t), Some(5.0));
            assert!(counts.nodes < 80 && counts.prims < 100, "{counts:?}");
        }
    }
}

#[test]
fn far_from_zero_boxes_stay_tight() {
    let far = DVec3::new(1e7, -2e7, 3e7);
    let mut noise = Noise(5);
    let mut vertices = Vec::new();
    for _ in 0..3000 {
        let center = noise.point().as_dvec3();
        vertices.extend([0; 3].map(|_| (far + center + noise.point().as_dvec3() * 0.01).to_array()));
    }
    let mesh = TriangleMesh::<f64>::new(vertices, (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
        .unwrap();
    let scene = Aggregate::<Bvh, _>::build(mesh.clone(), &BvhParams::default()).unwrap();
    let oracle = Aggregate::<Exhaustive, _>::build(mesh, &()).unwrap();
    scene.structure().validate(scene.geometry()).unwrap();
    let (mut hits, mut prims) = (0, 0);
    for _ in 0..3000 {
        let origin = far + noise.point().as_dvec3() * 2.0;
        let ray = Ray::new(origin, far + noise.point().as_dvec3() - origin);
        let mut counts = Default::default();
        let hit = scene.intersect_counted(&ray, &mut counts);
        assert_eq!(hit, oracle.intersect(&ray));
        hits += hit.is_some() as u64;
        prims += counts.prims;
    }
    assert!(hits > 50 && prims < 3000 * 60, "{hits} {prims}");
}

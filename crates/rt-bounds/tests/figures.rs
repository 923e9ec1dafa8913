//! Figures that volumes between planes must reproduce: areas of known bodies, hulls of known solids, shares of lines.

use rt_bounds::{Aabb, BoundingVolume, Hull, Kdop, Polytope, SlabRay};
use rt_geom::Ray;
use rt_geom::glam::{DMat3, DVec3, Vec3A};
use rt_measure::rays::{self, Seeded};

fn cube(half: DVec3) -> Vec<DVec3> {
    let sign = |i: u32, a: u32| if i >> a & 1 == 1 { 1.0 } else { -1.0 };
    (0..8).map(|i| half * DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
}

fn on_a_sphere(seed: u64, count: usize) -> Vec<DVec3> {
    let mut seeded = Seeded::new(seed);
    (0..count).map(|_| seeded.direction()).collect()
}

fn in_a_ball(seed: u64, count: usize) -> Vec<DVec3> {
    let mut seeded = Seeded::new(seed);
    let mut inside = || loop {
        let p = seeded.inside(DVec3::splat(-1.0), DVec3::ONE);
        if p.length_squared() < 1.0 {
            return p;
        }
    };
    (0..count).map(|_| inside()).collect()
}

/// An icosahedron, each facet split in four `levels` times and pushed out to the sphere.
fn icosphere(levels: usize) -> Vec<DVec3> {
    let phi = 0.5 + 1.25f64.sqrt();
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)] {
        points.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    for _ in 0..levels {
        let hull = Hull::new(&points).unwrap();
        for facet in hull.facets() {
            for (i, &u) in facet.iter().enumerate() {
                let v = facet[(i + 1) % facet.len()];
                if u < v {
                    points.push(hull.corners()[u as usize] + hull.corners()[v as usize]);
                }
            }
        }
        points.iter_mut().for_each(|p| *p = p.normalize());
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    points
}

fn rotation(seeded: &mut Seeded) -> DMat3 {
    // Two directions are enough: uniform ones, made perpendicular.
    let x = seeded.direction();
    let y = x.cross(seeded.direction()).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

fn close(x: f64, y: f64, relative: f64) {
    assert!((x - y).abs() <= y.abs() * relative, "{x} is not {y}");
}

#[test]
fn dops_around_a_sphere() {
    fn area<const K: usize>() -> f64 {
        let dop = Kdop::<K>::from_support(|n| n.length() * (1.0 + 4.0 * f64::EPSILON));
        // And the same a thousand times as large, far away.
        let far = DVec3::new(1e7, -2e7, 3e7);
        let away = Kdop::<K>::from_support(|n| n.length() * 1000.0 + n.dot(far));
        close(away.surface_area(), dop.surface_area() * 1e6, 1e-2);
        dop.surface_area()
    }
    close(area::<6>(), 24.0, 1e-6);
    close(area::<14>(), 16.0770, 1e-5);
    close(area::<18>(), 15.2649, 1e-5);
    close(area::<26>(), 14.3319, 1e-5);
}

#[test]
fn dops_around_turned_boxes() {
    let mut seeded = Seeded::new(5);
    let rods = cube(DVec3::new(0.5, 0.02, 0.02));
    let cubes = cube(DVec3::splat(0.5));
    let mut sums = [[0.0; 4]; 2];
    let turns = 4000;
    for _ in 0..turns {
        let turn = rotation(&mut seeded);
        for (sum, points) in sums.iter_mut().zip([&cubes, &rods]) {
            let turned: Vec<DVec3> = points.iter().map(|p| turn * *p).collect();
            let all = turned.iter().copied();
            sum[0] += Kdop::<6>::from_points(all.clone(), DVec3::ZERO).surface_area();
            sum[1] += Kdop::<14>::from_points(all.clone(), DVec3::ZERO).surface_area();
            sum[2] += Kdop::<18>::from_points(all.clone(), DVec3::ZERO).surface_area();
            sum[3] += Kdop::<26>::from_points(all, DVec3::ZERO).surface_area();
        }
    }
    let own = [6.0, 2.0 * (0.04 * 0.04 + 2.0 * 0.04)];
    let expected = [[2.260, 1.474, 1.389, 1.280], [9.45, 4.48, 3.81, 3.05]];
    for shape in 0..2 {
        for k in 0..4 {
            close(sums[shape][k] / turns as f64 / own[shape], expected[shape][k], 0.01);
        }
    }
}

#[test]
fn dops_of_flat_things() {
    // A unit square in the plane x + y = 0, and one in z = 3: both sides count.
    let side = 0.5f64.sqrt() * 0.5;
    let tilted =
        [(1.0, -0.5), (1.0, 0.5), (-1.0, 0.5), (-1.0, -0.5)].map(|(s, z)| DVec3::new(s * side, -s * side, z));
    close(Kdop::<26>::around(&tilted, DVec3::ZERO).unwrap().surface_area(), 2.0, 1e-6);
    close(Polytope::around(&tilted, DVec3::ZERO).unwrap().surface_area(), 2.0, 1e-6);
    let level = [DVec3::Z * 3.0, DVec3::new(1.0, 0.0, 3.0), DVec3::new(0.0, 1.0, 3.0)];
    assert_eq!(Kdop::<14>::around(&level, DVec3::ZERO).unwrap().surface_area(), 1.0);
    assert_eq!(Kdop::<6>::around(&level, DVec3::ZERO).unwrap().surface_area(), 2.0);
    let place = [DVec3::new(0.5, 2.0, 3.0)];
    assert_eq!(Kdop::<26>::around(&place, DVec3::ZERO).unwrap().surface_area(), 0.0);
    assert_eq!(Polytope::around(&place, DVec3::ZERO).unwrap().surface_area(), 0.0);
    // A crooked segment is fenced in closely.
    let segment = [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)];
    let hull = Hull::new(&segment).unwrap();
    assert_eq!((hull.corners().len(), hull.edge_count(), hull.facets().len()), (2, 1, 0));
    assert!(hull.polytope(DVec3::ZERO).surface_area() < 1e-5);
}

#[test]
fn hulls_of_solids() {
    let count = |hull: &Hull| (hull.corners().len(), hull.edge_count(), hull.facets().len());
    let tetrahedron = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let hull = Hull::new(&tetrahedron).unwrap();
    assert_eq!(count(&hull), (4, 6, 4));
    close(hull.surface_area(), 1.5 + 0.75f64.sqrt(), 1e-15);
    let octahedron = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    assert_eq!(count(&Hull::new(&octahedron).unwrap()), (6, 12, 8));
    // 2562 points, all of them corners; facets are triangles but for accidents of rounding.
    let sphere = icosphere(4);
    let hull = Hull::new(&sphere).unwrap();
    assert_eq!((sphere.len(), hull.corners().len(), hull.triangle_count()), (2562, 2562, 5120));
    let random = Hull::new(&on_a_sphere(1, 1000)).unwrap();
    assert_eq!(count(&random), (1000, 2994, 1996));
    // A flat grid: four corners, two sides.
    let grid: Vec<Vec3A> = (0..10_000).map(|i| Vec3A::new((i % 100) as f32, (i / 100) as f32, 7.0)).collect();
    assert_eq!(count(&Hull::new(&grid).unwrap()), (4, 4, 2));
    // The same points on all faces of a cube, and inside.
    let block: Vec<Vec3A> =
        (0..8000).map(|i| Vec3A::new((i % 20) as f32, (i / 20 % 20) as f32, (i / 400) as f32)).collect();
    assert_eq!(count(&Hull::new(&block).unwrap()), (8, 12, 6));
}

#[test]
fn a_cube_full_of_points() {
    let mut seeded = Seeded::new(2);
    let mut points: Vec<DVec3> =
        (0..10_000).map(|_| seeded.inside(DVec3::splat(-0.5), DVec3::splat(0.5))).collect();
    points.extend(cube(DVec3::splat(0.5)));
    let hull = Hull::new(&points).unwrap();
    assert_eq!((hull.facets().len(), hull.triangle_count(), hull.surface_area()), (6, 12, 6.0));
    let polytope = hull.polytope(DVec3::ZERO);
    assert_eq!((polytope.plane_count(), polytope.surface_area()), (6, 6.0));
}

/// The volume's share of uniform lines is its share of the sphere's surface.
fn share<B: BoundingVolume>(b: &B, lines: &[Ray<f32>], sphere: f64, what: &str) {
    let world = b.aabb();
    let hits = lines.iter().filter(|ray| b.entry(&B::ready(ray, DVec3::ZERO, &world)).is_some()).count();
    let (n, p) = (lines.len() as f64, b.surface_area() / sphere);
    let sigma = (p * (1.0 - p) / n).sqrt();
    assert!((hits as f64 / n - p).abs() < 3.0 * sigma, "{what}: {} of {n}, not {p}", hits);
}

#[test]
fn lines_meet_volumes_by_their_area() {
    let mut seeded = Seeded::new(9);
    let turn = rotation(&mut seeded);
    let points: Vec<DVec3> = cube(DVec3::new(0.6, 0.3, 0.1)).iter().map(|p| turn * *p).collect();
    let world = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
    let lines: Vec<Ray<f32>> = rays::uniform(4, &world, 300_000);
    let sphere = 4.0 * core::f64::consts::PI * 3.0;
    share(&Kdop::<6>::around(&points, DVec3::ZERO).unwrap(), &lines, sphere, "6-DOP");
    share(&Kdop::<14>::around(&points, DVec3::ZERO).unwrap(), &lines, sphere, "14-DOP");
    share(&Kdop::<18>::around(&points, DVec3::ZERO).unwrap(), &lines, sphere, "18-DOP");
    share(&Kdop::<26>::around(&points, DVec3::ZERO).unwrap(), &lines, sphere, "26-DOP");
    let polytope = Polytope::around(&points, DVec3::ZERO).unwrap();
    close(polytope.surface_area(), 8.0 * (0.18 + 0.03 + 0.06), 1e-6);
    share(&polytope, &lines, sphere, "polytope");
    let ball = Polytope::around(&in_a_ball(3, 3000), DVec3::ZERO).unwrap();
    share(&ball, &lines, sphere, "polytope around a ball");
}

#[test]
fn more_planes_leave_less() {
    for (what, points) in [("sphere", on_a_sphere(7, 400)), ("ball", in_a_ball(8, 2000))] {
        let hull = Hull::new(&points).unwrap();
        let mut last = f64::INFINITY;
        for k in [4, 6, 8, 12, 16, 24, 32, 48, 64] {
            let polytope = hull.reduced(k, DVec3::ZERO);
            let area = polytope.surface_area();
            assert_eq!(polytope.plane_count(), k.max(6), "{what}");
            assert!(area <= last && area > hull.surface_area(), "{what} {k}: {area}");
            last = area;
        }
        assert!(last < 1.1 * hull.surface_area(), "{what}: {last}");
        close(hull.polytope(DVec3::ZERO).surface_area(), hull.surface_area(), 1e-5);
    }
}

/// Prints areas left by K planes, and what things take.
#[test]
#[ignore]
#[allow(clippy::print_stdout)]
fn curves_and_times() {
    let time = |what: &str, run: &mut dyn FnMut() -> String| {
        let start = std::time::Instant::now();
        let said = run();
        println!("{what}: {:.2} ms {said}", start.elapsed().as_secs_f64() * 1e3);
    };
    let mut seeded = Seeded::new(11);
    let turn = rotation(&mut seeded);
    let turned = |points: Vec<DVec3>| points.iter().map(|p| turn * *p).collect::<Vec<_>>();
    let shapes = [
        ("sphere 1000", on_a_sphere(1, 1000)),
        ("ball 1e5", in_a_ball(2, 100_000)),
        ("icosphere 2562", icosphere(4)),
        ("cube", turned(cube(DVec3::ONE))),
        ("rod", turned(cube(DVec3::new(1.0, 0.04, 0.04)))),
        (
            "ellipsoid 1:0.3:0.1",
            turned(on_a_sphere(3, 1000).iter().map(|p| *p * DVec3::new(1.0, 0.3, 0.1)).collect()),
        ),
        ("half ball", turned(in_a_ball(4, 20_000).into_iter().filter(|p| p.z > 0.0).collect())),
    ];
    for (what, points) in &shapes {
        let mut hull = Hull::new(&points[..1]).unwrap();
        time(&format!("{what}: hull"), &mut || {
            hull = Hull::new(points).unwrap();
            format!("{} corners {} facets", hull.corners().len(), hull.facets().len())
        });
        time(&format!("{what}: reduced to 64"), &mut || {
            hull.reduced(64, DVec3::ZERO).plane_count().to_string()
        });
        time(&format!("{what}: around"), &mut || {
            let p = Polytope::around(points, DVec3::ZERO).unwrap();
            format!("{} planes, S {:.4}", p.plane_count(), p.surface_area() / hull.surface_area())
        });
        let dop = |s: f64| s / hull.surface_area();
        println!(
            "  S over hull: 14-DOP {:.4} 18-DOP {:.4} 26-DOP {:.4}",
            dop(Kdop::<14>::from_points(points.iter().copied(), DVec3::ZERO).surface_area()),
            dop(Kdop::<18>::from_points(points.iter().copied(), DVec3::ZERO).surface_area()),
            dop(Kdop::<26>::from_points(points.iter().copied(), DVec3::ZERO).surface_area())
        );
        let mut line = String::from("  K:S");
        for k in [4, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 24, 26, 28, 32, 40, 48, 56, 64] {
            let p = hull.reduced(k, DVec3::ZERO);
            line += &format!(" {k}:{:.4}", p.surface_area() / hull.surface_area());
        }
        println!("{line}");
    }
    time("hull of 1e4 on a sphere", &mut || {
        Hull::new(&on_a_sphere(5, 10_000)).unwrap().facets().len().to_string()
    });
    time("around 1e5 on a sphere", &mut || {
        Polytope::around(&on_a_sphere(5, 100_000), DVec3::ZERO).unwrap().plane_count().to_string()
    });
    test_times();
}

#[allow(clippy::print_stdout)]
fn test_times() {
    fn volumes<B: BoundingVolume>(
        what: &str,
        points: &[Vec<DVec3>],
        lines: &[Ray<f32>],
        world: &Aabb,
        of_box: f64,
    ) {
        let start = std::time::Instant::now();
        let all: Vec<B> = points.iter().map(|p| B::around(p, DVec3::ZERO).unwrap()).collect();
        let build = start.elapsed().as_secs_f64() * 1e6 / all.len() as f64;
        let start = std::time::Instant::now();
        let area: f64 = all.iter().map(|b| b.surface_area()).sum();
        let area_time = start.elapsed().as_secs_f64() * 1e6 / all.len() as f64;
        let start = std::time::Instant::now();
        let ready: Vec<B::Ready> = lines.iter().map(|ray| B::ready(ray, DVec3::ZERO, world)).collect();
        let set_up = start.elapsed().as_secs_f64() * 1e9 / ready.len() as f64;
        let mut best = f64::INFINITY;
        let mut hits = 0;
        for _ in 0..7 {
            let start = std::time::Instant::now();
            hits = ready.iter().take(400).map(|r| all.iter().filter(|b| b.entry(r).is_some()).count()).sum();
            best = best.min(start.elapsed().as_secs_f64());
        }
        let tests = (ready.len().min(400) * all.len()) as f64;
        println!(
            "{what}: {:.2} ns a test, p {:.3}, S over box {:.3}, set-up {set_up:.0} ns, build {build:.2} us, area {area_time:.2} us",
            best * 1e9 / tests,
            hits as f64 / tests,
            area / of_box,
        );
    }
    let mut seeded = Seeded::new(12);
    let world = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
    let lines: Vec<Ray<f32>> = rays::uniform(4, &world, 2000);
    for (shape, half) in [("cubes", DVec3::splat(0.4)), ("rods", DVec3::new(0.9, 0.04, 0.04))] {
        println!("{shape}");
        let mut one = || {
            let turn = rotation(&mut seeded);
            cube(half).iter().map(|p| turn * *p).collect::<Vec<DVec3>>()
        };
        let points: Vec<Vec<DVec3>> = (0..2000).map(|_| one()).collect();
        let of_box =
            points.iter().map(|p| Aabb::around(p, DVec3::ZERO).unwrap().surface_area() as f64).sum::<f64>();
        volumes::<Aabb>("box (pair test)", &points, &lines, &world, of_box);
        volumes::<Kdop<6>>("6-DOP", &points, &lines, &world, of_box);
        volumes::<Kdop<14>>("14-DOP", &points, &lines, &world, of_box);
        volumes::<Kdop<18>>("18-DOP", &points, &lines, &world, of_box);
        volumes::<Kdop<26>>("26-DOP", &points, &lines, &world, of_box);
        volumes::<Polytope>("polytope", &points, &lines, &world, of_box);
    }
    let ray = SlabRay::new(&lines[0], DVec3::ZERO, &world);
    assert!(ray.far() > 0.0);
}

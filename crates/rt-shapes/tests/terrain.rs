//! Terrains against the explicit meshes of the same level.

// The long test, run by hand, says what it found.
#![allow(clippy::print_stdout)]

use core::ops::ControlFlow;
use rt_accel::{Aggregate, BuildError, Counts, Exhaustive, Hit, Primitive, WorldBound};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector};
use rt_measure::error::HitError;
use rt_measure::rays::{self, Seeded};
use rt_shapes::{
    Fractal, Heights, Lazy, Refine, Samples, Shape, Surfaced, Terrain, TerrainParams, TriangleMesh, Uv,
};

type Mesh = Aggregate<Exhaustive, TriangleMesh<f64>>;

/// All hits, in order.
fn all<P: Primitive<f64, At = Uv>>(shape: &P, ray: &Ray<f64>) -> Vec<(f64, u32)> {
    let mut hits = Vec::new();
    let _ = shape.all_hits(ray, &mut |hit: Hit<Uv, f64>| {
        hits.push((hit.t, hit.at.prim));
        ControlFlow::Continue(())
    });
    hits.sort_by(|a, b| a.partial_cmp(b).unwrap());
    hits
}

/// Rays of all kinds: chords, through vertices and middles of edges, along axes, and from below.
fn shoot<R: Real>(terrain: &impl WorldBound, mesh: &TriangleMesh<f64>, count: usize) -> Vec<Ray<R>> {
    let bound = terrain.world_bound();
    let mut seeded = Seeded::new(3);
    let vertices: Vec<DVec3> = (0..count / 8)
        .flat_map(|_| {
            let [a, b, _] = mesh.triangle(seeded.below(mesh.triangles().len()) as u32).corners;
            [a, (a + b) * 0.5]
        })
        .collect();
    let mut rays = rays::uniform(1, &bound, count / 2);
    rays.extend(rays::aimed::<R>(2, &bound, &vertices, 1));
    rays.extend(rays::axis_parallel::<R>(&bound, &vertices[..vertices.len() / 6]));
    rays.extend(rays::in_faces::<R>(4, &bound, count / 8));
    rays
}

/// Compares answers to about `count` rays of either precision; returns hits, and facets made a ray.
fn compare<H: Heights>(terrain: &Terrain<H>, count: usize) -> (usize, f64) {
    let mesh: Mesh = Aggregate::build(terrain.refine().unwrap(), &()).unwrap();
    assert_eq!(mesh.geometry().triangles().len() as u32, terrain.facet_count());
    for prim in [0, terrain.facet_count() / 3, terrain.facet_count() - 1] {
        assert_eq!(terrain.facet(prim), Some(mesh.geometry().triangle(prim)));
    }
    let (mut hits, mut counts) = (0, Counts::default());
    let rays = shoot::<f64>(terrain, mesh.geometry(), count);
    for ray in &rays {
        let (found, wanted) = (terrain.intersect_counted(ray, &mut counts), mesh.intersect(ray));
        assert_eq!(found, wanted, "{ray:?}");
        assert_eq!(terrain.intersect_p(ray), wanted.is_some());
        let short = ray.between(0.2, 0.6);
        assert_eq!(terrain.intersect(&short), mesh.intersect(&short), "{short:?}");
        assert_eq!(all(terrain, ray), all(&mesh, ray), "{ray:?}");
        hits += wanted.is_some() as usize;
    }
    for ray in shoot::<f32>(terrain, mesh.geometry(), count / 4) {
        let wanted = (0..terrain.facet_count())
            .filter_map(|prim| {
                let met = mesh.geometry().triangle(prim).intersect(&ray)?;
                Some((met.t, prim))
            })
            .min_by(|a, b| a.partial_cmp(b).unwrap());
        let found = terrain.intersect(&ray).map(|hit| (hit.t, hit.at.prim));
        assert_eq!(found, wanted, "{ray:?}");
    }
    (hits, counts.prims as f64 / rays.len() as f64)
}

fn hills(level: u32, cached: u32) -> Terrain<Fractal> {
    let params = TerrainParams { level, cached, ..TerrainParams::default() };
    Terrain::new(Fractal { corners: [0.1, -0.2, 0.0, 0.3], ..Fractal::default() }, params).unwrap()
}

#[test]
fn hits_are_those_of_the_mesh() {
    for cached in [0, 2, 5] {
        let (hits, made) = compare(&hills(5, cached), 1200);
        assert!(hits > 300, "{hits}");
        // Of 2048.
        assert!(made < [80.0, 50.0, 12.0][cached as usize / 2], "{cached}: {made}");
    }
    compare(&hills(0, 0), 100);
    compare(&hills(1, 1), 100);
}

#[test]
#[ignore = "a hundred thousand rays at 2048 facets, one by one"]
fn hits_are_those_of_the_mesh_for_many_rays() {
    for cached in [0, 5] {
        println!("{:?}", compare(&hills(5, cached), 100_000));
    }
}

#[test]
fn tables_are_terrains_too() {
    let mut seeded = Seeded::new(5);
    let heights: Vec<f32> = (0..33 * 33).map(|_| seeded.unit() as f32 * 0.2).collect();
    let params = TerrainParams {
        level: 5,
        min: DVec2::new(-7.0, 3.0),
        size: DVec2::new(2.0, 0.5),
        ..TerrainParams::default()
    };
    let terrain = Terrain::new(Samples::new(heights.clone()).unwrap(), params).unwrap();
    assert_eq!(terrain.params().cached, 5);
    let (hits, _) = compare(&terrain, 800);
    assert!(hits > 100, "{hits}");
    // Sample (i, j) stands at its place.
    let down = Ray::new(DVec3::new(-7.0 + 2.0 * 3.0 / 32.0, 3.0 + 0.5 * 7.0 / 32.0, 1.0), -DVec3::Z);
    assert_eq!(terrain.intersect(&down).unwrap().t, 1.0 - heights[7 * 33 + 3] as f64);
    assert!(Samples::new(vec![0.0; 12]).is_err() && Samples::new(vec![f32::NAN; 9]).is_err());
}

#[test]
fn places_scales_and_flat_ground_do_not_matter() {
    let fractal = Fractal { hurst: 0.5, ..Fractal::default() };
    for (scale, min) in [(1e-40, DVec2::ZERO), (1e30, DVec2::ONE), (1.0, DVec2::new(1e6, -1e7))] {
        let fractal = Fractal { rise: 0.1 * scale, ..fractal };
        let params = TerrainParams {
            min: min * scale,
            size: DVec2::splat(scale),
            level: 4,
            cached: 1,
            ..TerrainParams::default()
        };
        let terrain = Terrain::new(fractal, params).unwrap();
        let mesh: Mesh = Aggregate::build(terrain.refine().unwrap(), &()).unwrap();
        let mut seeded = Seeded::new(6);
        for k in 0..600 {
            let spread = DVec3::splat(0.6) * scale;
            let middle = (min + 0.5).extend(0.0) * scale;
            let (from, to) = (seeded.inside(-spread, spread), seeded.inside(-spread, spread));
            let fast = [1.0, 1e-30, 1e20][k % 3];
            let ray = Ray::new(middle + from, (to - from) * fast);
            assert_eq!(terrain.intersect(&ray), mesh.intersect(&ray), "{scale:e} {ray:?}");
        }
    }
    let flat = Terrain::new(Fractal { rise: 0.0, ..fractal }, TerrainParams::default()).unwrap();
    let ray = Ray::new(DVec3::new(0.3, 0.3, 1.0), DVec3::new(0.1, 0.2, -1.0));
    assert_eq!(flat.intersect(&ray).unwrap().t, 1.0);
    // Within the ground: never hit, as with triangles.
    assert!(!flat.intersect_p(&Ray::new(DVec3::new(-1.0, 0.3, 0.0), DVec3::X)));
    for dir in [DVec3::ZERO, DVec3::NAN, DVec3::splat(1e300)] {
        let _ = flat.intersect(&Ray::new(DVec3::ONE, dir));
    }
}

#[test]
fn coarser_levels_leave_vertices_out_and_tolerance_chooses_one() {
    let (fine, coarse) = (hills(6, 0).refine().unwrap(), hills(4, 0).refine().unwrap());
    let fine: std::collections::HashSet<_> = fine.vertices().iter().map(|v| v.map(f64::to_bits)).collect();
    assert!(coarse.vertices().iter().all(|v| fine.contains(&v.map(f64::to_bits))));
    let params = TerrainParams { level: 12, tolerance: 0.05, ..TerrainParams::default() };
    let terrain = Terrain::new(Fractal::default(), params).unwrap();
    let level = terrain.params().level;
    assert!(terrain.heights().beyond(level, 12) <= 0.05 && terrain.heights().beyond(level - 1, 12) > 0.05);
}

#[test]
fn a_deep_terrain_is_asked_without_being_made() {
    let terrain = hills(15, 6);
    assert!(terrain.bytes() < 200_000 && terrain.facet_count() == 1 << 31);
    let (mut counts, mut hits) = (Counts::default(), 0);
    let rays = rays::uniform::<f32>(8, &terrain.world_bound(), 500);
    for ray in &rays {
        if let Some(hit) = terrain.intersect_counted(ray, &mut counts) {
            hits += 1;
            let surface = terrain.surface(ray, &hit);
            let off = (surface.point - ray.at(hit.t).widen()).abs().max_element();
            assert!(off < 1e-6 && surface.normal.z > 0.0 && surface.uv.min_element() >= 0.0);
            let partials = terrain.partials(ray, &hit);
            let n = partials.dpdu.cross(partials.dpdv).normalize();
            assert!(n.dot(surface.normal) > 1.0 - 1e-6, "{n} {}", surface.normal);
            assert!(!terrain.intersect_p(&surface.spawn(rt_geom::glam::Vec3A::Z).between(0.0, 1e-9)));
        }
    }
    assert!(hits > 100 && counts.prims < 40 * rays.len() as u64, "{hits} {counts:?}");
}

#[test]
fn bad_parameters_are_named() {
    let with = |params: TerrainParams| Terrain::new(Fractal::default(), params).is_err();
    let fine = TerrainParams::default();
    assert!(with(TerrainParams { level: 16, ..fine }));
    assert!(with(TerrainParams { size: DVec2::new(1.0, 0.0), ..fine }));
    assert!(with(TerrainParams { size: DVec2::new(1.0, f64::NAN), ..fine }));
    assert!(with(TerrainParams { min: DVec2::new(1e15, 0.0), ..fine }));
    assert!(with(TerrainParams { tolerance: f64::NAN, ..fine }));
    assert!(Terrain::new(Fractal { hurst: 0.0, ..Fractal::default() }, fine).is_err());
    assert!(Terrain::new(Fractal { rise: f64::INFINITY, ..Fractal::default() }, fine).is_err());
}

#[test]
fn what_takes_too_much_memory_is_refused_in_true_figures() {
    let refused = hills(15, 6).refine().unwrap_err();
    let side = (1 << 15) + 1;
    assert_eq!(refused, BuildError::OutOfMemory { needed: side * side * 24 + (12 << 31), limit: 1 << 31 });
    let params = TerrainParams { level: 15, cached: 15, ..TerrainParams::default() };
    let refused = Terrain::new(Fractal::default(), params).unwrap_err();
    assert_eq!(refused, BuildError::OutOfMemory { needed: ((1 << 30) - 1) / 3 * 32, limit: 1 << 31 });
    let little = TerrainParams { memory_limit: 1 << 20, ..TerrainParams::default() };
    let terrain = Terrain::new(Fractal::default(), little).unwrap();
    assert!(terrain.bytes() < 1 << 16 && terrain.refine().is_err());
}

#[test]
fn terrains_refine_lazily() {
    let lazy = Lazy::<Exhaustive, _>::new(hills(5, 3), ());
    let terrain = hills(5, 3);
    let mut hits = 0;
    for ray in rays::uniform::<f64>(9, &terrain.world_bound(), 200) {
        assert_eq!(lazy.intersect(&ray), terrain.intersect(&ray));
        if let Some(hit) = lazy.intersect(&ray) {
            hits += 1;
            let mesh = lazy.refined().unwrap().unwrap().geometry();
            assert_eq!(Surfaced::surface(mesh, &ray, &hit).point, terrain.surface(&ray, &hit).point);
        }
    }
    assert!(hits > 30);
}

/// Rays through points of the terrain from as far away as triangles promise to be exact, at any pace; along axes, diagonals and
/// anywhere.
fn from_afar(terrain: &Terrain<Fractal>, scale: f64, count: usize) -> Vec<Ray<f64>> {
    let mut seeded = Seeded::new(11);
    let TerrainParams { min, size, .. } = *terrain.params();
    let tall = 0.3 * scale;
    let mut rays = Vec::new();
    for k in 0..count {
        let at = seeded.inside(min.extend(-tall), (min + size).extend(tall));
        let dir = match k % 5 {
            0 => -DVec3::Z,
            1 => DVec3::new(0.0, if k % 2 == 0 { 1.0 } else { -1.0 }, 0.0),
            2 => DVec3::new(0.5, -0.25, -1.0),
            _ => seeded.inside(-DVec3::ONE, DVec3::ONE),
        };
        let far = [0.0, 1.0, 1e6, 1e9, 1e15, 1e20, 1e30, 1e40, 1e60, 1e80][k / 5 % 10];
        // From so far that `at` leaves no trace: through zero, exactly, or along an axis through `at`.
        let far = 2f64.powf(f64::log2(far).floor().max(-60.0)) * scale;
        let origin = at - dir * far;
        let pace = [1.0, 1e-320, 1e-300, 1e-120, 1e120, 1e307][k / 50 % 6];
        rays.push(Ray::new(origin, dir * pace));
    }
    rays
}

#[test]
fn rays_from_anywhere_at_any_pace_meet_what_the_mesh_says() {
    let (mut hits, mut far) = (0, 0);
    let mut counts = Counts::default();
    for (scale, min) in [(1.0, DVec2::splat(-0.4)), (1e-50, DVec2::ZERO), (1e55, DVec2::splat(-0.9))] {
        let fractal = Fractal {
            rise: 0.1 * scale,
            corners: [0.1, -0.2, 0.0, 0.3].map(|z| z * scale),
            ..Fractal::default()
        };
        let params = TerrainParams {
            min: min * scale,
            size: DVec2::splat(scale),
            level: 3,
            cached: 1,
            ..TerrainParams::default()
        };
        let terrain = Terrain::new(fractal, params).unwrap();
        let mesh: Mesh = Aggregate::build(terrain.refine().unwrap(), &()).unwrap();
        let rays = from_afar(&terrain, scale, 300);
        for ray in &rays {
            let wanted = mesh.intersect(ray);
            assert_eq!(terrain.intersect_counted(ray, &mut counts), wanted, "{ray:?}");
            assert_eq!(terrain.intersect_p(ray), wanted.is_some(), "{ray:?}");
            assert_eq!(all(&terrain, ray), all(&mesh, ray), "{ray:?}");
            if let Some(hit) = wanted {
                hits += 1;
                far += (ray.origin.abs().max_element() > 1e18 * scale) as usize;
                // Intervals that end at the hit and before it.
                for near in
                    [ray.between(hit.t, hit.t), ray.between(0.0, hit.t), ray.between(0.0, hit.t.next_down())]
                {
                    assert_eq!(terrain.intersect(&near), mesh.intersect(&near), "{near:?}");
                }
            }
        }
    }
    println!("{hits} hits, {far} of them from far away, {counts:?}");
    assert!(hits > 200 && far > 80, "{hits} {far}");
}

#[test]
fn rays_from_anywhere_are_right_by_exact_arithmetic() {
    let terrain = Terrain::new(
        Fractal { corners: [0.1, -0.2, 0.0, 0.3], ..Fractal::default() },
        TerrainParams { min: DVec2::splat(-0.4), level: 3, cached: 1, ..TerrainParams::default() },
    )
    .unwrap();
    let facets: Vec<_> = (0..terrain.facet_count())
        .map(|prim| terrain.facet(prim).unwrap().corners.map(|corner| corner.to_array()))
        .collect();
    // Distances below the normal range are rounded twice.
    let mut errors = [HitError::default(); 2];
    for ray in from_afar(&terrain, 1.0, 600) {
        let hit = terrain.intersect(&ray);
        let error = &mut errors[usize::from(hit.is_some_and(|hit| hit.t < f64::MIN_POSITIVE))];
        error.judge_triangles(&ray, &facets, hit.map(|hit| (hit.at.prim, hit.t)));
    }
    let [normal, tiny] = errors;
    assert!(normal.rays > 500 && normal.is_exact() && normal.t_ulp <= 0.5, "{normal:?}");
    assert!(tiny.rays > 0 && tiny.is_exact() && tiny.t_ulp < 1.0, "{tiny:?}");
}

#[test]
fn a_deep_terrain_is_asked_from_afar_without_being_searched() {
    let terrain = hills(15, 6);
    for (far, most) in [(1e3, 60), (1e9, 60), (1e20, 200), (1e60, 200), (1e200, 200)] {
        let far = 2f64.powf(f64::log2(far).floor());
        let mut counts = Counts::default();
        for k in 0..20 {
            let at = DVec3::new(0.05 * f64::from(k) + 0.01, 0.37, 0.0);
            for dir in [-DVec3::Z, DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.7, 0.2, -0.5)] {
                let _ = terrain.intersect_counted(&Ray::new(at - dir * far, dir), &mut counts);
            }
        }
        println!("{far:e} {counts:?}");
        assert!(counts.prims < most * 60, "{far:e} {counts:?}");
    }
}

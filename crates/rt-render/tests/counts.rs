//! The rays of the Standard Procedural Databases, counted: the figures that every correct renderer agrees on.

use rt_accel::{Aggregate, Member};
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Real;
use rt_render::{Camera, Film, Look, RayCounts, Whitted, ungoverned};
use rt_scenes::{Scene, SceneGeometry, Solid};
use rt_shapes::{Shape, Uv};

fn rays<R: Real, P: Shape<R>>(
    scene: &Scene,
    shape: &P,
    material_of: impl Fn(&P::At) -> u32 + Sync,
) -> RayCounts {
    let look = Look { materials: &scene.materials, lights: &scene.lights, background: scene.background };
    let whitted = Whitted::new(shape, material_of, look);
    let camera = Camera::new(&scene.view).unwrap();
    Film::new(512, 512).render::<R, _, _>(&camera, &whitted, &ungoverned).unwrap().1
}

/// Counts in `f64` and in `f32`.
fn count(name: &str, size: u32) -> [RayCounts; 2] {
    let scene = rt_scenes::by_name(name, Some(size)).unwrap();
    let material = |prim: u32| scene.material_of.get(prim as usize).copied().unwrap_or(0);
    match scene.geometry.clone() {
        SceneGeometry::Solids(solids) => {
            let shape = Aggregate::<Bvh, Vec<Solid>>::build(solids, &BvhParams::default()).unwrap();
            let material_of = |at: &Member<Uv>| material(at.prim);
            [rays::<f64, _>(&scene, &shape, material_of), rays::<f32, _>(&scene, &shape, material_of)]
        }
        SceneGeometry::Mesh(mesh) => {
            let shape = Aggregate::<Bvh, _>::build(mesh, &BvhParams::default()).unwrap();
            let material_of = |at: &Uv| material(at.prim);
            [rays::<f64, _>(&scene, &shape, material_of), rays::<f32, _>(&scene, &shape, material_of)]
        }
        SceneGeometry::FineMesh(_) => panic!("{name} is no mesh of f64"),
    }
}

/// Within 0.05 % of the figures computed with brute geometry and an `f64` tracer of another make.
#[track_caller]
fn agree(name: &str, size: u32, expected: RayCounts) {
    for (counted, bits) in count(name, size).into_iter().zip(["f64", "f32"]) {
        let pairs = [
            (counted.eye, expected.eye),
            (counted.eye_hits, expected.eye_hits),
            (counted.shadow, expected.shadow),
            (counted.occluded, expected.occluded),
            (counted.reflection, expected.reflection),
            (counted.refraction, expected.refraction),
            (counted.secondary_hits, expected.secondary_hits),
            (counted.total_internal, expected.total_internal),
        ];
        for (counted, expected) in pairs {
            let off = counted.abs_diff(expected) as f64;
            assert!(off <= 0.0005 * expected as f64, "{name} {size} in {bits}: {counted} for {expected}");
        }
    }
}

#[test]
fn the_sphereflake_takes_the_rays_it_is_known_for() {
    let known = RayCounts {
        eye: 263_169,
        eye_hits: 263_169,
        shadow: 954_971,
        occluded: 287_384,
        reflection: 175_921,
        secondary_hits: 126_753,
        ..RayCounts::default()
    };
    agree("balls", 4, known);
    let known = RayCounts {
        shadow: 874_391,
        occluded: 185_362,
        reflection: 113_455,
        secondary_hits: 68_430,
        ..known
    };
    agree("balls", 2, known);
}

#[test]
fn the_tetrahedra_take_the_rays_they_are_known_for() {
    let known =
        RayCounts { eye: 263_169, eye_hits: 49_950, shadow: 46_261, occluded: 5_557, ..RayCounts::default() };
    agree("tetra", 6, known);
    agree("tetra", 5, RayCounts { eye_hits: 53_807, shadow: 50_135, occluded: 4_651, ..known });
}

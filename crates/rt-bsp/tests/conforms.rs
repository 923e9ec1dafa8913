//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Mailing, Sah};
use rt_bsp::{Bsp, BspParams};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use rt_measure::conform;
use rt_measure::rays::{Seeded, troublesome};
use rt_scenes::{SceneGeometry, Solid, Trial, soup};
use rt_shapes::TriangleMesh;

/// The default, and trees with as many slanted planes as the parameters can make.
fn params() -> [BspParams; 2] {
    let slanted = BspParams {
        sah: Sah { traverse: 0.5, intersect: 1.0 },
        slanted: 0.0,
        exhaustive: 12,
        samples: 4,
        bad_splits: 2,
        empty_bonus: 0.9,
        max_depth: Some(10),
        mailing: Mailing::Hashed,
        ..BspParams::default()
    };
    [BspParams::default(), slanted]
}

fn check<V: Real + Into<R>, R: Real>(trial: &Trial<V>) {
    let rays = troublesome::<R>(&trial.mesh, &trial.points());
    conform::conform_all::<Bsp, R, _>(&trial.name, &trial.mesh, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

/// Trials of up to so many triangles are quick.
const QUICK: usize = 120;

#[test]
fn on_quick_trials_in_f32() {
    for trial in rt_scenes::trials().iter().filter(|trial| trial.mesh.triangles().len() <= QUICK) {
        check::<f32, f32>(trial);
    }
}

#[test]
fn on_quick_trials_in_f64() {
    for trial in rt_scenes::trials().iter().filter(|trial| trial.mesh.triangles().len() <= QUICK) {
        check::<f32, f64>(trial);
    }
    for trial in rt_scenes::fine_trials().iter().filter(|trial| trial.mesh.triangles().len() <= QUICK) {
        check::<f64, f64>(trial);
    }
}

/// All of them, in both precisions.
#[test]
#[ignore = "minutes: run it when the build or the walk has changed"]
fn on_every_trial() {
    for trial in rt_scenes::trials() {
        check::<f32, f32>(&trial);
        check::<f32, f64>(&trial);
    }
    for trial in rt_scenes::fine_trials() {
        check::<f64, f64>(&trial);
    }
}

#[test]
fn on_spheres_and_polygons() {
    let scene = rt_scenes::by_name("balls", Some(2)).unwrap();
    let SceneGeometry::Solids(solids) = scene.geometry else { panic!("balls are solids") };
    let points: Vec<DVec3> = solids
        .iter()
        .filter_map(|solid| match solid {
            Solid::Sphere(ball) => Some(ball.center() + DVec3::X * ball.radius()),
            _ => None,
        })
        .collect();
    for params in params() {
        let rays = troublesome::<f32>(&solids, &points);
        conform::conform::<Bsp, f32, _>("balls 2", &solids, &params, &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

/// Squares in a slanted plane of whole numbers, and triangles that stand on it: rays run within planes of the tree, exactly.
fn slanted_floor() -> TriangleMesh {
    let grid = soup::grid(6);
    let [u, v] = [DVec3::new(2.0, 1.0, -1.0), DVec3::new(-1.0, 3.0, 2.0)];
    let place = |x: f32, y: f32| u * f64::from(x) + v * f64::from(y);
    let floor = grid.vertices().iter().map(|&[x, y, _]| place(x, y));
    let mut vertices: Vec<[f32; 3]> = floor.map(|p| p.as_vec3().to_array()).collect();
    let mut triangles = grid.triangles().to_vec();
    for (i, square) in (0..).zip(grid.triangles().iter().step_by(5)) {
        let top = vertices.len() as u32;
        let [x, y, z] = vertices[square[0] as usize];
        vertices.push([x + 5.0, y - 3.0, z + 7.0 - (i % 3) as f32 * 7.0]);
        triangles.push([square[0], square[2], top]);
    }
    TriangleMesh::new(vertices, triangles).unwrap()
}

fn within_planes<R: Real + From<f32>>() {
    let mesh = slanted_floor();
    let at = |i: u32| DVec3::from_array(mesh.vertices()[i as usize].map(f64::from));
    let mut rays = Vec::new();
    for &[a, b, c] in mesh.triangles() {
        let [a, b, c] = [a, b, c].map(at);
        // Along edges and across triangles, within their planes, from outside and from corners; and beside them, in parallel.
        for (from, to) in [(a, b), (b, c), (c, a), (a, b + c - a), (b, (a + c) * 0.5)] {
            for (back, lift) in [(0.0, 0.0), (3.0, 0.0), (64.0, 0.0), (3.0, 0.5), (2.0, -1.0)] {
                let dir = to - from;
                let lift = (b - a).cross(c - a) * lift;
                rays.push(Ray::new(R::Vec3::nearest(from - dir * back + lift), R::Vec3::nearest(dir)));
            }
        }
    }
    conform::conform_all::<Bsp, R, _>("slanted floor", &mesh, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

#[test]
fn on_rays_within_slanted_planes() {
    within_planes::<f32>();
    within_planes::<f64>();
}

fn from_afar<R: Real + From<f32>>(distances: &[f64]) {
    for (name, mesh) in [("sticks 40", soup::sticks(40, 50.0, 9)), ("slanted floor", slanted_floor())] {
        let mut seeded = Seeded::new(4);
        let mut rays = Vec::new();
        for vertex in mesh.vertices() {
            let at = DVec3::from_array(vertex.map(f64::from));
            for &far in distances {
                let from = R::Vec3::nearest(at - seeded.direction() * far);
                let ray = Ray::new(from, R::Vec3::nearest(at - from.widen()));
                // From behind itself, too.
                rays.extend([
                    ray,
                    Ray { origin: R::Vec3::nearest(at), ..ray }.between(R::nearest(-1.0), R::nearest(1.0)),
                ]);
            }
        }
        conform::conform_all::<Bsp, R, _>(name, &mesh, &params(), &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

#[test]
fn on_rays_from_afar() {
    from_afar::<f32>(&[1e3, 1e7, 1e30]);
    from_afar::<f64>(&[1e3, 1e9, 1e15, 1e40, 1e300]);
}

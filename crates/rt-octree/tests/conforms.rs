//! The tree answers as every primitive in turn does, bit for bit: closest, any, all, many; in both precisions.

use rt_accel::{Aggregate, Clip, Exhaustive, Hit, Mailing, Primitive, Sah, Structure, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real};
use rt_measure::conform;
use rt_measure::rays::{self, troublesome};
use rt_octree::{Octree, OctreeParams, Split, Stop};
use rt_scenes::{SceneGeometry, Solid, Trial};

/// The default; the textbooks'; Morton codes; and as deep as the parameters can make it.
fn params() -> [OctreeParams; 4] {
    let classic = OctreeParams { clip: Clip::Box, mailing: Mailing::Inverse, ..OctreeParams::classic(4, 6) };
    let linear = OctreeParams { mailing: Mailing::Hashed, stop: Stop::Count, ..OctreeParams::linear() };
    let deep = OctreeParams {
        split: Split::Cost,
        stop: Stop::Cost { ahead: 3 },
        sah: Sah { traverse: 0.0, intersect: 1.0 },
        max_depth: Some(21),
        most_references: 20.0,
        ..OctreeParams::default()
    };
    [OctreeParams::default(), classic, OctreeParams { max_depth: Some(7), ..linear }, deep]
}

/// Where hundreds of primitives coincide the truth alone, by exact arithmetic, takes seconds: closest hits of few rays,
/// unless all is asked.
const SLOW: [&str; 5] = [
    "300 times one triangle",
    "150 pairs, back to back",
    "coordinates 2^i, i from -126 to 126",
    "coordinates 3^-i about a corner",
    "boxes nested from 2^-60 to 2^60",
];

fn check<V: Real + Into<R>, R: Real>(trial: &Trial<V>, params: &[OctreeParams]) {
    let rays = troublesome::<R>(&trial.mesh, &trial.points());
    if params.len() < 4 && SLOW.contains(&trial.name.as_str()) {
        let some: Vec<Ray<R>> = rays.iter().copied().step_by(rays.len() / 24 + 1).collect();
        return params.iter().for_each(|params| few::<V, R>(trial, &some, params));
    }
    conform::conform_all::<Octree, R, _>(&trial.name, &trial.mesh, params, &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

fn few<V: Real + Into<R>, R: Real>(trial: &Trial<V>, rays: &[Ray<R>], params: &OctreeParams) {
    let tree = Aggregate::<Octree, _>::build(&trial.mesh, params).unwrap();
    let all = Aggregate::<Exhaustive, _>::build(&trial.mesh, &()).unwrap();
    tree.structure().validate(&trial.mesh).unwrap_or_else(|why| panic!("{}: {why}", trial.name));
    for ray in rays {
        assert_eq!(tree.intersect(ray), all.intersect(ray), "{}: {}", trial.name, conform::paste(ray));
    }
}

#[test]
fn on_every_trial_in_f32() {
    for (i, trial) in rt_scenes::trials().iter().enumerate() {
        check::<f32, f32>(trial, &[params()[0], params()[1 + i % 3]]);
    }
}

#[test]
fn on_every_trial_in_f64() {
    for (i, trial) in rt_scenes::trials().iter().enumerate().step_by(4) {
        check::<f32, f64>(trial, &[params()[0], params()[1 + i / 4 % 3]]);
    }
    for trial in rt_scenes::fine_trials() {
        check::<f64, f64>(&trial, &params());
    }
}

#[test]
#[ignore = "minutes"]
fn on_every_trial_with_all_parameters() {
    for trial in rt_scenes::trials() {
        check::<f32, f32>(&trial, &params());
        check::<f32, f64>(&trial, &params());
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
    let rays = troublesome::<f32>(&solids, &points);
    conform::conform_all::<Octree, f32, _>("balls 2", &solids, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
    let rays = troublesome::<f64>(&solids, &points);
    conform::conform_all::<Octree, f64, _>("balls 2", &solids, &params(), &rays)
        .unwrap_or_else(|why| panic!("{why}"));
}

/// A plane across one axis, without end.
struct Plane(usize, f32);

impl WorldBound for Plane {
    fn world_bound(&self) -> Aabb {
        let mut b = Aabb::INFINITE;
        (b.min[self.0], b.max[self.0]) = (self.1, self.1);
        b
    }
}

impl Primitive for Plane {
    type At = ();
    fn intersect(&self, ray: &Ray) -> Option<Hit<()>> {
        let t = (self.1 as f64 - ray.origin[self.0] as f64) / ray.dir[self.0] as f64;
        if ray.dir[self.0] == 0.0 { None } else { ray.admit(t).map(|t| Hit { t, at: () }) }
    }
}

#[test]
fn on_planes_without_end() {
    let planes: Vec<Plane> = (0..90).map(|i| Plane(i % 3, (i * i % 41) as f32)).collect();
    let one: Vec<Plane> = vec![Plane(1, 5.0)];
    let inside = Aabb::new(Vec3A::splat(-20.0), Vec3A::splat(60.0));
    for planes in [planes, one] {
        let rays = rays::uniform(1, &inside, 100);
        conform::conform_all::<Octree, f32, _>("planes", &planes, &params(), &rays)
            .unwrap_or_else(|why| panic!("{why}"));
    }
}

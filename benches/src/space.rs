//! Which space to bound in? Turned cubes and rods behind boxes of four kinds, in the world or in their own space.
//!
//! Each ray is a chord of the sphere around one object. `nodes` are tests of bounds by ray, `tests` those of the object, which is
//! asked with the ray carried into its space; `S` is the bound's surface over that of the object's convex hull, `false` the share
//! of rays that meet the bound and not the object. Rays for boxes in the world are made ready beforehand, as a traversal does
//! once for all boxes; what is done once a candidate is in the time.

use crate::contest::{Group, Measured, Mismatch, Weigh, mark_front};
use crate::volumes::turn;
use crate::{Effort, Trouble, Watch, hear};
use core::hint::black_box;
use rt_accel::{Aggregate, Exhaustive, Instance, Primitive, WorldBound};
use rt_bounds::{Aabb, BoundingVolume, DAabb, Obb, SlabRay, UnitRay};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Transform};
use rt_measure::clock::race;
use rt_measure::error::HitError;
use rt_measure::rays::{self, Seeded};
use rt_shapes::TriangleMesh;

/// Turned objects.
const OBJECTS: usize = 400;
/// Rays at each of them.
const AT_EACH: usize = 40;

type Solid = Aggregate<Exhaustive, TriangleMesh>;

/// The objects: a name, half the size of the box, and whether the box is filled or holds an octahedron.
const KINDS: [(&str, [f32; 3], Fill); 4] = [
    ("cube", [0.5, 0.5, 0.5], Fill::Whole),
    ("rod", [0.5, 0.02, 0.02], Fill::Whole),
    ("octahedron", [0.5, 0.5, 0.5], Fill::Octahedron),
    ("splinter", [0.5, 0.02, 0.02], Fill::Octahedron),
];

#[derive(Clone, Copy)]
enum Fill {
    Whole,
    Octahedron,
}

/// The object, and the surface of its hull, which is itself.
fn solid([x, y, z]: [f32; 3], fill: Fill) -> Result<(Solid, f64), Trouble> {
    let (vertices, triangles): (Vec<[f32; 3]>, Vec<[u32; 3]>) = match fill {
        Fill::Whole => {
            let side = |i: u32, a: u32, h: f32| if i >> a & 1 == 1 { h } else { -h };
            let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
            let halves = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
            ((0..8).map(|i| [side(i, 0, x), side(i, 1, y), side(i, 2, z)]).collect(), halves.collect())
        }
        Fill::Octahedron => {
            let tips = [[x, 0., 0.], [-x, 0., 0.], [0., y, 0.], [0., -y, 0.], [0., 0., z], [0., 0., -z]];
            let faces = (0..8u32).map(|i| [i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)]);
            (tips.to_vec(), faces.collect())
        }
    };
    let corner = |i: u32| Vec3A::from_array(vertices[i as usize]).as_dvec3();
    let area = |&[a, b, c]: &[u32; 3]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).length() / 2.0;
    let surface = triangles.iter().map(area).sum();
    let mesh = TriangleMesh::new(vertices, triangles).map_err(|why| Trouble::Scene(why.to_string()))?;
    Ok((Aggregate::build(mesh, &())?, surface))
}

/// An object somewhere, and what surrounds it.
struct Turned<'a> {
    solid: &'a Solid,
    to_world: Transform,
    to_object: Transform,
    /// The object's box in the world.
    slabs: Obb,
    /// In the world: of carried vertices, and of the carried box.
    tight: Aabb,
    loose: Aabb,
    own: DAabb,
}

/// A ray and its object.
struct Shot {
    object: usize,
    ray: Ray,
    slab: SlabRay,
    unit: UnitRay,
}

impl Turned<'_> {
    /// Option 3: the ray in the object's space, if it meets the box there.
    fn meets_inside(&self, ray: &Ray) -> Option<Ray<f64>> {
        let inside = self.to_object.ray(ray);
        self.own.span(&inside).map(|_| inside)
    }

    fn hit(&self, ray: &Ray) -> bool {
        self.solid.intersect_p(&self.to_object.ray(ray))
    }
}

/// One way to bound: how many bounds a ray tested, and whether the object was asked, and hit.
struct Way {
    name: &'static str,
    surface: fn(&Turned<'_>) -> f64,
    ask: fn(&Turned<'_>, &Shot) -> (u32, Option<bool>),
}

const WAYS: [Way; 7] = [
    Way {
        name: "1-world-box",
        surface: |at| f64::from(at.tight.surface_area()),
        ask: |at, shot| (1, world(at, shot, &at.tight)),
    },
    Way {
        name: "1b-carried-box",
        surface: |at| f64::from(at.loose.surface_area()),
        ask: |at, shot| (1, world(at, shot, &at.loose)),
    },
    Way {
        name: "2-slabs-in-world",
        surface: |at| at.own.relative_to(DVec3::ZERO).surface_area() as f64,
        ask: |at, shot| (1, at.slabs.entry(&shot.unit).map(|_| at.hit(&shot.ray))),
    },
    Way {
        name: "3-object-box",
        surface: |at| at.own.relative_to(DVec3::ZERO).surface_area() as f64,
        ask: |at, shot| (1, at.meets_inside(&shot.ray).map(|inside| at.solid.intersect_p(&inside))),
    },
    Way {
        name: "3-by-slab-ray",
        surface: |at| at.own.relative_to(DVec3::ZERO).surface_area() as f64,
        ask: |at, shot| {
            let (inside, b) = (at.to_object.ray(&shot.ray), at.solid.world_bound());
            let met = SlabRay::new(&inside, DVec3::ZERO, &b).entry(&b).is_some();
            (1, met.then(|| at.solid.intersect_p(&inside)))
        },
    },
    Way {
        name: "1-then-3",
        surface: |at| at.own.relative_to(DVec3::ZERO).surface_area() as f64,
        ask: |at, shot| match shot.slab.entry(&at.tight) {
            None => (1, None),
            Some(_) => (2, at.meets_inside(&shot.ray).map(|inside| at.solid.intersect_p(&inside))),
        },
    },
    Way { name: "none", surface: |_| f64::INFINITY, ask: |at, shot| (0, Some(at.hit(&shot.ray))) },
];

fn world(at: &Turned<'_>, shot: &Shot, b: &Aabb) -> Option<bool> {
    shot.slab.entry(b).map(|_| at.hit(&shot.ray))
}

pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let mut groups = Vec::new();
    for (k, (name, half, fill)) in KINDS.into_iter().enumerate() {
        hear(watch, k, KINDS.len())?;
        let (solid, hull) = solid(half, fill)?;
        groups.push(group(effort, name, &solid, hull)?);
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

fn group(effort: Effort, name: &str, solid: &Solid, hull: f64) -> Result<Group, Trouble> {
    let mut seeded = Seeded::new(3);
    let mut objects = Vec::with_capacity(OBJECTS);
    for _ in 0..OBJECTS {
        objects.push(turned(&mut seeded, solid)?);
    }
    let reach = solid.world_bound().size().length() / 2.0;
    let mut shots = Vec::with_capacity(OBJECTS * AT_EACH);
    for (object, at) in objects.iter().enumerate() {
        // The sphere around what `uniform` is given is the sphere around the object's box.
        let (center, half) = (at.to_world.point(DVec3::ZERO).as_vec3a(), Vec3A::splat(reach / 3f32.sqrt()));
        for ray in rays::uniform(object as u64, &Aabb::new(center - half, center + half), AT_EACH) {
            let slab = SlabRay::new(&ray, DVec3::ZERO, &at.loose);
            let unit = Obb::ready(&ray, DVec3::ZERO, &at.loose);
            shots.push(Shot { object, ray, slab, unit });
        }
    }
    let mut errors = [HitError::default(); WAYS.len()];
    let mut tallies = [(0u32, 0u32, 0u32); WAYS.len()];
    for shot in &shots {
        let at = &objects[shot.object];
        let truth = at.hit(&shot.ray);
        for ((way, error), tally) in WAYS.iter().zip(&mut errors).zip(&mut tallies) {
            let (bounds, asked) = (way.ask)(at, shot);
            error.rays += 1;
            error.missed += (truth && asked != Some(true)) as u64;
            error.invented += (!truth && asked == Some(true)) as u64;
            tally.0 += bounds;
            tally.1 += asked.is_some() as u32;
            tally.2 += (asked == Some(false)) as u32;
        }
    }
    let liar = WAYS.iter().zip(&errors).find(|(_, error)| !error.is_exact());
    let outcome = match liar {
        Some((way, error)) => {
            Err(Mismatch { who: way.name.into(), what: format!("missed {} of {}", error.missed, error.rays) })
        }
        None => {
            let mean =
                |way: &Way| objects.iter().map(|at| (way.surface)(at)).sum::<f64>() / OBJECTS as f64 / hull;
            Ok(timed(effort, &objects, &shots, &errors, &tallies, &mean))
        }
    };
    let ray_kind = "chords".to_string();
    Ok(Group {
        scene: name.into(),
        prims: OBJECTS,
        ray_kind,
        rays: shots.len(),
        judged: shots.len(),
        outcome,
    })
}

fn turned<'a>(seeded: &mut Seeded, solid: &'a Solid) -> Result<Turned<'a>, Trouble> {
    let wrong = |why: rt_geom::TransformError| Trouble::Scene(why.to_string());
    let turn = Transform::from_quat(turn(seeded)).map_err(wrong)?;
    let place = Transform::translation(seeded.inside(DVec3::splat(-10.0), DVec3::splat(10.0)));
    let to_world = turn.then(&place).map_err(wrong)?;
    let b = solid.world_bound();
    Ok(Turned {
        solid,
        to_world,
        to_object: to_world.inverse(),
        slabs: Obb::carried(&b, &to_world, DVec3::ZERO)
            .ok_or_else(|| Trouble::Scene("an object without a box".into()))?,
        tight: Instance::new(solid, to_world).world_bound(),
        loose: Instance::boxed(solid, to_world).world_bound(),
        own: DAabb { min: b.min.as_dvec3(), max: b.max.as_dvec3() },
    })
}

fn timed(
    effort: Effort,
    objects: &[Turned<'_>],
    shots: &[Shot],
    errors: &[HitError],
    tallies: &[(u32, u32, u32)],
    surface: &dyn Fn(&Way) -> f64,
) -> Vec<Measured> {
    let mut runs: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for way in &WAYS {
        runs.push(Box::new(move || {
            let asked = |shot: &&Shot| (way.ask)(&objects[shot.object], shot).1 == Some(true);
            black_box(black_box(shots).iter().filter(asked).count());
        }));
    }
    let mut contestants: Vec<&mut dyn FnMut()> = Vec::new();
    for run in &mut runs {
        contestants.push(&mut **run);
    }
    let race = race(effort.plan(), &mut contestants);
    let n = shots.len().max(1) as f64;
    let measured = WAYS.iter().enumerate().map(|(i, way)| {
        let (bounds, asked, idle) = tallies[i];
        Measured {
            structure: way.name.into(),
            params: String::new(),
            build_ms: None,
            bytes_per_prim: None,
            ns_per_ray: race.median(i) / n,
            spread: race.spread(i),
            speed: race.ratio(0, i),
            nodes_per_ray: Some(bounds as f64 / n),
            tests_per_ray: Some(asked as f64 / n),
            sah: None,
            error: errors[i],
            has_t: false,
            void: None,
            figures: vec![("S", surface(way)), ("false", idle as f64 / n)],
            on_front: false,
        }
    });
    let mut measured: Vec<Measured> = measured.collect();
    mark_front(&mut measured, Weigh::Misses);
    measured
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::ControlFlow;

    #[test]
    fn bounds_lose_nothing_and_fit_as_they_should() {
        for group in ask(Effort::Quick, &mut |_| ControlFlow::Continue(())).unwrap() {
            let measured = group.outcome.unwrap_or_else(|why| panic!("{}: {why}", group.scene));
            let tests = |name: &str| measured.iter().find(|m| m.structure == name).unwrap().tests_per_ray;
            assert!(tests("1-world-box") <= tests("1b-carried-box"));
            assert!(tests("1-then-3") <= tests("3-object-box") && tests("3-object-box") < tests("none"));
        }
    }
}

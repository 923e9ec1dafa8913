//! The promises of the contract that hold for every structure, because they are kept here.

use core::ops::ControlFlow;
use rt_accel::{
    Aggregate, Bounded, Boxes, BuildError, Counts, Exhaustive, Geometry, Hit, Instance, Invalid, Leaf,
    Member, Primitive, Structure, Visitor, Watch, WorldBound,
};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Transform, Vector};

/// The unit square at some height, met from both sides; remembers nothing.
#[derive(Clone, Copy, Debug)]
struct Square(f64);

impl WorldBound for Square {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        Aabb::from_f64(DVec3::new(0.0, 0.0, self.0), DVec3::new(1.0, 1.0, self.0), origin)
    }
}

impl<R: Real> Primitive<R> for Square {
    type At = ();
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<(), R>> {
        let Ray { origin: o, dir: d, .. } = ray.widen();
        let t = (self.0 - o.z) / d.z;
        let p = o + d * t;
        let inside = (0.0..=1.0).contains(&p.x) && (0.0..=1.0).contains(&p.y);
        ray.admit(t).filter(|_| inside).map(|t| Hit { t, at: () })
    }
}

/// A structure whose every leaf holds every primitive, three times: the worst of repeaters.
#[derive(Debug)]
struct Echo(Vec<u32>);

impl Structure for Echo {
    type Params = ();
    fn build_watched(prims: &dyn Bounded, (): &(), _: Watch<'_>) -> Result<Echo, BuildError> {
        Ok(Echo((0..prims.prim_count() as u32).rev().collect()))
    }
    fn origin(&self) -> DVec3 {
        DVec3::ZERO
    }
    fn local_bound(&self) -> Aabb {
        Aabb::INFINITE
    }
    fn skipped(&self) -> &[u32] {
        &[]
    }
    fn repeats(&self) -> bool {
        true
    }
    fn bytes(&self) -> usize {
        0
    }
    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        for first in 0..3 {
            visit.node();
            if visit.leaf(Leaf { first, prims: &self.0 }, ray).is_break() {
                return;
            }
        }
    }
    fn gather(&self, _: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        each(Leaf { first: 0, prims: &self.0 });
    }
    fn validate(&self, _: &dyn Bounded) -> Result<(), Invalid> {
        Ok(())
    }
}

fn up() -> Ray {
    Ray::new(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z)
}

fn all<R: Real, P: Primitive<R>>(scene: &P, ray: &Ray<R>) -> Vec<R> {
    let mut found = Vec::new();
    let _ = scene.all_hits(ray, &mut |hit| {
        found.push(hit.t);
        ControlFlow::Continue(())
    });
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    found
}

#[test]
fn equal_distances_go_to_the_lowest_number_in_any_order_of_leaves() {
    let squares: Vec<Square> = [3.0, 2.0, 2.0, 2.0, 5.0].map(Square).to_vec();
    let first = Some(Hit { t: 2.0, at: Member { prim: 1, at: () } });
    assert_eq!(Aggregate::<Exhaustive, _>::build(squares.clone(), &()).unwrap().intersect(&up()), first);
    let echo = Aggregate::<Echo, _>::build(squares, &()).unwrap();
    assert_eq!(echo.intersect(&up()), first);
    assert_eq!(echo.intersect_counted(&up(), &mut Counts::default()), first);
    let mut hits = [None; 2];
    echo.intersect_many(&[up(), up().between(4.0, 4.5)], &mut hits);
    assert_eq!(hits, [first, None]);
}

#[test]
fn all_hits_come_once_even_from_structures_that_repeat() {
    let squares: Vec<Square> = [3.0, 2.0, 2.0, 9.0].map(Square).to_vec();
    let echo = Aggregate::<Echo, _>::build(squares, &()).unwrap();
    assert_eq!(all(&echo, &up()), [2.0, 2.0, 3.0, 9.0]);
    assert_eq!(all(&echo, &up().between(2.5, 3.0)), [3.0]);
    let mut heard = 0;
    let flow = echo.all_hits(&up(), &mut |_| {
        heard += 1;
        if heard == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(flow.is_break() && heard == 2);
}

#[test]
fn a_careless_primitive_cannot_spoil_a_query() {
    /// Answers NaN, or beyond the ray.
    struct Careless(f32);
    impl WorldBound for Careless {
        fn world_bound(&self) -> Aabb {
            Aabb::INFINITE
        }
    }
    impl Primitive for Careless {
        type At = ();
        fn intersect(&self, _: &Ray) -> Option<Hit<()>> {
            Some(Hit { t: self.0, at: () })
        }
    }
    let scene = Aggregate::<Exhaustive, _>::build(
        [f32::NAN, -1.0, 7.0, 3.0].map(Careless).into_iter().collect::<Vec<_>>(),
        &(),
    )
    .unwrap();
    assert_eq!(scene.intersect(&up()).map(|hit| (hit.t, hit.at.prim)), Some((3.0, 3)));
    assert_eq!(scene.intersect(&up().between(0.0, 2.0)), None);
}

#[test]
fn instances_keep_t_in_units_of_the_world() {
    let map = Transform::scale(DVec3::new(2.0, 3.0, -1e8))
        .and_then(|t| t.then(&Transform::translation(DVec3::new(0.0, 0.0, 4e8))))
        .unwrap();
    let moved = Instance::new(Square(1.0), map);
    let ray = Ray::new(Vec3A::new(1.9, 2.9, 0.0), Vec3A::Z * 0.5);
    assert_eq!(moved.intersect(&ray).map(|hit| hit.t), Some(6e8));
    assert!(moved.intersect_p(&ray.between(6e8, 6e8)));
    assert!(!moved.intersect_p(&ray.between(0.0, 6e8f32.next_down())));
    let twice = Instance::new(Instance::new(Square(1.0), map), map.inverse());
    assert_eq!(twice.intersect(&up()).map(|hit| hit.t), Some(1.0));
    assert!(twice.world_bound().size().z < 1e-5);
}

#[test]
fn distances_that_tie_after_rounding_tie_inside_instances_too() {
    // In f64 the second is closer; in f32 they are equal, and the first has the lower number.
    let near = 1.0 + 1e-12;
    let squares: Vec<_> = [near, 1.0].map(|z| Instance::new(Square(z), Transform::IDENTITY)).into();
    let scene = Aggregate::<Exhaustive, _>::build(squares, &()).unwrap();
    assert_eq!(scene.intersect(&up()).map(|hit| hit.at.prim), Some(0));
    assert_eq!(scene.intersect(&up().between(0.0, 1.0)).map(|hit| hit.at.prim), Some(0));
    let fine = up().widen();
    assert_eq!(scene.intersect(&fine).map(|hit| hit.at.prim), Some(1));
}

#[test]
fn rays_that_are_not_valid_miss() {
    let scene = Aggregate::<Exhaustive, _>::build(vec![Square(1.0)], &()).unwrap();
    for bad in [
        Ray { dir: Vec3A::ZERO, ..up() },
        Ray { origin: Vec3A::NAN, ..up() },
        Ray { dir: Vec3A::new(0.0, f32::NAN, 1.0), ..up() },
        Ray { dir: Vec3A::INFINITY, ..up() },
        up().between(2.0, 0.0),
        up().between(f32::NAN, 9.0),
    ] {
        assert!(scene.intersect(&bad).is_none() && !scene.intersect_p(&bad) && all(&scene, &bad).is_empty());
    }
}

#[test]
fn nothing_is_a_scene_too() {
    let scene = Aggregate::<Exhaustive, _>::build(Vec::<Square>::new(), &()).unwrap();
    assert!(scene.intersect(&up()).is_none() && scene.world_bound().is_empty());
    let nested = Aggregate::<Exhaustive, _>::build(vec![scene], &()).unwrap();
    assert!(nested.intersect(&up()).is_none());
    assert_eq!(nested.structure().skipped(), [0]);
}

#[test]
fn a_scene_far_away_is_read_from_its_own_middle() {
    let squares: Vec<Square> = (0..4).map(|i| Square(1e9 + i as f64 * 0.001)).collect();
    let boxes = Boxes::read(&squares).unwrap();
    assert!(boxes.origin.z > 9e8 && boxes.world.size().z < 0.0031);
    let near = Boxes::read(&vec![Square(0.0), Square(1.0)]).unwrap();
    assert_eq!(near.origin, DVec3::ZERO);
    let scene = Aggregate::<Exhaustive, _>::build(squares, &()).unwrap();
    let tight = scene.world_bound_from(DVec3::new(0.0, 0.0, 1e9));
    assert!(tight.size().z < 0.004 && tight.min.z <= 0.0 && tight.max.z >= 0.003);
    let hit = scene.intersect(&Ray::new(DVec3::new(0.5, 0.5, 1e9 - 1.0), DVec3::Z)).unwrap();
    assert_eq!((hit.t, hit.at.prim), (1.0, 0));
}

#[test]
fn both_precisions_ask_the_same_scene() {
    fn ask<R: Real>(scene: &impl Primitive<R>) -> f64 {
        let ray = Ray::new(R::Vec3::nearest(DVec3::new(0.25, 0.25, -1.0)), R::Vec3::nearest(DVec3::Z));
        scene.intersect(&ray).map_or(f64::NAN, |hit| hit.t.into())
    }
    let scene = Aggregate::<Exhaustive, _>::build(vec![Square(0.1)], &()).unwrap();
    assert_eq!(ask::<f64>(&scene), 1.1);
    assert_eq!(ask::<f32>(&scene), 1.1f32 as f64);
    // Through pointers and as an object, too.
    let object: std::sync::Arc<dyn Primitive<At = Member<()>>> = std::sync::Arc::new(scene);
    assert_eq!(ask::<f32>(&object), 1.1f32 as f64);
    assert!(Geometry::<f32>::intersect_p(&vec![object], 0, &up()));
}

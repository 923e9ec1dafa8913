//! [`Instance`]: a primitive moved by a transform.

use crate::{Counts, Hit, Primitive, WorldBound};
use core::ops::ControlFlow;
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};

/// A primitive moved by a transform. Ask it with rays of either precision; the primitive inside is asked with `f64`.
///
/// The ray is carried back by the `f64` inverse, translation first, and not normalised: `t` is in world units throughout and
/// is rounded once, to the precision of the asking ray. In `f32` an inverse with a stretch of `1e8` would miss four hits in
/// five. Share what is inside with an `Arc`; instances nest to any depth. A primitive of one's own can be moved when it answers
/// `f64`: write `impl<R: Real> Primitive<R> for Mine`, which serves both.
///
/// An instance is found in its world bound: the box of what is inside, carried vertex by vertex where that is known
/// ([`WorldBound::bound_under`]). Whether a ray meets that box is decided exactly, and hits are held within it, so that every
/// structure finds the same: none can pass over a box whose ray is known to meet it.
///
/// Error: the ray inside is off by some `2^-53` of its distance from the instance, times the condition of the transform; what
/// is inside decides exactly about that ray. From beyond about `10^7` times the size of a turned instance, hits within that
/// error of its outline may be lost or made up, by all structures alike.
///
/// ```
/// use rt_accel::{Instance, Primitive};
/// # use rt_accel::{Hit, WorldBound};
/// # use rt_bounds::{Aabb, DAabb};
/// # use rt_geom::{Ray, Transform, glam::{DVec3, Vec3A}};
/// # struct Unit;
/// # impl WorldBound for Unit { fn world_bound(&self) -> Aabb { Aabb::new(Vec3A::NEG_ONE.with_z(0.0), Vec3A::ONE.with_z(0.0)) } }
/// # impl Primitive<f64> for Unit {
/// #     type At = ();
/// #     fn intersect(&self, ray: &Ray<f64>) -> Option<Hit<(), f64>> {
/// #         ray.admit(-ray.origin.z / ray.dir.z).map(|t| Hit { t, at: () })
/// #     }
/// # }
/// let raised = Instance::new(Unit, Transform::translation(DVec3::new(0.0, 0.0, 5.0)));
/// let hit = raised.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
/// assert_eq!(hit.t, 5.0);
/// ```
#[derive(Clone, Debug)]
pub struct Instance<P> {
    inner: P,
    to_world: Transform,
    to_object: Transform,
    /// Around all of it in the world.
    bound: DAabb,
}

impl<P: WorldBound> Instance<P> {
    /// `inner`, moved from its own space to the world by `to_world`, in the box of what is inside carried there.
    ///
    /// Of an aggregate this opens the part of its tree that may lie at the outline; of an exhaustive one all.
    pub fn new(inner: P, to_world: Transform) -> Instance<P> {
        let bound = inner.bound_under(&to_world);
        Instance { inner, to_world, to_object: to_world.inverse(), bound }
    }

    /// The same, in the box of the carried box of what is inside: `O(1)`, for instances that move before many rays have met them.
    /// Looser where what is inside leaves the corners of its own box empty: 3.3 times the surface for turned octahedra.
    pub fn boxed(inner: P, to_world: Transform) -> Instance<P> {
        let bound = inner.world_bound().carried(&to_world);
        Instance { inner, to_world, to_object: to_world.inverse(), bound }
    }
}

impl<P> Instance<P> {
    /// What is moved.
    pub fn inner(&self) -> &P {
        &self.inner
    }

    /// The way from its own space to the world.
    pub fn to_world(&self) -> &Transform {
        &self.to_world
    }

    /// The ray in the space of [`Instance::inner`]; `t` keeps its meaning.
    ///
    /// Its far end reaches as far as numbers that round to the asking ray's far end, so that distances that tie after
    /// rounding still tie.
    #[inline]
    pub fn object_ray<R: Real>(&self, ray: &Ray<R>) -> Ray<f64> {
        Ray { t_max: ray.t_max.reach(), ..self.to_object.ray(ray) }
    }

    /// The ray inside and where it may hit, if it meets the world bound.
    #[inline(always)]
    fn enter<R: Real>(&self, ray: &Ray<R>) -> Option<(Ray<f64>, Held)> {
        let (start, reach) = (ray.t_min.into(), ray.t_max.reach());
        // Of the whole line, so that a ray that ends at a hit held in the box does not end before the box.
        let line = Ray { t_min: f64::NEG_INFINITY, t_max: f64::INFINITY, ..ray.widen() };
        let [near, far] = self.bound.span(&line)?;
        if !(start <= reach && start <= far && near <= reach) {
            return None;
        }
        let mut inside = self.to_object.ray(ray);
        // A ray that ends behind the box ends nowhere: what is hit then does not depend on where exactly it ends.
        inside.t_max = if far <= reach { f64::INFINITY } else { reach };
        Some((inside, Held { near, far, t_min: start }))
    }
}

/// Where hits of an instance lie: in its world bound.
struct Held {
    near: f64,
    far: f64,
    t_min: f64,
}

impl Held {
    /// `t`, if it is there, else the end that it missed by a rounding of the ray inside. NaN stays NaN.
    #[inline(always)]
    fn hold(&self, t: f64) -> f64 {
        match t {
            t if t < self.near => self.near.max(self.t_min),
            t if t > self.far => self.far.max(self.t_min),
            t => t,
        }
    }
}

impl<P: WorldBound> WorldBound for Instance<P> {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.bound.relative_to(origin)
    }
    fn bound_under(&self, map: &Transform) -> DAabb {
        match self.to_world.then(map) {
            Ok(both) => self.inner.bound_under(&both),
            Err(_) => self.world_bound().carried(map),
        }
    }
}

impl<R: Real, P: Primitive<f64>> Primitive<R> for Instance<P> {
    type At = P::At;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<P::At, R>> {
        let (inside, held) = self.enter(ray)?;
        let hit = self.inner.intersect(&inside)?;
        Some(Hit { t: ray.admit(held.hold(hit.t))?, at: hit.at })
    }
    #[inline]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.enter(ray).is_some_and(|(inside, _)| self.inner.intersect_p(&inside))
    }
    fn all_hits(
        &self,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<P::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Some((inside, held)) = self.enter(ray) else { return ControlFlow::Continue(()) };
        self.inner.all_hits(&inside, &mut |hit| match ray.admit(held.hold(hit.t)) {
            Some(t) => each(Hit { t, at: hit.at }),
            None => ControlFlow::Continue(()),
        })
    }
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<P::At, R>> {
        let (inside, held) = self.enter(ray)?;
        let hit = self.inner.intersect_counted(&inside, counts)?;
        Some(Hit { t: ray.admit(held.hold(hit.t))?, at: hit.at })
    }
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        self.enter(ray).is_some_and(|(inside, _)| self.inner.intersect_p_counted(&inside, counts))
    }
}

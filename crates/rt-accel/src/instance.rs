//! [`Instance`]: a primitive moved by a transform.

use crate::{Counts, Hit, Primitive, WorldBound};
use core::ops::ControlFlow;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};

/// A primitive moved by a transform. Ask it with rays of either precision; the primitive inside is asked with `f64`.
///
/// The ray is carried back by the `f64` inverse, translation first, and not normalised: `t` is in world units throughout and
/// is rounded once, to the precision of the asking ray. In `f32` an inverse with a stretch of `1e8` would miss four hits in
/// five. Share what is inside with an `Arc`; instances nest to any depth. A primitive of one's own can be moved when it answers
/// `f64`: write `impl<R: Real> Primitive<R> for Mine`, which serves both.
///
/// Error: the ray inside is off by some `2^-53` of its distance from the instance, times the condition of the transform; what
/// is inside decides exactly about that ray. From beyond about `10^7` times the size of a turned instance, hits within that
/// error of its outline may be found or not, depending on the boxes above.
///
/// ```
/// use rt_accel::{Instance, Primitive};
/// # use rt_accel::{Hit, WorldBound};
/// # use rt_bounds::Aabb;
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
}

impl<P> Instance<P> {
    /// `inner`, moved from its own space to the world by `to_world`.
    pub fn new(inner: P, to_world: Transform) -> Instance<P> {
        Instance { inner, to_world, to_object: to_world.inverse() }
    }

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
}

impl<P: WorldBound> WorldBound for Instance<P> {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.inner.world_bound().transformed(&self.to_world, origin)
    }
}

impl<R: Real, P: Primitive<f64>> Primitive<R> for Instance<P> {
    type At = P::At;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<P::At, R>> {
        let hit = self.inner.intersect(&self.object_ray(ray))?;
        Some(Hit { t: ray.admit(hit.t)?, at: hit.at })
    }
    #[inline]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.inner.intersect_p(&self.object_ray(ray))
    }
    fn all_hits(
        &self,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<P::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.inner.all_hits(&self.object_ray(ray), &mut |hit| match ray.admit(hit.t) {
            Some(t) => each(Hit { t, at: hit.at }),
            None => ControlFlow::Continue(()),
        })
    }
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<P::At, R>> {
        let hit = self.inner.intersect_counted(&self.object_ray(ray), counts)?;
        Some(Hit { t: ray.admit(hit.t)?, at: hit.at })
    }
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        self.inner.intersect_p_counted(&self.object_ray(ray), counts)
    }
}

//! [`Guarded`]: a primitive behind a volume.

use crate::{Counts, Hit, Primitive, WorldBound};
use core::ops::ControlFlow;
use rt_bounds::{Aabb, BoundingVolume, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};

/// A primitive that is asked only by rays that meet a volume around it.
///
/// It pays where `c_b < (1 - p) c_o`: the volume's test costs less than the primitive's, times the share of rays that miss the
/// volume. An aggregate needs none, its root is one; within an [`Instance`](crate::Instance), whose own box lies in world space, a
/// costly primitive that is slender and turned does. Answers are those of the primitive, as long as the volume holds it.
///
/// Source: Weghorst, Hooper, Greenberg, "Improved computational methods for ray tracing", ACM Transactions on Graphics 3(1)
/// (1984).
///
/// ```
/// use rt_accel::{Guarded, Primitive};
/// # use rt_accel::{Hit, WorldBound};
/// # use rt_bounds::Aabb;
/// # use rt_geom::{Ray, glam::Vec3A};
/// # struct Costly;
/// # impl WorldBound for Costly { fn world_bound(&self) -> Aabb { Aabb::new(Vec3A::ZERO, Vec3A::ONE) } }
/// # impl Primitive for Costly {
/// #     type At = ();
/// #     fn intersect(&self, _: &Ray) -> Option<Hit<()>> { panic!("not asked") }
/// # }
/// let guarded = Guarded::boxed(Costly);
/// assert!(!guarded.intersect_p(&Ray::new(Vec3A::splat(2.0), Vec3A::Z)));
/// ```
#[derive(Clone, Debug)]
pub struct Guarded<P, V = Aabb> {
    inner: P,
    volume: V,
    aabb: Aabb,
}

impl<P: WorldBound> Guarded<P> {
    /// `inner` in its own box.
    pub fn boxed(inner: P) -> Guarded<P> {
        let volume = inner.world_bound();
        Guarded { inner, volume, aabb: volume }
    }
}

impl<P, V: BoundingVolume> Guarded<P, V> {
    /// `inner` in a volume, given relative to zero, that holds all of it; of what it does not hold, hits are lost.
    pub fn new(inner: P, volume: V) -> Guarded<P, V> {
        let aabb = volume.aabb();
        Guarded { inner, volume, aabb }
    }

    /// What is guarded.
    pub fn inner(&self) -> &P {
        &self.inner
    }

    /// The volume.
    pub fn volume(&self) -> &V {
        &self.volume
    }

    #[inline(always)]
    fn admits<R: Real>(&self, ray: &Ray<R>) -> bool {
        ray.is_valid() && self.volume.entry(&V::ready(ray, DVec3::ZERO, &self.aabb)).is_some()
    }
}

impl<P: WorldBound, V: Send + Sync> WorldBound for Guarded<P, V> {
    fn world_bound(&self) -> Aabb {
        self.inner.world_bound()
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.inner.world_bound_from(origin)
    }
    fn bound_under(&self, map: &Transform) -> DAabb {
        self.inner.bound_under(map)
    }
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        self.inner.clipped_bound(cell, origin)
    }
    fn outline(&self, origin: DVec3) -> Option<[DVec3; 3]> {
        self.inner.outline(origin)
    }
}

impl<R: Real, P: Primitive<R>, V: BoundingVolume + Send + Sync> Primitive<R> for Guarded<P, V> {
    type At = P::At;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<P::At, R>> {
        if self.admits(ray) { self.inner.intersect(ray) } else { None }
    }
    #[inline]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.admits(ray) && self.inner.intersect_p(ray)
    }
    fn all_hits(
        &self,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<P::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if self.admits(ray) { self.inner.all_hits(ray, each) } else { ControlFlow::Continue(()) }
    }
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<P::At, R>> {
        if self.admits(ray) { self.inner.intersect_counted(ray, counts) } else { None }
    }
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        self.admits(ray) && self.inner.intersect_p_counted(ray, counts)
    }
}

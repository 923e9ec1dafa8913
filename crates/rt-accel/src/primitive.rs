//! [`Primitive`] and [`Hit`]: one thing that a ray can hit.

use crate::Counts;
use core::ops::ControlFlow;
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use std::sync::Arc;

/// A ray met something at `t`, in lengths of its direction; `at` says where, in the words of what was hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit<A, R: Real = f32> {
    /// The distance, in lengths of the ray's direction.
    pub t: R,
    /// Where on the thing that was hit.
    pub at: A,
}

/// Something with a place in the world.
pub trait WorldBound: Send + Sync {
    /// A box around all of it, in world space, rounded outward.
    fn world_bound(&self) -> Aabb;

    /// The same box relative to `origin`. The default subtracts; things kept in `f64` do better.
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.world_bound().relative_to(origin)
    }

    /// A box around all of it once carried by `map`, with [room](DAabb::room) for roundings. The default carries the world
    /// bound, which is loose for what is turned; whoever can carry vertices, or knows better, says better.
    fn bound_under(&self, map: &Transform) -> DAabb {
        self.world_bound().carried(map)
    }

    /// A box around the part of it inside `cell`, both relative to `origin`; empty where nothing is. The default cuts the box.
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        self.world_bound_from(origin).overlap(*cell)
    }
    /// The corners of a triangle that holds all of it, relative to `origin`, each coordinate rounded once; `None`, as the
    /// default says, where a box must do. Structures that split space by the primitives' own planes ask for it.
    fn outline(&self, _origin: DVec3) -> Option<[DVec3; 3]> {
        None
    }
}

/// Something a ray can hit, from any thread, in world space, by rays of precision `R`.
///
/// Object-safe. One method is required; `Vec<Mine>` then works in every structure.
///
/// A hit's `t` lies in the ray's closed interval ([`Ray::admit`] sees to it) and is within one unit in the last place of a
/// point inside the [world bound](WorldBound::world_bound): structures pass over boxes beyond the closest hit so far.
pub trait Primitive<R: Real = f32>: WorldBound {
    /// Where a hit is, beyond its distance.
    type At: Copy;

    /// The closest hit.
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Self::At, R>>;

    /// Whether there is any hit: `intersect(ray).is_some()`, sooner.
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.intersect(ray).is_some()
    }

    /// Every hit, in no order, each once. The default reports the closest only: override it where a ray may meet the thing
    /// more than once.
    ///
    /// Hits are counted as crossings: a boundary that the ray meets exactly is owned by one side, so on the rim of an open
    /// surface there may be a closest hit and no crossing.
    fn all_hits(
        &self,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<Self::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        match self.intersect(ray) {
            Some(hit) => each(hit),
            None => ControlFlow::Continue(()),
        }
    }

    /// The closest hit of each ray, bit for bit as [`Primitive::intersect`] finds it.
    ///
    /// # Panics
    ///
    /// When `hits` is shorter than `rays`.
    fn intersect_many(&self, rays: &[Ray<R>], hits: &mut [Option<Hit<Self::At, R>>]) {
        let hits = &mut hits[..rays.len()];
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect(ray);
        }
    }

    /// Whether each ray hits anything, as [`Primitive::intersect_p`] says.
    ///
    /// # Panics
    ///
    /// When `hits` is shorter than `rays`.
    fn intersect_p_many(&self, rays: &[Ray<R>], hits: &mut [bool]) {
        let hits = &mut hits[..rays.len()];
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect_p(ray);
        }
    }

    /// [`Primitive::intersect`], adding its work to `counts`.
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Self::At, R>> {
        counts.prims += 1;
        self.intersect(ray)
    }

    /// [`Primitive::intersect_p`], adding its work to `counts`.
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        counts.prims += 1;
        self.intersect_p(ray)
    }
}

/// Forwards both traits through a pointer, so that static and dynamic dispatch are one trait.
macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<P: WorldBound + ?Sized> WorldBound for $pointer {
            #[inline]
            fn world_bound(&self) -> Aabb {
                (**self).world_bound()
            }
            #[inline]
            fn world_bound_from(&self, origin: DVec3) -> Aabb {
                (**self).world_bound_from(origin)
            }
            fn bound_under(&self, map: &Transform) -> DAabb {
                (**self).bound_under(map)
            }
            fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
                (**self).clipped_bound(cell, origin)
            }
            fn outline(&self, origin: DVec3) -> Option<[DVec3; 3]> {
                (**self).outline(origin)
            }
        }

        impl<R: Real, P: Primitive<R> + ?Sized> Primitive<R> for $pointer {
            type At = P::At;
            #[inline]
            fn intersect(&self, ray: &Ray<R>) -> Option<Hit<P::At, R>> {
                (**self).intersect(ray)
            }
            #[inline]
            fn intersect_p(&self, ray: &Ray<R>) -> bool {
                (**self).intersect_p(ray)
            }
            fn all_hits(
                &self,
                ray: &Ray<R>,
                each: &mut dyn FnMut(Hit<P::At, R>) -> ControlFlow<()>,
            ) -> ControlFlow<()> {
                (**self).all_hits(ray, each)
            }
            fn intersect_many(&self, rays: &[Ray<R>], hits: &mut [Option<Hit<P::At, R>>]) {
                (**self).intersect_many(rays, hits)
            }
            fn intersect_p_many(&self, rays: &[Ray<R>], hits: &mut [bool]) {
                (**self).intersect_p_many(rays, hits)
            }
            fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<P::At, R>> {
                (**self).intersect_counted(ray, counts)
            }
            fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
                (**self).intersect_p_counted(ray, counts)
            }
        }
    )*};
}

forward!(&P, Box<P>, Arc<P>);

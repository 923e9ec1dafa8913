//! [`Bounded`] and [`Geometry`]: numbered primitives, as builders and leaves see them.

use crate::{Counts, Hit, Primitive};
use core::ops::ControlFlow;
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use std::sync::Arc;

/// Numbered primitives with bounds: all a builder may know. A number that does not exist has a bound that is not valid, and is
/// never hit: structures outlive changes to what they were built over.
pub trait Bounded: Send + Sync {
    /// How many primitives there are; they are numbered from 0.
    fn prim_count(&self) -> usize;

    /// A box around primitive `prim`, rounded outward. A box that is [not valid](Aabb::is_valid) leaves the primitive out.
    fn bound(&self, prim: u32) -> Aabb;

    /// The same box relative to `origin`. The default subtracts; geometry kept in `f64` does better.
    fn bound_from(&self, prim: u32, origin: DVec3) -> Aabb {
        self.bound(prim).relative_to(origin)
    }

    /// A box around `prim` once carried by `map`, as [`WorldBound::bound_under`](crate::WorldBound::bound_under). The default
    /// carries the box.
    fn bound_under(&self, prim: u32, map: &Transform) -> DAabb {
        self.bound(prim).carried(map)
    }

    /// A box around the part of `prim` inside `cell`, both relative to `origin`. The default cuts the box.
    fn clipped_bound(&self, prim: u32, cell: &Aabb, origin: DVec3) -> Aabb {
        self.bound_from(prim, origin).overlap(*cell)
    }

    /// The corners of a triangle that holds all of `prim`, relative to `origin`, each coordinate rounded once; `None`, as the
    /// default says, where a box must do. For builders that split space by the primitives' own planes.
    fn outline(&self, _prim: u32, _origin: DVec3) -> Option<[DVec3; 3]> {
        None
    }
}

/// What of a primitive counts in a cell: a knob of structures that divide space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clip {
    /// The part of it that lies in the cell ([`Bounded::clipped_bound`]): exact for triangles and
    /// polygons, and for spheres, cones and cylinders whether there is any.
    Exact,
    /// The part of its box. Builds faster, and cells have more references.
    Box,
}

/// The primitive numbers of one leaf.
///
/// `first` names the leaf: no two leaves share it, and it stays below the number of references.
#[derive(Clone, Copy, Debug)]
pub struct Leaf<'a> {
    /// The leaf's name.
    pub first: u32,
    /// The primitives in it.
    pub prims: &'a [u32],
}

/// Number `prim` of a list was hit, `at` there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member<A> {
    /// The number in the list.
    pub prim: u32,
    /// Where on that member.
    pub at: A,
}

/// Numbered primitives that rays of precision `R` can hit.
pub trait Geometry<R: Real = f32>: Bounded {
    /// Where a hit is, beyond its distance; says which primitive, if anyone shall know.
    type At: Copy;

    /// The closest hit on `prim`, in the ray's closed interval.
    fn intersect(&self, prim: u32, ray: &Ray<R>) -> Option<Hit<Self::At, R>>;

    /// Whether the ray hits `prim` at all.
    fn intersect_p(&self, prim: u32, ray: &Ray<R>) -> bool {
        self.intersect(prim, ray).is_some()
    }

    /// Every hit on `prim`. Where primitives share a boundary that the ray meets exactly, one of them owns the hit by a fixed
    /// rule, so that the crossings of a closed surface are counted right; on the rim of an open one that may leave none.
    fn all_hits(
        &self,
        prim: u32,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<Self::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        match self.intersect(prim, ray) {
            Some(hit) => each(hit),
            None => ControlFlow::Continue(()),
        }
    }

    /// The closest hit in a leaf, and of whom; the lowest number of equals. Shortens `ray.t_max` to it. Override to test many
    /// at once.
    #[inline]
    fn intersect_leaf(&self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> Option<Hit<Member<Self::At>, R>> {
        let mut best = None;
        for &prim in leaf.prims {
            keep_closest(&mut best, ray, prim, self.intersect(prim, ray));
        }
        best
    }

    /// Whether anything in a leaf is hit.
    #[inline]
    fn intersect_p_leaf(&self, leaf: Leaf<'_>, ray: &Ray<R>) -> bool {
        leaf.prims.iter().any(|&prim| self.intersect_p(prim, ray))
    }

    /// [`Geometry::intersect`], adding its work to `counts`.
    fn intersect_counted(&self, prim: u32, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Self::At, R>> {
        counts.prims += 1;
        self.intersect(prim, ray)
    }

    /// [`Geometry::intersect_p`], adding its work to `counts`.
    fn intersect_p_counted(&self, prim: u32, ray: &Ray<R>, counts: &mut Counts) -> bool {
        counts.prims += 1;
        self.intersect_p(prim, ray)
    }
}

/// The closest hit so far, and of whom.
pub(crate) type Best<A, R> = Option<Hit<Member<A>, R>>;

/// Puts `found` in the place of `best` if it is closer, or as close and lower in number; shortens the ray. A hit outside the
/// ray's interval, or with a NaN for a distance, is not taken: that guards queries against careless primitives.
#[inline(always)]
pub(crate) fn keep_closest<A: Copy, R: Real>(
    best: &mut Best<A, R>,
    ray: &mut Ray<R>,
    prim: u32,
    found: Option<Hit<A, R>>,
) {
    if let Some(hit) = found
        && ray.contains(hit.t)
        && best.is_none_or(|b| hit.t < b.t || prim < b.at.prim)
    {
        ray.t_max = hit.t;
        *best = Some(Hit { t: hit.t, at: Member { prim, at: hit.at } });
    }
}

impl<P: crate::WorldBound> Bounded for Vec<P> {
    fn prim_count(&self) -> usize {
        self.len()
    }
    fn bound(&self, prim: u32) -> Aabb {
        self.get(prim as usize).map_or(Aabb::EMPTY, |member| member.world_bound())
    }
    fn bound_from(&self, prim: u32, origin: DVec3) -> Aabb {
        self.get(prim as usize).map_or(Aabb::EMPTY, |member| member.world_bound_from(origin))
    }
    fn bound_under(&self, prim: u32, map: &Transform) -> DAabb {
        self.get(prim as usize).map_or(DAabb::EMPTY, |member| member.bound_under(map))
    }
    fn clipped_bound(&self, prim: u32, cell: &Aabb, origin: DVec3) -> Aabb {
        self.get(prim as usize).map_or(Aabb::EMPTY, |member| member.clipped_bound(cell, origin))
    }
    fn outline(&self, prim: u32, origin: DVec3) -> Option<[DVec3; 3]> {
        self.get(prim as usize)?.outline(origin)
    }
}

impl<R: Real, P: Primitive<R>> Geometry<R> for Vec<P> {
    type At = Member<P::At>;

    #[inline]
    fn intersect(&self, prim: u32, ray: &Ray<R>) -> Option<Hit<Self::At, R>> {
        member(prim, self.get(prim as usize)?.intersect(ray))
    }
    #[inline]
    fn intersect_p(&self, prim: u32, ray: &Ray<R>) -> bool {
        self.get(prim as usize).is_some_and(|member| member.intersect_p(ray))
    }
    fn all_hits(
        &self,
        prim: u32,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<Self::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut named = |hit: Hit<P::At, R>| each(Hit { t: hit.t, at: Member { prim, at: hit.at } });
        self.get(prim as usize).map_or(ControlFlow::Continue(()), |member| member.all_hits(ray, &mut named))
    }
    fn intersect_counted(&self, prim: u32, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Self::At, R>> {
        member(prim, self.get(prim as usize)?.intersect_counted(ray, counts))
    }
    fn intersect_p_counted(&self, prim: u32, ray: &Ray<R>, counts: &mut Counts) -> bool {
        self.get(prim as usize).is_some_and(|member| member.intersect_p_counted(ray, counts))
    }
}

#[inline(always)]
fn member<A, R: Real>(prim: u32, hit: Option<Hit<A, R>>) -> Option<Hit<Member<A>, R>> {
    hit.map(|hit| Hit { t: hit.t, at: Member { prim, at: hit.at } })
}

/// Forwards both traits through a pointer, so that several structures share one geometry.
macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<G: Bounded + ?Sized> Bounded for $pointer {
            fn prim_count(&self) -> usize {
                (**self).prim_count()
            }
            #[inline]
            fn bound(&self, prim: u32) -> Aabb {
                (**self).bound(prim)
            }
            #[inline]
            fn bound_from(&self, prim: u32, origin: DVec3) -> Aabb {
                (**self).bound_from(prim, origin)
            }
            fn clipped_bound(&self, prim: u32, cell: &Aabb, origin: DVec3) -> Aabb {
                (**self).clipped_bound(prim, cell, origin)
            }
            fn bound_under(&self, prim: u32, map: &Transform) -> DAabb {
                (**self).bound_under(prim, map)
            }
            fn outline(&self, prim: u32, origin: DVec3) -> Option<[DVec3; 3]> {
                (**self).outline(prim, origin)
            }
        }

        impl<R: Real, G: Geometry<R> + ?Sized> Geometry<R> for $pointer {
            type At = G::At;
            #[inline(always)]
            fn intersect(&self, prim: u32, ray: &Ray<R>) -> Option<Hit<G::At, R>> {
                (**self).intersect(prim, ray)
            }
            #[inline(always)]
            fn intersect_p(&self, prim: u32, ray: &Ray<R>) -> bool {
                (**self).intersect_p(prim, ray)
            }
            fn all_hits(
                &self,
                prim: u32,
                ray: &Ray<R>,
                each: &mut dyn FnMut(Hit<G::At, R>) -> ControlFlow<()>,
            ) -> ControlFlow<()> {
                (**self).all_hits(prim, ray, each)
            }
            #[inline(always)]
            fn intersect_leaf(&self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> Option<Hit<Member<G::At>, R>> {
                (**self).intersect_leaf(leaf, ray)
            }
            #[inline(always)]
            fn intersect_p_leaf(&self, leaf: Leaf<'_>, ray: &Ray<R>) -> bool {
                (**self).intersect_p_leaf(leaf, ray)
            }
            fn intersect_counted(
                &self,
                prim: u32,
                ray: &Ray<R>,
                counts: &mut Counts,
            ) -> Option<Hit<G::At, R>> {
                (**self).intersect_counted(prim, ray, counts)
            }
            fn intersect_p_counted(&self, prim: u32, ray: &Ray<R>, counts: &mut Counts) -> bool {
                (**self).intersect_p_counted(prim, ray, counts)
            }
        }
    )*};
}

forward!(&G, Arc<G>);

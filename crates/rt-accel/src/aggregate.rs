//! [`Aggregate`]: a geometry arranged by a structure, and the queries, once for all structures.

use crate::geometry::{Best, keep_closest};
use crate::{
    Bounded, BuildError, Counts, Feed, Geometry, Hit, Leaf, Primitive, Refit, Structure, Visitor, Watch,
    WorldBound, unwatched,
};
use core::cell::Cell;
use core::ops::ControlFlow;
use rt_bounds::{Aabb, DAabb};
use rt_geom::expansion::two_sum;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use std::collections::HashSet;

/// A geometry arranged by a structure; itself a [`Primitive`], so scenes nest.
///
/// The answers do not depend on the structure: equal hits, bit for bit, ties to the lowest primitive number.
#[derive(Clone, Debug)]
pub struct Aggregate<S, G> {
    structure: S,
    geometry: G,
}

impl<S: Structure, G: Bounded> Aggregate<S, G> {
    /// Builds a structure over `geometry`.
    ///
    /// # Errors
    ///
    /// See [`BuildError`].
    pub fn build(geometry: G, params: &S::Params) -> Result<Self, BuildError> {
        Self::build_watched(geometry, params, &mut unwatched)
    }

    /// [`Aggregate::build`], heard by `watch`, which may cancel it.
    ///
    /// # Errors
    ///
    /// See [`BuildError`].
    pub fn build_watched(geometry: G, params: &S::Params, watch: Watch<'_>) -> Result<Self, BuildError> {
        let structure = S::build_watched(&geometry, params, watch)?;
        Ok(Aggregate { structure, geometry })
    }

    /// Builds over `source`, then lets it be rearranged to suit the structure's leaves.
    ///
    /// # Errors
    ///
    /// See [`BuildError`].
    pub fn arrange<B: Bounded>(
        source: B,
        params: &S::Params,
        into: impl FnOnce(B, &S) -> G,
    ) -> Result<Self, BuildError> {
        let structure = S::build(&source, params)?;
        let geometry = into(source, &structure);
        Ok(Aggregate { structure, geometry })
    }
}

impl<S: Structure, G> Aggregate<S, G> {
    /// The structure.
    pub fn structure(&self) -> &S {
        &self.structure
    }

    /// The geometry.
    pub fn geometry(&self) -> &G {
        &self.geometry
    }
}

impl<S: Refit, G: Bounded> Aggregate<S, G> {
    /// Changes the geometry, then refits the structure to it. Primitives that are added are not found before the next build;
    /// see [`Refit::refit`].
    pub fn update(&mut self, change: impl FnOnce(&mut G)) {
        change(&mut self.geometry);
        self.structure.refit(&self.geometry);
    }
}

impl<S: Structure, G: Bounded> WorldBound for Aggregate<S, G> {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }

    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let local = self.structure.local_bound();
        let shift = origin - self.structure.origin();
        let bound = local.relative_to(shift);
        // The difference of two origins may itself have been rounded.
        let own = self.structure.origin();
        let exact = (0..3).all(|a| two_sum(origin[a], -own[a]).1 == 0.0);
        if exact || !local.is_valid() {
            return bound;
        }
        let slack = DVec3::splat((origin.abs() + own.abs()).max_element() * f64::EPSILON);
        Aabb::from_f64(bound.min.as_dvec3() - slack, bound.max.as_dvec3() + slack, DVec3::ZERO)
    }

    /// The box of all primitives' carried boxes. Only nodes that may reach beyond what has been found are opened: of a tree over
    /// `n` primitives a small part, of [`Exhaustive`](crate::Exhaustive) all.
    fn bound_under(&self, map: &Transform) -> DAabb {
        let found = Cell::new(DAabb::EMPTY);
        // Room twice more, which is more than any primitive's own: what is in a node that is not opened could not have made the
        // box larger by a rounding.
        let mut keep = |node: &Aabb| {
            let here = DAabb::from(*node);
            !found.get().contains(node.carried(map).room(here, map).room(here, map))
        };
        let mut each = |leaf: Leaf<'_>| {
            for &prim in leaf.prims {
                let bound = self.geometry.bound_under(prim, map);
                if bound.min.cmple(bound.max).all() {
                    found.set(found.get().union(bound));
                }
            }
        };
        self.structure.gather(&mut keep, &mut each);
        found.get()
    }
}

impl<R: Real, S: Structure, G: Geometry<R>> Primitive<R> for Aggregate<S, G> {
    type At = G::At;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<G::At, R>> {
        let mut closest = Closest { geometry: &self.geometry, best: None };
        self.structure.traverse(&mut { *ray }, &mut closest);
        closest.found()
    }

    #[inline]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        let mut any = Any { geometry: &self.geometry, found: false };
        self.structure.traverse_any(&mut { *ray }, &mut any);
        any.found
    }

    fn all_hits(
        &self,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<G::At, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let seen = self.structure.repeats().then(HashSet::new);
        let mut all = All { geometry: &self.geometry, each, seen, flow: ControlFlow::Continue(()) };
        self.structure.traverse(&mut { *ray }, &mut all);
        all.flow
    }

    fn intersect_many(&self, rays: &[Ray<R>], hits: &mut [Option<Hit<G::At, R>>]) {
        let hits = &mut hits[..rays.len()];
        let geometry = &self.geometry;
        let mut batch = Batch {
            rays,
            next: 0,
            visitor: |at| Numbered { at, visitor: Closest { geometry, best: None } },
            done: |seat: Numbered<Closest<'_, G, G::At, R>>| hits[seat.at as usize] = seat.visitor.found(),
        };
        self.structure.traverse_many(&mut batch);
    }

    fn intersect_p_many(&self, rays: &[Ray<R>], hits: &mut [bool]) {
        let hits = &mut hits[..rays.len()];
        let geometry = &self.geometry;
        let mut batch = Batch {
            rays,
            next: 0,
            visitor: |at| Numbered { at, visitor: Any { geometry, found: false } },
            done: |seat: Numbered<Any<'_, G>>| hits[seat.at as usize] = seat.visitor.found,
        };
        self.structure.traverse_many(&mut batch);
    }

    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<G::At, R>> {
        let mut counted = CountedClosest { geometry: &self.geometry, best: None, counts };
        self.structure.traverse(&mut { *ray }, &mut counted);
        counted.best.map(|hit| Hit { t: hit.t, at: hit.at.at })
    }

    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        let mut counted = CountedAny { geometry: &self.geometry, found: false, counts };
        self.structure.traverse_any(&mut { *ray }, &mut counted);
        counted.found
    }
}

/// Keeps the closest hit.
struct Closest<'a, G, A, R: Real> {
    geometry: &'a G,
    best: Best<A, R>,
}

impl<G, A, R: Real> Closest<'_, G, A, R> {
    #[inline(always)]
    fn found(self) -> Option<Hit<A, R>> {
        self.best.map(|hit| Hit { t: hit.t, at: hit.at.at })
    }
}

impl<R: Real, G: Geometry<R>> Visitor<R> for Closest<'_, G, G::At, R> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        if let Some(hit) = self.geometry.intersect_leaf(leaf, ray)
            && self.best.is_none_or(|best| hit.t < best.t || hit.at.prim < best.at.prim)
        {
            self.best = Some(hit);
        }
        ControlFlow::Continue(())
    }
}

/// Stops at the first hit.
struct Any<'a, G> {
    geometry: &'a G,
    found: bool,
}

impl<R: Real, G: Geometry<R>> Visitor<R> for Any<'_, G> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        self.found = self.geometry.intersect_p_leaf(leaf, ray);
        if self.found { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Reports every hit of every primitive, each primitive once.
struct All<'a, G, A, R: Real> {
    geometry: &'a G,
    each: &'a mut dyn FnMut(Hit<A, R>) -> ControlFlow<()>,
    seen: Option<HashSet<u32>>,
    flow: ControlFlow<()>,
}

impl<R: Real, G: Geometry<R>> Visitor<R> for All<'_, G, G::At, R> {
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        for &prim in leaf.prims {
            if self.seen.as_mut().is_none_or(|seen| seen.insert(prim)) {
                self.flow = self.geometry.all_hits(prim, ray, self.each);
                if self.flow.is_break() {
                    break;
                }
            }
        }
        self.flow
    }
}

/// [`Closest`], one primitive after another, with counts.
struct CountedClosest<'a, G, A, R: Real> {
    geometry: &'a G,
    best: Best<A, R>,
    counts: &'a mut Counts,
}

impl<R: Real, G: Geometry<R>> Visitor<R> for CountedClosest<'_, G, G::At, R> {
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        self.counts.leaves += 1;
        for &prim in leaf.prims {
            let found = self.geometry.intersect_counted(prim, ray, self.counts);
            keep_closest(&mut self.best, ray, prim, found);
        }
        ControlFlow::Continue(())
    }
    fn node(&mut self) {
        self.counts.nodes += 1;
    }
    fn spared(&mut self) {
        self.counts.spared += 1;
    }
}

/// [`Any`], with counts.
struct CountedAny<'a, G> {
    geometry: &'a G,
    found: bool,
    counts: &'a mut Counts,
}

impl<R: Real, G: Geometry<R>> Visitor<R> for CountedAny<'_, G> {
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        self.counts.leaves += 1;
        for &prim in leaf.prims {
            if self.geometry.intersect_p_counted(prim, ray, self.counts) {
                self.found = true;
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }
    fn node(&mut self) {
        self.counts.nodes += 1;
    }
    fn spared(&mut self) {
        self.counts.spared += 1;
    }
}

/// A visitor that knows whose ray it walks with.
struct Numbered<V> {
    at: u32,
    visitor: V,
}

impl<R: Real, V: Visitor<R>> Visitor<R> for Numbered<V> {
    #[inline(always)]
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()> {
        self.visitor.leaf(leaf, ray)
    }
}

/// Hands out a slice of rays in order.
struct Batch<'a, R: Real, N, D> {
    rays: &'a [Ray<R>],
    next: u32,
    visitor: N,
    done: D,
}

impl<R: Real, V: Visitor<R>, N: FnMut(u32) -> Numbered<V>, D: FnMut(Numbered<V>)> Feed<R>
    for Batch<'_, R, N, D>
{
    type Visitor = Numbered<V>;

    #[inline(always)]
    fn next(&mut self) -> Option<(Ray<R>, Numbered<V>)> {
        let ray = *self.rays.get(self.next as usize)?;
        let visitor = (self.visitor)(self.next);
        self.next += 1;
        Some((ray, visitor))
    }

    #[inline(always)]
    fn done(&mut self, visitor: Numbered<V>) {
        (self.done)(visitor);
    }
}

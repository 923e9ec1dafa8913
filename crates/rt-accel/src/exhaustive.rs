//! [`Exhaustive`]: every primitive in one leaf.

use crate::{Bounded, Boxes, BuildError, Invalid, Leaf, Refit, Structure, Visitor, Watch};
use core::ops::ControlFlow;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};

/// The structure that is none: one leaf with every primitive, shown to every ray. The oracle that the others must equal.
///
/// No box is tested, so no box can be wrong. `O(n)` a ray.
#[derive(Clone, Debug, Default)]
pub struct Exhaustive {
    origin: DVec3,
    bound: Aabb,
    prims: Vec<u32>,
    skipped: Vec<u32>,
}

impl Structure for Exhaustive {
    type Params = ();

    fn build_watched(prims: &dyn Bounded, (): &(), watch: Watch<'_>) -> Result<Exhaustive, BuildError> {
        let boxes = Boxes::read(prims)?;
        if watch(1.0).is_break() {
            return Err(BuildError::Cancelled);
        }
        Ok(Exhaustive {
            origin: boxes.origin,
            bound: boxes.world,
            prims: boxes.prims.iter().map(|&(prim, _)| prim).collect(),
            skipped: boxes.skipped,
        })
    }

    fn origin(&self) -> DVec3 {
        self.origin
    }

    fn local_bound(&self) -> Aabb {
        self.bound
    }

    fn skipped(&self) -> &[u32] {
        &self.skipped
    }

    fn repeats(&self) -> bool {
        false
    }

    fn bytes(&self) -> usize {
        (self.prims.capacity() + self.skipped.capacity()) * size_of::<u32>()
    }

    #[inline]
    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if ray.is_valid() && !self.prims.is_empty() {
            visit.node();
            let _: ControlFlow<()> = visit.leaf(Leaf { first: 0, prims: &self.prims }, ray);
        }
    }

    fn gather(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        if !self.prims.is_empty() && keep(&self.bound.relative_to(-self.origin)) {
            each(Leaf { first: 0, prims: &self.prims });
        }
    }

    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid> {
        let seen = self.prims.len() + self.skipped.len();
        if seen != prims.prim_count() {
            return Err(Invalid(format!("{seen} of {} primitives are listed", prims.prim_count())));
        }
        Ok(())
    }
}

impl Refit for Exhaustive {
    fn refit(&mut self, prims: &dyn Bounded) {
        let bounds = self.prims.iter().map(|&prim| prims.bound_from(prim, self.origin));
        self.bound = bounds.filter(|b| b.is_valid()).fold(Aabb::EMPTY, Aabb::union);
    }
}

//! [`Boxes`]: what a builder reads, once.

use crate::{Bounded, BuildError};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

/// The valid bounds of some primitives, relative to an origin near them: what every builder starts from.
///
/// The origin is zero unless the scene lies further from it than it is large; then it is the middle of the scene, so that
/// `f32` boxes stay tight.
#[derive(Clone, Debug)]
pub struct Boxes {
    /// What the bounds are relative to.
    pub origin: DVec3,
    /// The number and bound of each valid primitive, in ascending order of number.
    pub prims: Vec<(u32, Aabb)>,
    /// The numbers of the others, ascending.
    pub skipped: Vec<u32>,
    /// A box around all valid bounds.
    pub world: Aabb,
}

impl Boxes {
    /// Reads the bound of every primitive. `O(n)`.
    ///
    /// # Errors
    ///
    /// [`BuildError::TooManyPrimitives`] from `u32::MAX` primitives on.
    pub fn read(source: &dyn Bounded) -> Result<Boxes, BuildError> {
        let len = source.prim_count();
        let max = u32::MAX as usize - 1;
        if len > max {
            return Err(BuildError::TooManyPrimitives { len, max });
        }
        let mut boxes = Boxes {
            origin: DVec3::ZERO,
            prims: Vec::with_capacity(len),
            skipped: Vec::new(),
            world: Aabb::EMPTY,
        };
        for prim in 0..len as u32 {
            let bound = source.bound(prim);
            if bound.is_valid() {
                boxes.prims.push((prim, bound));
                boxes.world = boxes.world.union(bound);
            } else {
                boxes.skipped.push(prim);
            }
        }
        let center = boxes.world.center().as_dvec3();
        let far = boxes.world.is_valid()
            && boxes.world.min.is_finite()
            && boxes.world.max.is_finite()
            && center.abs().max_element() > 2.0 * boxes.world.size().max_element() as f64;
        if far {
            boxes.origin = center;
        }
        // Once more from the origin: `f64` geometry is tighter seen from there, and coordinates out of reach become infinite.
        boxes.world = Aabb::EMPTY;
        for (prim, bound) in &mut boxes.prims {
            *bound = source.bound_from(*prim, boxes.origin);
            boxes.world = boxes.world.union(*bound);
        }
        Ok(boxes)
    }
}

//! Volumes that enclose things, and the tests of rays, cones and beams against them.
//!
//! Boxes are `f32` and always rounded outward; a ray of either precision meets them through a [`SlabRay`], which encloses the
//! ray it is made from. So a traversal may say *hit* too often, by a few units in the last place, and never *miss* wrongly:
//! not for axis-parallel rays in box faces, negative zeros, flat boxes, infinite boxes, or coordinates of any finite size.
//!
//! Scenes far from the origin are met through an `origin` of their own: boxes and rays are taken relative to it in `f64`
//! before they are rounded to `f32`, so a town in planetary coordinates still has tight boxes.
//!
//! ```
//! use rt_bounds::{Aabb, SlabRay};
//! use rt_geom::{Ray, glam::{DVec3, Vec3A}};
//!
//! let flat = Aabb::new(Vec3A::new(-1.0, -1.0, 1.0), Vec3A::ONE);
//! let ray = Ray::new(Vec3A::ZERO, Vec3A::new(0.0, -0.0, 2.0));
//! assert!(SlabRay::new(&ray, DVec3::ZERO, &flat).entry(&flat).is_some());
//! ```
//!
//! # Invariants
//!
//! What traversal uses may say *hit* too often, never *miss* wrongly. A faster test that may is named `_fast`; there is none
//! yet, because the conservative test costs no operation more.

mod aabb;
mod cloud;
mod double;
mod hull;
mod kdop;
mod lanes;
mod moving;
mod obb;
mod octet;
mod overlap;
mod slab;
mod solid;
mod sphere;
mod unit_ray;
mod volume;

pub use aabb::Aabb;
pub use double::DAabb;
pub use hull::{Hull, HullError, Polytope, PolytopeRay};
pub use kdop::{Kdop, KdopRay};
pub use lanes::{Eight, Lanes, Portable};
pub use obb::Obb;
pub use octet::{BoxOctet, WideRay};
pub use overlap::{BeamTest, ConeTest};
pub use slab::{BoxPair, SlabRay};
pub use sphere::{BoundingSphere, Extremes};
pub use unit_ray::UnitRay;
pub use volume::BoundingVolume;

#[cfg(feature = "simd")]
#[doc(hidden)]
pub use fearless_simd;

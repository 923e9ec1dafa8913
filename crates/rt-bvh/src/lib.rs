//! Bounding volume hierarchies.
//!
//! A [`Bvh`] is a binary tree of boxes over numbered primitives: each primitive stands in one leaf, boxes may overlap. It is
//! built top-down by the surface area heuristic over bins, walked near child first, and can be refitted to moving primitives.
//!
//! ```
//! use rt_accel::{Aggregate, Primitive};
//! use rt_bvh::{Bvh, BvhParams};
//! use rt_geom::{Ray, glam::Vec3A};
//! # use rt_accel::{Hit, WorldBound};
//! # use rt_bounds::Aabb;
//! # struct Tile(f32);
//! # impl WorldBound for Tile {
//! #     fn world_bound(&self) -> Aabb { Aabb::new(Vec3A::new(-1.0, -1.0, self.0), Vec3A::new(1.0, 1.0, self.0)) }
//! # }
//! # impl Primitive for Tile {
//! #     type At = ();
//! #     fn intersect(&self, ray: &Ray) -> Option<Hit<()>> {
//! #         ray.admit((self.0 as f64 - ray.origin.z as f64) / ray.dir.z as f64).map(|t| Hit { t, at: () })
//! #     }
//! # }
//! let tiles: Vec<Tile> = (1..100).map(|i| Tile(i as f32)).collect();
//! let scene = Aggregate::<Bvh, _>::build(tiles, &BvhParams::default())?;
//! let hit = scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! # Ok::<(), rt_accel::BuildError>(())
//! ```
//!
//! # Layout
//!
//! A [`Node`] is the two boxes of its children side by side in the order the slab test reads them, and where the children
//! are: 64 bytes, one cache line, tested at once. (A node per box of 32 bytes would need a shuffle for every
//! plane to test two at once.) Nodes stand in depth-first order, so children come after their parents and a left child
//! usually follows its parent directly.
//!
//! # Invariants
//!
//! The tree is at most [`MAX_DEPTH`] deep, so the walk's stack has a fixed size and cannot overflow, coincident primitives
//! included. Equal input gives equal bytes at any thread count. Leaves hold at most `leaf_prims` primitives. Child boxes lie
//! inside their parents bit for bit.

mod build;
mod node;
mod refit;
mod walk;

pub use build::{Builder, BvhParams};
pub use node::{Bvh, MAX_DEPTH, Node};

//! Octrees: space, split in eight by three planes at a time.
//!
//! An [`Octree`] splits the box of a scene by one plane along each axis, at the middle or where the surface area
//! heuristic wants them ([`Split`]), and each part again. Leaves are disjoint cells; a primitive stands in every leaf
//! that it reaches into. Rays walk the leaves near to far. The tree is kept as nodes with eight links each, or without
//! any, as the sorted Morton codes of its leaves ([`Storage`]).
//!
//! ```
//! use rt_accel::{Aggregate, Primitive};
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_octree::{Octree, OctreeParams};
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
//! let scene = Aggregate::<Octree, _>::build(tiles, &OctreeParams::default())?;
//! let hit = scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! # Ok::<(), rt_accel::BuildError>(())
//! ```
//!
//! # Why no hit is lost
//!
//! Let a ray meet a primitive at a point `P`, exactly.
//!
//! 1. *A leaf whose closed cell holds `P` names the primitive.* Both children of a plane hold it. What a primitive does
//!    not enter is decided on bounds rounded outward; a bound that ends at a plane goes below it only, one that starts
//!    there and ends above goes above only, and all of it is in that child's closed cell.
//! 2. *The walk visits every such leaf*, by induction: a node is visited with an interval of the ray that holds all of
//!    its cell's. Where a plane cuts the ray is rounded down for the part that begins there and up for the part that
//!    ends there ([`SlabRay::crossing`](rt_bounds::SlabRay::crossing)); a child's interval is the node's, begun by the
//!    planes that the ray has to cross to get into it and ended by the others, and so holds all of its cell's. Children
//!    whose interval is empty are passed over, so their cells are not met. Rays within a plane visit both sides.
//! 3. *What is beyond the closest hit* is passed over by its distance alone; that a hit lies in the cell at hand is
//!    never asked.
//!
//! # Near to far
//!
//! With the children numbered by how many planes the ray crosses to get into them (bit 0 of the number for x, 1 for y,
//! 2 for z, mirrored where the ray descends), those it meets form a chain: each has the bits of the one before, and
//! another. So their order is that of their numbers, without sorting; where planes are crossed at the same time up to
//! rounding, more than one such chain may be visited, and a ray within a plane passes by one side of it after the
//! other. This is the order of Revelles, Ureña and Lastra, "An efficient parametric algorithm for octree traversal",
//! WSCG 2000, who go from child to child; here eight intervals are made at once, in lanes, because then nothing is lost
//! to rounding and there are few branches.
//!
//! # Invariants
//!
//! At most [`MAX_DEPTH`] splits on a way, so the walk's stack has a fixed size. Equal input gives equal bytes at any
//! thread count.

mod build;
mod linear;
mod octree;
mod params;
mod planes;
mod walk;

pub use octree::{MAX_DEPTH, Node, Octree, Statistics};
pub use params::{OctreeParams, Split, Stop, Storage};

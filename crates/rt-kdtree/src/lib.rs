//! kd-trees: space, split in two along one axis at a time.
//!
//! A [`KdTree`] splits the box of a scene by planes that the surface area heuristic chooses among the faces of the primitives'
//! bounds. Leaves are disjoint cells; a primitive stands in every leaf that it reaches into. Rays walk the leaves near to far.
//!
//! ```
//! use rt_accel::{Aggregate, Primitive};
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_kdtree::{KdTree, KdTreeParams};
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
//! let scene = Aggregate::<KdTree, _>::build(tiles, &KdTreeParams::default())?;
//! let hit = scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! # Ok::<(), rt_accel::BuildError>(())
//! ```
//!
//! # Why no hit is lost
//!
//! Let a ray meet a primitive at a point `P`, exactly. The builder puts the primitive into a leaf whose closed cell holds `P`: what
//! a primitive does not enter is decided on bounds rounded outward. The walk visits every leaf whose closed cell the ray meets,
//! by induction: a node is visited with an interval of the ray that holds all of its cell's; where the plane cuts the interval is
//! rounded towards the far side for the near child and towards the near side for the far one
//! ([`SlabRay::crossing`](rt_bounds::SlabRay::crossing)), so each child's interval holds all of its own. Rays within a plane
//! visit both sides. So the rule "accept a hit only inside its cell" is not needed: what lies beyond the closest hit is
//! passed over by its distance.
//!
//! # Where the time goes
//!
//! Loading nodes is what a walk waits for: on a scan of 69 000 triangles more than half of the samples of a profile fall there. So
//! nodes are 8 bytes, and empty children, which are 14 to 70 % of all leaves in nine scenes, are no nodes at all. Against a tree that
//! stores them this saves a fifth to a third of the bytes on four of these. Together with a walk that does not branch upon the axis
//! of a node, nor upon the order of its children, it makes rays 1.02 to 1.26 times as fast (seven scenes, primary rays, chords and
//! diffuse rays; 1.13 in the geometric mean).
//!
//! Rays are walked one by one. Walking them in flight, eight at a time, a node each in turn, was measured and left out: over a
//! million triangles strewn at random it came to 1.24 (chords), 1.28 (diffuse rays) and 1.06 (primary rays), over 100 000 to 1.17, 1.14
//! and 0.84, on the scan to 1.10, 0.98 and 0.74 times as fast. Two, four or eight rays that each go down to a
//! leaf in turn came to 0.81 to 1.01. A node's work is too little to pay for changing rays, and the branches of coherent rays,
//! foreseen well one ray at a time, are not any more.
//!
//! # Invariants
//!
//! At most [`MAX_DEPTH`] splits on a way, so the walk's stack has a fixed size. Equal input gives equal bytes at any thread count.

mod build;
mod node;
mod sweep;
mod walk;

pub use build::KdTreeParams;
pub use node::{KdTree, MAX_DEPTH, Node, Statistics};

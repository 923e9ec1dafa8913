//! BSP trees: space, split in two by any plane at a time.
//!
//! A [`Bsp`] splits the box of a scene like a kd-tree, and besides by the planes in which the scene's own triangles lie and by
//! planes through their edges. The surface area heuristic chooses among them, with the surfaces of the convex polytopes that
//! cells then are. So a cell can fit what it holds however that is turned: rays test few triangles (on closed meshes about one each), and long diagonal
//! triangles, which stand in a great many cells of a kd-tree, stand in few. The price is the build, which looks at far more planes.
//!
//! Planes are asked of the primitives by [`Bounded::outline`](rt_accel::Bounded::outline). Primitives without one are split by their
//! boxes, and a scene of only such gives a kd-tree.
//!
//! ```
//! use rt_accel::{Aggregate, Primitive};
//! use rt_bsp::{Bsp, BspParams};
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
//! let scene = Aggregate::<Bsp, _>::build(tiles, &BspParams::default())?;
//! let hit = scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! # Ok::<(), rt_accel::BuildError>(())
//! ```
//!
//! # Why no hit is lost
//!
//! A slanted plane is stored rounded, so the triangle it was made from lies in it only nearly. Therefore it has *room*: the
//! region below is `{p: n.p <= s + room}`, the region above `{p: n.p >= s - room}`, for the numbers `n`, `s` and `room` as they are
//! stored; they overlap, and cover everything. A node's region is what its ancestors' leave of the bound.
//!
//! *Builder.* If a primitive has a point `P` in the region of a node, it has one reference there at least, by induction: a
//! primitive is left out above a plane only if all of its part in the region has `n.p <= s + room`, for certain. The part is a
//! polygon whose corners may be off, and `room` is at least the distance of the plane's own triangle and four grains, where a
//! grain outweighs all errors of corners and of heights above planes (`2^-42` of the largest coordinate; the derivation stands
//! beside it in the source). So the triangle of the plane, and its neighbours where they share corners with it, count as lying
//! on one side, and still are where the walk looks. Polygons are cut at `room` and two grains beyond the plane.
//!
//! *Walk.* A node is visited with an interval of the ray that holds all of its region's. Where the interval is cut, the height of
//! the ray above the plane is computed in `f64` with `room` and the error bound of the height (`64 u` of the sizes of all
//! coordinates, and `32 u` of the distance) taken for nothing, and ends are rounded outward to `f32`; so each child's interval holds
//! all of its own region's. Rays within a plane, or so nearly parallel that the sign says nothing, visit both sides. Planes across
//! axes are met as in a kd-tree, through [`SlabRay::crossing`](rt_bounds::SlabRay::crossing), and have no room, for they are exact.
//!
//! Where coordinates exceed `2^100` or all are below `2^-80` in size there are no slanted planes.
//!
//! # Which planes are considered
//!
//! In each cell: across the axes at the ends of all parts, by a sweep. Slanted: of each triangle its plane, and through each edge
//! the plane across the triangle; of all triangles in cells of up to [`BspParams::exhaustive`] references, of
//! [`BspParams::samples`] evenly chosen ones in larger cells. How many parts lie on which side is counted in a tree of their
//! boxes, so a large cell of `n` references costs `O(n log n)`, and the build `O(n log^2 n)`, for bounded parameters.
//!
//! Source: Ize, Wald and Parker, "Ray tracing with the BSP tree", RT 2008.
//!
//! # Invariants
//!
//! At most [`MAX_DEPTH`] splits on a way, so the walk's stack has a fixed size. Equal input gives equal bytes at any thread count.
//! Polytopes decide costs only, no answer.

mod build;
mod cell;
mod node;
mod part;
mod plane;
mod sweep;
mod walk;

pub use build::BspParams;
pub use node::{Bsp, MAX_DEPTH, Node, Statistics};
pub use walk::Order;

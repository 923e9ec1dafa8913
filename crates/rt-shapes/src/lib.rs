//! Things with surfaces: triangle meshes, spheres, polygons, quadrics.
//!
//! Whether a ray hits is decided exactly: by a filter in `f64`, then with twice the digits or exact sums for what the filter
//! leaves open. So there are no leaks between triangles, and every structure, at any width and on any CPU, finds the same hits.
//!
//! * Triangles are closed sets: an edge or vertex met exactly is met, by each neighbour. When crossings are counted
//!   (`all_hits`), it belongs to one of them.
//! * Triangles without area are never hit, nor are rays in a triangle's own plane.
//! * Patches are met directly: [`BilinearPatch`], and [`BezierPatch`] without a lost root; terrains ([`Terrain`]) and Julia sets
//!   ([`Julia`]) exist only where rays come near. What must be turned into triangles first ([`Refine`]) can be so when the first
//!   ray reaches it ([`Lazy`]).
//! * A hit is its distance and a [`Uv`]; the full [`Surface`] record is asked of the winner only.
//!
//! ```
//! use rt_accel::{Aggregate, Exhaustive, Primitive};
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_shapes::{Shape, TriangleMesh};
//!
//! let corners = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
//! let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
//! let scene = Aggregate::<Exhaustive, _>::build(mesh, &())?;
//!
//! // Along the shared diagonal: one closest hit, of the lower number; one crossing.
//! let ray = Ray::new(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
//! let hit = scene.intersect(&ray).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! assert_eq!(scene.surface(&ray, &hit).normal.z.abs(), 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Invariants
//!
//! This crate knows no structure. The `t` of a triangle is the exact distance, correctly rounded to the ray's precision, whatever
//! the condition of the problem; so neighbours that are met at a shared vertex are met at one `t`. That of a sphere is within
//! `2^-33` of half a unit in the last place. A [`Quadric`], [`Frustum`] or [`Disk`] is decided with up to twice the digits of
//! `f64`, and what these leave open is a hit. Patches say what they are off by ([`PatchRoot`]).
//!
//! [`Uv`] is `f32` for rays of either precision: it orders nothing and decides nothing, and [`Surface`] is computed afresh in
//! `f64`, so a second precision of it would be carried by everyone and read by nobody.

mod bezier;
mod clip;
mod julia;
mod loop_subdivision;
mod mesh;
mod near;
mod polygon;
mod quadric;
mod refine;
mod sphere;
mod surface;
mod terrain;
mod triangle;

pub use bezier::{BezierPatch, BilinearPatch, PatchCounts, PatchError, PatchRoot, Tessellation};
pub use julia::{Julia, JuliaCounts, JuliaParams, Traced};
pub use loop_subdivision::{
    Boundaries, Corners, Deviation, LimitPoint, LoopError, LoopRules, LoopSurface, LoopTessellation,
    Vertices, Weights,
};
pub use mesh::{Component, Facing, MeshError, MeshSampler, Orientation, TriangleMesh};
pub use polygon::{Polygon, PolygonError};
pub use quadric::{Disk, Frustum, Quadric, QuadricError, Root};
pub use refine::{Lazy, Refine};
pub use sphere::{Sphere, SphereError};
pub use surface::{Partials, Shape, Surface, Surfaced, Uv};
pub use terrain::{Fractal, Heights, Samples, Terrain, TerrainParams};
pub use triangle::{Meeting, Triangle, moller_trumbore};

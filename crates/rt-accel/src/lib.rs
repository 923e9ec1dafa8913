//! The contract: what a primitive, a geometry and a structure promise each other.
//!
//! ```text
//!  Bounded     what a builder asks           "how many, and where?"
//!  Geometry    what a leaf asks              "does this ray hit number 7?"
//!  Structure   what a query asks             "show me, near to far, whom this ray may hit"
//!  Primitive   what everyone else asks       "what does this ray hit?"
//!
//!  Aggregate<S: Structure, G: Geometry>  is a  Primitive
//!  Vec<P: Primitive>                     is a  Geometry      — the loop closes: scenes nest
//! ```
//!
//! The queries are closest hit (`intersect`), any hit (`intersect_p`), all hits (`all_hits`), and the first two for many rays
//! at once; each has a counted twin for closest and any. They hold for every structure, because they are written once, in
//! [`Aggregate`], over [`Structure::traverse`].
//!
//! ```
//! use std::ops::ControlFlow;
//! use rt_accel::{Aggregate, Exhaustive, Hit, Member, Primitive, WorldBound};
//! use rt_bounds::Aabb;
//! use rt_geom::{Ray, glam::Vec3A};
//!
//! /// The plane z = height, met where `t` is an exact quotient.
//! struct Plane { height: f32 }
//!
//! impl WorldBound for Plane {
//!     fn world_bound(&self) -> Aabb {
//!         let far = Vec3A::new(f32::INFINITY, f32::INFINITY, self.height);
//!         Aabb::new(Vec3A::new(f32::NEG_INFINITY, f32::NEG_INFINITY, self.height), far)
//!     }
//! }
//! impl Primitive for Plane {
//!     type At = ();
//!     fn intersect(&self, ray: &Ray) -> Option<Hit<()>> {
//!         let t = (self.height as f64 - ray.origin.z as f64) / ray.dir.z as f64;
//!         ray.admit(t).map(|t| Hit { t, at: () })
//!     }
//! }
//!
//! let planes = vec![Plane { height: 3.0 }, Plane { height: 1.0 }, Plane { height: 2.0 }];
//! let scene = Aggregate::<Exhaustive, _>::build(planes, &()).unwrap();
//! let ray = Ray::new(Vec3A::ZERO, Vec3A::Z);
//! assert_eq!(scene.intersect(&ray), Some(Hit { t: 1.0, at: Member { prim: 1, at: () } }));
//! assert!(!scene.intersect_p(&ray.between(4.0, 9.0)));
//! ```
//!
//! # Why the traits are cut as they are
//!
//! * The world bound stands in a trait of its own, [`WorldBound`], because a primitive answers rays of two precisions: asked
//!   of `Primitive<f32>` and `Primitive<f64>` alike, `world_bound` would need a type annotation from users who know of one.
//! * Bounds are asked for *from an origin* ([`WorldBound::world_bound_from`], [`Bounded::bound_from`]): that is how `f64`
//!   geometry far from zero gets tight `f32` boxes. Whoever has only `f32` bounds writes nothing.
//! * [`Geometry::intersect_leaf`] names the primitive it hit, because ties between leaves go to the lowest number.
//! * [`Primitive::all_hits`] is part of the trait, so that instances and nested aggregates count crossings too, and a closed
//!   shape met twice reports both.
//! * [`Structure::build_watched`] is the one required build: every structure can be watched and cancelled.
//!
//! # Invariants
//!
//! This crate contains no spatial structure but [`Exhaustive`]. Queries cannot fail, and a ray that is not
//! [valid](rt_geom::Ray::is_valid) misses. Equal distances go to the lowest primitive number.

mod aggregate;
mod boxes;
mod counts;
mod exhaustive;
mod geometry;
mod guarded;
mod instance;
mod mailbox;
mod primitive;
mod sah;
mod structure;

pub use aggregate::Aggregate;
pub use boxes::Boxes;
pub use counts::Counts;
pub use exhaustive::Exhaustive;
pub use geometry::{Bounded, Clip, Geometry, Leaf, Member};
pub use guarded::Guarded;
pub use instance::Instance;
pub use mailbox::{HashedMailbox, InverseMailbox, Mailbox, Mailing, NoMailbox};
pub use primitive::{Hit, Primitive, WorldBound};
pub use sah::Sah;
pub use structure::{BuildError, Feed, Invalid, Refit, Structure, Visitor, Watch, unwatched};

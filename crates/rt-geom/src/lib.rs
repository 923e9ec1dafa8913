//! Rays, cones and beams, transforms, and the rounding rules they obey: what is true of numbers, rays and maps when
//! there is nothing to hit.
//!
//! # Conventions
//!
//! * **Units.** None are assumed: coordinates are in whatever length the caller uses. Angles are radians.
//! * **Handedness.** Right-handed formulas; nothing in the algebra depends on it.
//! * **The parameter `t`** counts lengths of `dir`, which need not be unit. It keeps its meaning through every
//!   [`Transform`], so hits found in object space compare with hits found in world space.
//! * **Intervals are closed.** A ray is its points for `t` in `[t_min, t_max]`, both ends included.
//! * **NaN.** A ray that holds a NaN, an infinite origin or direction, or a zero direction is [not
//!   valid](Ray::is_valid): every query answers it with a miss.
//! * **Two precisions.** A [`Ray`] is `f32` unless one asks for `Ray<f64>`; constructors take the precision from the vectors
//!   they are given, so users of `f32` never write a type parameter.
//!
//! # Example
//!
//! ```
//! use rt_geom::{Ray, Transform, glam::{DVec3, Vec3A}};
//!
//! let ray = Ray::new(Vec3A::ZERO, Vec3A::new(0.0, 0.0, 2.0));
//! assert_eq!(ray.at(1.5), Vec3A::new(0.0, 0.0, 3.0));
//!
//! let map = Transform::translation(DVec3::new(1.0, 0.0, 0.0));
//! let moved = map.inverse().ray(&ray.widen());
//! assert_eq!(moved.origin, DVec3::new(-1.0, 0.0, 0.0));
//! ```
//!
//! # Invariants
//!
//! This crate never mentions a thing that can be hit.
//!
//! [`expansion`] is here, rather than in a crate for exact predicates, because the predicates published for Rust take
//! points, whereas a ray's edge volume takes a direction, which is not a difference of representable points.

pub mod expansion;

mod axis;
mod beam;
mod cone;
mod differential;
mod direction;
mod invert;
mod motion;
mod orient;
mod parts;
mod ray;
mod real;
mod round;
mod transform;

pub use axis::Axis;
pub use beam::{Beam, BeamError};
pub use cone::{Cone, ConeError};
pub use differential::{Footprint, RayDifferential};
pub use direction::{angle_between, unit};
/// The vector library this workspace uses, so that users never meet two versions of it.
pub use glam;
pub use motion::{Motion, Path};
pub use parts::Parts;
pub use ray::Ray;
pub use real::{Real, Vector};
pub use round::{difference_of_products, f32_above, f32_below, gamma};
pub use transform::{Transform, TransformError};

//! Truth and time: what is right, how wrong an answer is, and what it cost.
//!
//! ```text
//!  exact     what a line meets, by integers of any length
//!  error     how far answers and images are from the truth
//!  rays      sets of rays, the same on every machine
//!  conform   a structure answers as the exhaustive one does, bit for bit
//!  clock     contestants timed in turn
//!  record    one measurement, one row; none without an error
//!  front     which measurements no other beats
//! ```
//!
//! Definitions only: no plotting, no scenes, no structures, no files, no printing; any crate's tests can use it and no crate's
//! users compile it.
//!
//! ```
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_measure::{error::HitError, exact};
//!
//! // An edge of two triangles, met exactly: both are hit at once, and the lower number is the answer.
//! let [a, b, c, d] = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
//! let ray = Ray::new(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
//! let found = exact::closest(&ray, [[a, b, c], [a, c, d]]).unwrap();
//! assert_eq!((found.prim, found.t), (0, 1.0));
//!
//! // Somebody else's answers, judged: naming the neighbour is no error, losing the ray is.
//! let mut error = HitError::default();
//! error.judge_triangles(&ray, &[[a, b, c], [a, c, d]], Some((1, 1.0)));
//! error.judge_triangles(&ray, &[[a, b, c], [a, c, d]], None);
//! assert_eq!((error.wrong, error.missed), (0, 1));
//! ```
//!
//! # Invariants
//!
//! This crate depends on nothing it might judge: on the contract (`rt-geom`, `rt-bounds`, `rt-accel`) alone, and
//! [`exact`] on nothing of it but the types of rays. Nothing here panics on bad input, except where a method says so.

pub mod clock;
pub mod conform;
pub mod error;
pub mod exact;
pub mod front;
pub mod rays;
pub mod record;

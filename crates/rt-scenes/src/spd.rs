//! Scenes of the Standard Procedural Databases.
//!
//! Source: Haines, "A proposal for standard graphics environments", *IEEE Computer Graphics and Applications* 7(11), 1987, 3-5,
//! and his *Standard Procedural Databases* 3.14. The rules are derived again from what the databases contain; no program of
//! theirs is copied. Generators compute in `f64`.

mod balls;
mod tetra;

pub use balls::balls;
pub(crate) use balls::balls_of_triangles;
pub use tetra::tetra;

/// The sky of most SPD scenes.
pub(crate) const SKY: [f32; 3] = [0.078, 0.361, 0.753];

//! Scenes to try ray tracing on: Haines' Standard Procedural Databases, NFF and OBJ files, random soups, a teapot in a
//! stadium, an interior, a terrain, a gallery of curved shapes, and inputs meant to hurt.
//!
//! * A [`Scene`] is what a picture needs: shapes, looks, lights, a view. [`by_name`] makes one of [`names`]; [`obj::load`] and
//!   [`nff::load`] read one.
//! * A [`Trial`] is a small mesh with a name. [`trials`] lists what every structure must answer rightly on, [`closed_meshes`]
//!   those that no ray from inside may leave.
//!
//! ```
//! let scene = rt_scenes::by_name("balls", Some(2))?;
//! assert_eq!(scene.prim_count(), 91 + 1);
//! assert_eq!(scene.lights.len(), 3);
//! assert_eq!(scene.material(1).color, [1.0, 0.9, 0.7]);
//! # Ok::<(), rt_scenes::SceneError>(())
//! ```
//!
//! # Invariants
//!
//! A scene depends on its name and numbers alone, to the last bit, on every machine: generators use only operations that
//! IEEE 754 rounds correctly, and random numbers of their own. (Shapes of the [`gallery`] hold sines and powers as the platform
//! rounds them.) Nothing here prints, or panics on any input or file.

pub mod fine;
pub mod gallery;
pub mod hostile;
pub mod interior;
pub mod nff;
pub mod obj;
pub mod soup;
pub mod spd;
pub mod stadium;
pub mod terrain;

mod facet;
mod numbers;
mod placed;
mod scene;
mod solid;
mod teapot;
mod trial;

pub use facet::Facet;
pub use placed::Placed;
pub use scene::{Light, Material, Scene, SceneError, SceneGeometry, View, about, by_name, names};
pub use solid::Solid;
pub use teapot::teapot_nets;
pub use trial::{Closed, Trial, closed_meshes, fine_trials, trials};

//! A thin renderer, to see rays and to time them: a camera, recursive rays in batches, a film, pictures of cost.
//!
//! ```text
//!  Camera     one ray per pixel corner          Film       tiles of corners, in parallel; progress; cancelling
//!  Whitted    colours of those rays, by waves   Picture    pixels, averaged from corners; PNG bytes
//!  cost       nodes and tests of those rays     heat       the cost in colour, with its scale burned in
//! ```
//!
//! Everything is written over [`rt_shapes::Shape`], of either precision: whatever can be hit and knows its surface can be
//! rendered. Nothing here is a file or a screen: pictures become bytes, progress goes to the caller.
//!
//! ```
//! use rt_accel::{Aggregate, Exhaustive, Member};
//! use rt_geom::glam::DVec3;
//! use rt_render::{Camera, Film, Look, Whitted, ungoverned};
//! use rt_scenes::{Light, Material, View};
//! use rt_shapes::Sphere;
//!
//! let balls = vec![Sphere::new(DVec3::ZERO, 1.0)?, Sphere::new(DVec3::new(1.5, 0.0, 0.0), 0.5)?];
//! let scene = Aggregate::<Exhaustive, _>::build(balls, &())?;
//! let materials =
//!     [Material { color: [1.0, 0.9, 0.7], kd: 0.5, ks: 0.5, shine: 3.0, transmittance: 0.0, ior: 1.0 }];
//! let lights = [Light { position: DVec3::new(4.0, 3.0, 2.0), color: [0.5; 3] }];
//! let view = View { from: DVec3::new(2.0, 6.0, 2.0), at: DVec3::ZERO, up: DVec3::Z, angle: 0.8 };
//!
//! let look = Look { materials: &materials, lights: &lights, background: [0.1, 0.4, 0.8] };
//! let whitted = Whitted::new(&scene, |_: &Member<_>| 0, look);
//! let film = Film::new(64, 64);
//! let (picture, rays) = film.render::<f32, _, _>(&Camera::new(&view)?, &whitted, &ungoverned)?;
//! assert_eq!(rays.eye, 65 * 65);
//! assert!(rays.eye_hits > 0 && rays.shadow > 0 && rays.refraction == 0);
//! assert!(picture.png()?.starts_with(b"\x89PNG"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Invariants
//!
//! This crate never names a structure. A picture and its counts do not depend on the size of tiles, the number of threads or
//! the structure under the scene: equal bit for bit. Rays that leave a surface start off it by the error bound of their
//! point, never by a chosen distance.

mod camera;
mod film;
mod glyphs;
mod heat;
mod whitted;

pub use camera::{Camera, CameraError};
pub use film::{Cancelled, Film, Governor, Picture, PngError, Tile, ungoverned};
pub use heat::{Measure, Scale, heat};
pub use whitted::{Look, Plan, RayCounts, Whitted};

/// The code of the workspace's front page, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct FrontPage;

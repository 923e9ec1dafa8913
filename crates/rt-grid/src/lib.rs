//! Grids: space in equal cells, each with the primitives that reach into it.
//!
//! A [`Grid`] cuts the box of a scene into cells of one size, in one array, with the numbers of primitives in another. Where primitives
//! are crowded, a cell may itself be a grid over the tight box of what is in it ([`GridParams::nested`], [`GridParams::two_level`]); or
//! what is small and hangs together is a grid of its own, and an object of a larger one ([`GridParams::hug`]).
//! Rays walk the cells near to far, and leap over empty ones.
//!
//! ```
//! use rt_accel::{Aggregate, Primitive};
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_grid::{Grid, GridParams};
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
//! let scene = Aggregate::<Grid, _>::build(tiles, &GridParams::default())?;
//! let hit = scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap();
//! assert_eq!((hit.t, hit.at.prim), (1.0, 0));
//! # Ok::<(), rt_accel::BuildError>(())
//! ```
//!
//! # Why no hit is lost
//!
//! Let a ray `o + t d` meet a primitive at a point `P`, exactly, at `t` in its interval. All below is in `f64`, with `u = 2^-53`, for
//! each axis on its own; `s` is the side of the grid, and plane `k` lies at `low + k w`, without rounding.
//!
//! 1. *The walk errs little.* It crosses plane `k` at `T(k) = fl(k c + b)` with `c = fl(w / d)` and `b = fl((low - o) / d)`, from the
//!    integer `k` each time, so nothing adds up. Each of the two terms has been rounded at most five times, one for the reciprocal and one
//!    for `o` relative to the grid's own zero included: `|T(k) d - (low + k w - o)| <= 8u (s + |low - o| + |low|)`. A grid has more
//!    than one cell along an axis only where `|low| < 2^23 s`, and a ray is walked only where `|low - o| <= 2^23 s - |low|`. Then the error
//!    is at most `8u 2^24 s = 2^-26 s`.
//! 2. *At every time the walk is in a cell near the ray.* `T` is monotone, since rounding is. The walk merges the crossings
//!    of three axes in order of `T`; ties go to x before y before z, by steps that take no time. So at time `t` it visits a cell with
//!    `T(entry) <= t <= T(exit)` on every axis, and by 1. `P = o + t d` is within `2^-26 s` of that cell. Where the first cell is found,
//!    and where empty cells are leapt over, an estimate is corrected until the same holds. Planes at the grid's own border
//!    are never crossed: the first and the last cell along an axis reach on outward, so rounding at the border matters to nobody.
//! 3. *Primitives are registered that much further.* A primitive stands in each cell that its part within `2^-25 s` of the cell reaches
//!    into: twice the error of 1., which leaves room for the rounding of the division that finds the cell. Clipping is to boxes that
//!    are larger by as much, rounded outward. So the cell of 2. holds the primitive.
//! 4. *The walk lasts long enough.* It begins and ends where the ray enters and leaves the box of all bounds, rounded outward
//!    by an error bound made for this ray, and ends early only where the next cell is entered beyond `ray.t_max`. A hit found in one
//!    cell and lying in a later one shortens `t_max` and is kept; cells before it are still visited.
//! 5. *Grids in cells.* The box of an inner grid contains the parts of all the cell's primitives within the cell, made larger as in 3.;
//!    hence `P`. It is walked between the two times at which the outer walk enters and leaves the cell; `t` is one of those by 2. A grid
//!    that is an object ([`Nest::Sizes`]) contains its primitives whole, and is registered by its box as a primitive would be.
//!
//! A ray that starts too far away for 1. is carried nearer along itself, with twice the digits: the new origin is within
//! `2^-102` of the way, which may be `2^-28` of a side at most, and one rounding of itself. One that is too far even for that (some 2^70 sides) visits every reference of the grid.
//!
//! A direction whose component is so small that its reciprocal is infinite counts as parallel to that axis: over any distance at which
//! there are `f32` boxes it moves by less than `2^-26` of a side.
//!
//! # Invariants
//!
//! Equal input gives equal bytes at any thread count. Primitives with infinite bounds are shown to every ray, first.

mod build;
mod clouds;
mod grid;
mod hug;
mod measure;
mod params;
mod voxels;
mod walk;

pub use grid::{Grid, MAX_DEPTH, Statistics};
pub use params::{GridParams, Nest, Resolution, Skip};

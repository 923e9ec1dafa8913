//! [`Structure`]: spatial indices, and those who listen to their traversals.

use crate::{Bounded, Leaf};
use core::fmt;
use core::ops::ControlFlow;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};

/// Receives what a traversal finds.
pub trait Visitor<R: Real = f32> {
    /// A leaf that the ray may touch. Shortening `ray.t_max` spares what lies beyond; `Break` ends the traversal.
    fn leaf(&mut self, leaf: Leaf<'_>, ray: &mut Ray<R>) -> ControlFlow<()>;

    /// A leaf comes next, so that its data may be fetched ahead.
    #[inline(always)]
    fn soon(&mut self, _leaf: Leaf<'_>) {}

    /// A node was opened. Free unless someone counts.
    #[inline(always)]
    fn node(&mut self) {}

    /// A primitive that the ray had met before was dropped from a leaf. Free unless someone counts.
    #[inline(always)]
    fn spared(&mut self) {}
}

/// Hands out rays with their visitors and takes the visitors back. Pulled, so that the few rays in flight live beside the
/// walk, in the nearest cache.
pub trait Feed<R: Real = f32> {
    /// What goes with each ray.
    type Visitor: Visitor<R>;
    /// The next ray, if any is left.
    fn next(&mut self) -> Option<(Ray<R>, Self::Visitor)>;
    /// A ray has been walked to its end.
    fn done(&mut self, visitor: Self::Visitor);
}

/// Hears the progress of a build, from 0 to 1, never falling and ending at exactly 1, and may cancel it. Called from the
/// thread that called the build.
pub type Watch<'a> = &'a mut dyn FnMut(f32) -> ControlFlow<()>;

/// A [`Watch`] that lets a build run.
pub fn unwatched(_progress: f32) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A spatial index over numbers `0..n`. It owns no primitives and is not generic in them.
///
/// A structure's author writes `build_watched`, `traverse`, `gather` and the small facts; the queries, counters, instancing,
/// conformance tests and benches come with it.
pub trait Structure: Sized + Send + Sync {
    /// The knobs of the build. The default is the one that was measured best.
    type Params: Default + Clone + Send + Sync;

    /// Builds over all valid primitives. Primitives whose bound holds a NaN or is inverted are left out and named by
    /// [`Structure::skipped`]. Empty input is a valid structure that is never hit. The same input gives the same bytes.
    ///
    /// # Errors
    ///
    /// See [`BuildError`]. Nothing is left behind.
    fn build_watched(
        prims: &dyn Bounded,
        params: &Self::Params,
        watch: Watch<'_>,
    ) -> Result<Self, BuildError>;

    /// [`Structure::build_watched`] with nobody watching.
    ///
    /// # Errors
    ///
    /// See [`BuildError`].
    fn build(prims: &dyn Bounded, params: &Self::Params) -> Result<Self, BuildError> {
        Self::build_watched(prims, params, &mut unwatched)
    }

    /// Where the structure keeps its own zero: boxes are stored relative to it.
    fn origin(&self) -> DVec3;

    /// A box around everything, relative to [`Structure::origin`]; empty when nothing is in it.
    fn local_bound(&self) -> Aabb;

    /// Primitives left out because their bounds were not valid, in ascending order.
    fn skipped(&self) -> &[u32];

    /// Whether one primitive may stand in several leaves: grids and space splits yes, box hierarchies only after spatial
    /// splits.
    fn repeats(&self) -> bool;

    /// Heap memory, in bytes.
    fn bytes(&self) -> usize;

    /// Leaves the ray may touch, near to far, skipping what lies past `ray.t_max`, which the visitor may shorten. A leaf
    /// entered at exactly `t_max` is visited. A ray that is not valid touches none.
    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>);

    /// As [`Structure::traverse`], in the order likeliest to find *some* hit.
    #[inline]
    fn traverse_any<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        self.traverse(ray, visit);
    }

    /// Many rays in flight: takes the next one from `rays` whenever a place falls free. The default walks them one by one.
    fn traverse_many<R: Real, F: Feed<R>>(&self, rays: &mut F) {
        while let Some((mut ray, mut visitor)) = rays.next() {
            self.traverse(&mut ray, &mut visitor);
            rays.done(visitor);
        }
    }

    /// Leaves under nodes whose box, in world space, `keep` accepts: cones, beams, points, boxes, frusta.
    fn gather(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>));

    /// Checks what must hold inside: children in parents, every valid primitive present, leaf names unique. For tests and
    /// for people debugging a structure of their own; `prims` is what it was built over.
    ///
    /// # Errors
    ///
    /// Says what is wrong, and where.
    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid>;
}

/// Structures that follow moving primitives without rebuilding.
pub trait Refit: Structure {
    /// New bounds for the same primitives in the same tree. Quality may fall; answers stay right for every primitive that stood
    /// in the tree when it was built: one that was left out then ([`Structure::skipped`]) stays out until the next build, and
    /// so does one with a number that did not exist.
    fn refit(&mut self, prims: &dyn Bounded);
}

/// Why a structure was not built.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum BuildError {
    /// More primitives than numbers.
    TooManyPrimitives {
        /// How many there are.
        len: usize,
        /// How many there may be.
        max: usize,
    },
    /// The build would need more memory than it was allowed.
    OutOfMemory {
        /// Bytes needed.
        needed: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// The watcher said stop.
    Cancelled,
    /// A parameter outside its range.
    BadParam {
        /// Its name.
        name: &'static str,
        /// What is wrong with it.
        why: &'static str,
    },
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BuildError::TooManyPrimitives { len, max } => {
                write!(f, "{len} primitives are more than the {max} a structure can number")
            }
            BuildError::OutOfMemory { needed, limit } => {
                write!(f, "the build needs {needed} bytes and may use {limit}")
            }
            BuildError::Cancelled => write!(f, "the build was cancelled"),
            BuildError::BadParam { name, why } => write!(f, "parameter {name}: {why}"),
        }
    }
}

impl core::error::Error for BuildError {}

/// What [`Structure::validate`] found wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Invalid(pub String);

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for Invalid {}

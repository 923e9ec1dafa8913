//! [`GridParams`]: the knobs.

use crate::voxels::{MOST_ALONG, MOST_CELLS};
use rt_accel::{BuildError, Clip, Mailing, Sah};

/// How many cells a grid gets along each axis.
///
/// `N` is the number of primitives (of references, within a cell), `s` the sides of the box, `V` its volume. An axis along which the
/// box is flat gets one cell. No axis gets more than 2^20, and a grid that a rule asks for is halved along its longest axes while boxes
/// of primitives overlap more than 256 of its cells on average (16 in a grid within a cell).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// This many cells for each primitive, as near to cubes as can be: `s (lambda N / V)^(1/3)`. Axes too short for one such cell get
    /// one, and the others make up for them. 1 to 10 is usual.
    ///
    /// Source: Cleary and Wyvill, "Analysis of an algorithm for fast ray tracing using uniform space subdivision", The Visual
    /// Computer 4 (1988).
    Density(f32),
    /// `D N^(1/3)` along every axis that is not flat.
    ///
    /// Source: Fujimoto, Tanaka and Iwata, "ARTS: accelerated ray-tracing system", CG&A 6(4) 1986.
    Root(f32),
    /// `max(1, floor((D N)^(1/3) s / max s))`.
    ///
    /// Source: Woo, "Ray tracing polygons using spatial subdivision", Graphics Interface 1992.
    Woo(f32),
    /// `3 N^(1/3) s / max s`, rounded, in `1..=64`.
    ///
    /// Source: Pharr and Humphreys, *Physically Based Rendering* (2004), section 4.3.
    Pharr,
    /// This many cells along x, y and z, each in `1..=2^20`, whatever the scene.
    Fixed([u32; 3]),
    /// The density, among powers of two from 1/16 to 64, at which so many sampled rays cost least by [`GridParams::sah`]: cells and
    /// tests are counted, not timed, and boxes stand for primitives: scenes of long diagonal ones get fewer cells than would suit
    /// [`Clip::Exact`]. Rays are isotropic lines that end where they probably hit.
    Measured {
        /// How many rays; some hundreds suffice.
        rays: u32,
    },
}

/// How rays pass through empty cells.
///
/// Macro cells (Parker, Parker, Livnat, Sloan, Hansen and Shirley, "Interactive ray tracing for volume visualization", 1999) are not
/// among the ways. The nearest thing to them here, grids of 4 cells a side in the cells of one as much coarser ([`Nest::Above`] 0), took
/// 9.3 steps a ray where clouds took 8.6, and a fifth more time, in a pyramid of rings; 8.4 to 6.2, and two fifths more, in a lattice.
/// Where they won, it was by fewer tests in tight boxes, which is what [`Nest`] is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skip {
    /// One after another.
    None,
    /// By as many cells at once as are empty all around: each empty cell knows how far the nearest other is.
    ///
    /// Source: Cohen and Sheffer, "Proximity clouds: an acceleration technique for 3D grid traversal", The Visual Computer 11 (1994).
    Clouds,
}

/// Which cells become grids of their own, over the tight box of what is in them.
///
/// [`Nest::Sizes`] goes the other way, from primitives instead of cells: its grids are objects that reach into cells as primitives do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nest {
    /// None: the grid is uniform.
    Never,
    /// Those with more references than this.
    ///
    /// Source: Jevans and Wyvill, "Adaptive voxel subdivision for ray tracing", Graphics Interface 1989.
    Above(u32),
    /// Those where that lowers the expected cost of a ray by [`GridParams::sah`].
    Cheaper,
    /// None; but primitives are parted into classes of size, at the widest gaps between sizes, and in each class but the largest
    /// those that hang together become a grid. It is an object of the smallest grid of a larger class that encloses it, or of the first
    /// grid; so are primitives in clusters that are too small.
    ///
    /// Sizes are diagonals of boxes; those within a tenth of each other are never parted. Of evenly spread sizes nothing
    /// is gained. Grids within are never cut to cells: one that reaches into several is walked a part at a time.
    ///
    /// Source: Cazals, Drettakis and Puech, "Filtering, clustering and hierarchy construction: a new solution for ray-tracing complex
    /// scenes", CGF 14(3) 1995, with gaps in the place of their histogram.
    Sizes {
        /// How many classes at most; no more than [`GridParams::depth`] and one.
        classes: u32,
        /// By how much of its diagonal a box grows on each side before those that overlap are said to hang together.
        grown: f32,
        /// How many primitives a grid has at least.
        least: u32,
    },
}

/// The knobs of a [`Grid`](crate::Grid).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridParams {
    /// How many cells. [`Resolution::Measured`] counts the references of some five grids and so takes the time of as many builds with
    /// [`Clip::Box`].
    pub resolution: Resolution,
    /// In which cells a primitive is registered.
    pub clip: Clip,
    /// Whether rays remember whom they were tested against.
    pub mailing: Mailing,
    /// How rays pass through empty cells.
    pub skip: Skip,
    /// Which cells become grids.
    pub nest: Nest,
    /// How many cells those get; not [`Resolution::Measured`].
    pub inner: Resolution,
    /// How many grids may lie within each other below the first, in `0..=12`.
    pub depth: u32,
    /// What passing a cell and testing a primitive cost: for [`Resolution::Measured`] and [`Nest::Cheaper`]. A test of a triangle in
    /// the nearest cache costs about a step, one in memory about ten.
    pub sah: Sah,
    /// Bytes the build may use, working memory included; `None` is no limit.
    pub memory_limit: Option<usize>,
}

impl Default for GridParams {
    fn default() -> GridParams {
        GridParams {
            resolution: Resolution::Density(5.0),
            clip: Clip::Exact,
            mailing: Mailing::None,
            skip: Skip::Clouds,
            nest: Nest::Never,
            inner: Resolution::Density(2.4),
            depth: 8,
            sah: Sah { traverse: 1.0, intersect: 3.0 },
            memory_limit: None,
        }
    }
}

impl GridParams {
    /// Grids in cells wherever that pays, at any depth: for scenes of uneven density.
    pub fn nested() -> GridParams {
        GridParams {
            resolution: Resolution::Density(1.0),
            inner: Resolution::Density(1.0),
            nest: Nest::Cheaper,
            ..GridParams::default()
        }
    }

    /// A coarse grid, and a grid in each of its cells that is not empty.
    ///
    /// Source: Kalojanov, Billeter and Slusallek, "Two-level grids for ray tracing on GPUs", CGF 30(2) 2011, with their densities.
    pub fn two_level() -> GridParams {
        GridParams {
            resolution: Resolution::Density(0.12),
            inner: Resolution::Density(2.4),
            nest: Nest::Above(0),
            depth: 1,
            ..GridParams::default()
        }
    }

    /// A grid for each cluster of primitives of like size: for small things in a wide space, at a fraction of the time that
    /// [`GridParams::nested`] takes to build.
    ///
    /// Two classes are best wherever it was measured: a field or a floor apart from all that stands on it. More classes part things that
    /// share one space into grids that overlap, each of which a ray has to walk. Time for a ray, to that of the default: 0.08 for a
    /// tree in a field, 0.11 for a teapot in a stadium, 0.43 for a flake of balls, 1.06 for rings and 1.6 for a lattice, where spheres and
    /// cylinders share the space. It was built in a tenth to two fifths of the time of [`GridParams::nested`].
    pub fn hug() -> GridParams {
        GridParams {
            inner: Resolution::Density(5.0),
            nest: Nest::Sizes { classes: 2, grown: 0.3, least: 8 },
            ..GridParams::default()
        }
    }

    pub(crate) fn check(&self) -> Result<(), BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        for (name, resolution) in [("resolution", self.resolution), ("inner", self.inner)] {
            match resolution {
                Resolution::Density(x) | Resolution::Root(x) | Resolution::Woo(x) => {
                    if !(x > 0.0 && x.is_finite()) {
                        return bad(name, "must be finite and positive");
                    }
                }
                Resolution::Fixed(count) => {
                    if count.iter().any(|n| !(1..=MOST_ALONG).contains(n)) {
                        return bad(name, "must lie in 1..=1048576 along each axis");
                    }
                    if count.iter().map(|n| *n as u64).product::<u64>() > MOST_CELLS as u64 {
                        return bad(name, "must not make more than 2^30 cells");
                    }
                }
                Resolution::Measured { rays } => {
                    if rays == 0 {
                        return bad(name, "must measure with a ray at least");
                    }
                    if name == "inner" {
                        return bad(name, "must not be measured");
                    }
                }
                Resolution::Pharr => {}
            }
        }
        if let Nest::Sizes { classes, grown, least } = self.nest {
            if classes == 0 || least == 0 {
                return bad("nest", "must have a class and a primitive at least");
            }
            if !(grown >= 0.0 && grown.is_finite()) {
                return bad("nest", "must grow boxes by a finite share, not negative");
            }
        }
        if self.depth as usize > crate::grid::MAX_DEPTH {
            return bad("depth", "must lie in 0..=12");
        }
        if !(self.sah.traverse >= 0.0 && self.sah.traverse.is_finite()) {
            return bad("sah.traverse", "must be finite and not negative");
        }
        if !(self.sah.intersect > 0.0 && self.sah.intersect.is_finite()) {
            return bad("sah.intersect", "must be finite and positive");
        }
        Ok(())
    }
}

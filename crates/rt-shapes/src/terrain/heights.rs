//! [`Heights`]: where the heights of a terrain come from.

use super::walk::{DIGITS, FULL};
use rt_accel::BuildError;

/// Heights of vertices, which are named by their place: `[0, 0]` and `[2^30, 2^30]` are opposite corners of the terrain, and each
/// level adds the middles between neighbours of the last.
///
/// Implemented by [`Fractal`] and [`Samples`].
pub trait Heights: Send + Sync {
    /// The height of one of the four corners.
    fn corner(&self, at: [u32; 2]) -> f64;

    /// The height of the vertex that `level` adds, from 1, between two of these heights. The same whichever end comes first.
    fn middle(&self, at: [u32; 2], level: u32, ends: [f64; 2]) -> f64;

    /// How far the vertices of all levels after `from`, up to `level`, may lie from the plane of the three vertices around
    /// them; infinity if only looking at them can tell.
    fn beyond(&self, from: u32, level: u32) -> f64;

    /// Whether there are heights for `level` levels.
    ///
    /// # Errors
    ///
    /// [`BuildError::BadParam`] says what is wrong.
    fn check(&self, level: u32) -> Result<(), BuildError>;
}

/// Midpoint displacement: each vertex lies midway between its neighbours of the last level, plus a random displacement that
/// shrinks from level to level. Random numbers are a hash of the vertex's place, so that all who share it agree, and nothing is
/// stored; coarser levels are the finer ones with vertices left out.
///
/// Displacements have the distribution of a sum of four uniform numbers: near normal, and never beyond `2 sqrt(3)` deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fractal {
    /// Chooses among terrains.
    pub seed: u64,
    /// The standard deviation of the displacements of the first level; finite.
    pub rise: f64,
    /// By which power of the step displacements shrink, in `(0, 1]`: 3 less the fractal dimension.
    pub hurst: f64,
    /// The heights of the corners, in the order `(0, 0)`, `(1, 0)`, `(0, 1)`, `(1, 1)`; finite.
    pub corners: [f64; 4],
}

impl Default for Fractal {
    /// Hills of dimension 2.2 over the unit square.
    fn default() -> Fractal {
        Fractal { seed: 0, rise: 0.1, hurst: 0.8, corners: [0.0; 4] }
    }
}

/// No displacement exceeds this many deviations: `2 sqrt(3)`, rounded up.
const MOST: f64 = 3.464_101_615_137_755_5;

impl Fractal {
    /// The standard deviation of the displacements of a level, from 1.
    fn deviation(&self, level: u32) -> f64 {
        self.rise.abs() * (-self.hurst * f64::from(level - 1)).exp2()
    }
}

/// Random bits that belong to a place. Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (2014).
#[inline]
fn hash(seed: u64, [i, j]: [u32; 2]) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    };
    mix(mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15))
        ^ mix((u64::from(i) << 32 | u64::from(j)).wrapping_add(0x9e37_79b9_7f4a_7c15)))
}

impl Heights for Fractal {
    fn corner(&self, at: [u32; 2]) -> f64 {
        self.corners[usize::from(at[0] > 0) + 2 * usize::from(at[1] > 0)]
    }

    #[inline]
    fn middle(&self, at: [u32; 2], level: u32, [a, b]: [f64; 2]) -> f64 {
        let bits = hash(self.seed, at);
        // Four whole numbers below 2^16, their sum symmetric around 0 in units of half a step.
        let sum: u64 = (0..4).map(|k| bits >> (16 * k) & 0xffff).sum();
        let deviate = (2.0 * sum as f64 - 262_140.0) / 262_140.0 * MOST;
        (a + b) * 0.5 + deviate * self.deviation(level)
    }

    fn beyond(&self, from: u32, level: u32) -> f64 {
        // Rounding of the sum and of the displacements.
        let sum: f64 = (from + 1..=level).map(|l| self.deviation(l)).sum();
        sum * MOST * (1.0 + 64.0 * f64::EPSILON)
    }

    fn check(&self, _: u32) -> Result<(), BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        if !(self.hurst > 0.0 && self.hurst <= 1.0) {
            return bad("hurst", "must lie in (0, 1]");
        }
        if !(self.rise.is_finite() && self.corners.iter().all(|z| z.is_finite())) {
            return bad("rise", "and corners must be finite");
        }
        Ok(())
    }
}

/// A table of heights: `2^level + 1` rows of as many samples, row by row along y, each along x.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    heights: Vec<f32>,
    level: u32,
}

impl Samples {
    /// A table.
    ///
    /// # Errors
    ///
    /// [`BuildError::BadParam`] when the samples are not `(2^k + 1)^2`, `k` in `0..=15`, or not all finite.
    pub fn new(heights: Vec<f32>) -> Result<Samples, BuildError> {
        let len = |k: u32| ((1usize << k) + 1) * ((1usize << k) + 1);
        let Some(level) = (0..=super::DEEPEST).find(|&k| len(k) == heights.len()) else {
            return Err(BuildError::BadParam {
                name: "heights",
                why: "must be (2^k + 1)^2 samples, k in 0..=15",
            });
        };
        if !heights.iter().all(|z| z.is_finite()) {
            return Err(BuildError::BadParam { name: "heights", why: "must be finite" });
        }
        Ok(Samples { heights, level })
    }

    /// The number of levels, `k` for `2^k + 1` samples a side.
    pub fn level(&self) -> u32 {
        self.level
    }

    fn sample(&self, [i, j]: [u32; 2]) -> f64 {
        let shift = DIGITS - self.level;
        let side = (1usize << self.level) + 1;
        let at = (j.min(FULL) >> shift) as usize * side + (i.min(FULL) >> shift) as usize;
        self.heights.get(at).copied().unwrap_or(0.0).into()
    }
}

impl Heights for Samples {
    fn corner(&self, at: [u32; 2]) -> f64 {
        self.sample(at)
    }
    #[inline]
    fn middle(&self, at: [u32; 2], _: u32, _: [f64; 2]) -> f64 {
        self.sample(at)
    }
    fn beyond(&self, from: u32, level: u32) -> f64 {
        if from < level { f64::INFINITY } else { 0.0 }
    }
    fn check(&self, level: u32) -> Result<(), BuildError> {
        if level <= self.level {
            Ok(())
        } else {
            Err(BuildError::BadParam { name: "level", why: "is deeper than the table" })
        }
    }
}

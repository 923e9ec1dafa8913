//! [`Lanes`]: instructions that work on eight numbers at once, chosen by the CPU at hand.

use core::fmt::Debug;
use rt_geom::glam::Vec4;

/// A set of instructions for eight `f32` at once: the portable one, or one of the CPU's.
///
/// A value says that the CPU has them; [`dispatch!`](crate::dispatch) makes the best one there is. Code that is generic in it,
/// `#[inline(always)]` down to the arithmetic, is compiled once for each set.
pub trait Lanes: Copy + Debug {
    /// Eight numbers.
    type Eight: Eight;

    /// Eight times the same.
    fn splat(self, x: f32) -> Self::Eight;

    /// Eight numbers from memory.
    fn load(self, x: &[f32; 8]) -> Self::Eight;
}

/// Eight numbers. All operations round as `f32` does, and none is fused, so that every set of instructions answers alike.
pub trait Eight: Copy + Debug {
    /// `self - other`.
    fn minus(self, other: Self) -> Self;
    /// `self * other`.
    fn times(self, other: Self) -> Self;
    /// `self` where it is greater, else `other`: where either is NaN, and of zeros of two signs.
    fn or_greater(self, other: Self) -> Self;
    /// `self` where it is less, else `other`: where either is NaN, and of zeros of two signs.
    fn or_less(self, other: Self) -> Self;
    /// Where `self <= other`: bit `i` of number `i`.
    fn at_most(self, other: Self) -> u32;
    /// The numbers.
    fn store(self) -> [f32; 8];
}

/// Runs an expression with the best [`Lanes`] that the CPU has: `dispatch!(lanes => walk(lanes, ..))`.
///
/// What is called must be `#[inline(always)]` down to the arithmetic, closures too, else it is compiled for the least of CPUs.
/// Choosing costs more than testing eight boxes (3 ns against 2), so choose outside of loops; inside code already compiled for a
/// set, choosing again costs little. The expression may stand in a closure, so it holds no `return` and no `?`.
///
/// ```
/// use rt_bounds::{BoxOctet, Lanes, SlabRay};
///
/// #[inline(always)]
/// fn count<L: Lanes>(lanes: L, ray: &SlabRay, boxes: &[BoxOctet]) -> u32 {
///     let ray = ray.wide(lanes);
///     boxes.iter().map(|eight| ray.enter_eight(eight).0.count_ones()).sum()
/// }
///
/// fn met(ray: &SlabRay, boxes: &[BoxOctet]) -> u32 {
///     rt_bounds::dispatch!(lanes => count(lanes, ray, boxes))
/// }
/// ```
#[cfg(feature = "simd")]
#[macro_export]
macro_rules! dispatch {
    ($lanes:pat => $op:expr) => {
        $crate::fearless_simd::dispatch!($crate::fearless_simd::Level::new(), $lanes => $op)
    };
}

/// Runs an expression with the portable [`Lanes`]: `dispatch!(lanes => walk(lanes, ..))`. With the feature `simd`, with the best
/// that the CPU has.
#[cfg(not(feature = "simd"))]
#[macro_export]
macro_rules! dispatch {
    ($lanes:pat => $op:expr) => {
        match $crate::Portable {
            $lanes => $op,
        }
    };
}

/// The lanes that every CPU has: two times four.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

impl Lanes for Portable {
    type Eight = [Vec4; 2];

    #[inline(always)]
    fn splat(self, x: f32) -> [Vec4; 2] {
        [Vec4::splat(x); 2]
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> [Vec4; 2] {
        let [a, b, c, d, e, f, g, h] = *x;
        [Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)]
    }
}

impl Eight for [Vec4; 2] {
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        [self[0] - other[0], self[1] - other[1]]
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        [self[0] * other[0], self[1] * other[1]]
    }
    #[inline(always)]
    fn or_greater(self, other: Self) -> Self {
        [self[0].max(other[0]), self[1].max(other[1])]
    }
    #[inline(always)]
    fn or_less(self, other: Self) -> Self {
        [self[0].min(other[0]), self[1].min(other[1])]
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> u32 {
        self[0].cmple(other[0]).bitmask() | self[1].cmple(other[1]).bitmask() << 4
    }
    #[inline(always)]
    fn store(self) -> [f32; 8] {
        let ([a, b, c, d], [e, f, g, h]) = (self[0].to_array(), self[1].to_array());
        [a, b, c, d, e, f, g, h]
    }
}

#[cfg(feature = "simd")]
mod simd {
    use super::{Eight, Lanes};
    use fearless_simd::prelude::*;
    use fearless_simd::{Simd, f32x8};

    impl<S: Simd> Lanes for S {
        type Eight = f32x8<S>;

        #[inline(always)]
        fn splat(self, x: f32) -> f32x8<S> {
            f32x8::splat(self, x)
        }
        #[inline(always)]
        fn load(self, x: &[f32; 8]) -> f32x8<S> {
            f32x8::simd_from(self, *x)
        }
    }

    /// x86 has the very operation; elsewhere the maximum of NaN and zeros is another.
    const EXACT: bool = cfg!(any(target_arch = "x86", target_arch = "x86_64"));

    impl<S: Simd> Eight for f32x8<S> {
        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            self - other
        }
        #[inline(always)]
        fn times(self, other: Self) -> Self {
            self * other
        }
        #[inline(always)]
        fn or_greater(self, other: Self) -> Self {
            if EXACT { self.max(other) } else { self.simd_gt(other).select(self, other) }
        }
        #[inline(always)]
        fn or_less(self, other: Self) -> Self {
            if EXACT { self.min(other) } else { self.simd_lt(other).select(self, other) }
        }
        #[inline(always)]
        fn at_most(self, other: Self) -> u32 {
            self.simd_le(other).to_bitmask() as u32
        }
        #[inline(always)]
        fn store(self) -> [f32; 8] {
            self.into()
        }
    }
}

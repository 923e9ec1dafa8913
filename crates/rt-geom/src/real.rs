//! [`Real`]: the two precisions a ray may be asked in.

use crate::expansion::DoubleDouble;
use core::fmt::{Debug, Display};
use core::ops::{Add, Div, Mul, Neg, Sub};
use glam::{DVec3, Vec3A};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
    impl Sealed for glam::Vec3A {}
    impl Sealed for glam::DVec3 {}
}

/// `f32` or `f64`: the precision of a ray and of the answers to it. Sealed.
pub trait Real:
    sealed::Sealed
    + Copy
    + Debug
    + Display
    + Default
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Into<f64>
{
    /// Points and directions of this precision.
    type Vec3: Vector<Real = Self>;
    /// Zero.
    const ZERO: Self;
    /// Positive infinity.
    const INFINITY: Self;
    /// The greatest finite number.
    const MAX: Self;
    /// The relative error that a root may have before it is rounded to this precision: a small part of a unit in the last
    /// place. A root that may be worse is computed again with more digits; in `f64`, that is every root.
    const ROOT_ERROR: f64;

    /// The nearest number of this precision, ties to even.
    fn nearest(x: f64) -> Self;
    /// The nearest number of this precision, ties to even, rounded once.
    fn nearest_wide(x: DoubleDouble) -> Self;
    /// The greatest `f64` that becomes `self` or less when [`Ray::admit`](crate::Ray::admit) rounds it: infinity for the greatest
    /// number, which all beyond it become.
    fn reach(self) -> f64;
    /// The least number greater than `self`.
    fn next_up(self) -> Self;
    /// The greatest number less than `self`.
    fn next_down(self) -> Self;
    /// Whether `self` is neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

/// A point or direction in one of the two precisions. Sealed.
pub trait Vector:
    sealed::Sealed
    + Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Self::Real, Output = Self>
    + Neg<Output = Self>
{
    /// The precision of the components.
    type Real: Real<Vec3 = Self>;
    /// The same vector in `f64`, exactly.
    fn widen(self) -> DVec3;
    /// The nearest vector of this precision, component by component.
    fn nearest(v: DVec3) -> Self;
    /// The vector itself if this is the narrow precision: for shorter ways that only `f32` can take.
    fn as_f32(self) -> Option<Vec3A>;
}

impl Real for f32 {
    type Vec3 = Vec3A;
    const ZERO: f32 = 0.0;
    const INFINITY: f32 = f32::INFINITY;
    const MAX: f32 = f32::MAX;
    const ROOT_ERROR: f64 = 1.0 / (1u64 << 33) as f64;

    #[inline(always)]
    fn nearest(x: f64) -> f32 {
        x as f32
    }
    #[inline]
    fn nearest_wide(x: DoubleDouble) -> f32 {
        x.odd() as f32
    }
    #[inline]
    fn reach(self) -> f64 {
        if self >= f32::MAX {
            return f64::INFINITY;
        }
        let middle = (self as f64 + self.next_up() as f64) * 0.5;
        if middle as f32 <= self { middle } else { middle.next_down() }
    }
    #[inline(always)]
    fn next_up(self) -> f32 {
        self.next_up()
    }
    #[inline(always)]
    fn next_down(self) -> f32 {
        self.next_down()
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

impl Real for f64 {
    type Vec3 = DVec3;
    const ZERO: f64 = 0.0;
    const INFINITY: f64 = f64::INFINITY;
    const MAX: f64 = f64::MAX;
    const ROOT_ERROR: f64 = f64::EPSILON / 8.0;

    #[inline(always)]
    fn nearest(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn nearest_wide(x: DoubleDouble) -> f64 {
        x.value()
    }
    #[inline(always)]
    fn reach(self) -> f64 {
        if self == f64::MAX { f64::INFINITY } else { self }
    }
    #[inline(always)]
    fn next_up(self) -> f64 {
        self.next_up()
    }
    #[inline(always)]
    fn next_down(self) -> f64 {
        self.next_down()
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

impl Vector for Vec3A {
    type Real = f32;
    #[inline(always)]
    fn widen(self) -> DVec3 {
        self.as_dvec3()
    }
    #[inline(always)]
    fn nearest(v: DVec3) -> Vec3A {
        v.as_vec3a()
    }
    #[inline(always)]
    fn as_f32(self) -> Option<Vec3A> {
        Some(self)
    }
}

impl Vector for DVec3 {
    type Real = f64;
    #[inline(always)]
    fn widen(self) -> DVec3 {
        self
    }
    #[inline(always)]
    fn nearest(v: DVec3) -> DVec3 {
        v
    }
    #[inline(always)]
    fn as_f32(self) -> Option<Vec3A> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reach_is_the_last_that_rounds_down(bits: u32) {
            let x = f32::from_bits(bits);
            prop_assume!(x > f32::NEG_INFINITY);
            let reach = x.reach();
            prop_assert!(x == f32::MAX || reach as f32 <= x);
            prop_assert!(x >= f32::MAX || reach.next_up() as f32 > x);
        }
    }

    #[test]
    fn reach_at_the_ends() {
        for x in [f32::MIN, 0.0, -0.0, 1.0, f32::MIN_POSITIVE] {
            assert!(x.reach() as f32 <= x && x.reach().next_up() as f32 > x, "{x}");
        }
        assert_eq!(f32::INFINITY.reach(), f64::INFINITY);
        assert_eq!((f32::MAX.reach(), f64::MAX.reach(), 2.0f64.reach()), (f64::INFINITY, f64::INFINITY, 2.0));
    }
}

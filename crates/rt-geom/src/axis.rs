//! [`Axis`]: x, y, z as something to loop over.

use glam::{DVec3, Vec3A};

/// One of the three coordinate axes.
///
/// ```
/// use rt_geom::{Axis, glam::Vec3A};
/// let longest = Axis::longest(Vec3A::new(1.0, 3.0, 2.0));
/// assert_eq!(longest, Axis::Y);
/// assert_eq!(Axis::ALL.map(|axis| axis.next()), [Axis::Y, Axis::Z, Axis::X]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Axis {
    /// The first axis.
    X = 0,
    /// The second axis.
    Y = 1,
    /// The third axis.
    Z = 2,
}

impl Axis {
    /// All three, in order.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// The position of the axis's component in a vector: 0, 1 or 2.
    #[inline(always)]
    pub fn index(self) -> usize {
        self as usize
    }

    /// The axis after this one, cyclically.
    #[inline]
    pub fn next(self) -> Axis {
        Axis::ALL[(self.index() + 1) % 3]
    }

    /// The axis along which `v` is largest; the first of equals. NaN components are never the largest.
    #[inline]
    pub fn longest(v: Vec3A) -> Axis {
        Axis::longest_f64(v.as_dvec3())
    }

    /// [`Axis::longest`] in `f64`.
    #[inline]
    pub fn longest_f64(v: DVec3) -> Axis {
        let mut best = Axis::X;
        for axis in [Axis::Y, Axis::Z] {
            if v[axis.index()] > v[best.index()] || v[best.index()].is_nan() {
                best = axis;
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_axis_is_the_first_of_equals() {
        assert_eq!(Axis::longest(Vec3A::ONE), Axis::X);
        assert_eq!(Axis::longest(Vec3A::new(0.0, 1.0, 1.0)), Axis::Y);
        assert_eq!(Axis::longest(Vec3A::new(f32::NAN, 1.0, 2.0)), Axis::Z);
    }
}

//! [`Cloud`]: points made ready for fitting.

use rt_geom::Vector;
use rt_geom::glam::DVec3;

/// Axes, then diagonals of the cube, then diagonals of its faces. Not unit: only the order along each matters.
///
/// Source: Larsson, "Fast and tight fitting bounding spheres", SIGRAD 2008 (normal sets 001, 111 and 011).
pub(crate) const DIRECTIONS: [DVec3; 13] = [
    DVec3::X,
    DVec3::Y,
    DVec3::Z,
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, -1.0),
    DVec3::new(1.0, -1.0, 1.0),
    DVec3::new(1.0, -1.0, -1.0),
    DVec3::new(1.0, 1.0, 0.0),
    DVec3::new(1.0, -1.0, 0.0),
    DVec3::new(1.0, 0.0, 1.0),
    DVec3::new(1.0, 0.0, -1.0),
    DVec3::new(0.0, 1.0, 1.0),
    DVec3::new(0.0, 1.0, -1.0),
];

/// Points in `f64` about the middle of their box, scaled by a power of two so that the farthest coordinate is about 1.
///
/// So fitting meets neither overflow nor underflow, and loses no digits to an offset. What is fitted here is a guess,
/// rounded; that a volume holds its points is decided on the points themselves.
pub(crate) struct Cloud {
    /// The points; at least one.
    pub(crate) points: Vec<DVec3>,
    /// Where the zero of the cloud lies, in the coordinates of the input.
    middle: DVec3,
    /// Lengths of the input in a length of the cloud: a power of two.
    unit: f64,
}

impl Cloud {
    /// `None` where there are no points, or where one is not finite, or the `origin` of what is to be fitted.
    pub(crate) fn new<V: Vector>(points: &[V], origin: DVec3) -> Option<Cloud> {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut finite = origin.is_finite();
        for p in points {
            let p = p.widen();
            finite &= p.is_finite();
            (min, max) = (min.min(p), max.max(p));
        }
        if !finite || points.is_empty() {
            return None;
        }
        let middle = min * 0.5 + max * 0.5;
        let half = (max * 0.5 - min * 0.5).max_element();
        // A clamped exponent keeps the power of two and its inverse normal.
        let exponent = ((half.to_bits() >> 52) as i64 - 1023).clamp(-1000, 1000);
        let power = |e: i64| f64::from_bits(((e + 1023) as u64) << 52);
        let inverse = power(-exponent);
        let points = points.iter().map(|p| (p.widen() - middle) * inverse).collect();
        Some(Cloud { points, middle, unit: power(exponent) })
    }

    /// A point of the cloud in the coordinates of the input, relative to `origin`.
    pub(crate) fn place(&self, p: DVec3, origin: DVec3) -> DVec3 {
        (self.middle - origin) + p * self.unit
    }
}

/// The first points farthest back and farthest ahead along each direction, as numbers of points, of which there is one
/// at least.
pub(crate) fn extremes<const N: usize>(points: &[DVec3], along: &[DVec3; N]) -> [[usize; 2]; N] {
    // One direction after another: all at once was slower, for want of registers.
    along.map(|n| {
        let mut found = [0; 2];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, p) in points.iter().enumerate() {
            let x = n.dot(*p);
            if x < low {
                (low, found[0]) = (x, i);
            }
            if x > high {
                (high, found[1]) = (x, i);
            }
        }
        found
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_of_any_size_are_about_one() {
        for size in [5e-324, 1e-300, 1e-30, 1.0, 1e30, 1e300, f64::MAX] {
            let cloud = Cloud::new(&[DVec3::splat(-size), DVec3::new(size, 0.0, size)], DVec3::ZERO).unwrap();
            assert!(cloud.points.iter().all(|p| p.is_finite()));
            assert!(cloud.points[1].x < 1e8);
            let back = cloud.place(cloud.points[1], DVec3::ZERO);
            assert!((back.x / size - 1.0).abs() < 1e-15 || size < 1e-300, "{size:e} {back}");
        }
        assert!(Cloud::new(&[DVec3::ONE, DVec3::splat(f64::NAN)], DVec3::ZERO).is_none());
        assert!(Cloud::new(&[DVec3::INFINITY], DVec3::ZERO).is_none());
        assert!(Cloud::new::<DVec3>(&[], DVec3::ZERO).is_none());
    }

    #[test]
    fn extremes_of_a_cross() {
        let points = [DVec3::X, -DVec3::X, DVec3::Y, DVec3::ZERO, -DVec3::Y];
        assert_eq!(extremes(&points, &[DVec3::X, DVec3::Y]), [[1, 0], [4, 2]]);
    }
}

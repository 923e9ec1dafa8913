//! [`Transform`]: an affine map kept with its inverse.

use crate::expansion::DoubleDouble;
use crate::invert::{invert, mirrors, wide_dot};
use crate::{Ray, Real, Vector, gamma};
use core::fmt;
use glam::{DAffine3, DMat3, DVec3};

/// An affine map of space, kept with its inverse, in `f64` whatever the precision of the rays it moves.
///
/// Points go to `A (p + a) + b`, vectors to `A v`, normals to `A^-T n`. A map made from a matrix has `a = 0`; its
/// inverse is `A^-1 (p - b)`, which does not cancel where `A^-1 p - A^-1 b` does.
///
/// `f64` because with a stretch of `1e8` an inverse in `f32` misses four hits in five.
///
/// Error: the inverse is computed exactly and rounded once, so that each of its entries is right to the last digit,
/// whatever the stretch. Hence a point carried either way is off by a few roundings of the terms of its sum, `|A| |p +
/// a| + |b|`, never by the condition of `A`: see [`Transform::point_with_error`]. There and back, a point keeps all but
/// `log2(condition)` of its bits.
///
/// ```
/// use rt_geom::{Transform, glam::DVec3};
/// let map = Transform::scale(DVec3::new(2.0, 1.0, 1.0)).unwrap();
/// let there = map.point(DVec3::ONE);
/// assert_eq!(there, DVec3::new(2.0, 1.0, 1.0));
/// assert_eq!(map.inverse().point(there), DVec3::ONE);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    linear: DMat3,
    /// The inverse of `linear`.
    inverse: DMat3,
    /// Added before the linear part, zero in a map made from a matrix.
    before: DVec3,
    /// Added after the linear part.
    after: DVec3,
}

/// Why a map is not a [`Transform`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TransformError {
    /// An entry is NaN or infinite, or the result leaves the range of `f64`.
    NotFinite,
    /// The linear part cannot be inverted, or only with less than three digits.
    Singular {
        /// The condition of the linear part, rows and columns brought to size 1; infinite if its determinant is zero.
        condition: f64,
    },
    /// A vector that should give a direction is zero, not finite, or parallel to what it should differ from.
    NoDirection {
        /// Which one.
        of: &'static str,
    },
    /// One end of a motion mirrors and the other does not, so that something between is flat.
    Mirrors,
}

impl fmt::Display for TransformError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransformError::NotFinite => write!(f, "transform has an entry that is not finite"),
            TransformError::Singular { condition } => {
                let most = Transform::MAX_CONDITION;
                write!(
                    f,
                    "transform cannot be inverted: its condition is {condition:e}, and may be {most:e} at most"
                )
            }
            TransformError::NoDirection { of } => {
                write!(f, "transform is not determined: {of} has no direction")
            }
            TransformError::Mirrors => {
                write!(f, "motion starts mirrored and ends not, or the other way round")
            }
        }
    }
}

impl core::error::Error for TransformError {}

impl Transform {
    /// The map that changes nothing.
    pub const IDENTITY: Transform = Transform {
        linear: DMat3::IDENTITY,
        inverse: DMat3::IDENTITY,
        before: DVec3::ZERO,
        after: DVec3::ZERO,
    };

    /// Where nothing is: every point goes to NaN.
    pub(crate) const NOWHERE: Transform =
        Transform { linear: DMat3::NAN, inverse: DMat3::NAN, before: DVec3::NAN, after: DVec3::NAN };

    /// The greatest condition a linear part may have, after its rows and columns were brought to size 1: stretches
    /// along the axes of either side are free, however large; turned both before and after, a stretch may be up to
    /// about `1 : 1e12`.
    ///
    /// The entries of a matrix are rounded numbers. Beyond `1 / u`, about `1e16`, that rounding alone can make it
    /// singular, and at `1e12` it leaves three or four digits of the inverse: less than any picture needs.
    pub const MAX_CONDITION: f64 = 1e12;

    /// The map `p -> A p + b` of an affine matrix. Entries of `A` below `2^-300` of both their row and their column
    /// count as zero. Cost: about a microsecond, for the inverse is exact but for its one rounding.
    ///
    /// # Errors
    ///
    /// When an entry is not finite, or `A` has no finite inverse or a condition above [`Transform::MAX_CONDITION`].
    pub fn new(map: DAffine3) -> Result<Transform, TransformError> {
        Transform::from_parts(map.matrix3, DVec3::ZERO, map.translation)
    }

    fn from_parts(linear: DMat3, before: DVec3, after: DVec3) -> Result<Transform, TransformError> {
        if !(linear.is_finite() && before.is_finite() && after.is_finite()) {
            return Err(TransformError::NotFinite);
        }
        let inverted = invert(linear)?;
        if inverted.condition > Transform::MAX_CONDITION {
            return Err(TransformError::Singular { condition: inverted.condition });
        }
        Ok(Transform { linear: inverted.matrix, inverse: inverted.inverse, before, after })
    }

    /// Moves everything by `by`, which should be finite.
    ///
    /// One that is not makes a map that carries no point to a finite one. [`Transform::then`] and
    /// [`Motion::new`](crate::Motion::new) refuse such a map with [`TransformError::NotFinite`], as [`Transform::new`]
    /// refuses its matrix; [`Transform::point_with_error`] answers that the error is infinite.
    pub fn translation(by: DVec3) -> Transform {
        Transform { after: by, ..Transform::IDENTITY }
    }

    /// Stretches along the axes; negative factors mirror.
    ///
    /// # Errors
    ///
    /// When a factor is zero or not finite, or its inverse is not.
    pub fn scale(by: DVec3) -> Result<Transform, TransformError> {
        Transform::new(DAffine3::from_scale(by))
    }

    /// First `self`, then `next`.
    ///
    /// The product is computed with twice the digits and rounded once, and inverted anew: so however many maps are
    /// composed, the inverse fits the map to the last digit, and the map itself is off by one rounding a step. A
    /// translation between the two is moved to the outer side that has none yet, so that a way back (`A^-1 (p - b)`)
    /// followed by another stays one, and does not begin to cancel.
    ///
    /// # Errors
    ///
    /// When the product leaves the range of `f64`, or its condition exceeds [`Transform::MAX_CONDITION`].
    pub fn then(&self, next: &Transform) -> Result<Transform, TransformError> {
        let column = |v: DVec3| v.to_array().map(DoubleDouble::from);
        let product = |m: DMat3, v: [DoubleDouble; 3], c: DVec3| {
            let rows = m.transpose();
            DVec3::new(
                wide_dot(rows.x_axis, v, c.x),
                wide_dot(rows.y_axis, v, c.y),
                wide_dot(rows.z_axis, v, c.z),
            )
        };
        let carried = |v: DVec3| product(next.linear, column(v), DVec3::ZERO);
        let linear = DMat3::from_cols(
            carried(self.linear.x_axis),
            carried(self.linear.y_axis),
            carried(self.linear.z_axis),
        );
        let between = [0, 1, 2].map(|i| DoubleDouble::difference(self.after[i], -next.before[i]));
        let (before, after) = if between.iter().all(|x| x.value() == 0.0) {
            (self.before, next.after)
        } else if self.before == DVec3::ZERO || next.after != DVec3::ZERO {
            (self.before, product(next.linear, between, next.after))
        } else {
            (product(self.inverse, between, self.before), next.after)
        };
        Transform::from_parts(linear, before, after)
    }

    /// The way back.
    #[inline]
    pub fn inverse(&self) -> Transform {
        Transform { linear: self.inverse, inverse: self.linear, before: -self.after, after: -self.before }
    }

    /// The map as a matrix `p -> A p + b`. Of a way back, `b` may be large and hide small `A p`.
    pub fn affine(&self) -> DAffine3 {
        let before = self.before.to_array().map(DoubleDouble::from);
        let rows = self.linear.transpose();
        let translation = DVec3::new(
            wide_dot(rows.x_axis, before, self.after.x),
            wide_dot(rows.y_axis, before, self.after.y),
            wide_dot(rows.z_axis, before, self.after.z),
        );
        DAffine3 { matrix3: self.linear, translation }
    }

    /// A point carried over.
    #[inline]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * (p + self.before) + self.after
    }

    /// A point known within `error`, component by component, carried over: the result, and how far it may be from where
    /// the exact map takes the exact point, component by component. On the way back the exact map is the inverse of the
    /// forward one, not of its rounding. Infinite where the result is not finite.
    ///
    /// With `l` the entries of the matrix at hand and `s = fl(p + a)`, the bound is `gamma(7) (|l| |s| + |b|) + (1 +
    /// gamma(7)) |l| error`: each term of the sum carries the rounding of `l` if that is an inverse, of `s`, of the
    /// product and of three additions, six in all, and the seventh covers the evaluation of the bound. Products that
    /// underflow add a few times the least number. The condition of the map does not enter.
    ///
    /// Source: Higham, *Accuracy and Stability of Numerical Algorithms* (2002), section 3.5; Pharr, Jakob, Humphreys,
    /// *Physically Based Rendering*, 4th ed. (2023), section 6.8.
    pub fn point_with_error(&self, p: DVec3, error: DVec3) -> (DVec3, DVec3) {
        /// `2^-1070`: products and entries that underflow are off by half the least number each.
        const LEAST: f64 = f64::from_bits(1 << 4);
        let s = p + self.before;
        let result = self.linear * s + self.after;
        if !result.is_finite() {
            return (result, DVec3::INFINITY);
        }
        let size = self.linear.abs();
        let rounding = self.terms(p) * gamma(7);
        let underflow = (s.abs().element_sum() + 1.0) * LEAST;
        (result, rounding + size * error.abs() * (1.0 + gamma(7)) + underflow)
    }

    /// The size of the terms whose sum a carried point is, before they cancel: `|A| |p + a| + |b|`. Of a turn about a
    /// far pivot they are as large as the pivot is far, though the [matrix](Transform::affine) shows none of it.
    pub(crate) fn terms(&self, p: DVec3) -> DVec3 {
        self.linear.abs() * (p + self.before).abs() + self.after.abs()
    }

    /// A vector carried over: differences of points.
    #[inline]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.linear * v
    }

    /// A normal carried over, not normalised: `A^-T n`, which stays perpendicular to what `n` was perpendicular to. A
    /// normal that pointed to one side of a surface points to the same side, under reflections too; a cross product of
    /// carried tangents does not: see [`Transform::swaps_handedness`].
    #[inline]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.transpose() * n
    }

    /// The plane `n . x = d` carried over: the normal and the offset of its image. Half spaces `n . x <= d` go to half
    /// spaces `n' . x <= d'`.
    pub fn plane(&self, n: DVec3, d: f64) -> (DVec3, f64) {
        let normal = self.normal(n);
        (normal, d + n.dot(self.before) + normal.dot(self.after))
    }

    /// A ray carried over, in `f64`. `t` keeps its meaning: the direction is not normalised and the interval is unchanged.
    #[inline]
    pub fn ray<R: Real>(&self, ray: &Ray<R>) -> Ray<f64> {
        Ray {
            origin: self.point(ray.origin.widen()),
            dir: self.vector(ray.dir.widen()),
            t_min: ray.t_min.into(),
            t_max: ray.t_max.into(),
        }
    }

    /// The linear part `A`.
    #[inline]
    pub fn linear(&self) -> DMat3 {
        self.linear
    }

    /// Whether the map turns right hands into left hands. Exact. A surface oriented by the order of its corners or
    /// parameters turns its other side out when this holds.
    pub fn swaps_handedness(&self) -> bool {
        mirrors(self.linear)
    }

    /// The condition of the linear part, `|A| |A^-1|` in the largest-row-sum norm: 1 for a translation, `1e8` for a
    /// stretch of `1 : 1e8`.
    pub fn condition(&self) -> f64 {
        fn norm(m: DMat3) -> f64 {
            let rows = m.transpose();
            let sum = |row: DVec3| row.abs().element_sum();
            sum(rows.x_axis).max(sum(rows.y_axis)).max(sum(rows.z_axis))
        }
        norm(self.linear) * norm(self.inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(size: f64) -> impl Strategy<Value = DVec3> {
        (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn there_and_back(axis in vector(1.0), angle in -6.0..6.0f64, s in 0.1..10.0f64, b in vector(1e3), p in vector(1e3)) {
            prop_assume!(axis.length() > 1e-3);
            let map = Transform::rotation(axis, angle).unwrap()
                .then(&Transform::scale(DVec3::new(s, 1.0, -s)).unwrap()).unwrap()
                .then(&Transform::translation(b)).unwrap();
            let back = map.inverse().point(map.point(p));
            prop_assert!((back - p).length() < 1e-10);
            prop_assert!(map.swaps_handedness());
            prop_assert!((map.inverse().affine().transform_point3(map.point(p)) - p).length() < 1e-9);
        }

        #[test]
        fn tangents_stay_perpendicular_to_normals(m in prop::array::uniform9(-1.0..1.0f64), u in vector(1.0), v in vector(1.0)) {
            let linear = DMat3::from_cols_array(&m);
            prop_assume!(linear.determinant().abs() > 1e-2);
            let map = Transform::new(DAffine3::from_mat3(linear)).unwrap();
            let n = map.normal(u.cross(v));
            prop_assert!(n.dot(map.vector(u)).abs() < 1e-9);
            prop_assert!(n.dot(map.vector(v)).abs() < 1e-9);
        }
    }

    #[test]
    fn sizes_near_the_ends_of_the_range_can_be_inverted() {
        for size in [1e-300, 1e-107, 1e103, 1e300] {
            let map = Transform::scale(DVec3::new(size, 1.0, -size)).unwrap();
            let back = map.inverse().point(map.point(DVec3::new(3.0, 5.0, 7.0)));
            assert!((back - DVec3::new(3.0, 5.0, 7.0)).length() < 1e-14, "{size:e}");
        }
    }

    #[test]
    fn what_cannot_be_inverted_is_refused() {
        assert!(matches!(Transform::scale(DVec3::new(1.0, 0.0, 1.0)), Err(TransformError::Singular { .. })));
        assert_eq!(Transform::scale(DVec3::new(1.0, f64::NAN, 1.0)), Err(TransformError::NotFinite));
        assert_eq!(
            Transform::rotation(DVec3::ZERO, 1.0),
            Err(TransformError::NoDirection { of: "the axis" })
        );
    }

    #[test]
    fn a_quarter_turn_about_z() {
        let turn = Transform::rotation(DVec3::Z, std::f64::consts::FRAC_PI_2).unwrap();
        assert!((turn.point(DVec3::X) - DVec3::Y).length() < 1e-15);
        assert_eq!(turn.condition(), turn.inverse().condition());
    }
}

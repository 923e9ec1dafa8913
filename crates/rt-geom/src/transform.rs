//! [`Transform`]: an affine map kept with its inverse.

use crate::{Ray, Real, Vector};
use core::fmt;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// An affine map of space, kept with its inverse, in `f64` whatever the precision of the rays it moves.
///
/// Points go to `A p + b`, vectors to `A v`, normals to the cofactor matrix of `A` times `n`, so that a normal of a mirrored
/// surface still points outward. The inverse subtracts `b` first and multiplies after: `A^-1 (p - b)` does not cancel where
/// `A^-1 p - A^-1 b` does.
///
/// `f64` because with a stretch of `1e8` an inverse in `f32` misses four hits in five. Error of a point carried back:
/// at most `12 u kappa |A^-1 (p - b)|`, `u = 2^-53`, `kappa` the condition of `A`.
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
    translation: DVec3,
    /// Whether points go `A p + b` (forward) or `A (p + b)` (the inverse of a forward map).
    order: Order,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    LinearFirst,
    TranslationFirst,
}

/// Why a matrix is not a [`Transform`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TransformError {
    /// An entry is NaN or infinite.
    NotFinite,
    /// The determinant is zero, or the inverse is not representable.
    Singular {
        /// The determinant of the linear part, its columns scaled to lengths about 1.
        determinant: f64,
    },
}

impl fmt::Display for TransformError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransformError::NotFinite => write!(f, "transform has an entry that is not finite"),
            TransformError::Singular { determinant } => {
                write!(f, "transform cannot be inverted: its determinant is {determinant:e}")
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
        translation: DVec3::ZERO,
        order: Order::LinearFirst,
    };

    /// The map `p -> A p + b` of an affine matrix.
    ///
    /// # Errors
    ///
    /// When an entry is not finite, or `A` has no finite inverse.
    pub fn new(map: DAffine3) -> Result<Transform, TransformError> {
        if !map.is_finite() {
            return Err(TransformError::NotFinite);
        }
        let linear = map.matrix3;
        // Columns in units of a power of two each, so that neither size nor stretch takes the determinant out of range.
        let units = linear.to_cols_array_2d().map(|column| unit_of(DVec3::from_array(column)));
        let [x, y, z] = units;
        let normal = DMat3::from_cols(linear.x_axis / x, linear.y_axis / y, linear.z_axis / z);
        let determinant = normal.determinant();
        let rows = normal.inverse().transpose();
        let inverse = DMat3::from_cols(rows.x_axis / x, rows.y_axis / y, rows.z_axis / z).transpose();
        let lost = [inverse.x_axis, inverse.y_axis, inverse.z_axis].contains(&DVec3::ZERO);
        if determinant == 0.0 || !inverse.is_finite() || lost {
            return Err(TransformError::Singular { determinant });
        }
        Ok(Transform { linear, inverse, translation: map.translation, order: Order::LinearFirst })
    }

    /// Moves everything by `by`.
    pub fn translation(by: DVec3) -> Transform {
        Transform { translation: by, ..Transform::IDENTITY }
    }

    /// Stretches along the axes; negative factors mirror.
    ///
    /// # Errors
    ///
    /// When a factor is zero or not finite.
    pub fn scale(by: DVec3) -> Result<Transform, TransformError> {
        Transform::new(DAffine3::from_scale(by))
    }

    /// Turns by `angle` radians about `axis`, counter-clockwise seen against it. `axis` need not be unit.
    ///
    /// # Errors
    ///
    /// When `axis` has no direction or `angle` is not finite.
    pub fn rotation(axis: DVec3, angle: f64) -> Result<Transform, TransformError> {
        let Some(unit) = axis.try_normalize().filter(|_| angle.is_finite()) else {
            return Err(TransformError::NotFinite);
        };
        let linear = DMat3::from_quat(DQuat::from_axis_angle(unit, angle));
        Ok(Transform { linear, inverse: linear.transpose(), ..Transform::IDENTITY })
    }

    /// First `self`, then `next`.
    ///
    /// # Errors
    ///
    /// When the product leaves the range of `f64`.
    pub fn then(&self, next: &Transform) -> Result<Transform, TransformError> {
        let (a, b) = (self.affine(), next.affine());
        let map = b * a;
        let inverse = self.inverse * next.inverse;
        if !map.is_finite() || !inverse.is_finite() {
            return Err(TransformError::NotFinite);
        }
        Ok(Transform {
            linear: map.matrix3,
            inverse,
            translation: map.translation,
            order: Order::LinearFirst,
        })
    }

    /// The way back.
    #[inline]
    pub fn inverse(&self) -> Transform {
        Transform {
            linear: self.inverse,
            inverse: self.linear,
            translation: -self.translation,
            order: match self.order {
                Order::LinearFirst => Order::TranslationFirst,
                Order::TranslationFirst => Order::LinearFirst,
            },
        }
    }

    /// The map as a matrix `p -> A p + b`.
    pub fn affine(&self) -> DAffine3 {
        let translation = match self.order {
            Order::LinearFirst => self.translation,
            Order::TranslationFirst => self.linear * self.translation,
        };
        DAffine3 { matrix3: self.linear, translation }
    }

    /// A point carried over.
    #[inline]
    pub fn point(&self, p: DVec3) -> DVec3 {
        match self.order {
            Order::LinearFirst => self.linear * p + self.translation,
            Order::TranslationFirst => self.linear * (p + self.translation),
        }
    }

    /// A vector carried over: differences of points.
    #[inline]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.linear * v
    }

    /// A normal carried over, not normalised: the cofactor matrix of the linear part, with the sign that keeps outward
    /// normals outward under reflections.
    #[inline]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.transpose() * n
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

    /// Whether the map turns right hands into left hands.
    pub fn swaps_handedness(&self) -> bool {
        self.linear.determinant() < 0.0
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

/// The power of two that brings the largest component of `v` into `[1, 2)`; 1 for zero.
fn unit_of(v: DVec3) -> f64 {
    let exponent = v.abs().max_element().to_bits() >> 52;
    if v == DVec3::ZERO { 1.0 } else { f64::from_bits(exponent.clamp(1, 2045) << 52) }
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
        assert_eq!(Transform::rotation(DVec3::ZERO, 1.0), Err(TransformError::NotFinite));
    }

    #[test]
    fn a_quarter_turn_about_z() {
        let turn = Transform::rotation(DVec3::Z, std::f64::consts::FRAC_PI_2).unwrap();
        assert!((turn.point(DVec3::X) - DVec3::Y).length() < 1e-15);
        assert_eq!(turn.condition(), turn.inverse().condition());
    }
}

//! Transforms that turn: about an axis, from one direction to another, by a quaternion, and to face a target.

use crate::{Transform, TransformError, unit};
use glam::{DAffine3, DMat3, DQuat, DVec3};

impl Transform {
    /// Turns by `angle` radians about `axis`, counter-clockwise seen against it, within some 4 roundings. `axis` need
    /// not be unit.
    ///
    /// # Errors
    ///
    /// When `axis` has no direction or `angle` is not finite.
    pub fn rotation(axis: DVec3, angle: f64) -> Result<Transform, TransformError> {
        let axis = direction(axis, "the axis")?;
        if !angle.is_finite() {
            return Err(TransformError::NotFinite);
        }
        // Not by a quaternion, which doubles the rounding of half the angle: a quarter turn is one to the last digit.
        let (sin, cos) = angle.sin_cos();
        let half = (angle * 0.5).sin();
        let (turned, side) = (axis * (2.0 * half * half), axis * sin);
        let column = |a: usize, e: DVec3| turned * axis[a] + side.cross(e) + e * cos;
        Transform::new(DAffine3::from_mat3(DMat3::from_cols(
            column(0, DVec3::X),
            column(1, DVec3::Y),
            column(2, DVec3::Z),
        )))
    }

    /// Turns as a quaternion does, which need not be unit.
    ///
    /// # Errors
    ///
    /// When the quaternion is zero or not finite.
    ///
    /// ```
    /// use rt_geom::{Parts, Transform, glam::DQuat};
    /// let turn = DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5);
    /// let map = Transform::from_quat(turn).unwrap();
    /// assert!(Parts::of(&map).rotation.abs_diff_eq(turn, 1e-15)); // the way back to a quaternion
    /// ```
    pub fn from_quat(rotation: DQuat) -> Result<Transform, TransformError> {
        let largest = rotation.to_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        if !rotation.is_finite() || largest == 0.0 {
            return Err(TransformError::NoDirection { of: "the quaternion" });
        }
        // Twice, so that neither tiny nor huge quaternions leave the range.
        let scaled = DQuat::from_array(rotation.to_array().map(|x| x / largest));
        Transform::new(DAffine3::from_mat3(DMat3::from_quat(scaled.normalize())))
    }

    /// The rotation that takes the direction `from` to the direction `to`, neither of which need be unit: the least
    /// one, except that opposite directions leave the axis open.
    ///
    /// The product of two reflections by way of a third direction, which no pair of directions makes unstable.
    ///
    /// Source: Möller and Hughes, "Efficiently building a matrix to rotate one vector to another", Journal of Graphics
    /// Tools 4(4) (1999).
    ///
    /// # Errors
    ///
    /// When one of them has no direction.
    ///
    /// ```
    /// use rt_geom::{Transform, glam::DVec3};
    /// let turn = Transform::rotation_between(DVec3::X, -DVec3::X).unwrap();
    /// assert!(turn.vector(DVec3::X).abs_diff_eq(-DVec3::X, 1e-15) && !turn.swaps_handedness());
    /// ```
    pub fn rotation_between(from: DVec3, to: DVec3) -> Result<Transform, TransformError> {
        let (f, t) = (direction(from, "from")?, direction(to, "to")?);
        let linear = if f.dot(t) > -0.5 {
            // 1 + f . t is far from zero: the rotation about f x t, in the form that keeps its digits at small angles.
            let v = f.cross(t);
            let h = 1.0 / (1.0 + f.dot(t));
            let skew = DMat3::from_cols(
                DVec3::new(0.0, v.z, -v.y),
                DVec3::new(-v.z, 0.0, v.x),
                DVec3::new(v.y, -v.x, 0.0),
            );
            DMat3::from_diagonal(DVec3::splat(f.dot(t)))
                + skew
                + DMat3::from_cols(v * (v.x * h), v * (v.y * h), v * (v.z * h))
        } else {
            // f to -f in the plane of both, or in any where they are opposite, then -f to t, which is near.
            let aside = unit(f.cross(t).cross(f)).unwrap_or_else(|| f.cross(nearest_across(f)).normalize());
            let half = reflect(f) * reflect(aside);
            return Transform::new(DAffine3::from_mat3(half))?.then(&Transform::rotation_between(-f, t)?);
        };
        Transform::new(DAffine3::from_mat3(linear))
    }

    /// Places an object at `eye` so that its `+z` axis points to `target` and its `+y` axis as nearly `up` as can be;
    /// its `+x` is to its left. From object space to the world; nothing is mirrored.
    ///
    /// # Errors
    ///
    /// When `target` is `eye`, or `up` has no direction across the line of sight.
    ///
    /// ```
    /// use rt_geom::{Transform, glam::DVec3};
    /// let place = Transform::look_at_object(DVec3::X, DVec3::X * 5.0, DVec3::Y).unwrap();
    /// assert_eq!(place.point(DVec3::Z), DVec3::X * 2.0);
    /// ```
    pub fn look_at_object(eye: DVec3, target: DVec3, up: DVec3) -> Result<Transform, TransformError> {
        let z = direction(target - eye, "the line of sight")?;
        let y = direction(up, "up")?;
        let x = y.cross(z);
        // Both are known within a few roundings: so is x, whose direction is lost when it is not longer than that.
        if x.length() <= 8.0 * f64::EPSILON {
            return Err(TransformError::NoDirection { of: "up, across the line of sight," });
        }
        let x = direction(x, "up, across the line of sight,")?;
        Transform::new(DAffine3 { matrix3: DMat3::from_cols(x, z.cross(x), z), translation: eye })
    }

    /// From the world to the space of a camera at `eye` that looks at `target`: `x` to its right, `y` up, and what it
    /// sees at negative `z`. The inverse places the camera in the world. Nothing is mirrored.
    ///
    /// # Errors
    ///
    /// When `target` is `eye`, or `up` has no direction across the line of sight.
    ///
    /// ```
    /// use rt_geom::{Transform, glam::DVec3};
    /// let view = Transform::look_at_camera(DVec3::ZERO, DVec3::Y, DVec3::Z).unwrap();
    /// assert_eq!(view.point(DVec3::new(1.0, 5.0, 2.0)), DVec3::new(1.0, 2.0, -5.0));
    /// ```
    pub fn look_at_camera(eye: DVec3, target: DVec3, up: DVec3) -> Result<Transform, TransformError> {
        // A half turn about y: the object's front is the camera's back.
        let about = Transform::scale(DVec3::new(-1.0, 1.0, -1.0))?;
        Ok(about.then(&Transform::look_at_object(eye, target, up)?)?.inverse())
    }
}

fn direction(v: DVec3, of: &'static str) -> Result<DVec3, TransformError> {
    unit(v).ok_or(TransformError::NoDirection { of })
}

/// The axis along which the unit vector `v` is shortest.
fn nearest_across(v: DVec3) -> DVec3 {
    let a = v.abs();
    if a.x <= a.y && a.x <= a.z {
        DVec3::X
    } else if a.y <= a.z {
        DVec3::Y
    } else {
        DVec3::Z
    }
}

/// The reflection in the plane across the unit vector `n`.
fn reflect(n: DVec3) -> DMat3 {
    DMat3::IDENTITY - DMat3::from_cols(n * (2.0 * n.x), n * (2.0 * n.y), n * (2.0 * n.z))
}

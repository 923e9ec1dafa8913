//! [`Parts`]: a transform as a stretch, then a rotation, then a translation.

use crate::invert::{exponent, invert, ldexp};
use crate::{Transform, TransformError};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A transform taken apart by polar decomposition: a point is stretched, then turned, then moved, `p -> R (S p) + t`.
///
/// The stretch is symmetric; its eigenvalues are the factors along its own three axes, all positive, or all negative
/// where the map mirrors. Of all rotations, `R` is the nearest to the linear part, so that what is between two
/// transforms taken apart so looks as if it moved rigidly.
///
/// Error: the parts make the map again within some 16 roundings of its largest entry. The rotation itself is as
/// uncertain as its question: by `u` times the largest stretch over the sum of the two smallest.
///
/// Source: Shoemake and Duff, "Matrix animation and polar decomposition" (1992); scaled by Higham, "Computing the polar
/// decomposition - with applications" (1986).
///
/// ```
/// use rt_geom::{Parts, Transform, glam::DVec3};
/// let map = Transform::scale(DVec3::new(1.0, 2.0, -3.0)).unwrap();
/// let parts = Parts::of(&map);
/// assert!(parts.transform().unwrap().swaps_handedness());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// Applied last.
    pub translation: DVec3,
    /// Applied second; unit.
    pub rotation: DQuat,
    /// Applied first; symmetric.
    pub stretch: DMat3,
}

impl Parts {
    /// Takes `map` apart. Cost: some ten inversions, about ten microseconds; a thousand for stretches near the range of
    /// `f64`.
    pub fn of(map: &Transform) -> Parts {
        let affine = map.affine();
        let m = affine.matrix3;
        let unit = -exponent(m.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs())));
        let mut r = DMat3::from_cols_array(&m.to_cols_array().map(|x| ldexp(x, unit)));
        // Each step halves a stretch that the scale does not remove: the range of f64 is used up after 2^11 of them.
        for _ in 0..2048 {
            let Ok(inverted) = invert(r) else { break };
            let back = inverted.inverse.transpose();
            let scale = (norms(back).0 / norms(r).0).powf(0.25) * (norms(back).1 / norms(r).1).powf(0.25);
            let scale = if (scale - 1.0).abs() < 1e-2 { 1.0 } else { scale };
            let next = (r * scale + back * (1.0 / scale)) * 0.5;
            let change = norms(next - r).1;
            r = next;
            // Convergence is quadratic: once a step moved by less than this, the next would move by its square.
            if change < 1e-12 {
                break;
            }
        }
        if map.swaps_handedness() {
            r = -r;
        }
        let s = r.transpose() * m;
        Parts {
            translation: affine.translation,
            rotation: DQuat::from_mat3(&r).normalize(),
            stretch: (s + s.transpose()) * 0.5,
        }
    }

    /// The parts as one map again.
    ///
    /// # Errors
    ///
    /// As [`Transform::new`].
    pub fn transform(&self) -> Result<Transform, TransformError> {
        Transform::new(DAffine3 {
            matrix3: DMat3::from_quat(self.rotation) * self.stretch,
            translation: self.translation,
        })
    }
}

/// The greatest sum of the absolute entries of a column, and of a row.
fn norms(m: DMat3) -> (f64, f64) {
    let greatest = |m: DMat3| {
        let a = m.abs();
        a.x_axis.element_sum().max(a.y_axis.element_sum()).max(a.z_axis.element_sum())
    };
    (greatest(m), greatest(m.transpose()))
}

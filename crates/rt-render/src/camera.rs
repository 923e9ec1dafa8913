//! [`Camera`]: a pinhole.

use core::fmt;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use rt_scenes::View;

/// A pinhole whose rays go through the corners of pixels.
///
/// Corner `k` of `n` pixels lies at `tan(angle / 2) * (2 k / n - 1)` off the axis: the outermost rays are exactly on the edge
/// of the field of view, and `n` pixels take `n + 1` rays. The field of view spans the height of the picture; pixels are
/// square. Row 0 is at the top. Pictures are seen from behind the camera: right is `forward x up`.
///
/// Directions are not unit: one length of them is one unit of depth along the axis.
///
/// Source: Haines, *Standard Procedural Databases*, version 3.14.
///
/// ```
/// use rt_geom::glam::DVec3;
/// use rt_render::Camera;
/// use rt_scenes::View;
/// let view = View { from: DVec3::new(0.0, -4.0, 0.0), at: DVec3::ZERO, up: DVec3::Z, angle: std::f64::consts::FRAC_PI_2 };
/// let camera = Camera::new(&view)?;
/// let ray = camera.corner::<f64>([0, 0], [512, 512]);
/// assert!((ray.dir - DVec3::new(-1.0, 1.0, 1.0)).length() < 1e-15);
/// assert_eq!(camera.corner::<f64>([256, 256], [512, 512]).dir, DVec3::Y);
/// # Ok::<(), rt_render::CameraError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    from: DVec3,
    forward: DVec3,
    /// Half the picture's height, to the right.
    right: DVec3,
    /// Half the picture's height, up.
    up: DVec3,
}

/// Why a view is no camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CameraError {
    /// A point or direction is not finite.
    NotFinite,
    /// The camera stands where it looks at.
    NoDirection,
    /// Up is along the line of sight, or zero.
    NoUp,
    /// The angle is not between 0 and pi.
    Angle(f64),
}

impl fmt::Display for CameraError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CameraError::NotFinite => write!(f, "the view holds a number that is not finite"),
            CameraError::NoDirection => write!(f, "the view looks from a point at the same point"),
            CameraError::NoUp => write!(f, "the view's up has no direction across the line of sight"),
            CameraError::Angle(angle) => {
                write!(f, "the field of view must be between 0 and pi radians, not {angle}")
            }
        }
    }
}

impl core::error::Error for CameraError {}

/// The direction of a vector of any finite length.
fn unit(v: DVec3) -> Option<DVec3> {
    // Of size 1 first, so that squares neither vanish nor overflow. One over a subnormal may be infinite; a quotient is not.
    (v / v.abs().max_element()).try_normalize()
}

impl Camera {
    /// The camera of a view.
    ///
    /// # Errors
    ///
    /// See [`CameraError`].
    pub fn new(view: &View) -> Result<Camera, CameraError> {
        if !(view.from.is_finite() && view.at.is_finite() && view.up.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if !(view.angle > 0.0 && view.angle < std::f64::consts::PI) {
            return Err(CameraError::Angle(view.angle));
        }
        let way = view.at - view.from;
        let way = if way.is_finite() { way } else { view.at * 0.5 - view.from * 0.5 };
        let forward = unit(way).ok_or(CameraError::NoDirection)?;
        let up = unit(view.up).ok_or(CameraError::NoUp)?;
        let right = forward.cross(up);
        // Nearly parallel: what is left of the cross product is rounding.
        if right.length() < 1e-12 {
            return Err(CameraError::NoUp);
        }
        let right = right.normalize();
        let half = (view.angle / 2.0).tan();
        Ok(Camera { from: view.from, forward, right: right * half, up: right.cross(forward) * half })
    }

    /// The ray through corner `[column, row]` of a picture of `[width, height]` pixels.
    pub fn corner<R: Real>(&self, [column, row]: [u32; 2], [width, height]: [u32; 2]) -> Ray<R> {
        let (w, h) = (width as f64, height as f64);
        let x = (2.0 * column as f64 - w) / h;
        let y = 1.0 - 2.0 * row as f64 / h;
        let dir = self.forward + self.right * x + self.up * y;
        Ray::new(R::Vec3::nearest(self.from), R::Vec3::nearest(dir))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        View { from: DVec3::new(2.1, 1.3, 1.7), at: DVec3::ZERO, up: DVec3::Z, angle: 45f64.to_radians() }
    }

    #[test]
    fn the_outermost_rays_lie_on_the_edge_of_the_field_of_view() {
        let camera = Camera::new(&view()).unwrap();
        for size in [1, 7, 512] {
            let middle = [size, 2 * size];
            let top = camera.corner::<f64>([middle[0], 0], [middle[1], size]);
            let bottom = camera.corner::<f64>([middle[0], size], [middle[1], size]);
            assert!((top.dir.angle_between(bottom.dir) - view().angle).abs() < 1e-12);
            assert!(top.dir.z > bottom.dir.z);
        }
    }

    #[test]
    fn views_of_any_size_have_directions() {
        let near = Camera::new(&view()).unwrap();
        for size in [5e-324, 1e-310, 1e-200, 1e154, 1e300, 1.7e308] {
            let (from, at) = (DVec3::new(0.0, -size, 0.0), DVec3::new(0.0, size, 0.0));
            let camera = Camera::new(&View { from, at, up: DVec3::Z * size, ..view() }).unwrap();
            assert_eq!(camera.corner::<f64>([1, 1], [2, 2]).dir, DVec3::Y, "{size:e}");
            assert_eq!(camera.right.length(), near.right.length());
        }
    }

    #[test]
    fn views_without_a_picture_say_why() {
        let bad = |change: &dyn Fn(&mut View)| {
            let mut view = view();
            change(&mut view);
            Camera::new(&view).unwrap_err()
        };
        assert_eq!(bad(&|v| v.at = v.from), CameraError::NoDirection);
        assert_eq!(bad(&|v| v.up = v.at - v.from), CameraError::NoUp);
        assert_eq!(bad(&|v| v.up = DVec3::ZERO), CameraError::NoUp);
        assert_eq!(bad(&|v| v.from.x = f64::NAN), CameraError::NotFinite);
        assert_eq!(bad(&|v| v.angle = 4.0), CameraError::Angle(4.0));
        assert!(matches!(bad(&|v| v.angle = f64::NAN), CameraError::Angle(_)));
    }
}

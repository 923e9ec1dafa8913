//! The surface record of a hit: the point carried onto the zeros of the form.

use super::form::{Form, Number, offset as from_anchor, signed, size, uncertain};
use crate::Surface;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector};

const U: f64 = f64::EPSILON / 2.0;

/// The point of the ray at `t`, from the anchor of the form.
pub(super) fn offset<F: Form, R: Real>(form: &F, ray: &Ray<R>, t: R) -> DVec3 {
    let w =
        from_anchor(form.extent().anchor, ray.origin.widen(), ray.dir.widen(), DoubleDouble::from(t.into()));
    DVec3::from_array(w.map(Number::value))
}

/// The value of the form at a point of the world, its error, and its gradient.
fn value<F: Form>(form: &F, point: DVec3) -> (f64, f64, DVec3, f64) {
    let extent = form.extent();
    let w = from_anchor(extent.anchor, point, DVec3::ZERO, DoubleDouble::from(0.0));
    let (u, slope) = (form.at(w), form.slope());
    let signs = form.signs();
    let f = signed(signs, &u.squares, &u.squares) - slope * u.axial;
    let (eta, _) = uncertain::<DoubleDouble, F>(form, &w, point, DVec3::ZERO, 0.0);
    let off = 3.0 * size(&u) * eta + 4.0 * eta * eta + 2.0 * slope.value().abs() * eta;
    let weights = [0, 1, 2, 3].map(|i| 2.0 * signs[i] * u.squares[i].value());
    (f.value(), off, form.transposed(weights, -slope.value()), u.axial.value())
}

/// The record at the point of the surface next to `w`, which is given from the anchor.
///
/// The point is moved along the gradient of the form, evaluated with twice the digits, until the residual no longer falls; the
/// residual over the gradient is then what it is off by, along the normal. The bound adds two roundings of the size of the
/// numbers involved, so that rays that leave are clear of what an intersection cannot tell from the surface.
pub(super) fn of<F: Form>(form: &F, w: DVec3, uv: impl Fn(DVec3) -> DVec2) -> Surface {
    let extent = form.extent();
    let along = form.transposed([0.0; 4], 1.0);
    let [low, high] = extent.limits.map(DoubleDouble::value);
    let mut point = extent.anchor + w;
    for _ in 0..4 {
        let (f, _, gradient, axial) = value(form, point);
        // Beyond a rim: back to it, and then within its plane.
        let beyond = axial - axial.clamp(low, high);
        let (mut to, mut gradient) = (DVec3::ZERO, gradient);
        if beyond != 0.0 {
            to = along * (-beyond / along.length_squared());
            let flat = gradient - along * (gradient.dot(along) / along.length_squared());
            if flat.length_squared() > 1e-12 * gradient.length_squared() {
                gradient = flat;
            }
        }
        let step = to - gradient * (f / gradient.length_squared());
        if !step.is_finite() || point + step == point {
            break;
        }
        point += step;
    }
    let (f, off, gradient, _) = value(form, point);
    let steep = gradient.length();
    let normal = (gradient / steep).try_normalize().unwrap_or_else(|| along.normalize());
    let near = if steep > 0.0 { 2.0 * (f.abs() + off) / steep } else { 0.0 };
    let local = point - extent.anchor;
    let rounded = 2.0 * U * (local.abs().max_element() + extent.radius + point.abs().max_element());
    let error = normal.abs() * (near * (1.0 + 8.0 * U)) + DVec3::splat(rounded);
    Surface { point, error, normal, shading: normal, uv: uv(local) }
}

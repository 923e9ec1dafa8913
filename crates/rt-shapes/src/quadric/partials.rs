//! The Weingarten equations.

use crate::Partials;
use rt_geom::glam::DVec3;

/// Derivatives of the unit normal from those of the point: `second` are those along uu, uv and vv. Zero where the parameters
/// do not span a plane.
///
/// The signs of the normal and of its derivatives go together, whichever side it is on.
///
/// Source: do Carmo, *Differential Geometry of Curves and Surfaces* (1976), section 3.3.
pub(super) fn weingarten(dpdu: DVec3, dpdv: DVec3, second: [DVec3; 3], normal: DVec3) -> Partials {
    let (ee, ff, gg) = (dpdu.dot(dpdu), dpdu.dot(dpdv), dpdv.dot(dpdv));
    let [e, f, g] = second.map(|p| normal.dot(p));
    let area = dpdu.cross(dpdv).length_squared(); // E G - F^2, without its cancellation
    let (dndu, dndv) = (
        dpdu * ((f * ff - e * gg) / area) + dpdv * ((e * ff - f * ee) / area),
        dpdu * ((g * ff - f * gg) / area) + dpdv * ((f * ff - g * ee) / area),
    );
    let flat = !(dndu.is_finite() && dndv.is_finite());
    let [dndu, dndv] = if flat { [DVec3::ZERO; 2] } else { [dndu, dndv] };
    Partials { dpdu, dpdv, dndu, dndv }
}

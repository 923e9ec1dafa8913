//! [`Sweep`]: a range of angles about the axis, decided by signs.

use super::QuadricError;
use rt_geom::glam::DVec2;
use std::f64::consts::{PI, TAU};

/// The angles from one direction counter-clockwise to another: less than a full turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sweep {
    /// The directions it begins and ends with, of unit length up to rounding. They are what is meant, not the angles.
    pub(super) ends: [DVec2; 2],
    /// Whether it is more than half a turn: what is beyond one end may still be within the other.
    pub(super) reflex: bool,
}

impl Sweep {
    /// From one angle to a larger one, at most a turn further; `None` for a full turn, up to the rounding of the angles.
    pub(super) fn new([from, to]: [f64; 2]) -> Result<Option<Sweep>, QuadricError> {
        let slack = 4.0 * f64::EPSILON * from.abs().max(to.abs()).max(TAU);
        if !(from.is_finite() && to - from > 0.0 && to - from <= TAU + slack) {
            return Err(QuadricError::Sweep { from, to });
        }
        let ends = [from, to].map(direction);
        Ok((to - from < TAU - slack).then_some(Sweep { ends, reflex: to - from > PI }))
    }

    /// Whether a direction lies within, ends included.
    pub(super) fn contains(&self, p: DVec2) -> bool {
        let [from, to] = [self.ends[0].perp_dot(p) >= 0.0, p.perp_dot(self.ends[1]) >= 0.0];
        if self.reflex { from || to } else { from && to }
    }
}

/// The direction at an angle.
pub(super) fn direction(phi: f64) -> DVec2 {
    DVec2::new(phi.cos(), phi.sin())
}

/// Where `p` lies between two angles, from 0 to 1; outside, the nearer end.
pub(crate) fn share([from, to]: [f64; 2], p: DVec2) -> f64 {
    let (start, range) = (direction(from), to - from);
    let phi = start.perp_dot(p).atan2(start.dot(p));
    let phi = if phi < 0.0 { phi + TAU } else { phi };
    if phi <= range {
        phi / range
    } else if phi - range < TAU - phi {
        1.0
    } else {
        0.0
    }
}

/// The box of the arc of directions times `radius`, where `sweep` counts from the direction `zero`, of any length; rounded
/// outward where it is not exact.
pub(super) fn arc(sweep: Option<&Sweep>, zero: DVec2, radius: f64) -> [DVec2; 2] {
    let mut span = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    let mut grow = |p: DVec2| span = [span[0].min(p), span[1].max(p)];
    for axis in [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y] {
        let relative = DVec2::new(zero.dot(axis), zero.perp_dot(axis));
        if sweep.is_none_or(|sweep| sweep.contains(relative)) {
            grow(axis * radius);
        }
    }
    for end in sweep.iter().flat_map(|sweep| sweep.ends) {
        // Both directions are rounded, and so is the product: outward by more than that.
        let p = (zero / zero.abs().max_element()).normalize().rotate(end) * radius;
        let pad = DVec2::splat(8.0 * f64::EPSILON * radius);
        grow((p - pad).max(DVec2::splat(-radius)));
        grow((p + pad).min(DVec2::splat(radius)));
    }
    span
}

//! [`Sweep`]: a range of angles about the axis, decided by signs.

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
    /// From one angle to a larger one; `None` for a full turn, up to the rounding of the angles.
    pub(super) fn new(from: f64, to: f64) -> Option<Sweep> {
        let slack = 4.0 * f64::EPSILON * from.abs().max(to.abs()).max(TAU);
        let ends = [from, to].map(|phi| DVec2::new(phi.cos(), phi.sin()));
        (to - from < TAU - slack).then_some(Sweep { ends, reflex: to - from > PI })
    }

    /// Whether a direction of angle 0, 90, 180 or 270 degrees, or any other, lies within.
    pub(super) fn contains(&self, p: DVec2) -> bool {
        let [from, to] = [self.ends[0].perp_dot(p) >= 0.0, p.perp_dot(self.ends[1]) >= 0.0];
        if self.reflex { from || to } else { from && to }
    }
}

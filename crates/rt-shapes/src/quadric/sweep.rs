//! [`Sweep`]: a range of angles about the axis, decided by signs.

use super::QuadricError;
use rt_geom::expansion::Expansion;
use rt_geom::glam::DVec2;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Beyond this angle, 2^20 radians, the rounding of angles is no small angle. Up to it a full turn is told within `2^-27` of a radian, and
/// ends are moved by less than `2^-28`.
const LARGEST: f64 = 1_048_576.0;

/// The angles from one direction counter-clockwise to another: less than a full turn, both ends included.
///
/// One angle has one direction, whichever end it is of; multiples of a quarter turn, up to rounding, have the axes. So parts that
/// abut share their border bit for bit, and what is within rounding of it belongs to both. A number outside of `[0, 2 pi)` may be
/// another's with turns added or taken away, which rounds: an end that has such a one lies further out by more than that.
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
        let none = Err(QuadricError::Sweep { from, to });
        // Also false for NaN and the infinities.
        if !(from.abs() <= LARGEST && to.abs() <= LARGEST) {
            return none;
        }
        let slack = 4.0 * f64::EPSILON * from.abs().max(to.abs()).max(TAU);
        if !(to - from > 0.0 && to - from <= TAU + slack) {
            return none;
        }
        if to - from >= TAU - 8.0 * slack {
            return Ok(None);
        }
        let ends = [end(from, -1.0), end(to, 1.0)];
        // By the directions, which may be further apart than the angles, or less far.
        let turn = cross(ends[0], ends[1]);
        let reflex = if (to - from - PI).abs() < 1.0 { turn < 0 } else { to - from > PI };
        if to - from < 1.0 && turn <= 0 {
            return none;
        }
        Ok(Some(Sweep { ends, reflex }))
    }

    /// Whether a direction lies within, ends included.
    pub(super) fn contains(&self, p: DVec2) -> bool {
        let [from, to] = [self.ends[0].perp_dot(p) >= 0.0, p.perp_dot(self.ends[1]) >= 0.0];
        if self.reflex { from || to } else { from && to }
    }
}

/// The direction that a sweep ends with, outward being `-1` or `1`.
fn end(phi: f64, outward: f64) -> DVec2 {
    let within = (0.0..TAU).contains(&phi);
    // Half as far from an axis where turns may have been added to a number: so whichever has the axis, the one within has it.
    let near = if within { 4.0 } else { 2.0 } * f64::EPSILON * TAU;
    let quarter = (phi / FRAC_PI_2).round();
    if phi.abs() <= 2.0 * TAU && (phi - quarter * FRAC_PI_2).abs() <= near {
        return [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y][quarter.rem_euclid(4.0) as usize];
    }
    direction(if within { phi } else { phi + outward * 8.0 * f64::EPSILON * phi.abs().max(TAU) })
}

/// The sign of the cross product, exactly.
fn cross(a: DVec2, b: DVec2) -> i32 {
    let product = |x: f64, y: f64| -> Expansion<2> { Expansion::<1>::new(x).scaled(y) };
    let difference: Expansion<4> = product(a.x, b.y).minus(&product(a.y, b.x));
    difference.sign()
}

/// The direction at an angle.
pub(crate) fn direction(phi: f64) -> DVec2 {
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

//! [`Motion`]: a transform that changes over time.

use crate::invert::invert;
use crate::{Parts, Transform, TransformError};
use glam::{DMat3, DQuat, DVec3};

/// Beyond this size of a translation, a stretch or its inverse a motion is refused: so no sum of a few of them overflows.
const LARGE: f64 = f64::MAX / 16.0;

/// How much the condition that [`Transform::new`] refuses may exceed `|S| |S^-1|`, in Frobenius norms, between two
/// stretches whose norms these bound.
///
/// With rows and columns brought to size 1 by powers of two, entry `i, j` of `|A^-1| |A|` is at most `2 sqrt(3) |a'_i|
/// |a_i|` for the row `a'_i` of the inverse and the column `a_i`, hence a row sum at most `6 sqrt(3) < 10.4` times their
/// product. Up to [`Transform::MAX_CONDITION`] the rounding of `R S` changes that by less than a hundredth. The norm of
/// [`Transform::condition`] needs a factor of 3 only.
const ROOM: f64 = 12.0;

/// The way from one transform at time 0 to another at time 1: translation and stretch go straight, the rotation turns
/// the shorter way at constant speed.
///
/// Both ends are kept as they were given. In between the map is `T(time) R(time) S(time)`, the parts of [`Parts`]; it
/// can be inverted at every time, because stretches between two positive ones are positive. Between opposite poses of
/// one axis both ways are equally short, and rounding picks one.
///
/// Source: Shoemake, "Animating rotation with quaternion curves" (1985); Shoemake and Duff, "Matrix animation and polar
/// decomposition" (1992).
///
/// ```
/// use rt_geom::{Motion, Transform, glam::DVec3};
/// let turn = Transform::rotation(DVec3::Z, std::f64::consts::FRAC_PI_2).unwrap();
/// let motion = Motion::new(Transform::IDENTITY, turn).unwrap();
/// let half = std::f64::consts::FRAC_1_SQRT_2;
/// assert!(motion.at(0.5).point(DVec3::X).abs_diff_eq(DVec3::new(half, half, 0.0), 1e-15));
/// assert_eq!(motion.at(1.0), turn);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    start: Transform,
    end: Transform,
    from: Parts,
    to: Parts,
    /// Half the angle of the turn, in `[0, pi / 2]`.
    half_angle: f64,
    /// Across `from.rotation`, on the arc to `to.rotation`; as far from unit as the rounding of tiny angles leaves it.
    across: DQuat,
    condition: f64,
}

impl Motion {
    /// The motion from `start` to `end`.
    ///
    /// # Errors
    ///
    /// [`TransformError::NotFinite`] when a translation is not finite, or a translation or a stretch so large or so
    /// small that something between may leave the range of `f64`.
    /// [`TransformError::Mirrors`] when one of them swaps handedness and the other does not.
    /// [`TransformError::Singular`] when their stretches are such, or differ so, that something between may have a
    /// condition above [`Transform::MAX_CONDITION`]: from a stretch of about `1 : 8e10` on, for what turns between.
    pub fn new(start: Transform, end: Transform) -> Result<Motion, TransformError> {
        let within = |v: DVec3| v.abs().cmple(DVec3::splat(LARGE)).all();
        if !(within(start.affine().translation) && within(end.affine().translation)) {
            return Err(TransformError::NotFinite);
        }
        if start.swaps_handedness() != end.swaps_handedness() {
            return Err(TransformError::Mirrors);
        }
        let (from, mut to) = (Parts::of(&start), Parts::of(&end));
        if from.rotation.dot(to.rotation) < 0.0 {
            to.rotation = -to.rotation;
        }
        let (a, b) = (from.rotation, to.rotation);
        // Not by the arc cosine, which sees no angle below 1e-8.
        let half_angle = 2.0 * (a - b).length().atan2((a + b).length());
        let (sin, cos) = half_angle.sin_cos();
        // What is lost here to cancellation at small angles is multiplied by small sines again.
        let across = if sin == 0.0 { b * 0.0 } else { (b - a * cos) * (1.0 / sin) };
        let size = frobenius(from.stretch).max(frobenius(to.stretch));
        let back = frobenius(invert(from.stretch)?.inverse).max(frobenius(invert(to.stretch)?.inverse));
        if !(size <= LARGE && back <= LARGE && from.rotation.is_finite() && across.is_finite()) {
            return Err(TransformError::NotFinite);
        }
        let condition = size * back * ROOM;
        if condition > Transform::MAX_CONDITION || condition.is_nan() {
            return Err(TransformError::Singular { condition });
        }
        Ok(Motion { start, end, from, to, half_angle, across, condition })
    }

    /// The transform at a time between 0 and 1. Earlier times are 0, later ones 1, and NaN is 0.
    ///
    /// Error: a point is carried within `64 u` of the size of the terms it is the sum of. Cost: one inversion, about a
    /// microsecond.
    pub fn at(&self, time: f64) -> Transform {
        if time >= 1.0 {
            return self.end;
        }
        if time <= 0.0 || time.is_nan() {
            return self.start;
        }
        let (sin, cos) = (self.half_angle * time).sin_cos();
        let parts = Parts {
            translation: self.from.translation * (1.0 - time) + self.to.translation * time,
            rotation: (self.from.rotation * cos + self.across * sin).normalize(),
            stretch: self.from.stretch * (1.0 - time) + self.to.stretch * time,
        };
        // Never refused: the constructor has seen to it. Were it refused, no answer would be better than a wrong one.
        let map = parts.transform();
        debug_assert!(map.is_ok(), "{map:?} within {:e}", self.condition);
        map.unwrap_or(Transform::NOWHERE)
    }

    /// The curve along which the motion carries the point `p`.
    pub fn path(&self, p: DVec3) -> Path {
        let (q, r) = (self.from.rotation, self.across);
        // R(q cos + r sin) = R(q) cos^2 + R(r) sin^2 + B(q, r) cos sin, in double angles.
        let (begin, side, mixed) = (turn(q, q), turn(r, r), turn(q, r));
        let (mean, swing) = ((begin + side) * 0.5, (begin - side) * 0.5);
        let (v, dv) = (self.from.stretch * p, (self.to.stretch - self.from.stretch) * p);
        Path {
            fixed: self.from.translation + mean * v,
            linear: self.to.translation - self.from.translation + mean * dv,
            cos: [swing * v, swing * dv],
            sin: [mixed * v, mixed * dv],
            angle: 2.0 * self.half_angle,
            size: (self.from.translation.abs().max(self.to.translation.abs()))
                + DVec3::splat(frobenius(self.from.stretch).max(frobenius(self.to.stretch)) * p.length())
                // The ends are kept as they were given, and what cancels in them is in no part.
                + self.start.terms(p).max(self.end.terms(p)),
        }
    }

    /// The transform at time 0.
    pub fn start(&self) -> &Transform {
        &self.start
    }

    /// The transform at time 1.
    pub fn end(&self) -> &Transform {
        &self.end
    }

    /// A bound on the condition of every transform between, in the norm of [`Transform::condition`] and in that by
    /// which [`Transform::new`] refuses.
    pub fn condition(&self) -> f64 {
        self.condition
    }
}

/// The curve of a point carried by a [`Motion`]: at `time` in `[0, 1]`
/// `fixed + linear time + (cos[0] + cos[1] time) cos(angle time) + (sin[0] + sin[1] time) sin(angle time)`.
///
/// ```
/// use rt_geom::{Motion, Transform, glam::DVec3};
/// let motion = Motion::new(Transform::IDENTITY, Transform::translation(DVec3::X * 3.0)).unwrap();
/// assert_eq!(motion.path(DVec3::Y).at(0.5), DVec3::new(1.5, 1.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Where the curve is, but for the rest.
    pub fixed: DVec3,
    /// What grows with time.
    pub linear: DVec3,
    /// What goes with the cosine: a fixed part and one that grows with time.
    pub cos: [DVec3; 2],
    /// What goes with the sine: a fixed part and one that grows with time.
    pub sin: [DVec3; 2],
    /// The angle turned in all, in `[0, pi]` but for rounding.
    pub angle: f64,
    /// The size of the terms the curve was made from, and of those by which the maps at both ends carry the point: the
    /// curve and [`Motion::at`] are off by at most `64 u` times this.
    pub size: DVec3,
}

impl Path {
    /// The point at a time.
    pub fn at(&self, time: f64) -> DVec3 {
        let (sin, cos) = (self.angle * time).sin_cos();
        self.fixed
            + self.linear * time
            + (self.cos[0] + self.cos[1] * time) * cos
            + (self.sin[0] + self.sin[1] * time) * sin
    }
}

/// The rotation by `q`, times its squared length, as a form in two arguments: `R(q + r)` is
/// `turn(q, q) + 2 turn(q, r) + turn(r, r)`.
fn turn(q: DQuat, r: DQuat) -> DMat3 {
    let (u, v) = (DVec3::new(q.x, q.y, q.z), DVec3::new(r.x, r.y, r.z));
    let column = |e: DVec3| {
        e * (q.w * r.w - u.dot(v)) + v * u.dot(e) + u * v.dot(e) + v.cross(e) * q.w + u.cross(e) * r.w
    };
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

fn frobenius(m: DMat3) -> f64 {
    let largest = m.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * m.to_cols_array().into_iter().map(|x| (x / largest) * (x / largest)).sum::<f64>().sqrt()
}

//! Where a line meets a [`Form`]: first in `f64` with bounds, then with twice the digits where the bounds leave something open.

use super::Root;
use super::form::{Coefficients, Extent, Form, Number, offset, signed, size, uncertain};
use crate::Uv;
use core::ops::ControlFlow;
use rt_accel::Hit;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector};

const U: f64 = f64::EPSILON / 2.0;
/// A discriminant this much larger than its error gives roots that Newton's steps converge from: to all digits in three.
const CLEAR: f64 = 4096.0;
/// The relative error of a root that decides: what twice the digits give, nearly.
const GOAL: f64 = f64::from_bits((1023 - 95) << 52); // 2^-95

/// Whether products of four such factors stay in range; false for NaN.
#[inline(always)]
fn moderate(x: f64) -> bool {
    x > 1e-60 && x < 1e60
}

/// A root off by no more than `error`, as first found in `f64` or with twice the digits.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    t: DoubleDouble,
    error: f64,
    digits: Digits,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Digits {
    Single,
    Double,
    /// Twice the digits, and still one or two roots: steps would lead to one of two.
    Touching,
}

/// Each hit of the ray on the surface, nearest first.
#[inline]
pub(super) fn hits<F: Form, R: Real>(
    form: &F,
    ray: &Ray<R>,
    mut each: impl FnMut(R) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let (o, d) = (ray.origin.widen(), ray.dir.widen());
    let extent = form.extent();
    let (reach, speed) = ((o - extent.anchor).abs().max_element().max(extent.radius), d.abs().max_element());
    if !(moderate(reach) && moderate(extent.radius) && moderate(speed)) {
        for root in roots_scaled(form, o, d).into_iter().flatten() {
            if let Some(t) = ray.admit(root.t) {
                each(t)?;
            }
        }
        return ControlFlow::Continue(());
    }
    let Some(found) = candidates(form, o, d) else { return ControlFlow::Continue(()) };
    let mut last = f64::NEG_INFINITY;
    for candidate in found.into_iter().flatten() {
        if let Some(root) = settle::<F, R>(form, o, d, candidate, ray.t_min.into(), ray.t_max.reach()) {
            // In order, whatever the digits of either.
            last = root.t.max(last);
            if let Some(t) = ray.admit(last) {
                each(t)?;
            }
        }
    }
    ControlFlow::Continue(())
}

/// The first hit.
#[inline(always)]
pub(super) fn closest<F: Form, R: Real>(form: &F, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
    let mut first = None;
    let _ = hits(form, ray, |t| {
        first = Some(Hit { t, at: Uv::default() });
        ControlFlow::Break(())
    });
    first
}

/// Both roots on the surface, whatever their sign, with their errors.
pub(super) fn roots<F: Form>(form: &F, o: DVec3, d: DVec3) -> [Option<Root>; 2] {
    let extent = form.extent();
    let (reach, speed) = ((o - extent.anchor).abs().max_element().max(extent.radius), d.abs().max_element());
    if moderate(reach) && moderate(extent.radius) && moderate(speed) {
        return roots_in_range(form, o, d);
    }
    roots_scaled(form, o, d)
}

fn roots_in_range<F: Form>(form: &F, o: DVec3, d: DVec3) -> [Option<Root>; 2] {
    let all = f64::INFINITY;
    let found = candidates(form, o, d).unwrap_or_default();
    let [near, far] = found.map(|c| settle::<F, f64>(form, o, d, c?, -all, all));
    // In order, whatever the digits of either.
    let least = near.map_or(-all, |root| root.t);
    [near, far.map(|far| Root { t: far.t.max(least), error: far.error + (least - far.t).max(0.0) })]
}

/// [`roots`] for sizes whose products leave the range of `f64`: the same surface and line, in other units.
#[cold]
fn roots_scaled<F: Form>(form: &F, o: DVec3, d: DVec3) -> [Option<Root>; 2] {
    let extent = form.extent();
    let size = (o - extent.anchor).abs().max_element().max(extent.radius);
    let speed = d.abs().max_element();
    if !(size.is_finite() && o.is_finite() && d.is_finite()) || speed == 0.0 {
        return [None; 2];
    }
    let power = |x: f64| f64::from_bits((x.to_bits() >> 52).clamp(30, 2000) << 52);
    let (unit, pace) = (power(size), power(speed));
    // In the order that stays in range.
    let back = |t: f64| if (t * unit).is_finite() { t * unit / pace } else { t / pace * unit };
    roots_in_range(&form.scaled(1.0 / unit), o / unit, d / pace)
        .map(|root| root.map(|root| Root { t: back(root.t), error: back(root.error) }))
}

/// The roots near enough to the surface, lesser first.
#[inline(always)]
fn candidates<F: Form>(form: &F, o: DVec3, d: DVec3) -> Option<[Option<Candidate>; 2]> {
    let extent = form.extent();
    // From here on distances count from the point of the line nearest to the middle: what lies far away does not cancel.
    let l = o - extent.anchor - extent.middle;
    let speed = d.dot(d);
    let t = -l.dot(d) / speed;
    let reach = reach(extent, o, d, t);
    let p = l + d * t;
    if p.dot(p) > reach * reach {
        return None;
    }
    let span = 2.0 * reach / speed.sqrt();
    let k = Coefficients::<f64>::new(form, o, d, t);
    let (a, b, c, off) = (k.a, k.b, k.c, k.off);
    let discriminant = b * b - a * c;
    let doubt = doubt::<f64>(a, b, c, off);
    if discriminant < -doubt {
        return None;
    }
    let root = discriminant.sqrt();
    let q = if b < 0.0 { root - b } else { -b - root };
    // The root at q / a may be so far away that the error of a does not matter.
    let away = q.abs() > span * (a.abs() + off[0]);
    if discriminant > CLEAR * doubt && (away || a.abs() > CLEAR * off[0]) {
        let candidate = |s: f64| Candidate {
            t: (t + s).into(),
            error: (off[2] + 2.0 * s.abs() * off[1] + s * s * off[0]) / root + 2.0 * U * (t.abs() + s.abs()),
            digits: Digits::Single,
        };
        let first = candidate(c / q);
        if away {
            return Some([Some(first), None]);
        }
        let second = candidate(q / a);
        let both = if first.t.value() <= second.t.value() { [first, second] } else { [second, first] };
        return Some(both.map(Some));
    }
    candidates_wide(form, o, d, t, span)
}

/// How far from the middle a point of the line may lie that is on the surface.
#[inline(always)]
fn reach(extent: &Extent, o: DVec3, d: DVec3, t: f64) -> f64 {
    let off = super::form::spread::<f64>(extent.anchor, o, d, t) + U * extent.middle.abs().max_element();
    (extent.radius + 8.0 * off) * (1.0 + 16.0 * U)
}

/// Bound on the error of `b b - a c`.
#[inline(always)]
fn doubt<T: Number>(a: f64, b: f64, c: f64, off: [f64; 3]) -> f64 {
    2.0 * b.abs() * off[1]
        + off[1] * off[1]
        + a.abs() * off[2]
        + c.abs() * off[0]
        + off[0] * off[2]
        + 4.0 * T::U * (b * b + (a * c).abs())
}

/// The same with twice the digits, for lines so close to tangent, or so long beside what they meet, that `f64` leaves the
/// decision open. What even these digits leave open is taken for a tangent: a hit.
#[cold]
#[inline(never)]
fn candidates_wide<F: Form>(
    form: &F,
    o: DVec3,
    d: DVec3,
    mut t: f64,
    span: f64,
) -> Option<[Option<Candidate>; 2]> {
    // Once more nearer: to the middle between the roots, where the linear term vanishes.
    for _ in 0..2 {
        let k = Coefficients::<DoubleDouble>::new(form, o, d, t);
        let shift = -k.b.value() / k.a.value();
        if shift.abs() <= span {
            t += shift;
        }
    }
    let k = Coefficients::<DoubleDouble>::new(form, o, d, t);
    let (a, b, c, off) = (k.a.value(), k.b.value(), k.c.value(), k.off);
    let discriminant = k.b * k.b - k.a * k.c;
    let doubt = doubt::<DoubleDouble>(a, b, c, off);
    if discriminant.value() < -doubt || discriminant.value().is_nan() {
        return None;
    }
    let zero = DoubleDouble::from(0.0);
    // Only what is certainly two is two.
    let root = if discriminant.value() > doubt { discriminant.sqrt() } else { zero };
    let q = if b < 0.0 { root - k.b } else { zero - k.b - root };
    // By how much the root of the discriminant may be off.
    let blur = if root.value() > 0.0 { (doubt / root.value()).min(doubt.sqrt()) } else { doubt.sqrt() };
    let candidate = |s: DoubleDouble| {
        let (at, s) = (DoubleDouble::from(t) + s, s.value());
        let by_slope = (off[2] + 2.0 * s.abs() * off[1] + s * s * off[0]) / root.value();
        let by_half = (blur + off[1] + s.abs() * off[0]) / a.abs();
        // Either may be NaN, where the other is not.
        let own = if root.value() * root.value() > 4.0 * doubt { by_slope.min(by_half) } else { by_half };
        let rounded = DoubleDouble::U * (t.abs() + s.abs());
        Candidate { t: at, error: 2.0 * own + 4.0 * rounded, digits: Digits::Double }
    };
    let near = |c: &Candidate| (c.t.value() - t).abs() <= 2.0 * span + c.error;
    if root.value() == 0.0 && a.abs() > off[0] {
        return Some([Some(Candidate { digits: Digits::Touching, ..candidate(q / k.a) }), None]);
    }
    if q.value() == 0.0 {
        // All of the line lies in the surface, which it then does not cross.
        return None;
    }
    let second = if a.abs() > off[0] { Some(candidate(q / k.a)).filter(near) } else { None };
    let first = Some(candidate(k.c / q)).filter(near);
    Some(match (first, second) {
        (Some(x), Some(y)) if (y.t - x.t).value() < 0.0 => [Some(y), Some(x)],
        (None, y) => [y, None],
        both => [both.0, both.1],
    })
}

/// Newton's steps on `f` evaluated with twice the digits, until they no longer matter.
///
/// On a quadratic, `e` away from a root, a step `f / f'` leaves `a e^2 / f'`; and `e` is at most two steps while
/// `4 |a f| <= f'^2`. So each step tells what error it leaves; they end when that is below `goal` times the root. Between steps
/// the root keeps all its digits: far from the origin, what `f64` drops of it is much to the surface.
#[inline(never)]
fn polish<F: Form>(form: &F, o: DVec3, d: DVec3, candidate: &Candidate, goal: f64) -> Option<Candidate> {
    if candidate.digits == Digits::Touching {
        return None;
    }
    let anchor = form.extent().anchor;
    let (signs, slope) = (form.signs(), form.slope());
    let v = form.linear::<DoubleDouble>(d.to_array().map(DoubleDouble::from));
    let fast = v.squares.map(DoubleDouble::value);
    let a = signed(signs, &fast, &fast);
    let mut t = candidate.t;
    for round in 0..6 {
        let w = offset(anchor, o, d, t);
        let u = form.at(w);
        let f = (signed(signs, &u.squares, &u.squares) - slope * u.axial).value();
        let derivative =
            2.0 * signed(signs, &u.squares.map(DoubleDouble::value), &fast) - slope.value() * v.axial.value();
        let (eta, _) = uncertain::<DoubleDouble, F>(form, &w, o, d, t.value());
        let (us, vs) = (size(&u), fast.iter().map(|x| x.abs()).sum::<f64>());
        let off = 3.0 * us * eta + 4.0 * eta * eta + 2.0 * slope.value().abs() * eta;
        let tilt = 16.0 * U * (us * vs + slope.value().abs() * v.axial.value().abs());
        let step = f / derivative;
        if !(4.0 * (a * f).abs() <= derivative * derivative && derivative.abs() > 2.0 * tilt) {
            return None;
        }
        t = t - step.into();
        let floor = 2.0 * off / derivative.abs();
        let left = (4.0 * a.abs() * step * step + 2.0 * tilt * step.abs()) / derivative.abs() + floor;
        if left <= goal * t.value().abs() || (left <= 2.0 * floor && round > 0) || round == 5 {
            let rounded = 4.0 * DoubleDouble::U * t.value().abs();
            let error = 2.0 * left + rounded;
            // The root that was meant, and not its neighbour.
            let same = (t - candidate.t).value().abs() <= candidate.error + error;
            return same.then_some(Candidate { t, error, digits: Digits::Double });
        }
    }
    None
}

/// Whether a root lies within the limits of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    Inside,
    Outside,
    /// It may: and it does when `t` is moved by so much, which is within its error.
    Unsure(f64),
}

/// What is left of the error of a root once it keeps to the limits, as far as these are open.
#[derive(Clone, Copy, Debug)]
struct Window {
    from: f64,
    to: f64,
    error: f64,
    unsure: bool,
}

impl Window {
    /// Whether `value + slope s + bend s^2`, known up to `off`, may be at least 0 for an `s` within the error of the root.
    #[inline(always)]
    fn admits(&mut self, value: f64, off: f64, slope: f64, bend: f64) -> bool {
        let error = self.error;
        // The most that is added within the error if it bends by `b`: at an end, or where it turns.
        let most = |b: f64| match slope.abs() < -2.0 * b * error {
            true => slope * slope / (-4.0 * b),
            false => (slope.abs() + b * error) * error,
        };
        if value >= off + most(-bend) {
            return true;
        }
        if value < -off - most(bend) {
            return false;
        }
        self.unsure = true;
        // Where it is 0, as generous as its bound.
        let zero = -(value + off + bend.max(0.0) * error * error) / slope;
        if slope > 0.0 {
            self.from = self.from.max(zero);
        } else if slope < 0.0 {
            self.to = self.to.min(zero);
        }
        // Each limit may be kept, but not always all of them by the same root.
        self.from <= self.to
    }
}

/// Decides about the root at `t`, off by no more than `error`, by signs.
#[inline(always)]
fn verdict<F: Form, T: Number>(form: &F, o: DVec3, d: DVec3, t: T, error: f64) -> Verdict {
    let extent = form.extent();
    let w = offset(extent.anchor, o, d, t);
    let (u, v) = (form.linear(w), form.linear::<T>(d.to_array().map(T::from)));
    let (eta, _) = uncertain::<T, F>(form, &w, o, d, t.value());
    let mut window = Window { from: -error, to: error, error, unsure: false };
    let limits = extent.limits.map(T::wide);
    let rounded = |x: T| eta + 4.0 * T::U * x.value().abs();
    let axial = v.axial.value();
    if !window.admits((u.axial - limits[0]).value(), rounded(limits[0]), axial, 0.0)
        || !window.admits((limits[1] - u.axial).value(), rounded(limits[1]), -axial, 0.0)
    {
        return Verdict::Outside;
    }
    if let Some(sweep) = form.sweep() {
        // The point beside the direction that angles count from, how it moves and bends along the line, and what it is off by.
        let zero = [T::from(0.0); 2];
        let (p, moves, bends, off) = if form.twisted() {
            let (a, b) = (form.at(w).squares, v.squares);
            let relative = |g: &[T; 4], p: &[T; 4]| [g[2] * p[0] + g[3] * p[1], g[2] * p[1] - g[3] * p[0]];
            let ([x0, y0], [x1, y1]) = (relative(&a, &b), relative(&b, &a));
            let total: f64 = a.iter().map(|x| x.value().abs()).sum();
            (relative(&a, &a), [x0 + x1, y0 + y1], relative(&b, &b), 4.0 * eta * (total + 2.0 * eta))
        } else {
            ([u.squares[0], u.squares[1]], [v.squares[0], v.squares[1]], zero, 4.0 * eta)
        };
        let cross = |e: DVec2, p: [T; 2]| (T::from(e.x) * p[1] - T::from(e.y) * p[0]).value();
        let side = |window: &mut Window, e: DVec2, sign: f64| {
            window.admits(sign * cross(e, p), off, sign * cross(e, moves), sign * cross(e, bends))
        };
        let [from, to] = sweep.ends;
        if sweep.reflex {
            let (mut one, mut other) = (window, window);
            let (a, b) = (side(&mut one, from, 1.0), side(&mut other, to, -1.0));
            // Prefer the half plane that leaves less open.
            window = match (a, b) {
                (false, false) => return Verdict::Outside,
                (true, false) => one,
                (false, true) => other,
                (true, true) if one.unsure => other,
                (true, true) => one,
            };
        } else if !side(&mut window, from, 1.0) || !side(&mut window, to, -1.0) {
            return Verdict::Outside;
        }
    }
    if window.unsure { Verdict::Unsure(0.0f64.max(window.from).min(window.to)) } else { Verdict::Inside }
}

/// The root near a candidate, if it lies on the surface and its error leaves it the chance to lie between `t_min` and `t_max`.
///
/// It has the digits that `R` asks for, and those that the limits ask for: which depends on the line alone, so that every
/// interval sees the same root.
#[inline(always)]
fn settle<F: Form, R: Real>(
    form: &F,
    o: DVec3,
    d: DVec3,
    candidate: Candidate,
    t_min: f64,
    t_max: f64,
) -> Option<Root> {
    let Candidate { digits, .. } = candidate;
    let t = candidate.t.value();
    let slack = candidate.error + U * t.abs();
    if !(t + slack >= t_min && t - slack <= t_max) {
        return None;
    }
    let rough = verdict::<F, f64>(form, o, d, t, slack);
    if rough == Verdict::Outside {
        return None;
    }
    if rough == Verdict::Inside && slack <= R::ROOT_ERROR * t.abs() {
        // Only the near end of the interval may need more digits, and then for the decision only.
        if (t - t_min).abs() > slack {
            return Some(Root { t, error: slack });
        }
        let fine = polish(form, o, d, &candidate, GOAL).unwrap_or(candidate);
        return (near_end(&fine, t_min) >= t_min).then(|| Root { t: t.max(t_min), error: slack });
    }
    // A decision left open wants all digits, not only those of the answer.
    let goal = if rough == Verdict::Inside { 0.125 * U } else { GOAL };
    let mut fine = match polish(form, o, d, &candidate, goal) {
        Some(fine) if digits == Digits::Single || fine.error < candidate.error => fine,
        _ if digits == Digits::Single => closest_wide(form, o, d, candidate),
        _ => candidate,
    };
    // From a point of the surface, as far as can be told, the distance is none.
    if fine.t.value().abs() <= fine.error {
        fine = Candidate { t: 0.0.into(), error: 2.0 * fine.error, ..fine };
    }
    if rough != Verdict::Inside || fine.error > slack {
        match verdict::<F, DoubleDouble>(form, o, d, fine.t, fine.error) {
            Verdict::Inside => {}
            Verdict::Outside => return None,
            Verdict::Unsure(shift) => {
                fine.t = fine.t + shift.into();
                fine.error += shift.abs();
            }
        }
    }
    let t = near_end(&fine, t_min);
    Some(Root { t, error: fine.error + U * t.abs() })
}

/// The root, rounded; at the near end of the interval, if it may lie there.
#[inline(always)]
fn near_end(root: &Candidate, t_min: f64) -> f64 {
    let t = root.t.value();
    if t < t_min && t + root.error >= t_min { t_min } else { t }
}

/// The root from twice the digits that is nearest to one from fewer, where steps do not converge.
#[cold]
fn closest_wide<F: Form>(form: &F, o: DVec3, d: DVec3, rough: Candidate) -> Candidate {
    let (t, span) = (rough.t.value(), 2.0 * form.extent().radius / d.length());
    let found = candidates_wide(form, o, d, t, span).unwrap_or_default().into_iter().flatten();
    let off = |c: &Candidate| (c.t.value() - t).abs();
    found.min_by(|x, y| off(x).total_cmp(&off(y))).unwrap_or(rough)
}

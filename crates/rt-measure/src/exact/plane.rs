//! Lines, points and planes.

use super::{Rational, Span, Vec3, cross, dot, integers, is_line, minus};
use core::cmp::Ordering;
use num_bigint::{BigInt, Sign};

/// A half-space: the points `x` with `normal . (x - from) <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The normal, of any length; a zero one leaves all of space or nothing, by the sign of the offset.
    pub normal: Vec3,
    /// How far along the normal the half-space reaches. Infinity leaves all of space.
    pub offset: f64,
    /// What offsets are counted from.
    pub from: Vec3,
}

impl Plane {
    /// Whether a point lies in the closed half-space; false for one that is not finite.
    ///
    /// ```
    /// use rt_measure::exact::Plane;
    /// let plane = Plane { normal: [1.0, 1.0, 0.0], offset: 1.0, from: [0.0; 3] };
    /// assert!(plane.holds([0.25, 0.75, 9.0]) && !plane.holds([0.25, 0.75f64.next_up(), 9.0]));
    /// ```
    pub fn holds(&self, point: Vec3) -> bool {
        if self.offset == f64::INFINITY {
            return true;
        }
        let finite = point.iter().chain(&self.normal).chain(&self.from).all(|x| x.is_finite());
        finite && self.offset.is_finite() && self.slack(point).0.sign() != Sign::Minus
    }

    /// `offset - normal . (x - from)` as an integer and the exponent of its unit.
    fn slack(&self, x: Vec3) -> (BigInt, i64) {
        let ([x, from], unit) = integers([x, self.from]);
        let ([n], normal_unit) = integers([self.normal]);
        let ([[offset, _, _]], offset_unit) = integers([[self.offset, 0.0, 0.0]]);
        let along = dot(&n, &minus(&x, &from));
        let along_unit = unit + normal_unit;
        let least = along_unit.min(offset_unit);
        ((offset << (offset_unit - least)) - (along << (along_unit - least)), least)
    }

    /// What of the line `origin + t dir` the half-space holds.
    fn part(&self, origin: Vec3, dir: Vec3) -> Part {
        if self.offset == f64::INFINITY {
            return Part::All;
        }
        if !self.offset.is_finite() {
            return Part::Nothing;
        }
        let ([n, d], unit) = integers([self.normal, dir]);
        let (along, (slack, slack_unit)) = (dot(&n, &d), self.slack(origin));
        // Normal and direction share a unit, so their product has it twice.
        let t = |along| Rational::new(slack.clone(), along, slack_unit - 2 * unit);
        match along.sign() {
            Sign::Plus => Part::Until(t(along)),
            Sign::Minus => Part::From(t(along)),
            Sign::NoSign if slack.sign() == Sign::Minus => Part::Nothing,
            Sign::NoSign => Part::All,
        }
    }
}

enum Part {
    All,
    Nothing,
    From(Rational),
    Until(Rational),
}

/// The part of the line `origin + t dir` in all of some half-spaces, if there is any.
///
/// ```
/// use rt_measure::exact::{self, Plane};
/// let below = |normal, offset| Plane { normal, offset, from: [0.0; 3] };
/// let wedge = [below([1.0, 1.0, 0.0], 1.0), below([-1.0, 0.0, 0.0], 0.0)];
/// let span = exact::convex([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], &wedge).unwrap();
/// assert_eq!((span.enter.unwrap().to_f64(), span.exit.unwrap().to_f64()), (1.0, 2.0));
/// ```
pub fn convex(origin: Vec3, dir: Vec3, planes: &[Plane]) -> Option<Span> {
    if !is_line(&origin, &dir) {
        return None;
    }
    let mut span = Span { enter: None, exit: None };
    for plane in planes {
        match plane.part(origin, dir) {
            Part::All => {}
            Part::Nothing => return None,
            // `None` is less than any number, which is right for entries and wrong for exits.
            Part::From(t) => span.enter = span.enter.max(Some(t)),
            Part::Until(t) => {
                span.exit = Some(match span.exit {
                    Some(exit) => exit.min(t),
                    None => t,
                });
            }
        }
    }
    let met = match (&span.enter, &span.exit) {
        (Some(enter), Some(exit)) => enter <= exit,
        _ => true,
    };
    met.then_some(span)
}

/// Whether any point of the line with `t` in `[t_min, t_max]` lies in all of some half-spaces: what [`convex`] says, sooner
/// where the answer is no, because two planes are enough to prove that. Which two, `f64` guesses.
pub fn convex_met(origin: Vec3, dir: Vec3, t_min: f64, t_max: f64, planes: &[Plane]) -> bool {
    let dot = |a: Vec3, b: Vec3| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (mut first, mut last) = ((f64::NEG_INFINITY, None), (f64::INFINITY, None));
    let (mut outside, mut worst) = (None, 0.0);
    for (i, plane) in planes.iter().enumerate() {
        let at = [0, 1, 2].map(|a| origin[a] - plane.from[a]);
        let (slack, along) = (plane.offset - dot(plane.normal, at), dot(plane.normal, dir));
        let t = slack / along;
        if along < 0.0 && t > first.0 {
            first = (t, Some(i));
        } else if along > 0.0 && t < last.0 {
            last = (t, Some(i));
        } else if along == 0.0 && slack < worst {
            (outside, worst) = (Some(i), slack);
        }
    }
    let few: Vec<Plane> = [first.1, last.1, outside].into_iter().flatten().map(|i| planes[i]).collect();
    let met = |planes: &[Plane]| convex(origin, dir, planes).is_some_and(|span| span.meets(t_min, t_max));
    met(&few) && met(planes)
}

/// On which side of the plane through `a`, `b` and `c` a point lies: `Greater` on that of `(b - a) x (c - a)`. Finite numbers
/// only.
///
/// ```
/// use core::cmp::Ordering;
/// use rt_measure::exact::side;
/// let (a, b, c) = ([0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 1.0, 0.1]);
/// assert_eq!(side(a, b, c, [5.0, 5.0, 0.1]), Ordering::Equal);
/// assert_eq!(side(a, b, c, [5.0, 5.0, 0.1f64.next_up()]), Ordering::Greater);
/// ```
pub fn side(a: Vec3, b: Vec3, c: Vec3, point: Vec3) -> Ordering {
    let ([a, b, c, point], _) = integers([a, b, c, point]);
    dot(&cross(&minus(&b, &a), &minus(&c, &a)), &minus(&point, &a)).cmp(&BigInt::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::aabb;
    use proptest::prelude::*;

    fn planes(min: Vec3, max: Vec3) -> Vec<Plane> {
        let axis = |a: usize, sign: f64| [0, 1, 2].map(|i| if i == a { sign } else { 0.0 });
        let side = |a: usize| {
            [(max[a], 1.0), (-min[a], -1.0)].map(|(offset, s)| Plane {
                normal: axis(a, 2.0 * s),
                offset: 2.0 * offset,
                from: [0.0; 3],
            })
        };
        [side(0), side(1), side(2)].concat()
    }

    proptest! {
        #[test]
        fn six_planes_are_a_box(o: [i8; 3], d: [i8; 3], p: [i8; 3], q: [i8; 3], t: i8) {
            let [o, d, p, q] = [o, d, p, q].map(|v| v.map(|x| f64::from(x >> 3) * 0.1));
            let (min, max) = ([0, 1, 2].map(|a| p[a].min(q[a])), [0, 1, 2].map(|a| p[a].max(q[a])));
            let (span, planes) = (aabb(o, d, min, max), planes(min, max));
            prop_assert_eq!(convex(o, d, &planes), span.clone());
            let met = span.is_some_and(|span| span.meets(t.into(), 1e3));
            prop_assert_eq!(convex_met(o, d, t.into(), 1e3, &planes), met);
        }
    }
}

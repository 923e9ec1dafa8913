//! Lines and axis-aligned boxes.

use super::{Rational, Vec3, integers, is_line};

/// The part of a line inside a box: from `enter` to `exit`, both included; `None` where it has no end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The least `t`; `None` is minus infinity.
    pub enter: Option<Rational>,
    /// The greatest `t`; `None` is infinity.
    pub exit: Option<Rational>,
}

impl Span {
    /// Whether any `t` of the closed interval lies in the span; false for NaN.
    pub fn meets(&self, t_min: f64, t_max: f64) -> bool {
        t_min <= t_max
            && self.enter.as_ref().is_none_or(|enter| enter.compare(t_max).is_some_and(|o| o.is_le()))
            && self.exit.as_ref().is_none_or(|exit| exit.compare(t_min).is_some_and(|o| o.is_ge()))
    }
}

/// The part of the line `origin + t dir` in the closed box, if there is any.
///
/// The box may be flat or a point, and infinite on any side. An inverted box, and one that holds a NaN, is never met.
///
/// ```
/// use rt_measure::exact;
/// let flat = exact::aabb([0.0, 0.0, -3.0], [0.0, -0.0, 2.0], [-1.0, 0.0, 0.0], [1.0, 0.0, f64::INFINITY]).unwrap();
/// assert_eq!(flat.enter.unwrap().to_f64(), 1.5);
/// assert!(flat.exit.is_none());
/// ```
pub fn aabb(origin: Vec3, dir: Vec3, min: Vec3, max: Vec3) -> Option<Span> {
    if !is_line(&origin, &dir) {
        return None;
    }
    let mut span = Span { enter: None, exit: None };
    for a in 0..3 {
        let points = min[a] <= max[a] && min[a] < f64::INFINITY && max[a] > f64::NEG_INFINITY;
        if !points {
            return None;
        }
        if dir[a] == 0.0 {
            if origin[a] < min[a] || max[a] < origin[a] {
                return None;
            }
            continue;
        }
        let reach = |plane: f64| plane.is_finite().then(|| quotient(plane, origin[a], dir[a]));
        let (near, far) = if dir[a] > 0.0 { (min[a], max[a]) } else { (max[a], min[a]) };
        // `None` is less than any number, which is right for entries and wrong for exits.
        span.enter = span.enter.max(reach(near));
        span.exit = match (span.exit, reach(far)) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
    }
    let met = match (&span.enter, &span.exit) {
        (Some(enter), Some(exit)) => enter <= exit,
        _ => true,
    };
    met.then_some(span)
}

/// `(plane - origin) / dir`.
fn quotient(plane: f64, origin: f64, dir: f64) -> Rational {
    let ([[p, o, _]], unit) = integers([[plane, origin, 0.0]]);
    let ([[d, _, _]], dir_unit) = integers([[dir, 0.0, 0.0]]);
    Rational::new(p - o, d, unit - dir_unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_edges_and_corners_belong_to_the_box() {
        let unit = |o: Vec3, d: Vec3| aabb(o, d, [-1.0; 3], [1.0; 3]);
        assert!(unit([1.0, 1.0, -5.0], [0.0, -0.0, 1.0]).unwrap().meets(4.0, 4.0));
        assert!(unit([1.0f64.next_up(), 1.0, -5.0], [0.0, -0.0, 1.0]).is_none());
        // Through one corner only.
        let span = unit([2.0, 0.0, 0.0], [-1.0, 1.0, 1.0]).unwrap();
        assert_eq!(span.enter, span.exit);
        assert!(unit([2.0, f64::from_bits(1), 0.0], [-1.0, 1.0, 1.0]).is_none());
        assert!(!unit([0.0; 3], [1.0; 3]).unwrap().meets(1.0f64.next_up(), f64::INFINITY));
        assert!(!unit([0.0; 3], [1.0; 3]).unwrap().meets(1.0, f64::NAN));
    }

    #[test]
    fn boxes_without_end_and_without_points() {
        let all = f64::INFINITY;
        let ground = aabb([0.0, 5.0, 0.0], [1.0, -1.0, 0.0], [-all, 0.0, -all], [all, 0.0, all]).unwrap();
        assert!(ground.meets(5.0, 5.0) && !ground.meets(5.0f64.next_up(), all));
        assert_eq!(aabb([0.0; 3], [1.0; 3], [-all; 3], [all; 3]), Some(Span { enter: None, exit: None }));
        assert!(aabb([0.0; 3], [1.0; 3], [1.0; 3], [0.0; 3]).is_none());
        assert!(aabb([0.0; 3], [1.0; 3], [all; 3], [all; 3]).is_none());
        assert!(aabb([0.0; 3], [1.0; 3], [0.0, f64::NAN, 0.0], [1.0; 3]).is_none());
        assert!(aabb([0.0; 3], [0.0; 3], [-1.0; 3], [1.0; 3]).is_none());
    }
}

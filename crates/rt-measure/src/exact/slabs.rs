//! Slabs of any normal, and what lies in several of them: oriented boxes and parallelepipeds.

use super::{Rational, Span, Vec3, dot, integers, is_line, minus};
use num_bigint::{BigInt, Sign};

/// The points `x` with `|normal . (x - middle)| <= half`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// Any direction, of any length.
    pub normal: Vec3,
    /// A point half way between the planes.
    pub middle: Vec3,
    /// Half of how much `normal . x` differs between the planes; infinite for all of space.
    pub half: f64,
}

/// Whether every one of the closed slabs holds `point - origin`, exactly. False where a number is not finite, but for
/// an infinite `half`.
///
/// ```
/// use rt_measure::exact::{Slab, slabs_hold};
/// let slab = Slab { normal: [1.0, 1.0, 0.0], middle: [0.0; 3], half: 2.0 };
/// assert!(slabs_hold(&[slab], [1.0, 1.0, 7.0], [0.0; 3]));
/// assert!(!slabs_hold(&[slab], [1.0, 1.0, 7.0], [0.0, -1e-300, 0.0]));
/// ```
pub fn slabs_hold(slabs: &[Slab], point: Vec3, origin: Vec3) -> bool {
    slabs.iter().all(|slab| {
        let Slab { normal, middle, half } = *slab;
        let numbers = [normal, middle, point, origin];
        if !numbers.iter().flatten().all(|x| x.is_finite()) || half.is_nan() {
            return false;
        }
        if half.is_infinite() {
            return half > 0.0;
        }
        let ([n, [one, _, _]], _) = integers([normal, [1.0, 0.0, 0.0]]);
        let ([p, o, m, [h, _, _]], _) = integers([point, origin, middle, [half, 0.0, 0.0]]);
        let across = dot(&n, &minus(&minus(&p, &o), &m));
        // The half width in the unit of the product.
        across.magnitude() <= (&h * &one).magnitude() && half >= 0.0
    })
}

/// The part of the line `at + t dir - origin` in every one of the closed slabs, if there is any. `None` where a number
/// is not finite, but for an infinite `half`.
pub fn slabs(slabs: &[Slab], at: Vec3, dir: Vec3, origin: Vec3) -> Option<Span> {
    let mut span = Span { enter: None, exit: None };
    for slab in slabs {
        let Slab { normal, middle, half } = *slab;
        let numbers = [normal, middle, origin];
        let wide = half >= 0.0;
        if !is_line(&at, &dir) || !numbers.iter().flatten().all(|x| x.is_finite()) || !wide {
            return None;
        }
        if half.is_infinite() {
            continue;
        }
        let ([n, [one, _, _]], _) = integers([normal, [1.0, 0.0, 0.0]]);
        let ([p, o, m, [h, _, _]], unit) = integers([at, origin, middle, [half, 0.0, 0.0]]);
        let ([d], dir_unit) = integers([dir]);
        let start = dot(&n, &minus(&minus(&p, &o), &m));
        let half = &h * &one;
        let pace = dot(&n, &d);
        if pace.sign() == Sign::NoSign {
            if start.magnitude() > half.magnitude() {
                return None;
            }
            continue;
        }
        let time = |plane: BigInt| Rational::new(plane - &start, pace.clone(), unit - dir_unit);
        let (a, b) = (time(-&half), time(half.clone()));
        let (enter, exit) = if a <= b { (a, b) } else { (b, a) };
        span.enter = span.enter.max(Some(enter));
        span.exit = match span.exit {
            Some(old) => Some(old.min(exit)),
            None => Some(exit),
        };
    }
    match (&span.enter, &span.exit) {
        (Some(enter), Some(exit)) if enter > exit => None,
        _ => Some(span),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_slabs_along_the_axes_are_a_box() {
        let middle = [1.0, 2.0, 3.0];
        let slab = |normal: Vec3, half: f64| Slab { normal, middle, half };
        let three = [slab([1.0, 0.0, 0.0], 1.0), slab([0.0, 0.5, 0.0], 0.5), slab([0.0, 0.0, -3.0], 3.0)];
        for (o, d) in
            [([0.0, 1.0, -5.0], [0.0, 0.0, 2.0]), ([0.0; 3], [1.0, 2.0, 3.0]), ([9.0; 3], [-1.0, -1.1, -0.9])]
        {
            assert_eq!(
                slabs(&three, o, d, [0.0; 3]),
                super::super::aabb(o, d, [0.0, 1.0, 2.0], [2.0, 3.0, 4.0])
            );
        }
        assert!(slabs_hold(&three, [3.0, 4.0, 5.0], [1.0; 3]));
        assert!(!slabs_hold(&three, [3.0, 4.0, 5.0f64.next_up()], [1.0; 3]));
        assert!(slabs(&three, [2.0f64.next_up(), 0.0, 0.0], [0.0, 1.0, 1.0], [0.0; 3]).is_none());
        assert!(slabs(&three, [0.0; 3], [f64::NAN; 3], [0.0; 3]).is_none());
    }
}

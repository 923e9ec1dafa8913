//! Balls: whether they hold points, whether segments meet them, and the smallest around points.

use super::{Rational, Vec3, Vector, cross, dot, integers, is_line, minus, parts};
use num_bigint::{BigInt, Sign};

/// Whether the closed ball holds `point - origin`, exactly.
///
/// A negative or NaN radius holds nothing, an infinite one everything finite.
///
/// ```
/// use rt_measure::exact;
/// assert!(exact::ball_holds([0.0; 3], 5.0, [4.0, 5.0, 0.0], [1.0, 1.0, 0.0]));
/// assert!(!exact::ball_holds([0.0; 3], 5.0, [3.0, 4.0, 1e-300], [0.0; 3]));
/// ```
pub fn ball_holds(center: Vec3, radius: f64, point: Vec3, origin: Vec3) -> bool {
    let finite = center.iter().chain(&point).chain(&origin).all(|x| x.is_finite());
    if !finite || radius.is_nan() || radius < 0.0 || radius == f64::INFINITY {
        return finite && radius == f64::INFINITY;
    }
    let ([c, p, o, [r, _, _]], _) = integers([center, point, origin, [radius, 0.0, 0.0]]);
    let q = minus(&minus(&p, &o), &c);
    dot(&q, &q) <= &r * &r
}

/// Whether a point `at + t dir - origin`, `t` in the closed interval, lies in the closed ball, exactly.
///
/// Ends may be infinite. False for a direction of zero and for anything else not finite.
///
/// ```
/// use rt_measure::exact;
/// let touches = |t_max| exact::ball_meets([-3.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, t_max], [0.0; 3], [0.0; 3], 1.0);
/// assert!(touches(3.0) && !touches(3.0f64.next_down()));
/// ```
pub fn ball_meets(at: Vec3, dir: Vec3, t: [f64; 2], origin: Vec3, center: Vec3, radius: f64) -> bool {
    let finite = center.iter().chain(&origin).all(|x| x.is_finite()) && radius.is_finite();
    if !is_line(&at, &dir) || !finite || radius < 0.0 || t[0].partial_cmp(&t[1]).is_none_or(|o| o.is_gt()) {
        return false;
    }
    let ([p, o, c, [r, _, _]], unit) = integers([at, origin, center, [radius, 0.0, 0.0]]);
    let ([d], dir_unit) = integers([dir]);
    let l = minus(&minus(&p, &o), &c);
    let (a, b, c) = (dot(&d, &d), dot(&l, &d), dot(&l, &l) - &r * &r);
    if (&b * &b - &a * &c).sign() == Sign::Minus {
        return false;
    }
    // The line meets it; the segment does if it holds the closest point or has an end inside.
    Rational::new(-b, a, unit - dir_unit).within(t[0], t[1])
        || t.iter().any(|t| {
            let (mantissa, exp) = parts(*t);
            let least = unit.min(dir_unit + exp);
            let scaled = |x: &BigInt, e: i64| x << (e - least);
            let q: Vector =
                [0, 1, 2].map(|i| scaled(&l[i], unit) + scaled(&(&d[i] * mantissa), dir_unit + exp));
            let r = scaled(&r, unit);
            t.is_finite() && dot(&q, &q) <= &r * &r
        })
}

/// The square of the radius of the smallest ball around points, exactly, found among all balls through up to four of
/// them; `None` for no points or one not finite.
///
/// Cost: the fifth power of their number, so for a dozen at most.
///
/// ```
/// use rt_measure::exact;
/// let cube = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| [0, 1, 2].map(|a| (i >> a & 1) as f64));
/// assert_eq!(exact::smallest_ball(&cube).unwrap().to_f64(), 0.75);
/// ```
pub fn smallest_ball(points: &[Vec3]) -> Option<Rational> {
    if points.is_empty() || !points.iter().flatten().all(|x| x.is_finite()) {
        return None;
    }
    // In one unit: pair by pair with a point that holds the least exponent.
    let exp = points.iter().map(|p| integers([*p]).1).min().unwrap_or(0);
    let points: Vec<Vector> = points
        .iter()
        .map(|p| {
            let ([v], e) = integers([*p]);
            v.map(|x| x << (e - exp))
        })
        .collect();
    let n = points.len();
    let mut best: Option<Rational> = None;
    let mut try_ball = |chosen: &[usize]| {
        let base = &points[chosen[0]];
        let sides: Vec<Vector> = chosen[1..].iter().map(|i| minus(&points[*i], base)).collect();
        let Some((c, den)) = circumcenter(&sides) else { return };
        // In units of 1 / den: squares of distances.
        let square = |p: &Vector| {
            let q = minus(&minus(p, base).map(|x| x * &den), &c);
            dot(&q, &q)
        };
        let most = points.iter().map(square).max().unwrap_or_default();
        let radius = Rational::new(most, &den * &den, 2 * exp);
        if best.as_ref().is_none_or(|b| radius < *b) {
            best = Some(radius);
        }
    };
    for i in 0..n {
        try_ball(&[i]);
        for j in i + 1..n {
            try_ball(&[i, j]);
            for k in j + 1..n {
                try_ball(&[i, j, k]);
                for l in k + 1..n {
                    try_ball(&[i, j, k, l]);
                }
            }
        }
    }
    best
}

/// The centre of the least sphere through zero and some points, and its common denominator; `None` where they depend on
/// each other.
fn circumcenter(sides: &[Vector]) -> Option<(Vector, BigInt)> {
    let times = |v: &Vector, by: &BigInt| [&v[0] * by, &v[1] * by, &v[2] * by];
    let plus = |a: &Vector, b: &Vector| [&a[0] + &b[0], &a[1] + &b[1], &a[2] + &b[2]];
    let (c, den) = match sides {
        [] => ([BigInt::ZERO, BigInt::ZERO, BigInt::ZERO], BigInt::from(1)),
        [a] => (a.clone(), BigInt::from(2)),
        [a, b] => {
            let normal = cross(a, b);
            let c = cross(&minus(&times(b, &dot(a, a)), &times(a, &dot(b, b))), &normal);
            (c, dot(&normal, &normal) * 2)
        }
        [a, b, c, ..] => {
            let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
            let sum = plus(&times(&bc, &dot(a, a)), &times(&ca, &dot(b, b)));
            (plus(&sum, &times(&ab, &dot(c, c))), dot(a, &bc) * 2)
        }
    };
    (den.sign() != Sign::NoSign).then_some((c, den))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smallest_balls_of_known_points() {
        let square = |points: &[Vec3]| smallest_ball(points).unwrap().to_f64();
        assert_eq!(square(&[[1e30; 3], [1e30; 3]]), 0.0);
        assert_eq!(square(&[[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.5, 0.0]]), 1.0);
        // An obtuse triangle needs two points, an acute one all three.
        assert_eq!(square(&[[-3.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]), 9.0);
        assert_eq!(square(&[[-4.0, -3.0, 0.0], [4.0, -3.0, 0.0], [0.0, 5.0, 0.0]]), 25.0);
        // A regular tetrahedron in a cube of side 1: a = sqrt 2, r = a sqrt 6 / 4.
        assert_eq!(square(&[[0.0; 3], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]), 0.75);
        assert!(smallest_ball(&[]).is_none() && smallest_ball(&[[f64::NAN; 3]]).is_none());
    }

    #[test]
    fn segments_that_end_on_balls() {
        let meets = |t: [f64; 2]| ball_meets([1.0, 1.0, 11.0], [0.0, 0.0, -2.0], t, [1.0; 3], [0.0; 3], 2.0);
        assert!(meets([0.0, 4.0]) && !meets([0.0, 4.0f64.next_down()]));
        assert!(meets([6.0, 9.0]) && !meets([6.0f64.next_up(), f64::INFINITY]));
        assert!(meets([4.5, 5.5]) && meets([f64::NEG_INFINITY, f64::INFINITY]));
        assert!(!meets([5.0, 4.0]) && !meets([f64::NAN, 9.0]));
        assert!(
            ball_holds([0.0; 3], 0.0, [1.0; 3], [1.0; 3]) && !ball_holds([0.0; 3], -1.0, [0.0; 3], [0.0; 3])
        );
    }
}

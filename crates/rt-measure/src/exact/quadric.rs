//! Lines and surfaces of revolution of the second degree.

use super::{Rational, Vec3, is_line};

/// The binary digits of an irrational root of the discriminant.
const DIGITS: u64 = 200;

fn whole(v: Vec3) -> [Rational; 3] {
    v.map(|x| Rational::from_f64(x).unwrap_or_else(zero))
}

fn zero() -> Rational {
    Rational::new(0.into(), 1.into(), 0)
}

fn dot(a: &[Rational; 3], b: &[Rational; 3]) -> Rational {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

/// The real zeros of `a t^2 + 2 b t + c`, in order: none, one (also where two coincide) or two. A constant has none, not even 0.
///
/// How many is exact; where the discriminant is no square of a rational they have a relative error below `2^-150`, unless the
/// coefficients of a difference cancel by more than fifty digits.
///
/// ```
/// use rt_measure::exact::{Rational, quadratic};
/// let [a, b, c] = [1.0, -1.5, 2.0].map(|x| Rational::from_f64(x).unwrap());
/// assert_eq!(quadratic(&a, &b, &c).iter().map(Rational::to_f64).collect::<Vec<_>>(), [1.0, 2.0]);
/// ```
pub fn quadratic(a: &Rational, b: &Rational, c: &Rational) -> Vec<Rational> {
    if a.sign() == 0 {
        let half = Rational::new((-1).into(), 2.into(), 0);
        return if b.sign() == 0 { Vec::new() } else { vec![&(c * &half) / b] };
    }
    let Some(root) = (&(b * b) - &(a * c)).sqrt(DIGITS) else { return Vec::new() };
    let minus = &zero() - b;
    if root.sign() == 0 {
        return vec![&minus / a];
    }
    // The sum that does not cancel; the other root follows from the product of both.
    let q = if b.sign() < 0 { &minus + &root } else { &minus - &root };
    let mut both = vec![&q / a, c / &q];
    both.sort();
    both
}

/// Where the line `origin + t dir` meets the surface `weight (x^2 + y^2) = q[0] + q[1] z + q[2] z^2`, of any height.
///
/// The weight spares fractions, which cost time. Spheres, cylinders, cones, paraboloids and hyperboloids about the z axis; the caller applies limits. See [`quadratic`] for the
/// error. A line in the surface does not meet it. Cost: tens of microseconds.
///
/// ```
/// use rt_measure::exact::{Rational, revolved};
/// // x^2 + y^2 = z^2 at height 2.
/// let [one, zero] = [1.0, 0.0].map(|x| Rational::from_f64(x).unwrap());
/// let roots = revolved([-3.0, 0.0, 2.0], [1.0, 0.0, 0.0], &one, &[zero.clone(), zero, one.clone()]);
/// assert_eq!(roots.iter().map(Rational::to_f64).collect::<Vec<_>>(), [1.0, 5.0]);
/// ```
pub fn revolved(origin: Vec3, dir: Vec3, weight: &Rational, q: &[Rational; 3]) -> Vec<Rational> {
    if !is_line(&origin, &dir) {
        return Vec::new();
    }
    let ([ox, oy, oz], [dx, dy, dz]) = (whole(origin), whole(dir));
    let half = &q[1] * &Rational::new(1.into(), 2.into(), 0);
    let flat = |a: &Rational, b: &Rational, c: &Rational, d: &Rational| weight * &(&(a * b) + &(c * d));
    let a = &flat(&dx, &dx, &dy, &dy) - &(&q[2] * &(&dz * &dz));
    let b = &flat(&ox, &dx, &oy, &dy) - &(&(&(&q[2] * &oz) + &half) * &dz);
    let c = &flat(&ox, &ox, &oy, &oy) - &(&q[0] + &(&(&(&q[2] * &oz) + &q[1]) * &oz));
    quadratic(&a, &b, &c)
}

/// Where the line meets the side of the truncated cone between two circles, rims included.
///
/// The circles are perpendicular to the line between their middles `base` and `top`; see [`quadratic`] for the error.
///
/// ```
/// use rt_measure::exact;
/// let cone = exact::frustum([-5.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0; 3], 2.0, [0.0, 0.0, 4.0], 0.0);
/// assert_eq!(cone.iter().map(exact::Rational::to_f64).collect::<Vec<_>>(), [4.0, 6.0]);
/// ```
pub fn frustum(origin: Vec3, dir: Vec3, base: Vec3, r0: f64, top: Vec3, r1: f64) -> Vec<Rational> {
    let finite = base.iter().chain(&top).all(|x| x.is_finite()) && r0.is_finite() && r1.is_finite();
    if !is_line(&origin, &dir) || !finite {
        return Vec::new();
    }
    let (o, d, base, top) = (whole(origin), whole(dir), whole(base), whole(top));
    let [r0, r1, _] = whole([r0, r1, 0.0]);
    let minus = |a: &[Rational; 3], b: &[Rational; 3]| [0, 1, 2].map(|i| &a[i] - &b[i]);
    let (w, e, grows) = (minus(&o, &base), minus(&top, &base), &r1 - &r0);
    let (ee, h, k) = (dot(&e, &e), dot(&w, &e), dot(&d, &e));
    // |w|^2 ee^2 - (w.e)^2 ee = (r0 ee + grows w.e)^2
    let form = |ww: Rational, hh: Rational, gg: Rational| &(&ee * &(&(&ww * &ee) - &hh)) - &gg;
    let (g, s) = (&(&r0 * &ee) + &(&grows * &h), &grows * &k);
    let a = form(dot(&d, &d), &k * &k, &s * &s);
    let b = form(dot(&w, &d), &h * &k, &g * &s);
    let c = form(dot(&w, &w), &h * &h, &g * &g);
    let mut roots = quadratic(&a, &b, &c);
    roots.retain(|t| {
        let height = &h + &(t * &k);
        height.sign() >= 0 && (&ee - &height).sign() >= 0
    });
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_cone_is_the_same_surface_by_both() {
        // Radius 3 at 0, 1 at 4: rho = 3 - z / 2.
        let q = [9.0, -3.0, 0.25].map(|x| Rational::from_f64(x).unwrap());
        let (o, d) = ([-7.0, 0.3, 0.1], [2.0, 0.1, 0.4]);
        let side = frustum(o, d, [0.0; 3], 3.0, [0.0, 0.0, 4.0], 1.0);
        let all = revolved(o, d, &Rational::from_f64(1.0).unwrap(), &q);
        assert_eq!((side.len(), all.len()), (2, 2));
        assert!(side.iter().zip(&all).all(|(x, y)| (x.to_f64() - y.to_f64()).abs() < 1e-15));
    }

    #[test]
    fn rims_belong_and_what_is_beyond_does_not() {
        let met =
            |z: f64| frustum([-5.0, 0.0, z], [1.0, 0.0, 0.0], [0.0; 3], 1.0, [0.0, 0.0, 2.0], 1.0).len();
        assert_eq!((met(0.0), met(2.0), met(1.0)), (2, 2, 2));
        assert_eq!((met(0.0f64.next_down()), met(2.0f64.next_up())), (0, 0));
        let touch =
            |y: f64| frustum([-5.0, y, 1.0], [1.0, 0.0, 0.0], [0.0; 3], 1.0, [0.0, 0.0, 2.0], 1.0).len();
        assert_eq!((touch(1.0), touch(1.0f64.next_up())), (1, 0));
    }
}

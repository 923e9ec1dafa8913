//! [`Form`]: a surface as the zeros of a signed sum of squares, in whatever digits are asked for.

use super::sweep::Sweep;
use core::ops::{Add, Div, Mul, Sub};
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::DVec3;

/// `f64`, or twice its digits.
pub(super) trait Number:
    Copy + From<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Bound on the relative error of one operation (of a sum: relative to its terms).
    const U: f64;
    fn value(self) -> f64;
    fn difference(a: f64, b: f64) -> Self;
    fn wide(x: DoubleDouble) -> Self;
}

impl Number for f64 {
    const U: f64 = f64::EPSILON / 2.0;
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn difference(a: f64, b: f64) -> f64 {
        a - b
    }
    #[inline(always)]
    fn wide(x: DoubleDouble) -> f64 {
        x.value()
    }
}

impl Number for DoubleDouble {
    const U: f64 = f64::from_bits((1023 - 101) << 52); // 2^-101
    #[inline(always)]
    fn value(self) -> f64 {
        self.value()
    }
    #[inline(always)]
    fn difference(a: f64, b: f64) -> DoubleDouble {
        DoubleDouble::difference(a, b)
    }
    #[inline(always)]
    fn wide(x: DoubleDouble) -> DoubleDouble {
        x
    }
}

/// What the linear functions of a [`Form`] give for a point or a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Terms<T> {
    /// What is squared.
    pub(super) squares: [T; 4],
    /// The coordinate along the axis, in units of the form's own.
    pub(super) axial: T,
}

/// Where a form lives and how large its numbers are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// The point from which its linear functions measure.
    pub(super) anchor: DVec3,
    /// From the anchor to the centre of a ball around all of the surface.
    pub(super) middle: DVec3,
    /// The radius of that ball, rounded up.
    pub(super) radius: f64,
    /// The largest sum of absolute coefficients of a linear function; at least 1.
    pub(super) gain: f64,
    /// The largest absolute constant of one.
    pub(super) constant: f64,
    /// The limits of the axial coordinate.
    pub(super) limits: [DoubleDouble; 2],
}

impl Extent {
    /// All lengths times `by`, a power of two.
    pub(super) fn scaled(&self, by: f64) -> Extent {
        Extent {
            anchor: self.anchor * by,
            middle: self.middle * by,
            radius: self.radius * by,
            gain: self.gain,
            constant: self.constant * by,
            limits: self.limits.map(|x| x * DoubleDouble::from(by)),
        }
    }
}

/// The surface `f = 0`, `f(w) = sum of sign_i squares_i(w)^2 - slope axial(w)`, where `axial` is between limits. Squares and
/// `axial` are linear in `w`, the offset from the anchor; their coefficients carry twice the digits of `f64`.
///
/// Outside of the surface `f` is positive.
pub(super) trait Form: Sized {
    fn extent(&self) -> &Extent;
    fn signs(&self) -> [f64; 4];
    fn slope(&self) -> DoubleDouble;
    /// The linear functions without their constants: for directions.
    fn linear<T: Number>(&self, w: [T; 3]) -> Terms<T>;
    /// The constants of the squares; `axial` has none.
    fn constants<T: Number>(&self) -> [T; 4];
    /// The vector of the linear function `sum of weight_i squares_i + axial`: the transpose of [`Form::linear`].
    fn transposed(&self, weights: [f64; 4], axial: f64) -> DVec3;
    /// Beyond its axial limits the surface may be cut by planes through the axis.
    fn sweep(&self) -> Option<&Sweep>;
    /// Whether the sweep turns with the direction of the last two squares, instead of starting from the first two's first axis.
    fn twisted(&self) -> bool;
    /// All lengths times `by`, a power of two.
    fn scaled(&self, by: f64) -> Self;

    #[inline(always)]
    fn at<T: Number>(&self, w: [T; 3]) -> Terms<T> {
        let (mut terms, constants) = (self.linear(w), self.constants::<T>());
        for i in 0..4 {
            terms.squares[i] = terms.squares[i] + constants[i];
        }
        terms
    }
}

/// A point of the line, from the anchor: `o + t d`, with its size in the bounds of rounding.
#[inline(always)]
pub(super) fn offset<T: Number>(anchor: DVec3, o: DVec3, d: DVec3, t: T) -> [T; 3] {
    [0, 1, 2].map(|i| T::difference(o[i], anchor[i]) + t * d[i].into())
}

/// Bound on the error of a coordinate of [`offset`].
#[inline(always)]
pub(super) fn spread<T: Number>(anchor: DVec3, o: DVec3, d: DVec3, t: f64) -> f64 {
    // Two roundings of the difference, three of the product.
    4.0 * T::U * ((o - anchor).abs().max_element() + t.abs() * d.abs().max_element())
}

/// The signed sum of squares.
#[inline(always)]
pub(super) fn signed<T: Number>(signs: [f64; 4], a: &[T; 4], b: &[T; 4]) -> T {
    let mut sum = a[0] * b[0] + a[1] * b[1];
    for i in 2..4 {
        let x = a[i] * b[i];
        sum = if signs[i] > 0.0 { sum + x } else { sum - x };
    }
    sum
}

#[inline(always)]
pub(super) fn size<T: Number>(terms: &Terms<T>) -> f64 {
    terms.squares.iter().map(|x| x.value().abs()).sum()
}

/// `f(o + (t + s) d) = a s^2 + 2 b s + c`, with bounds on the errors of the three.
///
/// With `eta` bounding the error of a linear function of the point and `nu` of the direction (each at least `16 U` times its
/// largest value), a sum of products `u v` of four terms is off by at most `|u| nu + |v| eta + 4 eta nu`, and by `4 U |u||v|`
/// for its own roundings, which half of the former covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coefficients<T> {
    pub(super) a: T,
    pub(super) b: T,
    pub(super) c: T,
    pub(super) off: [f64; 3],
}

impl<T: Number> Coefficients<T> {
    #[inline(always)]
    pub(super) fn new<F: Form>(form: &F, o: DVec3, d: DVec3, t: f64) -> Coefficients<T> {
        let extent = form.extent();
        let (signs, slope) = (form.signs(), T::wide(form.slope()));
        let w = offset(extent.anchor, o, d, T::from(t));
        let (u, v) = (form.at(w), form.linear::<T>(d.to_array().map(T::from)));
        let half = T::from(0.5) * slope;
        let (eta, nu) = uncertain::<T, F>(form, &w, o, d, t);
        let (us, vs, steep) = (size(&u), size(&v), slope.value().abs());
        Coefficients {
            a: signed(signs, &v.squares, &v.squares),
            b: signed(signs, &u.squares, &v.squares) - half * v.axial,
            c: signed(signs, &u.squares, &u.squares) - slope * u.axial,
            off: [
                3.0 * vs * nu + 4.0 * nu * nu,
                1.5 * (us * nu + vs * eta) + 4.0 * eta * nu + steep * nu,
                3.0 * us * eta + 4.0 * eta * eta + 2.0 * steep * eta,
            ],
        }
    }
}

/// The errors of linear functions at `o + t d`, which is `w` from the anchor, and of `d`.
#[inline(always)]
pub(super) fn uncertain<T: Number, F: Form>(form: &F, w: &[T; 3], o: DVec3, d: DVec3, t: f64) -> (f64, f64) {
    let extent = form.extent();
    let largest = w.iter().fold(0.0f64, |m, x| m.max(x.value().abs()));
    let eta = extent.gain * spread::<T>(extent.anchor, o, d, t)
        + 16.0 * T::U * (extent.gain * largest + extent.constant);
    (eta, 16.0 * T::U * extent.gain * d.abs().max_element())
}

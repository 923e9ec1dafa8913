//! [`Rational`]: exact quotients, and their one rounding.

use super::parts;
use core::cmp::Ordering;
use core::ops::{Add, Mul, Sub};
use num_bigint::{BigInt, Sign};
use rt_geom::Real;

/// An exact rational number, the quotient of two integers times a power of two.
///
/// Ordered and compared exactly. Cost: microseconds an operation.
///
/// ```
/// use rt_measure::exact::Rational;
/// let third = &Rational::from_f64(1.0).unwrap() / &Rational::from_f64(3.0).unwrap();
/// assert_eq!(third.to_f64(), 1.0 / 3.0);
/// assert_eq!(third.to_f32(), 1.0f32 / 3.0);
/// assert!(third > Rational::from_f64(1.0 / 3.0).unwrap());
/// ```
#[derive(Clone, Debug)]
pub struct Rational {
    num: BigInt,
    /// Above 0.
    den: BigInt,
    exp: i64,
}

impl Rational {
    /// `num / den * 2^exp`, for a `den` that is not zero.
    pub(super) fn new(num: BigInt, den: BigInt, exp: i64) -> Rational {
        match den.sign() {
            Sign::Minus => Rational { num: -num, den: -den, exp },
            _ => Rational { num, den, exp },
        }
    }

    /// The number `x`; `None` if it is not finite.
    pub fn from_f64(x: f64) -> Option<Rational> {
        let (mantissa, exp) = parts(x);
        x.is_finite().then(|| Rational { num: mantissa.into(), den: 1.into(), exp })
    }

    /// -1, 0 or 1.
    pub fn sign(&self) -> i32 {
        match self.num.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// The square root, rounded down to `digits` binary digits or more; exact where the number is a square of a quotient of such
    /// length. `None` below zero.
    pub fn sqrt(&self, digits: u64) -> Option<Rational> {
        if self.num.sign() == Sign::Minus {
            return None;
        }
        // sqrt(n / d) = sqrt(n d) / d, in an even power of two.
        let odd = self.exp.rem_euclid(2);
        let radicand = (&self.num * &self.den) << odd;
        let more = digits.saturating_sub(radicand.bits() / 2) as i64;
        let root = (radicand << (2 * more)).sqrt();
        Some(Rational { num: root, den: self.den.clone(), exp: (self.exp - odd) / 2 - more })
    }

    /// The nearest `f64`, ties to even; infinite beyond the range.
    pub fn to_f64(&self) -> f64 {
        self.round(53, -1074)
    }

    /// The nearest `f32`, ties to even, rounded once; infinite beyond the range.
    pub fn to_f32(&self) -> f32 {
        self.round(24, -149) as f32
    }

    /// [`Rational::to_f32`] or [`Rational::to_f64`].
    pub fn nearest<R: Real>(&self) -> R {
        R::nearest(if size_of::<R>() == size_of::<f32>() { self.to_f32() as f64 } else { self.to_f64() })
    }

    /// How this number compares with `x`, infinite or not; `None` for NaN.
    pub fn compare(&self, x: f64) -> Option<Ordering> {
        match Rational::from_f64(x) {
            Some(x) => Some(self.cmp(&x)),
            None => 0.0.partial_cmp(&x),
        }
    }

    /// Whether the number lies in the closed interval; false for NaN.
    pub fn within(&self, min: f64, max: f64) -> bool {
        self.compare(min).is_some_and(Ordering::is_ge) && self.compare(max).is_some_and(Ordering::is_le)
    }

    /// The nearest number of `digits` binary digits that is a multiple of `2^min_exp`.
    fn round(&self, digits: i64, min_exp: i64) -> f64 {
        let num = self.num.magnitude();
        if self.num.sign() == Sign::NoSign {
            return 0.0;
        }
        let den = self.den.magnitude();
        // A quotient of two to four digits too many, and whether anything is left over.
        let shift = digits + 3 - (num.bits() as i64 - den.bits() as i64);
        let (num, den) = if shift > 0 { (num << shift, den.clone()) } else { (num.clone(), den << -shift) };
        let quotient = &num / &den;
        let inexact = &quotient * &den != num;
        let unit = self.exp - shift;
        let exp = (quotient.bits() as i64 + unit - digits).max(min_exp);
        let drop = exp - unit;
        // At most 57 bits by the choice of the shift; what loses 64 of them is below half of the least number.
        let quotient = u64::try_from(quotient).unwrap_or(u64::MAX);
        let magnitude = if drop >= 64 {
            0.0
        } else if exp > 1023 {
            f64::INFINITY
        } else {
            let (kept, lost, half) = (quotient >> drop, quotient & ((1 << drop) - 1), 1 << (drop - 1));
            let up = match lost.cmp(&half) {
                Ordering::Less => false,
                Ordering::Equal => inexact || kept & 1 == 1,
                Ordering::Greater => true,
            };
            (kept + up as u64) as f64 * power_of_two(exp)
        };
        if self.num.sign() == Sign::Minus { -magnitude } else { magnitude }
    }
}

/// `2^exp` for `exp` from -1074 to 1023.
fn power_of_two(exp: i64) -> f64 {
    f64::from_bits(if exp >= -1022 { ((exp + 1023) as u64) << 52 } else { 1 << (exp + 1074) })
}

/// Both numerators over the product of the denominators, in the common unit `2^exp`.
fn common(a: &Rational, b: &Rational) -> (BigInt, BigInt, i64) {
    let exp = a.exp.min(b.exp);
    ((&a.num * &b.den) << (a.exp - exp), (&b.num * &a.den) << (b.exp - exp), exp)
}

impl Ord for Rational {
    fn cmp(&self, other: &Rational) -> Ordering {
        let (a, b, _) = common(self, other);
        a.cmp(&b)
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Rational) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Rational {
    fn eq(&self, other: &Rational) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Rational {}

impl Sub for &Rational {
    type Output = Rational;
    fn sub(self, other: &Rational) -> Rational {
        let (a, b, exp) = common(self, other);
        Rational { num: a - b, den: &self.den * &other.den, exp }
    }
}

impl Add for &Rational {
    type Output = Rational;
    fn add(self, other: &Rational) -> Rational {
        let (a, b, exp) = common(self, other);
        Rational { num: a + b, den: &self.den * &other.den, exp }
    }
}

impl Mul for &Rational {
    type Output = Rational;
    fn mul(self, other: &Rational) -> Rational {
        Rational { num: &self.num * &other.num, den: &self.den * &other.den, exp: self.exp + other.exp }
    }
}

impl core::ops::Div for &Rational {
    type Output = Rational;
    /// # Panics
    ///
    /// When `other` is zero.
    fn div(self, other: &Rational) -> Rational {
        assert!(other.num.sign() != Sign::NoSign, "division by zero");
        Rational::new(&self.num * &other.den, &self.den * &other.num, self.exp - other.exp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn finite() -> impl Strategy<Value = f64> {
        any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite())
    }

    proptest! {
        #[test]
        fn quotients_and_differences_round_as_the_processor_does(a in finite(), b in finite()) {
            let (x, y) = (Rational::from_f64(a).unwrap(), Rational::from_f64(b).unwrap());
            prop_assert_eq!(x.to_f64(), a);
            prop_assert_eq!(x.to_f32(), a as f32);
            prop_assert_eq!((&x - &y).to_f64(), a - b);
            prop_assert_eq!((&x + &y).to_f64(), a + b);
            prop_assert_eq!((&x * &y).to_f64(), a * b);
            prop_assert_eq!(x.partial_cmp(&y), a.partial_cmp(&b));
            prop_assert_eq!(x.compare(b), a.partial_cmp(&b));
            if b != 0.0 {
                prop_assert_eq!((&x / &y).to_f64(), a / b);
            }
        }

        #[test]
        fn quotients_of_f32_round_once(a: f32, b: f32) {
            prop_assume!(a.is_finite() && b.is_finite() && b != 0.0);
            let (x, y) = (Rational::from_f64(a as f64).unwrap(), Rational::from_f64(b as f64).unwrap());
            prop_assert_eq!((&x / &y).nearest::<f32>(), a / b);
        }
    }

    #[test]
    fn the_ends_of_the_range() {
        let [max, tiny] = [f64::MAX, f64::from_bits(1)].map(|x| Rational::from_f64(x).unwrap());
        assert_eq!((&max / &tiny).to_f64(), f64::INFINITY);
        assert_eq!((&tiny / &max).to_f64(), 0.0);
        assert_eq!(max.to_f32(), f32::INFINITY);
        assert!(max.within(f64::NEG_INFINITY, f64::INFINITY) && !max.within(0.0, f64::NAN));
        assert!(Rational::from_f64(f64::INFINITY).is_none());
    }
}

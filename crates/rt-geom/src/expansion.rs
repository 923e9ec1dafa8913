//! Exact sums and products: numbers kept as unevaluated sums of `f64`.
//!
//! An [`Expansion`] of capacity `N` is a sum of at most `N` non-overlapping components, least first, so its sign is the sign
//! of its last component. Nothing is allocated. Results are exact as long as no product of two components underflows below
//! `2^-1074` or overflows: for factors between `2^-300` and `2^300` never, whatever their differences.
//!
//! Source: Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates* (1997),
//! sections 2.2 to 2.8. Products use Dekker's splitting rather than a fused multiply-add, which is a slow library call on
//! the default x86-64 target.
//!
//! A [`DoubleDouble`] is the cheap step before: twice the digits of `f64`, not all of them.
//!
//! ```
//! use rt_geom::expansion::Expansion;
//! let tiny = Expansion::<2>::difference(1.0, 1.0 + f64::EPSILON);
//! assert_eq!(tiny.sign(), -1);
//! let zero = tiny.plus::<2, 4>(&Expansion::difference(1.0 + f64::EPSILON, 1.0));
//! assert_eq!(zero.sign(), 0);
//! ```

/// `a + b` as a rounded sum and its exact error.
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let x = a + b;
    let bv = x - a;
    let av = x - bv;
    (x, (a - av) + (b - bv))
}

/// `a * b` as a rounded product and its exact error.
#[inline(always)]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    let x = a * b;
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    let e = ((ah * bh - x) + ah * bl + al * bh) + al * bl;
    (x, e)
}

/// `a` as two halves of at most 26 bits each.
#[inline(always)]
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let c = SPLITTER * a;
    let hi = c - (c - a);
    (hi, a - hi)
}

/// An exact number: the sum of at most `N` non-overlapping `f64`, least first.
#[derive(Clone, Copy, Debug)]
pub struct Expansion<const N: usize> {
    parts: [f64; N],
    len: usize,
}

impl<const N: usize> Expansion<N> {
    /// Zero.
    pub const ZERO: Expansion<N> = Expansion { parts: [0.0; N], len: 0 };

    /// The number `x`. `N` is at least 1.
    #[inline]
    pub fn new(x: f64) -> Self {
        let mut sum = Self::ZERO;
        sum.push(x);
        sum
    }

    /// `a - b`, exactly. `N` is at least 2.
    #[inline]
    pub fn difference(a: f64, b: f64) -> Self {
        let (x, e) = two_sum(a, -b);
        let mut sum = Self::ZERO;
        sum.push(e);
        sum.push(x);
        sum
    }

    #[inline]
    fn push(&mut self, x: f64) {
        if x != 0.0 {
            self.parts[self.len] = x;
            self.len += 1;
        }
    }

    /// `self + other`. `S` is at least `N + M`.
    ///
    /// Source: Shewchuk 1997, figure 13 (fast expansion sum with zero elimination).
    #[inline(always)]
    pub fn plus<const M: usize, const S: usize>(&self, other: &Expansion<M>) -> Expansion<S> {
        self.merged(other, 1.0)
    }

    /// `self - other`. `S` is at least `N + M`.
    #[inline(always)]
    pub fn minus<const M: usize, const S: usize>(&self, other: &Expansion<M>) -> Expansion<S> {
        self.merged(other, -1.0)
    }

    /// `self + sign * other`. Inlined, as are all that return large arrays: they then are written where they are wanted.
    #[inline(always)]
    fn merged<const M: usize, const S: usize>(&self, other: &Expansion<M>, sign: f64) -> Expansion<S> {
        const { assert!(S >= N + M) };
        let mut sum = Expansion::<S>::ZERO;
        sum.merge(&self.parts[..self.len], &other.parts[..other.len], sign);
        sum
    }

    /// Becomes `a + sign * b`, from zero. The capacity must hold the result.
    #[inline(never)]
    fn merge(&mut self, a: &[f64], b: &[f64], sign: f64) {
        let (mut i, mut j) = (0, 0);
        // Merged in order of magnitude, each component is absorbed by a running total.
        let mut take = || {
            let from_a = j == b.len() || (i < a.len() && a[i].abs() < b[j].abs());
            let taken;
            if from_a {
                taken = *a.get(i)?;
                i += 1;
            } else {
                taken = sign * b[j];
                j += 1;
            }
            Some(taken)
        };
        let Some(mut total) = take() else { return };
        while let Some(x) = take() {
            let (t, e) = two_sum(total, x);
            self.push(e);
            total = t;
        }
        self.push(total);
    }

    /// `-self`.
    #[inline]
    pub fn negated(&self) -> Self {
        let mut negative = *self;
        negative.parts[..self.len].iter_mut().for_each(|x| *x = -*x);
        negative
    }

    /// `self * factor`. `S` is at least `2 N`.
    ///
    /// Source: Shewchuk 1997, figure 13's companion, scale expansion with zero elimination.
    #[inline(always)]
    pub fn scaled<const S: usize>(&self, factor: f64) -> Expansion<S> {
        const { assert!(S >= 2 * N) };
        let mut product = Expansion::<S>::ZERO;
        product.scale(&self.parts[..self.len], factor);
        product
    }

    /// Becomes `parts * factor`, from zero. The capacity must hold the result.
    #[inline(never)]
    fn scale(&mut self, parts: &[f64], factor: f64) {
        let Some((&first, rest)) = parts.split_first() else { return };
        let (mut total, e) = two_product(first, factor);
        self.push(e);
        for &x in rest {
            let (hi, lo) = two_product(x, factor);
            let (t, e) = two_sum(total, lo);
            self.push(e);
            let (t, e) = two_sum(hi, t);
            self.push(e);
            total = t;
        }
        self.push(total);
    }

    /// `self * other`, by distributing over the components of `other`. `S` is at least `2 N M`.
    #[inline(always)]
    pub fn times<const M: usize, const S: usize>(&self, other: &Expansion<M>) -> Expansion<S> {
        const { assert!(S >= 2 * N * M) };
        let mut product = Expansion::<S>::ZERO;
        for &factor in &other.parts[..other.len] {
            product.add_scaled(self, factor);
        }
        product
    }

    /// Adds `other * factor` in place, one component after another. The capacity must hold the result.
    fn add_scaled<const M: usize>(&mut self, other: &Expansion<M>, factor: f64) {
        for &x in &other.parts[..other.len] {
            let (hi, lo) = two_product(x, factor);
            self.grow(lo);
            self.grow(hi);
        }
    }

    /// Adds `x` in place.
    ///
    /// Source: Shewchuk 1997, figure 6 (grow expansion).
    fn grow(&mut self, x: f64) {
        let mut total = x;
        let mut kept = 0;
        for i in 0..self.len {
            let (t, e) = two_sum(total, self.parts[i]);
            total = t;
            if e != 0.0 {
                self.parts[kept] = e;
                kept += 1;
            }
        }
        self.len = kept;
        self.push(total);
    }

    /// -1, 0 or 1.
    #[inline]
    pub fn sign(&self) -> i32 {
        match self.len {
            0 => 0,
            n => {
                if self.parts[n - 1] > 0.0 {
                    1
                } else {
                    -1
                }
            }
        }
    }

    /// The value as one `f64`, within one unit in the last place.
    #[inline]
    pub fn value(&self) -> f64 {
        self.parts[..self.len].iter().sum()
    }

    /// The value with twice the digits of `f64`.
    pub fn rounded(&self) -> DoubleDouble {
        let mut rest = 0.0;
        let mut sum = 0.0;
        for &part in &self.parts[..self.len] {
            let (s, e) = two_sum(sum, part);
            // Least first: what the sum loses now is larger than all it lost before.
            (sum, rest) = (s, rest + e);
        }
        DoubleDouble::normal(sum, rest)
    }
}

/// A number kept as an unevaluated sum of two `f64`: some 106 bits.
///
/// Each operation has a relative error below `2^-102` (a sum of numbers of opposite sign: relative to its terms). Between an
/// `f64` and an [`Expansion`] in digits and in price.
///
/// Source: Dekker, "A floating-point technique for extending the available precision" (1971); Joldes, Muller, Popescu,
/// "Tight and rigorous error bounds for basic building blocks of double-word arithmetic" (2017), algorithms 6 and 10.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

impl DoubleDouble {
    /// `a - b`, exactly.
    #[inline(always)]
    pub fn difference(a: f64, b: f64) -> DoubleDouble {
        let (hi, lo) = two_sum(a, -b);
        DoubleDouble { hi, lo }
    }

    /// The nearest `f64`.
    #[inline(always)]
    pub fn value(self) -> f64 {
        self.hi + self.lo
    }

    /// Rounded to odd: to the neighbour with an odd last digit, where it is not an `f64` itself. Rounding that to a shorter
    /// precision rounds the number itself, once.
    ///
    /// Source: Boldo and Melquiond, "When double rounding is odd" (2005).
    pub(crate) fn odd(self) -> f64 {
        if self.lo == 0.0 || self.hi.to_bits() & 1 == 1 {
            self.hi
        } else if self.lo > 0.0 {
            self.hi.next_up()
        } else {
            self.hi.next_down()
        }
    }

    /// The square root; NaN below zero.
    pub fn sqrt(self) -> DoubleDouble {
        let first = self.hi.sqrt();
        if first == 0.0 {
            return DoubleDouble::from(0.0);
        }
        let rest = self - DoubleDouble::from(first) * DoubleDouble::from(first);
        DoubleDouble::normal(first, rest.hi / (2.0 * first))
    }

    #[inline(always)]
    fn normal(hi: f64, lo: f64) -> DoubleDouble {
        let sum = hi + lo;
        DoubleDouble { hi: sum, lo: lo - (sum - hi) }
    }
}

impl From<f64> for DoubleDouble {
    #[inline(always)]
    fn from(x: f64) -> DoubleDouble {
        DoubleDouble { hi: x, lo: 0.0 }
    }
}

impl core::ops::Add for DoubleDouble {
    type Output = DoubleDouble;
    #[inline(always)]
    fn add(self, b: DoubleDouble) -> DoubleDouble {
        let (s, e) = two_sum(self.hi, b.hi);
        let (t, f) = two_sum(self.lo, b.lo);
        let v = DoubleDouble::normal(s, e + t);
        DoubleDouble::normal(v.hi, f + v.lo)
    }
}

impl core::ops::Sub for DoubleDouble {
    type Output = DoubleDouble;
    #[inline(always)]
    fn sub(self, b: DoubleDouble) -> DoubleDouble {
        self + DoubleDouble { hi: -b.hi, lo: -b.lo }
    }
}

impl core::ops::Div for DoubleDouble {
    type Output = DoubleDouble;
    #[inline(always)]
    fn div(self, b: DoubleDouble) -> DoubleDouble {
        let first = self.hi / b.hi;
        let rest = self - b * DoubleDouble::from(first);
        DoubleDouble::normal(first, rest.hi / b.hi)
    }
}

impl core::ops::Mul for DoubleDouble {
    type Output = DoubleDouble;
    #[inline(always)]
    fn mul(self, b: DoubleDouble) -> DoubleDouble {
        let (p, e) = two_product(self.hi, b.hi);
        DoubleDouble::normal(p, e + (self.hi * b.lo + self.lo * b.hi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Exact value in units of 2^-120, for components that are integers times 2^-60 below 2^40.
    fn fixed(x: f64) -> i128 {
        let scaled = x * (2f64).powi(60);
        assert_eq!(scaled, scaled.trunc());
        scaled as i128
    }

    fn total<const N: usize>(e: &Expansion<N>) -> i128 {
        e.parts[..e.len].iter().map(|&x| fixed(x)).sum()
    }

    fn number() -> impl Strategy<Value = f64> {
        // Mixed magnitudes, so that sums do not fit one f64.
        (any::<i32>(), 0..28i32).prop_map(|(m, e)| m as f64 * (2f64).powi(-e))
    }

    proptest! {
        #[test]
        fn sums_and_differences_are_exact(a in number(), b in number(), c in number(), d in number()) {
            let x = Expansion::<2>::difference(a, b);
            let y = Expansion::<2>::difference(c, d);
            prop_assert_eq!(total(&x), fixed(a) - fixed(b));
            let s: Expansion<4> = x.plus(&y);
            prop_assert_eq!(total(&s), fixed(a) - fixed(b) + fixed(c) - fixed(d));
            let z: Expansion<8> = s.minus(&s);
            prop_assert_eq!(z.sign(), 0);
        }

        #[test]
        fn products_are_exact(a: i32, b: i32, c: i32, d: i32) {
            // Integers: (a 2^20 - b)(c 2^20 - d) fits i128.
            let (a, c) = (a as f64 * 1048576.0, c as f64 * 1048576.0);
            let x = Expansion::<2>::difference(a, b as f64);
            let y = Expansion::<2>::difference(c, d as f64);
            let p: Expansion<8> = x.times(&y);
            let exact = (a as i128 - b as i128) * (c as i128 - d as i128);
            let sum: i128 = p.parts[..p.len].iter().map(|&v| v as i128).sum();
            prop_assert_eq!(sum, exact);
            prop_assert_eq!(p.sign() as i128, exact.signum());
            let q: Expansion<4> = x.scaled(d as f64);
            let sum: i128 = q.parts[..q.len].iter().map(|&v| v as i128).sum();
            prop_assert_eq!(sum, (a as i128 - b as i128) * d as i128);
        }
    }

    proptest! {
        #[test]
        fn double_doubles_carry_twice_the_digits(a in number(), b in number(), c in number(), d in number()) {
            let (x, y) = (DoubleDouble::difference(a, b), DoubleDouble::difference(c, d));
            let (ex, ey) = (Expansion::<2>::difference(a, b), Expansion::<2>::difference(c, d));
            let exact: Expansion<8> = ex.times(&ey);
            let product = x * y;
            let rest: Expansion<10> = exact.minus(&Expansion::<2>::difference(product.hi, -product.lo));
            prop_assert!(rest.value().abs() <= exact.value().abs() * (2f64).powi(-102));
            if ey.sign() != 0 {
                let back = (product / y - x).value();
                prop_assert!(back.abs() <= x.value().abs() * (2f64).powi(-98), "{back:e}");
            }
            let root = (product * product).sqrt().value();
            prop_assert!((root - product.value().abs()).abs() <= product.value().abs() * f64::EPSILON);
            prop_assert!((exact.rounded() - product).value().abs() <= product.value().abs() * (2f64).powi(-100));
            let exact: Expansion<4> = ex.plus(&ey);
            let sum = x + y;
            let rest: Expansion<6> = exact.minus(&Expansion::<2>::difference(sum.hi, -sum.lo));
            prop_assert!(rest.value().abs() <= (ex.value().abs() + ey.value().abs()) * (2f64).powi(-102));
        }
    }

    #[test]
    fn halves_between_floats_round_by_what_lies_below() {
        use crate::Real;
        let (one, step) = (1.0f32, 1.0f32.next_up() - 1.0);
        let half = one as f64 + step as f64 / 2.0;
        let tiny = 1e-25;
        assert_eq!(f32::nearest_wide(DoubleDouble::difference(half, -tiny)), one.next_up());
        assert_eq!(f32::nearest_wide(DoubleDouble::difference(half, tiny)), one);
        assert_eq!(f32::nearest_wide(half.into()), one); // to even
        assert_eq!(f64::nearest_wide(DoubleDouble::difference(half, tiny)), half);
    }

    #[test]
    fn a_value_lost_to_rounding_keeps_its_sign() {
        let big: Expansion<4> = Expansion::<2>::new(1e30).plus(&Expansion::<2>::new(-1e-30));
        let rest: Expansion<6> = big.plus(&Expansion::<2>::new(-1e30));
        assert_eq!(rest.sign(), -1);
        assert_eq!(rest.value(), -1e-30);
    }
}

//! Rounding: how far a computed number may be from the exact one.

use crate::expansion::{two_product, two_sum};

/// `n u / (1 - n u)`: the relative error of `n` chained `f64` operations, `u = 2^-53`.
///
/// Source: Higham, *Accuracy and Stability of Numerical Algorithms* (2002), section 3.1.
#[inline]
pub const fn gamma(n: u32) -> f64 {
    let nu = n as f64 * (f64::EPSILON / 2.0);
    nu / (1.0 - nu)
}

/// `a b - c d` within 2 roundings of the result, however the products cancel, while neither under- nor overflows.
///
/// By exact products rather than fused ones, which are slow library calls on the default x86-64 target.
///
/// Source: after Kahan's algorithm; Jeannerod, Louvet, Muller, "Further analysis of Kahan's algorithm for the accurate
/// computation of 2x2 determinants" (2013).
///
/// ```
/// use rt_geom::difference_of_products;
/// let x = 1.0 + f64::EPSILON;
/// assert_eq!(difference_of_products(x, x, x + f64::EPSILON, 1.0), f64::EPSILON * f64::EPSILON); // naively 0
/// ```
#[inline]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let ((p, low_p), (q, low_q)) = (two_product(a, b), two_product(c, d));
    let (difference, low) = two_sum(p, -q);
    difference + (low + (low_p - low_q))
}

/// The greatest `f32` not above `x`. NaN stays NaN; values beyond the range become `-inf` or `f32::MAX`.
///
/// ```
/// use rt_geom::f32_below;
/// assert_eq!(f32_below(0.5), 0.5);
/// assert!((f32_below(0.1) as f64) <= 0.1);
/// assert_eq!(f32_below(1e300), f32::MAX);
/// ```
#[inline]
pub fn f32_below(x: f64) -> f32 {
    let y = x as f32;
    if y as f64 > x { y.next_down() } else { y }
}

/// The least `f32` not below `x`. NaN stays NaN; values beyond the range become `inf` or `f32::MIN`.
#[inline]
pub fn f32_above(x: f64) -> f32 {
    let y = x as f32;
    if (y as f64) < x { y.next_up() } else { y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_ends_of_the_range() {
        assert_eq!(f32_above(1e300), f32::INFINITY);
        assert_eq!(f32_above(-1e300), f32::MIN);
        assert_eq!(f32_below(-1e300), f32::NEG_INFINITY);
        assert_eq!(f32_below(f64::INFINITY), f32::INFINITY);
        assert_eq!(f32_above(1e-300), f32::from_bits(1));
        assert_eq!(f32_below(1e-300), 0.0);
        assert!(f32_above(f64::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn neighbours_enclose(bits: u64) {
            let x = f64::from_bits(bits);
            prop_assume!(!x.is_nan());
            let (lo, hi) = (f32_below(x), f32_above(x));
            prop_assert!(lo as f64 <= x && x <= hi as f64);
            prop_assert!(lo == hi || lo.next_up() == hi);
        }
    }
}

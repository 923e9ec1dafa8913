//! Inverses of 3 by 3 matrices, each entry right to its last digit.

use crate::TransformError;
use crate::expansion::{DoubleDouble, Expansion};
use glam::{DMat3, DVec3};

/// Entries below this part of both their row and their column count as zero: then no product underflows in the exact
/// arithmetic below.
const NEGLIGIBLE: f64 = f64::from_bits((1023 - 300) << 52);

/// A matrix and its inverse.
pub(crate) struct Inverted {
    /// The matrix, its negligible entries set to zero.
    pub(crate) matrix: DMat3,
    /// Each entry within `u (1 + 2^-40)` of the exact one, relatively, or half the least number absolutely.
    pub(crate) inverse: DMat3,
    /// The condition of the matrix when its rows and columns are brought to size 1: no stretch along the axes of either
    /// side counts. Roundings of the entries can make the matrix singular only if this exceeds `1 / u`.
    pub(crate) condition: f64,
}

/// The matrix with columns and rows divided by powers of two, so that its greatest entries are in `[1, 2)`.
struct Balanced {
    rows: [[f64; 3]; 3],
    row_unit: [i32; 3],
    column_unit: [i32; 3],
}

impl Balanced {
    /// `None` if a row or a column is zero.
    fn new(matrix: DMat3) -> Option<Balanced> {
        let columns = matrix.to_cols_array_2d();
        let column_unit = columns.map(|c| exponent(DVec3::from_array(c).abs().max_element()));
        let mut rows = [[0.0; 3]; 3];
        let mut row_unit = [0; 3];
        for i in 0..3 {
            // Exponents first: a row may be much smaller than the columns it crosses.
            let unit = (0..3)
                .filter(|&j| columns[j][i] != 0.0)
                .map(|j| exponent(columns[j][i].abs()) - column_unit[j])
                .max()?;
            row_unit[i] = unit;
            for j in 0..3 {
                let x = columns[j][i];
                let relative = exponent(x.abs()) - column_unit[j] - unit;
                rows[i][j] = if x == 0.0 || relative < -299 { 0.0 } else { ldexp(x, -column_unit[j] - unit) };
            }
        }
        debug_assert!(rows.iter().flatten().all(|x| *x == 0.0 || (NEGLIGIBLE..2.0).contains(&x.abs())));
        (0..3).all(|j| columns[j] != [0.0; 3]).then_some(Balanced { rows, row_unit, column_unit })
    }

    /// The matrix of signed minors, exactly: entry `[i][j]` belongs to entry `[i][j]` of the matrix.
    fn cofactors(&self) -> [[Expansion<4>; 3]; 3] {
        let m = &self.rows;
        let product = |a: f64, b: f64| Expansion::<1>::new(a).scaled::<2>(b);
        [0, 1, 2].map(|i| {
            [0, 1, 2].map(|j| {
                // Cyclic indices carry the signs.
                let (i1, i2, j1, j2) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
                product(m[i1][j1], m[i2][j2]).minus(&product(m[i1][j2], m[i2][j1]))
            })
        })
    }

    fn determinant(&self, cofactors: &[[Expansion<4>; 3]; 3]) -> Expansion<24> {
        let term = |j: usize| cofactors[0][j].scaled::<8>(self.rows[0][j]);
        term(0).plus::<8, 16>(&term(1)).plus(&term(2))
    }
}

/// Inverts a finite matrix by its cofactors, which are exact, over its determinant, which is exact too.
///
/// # Errors
///
/// When the determinant is zero, or the inverse is not representable.
pub(crate) fn invert(matrix: DMat3) -> Result<Inverted, TransformError> {
    let singular = TransformError::Singular { condition: f64::INFINITY };
    let balanced = Balanced::new(matrix).ok_or(singular.clone())?;
    let cofactors = balanced.cofactors();
    let determinant = balanced.determinant(&cofactors);
    if determinant.sign() == 0 {
        return Err(singular);
    }
    let determinant = determinant.rounded();
    let entry = |i: usize, j: usize| -> f64 { (cofactors[j][i].rounded() / determinant).value() };
    let (mut inverse, mut back, mut condition) = ([[0.0; 3]; 3], [[0.0; 3]; 3], 0.0f64);
    for i in 0..3 {
        let inner = [entry(i, 0), entry(i, 1), entry(i, 2)];
        let mut sum = 0.0;
        for j in 0..3 {
            inverse[j][i] = ldexp(inner[j], -balanced.column_unit[i] - balanced.row_unit[j]);
            back[j][i] = ldexp(balanced.rows[i][j], balanced.row_unit[i] + balanced.column_unit[j]);
            sum += (0..3).map(|k| (inner[k] * balanced.rows[k][j]).abs()).sum::<f64>();
        }
        condition = condition.max(sum);
    }
    let inverse = DMat3::from_cols_array_2d(&inverse);
    let lost = [inverse.x_axis, inverse.y_axis, inverse.z_axis].contains(&DVec3::ZERO);
    if !inverse.is_finite() || lost {
        return Err(TransformError::Singular { condition });
    }
    Ok(Inverted { matrix: DMat3::from_cols_array_2d(&back), inverse, condition })
}

/// Whether the determinant of an invertible matrix is negative, exactly.
pub(crate) fn mirrors(matrix: DMat3) -> bool {
    Balanced::new(matrix).is_some_and(|b| b.determinant(&b.cofactors()).sign() < 0)
}

/// `a . b + c`, rounded nearly once. Beyond the range of exact products, plainly.
pub(crate) fn wide_dot(a: DVec3, b: [DoubleDouble; 3], c: f64) -> f64 {
    let [x, y, z] = b;
    let wide = |f: f64, v: DoubleDouble| DoubleDouble::from(f) * v;
    let sum = (wide(a.x, x) + wide(a.y, y) + wide(a.z, z) + DoubleDouble::from(c)).value();
    if sum.is_finite() { sum } else { a.x * x.value() + a.y * y.value() + a.z * z.value() + c }
}

/// `e` such that `x` is in `[2^e, 2^(e+1))`, for a finite `x >= 0`; that of the least normal number's square for zero.
pub(crate) fn exponent(x: f64) -> i32 {
    let field = |x: f64| (x.to_bits() >> 52) as i32 - 1023;
    if x >= f64::MIN_POSITIVE {
        field(x)
    } else if x > 0.0 {
        field(x * 2f64.powi(60)) - 60
    } else {
        -2044
    }
}

/// `x 2^e`, rounded once, for `e` in `-2044..=2044`.
pub(crate) fn ldexp(x: f64, e: i32) -> f64 {
    let power = |e: i32| f64::from_bits(((e + 1023) as u64) << 52);
    // In steps towards the result, so that only the last can round.
    let (mut x, mut e) = (x, e.clamp(-4000, 4000));
    while e.abs() > 1000 {
        let step = 500 * e.signum();
        x *= power(step);
        e -= step;
    }
    x * power(e)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_determinant_lost_in_rounding_is_found() {
        // Singular but for the last digit of one entry; the rounded determinant is zero or has any sign.
        let row = DVec3::new(0.1, 0.2, 0.3);
        let m = |last: f64| DMat3::from_cols(row, row * 2.0, DVec3::new(1.0, 0.0, last)).transpose();
        assert!(invert(m(1.0)).is_err());
        let near = DMat3::from_cols(row, (row * 2.0).with_x(0.2f64.next_up()), DVec3::new(1.0, 0.0, 1.0))
            .transpose();
        assert!(invert(near).unwrap().condition > 1e15);
    }

    #[test]
    fn powers() {
        assert_eq!(exponent(1.5), 0);
        assert_eq!(exponent(f64::from_bits(1)), -1074);
        assert_eq!(ldexp(1.5, -1074), f64::from_bits(2)); // a tie goes to even
        assert_eq!(ldexp(f64::from_bits(1), 2044), 2f64.powi(970));
        assert_eq!(ldexp(1.0, 1024), f64::INFINITY);
    }
}

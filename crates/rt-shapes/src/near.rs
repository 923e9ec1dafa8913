//! [`Near`]: a line looked at from close by, whatever the ray's origin and pace.

use rt_geom::Ray;
use rt_geom::expansion::two_sum;
use rt_geom::glam::DVec3;

const U: f64 = f64::EPSILON / 2.0;
/// Directions and origins within these limits are taken as they are.
const FAST: f64 = 1e100;
const FAR: f64 = 1_048_576.0;
/// `2^1022`: the longest step, so that products with a direction stay finite.
const STRIDE: f64 = f64::MAX / 4.0;

/// The points of a ray's line as `origin + s dir`, with `t = 2^exponent (start + s)`.
///
/// A ray from far away says where it is near a thing by a small difference of large numbers, `o + t d`. So its origin is moved
/// there first, by products and sums kept as pairs of numbers, what these leave out added up; the direction is scaled by a power of
/// two, exactly but for components `2^-1022` of the largest. Most rays need neither, and are taken as they are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// A point of the line.
    pub(crate) origin: DVec3,
    /// What it may be off by, and what the direction's rounding adds anywhere near.
    pub(crate) error: DVec3,
    /// The direction.
    pub(crate) dir: DVec3,
    start: f64,
    exponent: i32,
}

impl Near {
    /// The line of a valid ray, near the cube of half side `size` around `center`. `size` is not less than the coordinates of
    /// what is in it.
    #[inline]
    pub(crate) fn new(ray: &Ray<f64>, center: DVec3, size: f64) -> Near {
        let speed = ray.dir.abs().max_element();
        if speed > 1.0 / FAST && speed < FAST && ray.origin.abs().max_element() <= size * FAR {
            return Near { origin: ray.origin, error: DVec3::ZERO, dir: ray.dir, start: 0.0, exponent: 0 };
        }
        Near::moved(ray, center, size, speed)
    }

    #[cold]
    fn moved(ray: &Ray<f64>, center: DVec3, size: f64, speed: f64) -> Near {
        // The largest component comes to lie in [1/2, 1).
        let exponent = -binary_exponent(speed) - 1;
        let dir = DVec3::from_array(ray.dir.to_array().map(|d| scaled(d, exponent)));
        let axis = (0..3).fold(0, |best, a| if dir[a].abs() > dir[best].abs() { a } else { best });
        let mut point = ray.origin.to_array().map(|o| [o, 0.0]);
        let mut lost = DVec3::splat(f64::MIN_POSITIVE);
        let mut start = 0.0;
        // Each round takes fifty binary digits off the distance, or a whole stride.
        for _ in 0..64 {
            let gap = center[axis] - point[axis][0] - point[axis][1];
            if gap.abs() <= size * 4.0 {
                break;
            }
            let t = (gap / dir[axis]).clamp(-STRIDE, STRIDE);
            for a in 0..3 {
                let left;
                (point[a], left) = moved_by(point[a], t, dir[a]);
                // What scaling took from a small component, by half a unit of the least number.
                lost[a] += left + t.abs() * f64::from_bits(1);
            }
            start += t;
        }
        let origin = DVec3::from_array(point.map(|[high, low]| high + low));
        let error = lost * (1.0 + 64.0 * U) + origin.abs() * (2.0 * U);
        Near { origin, error, dir, start, exponent }
    }

    fn is_plain(&self) -> bool {
        self.start == 0.0 && self.exponent == 0
    }

    /// An `s` no later than that of the ray's `t`.
    #[inline(always)]
    pub(crate) fn before(&self, t: f64) -> f64 {
        if self.is_plain() { t } else { -self.after_of(-t, -self.start) }
    }

    /// An `s` no earlier than that of the ray's `t`.
    #[inline(always)]
    pub(crate) fn after(&self, t: f64) -> f64 {
        if self.is_plain() { t } else { self.after_of(t, self.start) }
    }

    #[cold]
    fn after_of(&self, t: f64, start: f64) -> f64 {
        if t.is_infinite() {
            return t;
        }
        let unscaled = scaled(t, -self.exponent);
        // Of the differences; and half a last place of `t`, since hits are compared when rounded.
        let last = scaled(f64::from_bits(1), -self.exponent);
        let slack = 8.0 * U * (unscaled.abs() + start.abs()) + last + f64::MIN_POSITIVE;
        let after = unscaled - start + slack;
        // Beyond the range, or the difference of what is.
        if after.is_nan() || after == f64::NEG_INFINITY { f64::MIN } else { after }
    }

    /// The ray's `t` at `s`, rounded; the greatest number where it is beyond the range.
    #[inline(always)]
    pub(crate) fn t(&self, s: f64) -> f64 {
        if self.is_plain() { s } else { scaled(self.start + s, self.exponent).clamp(f64::MIN, f64::MAX) }
    }
}

/// `p + t d` and a bound on what the pair leaves out.
fn moved_by([high, low]: [f64; 2], t: f64, d: f64) -> ([f64; 2], f64) {
    let product = t * d;
    let (sum, a) = two_sum(high, product);
    let (rest, b) = two_sum(low, t.mul_add(d, -product));
    let (rest, c) = two_sum(rest, a);
    let (high, low) = two_sum(sum, rest);
    ([high, low], b.abs() + c.abs())
}

/// The `k` for which `2^k <= x < 2^(k + 1)`, for positive `x`.
fn binary_exponent(x: f64) -> i32 {
    if x < f64::MIN_POSITIVE {
        return binary_exponent(x * 2f64.powi(60)) - 60;
    }
    (x.to_bits() >> 52 & 0x7ff) as i32 - 1023
}

/// `x 2^k`, in steps that stay in range; rounded only where it leaves the normal range.
fn scaled(x: f64, k: i32) -> f64 {
    let (mut x, mut k) = (x, k);
    while k > 1000 {
        (x, k) = (x * 2f64.powi(1000), k - 1000);
    }
    while k < -1000 {
        (x, k) = (x * 2f64.powi(-1000), k + 1000);
    }
    x * 2f64.powi(k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::expansion::Expansion;

    /// `p - (o + t d)`, exactly, `t` the sum of two numbers.
    fn off(p: f64, o: f64, t: f64, d: f64) -> f64 {
        let along: Expansion<2> = Expansion::<1>::new(t).scaled(d);
        let rest: Expansion<4> = Expansion::<2>::difference(p, o).minus(&along);
        rest.rounded().value()
    }

    #[test]
    fn lines_from_far_away_are_where_they_are() {
        // Along a diagonal through zero, exactly; and beside it, where two strides are needed.
        let d = DVec3::new(0.75, -0.5, 0.6);
        for k in [10, 60, 200] {
            let far = 2f64.powi(k);
            let near = Near::new(&Ray::new(-d * far, d), DVec3::ZERO, 1.0);
            assert!(near.origin.abs().max_element() <= 4.0 || k == 10, "{near:?}");
            assert!(near.error.max_element() < 1e-250, "{near:?}");
            assert_eq!(near.t(0.0), if k == 10 { 0.0 } else { far });
            let beside = Near::new(&Ray::new(-d * far + DVec3::X * (far * 1e-20), d), DVec3::ZERO, 1.0);
            if !beside.is_plain() {
                for a in 0..3 {
                    let t = (beside.origin[a] + d[a] * far) / d[a];
                    assert!((t - far).abs() < 1e-10 * far);
                }
            }
        }
        let near =
            Near::new(&Ray::new(DVec3::new(0.3, 1e9, 0.1), DVec3::new(0.1, -0.7, 0.3)), DVec3::ZERO, 1.0);
        for a in 0..3 {
            let o = [0.3, 1e9, 0.1][a];
            assert!(
                off(near.origin[a], o, near.start, near.dir[a]).abs() <= near.error[a] || near.exponent != 0
            );
        }
    }

    #[test]
    fn any_pace_is_the_same_line() {
        for pace in [f64::from_bits(1), 1e-320, 1e-308, 1e-200, 1.0, 1e200, 1e308, f64::MAX] {
            let ray = Ray::new(DVec3::new(0.5, 0.25, 1.0), DVec3::new(0.0, 0.0, -pace));
            let near = Near::new(&ray, DVec3::ZERO, 1.0);
            assert!(near.dir.z <= -0.5 && near.dir.z >= -1.0 && near.error.max_element() < 1e-15, "{near:?}");
            let t = near.t(1.0 / -near.dir.z);
            assert!((t * pace - 1.0).abs() < 1e-15 || t == f64::MAX, "{pace:e} {near:?}");
            assert!(near.before(t) <= near.after(t));
            assert!(
                near.before(f64::INFINITY) == f64::INFINITY
                    && near.after(f64::NEG_INFINITY) == f64::NEG_INFINITY
            );
            assert!(near.before(0.0) <= 0.0 && near.after(0.0) >= 0.0);
        }
        for x in [1.0, -3e-300, 1e300, 0.0] {
            assert_eq!(scaled(scaled(x, -20), 20), x);
        }
        assert_eq!(scaled(f64::from_bits(1), 2046), 2f64.powi(972));
        assert_eq!(
            (binary_exponent(f64::from_bits(1)), binary_exponent(1.5), binary_exponent(f64::MAX)),
            (-1074, 0, 1023)
        );
    }
}

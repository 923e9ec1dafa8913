//! How wrong: errors of hits and of images.

use crate::exact::{Corners, Rational, closest, triangle};
use core::fmt;
use core::ops::{Add, AddAssign};
use rt_geom::{Ray, Real, Vector};

/// What some rays got wrong, against the exact answers.
///
/// ```
/// use rt_measure::error::HitError;
/// use rt_measure::exact::Rational;
/// let one = Rational::from_f64(1.0).unwrap();
/// let mut error = HitError::default();
/// error.judge::<f32>(Some((7, &one)), Some((7, 1.0f32.next_up())));
/// error.judge::<f32>(Some((7, &one)), None);
/// assert_eq!((error.rays, error.missed, error.t_ulp), (2, 1, 1.0));
/// assert_eq!(error.missed_per_million(), 500_000.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HitError {
    /// Rays judged.
    pub rays: u64,
    /// Rays that hit something and were said to miss.
    pub missed: u64,
    /// Rays that hit nothing and were said to hit.
    pub invented: u64,
    /// Rays that were said to hit another primitive than the closest.
    pub wrong: u64,
    /// The largest error of a `t` where the primitive was right, in units in the last place of the precision asked. Infinite
    /// if a `t` was not finite.
    pub t_ulp: f64,
}

impl HitError {
    /// Judges one answer, primitive and `t`, against the exact one.
    pub fn judge<R: Real>(&mut self, exact: Option<(u32, &Rational)>, found: Option<(u32, R)>) {
        self.rays += 1;
        match (exact, found) {
            (None, None) => {}
            (Some(_), None) => self.missed += 1,
            (None, Some(_)) => self.invented += 1,
            (Some((prim, _)), Some((other, _))) if prim != other => self.wrong += 1,
            (Some((_, exact)), Some((_, t))) => self.t_ulp = self.t_ulp.max(ulps(exact, t)),
        }
    }

    /// Judges the closest hit of a ray among triangles.
    ///
    /// Where several triangles are equally close, exactly or after rounding, any of them is right: at an edge that is met
    /// exactly, neither neighbour is an error. Which of them the contract asks for is a matter of conformance.
    pub fn judge_triangles<R: Real>(&mut self, ray: &Ray<R>, triangles: &[Corners], found: Option<(u32, R)>) {
        let Some(truth) = closest(ray, triangles.iter().copied()) else { return self.judge(None, found) };
        let exact = truth.root.exact();
        let (origin, dir) = (ray.origin.widen().to_array(), ray.dir.widen().to_array());
        let tie = found.filter(|(prim, _)| *prim != truth.prim).and_then(|(prim, _)| {
            let other = triangle(origin, dir, *triangles.get(prim as usize)?)?.exact();
            (other == exact || other.nearest::<R>() == truth.t).then_some((prim, other))
        });
        let (prim, exact) = tie.unwrap_or((truth.prim, exact));
        self.judge(Some((prim, &exact)), found);
    }

    /// [`HitError::missed`] per million rays; 0 for no rays, like the other rates.
    pub fn missed_per_million(&self) -> f64 {
        self.per_million(self.missed)
    }

    /// [`HitError::invented`] per million rays.
    pub fn invented_per_million(&self) -> f64 {
        self.per_million(self.invented)
    }

    /// Rays whose hit or miss or primitive is wrong, per million.
    pub fn wrong_per_million(&self) -> f64 {
        self.per_million(self.missed + self.invented + self.wrong)
    }

    /// Whether every decision was right.
    pub fn is_exact(&self) -> bool {
        self.missed + self.invented + self.wrong == 0
    }

    fn per_million(&self, count: u64) -> f64 {
        if self.rays == 0 { 0.0 } else { count as f64 * 1e6 / self.rays as f64 }
    }
}

impl Add for HitError {
    type Output = HitError;
    fn add(self, other: HitError) -> HitError {
        HitError {
            rays: self.rays + other.rays,
            missed: self.missed + other.missed,
            invented: self.invented + other.invented,
            wrong: self.wrong + other.wrong,
            t_ulp: self.t_ulp.max(other.t_ulp),
        }
    }
}

impl AddAssign for HitError {
    fn add_assign(&mut self, other: HitError) {
        *self = *self + other;
    }
}

/// How far `t` is from the exact number, in units in the last place: the distance from the exact number, rounded, to the next
/// number away from zero. Infinite when `t` is not finite. Zero for the greatest number where the exact one is beyond the range.
pub fn ulps<R: Real>(exact: &Rational, t: R) -> f64 {
    let Some(found) = Rational::from_f64(t.into()) else { return f64::INFINITY };
    let rounded = exact.nearest::<R>();
    let size = if rounded < R::ZERO { -rounded } else { rounded };
    if size > R::MAX {
        // Beyond the range the contract asks for the greatest number.
        return if t == R::MAX && R::ZERO < rounded || t == -R::MAX && rounded < R::ZERO {
            0.0
        } else {
            f64::INFINITY
        };
    }
    let next: f64 = size.next_up().into();
    let size: f64 = size.into();
    // The greatest number has no next one, but a last place all the same.
    let ulp = if next.is_finite() { next - size } else { size - R::MAX.next_down().into() };
    // A quotient, because the unit may be as small as the least number.
    Rational::from_f64(ulp).map_or(f64::INFINITY, |ulp| (&(&found - exact) / &ulp).to_f64().abs())
}

/// How far one image is from another.
///
/// ```
/// use rt_measure::error::ImageError;
/// let error = ImageError::between(&[0.0, 1.0, 0.5, 0.5], &[0.0, 1.0, 0.5, 1.0], 2).unwrap();
/// assert_eq!((error.rmse, error.max, error.differing), (0.25, 0.5, 0.5));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageError {
    /// The root of the mean squared difference of all numbers.
    pub rmse: f64,
    /// The largest difference.
    pub max: f64,
    /// The share of pixels that differ at all, from 0 to 1.
    pub differing: f64,
}

impl ImageError {
    /// Compares two images of `channels` numbers a pixel. A NaN equals a NaN, an infinity itself; against anything else they
    /// differ infinitely. Empty images are equal.
    ///
    /// # Errors
    ///
    /// [`NotComparable`] when the lengths differ or are not whole pixels.
    pub fn between(image: &[f32], reference: &[f32], channels: usize) -> Result<ImageError, NotComparable> {
        if image.len() != reference.len() || channels == 0 || !image.len().is_multiple_of(channels) {
            return Err(NotComparable { len: image.len(), reference: reference.len(), channels });
        }
        let (mut squares, mut max, mut differing) = (0.0f64, 0.0f64, 0usize);
        for (pixel, other) in image.chunks_exact(channels).zip(reference.chunks_exact(channels)) {
            let mut differs = false;
            for (a, b) in pixel.iter().zip(other) {
                let d = if a == b || a.is_nan() && b.is_nan() { 0.0 } else { (*a as f64 - *b as f64).abs() };
                let d = if d.is_nan() { f64::INFINITY } else { d };
                squares += d * d;
                max = max.max(d);
                differs |= d > 0.0;
            }
            differing += differs as usize;
        }
        let count = image.len().max(1) as f64;
        Ok(ImageError {
            rmse: (squares / count).sqrt(),
            max,
            differing: differing as f64 * channels as f64 / count,
        })
    }
}

/// Two images that cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotComparable {
    /// Numbers in the image.
    pub len: usize,
    /// Numbers in the reference.
    pub reference: usize,
    /// Numbers a pixel was said to have.
    pub channels: usize,
}

impl fmt::Display for NotComparable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let NotComparable { len, reference, channels } = self;
        write!(f, "images of {len} and {reference} numbers are not the same pixels of {channels} each")
    }
}

impl core::error::Error for NotComparable {}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(x: f64) -> Rational {
        Rational::from_f64(x).unwrap()
    }

    #[test]
    fn every_kind_of_error_is_counted_and_adds_up() {
        let t = exact(2.0);
        let mut a = HitError::default();
        a.judge::<f64>(None, None);
        a.judge(None, Some((1, 2.0)));
        a.judge(Some((1, &t)), Some((2, 2.0)));
        let mut b = HitError::default();
        b.judge(Some((1, &t)), Some((1, 2.0f64.next_down())));
        b.judge::<f64>(Some((1, &t)), None);
        let sum = a + b;
        assert_eq!(sum, HitError { rays: 5, missed: 1, invented: 1, wrong: 1, t_ulp: 0.5 });
        assert_eq!(sum.wrong_per_million(), 600_000.0);
        assert_eq!(sum.invented_per_million(), 200_000.0);
        assert_eq!(HitError::default().wrong_per_million(), 0.0);
        assert!(!sum.is_exact() && HitError::default().is_exact());
    }

    #[test]
    fn either_neighbour_is_right_at_an_edge() {
        use rt_geom::glam::Vec3A;
        let [a, b, c, d] = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
        let triangles = [[a, b, c], [a, c, d], [a, b, c].map(|v| [v[0], v[1], 2.0])];
        let edge = Ray::new(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
        let mut error = HitError::default();
        for prim in [0, 1] {
            error.judge_triangles(&edge, &triangles, Some((prim, 1.0)));
        }
        assert_eq!(error, HitError { rays: 2, ..HitError::default() });
        for found in [None, Some((2, 2.0)), Some((9, 1.0))] {
            error.judge_triangles(&edge, &triangles, found);
        }
        error.judge_triangles(&Ray { dir: -edge.dir, ..edge }, &triangles, Some((0, -1.0)));
        assert_eq!(error, HitError { rays: 6, missed: 1, invented: 1, wrong: 2, t_ulp: 0.0 });
    }

    #[test]
    fn units_in_the_last_place() {
        let third = &exact(1.0) / &exact(3.0);
        assert!(ulps(&third, 1.0f32 / 3.0) <= 0.5);
        assert!(ulps(&third, 1.0 / 3.0) <= 0.5);
        assert_eq!(ulps(&exact(-1.0), (-1.0f32).next_down()), 1.0);
        assert_eq!(ulps(&exact(0.0), f64::from_bits(3)), 3.0);
        assert_eq!(ulps(&exact(f32::MAX as f64), f32::MAX.next_down()), 1.0);
        assert_eq!(ulps(&exact(1.0), f32::NAN), f64::INFINITY);
    }

    #[test]
    fn images() {
        let nan = f32::NAN;
        assert_eq!(ImageError::between(&[nan, 1.0], &[nan, 1.0], 1).unwrap(), ImageError::default());
        assert_eq!(ImageError::between(&[nan], &[1.0], 1).unwrap().max, f64::INFINITY);
        assert_eq!(ImageError::between(&[], &[], 3).unwrap(), ImageError::default());
        assert!(ImageError::between(&[1.0], &[1.0, 2.0], 1).is_err());
        let error = ImageError::between(&[1.0; 4], &[1.0; 4], 3).unwrap_err();
        assert!(error.to_string().contains("pixels of 3"));
        assert!(ImageError::between(&[1.0], &[1.0], 0).is_err());
    }
}

//! [`BoundingSphere`]: balls around points.

mod enclose;
mod fit;

use crate::cloud::Cloud;
use crate::unit_ray::{U, U32};
use crate::{Aabb, BoundingVolume, UnitRay};
use enclose::{enclose, holds_ball};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real, Vector, f32_above, f32_below};

/// Beyond this size of a coordinate or radius a sphere is all of space.
const FAR: f32 = (1u128 << 126) as f32;

/// A closed ball in `f32`: the points at most `radius` from `center`, relative to the origin it was made with. 16 bytes
/// of numbers.
///
/// Called so because a sphere is also a shape. The radius is not negative; it is infinite where the points are out of
/// reach, beyond `2^126`, and then the ball is all of space. Every constructor ends with an exact decision: the ball
/// holds every point as real numbers, and with the same centre no smaller `f32` radius does.
///
/// | constructor | radius over the smallest: mean, most | of 24 points | of `10^5` points |
/// | --- | --- | --- | --- |
/// | [`ritter`](BoundingSphere::ritter) | 1.040, 1.285 | 0.26 us | 0.83 ms |
/// | [`epos`](BoundingSphere::epos), 6 | 1.006, 1.156 | 0.56 us | 0.84 ms |
/// | [`epos`](BoundingSphere::epos), 14 | 1.0003, 1.041 | 0.70 us | 1.2 ms |
/// | [`epos`](BoundingSphere::epos), 26 | 1.0000, 1.012 | 0.90 us | 1.8 ms |
/// | [`smallest`](BoundingSphere::smallest) | 1 | 0.39 us | 1.8 ms |
///
/// Measured on 20,000 random sets of 3 to 1000 points; times on a busy virtual machine, the least of many runs. Sets made to hurt
/// do worse: eight points found by search give Ritter's growth 1.364.
///
/// ```
/// use rt_bounds::BoundingSphere;
/// use rt_geom::glam::{DVec3, Vec3A};
/// let corners = [Vec3A::ZERO, Vec3A::X, Vec3A::Y, Vec3A::Z, Vec3A::ONE];
/// let ball = BoundingSphere::smallest(&corners, DVec3::ZERO).unwrap();
/// assert_eq!(ball.center, Vec3A::splat(0.5));
/// assert!((ball.radius - 0.75f32.sqrt()).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// The middle.
    pub center: Vec3A,
    /// The radius: not negative, may be zero or infinite.
    pub radius: f32,
}

/// From how many extreme points [`BoundingSphere::epos`] starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extremes {
    /// Along the axes.
    Six,
    /// And along the diagonals of a cube.
    Fourteen,
    /// And along the diagonals of its faces.
    TwentySix,
}

impl BoundingSphere {
    /// All of space.
    pub const INFINITE: BoundingSphere = BoundingSphere { center: Vec3A::ZERO, radius: f32::INFINITY };

    /// A ball around some points, relative to `origin`: of the three pairs of points extreme along the axes the one
    /// farthest apart is the diameter, and every point outside makes the ball grow just enough. `None` for no points,
    /// or where one or `origin` is not finite.
    ///
    /// Cost: four passes over the points and a copy of them in `f64`.
    ///
    /// Source: Ritter, "An efficient bounding sphere", Graphics Gems (1990). His growth is in `f64` here, and a last
    /// pass shrinks the radius to the farthest point.
    pub fn ritter<V: Vector>(points: &[V], origin: DVec3) -> Option<BoundingSphere> {
        let cloud = Cloud::new(points, origin)?;
        Some(enclose(cloud.place(fit::ritter(&cloud.points).center, origin), points, origin))
    }

    /// A ball around some points, relative to `origin`: the smallest ball of points extreme along fixed directions,
    /// grown by every point outside. `None` for no points, or where one or
    /// `origin` is not finite.
    ///
    /// Cost: four passes, one of them with 3, 7 or 13 dot products a point.
    ///
    /// Source: Larsson, "Fast and tight fitting bounding spheres", SIGRAD 2008 (EPOS-6, -14, -26).
    pub fn epos<V: Vector>(points: &[V], origin: DVec3, of: Extremes) -> Option<BoundingSphere> {
        let cloud = Cloud::new(points, origin)?;
        Some(enclose(cloud.place(fit::epos(&cloud.points, of).center, origin), points, origin))
    }

    /// The smallest ball around some points, relative to `origin`, up to the rounding of its centre to `f32`. `None`
    /// for no points, or where one or `origin` is not finite.
    ///
    /// Coincident, collinear, coplanar and cospherical points are ordinary input.
    ///
    /// Cost: four passes and one a round; four to six rounds, of 24 points or `10^5`.
    ///
    /// Source: Welzl, "Smallest enclosing disks (balls and ellipsoids)" (1991), with the pivot rule of Gärtner, "Fast
    /// and robust smallest enclosing balls", ESA 1999: always add the farthest point.
    pub fn smallest<V: Vector>(points: &[V], origin: DVec3) -> Option<BoundingSphere> {
        let cloud = Cloud::new(points, origin)?;
        Some(enclose(cloud.place(fit::smallest(&cloud.points).center, origin), points, origin))
    }

    /// The ball around a box: through its corners. `None` for a box that is not [valid](Aabb::is_valid); all of space
    /// for an infinite one.
    pub fn of_aabb(b: &Aabb) -> Option<BoundingSphere> {
        if !b.is_valid() {
            return None;
        }
        let corner = |i: u32| {
            let side = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
            Vec3A::new(side(0, b.min.x, b.max.x), side(1, b.min.y, b.max.y), side(2, b.min.z, b.max.z))
        };
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(corner);
        if !(b.min.is_finite() && b.max.is_finite()) {
            return Some(BoundingSphere::INFINITE);
        }
        Some(enclose(b.min.as_dvec3() * 0.5 + b.max.as_dvec3() * 0.5, &corners, DVec3::ZERO))
    }

    /// Whether every point of `other` lies in this ball, decided exactly. False where a number is NaN.
    pub fn contains(self, other: BoundingSphere) -> bool {
        if self.radius == f32::INFINITY {
            return !other.radius.is_nan() && !other.center.is_nan();
        }
        let finite = other.radius.is_finite() && other.center.is_finite() && self.center.is_finite();
        finite && self.radius >= 0.0 && holds_ball(self.center, self.radius, other.center, other.radius)
    }

    /// What [`BoundingVolume::entry`] decides last.
    #[inline]
    fn entry_f64(&self, ray: &UnitRay) -> Option<f32> {
        let radius = self.radius as f64;
        let m = ray.origin - self.center.as_dvec3();
        let k = m.dot(ray.dir);
        let across = m - ray.dir * k;
        let e = (ray.slack + (k.abs() + radius) * (32.0 * U)) * 2.0;
        let reach = radius + e;
        let square = reach * reach - across.length_squared() * (1.0 - 64.0 * U);
        if square < 0.0 {
            return None;
        }
        let half = square.sqrt() + e;
        let enter = ray.near.max(-k - half);
        (enter <= ray.far.min(half - k)).then(|| f32_below(enter))
    }

    /// The smallest ball around both, up to the rounding of its centre: the larger one where it holds the other.
    pub fn union(self, other: BoundingSphere) -> BoundingSphere {
        // The same answer whichever comes first.
        let key = |s: BoundingSphere| (s.radius, s.center.x, s.center.y, s.center.z);
        let (big, small) = if key(self) < key(other) { (other, self) } else { (self, other) };
        if big.contains(small) {
            return big;
        }
        let (c, d) = (big.center.as_dvec3(), small.center.as_dvec3());
        let (big_radius, small_radius) = (big.radius as f64, small.radius as f64);
        let apart = c.distance(d);
        let radius = (apart + big_radius + small_radius) * 0.5;
        let center = (c + (d - c) * ((radius - big_radius) / apart)).as_vec3a();
        let reach = |from: DVec3, r: f64| (from.distance(center.as_dvec3()) + r) * (1.0 + 8.0 * U);
        let most = reach(c, big_radius).max(reach(d, small_radius));
        let mut union = BoundingSphere { center, radius: f32_above(most) };
        if !(union.radius <= FAR && center.abs().max_element() <= FAR) {
            return BoundingSphere::INFINITE;
        }
        let below = BoundingSphere { center, radius: union.radius.next_down() };
        if below.contains(big) && below.contains(small) {
            union = below;
        }
        union
    }
}

impl BoundingVolume for BoundingSphere {
    type Ready = UnitRay;

    /// By [`BoundingSphere::smallest`], which costs no more than the others.
    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<BoundingSphere> {
        BoundingSphere::smallest(points, origin)
    }

    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, _world: &Aabb) -> UnitRay {
        UnitRay::new(ray, origin)
    }

    /// By the distance of the centre from the line, which does not cancel when the ray starts far away: in `f32` first,
    /// which dismisses what is clearly beside the line, then in `f64`.
    ///
    /// Why no hit is lost, with `u = 2^-53` (or `2^-24`), `m` from the centre to the ray's origin `o`, `k` and `f` its
    /// parts along the ray and across, and a hat for what is computed. `m` is off by `u |o| + u |m|`. The direction,
    /// off by `4 u`, and the roundings of `k` and `f` move each of them by at most `18 u |m|` more, and `|m| <= |k| +
    /// |f|`. So both errors stay below `e + 20 u f^` with `e = 2 u |o| + 32 u (|k^| + r)`. If the line meets the ball,
    /// then `f^ <= r + e + 20 u f^`, and `r^2 - f^2 <= r^2 - f^^2 + 2 (e + 20 u f^) f^ <= (r + 2 e)^2 - f^^2 (1 - 64
    /// u)`: the computed half chord is the longer one, and where the square would be negative there is no hit. What `k`
    /// may be off is added to the chord, at both ends.
    ///
    /// False hits: within some `64 u` of the distance beside the ball, `u = 2^-53`.
    #[inline]
    fn entry(&self, ray: &UnitRay) -> Option<f32> {
        let rough = &ray.rough;
        let m = rough.origin - self.center;
        let k = m.dot(rough.dir);
        let across = m - rough.dir * k;
        let reach = self.radius + (rough.slack + (k.abs() + self.radius) * (32.0 * U32)) * 2.0;
        if across.length_squared() * (1.0 - 64.0 * U32) > reach * reach {
            return None;
        }
        self.entry_f64(ray)
    }

    fn surface_area(&self) -> f64 {
        4.0 * std::f64::consts::PI * (self.radius as f64).powi(2)
    }

    fn aabb(&self) -> Aabb {
        if self.radius == f32::INFINITY {
            return Aabb::INFINITE;
        }
        let (c, r) = (self.center.as_dvec3(), DVec3::splat(self.radius as f64));
        Aabb::new(Aabb::from_f64(c, c, r).min, Aabb::from_f64(c, c, -r).max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_radii_stay_exact() {
        let points = [Vec3A::new(3.0, 4.0, 0.0), Vec3A::new(-3.0, -4.0, 0.0), Vec3A::new(0.0, 5.0, 0.0)];
        let ball = BoundingSphere::smallest(&points, DVec3::ZERO).unwrap();
        assert_eq!(ball, BoundingSphere { center: Vec3A::ZERO, radius: 5.0 });
        assert_eq!(ball.aabb(), Aabb::new(Vec3A::splat(-5.0), Vec3A::splat(5.0)));
        let point = BoundingSphere::ritter(&[Vec3A::ONE; 3], DVec3::ONE).unwrap();
        assert_eq!(point, BoundingSphere { center: Vec3A::ZERO, radius: 0.0 });
    }

    #[test]
    fn unions_of_tangent_and_nested_balls() {
        let ball = |x: f32, y: f32, radius: f32| BoundingSphere { center: Vec3A::new(x, y, 0.0), radius };
        assert_eq!(ball(0.0, 0.0, 10.0).union(ball(3.0, 4.0, 5.0)), ball(0.0, 0.0, 10.0));
        assert_eq!(ball(-1.0, 0.0, 1.0).union(ball(2.0, 0.0, 2.0)), ball(1.0, 0.0, 3.0));
        assert_eq!(ball(1.0, 0.0, 0.0).union(ball(1.0, 0.0, 0.0)), ball(1.0, 0.0, 0.0));
        assert_eq!(ball(1.0, 0.0, 2.0).union(BoundingSphere::INFINITE), BoundingSphere::INFINITE);
        assert!(!ball(0.0, 0.0, 10.0).contains(ball(3.0, 4.0, 5.0f32.next_up())));
    }

    #[test]
    fn balls_of_boxes() {
        let cube = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
        let ball = BoundingSphere::of_aabb(&cube).unwrap();
        assert!((ball.surface_area() / 6.0 - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        assert_eq!(BoundingSphere::of_aabb(&Aabb::INFINITE), Some(BoundingSphere::INFINITE));
        assert_eq!(BoundingSphere::of_aabb(&Aabb::EMPTY), None);
    }

    #[test]
    fn what_is_out_of_reach_is_all_of_space() {
        let far = [DVec3::splat(1e300), DVec3::splat(-1e300)];
        for ball in [BoundingSphere::ritter(&far, DVec3::ZERO), BoundingSphere::smallest(&far, DVec3::ONE)] {
            assert_eq!(ball, Some(BoundingSphere::INFINITE));
        }
        assert_eq!(BoundingSphere::INFINITE.aabb(), Aabb::INFINITE);
        let ray = Ray::new(Vec3A::ZERO, Vec3A::X);
        assert!(BoundingSphere::INFINITE.entry(&UnitRay::new(&ray, DVec3::ZERO)).is_some());
        assert!(BoundingSphere::ritter(&[Vec3A::NAN], DVec3::ZERO).is_none());
        assert!(BoundingSphere::smallest::<Vec3A>(&[], DVec3::ZERO).is_none());
    }
}

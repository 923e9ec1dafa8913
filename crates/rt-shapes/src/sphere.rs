//! [`Sphere`]: full spheres.

use crate::clip::sphere_avoids;
use crate::quadric::{direction, share};
use crate::surface::unit;
use crate::{Partials, Shape, Surface, Uv};
use core::f64::consts::{PI, TAU};
use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::{Aabb, DAabb};
use rt_geom::expansion::{DoubleDouble, Expansion, two_sum};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Transform, Vector, gamma};

const U: f64 = f64::EPSILON / 2.0;
/// A Newton step this small leaves an error of its square: less than a rounding.
const POLISHED: f64 = 1e-10;

/// A full sphere in world space, kept in `f64`; answers rays of both precisions.
///
/// Whether a ray hits is decided exactly, tangents included: a filter settles almost all rays, an exact discriminant the
/// rest. Roots are polished by a Newton step on a compensated residual: relative error below `2^-50` except within about
/// `2^-48` of tangency, where they come from the exact discriminant. `all_hits` reports both roots.
///
/// Exact where the coordinates, radius and components of the direction, as far as they are not zero, span at most `2^150` each;
/// beyond, rounded as `f64` rounds.
///
/// Source: Haines, Günther, Akenine-Möller, "Precision improvements for ray/sphere intersection", *Ray Tracing Gems* (2019),
/// chapter 7.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::Sphere;
/// let ball = Sphere::new(DVec3::new(0.0, 0.0, 10_000.0), 1.0)?;
/// let ray = Ray::new(Vec3A::new(0.0, 1.0, 0.0), Vec3A::Z); // tangent
/// assert_eq!(ball.intersect(&ray).unwrap().t, 10_000.0);
/// # Ok::<(), rt_shapes::SphereError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
}

/// Why a sphere is none.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SphereError {
    /// The centre is not finite.
    Center(DVec3),
    /// The radius is not finite and positive.
    Radius(f64),
}

impl fmt::Display for SphereError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SphereError::Center(c) => write!(f, "sphere centre {c} is not finite"),
            SphereError::Radius(r) => write!(f, "sphere radius {r} is not a positive number"),
        }
    }
}

impl core::error::Error for SphereError {}

/// Whether products of four such factors stay in range; false for NaN.
#[inline(always)]
fn moderate(x: f64) -> bool {
    x > 1e-60 && x < 1e60
}

impl Sphere {
    /// The sphere around `center`.
    ///
    /// # Errors
    ///
    /// When `center` is not finite, or `radius` not finite and above zero.
    pub fn new(center: DVec3, radius: f64) -> Result<Sphere, SphereError> {
        if !center.is_finite() {
            return Err(SphereError::Center(center));
        }
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(SphereError::Radius(radius));
        }
        Ok(Sphere { center, radius })
    }

    /// The centre.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The radius.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The area: infinite for a radius whose square leaves the range of `f64`. Relative error below `2^-51` but for subnormal ones.
    pub fn area(&self) -> f64 {
        4.0 * PI * self.radius * self.radius
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`, as
    /// [`Quadric::sample`](crate::Quadric::sample): the first goes around, the second evenly by height, which area is even by.
    /// Numbers outside are moved to the nearest inside, NaN to 0.
    ///
    /// Source: Archimedes, *On the Sphere and Cylinder* (about 225 BC).
    ///
    /// ```
    /// use rt_geom::glam::{DVec2, DVec3};
    /// use rt_shapes::Sphere;
    /// let ball = Sphere::new(DVec3::ONE, 2.0)?;
    /// assert_eq!(ball.sample(DVec2::new(0.0, 0.5)).point, DVec3::new(3.0, 1.0, 1.0));
    /// assert_eq!(ball.area(), 16.0 * std::f64::consts::PI);
    /// # Ok::<(), rt_shapes::SphereError>(())
    /// ```
    pub fn sample(&self, xi: DVec2) -> Surface {
        let xi = unit(xi);
        // The height in radii is 2 xi.y - 1; so nothing cancels in the distance from the axis.
        let across = 2.0 * (xi.y * (1.0 - xi.y)).sqrt();
        self.record((direction(xi.x * TAU) * across).extend(2.0 * xi.y - 1.0))
    }

    /// The record of the point with a normal.
    fn record(&self, normal: DVec3) -> Surface {
        let offset = normal * self.radius;
        let point = self.center + offset;
        let error = (offset.abs() * 2.0 + point.abs()) * gamma(5);
        // Neither cancels near the poles, as an arc cosine would.
        let around = share([0.0, TAU], normal.truncate());
        let uv = DVec2::new(around, normal.truncate().length().atan2(-normal.z) / PI);
        Surface { point, error, normal, shading: normal, uv }
    }

    /// Both distances at which the line meets the sphere, the lesser first; equal for a tangent.
    #[inline]
    fn roots(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        let (size, speed) = ((o - self.center).abs().max_element().max(self.radius), d.abs().max_element());
        if moderate(size) && moderate(speed) {
            return self.roots_in_range(o, d);
        }
        self.roots_scaled(o, d, size, speed)
    }

    /// [`Sphere::roots`] for sizes whose products leave the range of `f64`: the same sphere and ray, in other units.
    #[cold]
    fn roots_scaled(&self, o: DVec3, d: DVec3, size: f64, speed: f64) -> Option<[f64; 2]> {
        if !(size.is_finite() && o.is_finite() && d.is_finite()) || speed == 0.0 {
            return None;
        }
        let power = |x: f64| f64::from_bits((x.to_bits() >> 52).clamp(30, 2000) << 52);
        let (unit, pace) = (power(size), power(speed));
        let ball = Sphere { center: self.center / unit, radius: self.radius / unit };
        let roots = ball.roots_in_range(o / unit, d / pace)?;
        // In the order that stays in range.
        Some(roots.map(|t| if (t * unit).is_finite() { t * unit / pace } else { t / pace * unit }))
    }

    #[inline(always)]
    fn roots_in_range(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        let l = o - self.center;
        let r = self.radius;
        let a = d.dot(d);
        let k = l.dot(d) / a;
        // From the centre to the line, perpendicular: no cancellation of large squares for small far spheres.
        let f = l - d * k;
        let ff = f.dot(f);
        let inside = (r - ff.sqrt()) * (r + ff.sqrt());
        // 16 roundings of |l| in each component of f bound what its square may be off by.
        let size = l.abs().element_sum();
        let off = 32.0 * U * size;
        let bound = 4.0 * off * (off + ff.sqrt()) + 16.0 * U * (ff + r * r);
        if inside < -bound {
            return None;
        }
        if inside > bound {
            let half = (inside / a).sqrt();
            return Some([-k - half, -k + half].map(|t| self.polish(o, d, t)));
        }
        self.roots_exact(o, d)
    }

    /// Newton steps on the residual `|o + t d - c|^2 - r^2`, evaluated with twice the digits, until they no longer matter:
    /// one for most rays, a second for `f64` near tangency.
    #[inline]
    fn polish(&self, o: DVec3, d: DVec3, mut t: f64) -> f64 {
        let r = DoubleDouble::from(self.radius);
        for _ in 0..3 {
            let mut residual = DoubleDouble::from(0.0) - r * r;
            let mut slope = 0.0;
            for i in 0..3 {
                let p = DoubleDouble::difference(o[i], self.center[i]) + DoubleDouble::from(t) * d[i].into();
                residual = residual + p * p;
                slope += p.value() * d[i];
            }
            let step = residual.value() / (2.0 * slope);
            if !step.is_finite() {
                break;
            }
            t -= step;
            if step.abs() <= t.abs() * POLISHED {
                break;
            }
        }
        t
    }

    /// The roots from the exact discriminant, for lines so close to tangent that rounding leaves the decision open.
    #[cold]
    fn roots_exact(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        if !(o.is_finite() && d.is_finite() && d != DVec3::ZERO) {
            return None;
        }
        let l: [Expansion<2>; 3] = [0, 1, 2].map(|i| Expansion::difference(o[i], self.center[i]));
        let square = |x: &Expansion<2>| -> Expansion<8> { x.times(x) };
        let single = |x: f64| -> Expansion<2> { Expansion::<1>::new(x).scaled(x) };
        let a: Expansion<4> = single(d.x).plus(&single(d.y));
        let a: Expansion<6> = a.plus(&single(d.z));
        let products: [Expansion<4>; 3] = [0, 1, 2].map(|i| l[i].scaled(d[i]));
        let b: Expansion<8> = products[0].plus(&products[1]);
        let b: Expansion<12> = b.plus(&products[2]);
        let c: Expansion<16> = square(&l[0]).plus(&square(&l[1]));
        let c: Expansion<24> = c.plus(&square(&l[2]));
        let c: Expansion<26> = c.minus(&single(self.radius));
        let bb: Expansion<288> = b.times(&b);
        let ac: Expansion<312> = a.times(&c);
        let discriminant: Expansion<600> = bb.minus(&ac);
        if discriminant.sign() < 0 {
            return None;
        }
        let (a, b, root) = (a.rounded(), b.rounded(), discriminant.rounded().sqrt());
        let zero = DoubleDouble::from(0.0);
        // The root that does not cancel first, the other by division.
        let q = if b.value() < 0.0 { root - b } else { zero - b - root };
        if q.value() == 0.0 {
            return Some([0.0, 0.0]);
        }
        let (near, far) = ((q / a).value(), (c.rounded() / q).value());
        Some([near.min(far), near.max(far)])
    }
}

impl WorldBound for Sphere {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }

    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let below = |c: f64| match two_sum(c, -self.radius) {
            (x, e) if e < 0.0 => x.next_down(),
            (x, _) => x,
        };
        let min = DVec3::from_array(self.center.to_array().map(below));
        let max = -DVec3::from_array((-self.center).to_array().map(below));
        Aabb::from_f64(min, max, origin)
    }

    /// Its box within the cell, empty where the cell holds none of the surface.
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        match sphere_avoids(self.center, self.radius, cell, origin) {
            true => Aabb::EMPTY,
            false => self.world_bound_from(origin).overlap(*cell),
        }
    }

    /// The box of the ellipsoid that the map makes of the sphere: it reaches as far as the rows of the map are long.
    fn bound_under(&self, map: &Transform) -> DAabb {
        let (rows, center) = (map.linear().transpose(), map.point(self.center));
        let reach =
            DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length()) * self.radius;
        let here = DAabb { min: self.center - self.radius, max: self.center + self.radius };
        DAabb { min: center - reach, max: center + reach }.room(here, map)
    }
}

impl<R: Real> Primitive<R> for Sphere {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        let roots = self.roots(ray.origin.widen(), ray.dir.widen())?;
        let t = ray.admit(roots[0]).or_else(|| ray.admit(roots[1]))?;
        Some(Hit { t, at: Uv::default() })
    }

    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        if let Some([near, far]) = self.roots(ray.origin.widen(), ray.dir.widen()) {
            if let Some(t) = ray.admit(near) {
                each(Hit { t, at: Uv::default() })?;
            }
            if far != near
                && let Some(t) = ray.admit(far)
            {
                each(Hit { t, at: Uv::default() })?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl<R: Real> Shape<R> for Sphere {
    /// The point is carried onto the sphere (Pharr et al. 2023, section 6.8.4). `uv` are those of
    /// [`Quadric::sphere`](crate::Quadric::sphere): `u` goes counter-clockwise around the z axis from x, `v` from the lowest
    /// point to the highest, both evenly by angle.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let wide = ray.widen();
        let rough = wide.at(hit.t.into()) - self.center;
        // Of size 1 first, so that squares neither vanish nor overflow.
        self.record((rough / rough.abs().max_element()).normalize_or(DVec3::Z))
    }

    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let normal = self.surface(ray, hit).normal;
        let across = normal.truncate().length();
        let (x, y) = if across > 0.0 { (normal.x / across, normal.y / across) } else { (1.0, 0.0) };
        let dndu = DVec3::new(-normal.y, normal.x, 0.0) * TAU;
        let dndv = DVec3::new(-x * normal.z, -y * normal.z, across) * PI;
        Partials { dpdu: dndu * self.radius, dpdv: dndv * self.radius, dndu, dndv }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_geom::glam::Vec3A;

    #[test]
    fn tangents_hit_and_their_neighbours_do_not() {
        for distance in [3.0, 1e4, 1e8] {
            let ball = Sphere::new(DVec3::new(0.0, 0.0, distance), 1.0).unwrap();
            let at = |y: f64| ball.intersect(&Ray::new(DVec3::new(0.0, y, 0.0), DVec3::Z)).map(|hit| hit.t);
            assert_eq!(at(1.0), Some(distance));
            assert_eq!(at(1.0f64.next_up()), None);
            assert!(at(1.0f64.next_down()).is_some_and(|t| t < distance));
        }
    }

    #[test]
    fn sizes_and_speeds_beyond_any_product_are_met() {
        for size in [1e-300, 1e-165, 1e-90, 1.0, 1e100, 1e300] {
            for speed in [1e-250, 1e-165, 1e-60, 1.0, 1e160, 1e250] {
                let ball = Sphere::new(DVec3::Z * (5.0 * size), size).unwrap();
                let ray = Ray::new(DVec3::ZERO, DVec3::Z * speed);
                let (exact, met) = (4.0 * size / speed, ball.intersect(&ray));
                assert!(met.is_some(), "{size:e} {speed:e}");
                if exact.is_normal() {
                    assert!((met.unwrap().t / exact - 1.0).abs() < 1e-15, "{size:e} {speed:e} {met:?}");
                }
                assert_eq!(ball.intersect(&Ray { origin: DVec3::X * (3.0 * size), ..ray }), None);
            }
        }
    }

    #[test]
    fn both_sides_are_hits() {
        let ball = Sphere::new(DVec3::ZERO, 2.0).unwrap();
        let ray = Ray::new(Vec3A::ZERO, Vec3A::X);
        assert_eq!(ball.intersect(&ray).map(|hit| hit.t), Some(2.0));
        let mut all = Vec::new();
        let _ = ball.all_hits(&ray.between(-9.0, 9.0), &mut |hit| {
            all.push(hit.t);
            ControlFlow::Continue(())
        });
        assert_eq!(all, [-2.0, 2.0]);
        assert_eq!(ball.intersect(&Ray { dir: Vec3A::ZERO, ..ray }), None);
        assert_eq!(ball.intersect(&Ray { dir: Vec3A::NAN, ..ray }), None);
        assert!(Sphere::new(DVec3::ZERO, 0.0).is_err() && Sphere::new(DVec3::NAN, 1.0).is_err());
    }

    proptest! {
        #[test]
        fn spawned_rays_leave(scale in -8..8i32, c in prop::array::uniform3(-1e3..1e3f64), o in prop::array::uniform3(-3.0..3.0f64),
                              p in prop::array::uniform3(-0.55..0.55f64), out in prop::array::uniform3(-1.0..1.0f64)) {
            let s = (2f64).powi(scale);
            let ball = Sphere::new(DVec3::from_array(c), s).unwrap();
            let o = ball.center + DVec3::from_array(o) * s;
            let target = ball.center + DVec3::from_array(p) * s;
            let ray = Ray::new(o.as_vec3a(), (target - o).as_vec3a());
            prop_assume!(ray.is_valid());
            let Some(hit) = ball.intersect(&ray) else { return Ok(()) };
            let surface = ball.surface(&ray, &hit);
            let out = DVec3::from_array(out);
            let out = if out.dot(surface.normal) < 0.0 { -out } else { out };
            prop_assume!(out.dot(surface.normal) > 1e-3);
            prop_assert!(!ball.intersect_p(&surface.spawn(out.as_vec3a())));
            prop_assert!(!ball.intersect_p(&surface.spawn(out)));
        }
    }
}

//! [`Frustum`]: open cones, truncated cones and cylinders between two points.

use super::form::{Extent, Form, Number, Terms};
use super::solve;
use super::sweep::Sweep;
use super::{LARGEST, QuadricError, Root, surface};
use crate::clip::frustum_avoids;
use crate::surface::unit;
use crate::{Partials, Shape, Surface, Uv};
use core::f64::consts::{PI, TAU};
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real};

/// The side of a cone, a truncated cone or a cylinder between two points of the world: open at both ends.
///
/// It is placed by its two points, without a matrix or its inverse, and kept in `f64`; answers rays of both precisions. The
/// normal points away from the axis; `u` goes once around, `v` from the base to the top.
///
/// A line is decided about as by all quadrics here, see [`Quadric`](super::Quadric): no hit is missed. Both rims belong to
/// it. An apex has no normal; the direction of the axis stands in for it, and rays that leave from there may meet the side.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::Frustum;
/// let cone = Frustum::cone(DVec3::ZERO, 2.0, DVec3::new(0.0, 0.0, 4.0))?;
/// let half_way = Ray::new(Vec3A::new(-5.0, 0.0, 2.0), Vec3A::X);
/// assert_eq!(cone.intersect(&half_way).unwrap().t, 4.0);
/// let tube = Frustum::cylinder(DVec3::ZERO, DVec3::new(0.0, 3.0, 4.0), 1.0)?;
/// assert!((tube.area() - 10.0 * std::f64::consts::PI).abs() < 1e-12);
/// # Ok::<(), rt_shapes::QuadricError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Frustum {
    ends: [DVec3; 2],
    radii: [f64; 2],
    /// From the base to the top, over a power of two that makes its largest component about 1.
    axis: [DoubleDouble; 3],
    unit: f64,
    /// The radius at axial coordinate `h`, times the length of `axis`, is `at_base + grows h`.
    at_base: DoubleDouble,
    grows: DoubleDouble,
    extent: Extent,
}

fn dot(a: [DoubleDouble; 3], b: [DoubleDouble; 3]) -> DoubleDouble {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Frustum {
    /// The side between a circle of radius `r0` around `base` and one of radius `r1` around `top`, both perpendicular to the
    /// line between them. One radius may be zero.
    ///
    /// # Errors
    ///
    /// When a point is not finite or both are the same, a radius is negative or NaN, both are zero, or anything exceeds `1e290`.
    pub fn new(base: DVec3, r0: f64, top: DVec3, r1: f64) -> Result<Frustum, QuadricError> {
        for p in [base, top] {
            if !(p.abs().max_element() <= LARGEST && p.is_finite()) {
                return Err(QuadricError::Point(p));
            }
        }
        for r in [r0, r1] {
            if !(0.0..=LARGEST).contains(&r) {
                return Err(QuadricError::Radius(r));
            }
        }
        if r0 == 0.0 && r1 == 0.0 {
            return Err(QuadricError::Radius(r0));
        }
        let unit = match (top - base).abs().max_element() {
            0.0 => return Err(QuadricError::NoAxis(base)),
            length if length > LARGEST => return Err(QuadricError::Point(top)),
            length => f64::from_bits((length.to_bits() >> 52).clamp(30, 2000) << 52),
        };
        // Exact: the differences have two parts, and the unit is a power of two.
        let axis =
            [0, 1, 2].map(|i| DoubleDouble::difference(top[i], base[i]) * DoubleDouble::from(1.0 / unit));
        let square = dot(axis, axis);
        let length = square.sqrt();
        let wide = DoubleDouble::from;
        let rise = square * wide(unit);
        let half = 0.5 * (length.value() * unit);
        let extent = Extent {
            anchor: base,
            middle: (top - base) * 0.5,
            // The ball around both rims, with the middle of the axis at its middle.
            radius: half.hypot(r0.max(r1)) * (1.0 + 8.0 * f64::EPSILON),
            gain: 6.0,
            constant: length.value() * r0,
            limits: [wide(0.0), rise],
        };
        let grows = length * DoubleDouble::difference(r1 / unit, r0 / unit) / square;
        let gain = extent.gain.max(3.0 * grows.value().abs() * length.value());
        Ok(Frustum {
            ends: [base, top],
            radii: [r0, r1],
            axis,
            unit,
            at_base: length * wide(r0),
            grows,
            extent: Extent { gain, ..extent },
        })
    }

    /// The side of the cone from a circle around `base` to the point `apex`.
    ///
    /// # Errors
    ///
    /// As [`Frustum::new`].
    pub fn cone(base: DVec3, radius: f64, apex: DVec3) -> Result<Frustum, QuadricError> {
        Frustum::new(base, radius, apex, 0.0)
    }

    /// The side of the cylinder between two points.
    ///
    /// # Errors
    ///
    /// As [`Frustum::new`].
    pub fn cylinder(base: DVec3, top: DVec3, radius: f64) -> Result<Frustum, QuadricError> {
        Frustum::new(base, radius, top, radius)
    }

    /// The middles of both rims: base and top.
    pub fn ends(&self) -> [DVec3; 2] {
        self.ends
    }

    /// The radii of both rims.
    pub fn radii(&self) -> [f64; 2] {
        self.radii
    }

    /// Both roots of the whole line on the surface, the lesser first, whatever their sign.
    pub fn roots(&self, origin: DVec3, dir: DVec3) -> [Option<Root>; 2] {
        solve::roots(self, origin, dir)
    }

    /// The area: `pi (r0 + r1) s` with the slant height `s`. Relative error below `2^-49`.
    pub fn area(&self) -> f64 {
        let [r0, r1] = self.radii;
        PI * (r0 + r1) * self.rise().length().hypot(r1 - r0)
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`. Numbers
    /// outside are moved to the nearest inside, NaN to 0.
    pub fn sample(&self, xi: DVec2) -> Surface {
        let xi = unit(xi);
        let [r0, r1] = self.radii;
        let radius = (r0 * r0 + (r1 * r1 - r0 * r0) * xi.y).max(0.0).sqrt();
        let v = (xi.y * (r0 + r1) / (r0 + radius)).clamp(0.0, 1.0);
        let v = if r0 + radius > 0.0 { v } else { 0.0 };
        let [x, y, _] = self.frame();
        let (sin, cos) = (TAU * xi.x).sin_cos();
        surface::of(self, self.rise() * v + (x * cos + y * sin) * radius, |w| self.uv(w))
    }

    fn rise(&self) -> DVec3 {
        DVec3::from_array(self.axis.map(DoubleDouble::value)) * self.unit
    }

    /// Three perpendicular directions, the last along the axis.
    fn frame(&self) -> [DVec3; 3] {
        let z = DVec3::from_array(self.axis.map(DoubleDouble::value)).normalize();
        let (x, y) = z.any_orthonormal_pair();
        [x, y, z]
    }

    fn uv(&self, w: DVec3) -> DVec2 {
        let [x, y, z] = self.frame();
        let u = (w.dot(y).atan2(w.dot(x)) / TAU).rem_euclid(1.0);
        DVec2::new(u, (w.dot(z) / self.rise().length()).clamp(0.0, 1.0))
    }
}

impl Form for Frustum {
    #[inline(always)]
    fn extent(&self) -> &Extent {
        &self.extent
    }
    #[inline(always)]
    fn signs(&self) -> [f64; 4] {
        [1.0, 1.0, 1.0, -1.0]
    }
    #[inline(always)]
    fn slope(&self) -> DoubleDouble {
        DoubleDouble::from(0.0)
    }
    /// The distance from the axis and the radius there, both times the length of `axis`: `w x axis`, and a function of
    /// `w . axis`.
    #[inline(always)]
    fn linear<T: Number>(&self, w: [T; 3]) -> Terms<T> {
        let e = self.axis.map(T::wide);
        let axial = w[0] * e[0] + w[1] * e[1] + w[2] * e[2];
        let minor = |i: usize, j: usize| w[i] * e[j] - w[j] * e[i];
        Terms { squares: [minor(1, 2), minor(2, 0), minor(0, 1), T::wide(self.grows) * axial], axial }
    }
    #[inline(always)]
    fn constants<T: Number>(&self) -> [T; 4] {
        let zero = T::from(0.0);
        [zero, zero, zero, T::wide(self.at_base)]
    }
    fn transposed(&self, weights: [f64; 4], axial: f64) -> DVec3 {
        let e = DVec3::from_array(self.axis.map(DoubleDouble::value));
        e.cross(DVec3::new(weights[0], weights[1], weights[2]))
            + e * (weights[3] * self.grows.value() + axial)
    }
    #[inline(always)]
    fn sweep(&self) -> Option<&Sweep> {
        None
    }
    #[inline(always)]
    fn twisted(&self) -> bool {
        false
    }
    fn scaled(&self, by: f64) -> Frustum {
        let times = |x: DoubleDouble| x * DoubleDouble::from(by);
        Frustum {
            ends: self.ends.map(|p| p * by),
            radii: self.radii.map(|r| r * by),
            unit: self.unit * by,
            at_base: times(self.at_base),
            extent: self.extent.scaled(by),
            ..self.clone()
        }
    }
}

impl WorldBound for Frustum {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }

    /// The box of both rims, which is exact up to rounding.
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let e = DVec3::from_array(self.axis.map(DoubleDouble::value));
        let [mut min, mut max] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for (p, r) in self.ends.into_iter().zip(self.radii) {
            for a in 0..3 {
                // A circle of radius 1 reaches as far along a coordinate axis as the sine of the angle to it.
                let sine = e[(a + 1) % 3].hypot(e[(a + 2) % 3]) / e.length();
                let half = if e[a] == 0.0 { r } else { (r * sine * (1.0 + 8.0 * f64::EPSILON)).min(r) };
                let (below, above) = super::outward(p[a], half);
                min[a] = min[a].min(below);
                max[a] = max[a].max(above);
            }
        }
        Aabb::from_f64(min, max, origin)
    }

    /// Its box within the cell, empty where the cell lies beyond the planes of the rims or away from the axis.
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        match frustum_avoids(self.ends, self.radii, cell, origin) {
            true => Aabb::EMPTY,
            false => self.world_bound_from(origin).overlap(*cell),
        }
    }
}

impl<R: Real> Primitive<R> for Frustum {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        solve::closest(self, ray)
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        solve::hits(self, ray, |t| each(Hit { t, at: Uv::default() }))
    }
}

impl<R: Real> Shape<R> for Frustum {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        surface::of(self, surface::offset(self, ray, hit.t), |w| self.uv(w))
    }

    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let found = self.surface(ray, hit);
        let [.., z] = self.frame();
        let w = found.point - self.ends[0];
        let across = w - z * w.dot(z);
        let out = across.normalize_or_zero();
        let dpdu = z.cross(across) * TAU;
        let dpdv = self.rise() + out * (self.radii[1] - self.radii[0]);
        // The normal turns with the point around the axis, and not along a ruling.
        let dndu = z.cross(found.normal) * TAU;
        let tip = across == DVec3::ZERO;
        Partials { dpdu, dpdv, dndu: if tip { DVec3::ZERO } else { dndu }, dndv: DVec3::ZERO }
    }
}

//! [`RayDifferential`]: how a ray changes from pixel to pixel.

use crate::{Ray, Real, Transform, Vector, difference_of_products};
use glam::{DVec2, DVec3};

/// The derivatives of a ray's origin and direction by the two image coordinates, carried beside the ray, in `f64`.
///
/// In units of one sample: a pixel, unless [scaled](RayDifferential::scaled). The direction is differentiated as it
/// stands, unit or not, together with the `t` that counts its lengths. Where derivatives are not known there is none of
/// these: an `Option` of the caller, never zeros, which would claim a ray without width.
///
/// At a hit: [`RayDifferential::footprint`] gives the size of the sample on the surface; [`Footprint::parameters`] the
/// same in the surface's parameters, from which follows how the normal turns; then [`RayDifferential::reflected`] or
/// [`RayDifferential::refracted`] start the next ray. These are derivatives, exact to first order: for mirrors and
/// windows that are plane, finite differences of rays equal them only as far as the image itself is linear.
///
/// Source: Igehy, "Tracing ray differentials" (1999).
///
/// ```
/// use rt_geom::{Ray, RayDifferential, glam::DVec3};
/// // A camera at zero whose pixels are 0.01 wide at distance 1.
/// let ray = Ray::new(DVec3::ZERO, DVec3::Z);
/// let pixel = RayDifferential { origin: [DVec3::ZERO; 2], dir: [DVec3::X * 0.01, DVec3::Y * 0.01] };
/// // On a wall at distance 5, seen at 45 degrees.
/// let there = pixel.footprint(&ray, 5.0, DVec3::new(1.0, 0.0, -1.0)).unwrap();
/// assert_eq!(there.points, [DVec3::new(0.05, 0.0, 0.05), DVec3::new(0.0, 0.05, 0.0)]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayDifferential {
    /// The derivatives of the origin, by image x and by image y.
    pub origin: [DVec3; 2],
    /// The derivatives of the direction, by image x and by image y.
    pub dir: [DVec3; 2],
}

/// How a point on a surface moves, to first order, when the image point moves by one sample along x and along y: in the
/// plane that touches the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The derivatives of the point, by image x and by image y.
    pub points: [DVec3; 2],
}

impl RayDifferential {
    /// The differences of the rays of the next sample to the right and of the next one below to this one: derivatives,
    /// where the image is linear in between.
    pub fn between<R: Real>(ray: &Ray<R>, right: &Ray<R>, below: &Ray<R>) -> RayDifferential {
        let next = [right, below];
        RayDifferential {
            origin: next.map(|r| r.origin.widen() - ray.origin.widen()),
            dir: next.map(|r| r.dir.widen() - ray.dir.widen()),
        }
    }

    /// The differential of samples `by` times as far apart: `1 / sqrt(n)` for `n` samples a pixel.
    pub fn scaled(&self, by: f64) -> RayDifferential {
        RayDifferential { origin: self.origin.map(|v| v * by), dir: self.dir.map(|v| v * by) }
    }

    /// What the sample covers on a surface met at `t` with the normal `normal`, of any length and on either side;
    /// `None` when the ray grazes the surface, where it covers all of it.
    pub fn footprint(&self, ray: &Ray<f64>, t: f64, normal: DVec3) -> Option<Footprint> {
        let across = ray.dir.dot(normal);
        let points = [0, 1].map(|i| {
            let moved = self.origin[i] + self.dir[i] * t;
            moved - ray.dir * (moved.dot(normal) / across)
        });
        (points[0].is_finite() && points[1].is_finite()).then_some(Footprint { points })
    }

    /// The direction of the mirrored ray, as long as `dir`, and its differential. `normal` is unit, on either side, and
    /// `bend` how it changes by image x and image y: zero on a plane.
    pub fn reflected(
        &self,
        dir: DVec3,
        at: &Footprint,
        normal: DVec3,
        bend: [DVec3; 2],
    ) -> (DVec3, RayDifferential) {
        let along = dir.dot(normal);
        let turned = [0, 1].map(|i| {
            let d_along = self.dir[i].dot(normal) + dir.dot(bend[i]);
            self.dir[i] - (bend[i] * along + normal * d_along) * 2.0
        });
        (dir - normal * (2.0 * along), RayDifferential { origin: at.points, dir: turned })
    }

    /// The direction of the refracted ray, unit whatever the length of `dir`, and its differential; `None` where all
    /// light is reflected or the direction is zero. `normal` is unit, on either side, and `bend` how it changes by
    /// image x and image y. `index` is the index of refraction where the ray comes from over that where it goes.
    pub fn refracted(
        &self,
        dir: DVec3,
        at: &Footprint,
        normal: DVec3,
        bend: [DVec3; 2],
        index: f64,
    ) -> Option<(DVec3, RayDifferential)> {
        let length = dir.length();
        let d = dir / length;
        // The derivatives of the unit direction lose what lengthens it.
        let dd = self.dir.map(|v| (v - d * d.dot(v)) / length);
        // The normal on the side the ray comes from.
        let side = if d.dot(normal) > 0.0 { -1.0 } else { 1.0 };
        let (normal, bend) = (normal * side, bend.map(|v| v * side));
        let along = d.dot(normal);
        // 1 - sin^2 of the refracted angle, the sine by the cross product so that it is right near the normal.
        let inside = 1.0 - index * index * d.cross(normal).length_squared();
        if inside <= 0.0 || inside.is_nan() {
            return None;
        }
        let leaving = -inside.sqrt();
        let mu = index * along - leaving;
        let d_mu = index - index * index * along / leaving;
        let turned = [0, 1].map(|i| {
            let d_along = dd[i].dot(normal) + d.dot(bend[i]);
            dd[i] * index - (bend[i] * mu + normal * (d_mu * d_along))
        });
        Some((d * index - normal * mu, RayDifferential { origin: at.points, dir: turned }))
    }

    /// The differential of the ray carried over by `map`.
    pub fn transformed(&self, map: &Transform) -> RayDifferential {
        RayDifferential { origin: self.origin.map(|v| map.vector(v)), dir: self.dir.map(|v| map.vector(v)) }
    }
}

impl Footprint {
    /// The change of the surface's parameters `(u, v)` by image x and image y, where the surface goes by `dpdu` and
    /// `dpdv`: by least squares, so that tangents off the footprint's plane do not matter. `None` where the tangents do
    /// not span a plane.
    ///
    /// With the derivatives `dndu` and `dndv` of the unit normal, the normal changes by `dndu * du + dndv * dv`.
    ///
    /// ```
    /// use rt_geom::{Footprint, glam::{DVec2, DVec3}};
    /// let at = Footprint { points: [DVec3::X, DVec3::Y] };
    /// let [x, y] = at.parameters(DVec3::X * 2.0, DVec3::new(2.0, 1.0, 0.0)).unwrap();
    /// assert_eq!((x, y), (DVec2::new(0.5, 0.0), DVec2::new(-1.0, 1.0)));
    /// ```
    pub fn parameters(&self, dpdu: DVec3, dpdv: DVec3) -> Option<[DVec2; 2]> {
        let (e, f, g) = (dpdu.length_squared(), dpdu.dot(dpdv), dpdv.length_squared());
        let determinant = difference_of_products(e, g, f, f);
        let solved = self.points.map(|p| {
            let (a, b) = (p.dot(dpdu), p.dot(dpdv));
            DVec2::new(difference_of_products(g, a, f, b), difference_of_products(e, b, f, a)) / determinant
        });
        (solved[0].is_finite() && solved[1].is_finite()).then_some(solved)
    }
}

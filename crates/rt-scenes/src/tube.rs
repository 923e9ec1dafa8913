//! [`Tube`]: an open cone or cylinder between two circles. SCAFFOLD.

use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector, gamma};
use rt_shapes::{Partials, Shape, Surface, Uv};

/// Tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    ends: [DVec3; 2],
    radii: [f64; 2],
}

/// Why a tube is none.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TubeError {
    /// The middle of an end is not finite.
    End(DVec3),
    /// A radius is not finite, or negative, or both are zero.
    Radius(f64),
    /// Both ends are at one place.
    NoAxis,
}

impl fmt::Display for TubeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TubeError::End(end) => write!(f, "the end {end} of a cylinder or cone is not finite"),
            TubeError::Radius(r) => write!(f, "cylinders and cones have no radius {r}"),
            TubeError::NoAxis => write!(f, "the ends of a cylinder or cone are at one place"),
        }
    }
}

impl core::error::Error for TubeError {}

impl Tube {
    /// new
    pub fn new(ends: [DVec3; 2], radii: [f64; 2]) -> Result<Tube, TubeError> {
        if let Some(&end) = ends.iter().find(|end| !end.is_finite()) {
            return Err(TubeError::End(end));
        }
        if let Some(&radius) = radii.iter().find(|r| !(**r >= 0.0 && r.is_finite())) {
            return Err(TubeError::Radius(radius));
        }
        if radii == [0.0; 2] {
            return Err(TubeError::Radius(0.0));
        }
        if ends[0] == ends[1] {
            return Err(TubeError::NoAxis);
        }
        Ok(Tube { ends, radii })
    }
    /// The middles of the two circles.
    pub fn ends(&self) -> [DVec3; 2] {
        self.ends
    }
    /// The radii of the two circles.
    pub fn radii(&self) -> [f64; 2] {
        self.radii
    }
    fn roots(&self, o: DVec3, d: DVec3) -> Vec<f64> {
        let axis = self.ends[1] - self.ends[0];
        let h = axis.length();
        let a = axis / h;
        let k = (self.radii[1] - self.radii[0]) / h;
        let p = o - self.ends[0];
        let (pz, dz) = (p.dot(a), d.dot(a));
        let (pp, dp) = (p - a * pz, d - a * dz);
        let r = self.radii[0] + k * pz;
        let (qa, qb, qc) = (dp.dot(dp) - k * k * dz * dz, pp.dot(dp) - r * k * dz, pp.dot(pp) - r * r);
        let disc = qb * qb - qa * qc;
        if disc < 0.0 {
            return vec![];
        }
        let q = -(qb + disc.sqrt().copysign(qb));
        let mut roots = vec![q / qa, qc / q];
        roots.retain(|t| t.is_finite() && (0.0..=h).contains(&(pz + t * dz)));
        roots.sort_by(f64::total_cmp);
        roots
    }
}

impl WorldBound for Tube {
    fn world_bound(&self) -> Aabb {
        let a = (self.ends[1] - self.ends[0]).normalize();
        let e = (DVec3::ONE - a * a).max(DVec3::ZERO).map(f64::sqrt) * 1.0000001;
        let [p, q] = self.ends;
        let [r, s] = self.radii;
        Aabb::from_f64((p - e * r).min(q - e * s), (p + e * r).max(q + e * s), DVec3::ZERO)
    }
}

impl<R: Real> Primitive<R> for Tube {
    type At = Uv;
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.roots(ray.origin.widen(), ray.dir.widen())
            .into_iter()
            .find_map(|t| ray.admit(t))
            .map(|t| Hit { t, at: Uv::default() })
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        for t in self.roots(ray.origin.widen(), ray.dir.widen()) {
            if let Some(t) = ray.admit(t) {
                each(Hit { t, at: Uv::default() })?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl<R: Real> Shape<R> for Tube {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let (o, d) = (ray.origin.widen(), ray.dir.widen());
        let t: f64 = hit.t.into();
        let t = self
            .roots(o, d)
            .into_iter()
            .min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs()))
            .unwrap_or(t);
        let point = o + d * t;
        let axis = self.ends[1] - self.ends[0];
        let h = axis.length();
        let a = axis / h;
        let k = (self.radii[1] - self.radii[0]) / h;
        let p = point - self.ends[0];
        let out = (p - a * p.dot(a)).normalize_or_zero();
        let normal = (out - a * k).normalize();
        let error = DVec3::splat(1e-9);let _=gamma(1);
        Surface { point, error, normal, shading: normal, uv: DVec2::ZERO }
    }
    fn partials(&self, _ray: &Ray<R>, _hit: &Hit<Uv, R>) -> Partials {
        Partials::default()
    }
}

//! [`Beam`]: a ray with a polygonal width.

use crate::direction::{length, scaled};
use crate::invert::ldexp;
use crate::{Ray, Transform, unit};
use core::fmt;
use glam::DVec3;

/// The rays from an apex through a convex polygon, or through it in one direction, between two depths: a closed convex
/// set between planes.
///
/// It is kept as its corner rays, which share a parameter: the depth, measured across the polygon's plane from the
/// apex, or along the direction from its first corner. So the cross-sections at equal depths are parallel polygons, and
/// the beam is all that lies between its corners at equal depths.
///
/// Source: Heckbert and Hanrahan, "Beam tracing polygonal objects" (1984).
///
/// ```
/// use rt_geom::{Beam, glam::DVec3};
/// let window = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 2.0]].map(DVec3::from_array);
/// let seen = Beam::from_apex(DVec3::ZERO, &window).unwrap();
/// assert!(seen.contains(DVec3::new(4.0, 4.0, 9.0)) && !seen.contains(DVec3::new(5.0, 4.0, 9.0)));
/// assert!(!seen.between(0.0, 2.0).contains(DVec3::new(0.0, 0.0, 9.0)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// Counter-clockwise seen from where the beam goes to; `t` is the depth.
    corners: Vec<Ray<f64>>,
    /// Outward normals of the planes through neighbouring corners, the last and the first too.
    normals: Vec<DVec3>,
    /// `depth . (p - origin)` is the depth of a point; 1 for the direction of each corner.
    depth: DVec3,
}

/// Why there is no such [`Beam`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum BeamError {
    /// A coordinate is not finite, or the beam leaves the range of `f64`.
    NotFinite,
    /// The polygon has no area as the beam sees it, or neighbouring corners coincide, or there are fewer than three, or
    /// the apex is in its plane or between its corners.
    Flat,
    /// The polygon is not convex, or its corners are not in order.
    NotConvex,
}

impl fmt::Display for BeamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            BeamError::NotFinite => "the beam has a coordinate that is not finite",
            BeamError::Flat => "the beam has no area: its polygon is seen from the side or is degenerate",
            BeamError::NotConvex => "the polygon of the beam is not convex",
        })
    }
}

impl core::error::Error for BeamError {}

impl Beam {
    /// The rays from `apex` through a convex polygon, whose corners are in either order, at any depth ahead of the
    /// apex. A polygon that is not plane is met by the same corner rays.
    ///
    /// # Errors
    ///
    /// See [`BeamError`].
    pub fn from_apex(apex: DVec3, polygon: &[DVec3]) -> Result<Beam, BeamError> {
        let arms: Vec<DVec3> = polygon.iter().map(|&q| q - apex).collect();
        let plane = across(&arms)?;
        // Each of length about 1, exactly in its direction, so that no product leaves the range.
        let arms = arms.iter().map(|&arm| scaled(arm).map(|(arm, _)| arm));
        let arms: Vec<DVec3> = arms.collect::<Option<_>>().ok_or(BeamError::Flat)?;
        // On the side where the polygon is, so that depths grow towards it.
        let depth = if arms[0].dot(plane) < 0.0 { -plane } else { plane };
        let corners: Vec<_> = arms.iter().map(|&arm| Ray::new(apex, arm / arm.dot(depth))).collect();
        if !arms.iter().all(|arm| arm.dot(depth) > 0.0) {
            return Err(BeamError::Flat);
        }
        Beam::checked(corners, depth)
    }

    /// What comes from a convex polygon, whose corners are in either order, in the direction `dir`: at any depth from
    /// the plane across `dir` through the first corner.
    ///
    /// # Errors
    ///
    /// See [`BeamError`].
    pub fn parallel(polygon: &[DVec3], dir: DVec3) -> Result<Beam, BeamError> {
        let depth = unit(dir).ok_or(BeamError::Flat)?;
        let first = *polygon.first().ok_or(BeamError::Flat)?;
        let corner = |&q: &DVec3| Ray::new(q - depth * (q - first).dot(depth), depth);
        Beam::checked(polygon.iter().map(corner).collect(), depth)
    }

    fn checked(mut corners: Vec<Ray<f64>>, depth: DVec3) -> Result<Beam, BeamError> {
        if !corners.iter().all(|c| c.origin.is_finite() && c.dir.is_finite()) {
            return Err(BeamError::NotFinite);
        }
        if corners.len() < 3 {
            return Err(BeamError::Flat);
        }
        // At depth 1, relative to the first origin; where all go one way at depth 0, for beside a long direction a small
        // polygon would be lost.
        let parallel = corners.iter().all(|c| c.dir == corners[0].dir);
        let sections = |corners: &[Ray<f64>]| -> Vec<DVec3> {
            let ahead = |c: &Ray<f64>| if parallel { DVec3::ZERO } else { c.dir };
            corners.iter().map(|c| c.origin - corners[0].origin + ahead(c)).collect()
        };
        let area = across(&sections(&corners))?;
        if area.dot(depth) < 0.0 {
            corners.reverse();
        }
        let sections = sections(&corners);
        let n = corners.len();
        // Corners that are meant to lie in one plane may be off by the rounding of the cross product and of the
        // sections, and where the beam is parallel of the origins, which were moved into one plane.
        let moved = |c: &Ray<f64>| if parallel { length(c.origin) } else { 0.0 };
        let size = sections.iter().zip(&corners).fold(0.0f64, |m, (&s, c)| m.max(length(s)).max(moved(c)));
        let mut normals = Vec::with_capacity(n);
        for i in 0..n {
            let (a, b) = (sections[i], sections[(i + 1) % n]);
            // In the parallel beam a and b differ by the edge, in the other one the edge spans the same plane with
            // either arm.
            let (edge, arm) = (scaled(b - a), scaled(corners[i].dir));
            let (edge, arm) = edge.zip(arm).ok_or(BeamError::Flat)?;
            let normal = unit(edge.0.cross(arm.0)).ok_or(BeamError::Flat)?;
            if sections.iter().any(|&s| normal.dot(s - a) > size * (32.0 * f64::EPSILON)) {
                return Err(BeamError::NotConvex);
            }
            normals.push(normal);
        }
        Ok(Beam { corners, normals, depth })
    }

    /// The same beam between two depths, `near` and `far` included. A `near` below 0 is 0; NaN leaves an end where it
    /// is.
    pub fn between(mut self, near: f64, far: f64) -> Beam {
        for corner in &mut self.corners {
            corner.t_min = if near.is_nan() { corner.t_min } else { near.max(0.0) };
            corner.t_max = if far.is_nan() { corner.t_max } else { far };
        }
        self
    }

    /// The corner rays: `t` is the depth, and its interval the depths of the beam. Counter-clockwise seen against the
    /// beam.
    pub fn corners(&self) -> &[Ray<f64>] {
        &self.corners
    }

    /// The planes at the sides: outward normals, and a point on each. The ends are not among them.
    pub fn sides(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        self.normals.iter().zip(&self.corners).map(|(&n, c)| (n, c.origin))
    }

    /// The covector of the depth: a point has the depth `depth . (p - origin)`, for the origin of any corner. Unit
    /// until the beam is carried by a map.
    pub fn depth(&self) -> DVec3 {
        self.depth
    }

    /// The least and the greatest depth.
    pub fn range(&self) -> [f64; 2] {
        [self.corners[0].t_min, self.corners[0].t_max]
    }

    /// Whether a point lies in the beam, up to rounding.
    pub fn contains(&self, p: DVec3) -> bool {
        self.corners[0].contains(self.depth.dot(p - self.corners[0].origin))
            && self.sides().all(|(normal, through)| normal.dot(p - through) <= 0.0)
    }

    /// The beam carried over; depths keep their meaning. By a reflection in a plane: the beam of the mirror.
    ///
    /// # Errors
    ///
    /// When it leaves the range of `f64` or becomes so thin that rounding flattens it.
    pub fn transformed(&self, map: &Transform) -> Result<Beam, BeamError> {
        let corners = self.corners.iter().map(|c| map.ray(c)).collect();
        Beam::checked(corners, map.normal(self.depth))
    }
}

/// The direction across a polygon, by the areas of its projections: of the polygon scaled by a power of two, so that no
/// square leaves the range, however small or large it is.
fn across(points: &[DVec3]) -> Result<DVec3, BeamError> {
    if !points.iter().all(|p| p.is_finite()) {
        return Err(BeamError::NotFinite);
    }
    let fan = points.get(1..).unwrap_or(&[]);
    let first = points.first().copied().unwrap_or(DVec3::ZERO);
    let edges: Vec<DVec3> = fan.iter().map(|&p| p - first).collect();
    let widest = edges.iter().fold(DVec3::ZERO, |m, e| m.max(e.abs()));
    let Some((_, exponent)) = scaled(widest) else {
        return Err(if widest == DVec3::ZERO { BeamError::Flat } else { BeamError::NotFinite });
    };
    let edges: Vec<DVec3> = edges.iter().map(|e| e.to_array().map(|x| ldexp(x, -exponent)).into()).collect();
    let area: DVec3 = edges.windows(2).map(|w| w[0].cross(w[1])).sum();
    unit(area).ok_or(if area.is_finite() { BeamError::Flat } else { BeamError::NotFinite })
}

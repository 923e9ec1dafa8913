//! [`Polygon`]: planar polygons.

use crate::mesh::{ends, hit, pick};
use crate::triangle::power_of_two;
use crate::{Partials, Shape, Surface, Triangle, Uv};
use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Axis, Ray, Real, Transform};

/// A planar polygon, convex or concave, in world space, kept in `f64`; answers rays of both precisions.
///
/// It is the union of the closed triangles that ear clipping cuts it into, once, when it is made: its decisions are theirs,
/// exact, with no leak along a cut. Corners that are not quite planar bend it along the cuts. The part of a hit's [`Uv`] is
/// the triangle. The normal follows the right-hand rule around the corners (Newell's).
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::Polygon;
/// // An arrow head: concave at the last corner.
/// let corners = [(0.0, 0.0), (2.0, -1.0), (0.0, 3.0), (-2.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
/// let arrow = Polygon::new(&corners)?;
/// let at = |x, y| arrow.intersect_p(&Ray::new(Vec3A::new(x, y, 0.0), Vec3A::Z));
/// assert!(at(0.0, 1.0) && at(0.0, 0.0) && !at(0.0, -0.5));
/// # Ok::<(), rt_shapes::PolygonError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    corners: Box<[DVec3]>,
    triangles: Box<[Triangle]>,
    normal: DVec3,
    /// For each triangle the area up to its end, in squares of `unit`: so that it stays in range.
    ends: Box<[f64]>,
    unit: f64,
}

/// Why corners are not a polygon.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PolygonError {
    /// Fewer than three corners.
    TooFew(usize),
    /// A corner is not finite.
    NotFinite(DVec3),
    /// The corners enclose no area, or cross so that they cannot be cut into triangles.
    NoArea,
}

impl fmt::Display for PolygonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PolygonError::TooFew(n) => write!(f, "a polygon needs three corners, not {n}"),
            PolygonError::NotFinite(p) => write!(f, "polygon corner {p} is not finite"),
            PolygonError::NoArea => write!(f, "the polygon has no area"),
        }
    }
}

impl core::error::Error for PolygonError {}

impl Polygon {
    /// The polygon with these corners, in order around it.
    ///
    /// # Errors
    ///
    /// See [`PolygonError`].
    pub fn new(corners: &[DVec3]) -> Result<Polygon, PolygonError> {
        let (cuts, normal) = cut(corners)?;
        let triangles: Box<[Triangle]> =
            cuts.into_iter().map(|cut| Triangle { corners: cut.map(|i| corners[i]) }).collect();
        let size = corners.iter().fold(0.0f64, |m, &p| m.max((p - corners[0]).abs().max_element()));
        let unit = power_of_two(size);
        let areas = triangles.iter().map(|part| Triangle { corners: part.corners.map(|p| p / unit) }.area());
        let ends: Box<[f64]> = ends(areas).collect();
        if !ends.last().is_some_and(|&area| area > 0.0 && area.is_finite()) {
            return Err(PolygonError::NoArea);
        }
        Ok(Polygon { corners: corners.into(), triangles, normal, ends, unit })
    }

    /// The area of its triangles: zero or infinite where it leaves the range of `f64`.
    ///
    /// Error: 0.51 units in the last place of each triangle's, and one rounding.
    pub fn area(&self) -> f64 {
        self.ends[self.ends.len() - 1] * self.unit * self.unit
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`. Numbers
    /// outside are moved to the nearest inside, NaN to 0. The first picks the triangle, as that of a
    /// [`MeshSampler`](crate::MeshSampler). Cost: `O(log n)`.
    ///
    /// ```
    /// use rt_geom::glam::{DVec2, DVec3};
    /// use rt_shapes::Polygon;
    /// let corners = [(0.0, 0.0), (2.0, -1.0), (0.0, 3.0), (-2.0, -1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
    /// let arrow = Polygon::new(&corners)?;
    /// let spot = arrow.sample(DVec2::new(0.25, 0.5));
    /// assert_eq!((arrow.area(), spot.point.z, spot.normal), (6.0, 1.0, DVec3::Z));
    /// # Ok::<(), rt_shapes::PolygonError>(())
    /// ```
    pub fn sample(&self, xi: DVec2) -> Surface {
        let (part, weights) = pick(&self.ends, xi);
        self.record(part, weights)
    }

    fn record(&self, part: u32, weights: [f64; 3]) -> Surface {
        let surface = self.triangles[part as usize].surface(weights);
        // The part's own normal, on the polygon's side: corners may be off the plane.
        let side = if surface.normal.dot(self.normal) < 0.0 { -surface.normal } else { surface.normal };
        Surface { normal: side, shading: side, ..surface }
    }

    /// The corners, in the order given.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The triangles `corners` is cut into, by corner numbers, turning the way the corners do: for meshes of polygons.
    ///
    /// # Errors
    ///
    /// See [`PolygonError`].
    pub fn triangulate(corners: &[DVec3]) -> Result<Vec<[usize; 3]>, PolygonError> {
        cut(corners).map(|(cuts, _)| cuts)
    }

    /// The triangles it is made of.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// The unit normal.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }
}

/// Ear clipping, seen along the largest component of the normal; and the normal.
fn cut(corners: &[DVec3]) -> Result<(Vec<[usize; 3]>, DVec3), PolygonError> {
    if corners.len() < 3 {
        return Err(PolygonError::TooFew(corners.len()));
    }
    if let Some(&bad) = corners.iter().find(|p| !p.is_finite()) {
        return Err(PolygonError::NotFinite(bad));
    }
    // Newell's normal, about the first corner and in units of the polygon, so that neither distance nor size matters.
    let first = corners[0];
    let size = corners.iter().fold(0.0f64, |m, &p| m.max((p - first).abs().max_element()));
    let at = |i: usize| (corners[i % corners.len()] - first) / size;
    let sum = (1..corners.len() - 1).fold(DVec3::ZERO, |sum, i| sum + at(i).cross(at(i + 1)));
    let normal = sum.try_normalize().ok_or(PolygonError::NoArea)?;
    let drop = Axis::longest_f64(normal.abs());
    let (x, y) = (drop.next().index(), drop.next().next().index());
    let flat: Vec<[f64; 2]> = (0..corners.len()).map(|i| [at(i)[x], at(i)[y]]).collect();
    let mut cuts: Vec<usize> = Vec::new();
    if corners.len() == 3 {
        cuts.extend([0, 1, 2]);
    } else {
        earcut::Earcut::new().earcut(flat.iter().copied(), &[], &mut cuts);
    }
    let turn = |cut: &[usize]| {
        let [a, b, c] = [flat[cut[0]], flat[cut[1]], flat[cut[2]]];
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let cuts: Vec<[usize; 3]> = cuts
        .chunks_exact(3)
        .map(|cut| {
            let along = turn(cut) * normal[drop.index()] >= 0.0;
            if along { [cut[0], cut[1], cut[2]] } else { [cut[0], cut[2], cut[1]] }
        })
        .collect();
    if cuts.is_empty() {
        return Err(PolygonError::NoArea);
    }
    Ok((cuts, normal))
}

impl WorldBound for Polygon {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let corners = || self.triangles.iter().flat_map(|t| t.corners);
        let min = corners().fold(DVec3::INFINITY, DVec3::min);
        let max = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        Aabb::from_f64(min, max, origin)
    }
    fn bound_under(&self, map: &Transform) -> DAabb {
        DAabb::around_carried(self.triangles.iter().flat_map(|t| t.corners), map)
    }
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        let parts = self.triangles.iter().map(|t| t.clipped_bound(cell, origin));
        parts.fold(Aabb::EMPTY, Aabb::union)
    }
    fn outline(&self, origin: DVec3) -> Option<[DVec3; 3]> {
        let [only] = *self.triangles else { return None };
        Some(only.corners.map(|corner| corner - origin))
    }
}

impl<R: Real> Primitive<R> for Polygon {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        let mut closest: Option<Hit<Uv, R>> = None;
        for (part, triangle) in (0..).zip(&self.triangles) {
            if let Some(meeting) = triangle.intersect(ray)
                && closest.is_none_or(|best| meeting.t < best.t)
            {
                closest = Some(hit(part, meeting));
            }
        }
        closest
    }

    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.triangles.iter().any(|triangle| triangle.intersect(ray).is_some())
    }

    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        for (part, triangle) in (0..).zip(&self.triangles) {
            if let Some(meeting) = triangle.cross(ray) {
                each(hit(part, meeting))?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl<R: Real> Shape<R> for Polygon {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        self.record(hit.at.prim, self.triangles[hit.at.prim as usize].weights(ray, hit))
    }

    fn partials(&self, _ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let [a, b, c] = self.triangles[hit.at.prim as usize].corners;
        Partials { dpdu: b - a, dpdv: c - a, ..Partials::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::Vec3A;

    fn star(points: usize, z: f64) -> Vec<DVec3> {
        (0..2 * points)
            .map(|i| {
                let (s, c) = (std::f64::consts::PI * i as f64 / points as f64).sin_cos();
                let r = if i % 2 == 0 { 2.0 } else { 1.0 };
                DVec3::new(r * c, r * s, z)
            })
            .collect()
    }

    #[test]
    fn a_concave_polygon_is_hit_inside_its_outline() {
        let corners = star(36, 5.0);
        let polygon = Polygon::new(&corners).unwrap();
        assert_eq!(polygon.triangles().len(), 70);
        assert!((polygon.normal() - DVec3::Z).length() < 1e-12);
        let crossings = |x: f64, y: f64| {
            let mut odd = false;
            for i in 0..corners.len() {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                if (a.y > y) != (b.y > y) && x < (b.x - a.x) * (y - a.y) / (b.y - a.y) + a.x {
                    odd = !odd;
                }
            }
            odd
        };
        let mut inside = 0;
        for i in -50..50 {
            for j in -50..50 {
                let (x, y) = (i as f32 * 0.0437 + 0.001, j as f32 * 0.0437 + 0.002);
                let ray = Ray::new(Vec3A::new(x, y, 0.0), Vec3A::Z);
                let hit = polygon.intersect(&ray);
                assert_eq!(hit.is_some(), crossings(x as f64, y as f64), "{x} {y}");
                inside += hit.is_some() as usize;
            }
        }
        assert!(inside > 1000);
        // Each corner belongs to the polygon.
        assert!(corners.iter().all(|&c| polygon.intersect_p(&Ray::new(c - DVec3::Z, DVec3::Z))));
    }

    /// There the error of a point along the normal is zero, and the next number after zero is lost in products.
    #[test]
    fn rays_that_leave_a_plane_through_zero_do_not_meet_it() {
        let square = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.6), (0.0, 0.6)];
        for tiny in [1.0, 1e-3, 1e-12] {
            let polygon = Polygon::new(&square.map(|(x, y)| DVec3::new(x, y, 0.0) * tiny)).unwrap();
            for (x, y) in [(0.1, 0.2), (0.3, 0.3), (0.55, 0.01)] {
                for z in [1.0, -1.0] {
                    let ray = Ray::new(DVec3::new(x, y, z) * tiny, DVec3::new(0.01, 0.02, -z));
                    let hit = polygon.intersect(&ray).unwrap();
                    let surface = Shape::<f64>::surface(&polygon, &ray, &hit);
                    for dir in [DVec3::new(0.3, 0.1, 1.0), DVec3::new(0.2, 0.9, -0.1)] {
                        assert!(!polygon.intersect_p(&surface.spawn(dir)), "{tiny} {x} {y} {z} {dir}");
                        assert!(
                            !polygon.intersect_p(&surface.spawn(dir.as_vec3a())),
                            "{tiny} {x} {y} {z} {dir}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_no_polygon_says_why() {
        assert_eq!(Polygon::new(&[DVec3::ZERO, DVec3::X]), Err(PolygonError::TooFew(2)));
        assert_eq!(
            Polygon::new(&[DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::X * 3.0]),
            Err(PolygonError::NoArea)
        );
        assert!(matches!(
            Polygon::new(&[DVec3::ZERO, DVec3::X, DVec3::NAN]),
            Err(PolygonError::NotFinite(_))
        ));
    }
}

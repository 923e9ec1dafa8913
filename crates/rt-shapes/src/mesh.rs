//! [`TriangleMesh`]: indexed triangles.

mod area;
mod orientation;

pub use area::MeshSampler;
pub(crate) use area::{ends, pick};
pub use orientation::{Component, Facing, Orientation};

use crate::{Meeting, Partials, Surface, Surfaced, Triangle, Uv};
use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Bounded, Geometry, Hit};
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::{DVec2, DVec3, Vec3A};
use rt_geom::{Ray, Real, Transform, gamma};

/// Triangles over shared vertices, in world space, of `f32` or `f64` coordinates.
///
/// A mesh of `f32` answers rays of both precisions, one of `f64` answers `f64` rays. Its triangles are never objects: 12 bytes
/// each beside the vertices. Normals and texture coordinates are stored where there are any.
///
/// A triangle with a vertex that is not finite is left out by every structure. One without area stands in the tree and is
/// never hit; [`TriangleMesh::degenerate`] counts them.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh<V: Real = f32> {
    vertices: Vec<[V; 3]>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
}

/// Why arrays are not a mesh.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshError {
    /// A triangle names a vertex that does not exist.
    IndexOutOfRange {
        /// The triangle's number.
        triangle: usize,
        /// The vertex it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// More triangles than numbers.
    TooManyTriangles {
        /// How many there are.
        len: usize,
    },
    /// Attributes are not one per vertex.
    AttributeCount {
        /// Which attribute.
        name: &'static str,
        /// How many there are.
        len: usize,
        /// How many vertices there are.
        vertices: usize,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MeshError::IndexOutOfRange { triangle, index, vertices } => {
                write!(f, "triangle {triangle} names vertex {index}, but there are {vertices}")
            }
            MeshError::TooManyTriangles { len } => write!(f, "{len} triangles are more than can be numbered"),
            MeshError::AttributeCount { name, len, vertices } => {
                write!(f, "{len} {name} for {vertices} vertices")
            }
        }
    }
}

impl core::error::Error for MeshError {}

impl<V: Real> TriangleMesh<V> {
    /// A mesh from vertices and the vertex numbers of each triangle's corners.
    ///
    /// # Errors
    ///
    /// When a triangle names a vertex that is not there, or there are `2^32 - 2` triangles or more.
    pub fn new(vertices: Vec<[V; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if triangles.len() >= u32::MAX as usize - 1 {
            return Err(MeshError::TooManyTriangles { len: triangles.len() });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= vertices.len()) {
                return Err(MeshError::IndexOutOfRange { triangle, index, vertices: vertices.len() });
            }
        }
        Ok(TriangleMesh { vertices, triangles, normals: Vec::new(), uvs: Vec::new() })
    }

    /// The same mesh with a normal per vertex, of any length, to shade with.
    ///
    /// # Errors
    ///
    /// When there is not one for each vertex.
    pub fn with_normals(self, normals: Vec<[f32; 3]>) -> Result<Self, MeshError> {
        self.per_vertex("normals", normals.len())?;
        Ok(TriangleMesh { normals, ..self })
    }

    /// The same mesh with texture coordinates per vertex.
    ///
    /// # Errors
    ///
    /// When there are not two for each vertex.
    pub fn with_uvs(self, uvs: Vec<[f32; 2]>) -> Result<Self, MeshError> {
        self.per_vertex("texture coordinates", uvs.len())?;
        Ok(TriangleMesh { uvs, ..self })
    }

    fn per_vertex(&self, name: &'static str, len: usize) -> Result<(), MeshError> {
        let vertices = self.vertices.len();
        if len == vertices { Ok(()) } else { Err(MeshError::AttributeCount { name, len, vertices }) }
    }

    /// The vertices.
    pub fn vertices(&self) -> &[[V; 3]] {
        &self.vertices
    }

    /// The vertices, to be moved; the structure over the mesh must then be refitted.
    pub fn vertices_mut(&mut self) -> &mut [[V; 3]] {
        &mut self.vertices
    }

    /// The vertex numbers of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The normals to shade with, one per vertex; empty where there are none.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// Triangle `prim` by its corners.
    ///
    /// # Panics
    ///
    /// When there is no such triangle.
    #[inline]
    pub fn triangle(&self, prim: u32) -> Triangle {
        Triangle { corners: self.triangles[prim as usize].map(|i| widen(self.vertices[i as usize])) }
    }

    #[inline(always)]
    fn get(&self, prim: u32) -> Option<Triangle> {
        let corners = self.triangles.get(prim as usize)?;
        Some(Triangle { corners: corners.map(|i| widen(self.vertices[i as usize])) })
    }

    /// The interpolated normal, if there is one with a direction.
    fn shading(&self, prim: u32, weights: [f64; 3]) -> Option<DVec3> {
        let [a, b, c] = self.normals_of(prim)?;
        (a * weights[0] + b * weights[1] + c * weights[2]).try_normalize()
    }

    fn normals_of(&self, prim: u32) -> Option<[DVec3; 3]> {
        let of = |i: u32| widen(self.normals[i as usize]);
        (!self.normals.is_empty()).then(|| self.triangles[prim as usize].map(of))
    }

    fn uvs_of(&self, prim: u32) -> Option<[DVec2; 3]> {
        let of = |i: u32| DVec2::from(self.uvs[i as usize].map(f64::from));
        (!self.uvs.is_empty()).then(|| self.triangles[prim as usize].map(of))
    }

    /// The surface of a triangle at the point with these weights of its corners.
    fn surface_at(&self, prim: u32, weights: [f64; 3]) -> Surface {
        let [w, u, v] = weights;
        let mut surface = self.triangle(prim).surface(weights);
        surface.uv = match self.uvs_of(prim) {
            Some([a, b, c]) => a * w + b * u + c * v,
            None => DVec2::new(u, v),
        };
        if let Some(shading) = self.shading(prim, weights) {
            // The vertex normals decide which side is outside.
            if shading.dot(surface.normal) < 0.0 {
                surface.normal = -surface.normal;
            }
            surface.shading = shading;
        }
        surface
    }

    /// The weights of the corners at a hit, in full precision.
    fn weights<R: Real>(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> [f64; 3] {
        self.triangle(hit.at.prim).weights(ray, hit)
    }
}

#[inline(always)]
fn widen<V: Real>([x, y, z]: [V; 3]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}

impl<V: Real> Bounded for TriangleMesh<V> {
    fn prim_count(&self) -> usize {
        self.triangles.len()
    }

    #[inline]
    fn bound(&self, prim: u32) -> Aabb {
        self.bound_from(prim, DVec3::ZERO)
    }

    #[inline]
    fn bound_from(&self, prim: u32, origin: DVec3) -> Aabb {
        let [a, b, c] = self.get(prim).map_or([DVec3::NAN; 3], |triangle| triangle.corners);
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return Aabb::new(Vec3A::NAN, Vec3A::NAN);
        }
        Aabb::from_f64(a.min(b).min(c), a.max(b).max(c), origin)
    }

    fn clipped_bound(&self, prim: u32, cell: &Aabb, origin: DVec3) -> Aabb {
        self.get(prim).map_or(Aabb::EMPTY, |triangle| triangle.clipped_bound(cell, origin))
    }

    fn bound_under(&self, prim: u32, map: &Transform) -> DAabb {
        DAabb::around_carried(self.get(prim).map_or([DVec3::NAN; 3], |triangle| triangle.corners), map)
    }

    fn outline(&self, prim: u32, origin: DVec3) -> Option<[DVec3; 3]> {
        self.get(prim).map(|triangle| triangle.corners.map(|corner| corner - origin))
    }
}

impl<R: Real, V: Real + Into<R>> Geometry<R> for TriangleMesh<V> {
    type At = Uv;

    #[inline(always)]
    fn intersect(&self, prim: u32, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.get(prim)?.intersect(ray).map(|meeting| hit(prim, meeting))
    }

    fn all_hits(
        &self,
        prim: u32,
        ray: &Ray<R>,
        each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        match self.get(prim).and_then(|triangle| triangle.cross(ray)) {
            Some(meeting) => each(hit(prim, meeting)),
            None => ControlFlow::Continue(()),
        }
    }
}

#[inline(always)]
pub(crate) fn hit<R: Real>(prim: u32, Meeting { t, u, v }: Meeting<R>) -> Hit<Uv, R> {
    Hit { t, at: Uv { prim, u: u as f32, v: v as f32 } }
}

impl<R: Real, V: Real + Into<R>> Surfaced<R> for TriangleMesh<V> {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        self.surface_at(hit.at.prim, self.weights(ray, hit))
    }

    /// Along the mesh's own texture coordinates where it has such and they are not degenerate on this triangle, else along two
    /// of its edges.
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let prim = hit.at.prim;
        let [a, b, c] = self.triangle(prim).corners;
        let along = Along::of(self.uvs_of(prim));
        let [dpdu, dpdv] = along.differences(a, b, c);
        let mut partials = Partials { dpdu, dpdv, ..Partials::default() };
        if let Some([na, nb, nc]) = self.normals_of(prim) {
            let [w0, w1, w2] = self.weights(ray, hit);
            let long = na * w0 + nb * w1 + nc * w2;
            if let Some(unit) = long.try_normalize() {
                // The derivative of what is normalised, without its part along the normal.
                let turn = |dn: DVec3| (dn - unit * unit.dot(dn)) / long.length();
                [partials.dndu, partials.dndv] = along.differences(na, nb, nc).map(turn);
            }
        }
        partials
    }
}

/// Weights by which differences along two edges of a triangle become differences along u and v.
struct Along([DVec2; 2]);

impl Along {
    /// Of the texture coordinates of the corners. Source: Pharr, Jakob, Humphreys, *Physically Based Rendering*, 4th ed.
    /// (2023), section 6.5.2.
    fn of(uvs: Option<[DVec2; 3]>) -> Along {
        let edges = || Along([DVec2::X, DVec2::Y]);
        let Some([a, b, c]) = uvs else { return edges() };
        let (b, c) = (b - a, c - a);
        let area = b.perp_dot(c);
        let [du, dv] = [DVec2::new(c.y, -b.y) / area, DVec2::new(-c.x, b.x) / area];
        if du.is_finite() && dv.is_finite() { Along([du, dv]) } else { edges() }
    }

    fn differences(&self, a: DVec3, b: DVec3, c: DVec3) -> [DVec3; 2] {
        self.0.map(|along| (b - a) * along.x + (c - a) * along.y)
    }
}

impl Triangle {
    /// The surface at the point with these weights of the three corners, which add to 1.
    ///
    /// Error of the point: 7 roundings of each term (Pharr et al. 2023, section 6.8.4).
    pub fn surface(&self, [w0, w1, w2]: [f64; 3]) -> Surface {
        let [a, b, c] = self.corners;
        let point = a * w0 + b * w1 + c * w2;
        let error = (a.abs() * w0.abs() + b.abs() * w1.abs() + c.abs() * w2.abs()) * gamma(7);
        // Edges of size 1, so that products neither vanish nor overflow.
        let size = |v: DVec3| v / v.abs().max_element();
        let normal = size(b - a).cross(size(c - a));
        // Scaled first where the square of a component would leave the range.
        let normal = (normal / normal.abs().max_element()).normalize_or_zero();
        Surface { point, error, normal, shading: normal, uv: DVec2::new(w1, w2) }
    }

    /// The weights of the corners where a ray hit: of the exact distance, rounded once, then of the point there. The volumes that
    /// decide a hit are off by the square of the distance; this is off by some roundings of the distance.
    pub(crate) fn weights<R: Real>(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> [f64; 3] {
        let line = Ray { t_min: f64::NEG_INFINITY, t_max: f64::INFINITY, ..ray.widen() };
        let told = |u: f64, v: f64| [1.0 - u - v, u, v];
        match self.intersect(&line) {
            Some(meeting) => self.weights_at(line.at(meeting.t)).unwrap_or(told(meeting.u, meeting.v)),
            None => told(hit.at.u as f64, hit.at.v as f64),
        }
    }

    /// The weights of the point nearest `p`, or of one of the border; `None` where products leave the range of `f64`.
    fn weights_at(&self, p: DVec3) -> Option<[f64; 3]> {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(c - a);
        let square = normal.length_squared();
        let share = |v: DVec3| (v.dot(normal) / square).clamp(0.0, 1.0);
        let (u, v) = (share((p - a).cross(c - a)), share((b - a).cross(p - a)));
        let sum = (u + v).max(1.0);
        (square.is_normal() && u.is_finite() && v.is_finite())
            .then(|| [(1.0 - u - v).max(0.0), u / sum, v / sum])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_point_stays_at_the_hit_from_far_away() {
        let triangle =
            Triangle { corners: [DVec3::ZERO, DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.2, 1.0, 0.3)] };
        for distance in [1.0, 1e3, 1e5, 1e7] {
            let target = DVec3::new(0.375, 0.34375, 0.08);
            let dir = DVec3::new(0.3, -0.2, 0.93);
            let ray = Ray::new(target - dir * distance, dir);
            let meeting = triangle.intersect(&ray).unwrap();
            let point = triangle.surface(triangle.weights(&ray, &hit(0, meeting))).point;
            let off = (point - ray.at(meeting.t)).length();
            assert!(off < 4.0 * f64::EPSILON * (distance + 1.0), "{off} from {distance}");
        }
        for size in [1e-200, 1e200] {
            let small = Triangle { corners: triangle.corners.map(|c| c * size) };
            assert!((small.surface([0.5, 0.25, 0.25]).normal.length() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn bad_indices_are_named() {
        let error = TriangleMesh::new(vec![[0.0f32; 3]; 3], vec![[0, 1, 2], [0, 3, 1]]).unwrap_err();
        assert_eq!(error, MeshError::IndexOutOfRange { triangle: 1, index: 3, vertices: 3 });
        assert_eq!(error.to_string(), "triangle 1 names vertex 3, but there are 3");
        let mesh = TriangleMesh::new(vec![[0.0f32; 3]; 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.degenerate(), 1);
        assert!(mesh.with_normals(vec![[0.0; 3]; 2]).is_err());
    }

    #[test]
    fn a_vertex_that_is_not_finite_spoils_its_triangle_only() {
        let mesh = TriangleMesh::new(
            vec![
                [0.0f32, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, f32::NAN, 0.0],
                [0.0, 1.0, 0.0],
                [f32::INFINITY, 0.0, 0.0],
            ],
            vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
        )
        .unwrap();
        assert_eq!([0, 1, 2].map(|prim| mesh.bound(prim).is_valid()), [false, true, false]);
    }

    #[test]
    fn a_spawned_ray_does_not_meet_its_surface() {
        let mesh = TriangleMesh::new(
            vec![[0.1f32, 0.2, 1e4], [7.3, 0.4, 1.1e4], [0.5, 9.6, 1.2e4]],
            vec![[0, 1, 2]],
        )
        .unwrap();
        let mut hits = 0;
        for i in 0..100 {
            for j in 0..100 - i {
                let (x, y) = (i as f32 * 0.07 + 0.3, j as f32 * 0.09 + 0.3);
                let ray = Ray::new(Vec3A::new(x, y, 0.0), Vec3A::new(1e-5, 2e-5, 1.0));
                let Some(hit) = Geometry::<f32>::intersect(&mesh, 0, &ray) else { continue };
                hits += 1;
                let surface = mesh.surface(&ray, &hit);
                for dir in
                    [Vec3A::new(0.3, 0.2, -1.0), Vec3A::Y, -Vec3A::X, Vec3A::new(1.0, -2.0, 5.0), ray.dir]
                {
                    assert!(!Geometry::<f32>::intersect_p(&mesh, 0, &surface.spawn(dir)), "{surface:?}");
                    assert!(!Geometry::<f64>::intersect_p(&mesh, 0, &surface.spawn(dir.as_dvec3())));
                }
            }
        }
        assert!(hits > 2000);
    }

    /// One triangle, leaning, with these texture coordinates and vertex normals.
    fn leaning(uvs: Option<[[f32; 2]; 3]>, normals: Option<[[f32; 3]; 3]>) -> TriangleMesh<f64> {
        let corners = vec![[0.1, 0.2, 4.0], [7.3, 0.4, 5.5], [0.5, 9.6, 6.0]];
        let mut mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).unwrap();
        if let Some(uvs) = uvs {
            mesh = mesh.with_uvs(uvs.to_vec()).unwrap();
        }
        if let Some(normals) = normals {
            mesh = mesh.with_normals(normals.to_vec()).unwrap();
        }
        mesh
    }

    #[test]
    fn partials_are_those_of_differences() {
        let bent = [[0.1, -0.3, 1.0], [0.4, 0.2, 0.7], [-0.3, 0.5, 1.6]];
        let inward = bent.map(|n| n.map(|x: f32| -x));
        let plain = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let skew = [[0.3, 0.1], [2.0, -0.5], [1.0, 3.0]];
        let mirrored = [[0.0, 0.0], [0.0, 4.0], [2.0, 0.0]];
        let needle = [[0.0, 0.0], [1.0, 1.0], [1.0, 1.000001]];
        for uvs in [None, Some(plain), Some(skew), Some(mirrored), Some(needle)] {
            for normals in [None, Some(bent), Some(inward)] {
                let mesh = leaning(uvs, normals);
                let at = |point: DVec3| {
                    let ray = Ray::new(DVec3::new(point.x, point.y, 0.0), DVec3::Z);
                    let hit = Geometry::<f64>::intersect(&mesh, 0, &ray).unwrap();
                    (mesh.surface(&ray, &hit), mesh.partials(&ray, &hit))
                };
                let (here, partials) = at(DVec3::new(2.2, 2.9, 0.0));
                for (along, turn, step) in
                    [(partials.dpdu, partials.dndu, DVec2::X), (partials.dpdv, partials.dndv, DVec2::Y)]
                {
                    let h = 1e-4 / along.length();
                    let (after, before) = (at(here.point + along * h).0, at(here.point - along * h).0);
                    let moved = (after.uv - before.uv) / (2.0 * h);
                    // Some roundings of the texture coordinates over the step, which a needle makes short.
                    assert!((moved - step).length() < 1e-9 + 2e-12 * along.length(), "{uvs:?} {moved}");
                    let turned = (after.shading - before.shading) / (2.0 * h);
                    assert!((turned - turn).length() <= 1e-6 * along.length(), "{uvs:?} {turned} {turn}");
                    assert!(
                        along.dot(here.normal).abs() < 1e-10 * along.length()
                            && turn.dot(here.shading).abs() < 1e-9 * along.length()
                    );
                }
                assert_eq!(partials.dndu == DVec3::ZERO, normals.is_none());
            }
        }
    }

    #[test]
    fn degenerate_texture_coordinates_give_way_to_edges() {
        let line = [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]];
        let point = [[0.5, 0.5]; 3];
        let spoilt = [[f32::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let bent = [[0.1, -0.3, 1.0], [0.4, 0.2, 0.7], [-0.3, 0.5, 1.6]];
        let opposed = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
        let ray = Ray::new(DVec3::new(2.2, 2.9, 0.0), DVec3::Z);
        let of = |mesh: &TriangleMesh<f64>| {
            let hit = Geometry::<f64>::intersect(mesh, 0, &ray).unwrap();
            mesh.partials(&ray, &hit)
        };
        let expected = of(&leaning(None, Some(bent)));
        assert_eq!(expected.dpdu, DVec3::new(7.3, 0.4, 5.5) - DVec3::new(0.1, 0.2, 4.0));
        for uvs in [line, point, spoilt] {
            assert_eq!(of(&leaning(Some(uvs), Some(bent))), expected);
        }
        let flat = of(&leaning(None, None));
        assert_eq!((flat.dndu, flat.dndv), (DVec3::ZERO, DVec3::ZERO));
        let finite = |p: Partials| [p.dpdu, p.dpdv, p.dndu, p.dndv].iter().all(|v| v.is_finite());
        assert!(finite(of(&leaning(Some(line), Some(opposed)))));
        assert!(finite(of(&leaning(None, Some([[0.0; 3]; 3])))));
    }
}

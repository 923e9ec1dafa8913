//! [`Facet`]: a triangle of a shared mesh, among other solids.

use core::ops::ControlFlow;
use rt_accel::{Bounded, Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use rt_shapes::{Meeting, Partials, Shape, Surface, Surfaced, TriangleMesh, Uv};
use std::sync::Arc;

/// A triangle of a mesh that many share, as one solid among others: 16 bytes beside the mesh. With the mesh's normals, if it has
/// such; of `f64`, and answers rays of both precisions.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::Vec3A};
/// use rt_scenes::Facet;
/// use rt_shapes::TriangleMesh;
/// let mesh = TriangleMesh::new(vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], vec![[0, 1, 2]])?;
/// let facets = Facet::all(mesh);
/// assert_eq!(facets[0].intersect(&Ray::new(Vec3A::new(0.2, 0.2, 0.0), Vec3A::Z)).unwrap().t, 1.0);
/// # Ok::<(), rt_shapes::MeshError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Facet {
    mesh: Arc<TriangleMesh<f64>>,
    number: u32,
}

/// The same triangle: corners, and normals.
impl PartialEq for Facet {
    fn eq(&self, other: &Facet) -> bool {
        self.mesh.triangle(self.number).corners == other.mesh.triangle(other.number).corners
            && self.normals() == other.normals()
    }
}

impl Facet {
    /// All triangles of a mesh, in order.
    pub fn all(mesh: TriangleMesh<f64>) -> Vec<Facet> {
        let mesh = Arc::new(mesh);
        (0..mesh.triangles().len() as u32).map(|number| Facet { mesh: Arc::clone(&mesh), number }).collect()
    }

    /// The same ray and hit, of the mesh. Exact: a ray of `f32` is one of `f64`.
    fn in_mesh<R: Real>(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> (Ray<f64>, Hit<Uv, f64>) {
        let at = Uv { prim: self.number, ..hit.at };
        (Ray::new(ray.origin.widen(), ray.dir.widen()), Hit { t: hit.t.into(), at })
    }

    /// The corners.
    pub fn corners(&self) -> [DVec3; 3] {
        self.mesh.triangle(self.number).corners
    }

    /// The normals at the corners, of any length; `None` where it is shaded flat.
    pub fn normals(&self) -> Option<[[f32; 3]; 3]> {
        corner_normals(&self.mesh, self.number)
    }
}

/// The normals at the corners of a triangle, unless all are zero.
pub(crate) fn corner_normals<V: Real>(mesh: &TriangleMesh<V>, number: u32) -> Option<[[f32; 3]; 3]> {
    let normals = mesh.triangles()[number as usize].map(|i| mesh.normals().get(i as usize).copied());
    match normals {
        [Some(a), Some(b), Some(c)] if [a, b, c] != [[0.0; 3]; 3] => Some([a, b, c]),
        _ => None,
    }
}

fn hit<R: Real>(Meeting { t, u, v }: Meeting<R>) -> Hit<Uv, R> {
    Hit { t, at: Uv { prim: 0, u: u as f32, v: v as f32 } }
}

impl WorldBound for Facet {
    fn world_bound(&self) -> Aabb {
        self.mesh.bound(self.number)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.mesh.bound_from(self.number, origin)
    }
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        self.mesh.clipped_bound(self.number, cell, origin)
    }
    fn outline(&self, origin: DVec3) -> Option<[DVec3; 3]> {
        self.mesh.outline(self.number, origin)
    }
}

impl<R: Real> Primitive<R> for Facet {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.mesh.triangle(self.number).intersect(ray).map(hit)
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        match self.mesh.triangle(self.number).cross(ray) {
            Some(meeting) => each(hit(meeting)),
            None => ControlFlow::Continue(()),
        }
    }
}

impl<R: Real> Shape<R> for Facet {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let (ray, hit) = self.in_mesh(ray, hit);
        Surfaced::<f64>::surface(&*self.mesh, &ray, &hit)
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let (ray, hit) = self.in_mesh(ray, hit);
        Surfaced::<f64>::partials(&*self.mesh, &ray, &hit)
    }
}

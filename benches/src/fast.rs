//! [`FastMesh`] and [`TextbookRay`]: fast and fallible, to be measured against.

use rt_accel::{Bounded, Geometry, Hit};
use rt_bounds::Aabb;
use rt_geom::Ray;
use rt_geom::glam::{DVec3, Vec3A};
use rt_shapes::{TriangleMesh, Uv, moller_trumbore};

/// A mesh whose triangles are tested in plain `f32`, after Möller and Trumbore.
///
/// Error: see the question `precision`; hits are lost and made up at edges.
#[derive(Clone, Debug)]
pub struct FastMesh(pub TriangleMesh);

impl Bounded for FastMesh {
    fn prim_count(&self) -> usize {
        self.0.prim_count()
    }
    fn bound(&self, prim: u32) -> Aabb {
        self.0.bound(prim)
    }
    fn bound_from(&self, prim: u32, origin: DVec3) -> Aabb {
        self.0.bound_from(prim, origin)
    }
}

impl Geometry<f32> for FastMesh {
    type At = Uv;

    #[inline(always)]
    fn intersect(&self, prim: u32, ray: &Ray) -> Option<Hit<Uv>> {
        let corners = self.0.triangles()[prim as usize].map(|i| Vec3A::from(self.0.vertices()[i as usize]));
        moller_trumbore(ray, corners).map(|(t, u, v)| Hit { t, at: Uv { prim, u, v } })
    }
}

/// What the slab test of textbooks derives from a ray.
///
/// Source: Kay and Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986; with the minima and maxima of Williams et al., "An
/// efficient and robust ray-box intersection algorithm", JGT 10(1) 2005.
#[derive(Clone, Copy, Debug)]
pub struct TextbookRay {
    origin: Vec3A,
    inverse: Vec3A,
    t_min: f32,
    t_max: f32,
}

impl TextbookRay {
    /// Prepares a ray.
    #[inline]
    pub fn new(ray: &Ray) -> TextbookRay {
        TextbookRay { origin: ray.origin, inverse: ray.dir.recip(), t_min: ray.t_min, t_max: ray.t_max }
    }

    /// Where the ray enters the box; `None` for a miss, which may be false: roundings decide at edges, and `0 * inf` in faces.
    #[inline(always)]
    pub fn entry_fast(&self, b: &Aabb) -> Option<f32> {
        self.slab(b, 1.0)
    }

    /// [`TextbookRay::entry_fast`] with the exit padded by two units in the last place: rounding is outweighed, `0 * inf` is not.
    ///
    /// Source: Ize, "Robust BVH ray traversal", JCGT 2(2) 2013.
    #[inline(always)]
    pub fn entry_padded_fast(&self, b: &Aabb) -> Option<f32> {
        self.slab(b, 1.0 + 2.0 * f32::EPSILON)
    }

    #[inline(always)]
    fn slab(&self, b: &Aabb, grow: f32) -> Option<f32> {
        let low = (b.min - self.origin) * self.inverse;
        let high = (b.max - self.origin) * self.inverse;
        let near = low.min(high).max_element().max(self.t_min);
        let far = (low.max(high).min_element() * grow).min(self.t_max);
        (near <= far).then_some(near)
    }
}

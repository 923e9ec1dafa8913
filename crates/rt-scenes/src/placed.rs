//! [`Placed`]: a shape of any kind, somewhere in a scene.

use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Counts, Hit, Instance, Primitive, WorldBound};
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Transform};
use rt_shapes::{Partials, Shape, Surface, Uv};
use std::sync::Arc;

/// A shape of any kind, placed by a transform: what a scene has few of, or what is costly to meet, so that a virtual call is not
/// noticed. Answers rays of both precisions, as an [`Instance`] does; several may share a shape.
///
/// Equal are two of the same shared shape at the same place: shapes themselves are not compared.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, Transform, glam::{DVec3, Vec3A}};
/// use rt_scenes::{Placed, Solid};
/// use rt_shapes::Quadric;
/// use std::sync::Arc;
/// let bowl = Quadric::sphere(1.0)?.cut(-1.0, 0.0)?;
/// let bowl = Placed::new("part of a quadric", Arc::new(bowl), Transform::translation(DVec3::Z * 3.0));
/// let hit = Solid::from(bowl).intersect(&Ray::new(Vec3A::new(0.0, 0.0, 5.0), Vec3A::NEG_Z)).unwrap();
/// assert_eq!(hit.t, 3.0);
/// # Ok::<(), rt_shapes::QuadricError>(())
/// ```
#[derive(Clone)]
pub struct Placed {
    what: &'static str,
    shape: Instance<Arc<dyn Shape<f64, At = Uv>>>,
}

impl Placed {
    /// A shape, carried from its own space to the world by `to_world`; messages call it `what`, as "a Bézier patch".
    pub fn new(what: &'static str, shape: Arc<dyn Shape<f64, At = Uv>>, to_world: Transform) -> Placed {
        Placed { what, shape: Instance::new(shape, to_world) }
    }

    /// What messages call it.
    pub fn what(&self) -> &'static str {
        self.what
    }

    /// The shape, and its place.
    pub fn shape(&self) -> &Instance<Arc<dyn Shape<f64, At = Uv>>> {
        &self.shape
    }
}

impl fmt::Debug for Placed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut fields = f.debug_struct("Placed");
        fields.field("what", &self.what).field("to_world", self.shape.to_world()).finish_non_exhaustive()
    }
}

impl PartialEq for Placed {
    fn eq(&self, other: &Placed) -> bool {
        Arc::ptr_eq(self.shape.inner(), other.shape.inner())
            && self.shape.to_world() == other.shape.to_world()
    }
}

impl WorldBound for Placed {
    fn world_bound(&self) -> Aabb {
        self.shape.world_bound()
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.shape.world_bound_from(origin)
    }
    fn bound_under(&self, map: &Transform) -> DAabb {
        self.shape.bound_under(map)
    }
}

/// Never inlined, so that scenes without any are not slowed by them.
impl<R: Real> Primitive<R> for Placed {
    type At = Uv;

    #[inline(never)]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.shape.intersect(ray)
    }
    #[inline(never)]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.shape.intersect_p(ray)
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        self.shape.all_hits(ray, each)
    }
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Uv, R>> {
        self.shape.intersect_counted(ray, counts)
    }
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        self.shape.intersect_p_counted(ray, counts)
    }
}

impl<R: Real> Shape<R> for Placed {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        self.shape.surface(ray, hit)
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        self.shape.partials(ray, hit)
    }
}

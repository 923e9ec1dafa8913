//! [`Solid`]: one shape of a mixed scene.

use crate::{Facet, Placed};
use core::ops::ControlFlow;
use rt_accel::{Counts, Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};
use rt_shapes::{Frustum, Partials, Polygon, Shape, Sphere, Surface, Uv};

/// One solid of a mixed scene: answers as the shape inside does, rays of both precisions.
///
/// Shapes that scenes hold many of are a closed set, 64 bytes each and what they refer to, so that no call is virtual; whatever
/// else can be hit is [`Placed`].
///
/// ```
/// use rt_accel::{Aggregate, Exhaustive, Primitive};
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_scenes::Solid;
/// use rt_shapes::Sphere;
///
/// let ball = Solid::from(Sphere::new(DVec3::new(0.0, 0.0, 5.0), 1.0)?);
/// let scene = Aggregate::<Exhaustive, _>::build(vec![ball], &())?;
/// assert_eq!(scene.intersect(&Ray::new(Vec3A::ZERO, Vec3A::Z)).unwrap().t, 4.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Solid {
    /// A sphere.
    Sphere(Sphere),
    /// A planar polygon.
    Polygon(Polygon),
    /// A triangle, perhaps with normals to shade with.
    Facet(Facet),
    /// A cylinder or cone without ends; elsewhere, because it is several times as large as the others.
    Frustum(Box<Frustum>),
    /// Anything else, by a virtual call.
    Placed(Box<Placed>),
}

impl From<Sphere> for Solid {
    fn from(sphere: Sphere) -> Solid {
        Solid::Sphere(sphere)
    }
}

impl From<Polygon> for Solid {
    fn from(polygon: Polygon) -> Solid {
        Solid::Polygon(polygon)
    }
}

impl From<Facet> for Solid {
    fn from(facet: Facet) -> Solid {
        Solid::Facet(facet)
    }
}

impl From<Frustum> for Solid {
    fn from(frustum: Frustum) -> Solid {
        Solid::Frustum(Box::new(frustum))
    }
}

impl From<Placed> for Solid {
    fn from(placed: Placed) -> Solid {
        Solid::Placed(Box::new(placed))
    }
}

/// The same call on whichever shape is inside.
macro_rules! each {
    ($solid:expr, $shape:ident => $call:expr) => {
        match $solid {
            Solid::Sphere($shape) => $call,
            Solid::Polygon($shape) => $call,
            Solid::Facet($shape) => $call,
            Solid::Frustum($shape) => $call,
            Solid::Placed($shape) => $call,
        }
    };
}

impl WorldBound for Solid {
    fn world_bound(&self) -> Aabb {
        each!(self, shape => shape.world_bound())
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        each!(self, shape => shape.world_bound_from(origin))
    }
    fn clipped_bound(&self, cell: &Aabb, origin: DVec3) -> Aabb {
        each!(self, shape => shape.clipped_bound(cell, origin))
    }
    fn outline(&self, origin: DVec3) -> Option<[DVec3; 3]> {
        each!(self, shape => shape.outline(origin))
    }
}

impl<R: Real> Primitive<R> for Solid {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        each!(self, shape => shape.intersect(ray))
    }
    #[inline]
    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        each!(self, shape => shape.intersect_p(ray))
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        each!(self, shape => shape.all_hits(ray, each))
    }
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Uv, R>> {
        each!(self, shape => shape.intersect_counted(ray, counts))
    }
    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        each!(self, shape => shape.intersect_p_counted(ray, counts))
    }
}

impl<R: Real> Shape<R> for Solid {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        each!(self, shape => shape.surface(ray, hit))
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        each!(self, shape => shape.partials(ray, hit))
    }
}

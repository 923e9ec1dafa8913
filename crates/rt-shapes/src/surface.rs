//! [`Shape`] and [`Surface`]: what a hit looks like close up.

use rt_accel::{Aggregate, Geometry, Hit, Instance, Member, Primitive, Structure};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector, f32_above, f32_below, gamma};
use std::sync::Arc;

/// Which part was hit, and where on it. Simple shapes have one part, number 0.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Uv {
    /// The part: in a mesh, the triangle's number.
    pub prim: u32,
    /// First surface parameter; on a triangle the weight of its second corner.
    pub u: f32,
    /// Second surface parameter; on a triangle the weight of its third corner.
    pub v: f32,
}

/// The surface at a hit, in world space, in `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point, on the surface within `error`.
    pub point: DVec3,
    /// Bound on the absolute error of `point`, component by component.
    pub error: DVec3,
    /// The unit normal of the surface itself, on the side its orientation calls outside.
    pub normal: DVec3,
    /// The unit normal to shade with: interpolated where the shape has such, else `normal`. In the hemisphere of `normal`.
    pub shading: DVec3,
    /// Surface parameters, as the shape's texture coordinates if it has such.
    pub uv: DVec2,
}

/// Two numbers to sample by, moved into `[0, 1]`; NaN to 0.
pub(crate) fn unit(xi: DVec2) -> DVec2 {
    let inside = |x: f64| if x > 0.0 { x.min(1.0) } else { 0.0 };
    DVec2::new(inside(xi.x), inside(xi.y))
}

/// `2^-60`.
const STEP: f64 = f64::EPSILON / 256.0;

impl Surface {
    /// A ray leaving the surface towards `dir`, for `t` in `[0, inf]`: its origin lies off the surface, on the side `dir`
    /// points to, by no more than the point's error and one unit in the last place. It does not meet this surface at its
    /// start, unless the surface bends within that unit: rays of `f32` want shapes larger than what `f32` tells apart there.
    ///
    /// Source: Pharr, Jakob, Humphreys, *Physically Based Rendering*, 4th ed. (2023), section 6.8.6.
    pub fn spawn<V: Vector>(&self, dir: V) -> Ray<V::Real> {
        let side = if dir.widen().dot(self.normal) < 0.0 { -self.normal } else { self.normal };
        // The distance to clear the error box along the normal. In a plane through zero the error along the normal is zero too, and
        // the next number after zero is so small that products with it vanish: a share of the other errors, far below their
        // own rounding, keeps the step in range.
        let off = side * (self.error.dot(side.abs()) + self.error.max_element() * STEP);
        let mut origin = self.point + off;
        for a in 0..3 {
            // Away from the surface by rounding: to the precision of the ray, and by one more unit of f64 for the sum above.
            if side[a] > 0.0 {
                origin[a] = origin[a].next_up();
            } else if side[a] < 0.0 {
                origin[a] = origin[a].next_down();
            }
        }
        Ray::new(away::<V::Real>(origin, side), dir)
    }

    /// [`Surface::spawn`] towards a point, which lies at `t = 1`; the interval ends there.
    pub fn spawn_to<R: Real>(&self, target: DVec3) -> Ray<R> {
        let rough = R::Vec3::nearest(target - self.point);
        let origin = self.spawn(rough).origin;
        Ray::new(origin, R::Vec3::nearest(target - origin.widen())).between(R::ZERO, R::nearest(1.0))
    }
}

/// `p` rounded to the precision `R`, each component towards `side`.
fn away<R: Real>(p: DVec3, side: DVec3) -> R::Vec3 {
    let nearest = R::Vec3::nearest(p).widen();
    let mut rounded = p;
    for a in 0..3 {
        // Rounding to f32 and back is exact; for f64 the nearest is p itself and nothing is left to do.
        if nearest[a] != p[a] {
            rounded[a] = if side[a] > 0.0 {
                f32_above(p[a]) as f64
            } else if side[a] < 0.0 {
                f32_below(p[a]) as f64
            } else {
                nearest[a]
            };
        }
    }
    R::Vec3::nearest(rounded)
}

/// How the surface runs at a hit: derivatives of its point and of its unit normal along the parameters [`Surface::uv`], in world
/// space, in `f64`.
///
/// The normal is [`Surface::shading`], which is the surface's own unless vertex normals are interpolated. Where a parameter does
/// not move the point (the pole of a sphere, the tip of a cone) its derivatives are zero.
///
/// Source: the Weingarten equations: do Carmo, *Differential Geometry of Curves and Surfaces* (1976), section 3.3.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Partials {
    /// Derivative of the point along u.
    pub dpdu: DVec3,
    /// Derivative of the point along v.
    pub dpdv: DVec3,
    /// Derivative of the unit normal along u.
    pub dndu: DVec3,
    /// Derivative of the unit normal along v.
    pub dndv: DVec3,
}

/// A primitive that can describe its surface. Object-safe: `Arc<dyn Shape<At = Uv>>` makes a mixed scene.
pub trait Shape<R: Real = f32>: Primitive<R> {
    /// The surface at `hit`, which this shape reported for `ray`.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Self::At, R>) -> Surface;

    /// How the surface runs there: asked by those who filter, bump or follow ray differentials.
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Self::At, R>) -> Partials;
}

/// A geometry that can do the same for each of its primitives; its aggregates are then [`Shape`]s.
pub trait Surfaced<R: Real = f32>: Geometry<R> {
    /// The surface at `hit`, which this geometry reported for `ray`.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Self::At, R>) -> Surface;

    /// How the surface runs there.
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Self::At, R>) -> Partials;
}

impl<R: Real, S: Structure, G: Surfaced<R>> Shape<R> for Aggregate<S, G> {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<G::At, R>) -> Surface {
        self.geometry().surface(ray, hit)
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<G::At, R>) -> Partials {
        self.geometry().partials(ray, hit)
    }
}

impl<R: Real, P: Shape<R>> Surfaced<R> for Vec<P> {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Member<P::At>, R>) -> Surface {
        self[hit.at.prim as usize].surface(ray, &Hit { t: hit.t, at: hit.at.at })
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Member<P::At>, R>) -> Partials {
        self[hit.at.prim as usize].partials(ray, &Hit { t: hit.t, at: hit.at.at })
    }
}

impl<R: Real, P: Shape<f64>> Shape<R> for Instance<P> {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<P::At, R>) -> Surface {
        let inner = self.inner().surface(&self.object_ray(ray), &Hit { t: hit.t.into(), at: hit.at });
        let map = self.to_world();
        let m = map.linear();
        let carry = |v: DVec3| m.x_axis.abs() * v.x + m.y_axis.abs() * v.y + m.z_axis.abs() * v.z;
        let point = map.point(inner.point);
        let rounded = (carry(inner.point.abs()) + map.affine().translation.abs()) * gamma(4);
        let normal = map.normal(inner.normal).normalize_or(inner.normal);
        Surface {
            point,
            error: carry(inner.error) + rounded,
            normal,
            shading: map.normal(inner.shading).normalize_or(normal),
            uv: inner.uv,
        }
    }

    fn partials(&self, ray: &Ray<R>, hit: &Hit<P::At, R>) -> Partials {
        let (object_ray, object_hit) = (self.object_ray(ray), Hit { t: hit.t.into(), at: hit.at });
        let inner = self.inner().partials(&object_ray, &object_hit);
        let map = self.to_world();
        // The derivative of a unit normal has no part along it: carried as a normal, then freed of that part again.
        let long = map.normal(self.inner().surface(&object_ray, &object_hit).shading);
        let unit = long.normalize_or_zero();
        let turn = |dn: DVec3| {
            let carried = map.normal(dn);
            (carried - unit * unit.dot(carried)) / long.length()
        };
        Partials {
            dpdu: map.vector(inner.dpdu),
            dpdv: map.vector(inner.dpdv),
            dndu: turn(inner.dndu),
            dndv: turn(inner.dndv),
        }
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<R: Real, P: Shape<R> + ?Sized> Shape<R> for $pointer {
            fn surface(&self, ray: &Ray<R>, hit: &Hit<P::At, R>) -> Surface {
                (**self).surface(ray, hit)
            }
            fn partials(&self, ray: &Ray<R>, hit: &Hit<P::At, R>) -> Partials {
                (**self).partials(ray, hit)
            }
        }
    )*};
}

forward!(&P, Box<P>, Arc<P>);

macro_rules! forward_surfaced {
    ($($pointer:ty),*) => {$(
        impl<R: Real, G: Surfaced<R> + ?Sized> Surfaced<R> for $pointer {
            fn surface(&self, ray: &Ray<R>, hit: &Hit<G::At, R>) -> Surface {
                (**self).surface(ray, hit)
            }
            fn partials(&self, ray: &Ray<R>, hit: &Hit<G::At, R>) -> Partials {
                (**self).partials(ray, hit)
            }
        }
    )*};
}

forward_surfaced!(&G, Arc<G>);

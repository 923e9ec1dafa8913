//! [`BoundingVolume`]: what all volumes can do, so that they can be compared.

use crate::{Aabb, SlabRay};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};

/// Something around points that a ray can be tested against.
///
/// Every volume holds all the points it was made around, as real numbers, and its test never misses a ray that meets the
/// exact closed volume. How well it fits and what its test costs is what tells one kind from another.
pub trait BoundingVolume: Sized {
    /// A ray made ready, once, for all volumes of this kind.
    type Ready;

    /// The volume around some points, relative to `origin`, rounded outward; `None` where there are none, or where one or
    /// `origin` is not finite.
    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<Self>;

    /// Prepares a [valid](Ray::is_valid) ray for volumes given relative to `origin` that all lie in `world`, itself relative to
    /// `origin`.
    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> Self::Ready;

    /// Where the ray enters, as a distance that orders the volumes of one kind along one ray; `None` for a certain miss.
    fn entry(&self, ready: &Self::Ready) -> Option<f32>;

    /// The area of the surface, on which the chance of being met by a line depends. Approximate; infinite where it overflows.
    fn surface_area(&self) -> f64;

    /// The box around the volume.
    fn aabb(&self) -> Aabb;

    /// The bytes that the volume takes, those it holds on the heap included.
    fn bytes(&self) -> usize {
        size_of::<Self>()
    }
}

impl BoundingVolume for Aabb {
    type Ready = SlabRay;

    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<Aabb> {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let p = p.widen();
            if !p.is_finite() {
                return None;
            }
            (min, max) = (min.min(p), max.max(p));
        }
        (origin.is_finite() && !points.is_empty()).then(|| Aabb::from_f64(min, max, origin))
    }

    #[inline]
    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> SlabRay {
        SlabRay::new(ray, origin, world)
    }

    #[inline]
    fn entry(&self, ready: &SlabRay) -> Option<f32> {
        ready.entry(self)
    }

    fn surface_area(&self) -> f64 {
        let s = (self.max.as_dvec3() - self.min.as_dvec3()).max(DVec3::ZERO);
        let area = 2.0 * (s.x * s.y + s.y * s.z + s.z * s.x);
        if area.is_nan() { f64::INFINITY } else { area }
    }

    fn aabb(&self) -> Aabb {
        *self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::Vec3A;

    #[test]
    fn nothing_is_around_points_seen_from_no_place() {
        fn check<B: BoundingVolume>() {
            let points = [DVec3::ZERO, DVec3::ONE, DVec3::X];
            assert!(B::around(&points, DVec3::ONE).is_some());
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                for origin in [DVec3::X * bad, DVec3::new(0.0, bad, 0.0), DVec3::new(0.0, 0.0, bad)] {
                    assert!(B::around(&points, origin).is_none(), "{origin}");
                }
            }
        }
        check::<Aabb>();
        check::<crate::BoundingSphere>();
        check::<crate::Obb>();
        check::<crate::Kdop<14>>();
        let origin = DVec3::new(0.0, f64::NAN, 0.0);
        assert!(crate::BoundingSphere::ritter(&[DVec3::ONE], origin).is_none());
        assert!(crate::BoundingSphere::epos(&[DVec3::ONE], origin, crate::Extremes::Six).is_none());
        assert!(crate::Kdop::<6>::from_points([DVec3::ONE], origin).extent(0).0.is_nan());
    }

    #[test]
    fn a_box_around_points() {
        let b = <Aabb as BoundingVolume>::around(&[DVec3::ONE, DVec3::splat(3.0)], DVec3::ONE).unwrap();
        assert_eq!(b, Aabb::new(Vec3A::ZERO, Vec3A::splat(2.0)));
        assert_eq!(BoundingVolume::surface_area(&b), 24.0);
        assert!(<Aabb as BoundingVolume>::around::<DVec3>(&[], DVec3::ZERO).is_none());
        assert!(<Aabb as BoundingVolume>::around(&[Vec3A::NAN], DVec3::ZERO).is_none());
    }
}

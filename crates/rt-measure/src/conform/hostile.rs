//! Rays that structures tend to get wrong.

use rt_accel::Bounded;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};

/// At most `count` of some things, evenly spread.
pub(super) fn sample<T: Copy>(from: &[T], count: usize) -> Vec<T> {
    from.iter().copied().step_by(from.len().div_ceil(count).max(1)).collect()
}

/// The given rays, and hostile ones derived from the bounds.
pub(super) fn all_rays<R: Real, G: Bounded>(prims: &G, given: &[Ray<R>]) -> Vec<Ray<R>> {
    let mut rays = given.to_vec();
    let bounds: Vec<Aabb> = (0..prims.prim_count() as u32).map(|prim| prims.bound(prim)).collect();
    let mut bounds = sample(&bounds, 8);
    bounds.retain(|b| b.is_valid());
    bounds.push(bounds.iter().fold(Aabb::EMPTY, |world, b| world.union(*b)));
    for b in bounds {
        let middle = b.center().as_dvec3();
        let end = |corner: DVec3, a: usize| if corner[a].is_finite() { corner[a] } else { middle[a] };
        let ends = |corner: DVec3| DVec3::new(end(corner, 0), end(corner, 1), end(corner, 2));
        let (min, max) = (ends(b.min.as_dvec3()), ends(b.max.as_dvec3()));
        let size = (max - min).max_element().max(middle.abs().max_element() * 1e-3);
        for target in [middle, min, max, DVec3::new(min.x, max.y, middle.z)] {
            for a in 0..3 {
                let mut dir = DVec3::ZERO;
                dir[a] = if target == min { -1.0 } else { 1.0 };
                // Half of the zeros negative.
                dir[(a + 1) % 3] = -0.0;
                rays.push(single(target - dir * (2.0 * size), dir));
                rays.push(single(target, dir));
                // Within a plane, not along an axis; a direction far from unit.
                dir[(a + 1) % 3] = if target == max { -1e-3 } else { 1e3 };
                rays.push(single(target - dir * size, dir));
            }
        }
        let line: Ray<R> = single(middle, DVec3::new(1.0, -2.0, 3.0));
        let zero = R::ZERO;
        rays.push(line.between(-R::INFINITY, R::INFINITY));
        rays.push(line.between(-R::INFINITY, zero));
        rays.push(line.between(zero, zero));
        rays.push(line.between(-R::MAX, R::MAX));
        // From here on nothing may be hit.
        rays.push(line.between(R::MAX, zero));
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for a in 0..3 {
                let (mut o, mut d) = (middle, DVec3::ONE);
                o[a] = bad;
                rays.push(single(o, d));
                d[a] = bad;
                rays.push(single(middle, d));
            }
        }
        rays.push(single(middle, DVec3::ZERO));
        rays.push(single(middle, DVec3::splat(-0.0)));
        let nan = R::nearest(f64::NAN);
        rays.extend([line.between(nan, R::INFINITY), line.between(zero, nan)]);
        rays.extend([line.between(R::INFINITY, R::INFINITY), line.between(-R::INFINITY, -R::INFINITY)]);
    }
    rays
}

fn single<R: Real>(origin: DVec3, dir: DVec3) -> Ray<R> {
    Ray::new(R::Vec3::nearest(origin), R::Vec3::nearest(dir))
}

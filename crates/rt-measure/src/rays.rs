//! Sets of rays, the same on every machine for the same seed.
//!
//! Nothing here calls a transcendental function: additions, multiplications, divisions and square roots are rounded
//! correctly everywhere, so the numbers are equal bit for bit on any platform. Directions are of length 1 up to rounding
//! unless said otherwise.
//!
//! ```
//! use rt_bounds::Aabb;
//! use rt_geom::{Ray, glam::Vec3A};
//! use rt_measure::rays;
//! let world = Aabb::new(Vec3A::ZERO, Vec3A::ONE);
//! let chords: Vec<Ray<f32>> = rays::uniform(1, &world, 100);
//! assert_eq!(chords, rays::uniform(1, &world, 100));
//! ```

use rt_accel::Bounded;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};

/// Random numbers from a seed: SplitMix64. Eight bytes of state, a period of `2^64`.
///
/// Source: Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
///
/// ```
/// use rt_measure::rays::Seeded;
/// let mut seeded = Seeded::new(0);
/// assert_eq!(seeded.bits(), 0xe220_a839_7b1d_cdaf);
/// assert!((0.0..1.0).contains(&seeded.unit()));
/// ```
#[derive(Clone, Debug)]
pub struct Seeded(u64);

impl Seeded {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Seeded {
        Seeded(seed)
    }

    /// Sixty-four random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A whole number from 0 to `n - 1`, uniform up to `n / 2^64`; 0 for `n = 0`.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.bits() as u128 * n as u128) >> 64) as usize
    }

    /// A multiple of `2^-53` in `[0, 1)`, uniform.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform between `a` and `b`.
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// One of some things; `None` when there are none.
    pub fn choose<'a, T>(&mut self, from: &'a [T]) -> Option<&'a T> {
        from.get(self.below(from.len()))
    }

    /// A direction, uniform on the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let length = p.length();
            // Too close to the middle a direction has few bits.
            if (0.01..=1.0).contains(&length) {
                return p / length;
            }
        }
    }

    /// A point uniform in the box between two corners.
    pub fn inside(&mut self, min: DVec3, max: DVec3) -> DVec3 {
        let mut p = DVec3::ZERO;
        for a in 0..3 {
            p[a] = self.between(min[a], max[a]);
        }
        p
    }

    /// A point uniform in the unit disk perpendicular to `normal`, a direction.
    fn disk(&mut self, normal: DVec3) -> DVec3 {
        let side = if normal.x.abs() < 0.5 { DVec3::X } else { DVec3::Y };
        let u = normal.cross(side).normalize();
        let v = normal.cross(u);
        loop {
            let (x, y) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if x * x + y * y <= 1.0 {
                return u * x + v * y;
            }
        }
    }
}

/// A point and the normal of the surface there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The point.
    pub point: DVec3,
    /// The normal; any length but zero.
    pub normal: DVec3,
}

/// The corners, with what is infinite brought back to 1 from the finite corner or the origin; a unit box if there is none.
fn corners(world: &Aabb) -> (DVec3, DVec3) {
    if !world.is_valid() {
        return (DVec3::ZERO, DVec3::ONE);
    }
    let (mut min, mut max) = (world.min.as_dvec3(), world.max.as_dvec3());
    for a in 0..3 {
        if !min[a].is_finite() {
            min[a] = if max[a].is_finite() { max[a] - 1.0 } else { -1.0 };
        }
        if !max[a].is_finite() {
            max[a] = min[a] + 1.0;
        }
    }
    (min, max)
}

fn ray<R: Real>(origin: DVec3, dir: DVec3) -> Ray<R> {
    Ray::new(R::Vec3::nearest(origin), R::Vec3::nearest(dir))
}

/// Chords of the sphere around `world`, uniform among all lines that meet the sphere: direction uniform on the sphere, offset
/// uniform in the disk perpendicular to it. Origins lie on the sphere.
///
/// The share of them that meets a convex body inside is its surface area over that of the sphere.
pub fn uniform<R: Real>(seed: u64, world: &Aabb, count: usize) -> Vec<Ray<R>> {
    let mut seeded = Seeded::new(seed);
    let (min, max) = corners(world);
    let center = min + (max - min) * 0.5;
    let radius = (max - min).length() * 0.5;
    let chord = |_| {
        let dir = seeded.direction();
        let offset = seeded.disk(dir);
        let back = (1.0 - offset.length_squared()).max(0.0).sqrt();
        ray(center + (offset - dir * back) * radius, dir)
    };
    (0..count).map(chord).collect()
}

/// Rays that pass exactly through given points, at `t = 1`: `per` from around `world` to each. The direction is not unit.
///
/// The origin is chosen so that the direction is exact: a coordinate for which no rounding helps is drawn closer to the
/// point. Points must be representable in `R` for that.
pub fn aimed<R: Real>(seed: u64, world: &Aabb, points: &[DVec3], per: usize) -> Vec<Ray<R>> {
    let mut seeded = Seeded::new(seed);
    let (min, max) = corners(world);
    let size = max - min;
    let mut rays = Vec::with_capacity(points.len() * per);
    for &point in points {
        for _ in 0..per {
            let far = seeded.inside(min - size, max + size);
            let mut origin = R::Vec3::nearest(far).widen();
            for a in 0..3 {
                origin[a] = before::<R>(point[a], origin[a]);
            }
            if origin == point {
                origin.z = origin.z * 2.0 + 1.0;
            }
            rays.push(ray(origin, point - origin));
        }
    }
    rays
}

/// A number near `wish` whose difference to `point` is exact in `R`.
fn before<R: Real>(point: f64, wish: f64) -> f64 {
    let nearest = |x: f64| -> f64 { R::nearest(x).into() };
    let exact = |from: f64| {
        let d = nearest(point - from);
        nearest(from) == from && from + d == point && point - d == from && d - point == -from
    };
    if exact(wish) {
        return wish;
    }
    // On a grid as coarse as the larger of the two both are whole numbers, if the point is.
    let step = |x: f64| -> f64 { (R::nearest(x.abs()).next_up()).into() - nearest(x.abs()) };
    let coarse = step(wish.abs().max(point.abs()) * 2.0);
    let on_grid = (wish / coarse).round() * coarse;
    if exact(on_grid) {
        return on_grid;
    }
    // On the point's own grid, no further from zero than twice as far as the point.
    let fine = step(point);
    let reach = point.abs() * 1.5;
    let close = ((wish.clamp(-reach, reach) * 0.5 + point * 0.25) / fine).round() * fine;
    if exact(close) { close } else { point }
}

/// For each point six rays along the axes through it, from outside `world`; the zeros of the direction have either sign.
pub fn axis_parallel<R: Real>(world: &Aabb, points: &[DVec3]) -> Vec<Ray<R>> {
    let (min, max) = corners(world);
    let mut rays = Vec::with_capacity(points.len() * 6);
    for (i, point) in points.iter().enumerate() {
        let zero = if i % 2 == 0 { 0.0 } else { -0.0 };
        for a in 0..3 {
            for sign in [1.0, -1.0] {
                let mut dir = DVec3::splat(zero);
                dir[a] = sign;
                dir[(a + 1) % 3] = -zero;
                let mut origin = *point;
                let outside = (max[a] - min[a]) * 0.5;
                origin[a] = if sign > 0.0 { min[a] - outside } else { max[a] + outside };
                rays.push(ray(origin, dir));
            }
        }
    }
    rays
}

/// Rays within the six faces of a box, a third of them along its edges: the component across the face is zero, of either
/// sign.
pub fn in_faces<R: Real>(seed: u64, bounds: &Aabb, count: usize) -> Vec<Ray<R>> {
    let mut seeded = Seeded::new(seed);
    let (min, max) = corners(bounds);
    let mut rays = Vec::with_capacity(count);
    for i in 0..count {
        let a = i % 3;
        let mut origin = seeded.inside(min, max);
        let mut dir = seeded.direction();
        let side = |high: bool, a: usize| if high { max[a] } else { min[a] };
        origin[a] = side(i / 3 % 2 == 1, a);
        dir[a] = if i / 6 % 2 == 1 { -0.0 } else { 0.0 };
        if seeded.below(3) == 0 {
            let b = (a + 1) % 3;
            origin[b] = side(seeded.below(2) == 1, b);
            dir[b] = -dir[a];
        }
        origin -= dir * (max - min).length() * seeded.unit();
        rays.push(ray(origin, dir));
    }
    rays
}

/// Rays that start inside a box, uniform in place and direction.
pub fn inside<R: Real>(seed: u64, world: &Aabb, count: usize) -> Vec<Ray<R>> {
    let mut seeded = Seeded::new(seed);
    let (min, max) = corners(world);
    (0..count).map(|_| ray(seeded.inside(min, max), seeded.direction())).collect()
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at: the middle of the picture.
    pub target: DVec3,
    /// What is up in the picture; not parallel to the line of sight.
    pub up: DVec3,
    /// The tangent of half the vertical angle of view.
    pub half_height: f64,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// A ray through the middle of each pixel, row by row from the top left.
pub fn primary<R: Real>(camera: &Pinhole) -> Vec<Ray<R>> {
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let (w, h) = (camera.width as f64, camera.height as f64);
    let pixel = camera.half_height * 2.0 / h;
    let through = |row: usize, column: usize| {
        let x = (column as f64 + 0.5 - w * 0.5) * pixel;
        let y = (h * 0.5 - row as f64 - 0.5) * pixel;
        ray(camera.eye, (forward + right * x + up * y).normalize())
    };
    (0..camera.height)
        .flat_map(|row| (0..camera.width).map(move |column| (row, column)))
        .map(|(row, column)| through(row, column))
        .collect()
}

/// `per` rays from each spot into the half-space of its normal, with the density of the cosine: a matt surface's.
pub fn diffuse<R: Real>(seed: u64, spots: &[Spot], per: usize) -> Vec<Ray<R>> {
    let mut seeded = Seeded::new(seed);
    let mut rays = Vec::with_capacity(spots.len() * per);
    for spot in spots {
        let normal = spot.normal.normalize();
        for _ in 0..per {
            // A point uniform on the sphere that touches the spot.
            let dir = loop {
                let dir = normal + seeded.direction();
                if dir.length_squared() > 1e-12 {
                    break dir.normalize();
                }
            };
            rays.push(ray(spot.point, dir));
        }
    }
    rays
}

/// [`diffuse`], as far as `radius`: what ambient occlusion asks.
pub fn ambient<R: Real>(seed: u64, spots: &[Spot], per: usize, radius: R) -> Vec<Ray<R>> {
    diffuse(seed, spots, per).into_iter().map(|ray: Ray<R>| ray.between(R::ZERO, radius)).collect()
}

/// From each point to the light, at `t = 1`, where the ray ends. The direction is not unit. Points at the light itself are
/// left out.
pub fn shadow<R: Real>(points: &[DVec3], light: DVec3) -> Vec<Ray<R>> {
    let rays = points.iter().map(|&point| ray::<R>(point, light - point));
    rays.map(|ray| ray.between(R::ZERO, R::nearest(1.0))).filter(Ray::is_valid).collect()
}

/// Rays that make trouble for any structure over these primitives: at `points`, such as corners and middles of edges; along axes
/// through them; in the faces of the box around all; through all of it, and from inside. Some two hundred.
pub fn troublesome<R: Real>(source: &dyn Bounded, points: &[DVec3]) -> Vec<Ray<R>> {
    let finite = |b: &Aabb| b.is_valid() && b.min.is_finite() && b.max.is_finite();
    let bounds = (0..source.prim_count() as u32).map(|prim| source.bound(prim)).filter(finite);
    let world = bounds.fold(Aabb::EMPTY, Aabb::union);
    if !world.is_valid() {
        return Vec::new();
    }
    let some: Vec<DVec3> =
        points.iter().copied().filter(|p| p.is_finite()).step_by(1 + points.len() / 24).collect();
    let mut all = uniform(1, &world, 60);
    all.extend(aimed(2, &world, &some, 2));
    all.extend(axis_parallel(&world, &some[..some.len().min(8)]));
    all.extend(in_faces(3, &world, 24));
    all.extend(inside(4, &world, 24));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact;
    use rt_geom::glam::Vec3A;

    fn world() -> Aabb {
        Aabb::new(Vec3A::new(-1.0, -2.0, 5.0), Vec3A::new(1.0, 3.0, 9.0))
    }

    #[test]
    fn a_convex_body_is_hit_by_its_share_of_the_surface() {
        let b = world();
        let count = 40_000;
        let hit = |ray: &Ray<f64>| {
            let (min, max) = (b.min.as_dvec3().to_array(), b.max.as_dvec3().to_array());
            exact::aabb(ray.origin.to_array(), ray.dir.to_array(), min, max).is_some()
        };
        let share = uniform(5, &b, count).iter().filter(|ray| hit(ray)).count() as f64 / count as f64;
        let radius = b.size().length() as f64 * 0.5;
        let expected = b.surface_area() as f64 / (4.0 * core::f64::consts::PI * radius * radius);
        assert!((share - expected).abs() < 0.01, "{share} {expected}");
    }

    fn aims<R: Real>() {
        let mut seeded = Seeded::new(11);
        let (min, max) = corners(&world());
        let points: Vec<DVec3> = (0..300)
            .map(|_| R::Vec3::nearest(seeded.inside(min, max)).widen())
            .chain([DVec3::ZERO])
            .collect();
        for (i, ray) in aimed::<R>(3, &world(), &points, 4).iter().enumerate() {
            let (o, d, p) = (ray.origin.widen(), ray.dir.widen(), points[i / 4]);
            assert!(ray.is_valid());
            // A point box: met exactly at 1.
            let span = exact::aabb(o.to_array(), d.to_array(), p.to_array(), p.to_array());
            assert!(span.is_some_and(|span| span.meets(1.0, 1.0)), "{o} {d} {p}");
        }
    }

    #[test]
    fn aimed_rays_pass_exactly_through_their_points() {
        aims::<f32>();
        aims::<f64>();
    }

    #[test]
    fn rays_in_faces_touch_the_box() {
        let b = world();
        for ray in in_faces::<f32>(2, &b, 300) {
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
            let zero = (0..3).filter(|a| d[*a] == 0.0);
            assert!(zero.clone().count() >= 1);
            for a in zero {
                assert!(o[a] == b.min[a] as f64 || o[a] == b.max[a] as f64);
            }
        }
    }

    #[test]
    fn pictures_and_surfaces() {
        let camera = Pinhole {
            eye: DVec3::ZERO,
            target: DVec3::Z * 4.0,
            up: DVec3::Y,
            half_height: 1.0,
            width: 4,
            height: 2,
        };
        let rays: Vec<Ray<f64>> = primary(&camera);
        assert_eq!(rays.len(), 8);
        assert!(rays[0].dir.y > 0.0 && rays[7].dir.y < 0.0 && rays[0].dir.x == -rays[3].dir.x);
        let spots = [Spot { point: DVec3::ONE, normal: DVec3::Y * 3.0 }];
        let mean = |rays: Vec<Ray<f64>>| rays.iter().map(|r| r.dir.y).sum::<f64>() / rays.len() as f64;
        // The mean of a cosine that is itself the density.
        assert!((mean(diffuse(1, &spots, 20_000)) - 2.0 / 3.0).abs() < 0.01);
        assert!(ambient(1, &spots, 9, 0.5f32).iter().all(|ray| ray.t_max == 0.5));
        let to_light: Vec<Ray> = shadow(&[DVec3::ZERO, DVec3::ONE], DVec3::ONE);
        assert_eq!(to_light, [Ray::new(Vec3A::ZERO, Vec3A::ONE).between(0.0, 1.0)]);
        assert_eq!(axis_parallel::<f32>(&world(), &[DVec3::ZERO]).len(), 6);
        assert!(uniform::<f32>(1, &Aabb::EMPTY, 3).iter().all(Ray::is_valid));
        assert!(inside::<f32>(1, &Aabb::INFINITE, 3).iter().all(Ray::is_valid));
    }

    #[test]
    fn the_numbers_are_the_same_everywhere() {
        let dir = Seeded::new(42).direction();
        assert_eq!(dir.to_array().map(f64::to_bits), DIRECTION_42);
    }

    const DIRECTION_42: [u64; 3] = [0x3fe0_5e40_8b60_f72f, 0xbfe7_0b4a_2952_516d, 0xbfde_00e4_cd5a_71fb];
}

//! [`Whitted`]: recursive rays, shot in waves.

use core::fmt;
use core::ops::AddAssign;
use rt_accel::{Counts, Hit};
use rt_geom::glam::{DVec3, Vec3};
use rt_geom::{Ray, Real, Vector};
use rt_scenes::{Light, Material};
use rt_shapes::{Shape, Surface};

/// How deep rays go: the eye ray is 1, what it spawns is 2.
const DEPTH: u32 = 5;

/// What a scene looks like, beside its shapes.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// The materials, by number. A number that is not there is the default one.
    pub materials: &'a [Material],
    /// The lights.
    pub lights: &'a [Light],
    /// The colour of rays that hit nothing.
    pub background: [f32; 3],
}

/// Which kinds of rays a scene needs; read from its [`Look`] once, so that the others are neither made, nor carried, nor
/// tested. `Display` lists what is left out, a line each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Plan {
    /// Rays to lights: left out without lights.
    pub shadow: bool,
    /// Mirrored rays: left out without mirrors or glass.
    pub reflection: bool,
    /// Transmitted rays: left out without glass.
    pub refraction: bool,
}

impl Plan {
    /// What `look` needs.
    pub fn of(look: &Look<'_>) -> Plan {
        Plan {
            shadow: !look.lights.is_empty(),
            reflection: look.materials.iter().any(reflects),
            refraction: look.materials.iter().any(refracts),
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = [
            (self.shadow, "shadow rays: the scene has no lights"),
            (self.reflection, "reflection rays: the scene has no mirrors and no glass"),
            (self.refraction, "refraction rays: the scene has no glass"),
        ];
        let mut left_out = all.iter().filter(|(kept, _)| !kept).map(|(_, why)| why).peekable();
        if left_out.peek().is_none() {
            return f.write_str("nothing: the scene needs every kind of ray");
        }
        while let Some(why) = left_out.next() {
            f.write_str(why)?;
            if left_out.peek().is_some() {
                f.write_str("\n")?;
            }
        }
        Ok(())
    }
}

/// Rays by kind. Equal for every structure, thread count and tile size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the camera.
    pub eye: u64,
    /// Eye rays that hit something.
    pub eye_hits: u64,
    /// Mirrored.
    pub reflection: u64,
    /// Transmitted.
    pub refraction: u64,
    /// Reflection and refraction rays that hit something.
    pub secondary_hits: u64,
    /// Towards lights.
    pub shadow: u64,
    /// Shadow rays that hit something.
    pub occluded: u64,
    /// Refraction rays not shot, because all light is reflected.
    pub total_internal: u64,
}

impl RayCounts {
    /// All rays shot.
    pub fn rays(&self) -> u64 {
        self.eye + self.reflection + self.refraction + self.shadow
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: RayCounts) {
        self.eye += other.eye;
        self.eye_hits += other.eye_hits;
        self.reflection += other.reflection;
        self.refraction += other.refraction;
        self.secondary_hits += other.secondary_hits;
        self.shadow += other.shadow;
        self.occluded += other.occluded;
        self.total_internal += other.total_internal;
    }
}

/// Recursive ray tracing by the rules of the Standard Procedural Databases, so that its ray counts compare with published
/// ones.
///
/// * Depth 5, the eye ray being 1; no ray is cut off for carrying little.
/// * Both sides of a surface are alike: normals are turned against the ray.
/// * A shadow ray goes to each light for which N.L > 0; anything on the way shades, glass too.
/// * Surfaces with `ks > 0` or `transmittance > 0` reflect; those with `transmittance > 0` refract by Snell's law, or reflect
///   all of it beyond the critical angle.
/// * A surface shows `color * kd * (ambient + N.L)`, a Phong highlight `ks (R.L)^shine`, `ks` of what it mirrors and
///   `transmittance` of what lies behind it. The light that comes from everywhere has the strength `sqrt(L) / (2 L)`, `L`
///   being the number of lights; without lights it is 1.
///
/// Which lights are asked follows the geometric normal; how bright they are, and where rays are mirrored and bent to, follows
/// the shading normal as long as those rays stay on their side of the surface.
///
/// A batch of eye rays is one wave; the rays it spawns are the next. Each wave is one call of `intersect_many` and one of
/// `intersect_p_many`, so that structures with many rays in flight can keep them in flight. A ray's colour is summed in an
/// order that does not depend on its neighbours in the batch.
///
/// Sources: Whitted, "An improved illumination model for shaded display", *CACM* 23(6), 1980; Haines, *Standard Procedural
/// Databases*, version 3.14.
#[derive(Clone, Copy, Debug)]
pub struct Whitted<'a, P: ?Sized, M> {
    shape: &'a P,
    material_of: M,
    look: Look<'a>,
    plan: Plan,
    ambient: f32,
    plain: Material,
}

fn reflects(material: &Material) -> bool {
    material.ks > 0.0 || material.transmittance > 0.0
}

fn refracts(material: &Material) -> bool {
    material.transmittance > 0.0
}

/// A ray's share in the colour of the eye ray it descends from.
#[derive(Clone, Copy)]
struct Path {
    sample: u32,
    weight: f32,
}

/// A light seen from a surface, if nothing is between.
struct Gleam {
    sample: u32,
    color: Vec3,
}

/// Rays and what they are for.
struct Wave<R: Real, T> {
    rays: Vec<Ray<R>>,
    paths: Vec<T>,
}

impl<R: Real, T> Wave<R, T> {
    fn new() -> Wave<R, T> {
        Wave { rays: Vec::new(), paths: Vec::new() }
    }

    fn push(&mut self, ray: Ray<R>, path: T) {
        self.rays.push(ray);
        self.paths.push(path);
    }

    fn clear(&mut self) {
        self.rays.clear();
        self.paths.clear();
    }
}

impl<'a, P: ?Sized, M> Whitted<'a, P, M> {
    /// A renderer of `shape`, which looks like `look`, with the number of the material at a hit told by `material_of`.
    pub fn new(shape: &'a P, material_of: M, look: Look<'a>) -> Self {
        let lights = look.lights.len() as f32;
        let ambient = if look.lights.is_empty() { 1.0 } else { lights.sqrt() / (2.0 * lights) };
        Whitted { shape, material_of, look, plan: Plan::of(&look), ambient, plain: Material::default() }
    }

    /// The kinds of rays it shoots.
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// The colour seen along each eye ray, and the rays that took.
    pub fn colors<R: Real>(&self, eyes: Vec<Ray<R>>) -> (Vec<[f32; 3]>, RayCounts)
    where
        P: Shape<R>,
        M: Fn(&P::At) -> u32,
    {
        self.trace(
            eyes,
            |rays, hits| self.shape.intersect_many(rays, hits),
            |rays, dark| {
                self.shape.intersect_p_many(rays, dark);
            },
        )
    }

    /// [`Whitted::colors`], one ray after another, with the work of all its queries.
    pub fn colors_counted<R: Real>(&self, eyes: Vec<Ray<R>>) -> (Vec<[f32; 3]>, RayCounts, Counts)
    where
        P: Shape<R>,
        M: Fn(&P::At) -> u32,
    {
        let (mut closest, mut any) = (Counts::default(), Counts::default());
        let (colors, rays) = self.trace(
            eyes,
            |rays, hits| {
                for (hit, ray) in hits.iter_mut().zip(rays) {
                    *hit = self.shape.intersect_counted(ray, &mut closest);
                }
            },
            |rays, dark| {
                for (dark, ray) in dark.iter_mut().zip(rays) {
                    *dark = self.shape.intersect_p_counted(ray, &mut any);
                }
            },
        );
        (colors, rays, closest + any)
    }

    fn trace<R: Real>(
        &self,
        eyes: Vec<Ray<R>>,
        mut closest: impl FnMut(&[Ray<R>], &mut [Option<Hit<P::At, R>>]),
        mut any: impl FnMut(&[Ray<R>], &mut [bool]),
    ) -> (Vec<[f32; 3]>, RayCounts)
    where
        P: Shape<R>,
        M: Fn(&P::At) -> u32,
    {
        let mut colors = vec![Vec3::ZERO; eyes.len()];
        let mut counts = RayCounts { eye: eyes.len() as u64, ..RayCounts::default() };
        let paths = (0..eyes.len() as u32).map(|sample| Path { sample, weight: 1.0 }).collect();
        let mut wave = Wave { rays: eyes, paths };
        let mut next = Wave::new();
        let mut shadow = Wave::new();
        let (mut hits, mut dark) = (Vec::new(), Vec::new());
        for depth in 1..=DEPTH {
            hits.clear();
            hits.resize(wave.rays.len(), None);
            closest(&wave.rays, &mut hits);
            for ((ray, path), hit) in wave.rays.iter().zip(&wave.paths).zip(&hits) {
                let Some(hit) = hit else {
                    colors[path.sample as usize] += Vec3::from(self.look.background) * path.weight;
                    continue;
                };
                if depth == 1 {
                    counts.eye_hits += 1;
                } else {
                    counts.secondary_hits += 1;
                }
                let surface = self.shape.surface(ray, hit);
                let number = (self.material_of)(&hit.at) as usize;
                let material = self.look.materials.get(number).unwrap_or(&self.plain);
                let spot = Spot::new(ray, hit.t, surface, material);
                colors[path.sample as usize] += spot.ambient() * (path.weight * self.ambient);
                if self.plan.shadow {
                    self.lights(&spot, path, &mut shadow);
                }
                if depth < DEPTH {
                    self.spawn(&spot, path, &mut next, &mut counts);
                }
            }
            counts.shadow += shadow.rays.len() as u64;
            dark.clear();
            dark.resize(shadow.rays.len(), false);
            any(&shadow.rays, &mut dark);
            for (gleam, &dark) in shadow.paths.iter().zip(&dark) {
                if dark {
                    counts.occluded += 1;
                } else {
                    colors[gleam.sample as usize] += gleam.color;
                }
            }
            shadow.clear();
            core::mem::swap(&mut wave, &mut next);
            next.clear();
            if wave.rays.is_empty() {
                break;
            }
        }
        (colors.iter().map(Vec3::to_array).collect(), counts)
    }

    /// Shadow rays, with what they bring if they arrive.
    fn lights<R: Real>(&self, spot: &Spot<'_>, path: &Path, shadow: &mut Wave<R, Gleam>) {
        for light in self.look.lights {
            let to_light = light.position - spot.before.point;
            // Also false for a light that is not a number.
            if to_light.dot(spot.normal) > 0.0 {
                let brought = spot.lit_from(to_light.normalize_or_zero());
                let color = brought * Vec3::from(light.color) * path.weight;
                shadow.push(spot.before.spawn_to(light.position), Gleam { sample: path.sample, color });
            }
        }
    }

    /// The reflected and the refracted ray.
    fn spawn<R: Real>(&self, spot: &Spot<'_>, path: &Path, next: &mut Wave<R, Path>, counts: &mut RayCounts) {
        let Spot { material, .. } = spot;
        let mut mirrored = material.ks;
        let mut through = None;
        if self.plan.refraction && refracts(material) {
            through = spot.refracted();
            if through.is_none() {
                counts.total_internal += 1;
                mirrored += material.transmittance;
            }
        }
        if self.plan.reflection && reflects(material) {
            counts.reflection += 1;
            let ray = spot.before.spawn(R::Vec3::nearest(spot.mirrored));
            next.push(ray, Path { weight: path.weight * mirrored, ..*path });
        }
        if let Some(dir) = through {
            counts.refraction += 1;
            let ray = spot.surface.spawn(R::Vec3::nearest(dir));
            next.push(ray, Path { weight: path.weight * material.transmittance, ..*path });
        }
    }
}

/// A hit, ready to be shaded.
struct Spot<'a> {
    surface: Surface,
    /// The surface as rays leave it that stay on this side: a unit in the last place of `t` before the hit.
    ///
    /// Surfaces that the ray meets at distances which round to the same `t` are not told apart by it: the one that was hit, by its
    /// lower number, may lie up to half a unit behind the exact hit of another, and a ray that left the surface itself would begin
    /// behind that other one. Before this place there is nothing: there would have been a closer hit.
    before: Surface,
    material: &'a Material,
    /// The ray's unit direction.
    dir: DVec3,
    /// The geometric normal, turned against the ray.
    normal: DVec3,
    /// The shading normal, on the same side.
    shading: DVec3,
    /// The mirrored direction, on the side of `normal`.
    mirrored: DVec3,
}

/// A unit in the last place.
fn unit<R: Real>(t: R) -> f64 {
    t.next_up().into() - t.into()
}

impl<'a> Spot<'a> {
    fn new<R: Real>(ray: &Ray<R>, t: R, surface: Surface, material: &'a Material) -> Spot<'a> {
        let dir = ray.dir.widen().normalize_or_zero();
        let against = |n: DVec3, side: bool| if side { -n } else { n };
        let inside = dir.dot(surface.normal) > 0.0;
        let (normal, shading) = (against(surface.normal, inside), against(surface.shading, inside));
        let mirror = |n: DVec3| dir - n * (2.0 * dir.dot(n));
        let smooth = mirror(shading);
        let mirrored = if smooth.dot(normal) > 0.0 { smooth } else { mirror(normal) };
        let point = surface.point - ray.dir.widen() * unit(t);
        let before = if point.is_finite() { Surface { point, ..surface } } else { surface };
        Spot { surface, before, material, dir, normal, shading, mirrored }
    }

    fn ambient(&self) -> Vec3 {
        Vec3::from(self.material.color) * self.material.kd
    }

    /// What a light of unit intensity in this unit direction adds.
    fn lit_from(&self, to_light: DVec3) -> Vec3 {
        let Material { color, kd, ks, shine, .. } = *self.material;
        let diffuse = (to_light.dot(self.shading) as f32).max(0.0);
        let along = (to_light.dot(self.mirrored) as f32).clamp(0.0, 1.0);
        let highlight = if ks > 0.0 && along > 0.0 { ks * along.powf(shine) } else { 0.0 };
        Vec3::from(color) * (kd * diffuse) + Vec3::splat(highlight)
    }

    /// The refracted direction, if light gets through. The orientation of the surface says which side is the material.
    fn refracted(&self) -> Option<DVec3> {
        let ior = f64::from(self.material.ior);
        let inside = self.dir.dot(self.surface.normal) > 0.0;
        let eta = if inside { ior } else { 1.0 / ior };
        let bend = |n: DVec3| {
            let cos = -self.dir.dot(n);
            let cos2 = 1.0 - eta * eta * (1.0 - cos * cos);
            (cos2 >= 0.0).then(|| self.dir * eta + n * (eta * cos - cos2.sqrt()))
        };
        // A smooth normal may bend the ray back to where it came from.
        let smooth = bend(self.shading)?;
        if smooth.dot(self.normal) < 0.0 { Some(smooth) } else { bend(self.normal) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Film, ungoverned};
    use rt_accel::{Aggregate, Exhaustive, Member};
    use rt_shapes::{Sphere, Uv};

    type Balls = Aggregate<Exhaustive, Vec<Sphere>>;

    fn balls() -> Balls {
        let ball = |x, r| Sphere::new(DVec3::new(x, 0.0, 0.0), r).unwrap();
        Aggregate::build(vec![ball(0.0, 1.0), ball(2.5, 1.0)], &()).unwrap()
    }

    const GLASS: Material =
        Material { color: [1.0; 3], kd: 0.0, ks: 0.0, shine: 1.0, transmittance: 1.0, ior: 1.5 };
    const CHALK: Material = Material { kd: 1.0, transmittance: 0.0, ior: 1.0, ..GLASS };
    const MIRROR: Material = Material { kd: 0.0, ks: 1.0, ..CHALK };

    fn look<'a>(materials: &'a [Material], lights: &'a [Light]) -> Look<'a> {
        Look { materials, lights, background: [0.25, 0.5, 0.75] }
    }

    fn number(at: &Member<Uv>) -> u32 {
        at.prim
    }

    #[test]
    fn a_mirror_shows_what_is_behind_the_eye() {
        let scene = balls();
        let materials = [CHALK, MIRROR];
        let whitted = Whitted::new(&scene, number, look(&materials, &[]));
        // From between the balls at the mirror; back past the eye to the chalk.
        let (colors, rays) = whitted.colors(vec![Ray::new(DVec3::new(1.2, 0.0, 0.0), DVec3::X)]);
        assert_eq!(colors, [[1.0; 3]]);
        let expected =
            RayCounts { eye: 1, eye_hits: 1, reflection: 1, secondary_hits: 1, ..RayCounts::default() };
        assert_eq!(rays, expected);
    }

    #[test]
    fn light_falls_and_shade_too() {
        let scene = balls();
        let materials = [CHALK, CHALK];
        let lights = |x: f64| [Light { position: DVec3::new(x, 0.0, 0.0), color: [0.5; 3] }];
        let down = |lights: &[Light]| {
            let whitted = Whitted::new(&scene, number, look(&materials, lights));
            whitted.colors(vec![Ray::new(DVec3::new(-5.0, 0.0, 0.0), DVec3::X)])
        };
        let (colors, rays) = down(&lights(-9.0));
        assert_eq!((colors[0], rays.shadow, rays.occluded), ([1.0; 3], 1, 0));
        let (colors, rays) = down(&lights(9.0));
        assert_eq!((colors[0], rays.shadow), ([0.5; 3], 0));
        // Seen from the side, lit through the other ball.
        let whitted = Whitted::new(&scene, number, look(&materials, &[]));
        assert_eq!(whitted.plan(), Plan { shadow: false, reflection: false, refraction: false });
        let lights = lights(9.0);
        let whitted = Whitted::new(&scene, number, look(&materials, &lights));
        let (_, rays) = whitted.colors(vec![Ray::new(DVec3::new(0.5, -5.0, 0.0), DVec3::Y)]);
        assert_eq!((rays.shadow, rays.occluded), (1, 1));
    }

    #[test]
    fn glass_lets_the_middle_through_and_mirrors_the_rest_inside() {
        let scene = balls();
        let materials = [GLASS, GLASS];
        let whitted = Whitted::new(&scene, number, look(&materials, &[]));
        // Straight through both balls; each of four surfaces also reflects, down to depth 5.
        let (colors, rays) = whitted.colors(vec![Ray::new(DVec3::new(-5.0, 0.0, 0.0), DVec3::X)]);
        assert_eq!(rays.refraction, rays.reflection);
        assert_eq!(colors[0], [0.25, 0.5, 0.75]);
        // From inside, nearly along the surface.
        let (colors, rays) = whitted.colors(vec![Ray::new(DVec3::new(-0.95, 0.0, 0.0), DVec3::Y)]);
        assert_eq!((rays.refraction, rays.total_internal), (0, 4));
        assert_eq!(colors[0], [0.0; 3]);
    }

    #[test]
    fn counted_rays_and_batches_of_any_size_see_the_same() {
        let scene = balls();
        let materials = [Material { ks: 0.3, kd: 0.4, ..GLASS }, MIRROR];
        let lights = [Light { position: DVec3::new(3.0, 5.0, 4.0), color: [0.5; 3] }];
        let whitted = Whitted::new(&scene, number, look(&materials, &lights));
        let eyes: Vec<Ray> = (0..400)
            .map(|i| {
                let (x, z) = ((i % 20) as f32 * 0.25 - 1.5, (i / 20) as f32 * 0.1 - 1.0);
                Ray::new(rt_geom::glam::Vec3A::new(x, -4.0, z), rt_geom::glam::Vec3A::new(0.02, 1.0, 0.01))
            })
            .collect();
        let (all, rays) = whitted.colors(eyes.clone());
        assert!(rays.occluded > 0 && rays.refraction > 100, "{rays:?}");
        for size in [1, 7, 64] {
            let mut sum = RayCounts::default();
            let mut parts = Vec::new();
            for part in eyes.chunks(size) {
                let (colors, rays) = whitted.colors(part.to_vec());
                parts.extend(colors);
                sum += rays;
            }
            assert_eq!((&parts, sum), (&all, rays));
        }
        let (colors, again, work) = whitted.colors_counted(eyes);
        assert_eq!((colors, again), (all, rays));
        assert_eq!(work.nodes, rays.rays());
    }

    #[test]
    fn what_is_left_out_is_said() {
        let plan = Plan::of(&look(&[CHALK], &[]));
        assert_eq!(plan.to_string().lines().count(), 3);
        let lights = [Light { position: DVec3::Z, color: [1.0; 3] }];
        assert!(Plan::of(&look(&[GLASS], &lights)).to_string().starts_with("nothing"));
        assert!(Plan::of(&look(&[MIRROR], &lights)).to_string().starts_with("refraction"));
    }

    #[test]
    fn nonsense_neither_panics_nor_hangs() {
        let scene = balls();
        let nan = Material {
            ks: f32::NAN,
            kd: f32::NAN,
            ior: 0.0,
            shine: -1.0,
            transmittance: f32::INFINITY,
            ..GLASS
        };
        let lights = [Light { position: DVec3::NAN, color: [f32::NAN; 3] }];
        let materials = [nan];
        let whitted = Whitted::new(&scene, number, look(&materials, &lights));
        let ray = Ray::new(DVec3::new(-5.0, 0.1, 0.0), DVec3::X);
        let (colors, _) = whitted.colors(vec![ray, Ray { dir: DVec3::NAN, ..ray }]);
        assert_eq!(colors[1], [0.25, 0.5, 0.75]);
    }

    /// Spheres that cross at such small angles that many are met at one distance in f32: a ray that left the one of the lowest
    /// number would begin inside another.
    #[test]
    fn what_the_eye_sees_is_lit_from_the_eye() {
        for distance in [4.0, 64.0, 8192.0] {
            let ball = |i: i32| Sphere::new(DVec3::X * (f64::from(i) * 1e-3), 1.0).unwrap();
            let row = Balls::build((0..40).map(ball).collect(), &()).unwrap();
            let from = DVec3::new(-0.625, 0.5, 0.625) * distance;
            let lights = [Light { position: from, color: [1.0; 3] }];
            let look = Look { materials: &[], lights: &lights, background: [0.0; 3] };
            let whitted = Whitted::new(&row, |_: &Member<Uv>| 0, look);
            let view = rt_scenes::View { from, at: DVec3::ZERO, up: DVec3::Z, angle: 2.4 / distance };
            let camera = Camera::new(&view).unwrap();
            let film = Film::new(64, 64);
            let counts = [
                film.render::<f32, _, _>(&camera, &whitted, &ungoverned).unwrap().1,
                film.render::<f64, _, _>(&camera, &whitted, &ungoverned).unwrap().1,
            ];
            for counts in counts {
                assert!(counts.shadow > 1000 && counts.occluded == 0, "{distance}: {counts:?}");
            }
        }
    }
}

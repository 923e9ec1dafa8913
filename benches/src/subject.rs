//! [`Subject`]: a scene to be measured on, and the rays that are shot at it.

use crate::{Effort, Trouble};
use rt_accel::{Aggregate, Bounded, Hit, WorldBound};
use rt_bounds::Aabb;
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_geom::glam::DVec3;
use rt_measure::rays::{self, Pinhole, Seeded};
use rt_scenes::{Scene, SceneError, SceneGeometry, Solid, View, soup};
use rt_shapes::{Shape, Surface, Surfaced, TriangleMesh};

/// What there is to hit.
#[derive(Clone, Debug)]
pub enum Prims {
    /// Triangles.
    Mesh(TriangleMesh),
    /// Spheres and polygons.
    Solids(Vec<Solid>),
}

impl Prims {
    /// How many there are.
    pub fn count(&self) -> usize {
        match self {
            Prims::Mesh(mesh) => mesh.prim_count(),
            Prims::Solids(solids) => solids.len(),
        }
    }
}

/// A scene to be measured on.
///
/// ```
/// let subject = rt_bench::Subject::named("soup-1000")?;
/// assert_eq!((subject.name.as_str(), subject.prims.count()), ("soup-1000", 1000));
/// # Ok::<(), rt_bench::Trouble>(())
/// ```
#[derive(Clone, Debug)]
pub struct Subject {
    /// What it is called in records.
    pub name: String,
    /// What there is to hit.
    pub prims: Prims,
    view: View,
    light: DVec3,
    /// A set has so many times fewer rays, because each costs so much more.
    thin: usize,
}

impl Subject {
    /// A scene by its name, with its size after a hyphen, as in `soup-100000`; without one, in its default size. `blob` is
    /// a mesh made here: see [`Subject::blob`].
    ///
    /// # Errors
    ///
    /// When there is no such scene, or not in this size, or only rays of `f64` can see it.
    pub fn named(name: &str) -> Result<Subject, Trouble> {
        if name == "blob" {
            return Ok(Subject::blob());
        }
        let (scene, size) = split_size(name);
        let made = rt_scenes::by_name(scene, size).map_err(|error| {
            Trouble::Scene(match error {
                SceneError::Unknown { .. } => format!("{error}, blob"),
                error => error.to_string(),
            })
        })?;
        Subject::new(name, made)
    }

    /// A scene under a name.
    ///
    /// # Errors
    ///
    /// When only rays of `f64` can see it.
    pub fn new(name: &str, scene: Scene) -> Result<Subject, Trouble> {
        let prims = match scene.geometry {
            SceneGeometry::Mesh(mesh) => Prims::Mesh(mesh),
            SceneGeometry::Solids(solids) => Prims::Solids(solids),
            SceneGeometry::FineMesh(_) => {
                let why = format!("{name}: the triangles of this scene cannot be told apart in f32");
                return Err(Trouble::Scene(why));
            }
        };
        let light = scene.lights.first().map_or(scene.view.from, |light| light.position);
        // Needles: hundreds of boxes a ray.
        let thin = if ["sticks", "needles"].iter().any(|slow| scene.name.starts_with(slow)) { 16 } else { 1 };
        Ok(Subject { name: name.to_string(), prims, view: scene.view, light, thin })
    }

    /// A torus of 69 696 triangles with smooth bumps: even and closed, as scanned meshes are, and the same everywhere.
    pub fn blob() -> Subject {
        let mut mesh = soup::torus(264, 132, 0.45);
        for vertex in mesh.vertices_mut() {
            let v = vertex.map(|x| x as f64 / 1.5);
            let bump =
                chebyshev(v[0], 7) * chebyshev(v[1], 6) + chebyshev(v[2], 5) * chebyshev(v[0] * v[1], 4);
            *vertex = vertex.map(|x| (x as f64 * (1.0 + 0.06 * bump)) as f32);
        }
        let view = View::framing(&bound(&mesh));
        let light = view.at + (view.from - view.at) * 1.5 + view.up * (view.from - view.at).length();
        Subject { name: "blob".into(), prims: Prims::Mesh(mesh), view, light, thin: 1 }
    }

    /// Sets of about `count` rays. Kinds that there are no rays of, because nothing is hit to start from, are left out.
    ///
    /// # Errors
    ///
    /// When no structure can be built over the scene.
    pub fn rays(&self, kinds: &[RayKind], count: usize) -> Result<Vec<RaySet>, Trouble> {
        let count = (count / self.thin).max(1);
        match &self.prims {
            Prims::Mesh(mesh) => {
                let points: Vec<DVec3> =
                    mesh.vertices().iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
                self.rays_of(mesh.clone(), &points, kinds, count)
            }
            Prims::Solids(solids) => self.rays_of(solids.clone(), &[], kinds, count),
        }
    }

    fn rays_of<G: Surfaced<f32> + Bounded>(
        &self,
        geometry: G,
        points: &[DVec3],
        kinds: &[RayKind],
        count: usize,
    ) -> Result<Vec<RaySet>, Trouble> {
        let scene = Aggregate::<Bvh, G>::build(geometry, &BvhParams::default())?;
        let world = scene.world_bound();
        let radius = world.size().length() * 0.5;
        let primary = self.primary(count);
        let lit = Spots::of(&scene, &primary);
        let bounced = Spots::of(&scene, &rays::uniform(1, &world, count));
        let mut sets = Vec::new();
        for &kind in kinds {
            let mut seeded = Seeded::new(7);
            let rays: Vec<Ray> = match kind {
                RayKind::Primary => primary.clone(),
                RayKind::Chords => rays::uniform(2, &world, count),
                RayKind::Diffuse => bounced.spawn(&mut seeded, count),
                RayKind::Ambient => {
                    let short = |ray: Ray| ray.between(0.0, radius * 0.2);
                    bounced.spawn(&mut seeded, count).into_iter().map(short).collect()
                }
                RayKind::Shadow => {
                    let size = DVec3::splat(radius as f64 * 0.1);
                    lit.0
                        .iter()
                        .map(|s| s.spawn_to(self.light + seeded.inside(-size, size)))
                        .filter(Ray::is_valid)
                        .collect()
                }
                RayKind::Aimed => {
                    let some: Vec<DVec3> = (0..count)
                        .filter_map(|_| seeded.choose(points).copied())
                        .filter(|p| p.is_finite())
                        .collect();
                    rays::aimed(3, &world, &some, 1)
                }
            };
            if !rays.is_empty() {
                sets.push(RaySet::new(kind, rays));
            }
        }
        Ok(sets)
    }

    fn primary(&self, count: usize) -> Vec<Ray> {
        let side = (count as f64).sqrt() as usize;
        rays::primary(&Pinhole {
            eye: self.view.from,
            target: self.view.at,
            up: self.view.up,
            half_height: (self.view.angle * 0.5).tan(),
            width: side,
            height: side,
        })
    }
}

/// A scene's name and the size behind its hyphen.
pub(crate) fn split_size(name: &str) -> (&str, Option<u32>) {
    match name.rsplit_once('-').map(|(scene, size)| (scene, size.parse::<u32>())) {
        Some((scene, Ok(size))) => (scene, Some(size)),
        _ => (name, None),
    }
}

/// Each question's own scenes: a scan's like, a soup, Haines' balls and tetrahedra, a teapot in a stadium, needles.
pub(crate) fn own(effort: Effort) -> Result<Vec<Subject>, Trouble> {
    let names: &[&str] = match effort {
        Effort::Quick | Effort::Normal => {
            &["blob", "soup-100000", "balls-4", "tetra-8", "stadium-12", "sticks-10000"]
        }
        Effort::Full => &[
            "blob",
            "soup-100000",
            "soup-1000000",
            "balls-4",
            "balls-6",
            "tetra-8",
            "tetra-10",
            "stadium-12",
            "stadium-100",
            "sticks-10000",
            "sticks-100000",
        ],
    };
    names.iter().map(|name| Subject::named(name)).collect()
}

/// A box around all valid primitives.
fn bound(prims: &impl Bounded) -> Aabb {
    let bounds = (0..prims.prim_count() as u32).map(|prim| prims.bound(prim));
    bounds.filter(|b| b.is_valid()).fold(Aabb::EMPTY, Aabb::union)
}

/// The Chebyshev polynomial of degree `n`: waves without a transcendental function.
fn chebyshev(x: f64, n: usize) -> f64 {
    let (mut last, mut this) = (1.0, x);
    for _ in 1..n {
        (last, this) = (this, 2.0 * x * this - last);
    }
    if n == 0 { last } else { this }
}

/// Where rays have hit, seen from their side.
struct Spots(Vec<Surface>);

impl Spots {
    fn of<P: Shape<f32>>(scene: &P, rays: &[Ray]) -> Spots {
        let spot = |ray: &Ray| {
            let hit: Hit<P::At> = scene.intersect(ray)?;
            let surface = scene.surface(ray, &hit);
            let away = surface.normal.dot(ray.dir.as_dvec3()) > 0.0;
            Some(Surface { normal: if away { -surface.normal } else { surface.normal }, ..surface })
        };
        Spots(rays.iter().filter_map(spot).filter(|s| s.normal.length_squared() > 0.5).collect())
    }

    /// `count` rays into the half-spaces of the normals, with the density of the cosine; none if there are no spots.
    fn spawn(&self, seeded: &mut Seeded, count: usize) -> Vec<Ray> {
        let towards = |surface: &Surface| loop {
            let dir = surface.normal + seeded.direction();
            if dir.length_squared() > 1e-12 {
                break surface.spawn(dir.normalize().as_vec3a());
            }
        };
        self.0.iter().cycle().take(if self.0.is_empty() { 0 } else { count }).map(towards).collect()
    }
}

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// Through the pixels of a picture, row by row.
    Primary,
    /// Uniform among all lines through a sphere around the scene, in no order.
    Chords,
    /// Off the surfaces that chords meet, by the cosine, in no order.
    Diffuse,
    /// From around the scene exactly at vertices of a mesh.
    Aimed,
    /// As diffuse, a fifth of the scene's radius long; any hit.
    Ambient,
    /// From what the eye sees to a light of a tenth of the scene's radius; any hit.
    Shadow,
}

impl RayKind {
    /// The word in records.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Primary => "primary",
            RayKind::Chords => "chords",
            RayKind::Diffuse => "diffuse",
            RayKind::Aimed => "aimed",
            RayKind::Ambient => "ao",
            RayKind::Shadow => "shadow",
        }
    }

    /// Whether any hit will do.
    pub fn is_any(self) -> bool {
        matches!(self, RayKind::Ambient | RayKind::Shadow)
    }
}

/// Rays of one kind, in both precisions: the same rays.
#[derive(Clone, Debug)]
pub struct RaySet {
    /// The kind.
    pub kind: RayKind,
    /// The rays.
    pub rays: Vec<Ray>,
    /// The same rays, widened.
    pub wide: Vec<Ray<f64>>,
}

impl RaySet {
    /// A set of rays.
    pub fn new(kind: RayKind, rays: Vec<Ray>) -> RaySet {
        let wide = rays.iter().map(Ray::widen).collect();
        RaySet { kind, rays, wide }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_ray_starts_somewhere() {
        let kinds = [
            RayKind::Primary,
            RayKind::Chords,
            RayKind::Diffuse,
            RayKind::Aimed,
            RayKind::Ambient,
            RayKind::Shadow,
        ];
        let sets = Subject::named("tetra-4").unwrap().rays(&kinds, 256).unwrap();
        assert_eq!(sets.iter().map(|set| set.kind).collect::<Vec<_>>(), kinds);
        for set in &sets {
            assert!(set.rays.iter().all(Ray::is_valid) && set.rays.len() == set.wide.len(), "{:?}", set.kind);
            assert!(set.rays.len() > 20 && set.rays.len() <= 256, "{:?}: {}", set.kind, set.rays.len());
        }
        assert!(Subject::named("rubble-10").is_err() && Subject::named("bunny").is_err());
        assert!(Subject::named("soup-0").unwrap().rays(&[RayKind::Diffuse], 16).unwrap().is_empty());
    }

    #[test]
    fn the_blob_is_even_and_bumpy() {
        let Subject { prims: Prims::Mesh(mesh), .. } = Subject::blob() else { panic!() };
        assert_eq!((mesh.triangles().len(), mesh.degenerate()), (69_696, 0));
        let size = bound(&mesh).size();
        assert!(size.x > 2.5 && size.x < 4.0 && size.min_element() > 0.2, "{size}");
    }
}

//! [`Scene`]: shapes, looks, lights, a view.

use crate::{Solid, fine, gallery, interior, soup, spd, stadium, terrain};
use core::fmt;
use rt_accel::{Bounded, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_shapes::TriangleMesh;

/// A scene: shapes, looks, lights, a view.
///
/// See the [crate](crate) for an example.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// What it is called.
    pub name: String,
    /// What there is to hit.
    pub geometry: SceneGeometry,
    /// The looks, by number.
    pub materials: Vec<Material>,
    /// Material number of each primitive (triangle or solid); empty: all number 0.
    pub material_of: Vec<u32>,
    /// The lights, points all.
    pub lights: Vec<Light>,
    /// Where it is seen from.
    pub view: View,
    /// What rays see that hit nothing, red, green, blue.
    pub background: [f32; 3],
    /// What a reader of the file it came from should know, in sentences; empty for scenes made here.
    pub warnings: Vec<String>,
}

impl Scene {
    /// How many primitives there are, triangles or solids.
    pub fn prim_count(&self) -> usize {
        match &self.geometry {
            SceneGeometry::Mesh(mesh) => mesh.triangles().len(),
            SceneGeometry::FineMesh(mesh) => mesh.triangles().len(),
            SceneGeometry::Solids(solids) => solids.len(),
        }
    }

    /// A box around all primitives that have a valid one, rounded outward; empty when there are none. `O(n)`.
    pub fn world_bound(&self) -> Aabb {
        match &self.geometry {
            SceneGeometry::Mesh(mesh) => bound(mesh),
            SceneGeometry::FineMesh(mesh) => bound(mesh),
            SceneGeometry::Solids(solids) => {
                solids.iter().fold(Aabb::EMPTY, |b, solid| b.union(solid.world_bound()))
            }
        }
    }

    /// The look of primitive `prim`; the [default](Material::default) one where none is given.
    pub fn material(&self, prim: u32) -> Material {
        let number = self.material_of.get(prim as usize).copied().unwrap_or(0);
        self.materials.get(number as usize).copied().unwrap_or_default()
    }
}

/// A box around the valid primitives.
pub(crate) fn bound(prims: &impl Bounded) -> Aabb {
    (0..prims.prim_count() as u32)
        .map(|prim| prims.bound(prim))
        .filter(|b| b.is_valid())
        .fold(Aabb::EMPTY, Aabb::union)
}

/// What there is to hit in a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneGeometry {
    /// Triangles.
    Mesh(TriangleMesh),
    /// Triangles too small for their distance from zero to be told apart in `f32`; they answer `f64` rays.
    FineMesh(TriangleMesh<f64>),
    /// Solids of all kinds.
    Solids(Vec<Solid>),
}

/// How a surface looks: the numbers of an NFF file's `f` line.
///
/// Source: Haines, *Neutral File Format* 3.1, in the Standard Procedural Databases.
///
/// ```
/// use rt_scenes::Material;
/// let glass = Material { kd: 0.0, ks: 0.1, transmittance: 0.9, ior: 1.5, ..Material::default() };
/// assert!(glass.ks > 0.0 || glass.transmittance > 0.0); // rays are reflected
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Red, green, blue, each in `[0, 1]`.
    pub color: [f32; 3],
    /// Share of light scattered evenly.
    pub kd: f32,
    /// Share of light mirrored; also the strength of highlights.
    pub ks: f32,
    /// Phong power of highlights; 100000 and more stand for none.
    pub shine: f32,
    /// Share of light let through.
    pub transmittance: f32,
    /// Index of refraction, above 0; matters where light is let through.
    pub ior: f32,
}

/// A light grey that mirrors nothing.
impl Default for Material {
    fn default() -> Material {
        Material { color: [0.8; 3], kd: 1.0, ks: 0.0, shine: 100_000.0, transmittance: 0.0, ior: 1.0 }
    }
}

/// A point light. Its strength does not fall off with distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where it is, in world space.
    pub position: DVec3,
    /// Red, green, blue; white at full strength is 1 each.
    pub color: [f32; 3],
}

impl Light {
    /// White lights at `positions`, each of the strength `sqrt(n) / (2 n)` that SPD suggests for `n` lights and for the light
    /// that comes from everywhere.
    pub fn shared(positions: &[[f64; 3]]) -> Vec<Light> {
        let n = positions.len() as f32;
        positions
            .iter()
            .map(|&p| Light { position: DVec3::from_array(p), color: [n.sqrt() / (2.0 * n); 3] })
            .collect()
    }
}

/// Where a scene is seen from: the pinhole camera of an NFF file, of a square picture.
///
/// ```
/// use rt_bounds::Aabb;
/// use rt_geom::glam::Vec3A;
/// use rt_scenes::View;
/// let view = View::framing(&Aabb::new(Vec3A::ZERO, Vec3A::splat(2.0)));
/// assert_eq!(view.at.to_array(), [1.0; 3]);
/// assert!(view.from.min_element() > 2.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The eye.
    pub from: DVec3,
    /// A point in the middle of the picture.
    pub at: DVec3,
    /// What is up in the picture; of any length, not along the line of sight.
    pub up: DVec3,
    /// The full field of view, in radians, across and down alike; above 0, below pi.
    pub angle: f64,
}

impl View {
    /// A three-quarter view from above in which the whole box is visible, with some room around it.
    ///
    /// Up is y, as in most mesh files, unless the box lies flat in z: less than a quarter as high as it is long and wide. A
    /// box that is not finite, or empty, is seen as the unit cube would be; a point as if it had the size of its distance
    /// from zero.
    pub fn framing(bound: &Aabb) -> View {
        let usable = bound.is_valid() && bound.min.is_finite() && bound.max.is_finite();
        let (min, max) = if usable {
            (bound.min.as_dvec3(), bound.max.as_dvec3())
        } else {
            (DVec3::splat(-0.5), DVec3::splat(0.5))
        };
        let at = min * 0.5 + max * 0.5;
        let mut half = (max - min) * 0.5;
        if half == DVec3::ZERO {
            let far = at.abs().max_element();
            half = DVec3::splat(if far > 0.0 { far } else { 1.0 });
        }
        let flat = 4.0 * half.z < half.x && 4.0 * half.z < half.y;
        let (toward, up) = if flat {
            (DVec3::new(0.55, -0.75, 0.6), DVec3::Z)
        } else {
            (DVec3::new(0.55, 0.45, 0.8), DVec3::Y)
        };
        let toward = toward.normalize();
        let right = up.cross(toward).normalize();
        let over = toward.cross(right);
        let angle = std::f64::consts::FRAC_PI_4;
        // sqrt(2) - 1, the tangent of half the angle.
        let tan = std::f64::consts::SQRT_2 - 1.0;
        // Each corner asks for a distance from which it is seen; a tenth is left for room.
        let mut distance = 0.0f64;
        for corner in 0..8 {
            let sign = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let corner = half * DVec3::new(sign(0), sign(1), sign(2));
            let side = corner.dot(right).abs().max(corner.dot(over).abs());
            distance = distance.max(1.1 * side / tan + corner.dot(toward));
        }
        View { from: at + toward * distance, at, up, angle }
    }

    /// A light at the upper left behind the eye, and as far from what is seen again as the eye; as strong as SPD asks of one.
    pub(crate) fn key_light(&self) -> Light {
        let back = self.from - self.at;
        let right = self.up.cross(back).normalize_or_zero();
        let over = back.cross(right).normalize_or_zero();
        let position = self.at + back * 1.5 + (over - right) * back.length();
        Light { position, color: [0.5; 3] }
    }
}

/// Why there is no such scene.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// No scene has this name.
    Unknown {
        /// The name.
        name: String,
    },
    /// The scene is not made in this size.
    Size {
        /// The scene.
        name: &'static str,
        /// The size asked for.
        size: u32,
        /// The least size there is.
        min: u32,
        /// The greatest: beyond it the scene would fill more memory than most machines have.
        max: u32,
    },
    /// The stadium is not that many times larger than its teapot, for any teapot.
    Ratio {
        /// The ratio asked for.
        ratio: f64,
    },
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SceneError::Unknown { name } => {
                write!(f, "there is no scene {name:?}; there are {}", names().join(", "))
            }
            SceneError::Size { name, size, min, max } => {
                write!(f, "scene {name} comes in sizes {min} to {max}, not {size}")
            }
            SceneError::Ratio { ratio } => {
                write!(f, "a stadium is 1 to 1e7 times as large as its teapot, not {ratio}")
            }
        }
    }
}

impl core::error::Error for SceneError {}

/// `size`, if it lies in the range in which the scene is made.
pub(crate) fn sized(name: &'static str, size: u32, min: u32, max: u32) -> Result<u32, SceneError> {
    if (min..=max).contains(&size) { Ok(size) } else { Err(SceneError::Size { name, size, min, max }) }
}

/// A scene by its name, of its default size where none is given.
type Maker = fn(Option<u32>) -> Result<Scene, SceneError>;

/// All scenes: name, what it is, and how it is made.
const SCENES: &[(&str, &str, Maker)] = &[
    ("balls", "a flake of spheres, to a depth of 4", |size| spd::balls(size.unwrap_or(4))),
    ("gears", "meshing gears, some of glass, 4 along each side", |size| spd::gears(size.unwrap_or(4))),
    ("jacks", "a jack of jacks of cones and spheres, to a depth of 3", |size| spd::jacks(size.unwrap_or(3))),
    ("lattice", "a lattice of spheres and cylinders, 12 cells a side", |size| {
        spd::lattice(size.unwrap_or(12))
    }),
    ("mount", "a fractal mountain under four glass spheres, cut 6 times", |size| {
        spd::mount(size.unwrap_or(6))
    }),
    ("rings", "a pyramid of linked rings, 7 layers", |size| spd::rings(size.unwrap_or(7))),
    ("shells", "a sea shell of spheres that cross, doubled 5 times", |size| spd::shells(size.unwrap_or(5))),
    ("sombrero", "a hat of triangles, on a grid doubled 1 time", |size| spd::sombrero(size.unwrap_or(1))),
    ("teapot", "the Utah teapot of triangles on a board, 12 cells a patch", |size| {
        spd::teapot(size.unwrap_or(12))
    }),
    ("tetra", "a tetrahedron of tetrahedra, to a depth of 6", |size| spd::tetra(size.unwrap_or(6))),
    ("tree", "a tree of cones in a wide field, forked 11 times", |size| spd::tree(size.unwrap_or(11))),
    ("stadium", "a teapot in a stadium, 12 cells a patch", |size| {
        stadium::stadium(870.0, size.unwrap_or(12))
    }),
    ("interior", "a furnished room, in a detail of 3", |size| interior::interior(size.unwrap_or(3))),
    ("terrain", "mountains and a lake of a million triangles, 708 cells a side", |size| {
        terrain::terrain(size.unwrap_or(708))
    }),
    ("patches", "the Utah teapot by its Bézier patches, on bilinear ones; 1 pot a side", |size| {
        gallery::patches(size.unwrap_or(1))
    }),
    ("quadrics", "nine quadrics and disks, cut open; 9 twelfths of a turn are left", |size| {
        gallery::quadrics(size.unwrap_or(9))
    }),
    ("loop", "Loop subdivision surfaces in their cages, in 4 levels", |size| {
        gallery::loops(size.unwrap_or(4))
    }),
    ("julia", "quaternion Julia sets over a mirror, 3 of them", |size| gallery::julia(size.unwrap_or(3))),
    ("mountains", "a fractal terrain of facets made when looked at, in 11 levels", |size| {
        gallery::mountains(size.unwrap_or(11))
    }),
    ("soup", "10000 triangles anywhere", |size| triangles("soup", size, |n| soup::uniform(n, 1))),
    ("clusters", "10000 triangles in clusters", |size| triangles("clusters", size, |n| soup::clusters(n, 1))),
    ("sticks", "10000 triangles a thousand times as long as wide", |size| {
        triangles("sticks", size, |n| soup::sticks(n, 1e3, 1))
    }),
    ("needles", "10000 long triangles in a bundle", |size| triangles("needles", size, soup::needles)),
    ("icosphere", "a sphere of triangles, cut 5 times", |size| {
        Ok(around("icosphere", soup::icosphere(sized("icosphere", size.unwrap_or(5), 0, 10)?)))
    }),
    ("crumpled", "a crumpled sphere that crosses itself, cut 4 times", |size| {
        Ok(around("crumpled", soup::crumpled(sized("crumpled", size.unwrap_or(4), 0, 10)?, 4.0, 1)))
    }),
    ("torus", "a torus of triangles, 40 around its tube", |size| {
        let n = sized("torus", size.unwrap_or(40), 3, 2500)?;
        Ok(around("torus", soup::torus(2 * n, n, 0.4)))
    }),
    ("rubble", "10000 triangles so far out that only f64 tells them apart", rubble),
];

/// `n` triangles by `make`, 10 000 where no number is given, seen from outside.
fn triangles(
    name: &'static str,
    n: Option<u32>,
    make: impl Fn(u32) -> TriangleMesh,
) -> Result<Scene, SceneError> {
    Ok(around(name, make(sized(name, n.unwrap_or(10_000), 0, soup::MOST)?)))
}

/// A mesh in the default look, and a view of all of it.
fn around(name: &str, mesh: TriangleMesh) -> Scene {
    let view = View::framing(&bound(&mesh));
    framed(name.to_string(), SceneGeometry::Mesh(mesh), view)
}

/// Geometry in the default look, with one light behind the eye, and a light background.
pub(crate) fn framed(name: String, geometry: SceneGeometry, view: View) -> Scene {
    Scene {
        name,
        geometry,
        materials: vec![Material::default()],
        material_of: Vec::new(),
        lights: vec![view.key_light()],
        view,
        background: [0.9, 0.92, 0.95],
        warnings: Vec::new(),
    }
}

fn rubble(size: Option<u32>) -> Result<Scene, SceneError> {
    let center = DVec3::new(1e7, -3e6, 2e6);
    let n = sized("rubble", size.unwrap_or(10_000), 0, 1_000_000)?;
    // Framed about zero and moved there: a box of `f32` at 1e7 is metres too large.
    let view = View::framing(&Aabb::new(Vec3A::NEG_ONE, Vec3A::ONE));
    let view = View { from: center + view.from, at: center + view.at, ..view };
    Ok(framed("rubble".to_string(), SceneGeometry::FineMesh(fine::rubble(n, center, 1)), view))
}

/// The names of the scenes [`by_name`] knows.
pub fn names() -> Vec<&'static str> {
    SCENES.iter().map(|scene| scene.0).collect()
}

/// What the scene called `name` shows, in a few words, its default size among them; `None` if there is no such scene.
///
/// ```
/// let torus = rt_scenes::about("torus").unwrap();
/// assert_eq!(torus, "a torus of triangles, 40 around its tube");
/// ```
pub fn about(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|scene| scene.0 == name).map(|scene| scene.1)
}

/// The scene called `name`, in `size`; without one, in its default size. What sizes mean is up to the scene.
///
/// # Errors
///
/// When there is no such scene, or not in this size.
pub fn by_name(name: &str, size: Option<u32>) -> Result<Scene, SceneError> {
    match SCENES.iter().find(|scene| scene.0 == name) {
        Some((.., make)) => make(size),
        None => Err(SceneError::Unknown { name: name.to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_has_a_name_and_every_name_a_scene() {
        for name in names() {
            let size = by_name(name, None).map(|scene| scene.prim_count());
            assert!(size.is_ok_and(|n| n > 1), "{name}");
            assert!(about(name).is_some_and(|what| what.len() > 10 && what.len() < 80), "{name}");
            assert!(by_name(name, Some(u32::MAX)).is_err(), "{name}");
        }
        let error = by_name("bunny", None).unwrap_err().to_string();
        assert!(error.starts_with("there is no scene \"bunny\"; there are balls, gears, jacks,"), "{error}");
    }

    #[test]
    fn the_whole_box_is_in_the_picture() {
        let lying = Aabb::new(Vec3A::ZERO, Vec3A::new(100.0, 80.0, 1.0));
        let thin = Aabb::new(Vec3A::splat(1e7), Vec3A::new(1e7 + 1.0, 2e7, 1e7));
        let small = Aabb::new(Vec3A::splat(-1e-38), Vec3A::splat(1e-38));
        let large = Aabb::new(Vec3A::splat(-3e38), Vec3A::splat(3e38));
        let point = Aabb::new(Vec3A::ONE, Vec3A::ONE);
        for bound in [lying, thin, small, large, point, Aabb::EMPTY, Aabb::INFINITE] {
            let view = View::framing(&bound);
            assert!(view.from.is_finite() && view.at.is_finite() && view.from != view.at, "{bound:?}");
            let ahead = (view.at - view.from).normalize();
            let right = ahead.cross(view.up).normalize();
            let over = right.cross(ahead);
            let light = view.key_light().position - view.from;
            assert!(light.dot(right) < 0.0 && light.dot(over) > 0.0 && light.dot(ahead) < 0.0);
            if !bound.is_valid() || bound == Aabb::INFINITE {
                continue;
            }
            let (min, max) = (bound.min.as_dvec3(), bound.max.as_dvec3());
            for corner in [min, max, DVec3::new(min.x, max.y, min.z), DVec3::new(max.x, min.y, max.z)] {
                let to = corner - view.from;
                let side = to.dot(right).abs().max(to.dot(over).abs());
                assert!(to.dot(ahead) > 0.0 && side / to.dot(ahead) < (view.angle / 2.0).tan(), "{bound:?}");
            }
        }
    }
}

//! NFF, the Neutral File Format of the Standard Procedural Databases: read strictly, and written.
//!
//! | In the file | Here |
//! | --- | --- |
//! | `v` with `from`, `at`, `up`, `angle` | the [view](crate::View); without one, a view of the whole box |
//! | `hither`, `resolution` | passed over; written as 0 and 512 |
//! | `b`, `l` with or without a colour, `f` | background, lights, materials; lights without a colour [share](Light::shared) |
//! | `c` | a [frustum](rt_shapes::Frustum), open at both ends |
//! | `s` | a sphere; of a negative radius, with a warning, as one of a positive radius: surfaces have two sides here |
//! | `p` and `pp` of three corners | a triangle |
//! | `p` of more corners | a polygon |
//! | `pp` of more corners | cut into triangles |
//! | a view from a point to itself, or farther than `1e154` | an error |
//! | corners without area | triangles that are never hit, with a warning |
//! | words and numbers that are none, files that end too soon | an error |
//!
//! A file of triangles becomes a [mesh](SceneGeometry::Mesh), of `f32` if that tells all its vertices apart; corners at the same
//! place with the same normal are one vertex. Other files become [solids](SceneGeometry::Solids), in which triangles are
//! [facets](crate::Facet). Where lines end means nothing, except to comments, which begin with `#`.
//!
//! Numbers are written with as many digits as bring them back. So what is written and read again is the same, primitive for
//! primitive, with the same looks; materials may be numbered otherwise, texture coordinates are lost, and a mesh of `f64` that
//! `f32` tells apart comes back in `f32`. [Placed](crate::Solid::Placed) shapes, of which the format has no words, are an error.
//!
//! ```
//! use rt_scenes::nff;
//! let scene = nff::read(b"b 0 0 0\nl 5 5 5\nf 1 .5 .2 .7 .3 20 0 1\ns 0 0 0 1\np 3 0 0 0 1 0 0 0 1 0\n", "two.nff")?;
//! assert_eq!((scene.prim_count(), scene.material(1).ks), (2, 0.3));
//!
//! let mut file = Vec::new();
//! nff::write(&scene, &mut file)?;
//! assert_eq!(nff::read(&file, "two.nff")?.geometry, scene.geometry);
//!
//! let error = nff::read(b"s 0 0 0\ns 1 1 x 1\n", "bad.nff").unwrap_err();
//! assert_eq!(error.to_string(), "bad.nff:2: the radius of a sphere must be a number, not \"s\"");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Source: Haines, *Neutral File Format* 3.1, in the Standard Procedural Databases.

mod words;
mod write;

use crate::{Facet, Light, Material, Scene, SceneGeometry, Solid, View, numbers, scene};
use core::fmt;
use rt_accel::WorldBound;
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_shapes::{Frustum, Polygon, QuadricError, Sphere, SphereError};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use words::{Place, Words, start};
pub use write::write;

/// Why a file is not a scene: which file, where, and what is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct NffError {
    /// The file.
    pub file: String,
    /// The line, from 1, where it is known.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: NffProblem,
}

/// What is wrong with an NFF file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NffProblem {
    /// It cannot be read: the operating system's words.
    Unreadable(String),
    /// It is a directory.
    Directory,
    /// It is not text.
    NotText,
    /// There is nothing to hit in it.
    NoSolids,
    /// A word that begins nothing.
    Unknown(String),
    /// Something is not a number.
    Number {
        /// What should be one.
        what: &'static str,
        /// What there is.
        found: String,
    },
    /// A number that is NaN, infinite, or too large for `f64`.
    NotFinite {
        /// What it stands for.
        what: &'static str,
        /// The number.
        found: String,
    },
    /// A number of corners that is not whole, or below 3.
    Corners(String),
    /// A field of view that is not above 0 and below 180 degrees.
    Angle(f64),
    /// A view from a point to itself, or so far that the square of the distance leaves the range of `f64`.
    Sight {
        /// The eye.
        from: DVec3,
        /// What it looks at.
        at: DVec3,
    },
    /// The file ends where something is missing.
    Ends {
        /// What is missing.
        what: &'static str,
    },
    /// A sphere that is none.
    Sphere(SphereError),
    /// A cylinder or cone that is none.
    Frustum(QuadricError),
    /// More triangles than can be numbered.
    TooManyTriangles,
}

impl fmt::Display for NffError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file, self.problem),
            None => write!(f, "{}: {}", self.file, self.problem),
        }
    }
}

impl fmt::Display for NffProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NffProblem::Unreadable(why) => write!(f, "cannot be read: {why}"),
            NffProblem::Directory => write!(f, "is a directory, not a file"),
            NffProblem::NotText => write!(f, "this is not text, so not an NFF file"),
            NffProblem::NoSolids => write!(f, "holds nothing to hit"),
            NffProblem::Unknown(word) => {
                write!(f, "{word:?} begins nothing: there are v, b, l, f, c, s, p and pp")
            }
            NffProblem::Number { what, found } => write!(f, "{what} must be a number, not {found:?}"),
            NffProblem::NotFinite { what, found } => write!(f, "{what} must be finite, not {found}"),
            NffProblem::Corners(found) => {
                write!(f, "a polygon needs a whole number of corners, 3 or more, not {found}")
            }
            NffProblem::Angle(angle) => {
                write!(f, "the field of view must be between 0 and 180 degrees, not {angle}")
            }
            NffProblem::Sight { from, at } => {
                let point = |p: DVec3| format!("{:?} {:?} {:?}", p.x, p.y, p.z);
                write!(f, "the view looks from {} at ", point(*from))?;
                if from == at {
                    write!(f, "the same point")
                } else {
                    write!(f, "{}: so far that the square of the distance is no number", point(*at))
                }
            }
            NffProblem::Ends { what } => write!(f, "the file ends before {what}"),
            NffProblem::Sphere(error) => error.fmt(f),
            NffProblem::Frustum(error) => error.fmt(f),
            NffProblem::TooManyTriangles => write!(f, "more triangles than can be numbered"),
        }
    }
}

impl core::error::Error for NffError {}

/// Reads the NFF file at `path`. A million triangles, of 100 megabytes, take less than two seconds.
///
/// What was passed over stands in the scene's [`warnings`](Scene::warnings).
///
/// # Errors
///
/// When it cannot be read, or [`read`] fails.
pub fn load(path: impl AsRef<Path>) -> Result<Scene, NffError> {
    let path = path.as_ref();
    let fail = |problem| NffError { file: path.display().to_string(), line: None, problem };
    if path.is_dir() {
        return Err(fail(NffProblem::Directory));
    }
    let bytes = std::fs::read(path).map_err(|error| fail(NffProblem::Unreadable(error.to_string())))?;
    read(&bytes, &path.display().to_string())
}

/// Reads the contents of an NFF file; `name` is what the scene and errors call it.
///
/// # Errors
///
/// For what is [wrong](NffProblem), or when there is nothing to hit.
pub fn read(bytes: &[u8], name: &str) -> Result<Scene, NffError> {
    let mut words = Words::new(crate::obj::past_mark(bytes));
    let mut reader = Reader::default();
    let done = reader.read(&mut words);
    let fail = |line, problem| NffError { file: name.to_string(), line, problem };
    done.map_err(|problem| fail(Some(words.line()), problem))?;
    if reader.material_of.is_empty() {
        return Err(fail(None, NffProblem::NoSolids));
    }
    Ok(reader.scene(name))
}

/// What has been read.
#[derive(Default)]
struct Reader {
    view: Option<View>,
    background: [f32; 3],
    lights: Vec<(DVec3, Option<[f32; 3]>)>,
    materials: Vec<Material>,
    /// Materials by their bits.
    numbers: HashMap<[u32; 8], u32>,
    material: Option<u32>,
    material_of: Vec<u32>,
    /// What is no triangle, with its place among all primitives.
    solids: Vec<(usize, Solid)>,
    vertices: Vec<[f64; 3]>,
    /// The same vertices as `f32` reads them.
    single: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Vertices by the bits of their place and normal.
    corners: HashMap<([u64; 3], [u32; 3]), u32>,
    smooth: bool,
    flat: usize,
    inward: usize,
}

impl Reader {
    fn read(&mut self, words: &mut Words<'_>) -> Result<(), NffProblem> {
        while let Some(word) = words.next()? {
            match word {
                "v" => self.view(words)?,
                "b" => self.background = words.color("a background")?,
                "l" => {
                    let place = words.point("a light's place")?;
                    let color =
                        if words.number_follows()? { Some(words.color("a light's colour")?) } else { None };
                    self.lights.push((place, color));
                }
                "f" => self.look(words)?,
                "s" => {
                    let center = words.point("the centre of a sphere")?;
                    let radius = words.number("the radius of a sphere")?;
                    self.inward += usize::from(radius < 0.0);
                    let sphere = Sphere::new(center, radius.abs()).map_err(NffProblem::Sphere)?;
                    self.solid(sphere);
                }
                "c" => {
                    let ((base, wide), (apex, narrow)) = (circle(words)?, circle(words)?);
                    self.inward += usize::from(wide < 0.0 || narrow < 0.0);
                    let frustum = Frustum::new(base, wide.abs(), apex, narrow.abs());
                    self.solid(frustum.map_err(NffProblem::Frustum)?);
                }
                "p" => {
                    let corners = corners(words, |words| words.place("a corner"))?;
                    self.polygon(&corners)?;
                }
                "pp" => {
                    let corners =
                        corners(words, |words| Ok((words.place("a corner")?, words.color("a normal")?)))?;
                    let places: Vec<DVec3> = corners.iter().map(|corner| corner.0.wide).collect();
                    self.smooth = true;
                    for cut in self.cuts(&places) {
                        self.triangle(cut.map(|i| corners[i]))?;
                    }
                }
                other => return Err(NffProblem::Unknown(start(other))),
            }
        }
        Ok(())
    }

    fn view(&mut self, words: &mut Words<'_>) -> Result<(), NffProblem> {
        let (mut from, mut at, mut up, mut angle) = (None, None, None, None);
        while let Some(word) = words.peek()? {
            match word {
                "from" => from = Some(words.skip().point("from")?),
                "at" => at = Some(words.skip().point("at")?),
                "up" => up = Some(words.skip().point("up")?),
                "angle" => angle = Some(words.skip().number("angle")?),
                "hither" => {
                    words.skip().number("hither")?;
                }
                "resolution" => {
                    words.skip().number("resolution")?;
                    words.number("resolution")?;
                }
                _ => break,
            }
        }
        let lacks = |what| NffProblem::Ends { what };
        let angle: f64 = angle.ok_or(lacks("the angle of the view"))?;
        if !(angle > 0.0 && angle < 180.0) {
            return Err(NffProblem::Angle(angle));
        }
        let from: DVec3 = from.ok_or(lacks("the eye of the view (from)"))?;
        let at: DVec3 = at.ok_or(lacks("what the view looks at (at)"))?;
        if from == at || !(at - from).length_squared().is_finite() {
            return Err(NffProblem::Sight { from, at });
        }
        self.view =
            Some(View { from, at, up: up.ok_or(lacks("the up of the view"))?, angle: angle.to_radians() });
        Ok(())
    }

    fn look(&mut self, words: &mut Words<'_>) -> Result<(), NffProblem> {
        let color = words.color("a surface's colour")?;
        let mut value = || words.single("a surface's kd, ks, shine, t or index of refraction");
        let material = Material {
            color,
            kd: value()?,
            ks: value()?,
            shine: value()?,
            transmittance: value()?,
            ior: value()?,
        };
        self.material = Some(self.number(material));
        Ok(())
    }

    fn number(&mut self, material: Material) -> u32 {
        let Material { color: [r, g, b], kd, ks, shine, transmittance, ior } = material;
        let bits = [r, g, b, kd, ks, shine, transmittance, ior].map(f32::to_bits);
        *self.numbers.entry(bits).or_insert_with(|| {
            self.materials.push(material);
            self.materials.len() as u32 - 1
        })
    }

    /// Notes that one more primitive has the present look.
    fn one_more(&mut self) {
        let number = match self.material {
            Some(number) => number,
            None => self.number(Material::default()),
        };
        self.material = Some(number);
        self.material_of.push(number);
    }

    fn solid(&mut self, solid: impl Into<Solid>) {
        self.solids.push((self.material_of.len(), solid.into()));
        self.one_more();
    }

    fn polygon(&mut self, corners: &[Place]) -> Result<(), NffProblem> {
        let places: Vec<DVec3> = corners.iter().map(|corner| corner.wide).collect();
        if places.len() > 3
            && let Ok(polygon) = Polygon::new(&places)
        {
            self.solid(polygon);
            return Ok(());
        }
        for cut in self.cuts(&places) {
            self.triangle(cut.map(|i| (corners[i], [0.0; 3])))?;
        }
        Ok(())
    }

    /// Triangles between corners; those around the first where the corners have no area.
    fn cuts(&mut self, corners: &[DVec3]) -> Vec<[usize; 3]> {
        if corners.len() == 3 && (corners[1] - corners[0]).cross(corners[2] - corners[0]) != DVec3::ZERO {
            return vec![[0, 1, 2]];
        }
        Polygon::triangulate(corners).unwrap_or_else(|_| {
            self.flat += 1;
            (1..corners.len() - 1).map(|i| [0, i, i + 1]).collect()
        })
    }

    fn triangle(&mut self, corners: [(Place, [f32; 3]); 3]) -> Result<(), NffProblem> {
        if self.triangles.len() as u64 * 3 + 6 > u64::from(u32::MAX) {
            return Err(NffProblem::TooManyTriangles);
        }
        let numbers = corners.map(|(place, normal)| {
            let key = (place.wide.to_array().map(f64::to_bits), normal.map(f32::to_bits));
            *self.corners.entry(key).or_insert_with(|| {
                self.vertices.push(place.wide.to_array());
                self.single.push(place.single);
                self.normals.push(normal);
                self.vertices.len() as u32 - 1
            })
        });
        self.triangles.push(numbers);
        self.one_more();
        Ok(())
    }

    fn scene(self, name: &str) -> Scene {
        let mut warnings = Vec::new();
        if self.flat > 0 {
            warnings.push(format!("{} polygons have no area; rays never hit them", self.flat));
        }
        if self.inward > 0 {
            let why = "spheres, cylinders and cones have negative radii; they are seen from both sides here";
            warnings.push(format!("{} {why}", self.inward));
        }
        let geometry = if self.solids.is_empty() {
            mesh(self.vertices, self.single, self.smooth.then_some(self.normals), self.triangles)
        } else {
            let mut facets = with_normals(
                numbers::mesh(self.vertices, self.triangles),
                self.smooth.then_some(self.normals),
            );
            let mut solids = Vec::with_capacity(self.material_of.len());
            for (place, solid) in self.solids {
                let between = place - solids.len();
                solids.extend(facets.by_ref().take(between).map(Solid::from));
                solids.push(solid);
            }
            solids.extend(facets.map(Solid::from));
            SceneGeometry::Solids(solids)
        };
        let n = self.lights.len();
        let shared = Light::shared(&vec![[0.0; 3]; n]);
        let lights = self
            .lights
            .iter()
            .zip(shared)
            .map(|(&(position, color), shared)| Light { position, color: color.unwrap_or(shared.color) });
        let view = self.view.unwrap_or_else(|| {
            warnings.push("there is no view; it is seen whole, from above".to_string());
            View::framing(&match &geometry {
                SceneGeometry::Mesh(mesh) => scene::bound(mesh),
                SceneGeometry::FineMesh(mesh) => scene::bound(mesh),
                SceneGeometry::Solids(solids) => {
                    solids.iter().fold(Aabb::EMPTY, |b, solid| b.union(solid.world_bound()))
                }
            })
        });
        let one_look = self.materials.len() == 1;
        Scene {
            name: name.to_string(),
            geometry,
            materials: self.materials,
            material_of: if one_look { Vec::new() } else { self.material_of },
            lights: lights.collect(),
            view,
            background: self.background,
            warnings,
        }
    }
}

fn with_normals(
    mesh: rt_shapes::TriangleMesh<f64>,
    normals: Option<Vec<[f32; 3]>>,
) -> std::vec::IntoIter<Facet> {
    let mesh = match normals {
        Some(normals) => mesh.with_normals(normals).expect("one for each vertex"),
        None => mesh,
    };
    Facet::all(mesh).into_iter()
}

/// A mesh of `f32`, unless vertices then fall on one another.
fn mesh(
    vertices: Vec<[f64; 3]>,
    single: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    triangles: Vec<[u32; 3]>,
) -> SceneGeometry {
    let places: HashSet<[u64; 3]> = vertices.iter().map(|v| v.map(f64::to_bits)).collect();
    let rounded: HashSet<[u32; 3]> = single.iter().map(|v| v.map(f32::to_bits)).collect();
    let apart = places.len() == rounded.len() && single.iter().flatten().all(|x| x.is_finite());
    let why = "one for each vertex";
    match (apart, normals) {
        (true, None) => SceneGeometry::Mesh(numbers::mesh(single, triangles)),
        (true, Some(normals)) => {
            SceneGeometry::Mesh(numbers::mesh(single, triangles).with_normals(normals).expect(why))
        }
        (false, None) => SceneGeometry::FineMesh(numbers::mesh(vertices, triangles)),
        (false, Some(normals)) => {
            SceneGeometry::FineMesh(numbers::mesh(vertices, triangles).with_normals(normals).expect(why))
        }
    }
}

/// The middle and radius of one end of a cylinder or cone.
fn circle(words: &mut Words<'_>) -> Result<(DVec3, f64), NffProblem> {
    Ok((words.point("an end of a cone")?, words.number("a radius of a cone")?))
}

/// As many corners as are announced.
fn corners<T>(
    words: &mut Words<'_>,
    mut corner: impl FnMut(&mut Words<'_>) -> Result<T, NffProblem>,
) -> Result<Vec<T>, NffProblem> {
    let what = "the number of corners";
    let found = words.next()?.ok_or(NffProblem::Ends { what })?;
    let bad = || NffProblem::Corners(start(found));
    let count = found.parse::<u32>().ok().filter(|&count| count >= 3).ok_or_else(bad)?;
    // Not more at once than a file of this size may hold: the number may be a mistake.
    let mut corners = Vec::with_capacity(count.min(256) as usize);
    for _ in 0..count {
        corners.push(corner(words)?);
    }
    Ok(corners)
}

#[cfg(test)]
mod tests;

//! [`write`]: a scene as an NFF file.

use crate::facet::corner_normals;
use crate::{Material, Scene, SceneGeometry, Solid};
use rt_geom::Real;
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;
use std::io::{self, Write};

/// Writes `scene` as an NFF file, with as many digits as bring every number back. Texture coordinates have no place in one.
///
/// Writes in small pieces: give it a [`BufWriter`](io::BufWriter) where `to` is a file.
///
/// # Errors
///
/// When `to` cannot be written to; and of kind [`InvalidData`](io::ErrorKind::InvalidData), before anything is written, for what
/// has no place in one either: [placed](Solid::Placed) shapes, and triangles with vertices that are not finite.
pub fn write(scene: &Scene, to: &mut impl Write) -> io::Result<()> {
    if let Some(why) = misfit(&scene.geometry) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("{}: {why}", scene.name)));
    }
    let view = scene.view;
    writeln!(to, "v")?;
    line(to, "from", view.from)?;
    line(to, "at", view.at)?;
    line(to, "up", view.up)?;
    writeln!(to, "angle {}\nhither 0\nresolution 512 512", degrees(view.angle))?;
    writeln!(to, "b{}", Three(scene.background))?;
    for light in &scene.lights {
        writeln!(to, "l{}{}", Three(light.position.to_array()), Three(light.color))?;
    }
    let mut look = None;
    match &scene.geometry {
        SceneGeometry::Mesh(mesh) => triangles(scene, mesh, &mut look, to),
        SceneGeometry::FineMesh(mesh) => triangles(scene, mesh, &mut look, to),
        SceneGeometry::Solids(solids) => {
            for (prim, solid) in (0..).zip(solids) {
                changed(scene.material(prim), &mut look, to)?;
                match solid {
                    Solid::Sphere(sphere) => {
                        writeln!(to, "s{} {}", Three(sphere.center().to_array()), sphere.radius())?;
                    }
                    Solid::Polygon(polygon) => corners(polygon.corners(), None, to)?,
                    Solid::Facet(facet) => {
                        corners(&facet.corners(), facet.normals().as_ref().map(|n| &n[..]), to)?;
                    }
                    Solid::Frustum(frustum) => {
                        writeln!(to, "c")?;
                        for (end, radius) in frustum.ends().iter().zip(frustum.radii()) {
                            writeln!(to, "{} {radius}", Three(end.to_array()))?;
                        }
                    }
                    // There is none: see `misfit`.
                    Solid::Placed(_) => {}
                }
            }
            Ok(())
        }
    }
}

/// What NFF has no words for, if there is such a thing.
fn misfit(geometry: &SceneGeometry) -> Option<String> {
    fn endless<V: Real>(mesh: &TriangleMesh<V>) -> Option<String> {
        let wrong = |i: &u32| !mesh.vertices()[*i as usize].iter().all(|&x| x.into().is_finite());
        let triangle = mesh.triangles().iter().position(|corners| corners.iter().any(wrong))?;
        Some(format!("triangle {triangle} has a vertex that is not finite"))
    }
    match geometry {
        SceneGeometry::Mesh(mesh) => endless(mesh),
        SceneGeometry::FineMesh(mesh) => endless(mesh),
        SceneGeometry::Solids(solids) => (0..).zip(solids).find_map(|(prim, solid): (u32, _)| match solid {
            Solid::Placed(placed) => {
                Some(format!("solid {prim} is {}, which NFF has no word for", placed.what()))
            }
            Solid::Facet(facet) if !facet.corners().iter().all(|p| p.is_finite()) => {
                Some(format!("solid {prim} has a vertex that is not finite"))
            }
            _ => None,
        }),
    }
}

/// Three numbers, with a blank before each.
struct Three<T>([T; 3]);

impl<T: std::fmt::Display> std::fmt::Display for Three<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Three([x, y, z]) = self;
        write!(f, " {x} {y} {z}")
    }
}

fn line(to: &mut impl Write, word: &str, point: DVec3) -> io::Result<()> {
    writeln!(to, "{word}{}", Three(point.to_array()))
}

/// The number of degrees that is read as this angle, if there is one: the conversion rounds.
fn degrees(angle: f64) -> f64 {
    let near = angle.to_degrees();
    let found = [near, near.next_up(), near.next_down()].into_iter().find(|d| d.to_radians() == angle);
    found.unwrap_or(near)
}

/// The `f` line, if the look is another than the last.
fn changed(material: Material, last: &mut Option<Material>, to: &mut impl Write) -> io::Result<()> {
    if *last == Some(material) {
        return Ok(());
    }
    *last = Some(material);
    let Material { color, kd, ks, shine, transmittance, ior } = material;
    writeln!(to, "f{} {kd} {ks} {shine} {transmittance} {ior}", Three(color))
}

fn triangles<V: Real + std::fmt::Display>(
    scene: &Scene,
    mesh: &TriangleMesh<V>,
    look: &mut Option<Material>,
    to: &mut impl Write,
) -> io::Result<()> {
    for (prim, numbers) in (0..).zip(mesh.triangles()) {
        changed(scene.material(prim), look, to)?;
        let normals = corner_normals(mesh, prim);
        writeln!(to, "{} 3", if normals.is_some() { "pp" } else { "p" })?;
        for (i, &number) in numbers.iter().enumerate() {
            let place = mesh.vertices()[number as usize];
            match normals {
                Some(normals) => writeln!(to, "{}{}", Three(place), Three(normals[i]))?,
                None => writeln!(to, "{}", Three(place))?,
            }
        }
    }
    Ok(())
}

fn corners(places: &[DVec3], normals: Option<&[[f32; 3]]>, to: &mut impl Write) -> io::Result<()> {
    writeln!(to, "{} {}", if normals.is_some() { "pp" } else { "p" }, places.len())?;
    for (i, place) in places.iter().enumerate() {
        match normals {
            Some(normals) => writeln!(to, "{}{}", Three(place.to_array()), Three(normals[i]))?,
            None => writeln!(to, "{}", Three(place.to_array()))?,
        }
    }
    Ok(())
}

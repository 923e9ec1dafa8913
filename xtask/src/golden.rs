//! `cargo xtask golden`: has any picture changed?

use crate::failure::Failure;
use crate::output::{root, say, write_whole};
use crate::stage::{Precision, Stage, load};
use rt_bench::roster;
use rt_render::{Camera, Film, Picture, ungoverned};
use rt_scenes::{Scene, SceneGeometry};
use std::path::{Path, PathBuf};

/// Compare small pictures of every structure with the reference ones, bit for bit.
///
/// The pictures are 128 x 128 pixels and show shading normals; there is one per scene, which every structure must reproduce.
/// Where one does not, the new picture and the difference go to out/golden.
#[derive(clap::Args, Default)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Rewrite the reference pictures; look at them before committing.
    #[arg(long)]
    bless: bool,
    /// Only this structure.
    #[arg(long, value_name = "STRUCTURE")]
    with: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask golden              compare; exits with 1 where a picture differs
  cargo xtask golden --with bvh   one structure only
  cargo xtask golden --bless      take the pictures of the exhaustive structure for right";

/// Width and height of reference pictures.
const SIDE: u32 = 128;

/// The size of a scene in its reference picture: the picture has few pixels and exhaustive search is among the structures.
fn size(scene: &str) -> Option<u32> {
    match scene {
        "balls" => Some(2),
        "gears" | "jacks" | "rings" | "shells" => Some(2),
        "lattice" | "mount" => Some(4),
        "teapot" => Some(6),
        "tetra" => Some(4),
        "tree" => Some(8),
        "interior" => Some(1),
        "terrain" => Some(40),
        "stadium" => Some(2),
        "loop" => Some(2),
        "mountains" => Some(6),
        "soup" | "clusters" | "sticks" | "needles" | "rubble" => Some(1000),
        "icosphere" | "crumpled" => Some(3),
        "torus" => Some(20),
        _ => None,
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let folder = root().join("assets/golden");
    if args.bless {
        for name in rt_scenes::names() {
            let path = folder.join(format!("{name}.png"));
            write_whole(&path, &png(&draw(name, "exhaustive")?)?)?;
            say!("blessed {}", path.display());
        }
    }
    let one = args.with.as_deref();
    let all = roster::NAMES.iter().copied().filter(|name| one.is_none_or(|only| only == *name));
    let chosen: Vec<&str> = all.collect();
    if chosen.is_empty() {
        let known = roster::NAMES.join(", ");
        return Err(Failure::Usage(format!(
            "there is no structure {:?}; there are {known}",
            one.unwrap_or("")
        )));
    }
    let mut wrong = Vec::new();
    for name in rt_scenes::names() {
        for structure in &chosen {
            match compare(name, structure, &folder)? {
                None => say!("ok      {name} {structure}"),
                Some(why) => {
                    say!("differs {name} {structure}: {why}");
                    wrong.push(format!("{name} {structure}"));
                }
            }
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!("pictures differ from assets/golden: {}", wrong.join(", "))))
    }
}

/// What is wrong with one picture, having written it out.
fn compare(name: &str, structure: &str, folder: &Path) -> Result<Option<String>, Failure> {
    let path = folder.join(format!("{name}.png"));
    let new = draw(name, structure)?;
    let old = match std::fs::read(&path) {
        Ok(file) => Picture::from_png(&file).map_err(|e| Failure::file(&path, e))?,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Ok(Some("there is no reference picture; --bless makes one".into()));
        }
        Err(e) => return Err(Failure::file(&path, e)),
    };
    if (old.width, old.height, old.bytes()) == (new.width, new.height, new.bytes()) {
        return Ok(None);
    }
    let out = |what: &str| -> PathBuf { root().join(format!("out/golden/{name}-{structure}-{what}.png")) };
    write_whole(&out("new"), &png(&new)?)?;
    if (old.width, old.height) != (new.width, new.height) {
        return Ok(Some(format!(
            "{} x {} pixels instead of {} x {}",
            new.width, new.height, old.width, old.height
        )));
    }
    let (diff, count) = difference(&old, &new);
    write_whole(&out("diff"), &png(&diff)?)?;
    Ok(Some(format!("{count} pixels; see {}", out("diff").display())))
}

/// A picture that is grey where two are equal and as red as they differ elsewhere; and the number of pixels that do.
fn difference(old: &Picture, new: &Picture) -> (Picture, usize) {
    let mut diff = Picture::new(new.width, new.height);
    let (old, new) = (old.bytes(), new.bytes());
    let mut count = 0;
    for (i, pixel) in diff.pixels.iter_mut().enumerate() {
        let (a, b) = (&old[3 * i..3 * i + 3], &new[3 * i..3 * i + 3]);
        let most = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
        *pixel = if most == 0 {
            [b.iter().map(|&c| f32::from(c)).sum::<f32>() / (3.0 * 255.0 * 4.0); 3]
        } else {
            count += 1;
            // The least difference must be seen too.
            [0.5 + f32::from(most) / 510.0, 0.0, 0.0]
        };
    }
    (diff, count)
}

fn draw(name: &str, structure: &str) -> Result<Picture, Failure> {
    let scene = load(name, size(name))?;
    match scene.geometry {
        SceneGeometry::FineMesh(_) => normals::<f64>(scene, structure),
        _ => normals::<f32>(scene, structure),
    }
}

fn normals<R: Precision>(scene: Scene, structure: &str) -> Result<Picture, Failure> {
    let camera = Camera::new(&scene.view).map_err(|e| Failure::Check(format!("{}: {e}", scene.name)))?;
    let (stage, _) = R::stage(scene.geometry, structure, &mut rt_accel::unwatched)?;
    let film = Film::new(SIDE, SIDE);
    match stage {
        Stage::Solids(shape) => film.normals(&camera, &*shape, &ungoverned),
        Stage::Mesh(shape) => film.normals(&camera, &*shape, &ungoverned),
    }
    .map_err(|_| Failure::Interrupted)
}

fn png(picture: &Picture) -> Result<Vec<u8>, Failure> {
    picture.png().map_err(|e| Failure::Check(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_not_changed() {
        for name in ["balls", "tetra"] {
            for structure in roster::NAMES {
                assert_eq!(
                    compare(name, structure, &root().join("assets/golden")).unwrap(),
                    None,
                    "{name} {structure}"
                );
            }
        }
    }

    #[test]
    fn differences_are_counted_and_shown() {
        let old = Picture::new(3, 2);
        let mut new = old.clone();
        assert_eq!(difference(&old, &new).1, 0);
        new.pixels[4] = [0.0, 1.0 / 255.0, 0.0];
        let (diff, count) = difference(&old, &new);
        assert_eq!(count, 1);
        assert!(diff.pixels[4][0] > 0.5 && diff.pixels[3] == [0.0; 3]);
    }
}

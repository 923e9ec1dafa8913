//! `cargo xtask spd`: do Haines' scenes take the rays they are known for?

use crate::failure::Failure;
use crate::output::{Progress, catch_interrupts, say, thousands};
use crate::stage::{Bits, Precision, Stage, load};
use rt_accel::Member;
use rt_bench::roster;
use rt_geom::Real;
use rt_render::{Camera, Film, Look, RayCounts, Whitted};
use rt_scenes::spd::{KNOWN, Known};
use rt_scenes::{Scene, SceneGeometry};
use rt_shapes::{Shape, Uv};

/// Count the rays of Haines' scenes, and compare with what is known of them.
///
/// Each scene is rendered in 512 x 512 pixels by the rules of the databases. Under each count stands how far it is off the one
/// recomputed by brute force in f64, in percent, and under that off the one Haines gives, where he does.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Only these scenes; all without.
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// The structure over the scenes.
    #[arg(long, value_name = "STRUCTURE", default_value = roster::NAMES[0])]
    with: String,
    /// Precision of the rays.
    #[arg(long, value_enum, default_value_t = Bits::F64)]
    precision: Bits,
    /// Say nothing but the result.
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask spd                          all scenes; exits with 1 where a count is off
  cargo xtask spd rings tree               two of them
  cargo xtask spd --precision f32          by rays of f32

A count of rays shot is off where it is more than half a percent from the recomputed one, or a tenth from Haines'; one of rays
that hit, where it is more than two percent off. Those of the teapot differ because its mirrored rays follow its smooth normals,
and those recomputed follow its triangles.";

/// What is counted, in the order of [`Known::rays`].
const COLUMNS: [&str; 7] =
    ["eye hits", "reflected", "refracted", "shadow", "occluded", "second hits", "total refl"];

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let known = |name: &String| KNOWN.iter().any(|known| known.scene == name);
    if let Some(name) = args.scenes.iter().find(|name| !known(name)) {
        let mut names: Vec<&str> = KNOWN.iter().map(|known| known.scene).collect();
        names.dedup();
        return Err(Failure::Usage(format!("nothing is known of {name:?}, but of {}", names.join(", "))));
    }
    catch_interrupts();
    say!("{:14}{:>12}{}", "scene", "primitives", COLUMNS.map(|what| format!("{what:>13}")).concat());
    let mut wrong = Vec::new();
    for known in
        KNOWN.iter().filter(|known| args.scenes.is_empty() || args.scenes.iter().any(|s| s == known.scene))
    {
        let name = format!("{} {}", known.scene, known.size);
        let scene = load(known.scene, Some(known.size))?;
        let primitives = scene.prim_count();
        let counts = match args.precision {
            Bits::F32 => count::<f32>(args, scene)?,
            Bits::F64 => count::<f64>(args, scene)?,
        };
        let numbers = counts.map(|n| format!("{:>13}", thousands(n))).concat();
        say!("{name:14}{:>12}{numbers}", thousands(primitives as u64));
        say!("{:>26}{}", "off by %", percents(&counts, &known.rays));
        if let Some(haines) = known.haines {
            say!("{:>26}{}", "off Haines' by %", percents(&counts, &haines));
        }
        if primitives != known.primitives || off(&counts, known) {
            wrong.push(name);
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(Failure::Check(format!("not as known: {}", wrong.join(", ")))) }
}

/// By how much a count differs, as a share of what is known.
fn share(counted: u64, known: u64) -> f64 {
    (counted as f64 - known as f64) / known.max(1) as f64
}

fn percents(counted: &[u64], known: &[u64]) -> String {
    counted
        .iter()
        .zip(known)
        .map(|(&counted, &known)| format!("{:>13.3}", 100.0 * share(counted, known)))
        .collect()
}

fn off(counts: &[u64; 7], known: &Known) -> bool {
    let beyond = |counts: &[u64], known: &[u64], most: f64| {
        counts.iter().zip(known).any(|(&c, &k)| share(c, k).abs() > most)
    };
    let (shot, hits) = counts.split_at(4);
    beyond(shot, &known.rays, 0.005)
        || beyond(hits, &known.rays[4..], 0.02)
        || known.haines.is_some_and(|haines| beyond(shot, &haines, 0.1))
}

fn count<R: Precision>(args: &Args, mut scene: Scene) -> Result<[u64; 7], Failure> {
    let geometry = std::mem::replace(&mut scene.geometry, SceneGeometry::Solids(Vec::new()));
    let progress = Progress::new("building", args.quiet);
    let (stage, _) = R::stage(geometry, &args.with, &mut |done| progress.hear(done))?;
    drop(progress);
    let material = |prim: u32| scene.material_of.get(prim as usize).copied().unwrap_or(0);
    let rays = match stage {
        Stage::Solids(shape) => shoot(args, &scene, &*shape, |at: &Member<Uv>| material(at.prim)),
        Stage::Mesh(shape) => shoot(args, &scene, &*shape, |at: &Uv| material(at.prim)),
    }?;
    let RayCounts {
        eye: _,
        eye_hits,
        reflection,
        refraction,
        secondary_hits,
        shadow,
        occluded,
        total_internal,
    } = rays;
    Ok([eye_hits, reflection, refraction, shadow, occluded, secondary_hits, total_internal])
}

fn shoot<R: Real, P: Shape<R> + ?Sized>(
    args: &Args,
    scene: &Scene,
    shape: &P,
    material_of: impl Fn(&P::At) -> u32 + Sync,
) -> Result<RayCounts, Failure> {
    let look = Look { materials: &scene.materials, lights: &scene.lights, background: scene.background };
    let whitted = Whitted::new(shape, material_of, look);
    let camera = Camera::new(&scene.view).map_err(|e| Failure::File(format!("{}: {e}", scene.name)))?;
    let progress = Progress::new("rendering", args.quiet);
    let rendered = Film::new(512, 512).render(&camera, &whitted, &|done| progress.hear(done));
    rendered.map(|(_, rays)| rays).map_err(|_| Failure::Interrupted)
}

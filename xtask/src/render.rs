//! `cargo xtask render`: a picture, and what it took.

use crate::failure::Failure;
use crate::output::{Json, Progress, catch_interrupts, interrupted, say, thousands, write_whole};
use crate::stage::{Bits, Built, Precision, Stage, load};
use clap::ValueEnum;
use rt_accel::{Counts, Member};
use rt_bench::roster;
use rt_geom::Real;
use rt_render::{Camera, Film, Look, Measure, Picture, Plan, RayCounts, Scale, Whitted, heat};
use rt_scenes::{Scene, SceneGeometry};
use rt_shapes::{Shape, Uv};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Make a picture, and say what it took.
///
/// Without arguments: the sphereflake, in out/balls.png.
#[derive(clap::Args)]
#[command(after_help = format!("{EXAMPLES}\n\n{}", scenes()))]
pub(crate) struct Args {
    /// The scene: a name, of those below, or a file that ends in .obj or .nff.
    #[arg(default_value = "balls", value_name = "SCENE|FILE")]
    scene: String,
    /// The structure over the scene.
    #[arg(long, value_name = "STRUCTURE", default_value = DEFAULT_STRUCTURE)]
    with: String,
    /// Where the PNG goes; `-` is stdout. Default: out/SCENE.png.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Side of the picture in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..=16384))]
    size: u32,
    /// Threads; 0 is one per core. The picture does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// Precision of the rays. Default: f32, or f64 where the scene needs it.
    #[arg(long, value_enum)]
    precision: Option<Bits>,
    /// Show what eye rays cost instead of what they see.
    #[arg(long, value_enum, value_name = "WHAT")]
    heat: Option<Heat>,
    /// Say what the scene left out.
    #[arg(long)]
    explain: bool,
    /// Size of a generated scene, in its own terms: instead of the number in its description.
    #[arg(long, value_name = "N")]
    spd_size: Option<u32>,
    /// Overwrite the file given with -o.
    #[arg(long)]
    force: bool,
    /// Say nothing but the result.
    #[arg(long, short)]
    quiet: bool,
    /// Form of the result.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

const DEFAULT_STRUCTURE: &str = roster::NAMES[0];

const EXAMPLES: &str = "\
Examples:
  cargo xtask render                                 the sphereflake in out/balls.png
  cargo xtask render tetra --spd-size 8 --size 1024  a larger scene, a larger picture
  cargo xtask render bunny.obj -o bunny.png --force  a mesh, over an older picture
  cargo xtask render balls --heat nodes              what each eye ray costs
  cargo xtask render --precision f64 --format json   figures for a program";

/// The scenes, a line each.
fn scenes() -> String {
    let line = |name: &&str| format!("  {name:10} {}", rt_scenes::about(name).unwrap_or_default());
    let lines: Vec<String> = rt_scenes::names().iter().map(line).collect();
    format!("Scenes:\n{}", lines.join("\n"))
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Heat {
    Nodes,
    Tests,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// What a picture took.
struct Report {
    built: Built,
    plan: Plan,
    rays: RayCounts,
    time: Duration,
    /// Work of a smaller picture of the same view, and its rays.
    work: (Counts, u64),
    scale: Option<Scale>,
}

/// What is known of a scene before it is built over.
struct Facts {
    name: String,
    primitives: usize,
    degenerate: usize,
    lights: usize,
    warnings: Vec<String>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if !roster::NAMES.contains(&args.with.as_str()) {
        let known = roster::NAMES.join(", ");
        return Err(Failure::Usage(format!("there is no structure {:?}; there are {known}", args.with)));
    }
    let output = target(args)?;
    catch_interrupts();
    let mut scene = load(&args.scene, args.spd_size)?;
    let facts = Facts {
        name: scene.name.clone(),
        primitives: scene.prim_count(),
        degenerate: match &scene.geometry {
            SceneGeometry::Mesh(mesh) => mesh.degenerate(),
            SceneGeometry::FineMesh(mesh) => mesh.degenerate(),
            SceneGeometry::Solids(_) => 0,
        },
        lights: scene.lights.len(),
        warnings: std::mem::take(&mut scene.warnings),
    };
    if !args.quiet {
        for warning in &facts.warnings {
            eprintln!("warning: {warning}");
        }
    }
    let fine = matches!(scene.geometry, SceneGeometry::FineMesh(_));
    let bits = args.precision.unwrap_or(if fine { Bits::F64 } else { Bits::F32 });
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(args.threads))
        .build()
        .map_err(|e| Failure::Usage(format!("--threads {}: {e}", args.threads)))?;
    let (picture, report) = pool.install(|| match bits {
        Bits::F32 => shoot::<f32>(args, scene),
        Bits::F64 => shoot::<f64>(args, scene),
    })?;
    let png = picture.png().map_err(|e| Failure::Check(e.to_string()))?;
    if interrupted() {
        return Err(Failure::Interrupted);
    }
    let to_stdout = output == Path::new("-");
    if to_stdout {
        std::io::stdout().write_all(&png).map_err(|e| Failure::file(&output, e))?;
    } else {
        write_whole(&output, &png)?;
    }
    let threads = pool.current_num_threads();
    let text = match args.format {
        Format::Text => text(args, &output, &facts, &report, bits, threads),
        Format::Json => json(args, &output, &facts, &report, bits, threads) + "\n",
    };
    // The picture has stdout for itself.
    if !to_stdout {
        say!("{}", text.trim_end());
    } else if !args.quiet {
        eprint!("{text}");
    }
    Ok(())
}

/// Where the picture goes; refused early, before hours of rendering.
fn target(args: &Args) -> Result<PathBuf, Failure> {
    let Some(path) = &args.output else {
        let stem = Path::new(&args.scene).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let suffix = match args.heat {
            None => "",
            Some(Heat::Nodes) => "-nodes",
            Some(Heat::Tests) => "-tests",
        };
        return Ok(PathBuf::from("out").join(format!("{stem}{suffix}.png")));
    };
    if path != Path::new("-") {
        if path.is_dir() {
            return Err(Failure::file(path, "is a folder"));
        }
        if std::fs::symlink_metadata(path).is_ok() && !args.force {
            return Err(Failure::file(path, "exists; --force overwrites it"));
        }
    }
    Ok(path.clone())
}

fn shoot<R: Precision>(args: &Args, mut scene: Scene) -> Result<(Picture, Report), Failure> {
    let geometry = std::mem::replace(&mut scene.geometry, SceneGeometry::Solids(Vec::new()));
    let (stage, built) = {
        let progress = Progress::new("building", args.quiet);
        R::stage(geometry, &args.with, &mut |done| progress.hear(done))?
    };
    let material = |prim: u32| scene.material_of.get(prim as usize).copied().unwrap_or(0);
    match stage {
        Stage::Solids(shape) => picture(args, &scene, &*shape, |at: &Member<Uv>| material(at.prim), built),
        Stage::Mesh(shape) => picture(args, &scene, &*shape, |at: &Uv| material(at.prim), built),
    }
}

fn picture<R: Real, P: Shape<R> + ?Sized>(
    args: &Args,
    scene: &Scene,
    shape: &P,
    material_of: impl Fn(&P::At) -> u32 + Sync,
    built: Built,
) -> Result<(Picture, Report), Failure> {
    let look = Look { materials: &scene.materials, lights: &scene.lights, background: scene.background };
    let whitted = Whitted::new(shape, material_of, look);
    let camera = Camera::new(&scene.view).map_err(|e| Failure::File(format!("{}: {e}", args.scene)))?;
    let film = Film::new(args.size, args.size);
    if !camera.corner::<R>([0, 0], [args.size; 2]).is_valid() {
        let from = scene.view.from;
        return Err(Failure::File(format!(
            "{}: no ray of this precision begins at the eye, {from:?}",
            args.scene
        )));
    }
    let stopped = |_| Failure::Interrupted;

    let progress = Progress::new("rendering", args.quiet);
    let start = Instant::now();
    let (mut picture, rays) = film.render(&camera, &whitted, &|done| progress.hear(done)).map_err(stopped)?;
    let time = start.elapsed();
    drop(progress);

    // Counting slows rays down, so it is not done where they are timed.
    let progress = Progress::new("counting", args.quiet);
    let sample = Film::new(args.size.div_ceil(4), args.size.div_ceil(4));
    let (work, counted) = sample.work(&camera, &whitted, &|done| progress.hear(done)).map_err(stopped)?;
    let mut scale = None;
    if let Some(what) = args.heat {
        let measure = match what {
            Heat::Nodes => Measure::Nodes,
            Heat::Tests => Measure::Tests,
        };
        let costs = film.cost(&camera, shape, &|done| progress.hear(done)).map_err(stopped)?;
        let (hot, said) = heat(&film, measure, &costs);
        picture = hot;
        scale = Some(said);
    }
    Ok((picture, Report { built, plan: whitted.plan(), rays, time, work: (work, counted.rays()), scale }))
}

fn name(bits: Bits) -> &'static str {
    match bits {
        Bits::F32 => "f32",
        Bits::F64 => "f64",
    }
}

fn text(args: &Args, output: &Path, facts: &Facts, report: &Report, bits: Bits, threads: usize) -> String {
    let mut lines = String::new();
    let mut line = |what: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(lines, "{what:12} {value}");
    };
    let Report { built, plan, rays, time, work: (work, counted), scale } = report;
    line("picture", output.display().to_string());
    let primitives = thousands(facts.primitives as u64);
    line(
        "scene",
        format!(
            "{}: {primitives} primitives, {} skipped, {} degenerate, {} lights",
            facts.name, built.skipped, facts.degenerate, facts.lights
        ),
    );
    line(
        "structure",
        format!(
            "{}: built in {:.1} ms, {} bytes",
            args.with,
            built.time.as_secs_f64() * 1e3,
            thousands(built.bytes as u64)
        ),
    );
    line("eye", format!("{} rays, {} hit", thousands(rays.eye), thousands(rays.eye_hits)));
    line(
        "secondary",
        format!(
            "{} reflected, {} refracted, {} hit; {} totally reflected inside",
            thousands(rays.reflection),
            thousands(rays.refraction),
            thousands(rays.secondary_hits),
            thousands(rays.total_internal)
        ),
    );
    line("shadow", format!("{} rays, {} occluded", thousands(rays.shadow), thousands(rays.occluded)));
    let seconds = time.as_secs_f64();
    line(
        "time",
        format!(
            "{:.1} ms for {} rays: {:.2} million rays/s, {}, {threads} threads",
            seconds * 1e3,
            thousands(rays.rays()),
            rays.rays() as f64 / seconds / 1e6,
            name(bits)
        ),
    );
    let per_ray = |n: u64| n as f64 / (*counted).max(1) as f64;
    line(
        "per ray",
        format!(
            "{:.2} nodes, {:.2} leaves, {:.2} primitive tests (all kinds, of {} rays)",
            per_ray(work.nodes),
            per_ray(work.leaves),
            per_ray(work.prims),
            thousands(*counted)
        ),
    );
    if let Some(scale) = scale {
        line("scale", scale.to_string());
    }
    if args.explain {
        for (i, why) in plan.to_string().lines().enumerate() {
            line(if i == 0 { "left out" } else { "" }, why.to_string());
        }
    }
    lines
}

fn json(args: &Args, output: &Path, facts: &Facts, report: &Report, bits: Bits, threads: usize) -> String {
    let Report { built, plan, rays, time, work: (work, counted), scale } = report;
    let per_ray = |n: u64| Json::Number(n as f64 / (*counted).max(1) as f64);
    let mut fields = vec![
        ("schema", Json::Whole(1)),
        ("picture", Json::Text(output.display().to_string())),
        ("scene", Json::Text(facts.name.clone())),
        ("primitives", Json::Whole(facts.primitives as u64)),
        ("skipped", Json::Whole(built.skipped as u64)),
        ("degenerate", Json::Whole(facts.degenerate as u64)),
        ("lights", Json::Whole(facts.lights as u64)),
        ("structure", Json::Text(args.with.clone())),
        ("precision", Json::Text(name(bits).into())),
        ("threads", Json::Whole(threads as u64)),
        ("build_ns", Json::Whole(built.time.as_nanos() as u64)),
        ("bytes", Json::Whole(built.bytes as u64)),
        ("render_ns", Json::Whole(time.as_nanos() as u64)),
        ("rays", Json::Whole(rays.rays())),
        ("rays_per_s", Json::Number(rays.rays() as f64 / time.as_secs_f64())),
        ("eye", Json::Whole(rays.eye)),
        ("eye_hits", Json::Whole(rays.eye_hits)),
        ("reflection", Json::Whole(rays.reflection)),
        ("refraction", Json::Whole(rays.refraction)),
        ("secondary_hits", Json::Whole(rays.secondary_hits)),
        ("total_internal", Json::Whole(rays.total_internal)),
        ("shadow", Json::Whole(rays.shadow)),
        ("occluded", Json::Whole(rays.occluded)),
        ("counted_rays", Json::Whole(*counted)),
        ("nodes_per_ray", per_ray(work.nodes)),
        ("leaves_per_ray", per_ray(work.leaves)),
        ("tests_per_ray", per_ray(work.prims)),
        ("warnings", Json::List(facts.warnings.iter().cloned().map(Json::Text).collect())),
    ];
    if let Some(scale) = scale {
        fields.push((
            "scale",
            Json::Object(vec![
                ("top", Json::Whole(scale.top)),
                ("mean", Json::Number(scale.mean)),
                ("max", Json::Whole(scale.max)),
            ]),
        ));
    }
    if args.explain {
        let left_out = plan.to_string().lines().map(|why| Json::Text(why.into())).collect();
        fields.push(("left_out", Json::List(left_out)));
    }
    Json::Object(fields).to_string()
}

//! [`Stage`]: a scene under a structure, ready for rays of one precision.

use crate::failure::Failure;
use rt_accel::{Aggregate, Bounded, BuildError, Member, Structure};
use rt_bench::roster::{self, Job};
use rt_geom::Real;
use rt_scenes::{Scene, SceneGeometry};
use rt_shapes::{Shape, Surfaced, Uv};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// A shape whose structure is forgotten, so that the renderer is compiled once and not for each structure. Rays come in
/// batches, one virtual call each: balls took as long either way (medians of 15 turns each: 499 ms and 500 ms).
pub(crate) type AnyShape<R, A> = Box<dyn Shape<R, At = A>>;

/// The shapes of a scene: of solids, or of a mesh.
pub(crate) enum Stage<R: Real> {
    Solids(AnyShape<R, Member<Uv>>),
    Mesh(AnyShape<R, Uv>),
}

/// What a build took.
pub(crate) struct Built {
    pub(crate) time: Duration,
    pub(crate) bytes: usize,
    pub(crate) skipped: usize,
}

/// A scene by name, or from a file.
pub(crate) fn load(name: &str, size: Option<u32>) -> Result<Scene, Failure> {
    let path = Path::new(name);
    let suffix = path.extension().map(|e| e.to_ascii_lowercase());
    let suffix = suffix.as_deref().and_then(|e| e.to_str());
    if let Some(suffix @ ("obj" | "nff")) = suffix {
        if size.is_some() {
            return Err(Failure::Usage("--spd-size is for generated scenes, not for files".into()));
        }
        // The errors name the file.
        return match suffix {
            "obj" => rt_scenes::obj::load(path).map_err(|e| Failure::File(e.to_string())),
            _ => rt_scenes::nff::load(path).map_err(|e| Failure::File(e.to_string())),
        };
    }
    if name.contains(['/', '\\', '.']) {
        let why = format!(
            "{name}: only .obj and .nff files can be read; scenes are {}",
            rt_scenes::names().join(", ")
        );
        return Err(Failure::Usage(why));
    }
    rt_scenes::by_name(name, size).map_err(|e| Failure::Usage(e.to_string()))
}

/// A precision of rays, by name.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub(crate) enum Bits {
    F32,
    F64,
}

/// A precision of rays, and which scenes they can be shot into.
pub(crate) trait Precision: Real {
    fn stage(
        scene: SceneGeometry,
        structure: &str,
        watch: &mut dyn FnMut(f32) -> ControlFlow<()>,
    ) -> Result<(Stage<Self>, Built), Failure>;
}

impl Precision for f32 {
    fn stage(
        geometry: SceneGeometry,
        structure: &str,
        watch: &mut dyn FnMut(f32) -> ControlFlow<()>,
    ) -> Result<(Stage<f32>, Built), Failure> {
        match geometry {
            SceneGeometry::Mesh(mesh) => build(mesh, structure, watch).map(|(s, b)| (Stage::Mesh(s), b)),
            SceneGeometry::Solids(solids) => {
                build(solids, structure, watch).map(|(s, b)| (Stage::Solids(s), b))
            }
            SceneGeometry::FineMesh(_) => {
                let why = "the triangles of this scene cannot be told apart in f32: use --precision f64";
                Err(Failure::Usage(why.into()))
            }
        }
    }
}

impl Precision for f64 {
    fn stage(
        geometry: SceneGeometry,
        structure: &str,
        watch: &mut dyn FnMut(f32) -> ControlFlow<()>,
    ) -> Result<(Stage<f64>, Built), Failure> {
        match geometry {
            SceneGeometry::Mesh(mesh) => build(mesh, structure, watch).map(|(s, b)| (Stage::Mesh(s), b)),
            SceneGeometry::FineMesh(mesh) => build(mesh, structure, watch).map(|(s, b)| (Stage::Mesh(s), b)),
            SceneGeometry::Solids(solids) => {
                build(solids, structure, watch).map(|(s, b)| (Stage::Solids(s), b))
            }
        }
    }
}

fn build<R: Real, G: Surfaced<R> + Bounded + 'static>(
    geometry: G,
    structure: &str,
    watch: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<(AnyShape<R, G::At>, Built), Failure> {
    match roster::with(structure, Build { geometry, watch, precision: std::marker::PhantomData }) {
        Ok(Ok(built)) => Ok(built),
        Ok(Err(BuildError::Cancelled)) => Err(Failure::Interrupted),
        Ok(Err(error)) => Err(Failure::Check(format!("{structure}: {error}"))),
        Err(unknown) => Err(Failure::Usage(unknown)),
    }
}

struct Build<'a, R, G> {
    geometry: G,
    watch: &'a mut dyn FnMut(f32) -> ControlFlow<()>,
    precision: std::marker::PhantomData<R>,
}

impl<R: Real, G: Surfaced<R> + Bounded + 'static> Job for Build<'_, R, G> {
    type Out = Result<(AnyShape<R, G::At>, Built), BuildError>;

    fn run<S: Structure + 'static>(self, params: &S::Params) -> Self::Out {
        let start = Instant::now();
        let scene = Aggregate::<S, G>::build_watched(self.geometry, params, self.watch)?;
        let structure = scene.structure();
        let built =
            Built { time: start.elapsed(), bytes: structure.bytes(), skipped: structure.skipped().len() };
        Ok((Box::new(scene), built))
    }
}

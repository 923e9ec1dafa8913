//! [`Fielded`]: a structure over a scene, whichever it is; [`Population`]: the rays that a picture takes.

use crate::Trouble;
use crate::contest::Named;
use crate::roster::{self, Job};
use core::hint::black_box;
use core::ops::ControlFlow;
use rt_accel::{
    Aggregate, Bounded, BuildError, Counts, Exhaustive, Geometry, Hit, Primitive, Structure, WorldBound,
};
use rt_bounds::Aabb;
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_measure::rays::Seeded;
use rt_render::{Camera, Film, Look, Whitted};
use rt_scenes::Scene;
use rt_shapes::{Partials, Shape, Surface, Surfaced};
use std::sync::Mutex;

/// What a ray of `f32` met: which primitive, how far.
pub(crate) type Met = Option<(u32, f32)>;

/// A structure over a scene, when both are forgotten.
pub(crate) trait Fielded {
    fn closest(&self, rays: &[Ray]) -> Vec<Met>;
    fn any(&self, rays: &[Ray]) -> Vec<bool>;
    /// The work of both.
    fn counts(&self, rays: &Population) -> Counts;
    /// Both, for the clock.
    fn shoot(&self, rays: &Population);
    fn bytes(&self) -> usize;
    /// Leaves that are not empty, and primitive numbers in all of them.
    fn leaves(&self) -> [usize; 2];
}

impl<S: Structure, G: Geometry<f32>> Fielded for Aggregate<S, G>
where
    G::At: Named,
{
    fn closest(&self, rays: &[Ray]) -> Vec<Met> {
        rays.iter().map(|ray| self.intersect(ray).map(|hit| (hit.at.prim(), hit.t))).collect()
    }
    fn any(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.intersect_p(ray)).collect()
    }
    fn counts(&self, rays: &Population) -> Counts {
        let mut counts = Counts::default();
        for ray in &rays.closest {
            self.intersect_counted(ray, &mut counts);
        }
        for ray in &rays.any {
            self.intersect_p_counted(ray, &mut counts);
        }
        counts
    }
    fn shoot(&self, rays: &Population) {
        for ray in &rays.closest {
            black_box(self.intersect(black_box(ray)));
        }
        for ray in &rays.any {
            black_box(self.intersect_p(black_box(ray)));
        }
    }
    fn bytes(&self) -> usize {
        self.structure().bytes()
    }
    fn leaves(&self) -> [usize; 2] {
        let mut sum = [0, 0];
        self.structure().gather(&mut |_| true, &mut |leaf| sum = [sum[0] + 1, sum[1] + leaf.prims.len()]);
        sum
    }
}

/// Builds `S` over a geometry.
pub(crate) fn field<'a, S, G>(
    geometry: &'a G,
    params: &S::Params,
) -> Result<Box<dyn Fielded + 'a>, BuildError>
where
    S: Structure + 'static,
    G: Geometry<f32>,
    G::At: Named,
{
    Ok(Box::new(Aggregate::<S, &G>::build(geometry, params)?))
}

/// Builds the structure called `name` over a geometry.
pub(crate) fn field_named<'a, G>(name: &str, geometry: &'a G) -> Result<Box<dyn Fielded + 'a>, BuildError>
where
    G: Geometry<f32>,
    G::At: Named,
{
    struct Build<'a, G>(&'a G);
    impl<'a, G: Geometry<f32>> Job for Build<'a, G>
    where
        G::At: Named,
    {
        type Out = Result<Box<dyn Fielded + 'a>, BuildError>;
        fn run<S: Structure + 'static>(self, params: &S::Params) -> Self::Out {
            field::<S, G>(self.0, params)
        }
    }
    let unknown = |_| Err(BuildError::BadParam { name: "structure", why: "there is none of this name" });
    roster::with(name, Build(geometry)).unwrap_or_else(unknown)
}

/// Rays that want the closest hit, and rays that want any.
#[derive(Clone, Debug, Default)]
pub(crate) struct Population {
    pub(crate) closest: Vec<Ray>,
    pub(crate) any: Vec<Ray>,
}

impl Population {
    pub(crate) fn len(&self) -> usize {
        self.closest.len() + self.any.len()
    }

    /// All rays of a picture of `side x side` pixels, by the rules of [`Whitted`]; of those a sample of about `most`, each kind
    /// with its share, spread evenly.
    pub(crate) fn of_picture<G: Surfaced<f32> + Bounded>(
        scene: &Scene,
        geometry: &G,
        side: u32,
        most: usize,
    ) -> Result<Population, Trouble>
    where
        G::At: Named,
    {
        let recorder = Recorder {
            inner: Aggregate::<Bvh, &G>::build(geometry, &BvhParams::default())?,
            heard: Mutex::default(),
        };
        let camera = Camera::new(&scene.view).map_err(|e| Trouble::Scene(e.to_string()))?;
        let look = Look { materials: &scene.materials, lights: &scene.lights, background: scene.background };
        let material = |at: &G::At| scene.material_of.get(at.prim() as usize).copied().unwrap_or(0);
        let whitted = Whitted::new(&recorder, material, look);
        // One tile, so that rays are heard in the same order at any number of threads.
        let film = Film::new(side, side).tiled(side + 1);
        let pictured = film.render::<f32, _, _>(&camera, &whitted, &|_| ControlFlow::Continue(()));
        pictured.map_err(|_| Trouble::Stopped)?;
        let all = recorder.heard.into_inner().unwrap_or_default();
        let (of, mut seeded) = (all.len(), Seeded::new(5));
        let mut some = |rays: Vec<Ray>| -> Vec<Ray> {
            let count = if of > most {
                (rays.len() as f64 * most as f64 / of as f64).round() as usize
            } else {
                rays.len()
            };
            let place = |i: usize, jitter: f64| (i as f64 + jitter) * rays.len() as f64 / count as f64;
            if count == rays.len() {
                return rays;
            }
            (0..count).filter_map(|i| rays.get(place(i, seeded.unit()) as usize).copied()).collect()
        };
        Ok(Population { closest: some(all.closest), any: some(all.any) })
    }
}

/// Hears what rays a renderer shoots.
struct Recorder<'a, G> {
    inner: Aggregate<Bvh, &'a G>,
    heard: Mutex<Population>,
}

impl<G: Geometry<f32>> WorldBound for Recorder<'_, G> {
    fn world_bound(&self) -> Aabb {
        self.inner.world_bound()
    }
}

impl<G: Geometry<f32>> Primitive<f32> for Recorder<'_, G> {
    type At = G::At;

    fn intersect(&self, ray: &Ray) -> Option<Hit<G::At>> {
        self.inner.intersect(ray)
    }
    fn intersect_many(&self, rays: &[Ray], hits: &mut [Option<Hit<G::At>>]) {
        if let Ok(mut heard) = self.heard.lock() {
            heard.closest.extend_from_slice(rays);
        }
        self.inner.intersect_many(rays, hits);
    }
    fn intersect_p_many(&self, rays: &[Ray], hits: &mut [bool]) {
        if let Ok(mut heard) = self.heard.lock() {
            heard.any.extend_from_slice(rays);
        }
        self.inner.intersect_p_many(rays, hits);
    }
}

impl<G: Surfaced<f32>> Shape<f32> for Recorder<'_, G> {
    fn surface(&self, ray: &Ray, hit: &Hit<G::At>) -> Surface {
        self.inner.geometry().surface(ray, hit)
    }
    fn partials(&self, ray: &Ray, hit: &Hit<G::At>) -> Partials {
        self.inner.geometry().partials(ray, hit)
    }
}

/// What [`Exhaustive`] says to some of the rays: `judged` of them, spread evenly.
pub(crate) struct Truth {
    closest: Vec<(usize, Met)>,
    any: Vec<(usize, bool)>,
}

impl Truth {
    pub(crate) fn of<G>(geometry: &G, rays: &Population, judged: usize) -> Result<Truth, Trouble>
    where
        G: Geometry<f32>,
        G::At: Named,
    {
        let every = field::<Exhaustive, G>(geometry, &())?;
        let share = |n: usize| (n * judged / rays.len().max(1)).min(n);
        let some = |n: usize| (0..share(n)).map(move |i| i * n / share(n).max(1));
        Ok(Truth {
            closest: some(rays.closest.len()).map(|i| (i, every.closest(&rays.closest[i..=i])[0])).collect(),
            any: some(rays.any.len()).map(|i| (i, every.any(&rays.any[i..=i])[0])).collect(),
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.closest.len() + self.any.len()
    }

    /// How answers differ from it; `None` if they do not.
    pub(crate) fn differ(&self, closest: &[Met], any: &[bool]) -> Option<String> {
        let wrong = self.closest.iter().find(|(i, met)| closest[*i] != *met);
        if let Some((i, met)) = wrong {
            return Some(format!("ray {i}: {:?}, exhaustively {met:?}", closest[*i]));
        }
        let wrong = self.any.iter().find(|(i, met)| any[*i] != *met);
        wrong.map(|(i, met)| format!("shadow ray {i}: {}, exhaustively {met}", any[*i]))
    }
}

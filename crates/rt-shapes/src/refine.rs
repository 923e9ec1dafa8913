//! [`Refine`] and [`Lazy`]: surfaces that no ray can hit until they are made of something that can be hit.

use crate::{MeshError, Partials, Shape, Surface, Surfaced};
use core::ops::ControlFlow;
use rt_accel::{Aggregate, Bounded, BuildError, Counts, Geometry, Hit, Primitive, Structure, WorldBound};
use rt_bounds::{Aabb, SlabRay};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, Vector};
use std::sync::OnceLock;

/// A surface that is hit only through the parts it is turned into: subdivision surfaces, patches to be tessellated, terrains.
///
/// Whether a thing can be hit is a fact of its type: a [`Primitive`] can, a `Refine` cannot, and nobody has to ask at run time.
/// Refine it by hand and build an [`Aggregate`] over its parts, or let [`Lazy`] do both when the first ray comes near.
///
/// What it becomes is a type of its own choice: a [`TriangleMesh`](crate::TriangleMesh) of either precision, a `Vec` of patches,
/// or a `Vec` of [`Lazy`] pieces, which are refined again where rays come near *them*.
pub trait Refine: WorldBound {
    /// What it becomes.
    type Parts: Bounded;

    /// Turns it into parts, each of whose bounds lies inside [`WorldBound::world_bound`]. Equal surfaces give equal parts.
    ///
    /// # Errors
    ///
    /// [`BuildError::OutOfMemory`] or [`BuildError::TooManyPrimitives`] when there would be too many parts, and
    /// [`BuildError::BadParam`] for parameters that make no surface.
    fn refine(&self) -> Result<Self::Parts, BuildError>;
}

impl From<MeshError> for BuildError {
    fn from(error: MeshError) -> BuildError {
        match error {
            MeshError::TooManyTriangles { len } => {
                BuildError::TooManyPrimitives { len, max: u32::MAX as usize - 2 }
            }
            _ => BuildError::BadParam { name: "mesh", why: "its arrays do not fit each other" },
        }
    }
}

/// A surface refined, and arranged by the structure `S`, when the first ray reaches its bound; from then on as quick as its parts.
///
/// Ask it from any number of threads. Afterwards a query costs one load more than the parts alone: there is no lock on the way of a
/// ray. Before, a ray that misses the bound costs a box test, so that surfaces no ray comes near cost neither time nor memory.
///
/// *Refinement happens once.* Threads that arrive meanwhile wait for it, and do nothing else. Nor does the thread that
/// refines: were it to lend itself to others while a parallel build borrows threads, it could pick up a ray that reaches the
/// surface it is building, or borrow a thread that waits for it, and neither would ever end. So the work is done on
/// threads of its own, where there are no rays: one to refine, as many as the caller's pool has to build over 65 536 parts or
/// more. They cost some 0.1 ms, a build of a few hundred triangles. [`Refine::refine`] is free to use rayon, but must not wait for
/// a pool that rays are shot in, nor shoot rays at surfaces that wait for its own. Without the feature `parallel` all is done in
/// place, and neither [`Refine::refine`] nor the build may use rayon.
///
/// **If refinement fails**, for want of memory or of threads, or because parts stick out of the bound, every ray misses the
/// surface, now and later, and nothing is tried again. [`Lazy::refined`] says so after rendering; [`Lazy::refine_now`] says so
/// before. [`Lazy::update`] changes the surface and forgets the failure. If it panics, so does the query that began it, and the
/// next one tries again.
///
/// ```
/// use rt_accel::{BuildError, Exhaustive, Primitive, WorldBound};
/// use rt_bounds::Aabb;
/// use rt_geom::{Ray, glam::Vec3A};
/// use rt_shapes::{Lazy, Refine, TriangleMesh};
///
/// /// A square of `n * n` cells at a height.
/// struct Square { n: u16, height: f32 }
///
/// impl WorldBound for Square {
///     fn world_bound(&self) -> Aabb {
///         Aabb::new(Vec3A::ZERO.with_z(self.height), Vec3A::ONE.with_z(self.height))
///     }
/// }
/// impl Refine for Square {
///     type Parts = TriangleMesh;
///     fn refine(&self) -> Result<TriangleMesh, BuildError> {
///         let (n, w) = (self.n as u32, self.n as u32 + 1);
///         let at = |i: u32| i as f32 / n as f32;
///         let corners = (0..w * w).map(|i| [at(i % w), at(i / w), self.height]).collect();
///         let cell = |i: u32| { let a = i / n * w + i % n; [[a, a + 1, a + w + 1], [a, a + w + 1, a + w]] };
///         Ok(TriangleMesh::new(corners, (0..n * n).flat_map(cell).collect())?)
///     }
/// }
///
/// let squares: Vec<_> =
///     (0..5).map(|z| Lazy::<Exhaustive, _>::new(Square { n: 9, height: z as f32 }, ())).collect();
/// let refined = || squares.iter().filter(|square| square.refined().is_some()).count();
/// let ray = Ray::new(Vec3A::new(0.3, 0.7, 2.5), Vec3A::Z);
/// assert_eq!(squares.iter().filter(|square| square.intersect_p(&ray)).count(), 2);
/// assert_eq!(refined(), 2);
/// ```
///
/// Source: Pharr, Humphreys, *Physically Based Rendering* (2004), section 4.1.
#[derive(Debug)]
pub struct Lazy<S: Structure, R: Refine> {
    surface: R,
    params: S::Params,
    bound: Aabb,
    parts: OnceLock<Result<Aggregate<S, R::Parts>, BuildError>>,
}

impl<S: Structure, R: Refine> Lazy<S, R> {
    /// The surface, to be refined when a ray comes near and then arranged with these parameters.
    pub fn new(surface: R, params: S::Params) -> Lazy<S, R> {
        let bound = surface.world_bound();
        Lazy { surface, params, bound, parts: OnceLock::new() }
    }

    /// What is refined.
    pub fn surface(&self) -> &R {
        &self.surface
    }

    /// What refinement came to, if there has been any: the parts, or why there are none.
    pub fn refined(&self) -> Option<Result<&Aggregate<S, R::Parts>, &BuildError>> {
        self.parts.get().map(Result::as_ref)
    }

    /// Refines now, unless that has been done: for those who want to know before the first ray whether it can be done.
    ///
    /// # Errors
    ///
    /// Those of [`Refine::refine`] and of the build; [`BuildError::BadParam`] named `world_bound` when a part sticks out of
    /// the bound of the surface, because rays that meet it there would have been turned away.
    pub fn refine_now(&self) -> Result<&Aggregate<S, R::Parts>, &BuildError> {
        self.parts.get_or_init(|| apart(|large| self.build(large))).as_ref()
    }

    #[cold]
    fn build(&self, large: Large) -> Result<Aggregate<S, R::Parts>, BuildError> {
        let parts = self.surface.refine()?;
        let sticks_out = |prim: u32| {
            let bound = parts.bound(prim);
            bound.is_valid() && !self.bound.contains(bound)
        };
        if (0..u32::try_from(parts.prim_count()).unwrap_or(u32::MAX)).any(sticks_out) {
            return Err(BuildError::BadParam {
                name: "world_bound",
                why: "does not contain what it was refined to",
            });
        }
        if parts.prim_count() < LARGE {
            return Aggregate::build(parts, &self.params);
        }
        large.run(|| Aggregate::build(parts, &self.params))?
    }

    /// Changes the surface, and forgets what it was refined to. A structure above has to be refitted.
    pub fn update(&mut self, change: impl FnOnce(&mut R)) {
        change(&mut self.surface);
        self.bound = self.surface.world_bound();
        self.parts = OnceLock::new();
    }

    /// The parts, if the ray has any business with them.
    #[inline(always)]
    fn near<T: Real>(&self, ray: &Ray<T>) -> Option<&Aggregate<S, R::Parts>> {
        match self.parts.get() {
            Some(parts) => parts.as_ref().ok(),
            None => self.touched(ray),
        }
    }

    #[cold]
    fn touched<T: Real>(&self, ray: &Ray<T>) -> Option<&Aggregate<S, R::Parts>> {
        if !self.reached(ray) {
            return None;
        }
        self.refine_now().ok()
    }

    fn reached<T: Real>(&self, ray: &Ray<T>) -> bool {
        ray.is_valid()
            && self.bound.is_valid()
            && SlabRay::new(ray, DVec3::ZERO, &self.bound).entry(&self.bound).is_some()
    }
}

/// So many parts are built over on several threads: below, these cost more than they save.
const LARGE: usize = 1 << 16;

/// Threads for large builds.
#[derive(Clone, Copy)]
struct Large {
    #[cfg(feature = "parallel")]
    threads: usize,
}

/// Does some work in a pool of one new thread: whatever is parallel in it finds no task but its own. The caller sleeps.
#[cfg(feature = "parallel")]
fn apart<T: Send>(work: impl FnOnce(Large) -> Result<T, BuildError> + Send) -> Result<T, BuildError> {
    let large = Large { threads: rayon::current_num_threads() };
    let alone = || Large { threads: 1 }.run(|| work(large)).flatten();
    if rayon::current_thread_index().is_none() {
        return alone();
    }
    // A thread of a pool would look for other work while it waits for another pool. It does not while it waits for a thread.
    std::thread::scope(|scope| match std::thread::Builder::new().spawn_scoped(scope, alone) {
        Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
        Err(_) => Err(NO_THREAD),
    })
}

#[cfg(feature = "parallel")]
const NO_THREAD: BuildError =
    BuildError::BadParam { name: "parallel", why: "no thread was to be had to refine on" };

#[cfg(feature = "parallel")]
impl Large {
    /// Does some work in a new pool. To be called where a thread that waits finds no rays: outside of pools, or in one of ours.
    fn run<T: Send>(self, work: impl FnOnce() -> T + Send) -> Result<T, BuildError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        Ok(pool.map_err(|_| NO_THREAD)?.install(work))
    }
}

#[cfg(not(feature = "parallel"))]
fn apart<T>(work: impl FnOnce(Large) -> Result<T, BuildError>) -> Result<T, BuildError> {
    work(Large {})
}

#[cfg(not(feature = "parallel"))]
impl Large {
    fn run<T>(self, work: impl FnOnce() -> T) -> Result<T, BuildError> {
        Ok(work())
    }
}

impl<S: Structure, R: Refine> WorldBound for Lazy<S, R> {
    fn world_bound(&self) -> Aabb {
        self.bound
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.surface.world_bound_from(origin)
    }
}

impl<T: Real, S: Structure, R: Refine<Parts: Geometry<T>>> Primitive<T> for Lazy<S, R> {
    type At = <R::Parts as Geometry<T>>::At;

    #[inline]
    fn intersect(&self, ray: &Ray<T>) -> Option<Hit<Self::At, T>> {
        self.near(ray)?.intersect(ray)
    }
    #[inline]
    fn intersect_p(&self, ray: &Ray<T>) -> bool {
        self.near(ray).is_some_and(|parts| parts.intersect_p(ray))
    }
    fn all_hits(
        &self,
        ray: &Ray<T>,
        each: &mut dyn FnMut(Hit<Self::At, T>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.near(ray).map_or(ControlFlow::Continue(()), |parts| parts.all_hits(ray, each))
    }
    fn intersect_many(&self, rays: &[Ray<T>], hits: &mut [Option<Hit<Self::At, T>>]) {
        // One that comes near speaks for all.
        match rays.iter().find_map(|ray| self.near(ray)) {
            Some(parts) => parts.intersect_many(rays, hits),
            None => hits[..rays.len()].fill(None),
        }
    }
    fn intersect_p_many(&self, rays: &[Ray<T>], hits: &mut [bool]) {
        match rays.iter().find_map(|ray| self.near(ray)) {
            Some(parts) => parts.intersect_p_many(rays, hits),
            None => hits[..rays.len()].fill(false),
        }
    }
    fn intersect_counted(&self, ray: &Ray<T>, counts: &mut Counts) -> Option<Hit<Self::At, T>> {
        self.near(ray)?.intersect_counted(ray, counts)
    }
    fn intersect_p_counted(&self, ray: &Ray<T>, counts: &mut Counts) -> bool {
        self.near(ray).is_some_and(|parts| parts.intersect_p_counted(ray, counts))
    }
}

impl<T: Real, S: Structure, R: Refine<Parts: Surfaced<T>>> Shape<T> for Lazy<S, R> {
    /// For a hit that this surface never reported, because it could not be refined: a plane across the ray.
    fn surface(&self, ray: &Ray<T>, hit: &Hit<Self::At, T>) -> Surface {
        if let Ok(parts) = self.refine_now() {
            return parts.surface(ray, hit);
        }
        let point = ray.at(hit.t).widen();
        let normal = -ray.dir.widen().normalize_or(DVec3::Z);
        Surface { point, error: point.abs() * f64::EPSILON, normal, shading: normal, uv: DVec2::ZERO }
    }

    fn partials(&self, ray: &Ray<T>, hit: &Hit<Self::At, T>) -> Partials {
        self.refine_now().map_or(Partials::default(), |parts| parts.partials(ray, hit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sphere, TriangleMesh};
    use rayon::prelude::*;
    use rt_accel::Exhaustive;
    use rt_geom::glam::Vec3A;
    use std::panic::AssertUnwindSafe;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::RecvTimeoutError;
    use std::time::Duration;

    /// Balls along x in a box, refined as told.
    struct Balls<'a> {
        count: usize,
        reach: f32,
        refine: &'a (dyn Fn() -> Result<(), BuildError> + Sync + Send),
    }

    impl WorldBound for Balls<'_> {
        fn world_bound(&self) -> Aabb {
            Aabb::new(Vec3A::splat(-1.0), Vec3A::new(self.reach, 1.0, 1.0))
        }
    }

    impl Refine for Balls<'_> {
        type Parts = Vec<Sphere>;
        fn refine(&self) -> Result<Vec<Sphere>, BuildError> {
            (self.refine)()?;
            let ball = |i| Sphere::new(DVec3::X * (3.0 * i as f64), 1.0);
            Ok((0..self.count).flat_map(ball).collect())
        }
    }

    fn at(x: f32) -> Ray {
        Ray::new(Vec3A::new(x, 0.5, 9.0), -Vec3A::Z)
    }

    #[test]
    fn refines_when_a_ray_comes_near_and_only_then() {
        let calls = AtomicUsize::new(0);
        let refine = || {
            calls.fetch_add(1, Ordering::Relaxed);
            Ok(())
        };
        let balls = Lazy::<Exhaustive, _>::new(Balls { count: 3, reach: 7.0, refine: &refine }, ());
        let mut hits = [None; 2];
        assert!(!balls.intersect_p(&at(8.0)));
        assert!(balls.intersect(&at(1.0).between(0.0, 7.5)).is_none(), "ends before the bound");
        assert!(balls.intersect(&Ray { dir: Vec3A::NAN, ..at(0.0) }).is_none());
        balls.intersect_many(&[at(-2.0), at(8.0)], &mut hits);
        assert!(balls.refined().is_none() && calls.load(Ordering::Relaxed) == 0);
        // Near, though it hits nothing.
        assert!(!balls.intersect_p(&at(1.5)));
        assert!(balls.refined().is_some_and(|parts| parts.is_ok()));
        let hit = balls.intersect(&at(3.0)).unwrap();
        assert_eq!(hit.at.prim, 1);
        assert!((Shape::surface(&balls, &at(3.0), &hit).normal.y - 0.5).abs() < 1e-6);
        balls.intersect_many(&[at(-2.0), at(6.0)], &mut hits);
        assert_eq!((hits[0].is_some(), hits[1].map(|hit| hit.at.prim)), (false, Some(2)));
        assert_eq!(calls.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn failures_are_misses_and_can_be_seen() {
        let short = || Err(BuildError::OutOfMemory { needed: 9, limit: 8 });
        let mut balls = Lazy::<Exhaustive, _>::new(Balls { count: 1, reach: 1.0, refine: &short }, ());
        assert!(balls.intersect(&at(0.0)).is_none());
        assert_eq!(balls.refined().unwrap().unwrap_err(), &BuildError::OutOfMemory { needed: 9, limit: 8 });
        assert_eq!(balls.refine_now().unwrap_err(), &BuildError::OutOfMemory { needed: 9, limit: 8 });
        let hit = Hit { t: 8.0, at: rt_accel::Member { prim: 7, at: crate::Uv::default() } };
        assert_eq!(Shape::surface(&balls, &at(0.0), &hit).point, DVec3::new(0.0, 0.5, 1.0));

        let fine = || Ok(());
        balls.update(|balls| (balls.refine, balls.count) = (&fine, 2));
        assert!(matches!(balls.refine_now(), Err(BuildError::BadParam { name: "world_bound", .. })));
        balls.update(|balls| balls.reach = 4.0);
        assert!(balls.intersect_p(&at(3.0)) && balls.world_bound().max.x == 4.0);
    }

    /// Fails rather than hangs.
    fn in_time(work: impl FnOnce() + Send + 'static) {
        let (done, over) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            work();
            let _ = done.send(());
        });
        match over.recv_timeout(Duration::from_secs(60)) {
            Err(RecvTimeoutError::Timeout) => panic!("nobody ever ends"),
            _ => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
        }
    }

    /// Work that lends itself to whoever looks for some, for as long as it takes the others to come along.
    fn parallel_work() {
        (0..64).into_par_iter().for_each(|_| std::thread::sleep(Duration::from_micros(200)));
    }

    #[test]
    fn refinement_happens_once_whoever_asks() {
        in_time(|| {
            for round in 0..20 {
                let calls = AtomicUsize::new(0);
                let refine = || {
                    parallel_work();
                    calls.fetch_add(1, Ordering::Relaxed);
                    Ok(())
                };
                let balls = Lazy::<Exhaustive, _>::new(Balls { count: 3, reach: 7.0, refine: &refine }, ());
                let ask = |k: usize| {
                    let hit = balls.intersect(&at((k % 3) as f32 * 3.0));
                    assert_eq!(hit.map(|hit| hit.at.prim), Some(k as u32 % 3));
                };
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1 + round % 4).build().unwrap();
                std::thread::scope(|scope| {
                    if round % 2 == 0 {
                        (0..4).for_each(|k| drop(scope.spawn(move || (0..100).for_each(|i| ask(k + i)))));
                    }
                    pool.install(|| (0..1000).into_par_iter().for_each(ask));
                    // In the pool that is everybody's.
                    (0..1000).into_par_iter().for_each(ask);
                });
                assert_eq!(calls.load(Ordering::Relaxed), 1);
            }
        });
    }

    #[test]
    fn many_surfaces_refine_at_once_in_few_threads() {
        in_time(|| {
            let calls = AtomicUsize::new(0);
            let refine = || {
                parallel_work();
                calls.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            let all: Vec<_> = (0..8)
                .map(|_| Lazy::<Exhaustive, _>::new(Balls { count: 3, reach: 7.0, refine: &refine }, ()))
                .collect();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            pool.install(|| {
                (0..400).into_par_iter().for_each(|k: usize| {
                    // Near and far, forward and backward, so that they wait for each other crosswise.
                    let (a, b) = rayon::join(
                        || all[k % 8].intersect_p(&at(0.0)),
                        || all[7 - k % 8].intersect_p(&at(3.0)),
                    );
                    assert!(a && b);
                });
            });
            assert_eq!(calls.load(Ordering::Relaxed), 8);
        });
    }

    #[test]
    fn large_builds_have_threads_of_their_own() {
        in_time(|| {
            let balls = Lazy::<Exhaustive, _>::new(Balls { count: LARGE, reach: 3e5, refine: &PLAIN }, ());
            (0..64).into_par_iter().for_each(|_| assert!(balls.intersect_p(&at(3.0))));
            let threads = apart(|large| {
                let own = rayon::current_num_threads();
                large.run(|| (own, rayon::current_num_threads()))
            });
            assert_eq!(threads, Ok((1, rayon::current_num_threads())));
        });
    }

    #[test]
    fn a_panic_is_the_askers_and_the_next_one_tries_again() {
        in_time(|| {
            let calls = AtomicUsize::new(0);
            let refine = || match calls.fetch_add(1, Ordering::SeqCst) {
                0 => std::panic::panic_any("spoilt"),
                _ => Ok(()),
            };
            let balls = Lazy::<Exhaustive, _>::new(Balls { count: 3, reach: 7.0, refine: &refine }, ());
            let ask = || std::panic::catch_unwind(AssertUnwindSafe(|| balls.intersect_p(&at(6.0))));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            let asked: Vec<_> = pool.install(|| (0..50).into_par_iter().map(|_| ask()).collect());
            let panicked: Vec<_> = asked.iter().filter_map(|answer| answer.as_ref().err()).collect();
            assert_eq!(panicked.len(), 1);
            assert_eq!(panicked[0].downcast_ref::<&str>(), Some(&"spoilt"));
            assert!(asked.iter().flatten().all(|&hit| hit) && calls.load(Ordering::SeqCst) == 2);
        });
    }

    /// Refined into what is itself refined later.
    struct Row;
    static PLAIN: fn() -> Result<(), BuildError> = || Ok(());

    impl WorldBound for Row {
        fn world_bound(&self) -> Aabb {
            Aabb::new(Vec3A::splat(-1.0), Vec3A::new(7.0, 1.0, 1.0))
        }
    }
    impl Refine for Row {
        type Parts = Vec<Lazy<Exhaustive, Balls<'static>>>;
        fn refine(&self) -> Result<Self::Parts, BuildError> {
            let reach = |i: u8| Balls { count: 1 + i as usize, reach: 1.0 + 3.0 * i as f32, refine: &PLAIN };
            Ok((0..3).map(|i| Lazy::new(reach(i), ())).collect())
        }
    }

    #[test]
    fn refinement_nests() {
        let row = Lazy::<Exhaustive, _>::new(Row, ());
        let world = Aggregate::<Exhaustive, _>::build(vec![row], &()).unwrap();
        let hit = world.intersect(&at(6.0)).unwrap();
        assert_eq!((hit.at.at.prim, hit.at.at.at.prim), (2, 2));
        let parts = world.geometry()[0].refined().unwrap().unwrap().geometry();
        assert_eq!(
            parts.iter().map(|part| part.refined().is_some()).collect::<Vec<_>>(),
            [false, false, true]
        );
        assert!(Primitive::<f64>::intersect_p(&world, &at(0.0).widen()));
        assert!((Shape::surface(&world, &at(6.0), &hit).point.z - 0.75f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn nested_surfaces_refine_once_each() {
        /// As [`Row`], counted.
        struct Counted<'a>(&'a AtomicUsize, &'a (dyn Fn() -> Result<(), BuildError> + Sync + Send));
        impl WorldBound for Counted<'_> {
            fn world_bound(&self) -> Aabb {
                Row.world_bound()
            }
        }
        impl<'a> Refine for Counted<'a> {
            type Parts = Vec<Lazy<Exhaustive, Balls<'a>>>;
            fn refine(&self) -> Result<Self::Parts, BuildError> {
                parallel_work();
                self.0.fetch_add(1, Ordering::Relaxed);
                let ball =
                    |i: u8| Balls { count: 1 + i as usize, reach: 1.0 + 3.0 * i as f32, refine: self.1 };
                Ok((0..3).map(|i| Lazy::new(ball(i), ())).collect())
            }
        }
        in_time(|| {
            let (outer, inner) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let refine = || {
                parallel_work();
                inner.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            let row = Lazy::<Exhaustive, _>::new(Counted(&outer, &refine), ());
            let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
            pool.install(|| {
                (0..300).into_par_iter().for_each(|k| assert!(row.intersect_p(&at((k % 3) as f32 * 3.0))))
            });
            assert_eq!((outer.into_inner(), inner.into_inner()), (1, 3));
        });
    }

    #[test]
    fn a_mesh_with_a_bad_vertex_keeps_the_rest() {
        struct Bad;
        impl WorldBound for Bad {
            fn world_bound(&self) -> Aabb {
                Aabb::new(Vec3A::ZERO, Vec3A::ONE)
            }
        }
        impl Refine for Bad {
            type Parts = TriangleMesh<f64>;
            fn refine(&self) -> Result<TriangleMesh<f64>, BuildError> {
                let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN, 9.0, 9.0]];
                Ok(TriangleMesh::new(corners, vec![[0, 1, 2], [0, 1, 3]])?)
            }
        }
        let lazy = Lazy::<Exhaustive, _>::new(Bad, ());
        let ray = Ray::new(DVec3::new(0.2, 0.2, -1.0), DVec3::Z);
        assert_eq!(lazy.intersect(&ray).map(|hit| hit.at.prim), Some(0));
    }
}

//! Conformance: a structure answers as [`Exhaustive`] does, bit for bit.
//!
//! Both ask the same primitives with the same rays, and equal distances go to the lowest number on both sides; so whole hits
//! are equal, and what differs is the structure's fault.

mod hostile;

use core::fmt;
use core::ops::ControlFlow;
use hostile::{all_rays, sample};
use rt_accel::{
    Aggregate, Bounded, BuildError, Counts, Exhaustive, Geometry, Hit, Primitive, Refit, Structure,
};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use std::collections::HashSet;

/// What was asked when the answers differed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Check {
    /// The structure can be built.
    Build,
    /// The watcher hears progress that never falls and ends at 1, and may cancel.
    Watch,
    /// The structure finds nothing wrong in itself.
    Validate,
    /// The primitives left out are those without a valid bound.
    Skipped,
    /// The bound contains all valid bounds.
    Bound,
    /// Gathering lists every primitive, under leaf names that are unique.
    Gather,
    /// Building twice gives the same.
    Rebuild,
    /// The closest hit.
    Closest,
    /// Whether there is any hit.
    Any,
    /// All hits, as a multiset.
    All,
    /// The two queries of many rays.
    Many,
    /// The two counted queries.
    Counted,
}

/// How a structure fails to conform.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// What was asked.
    pub check: Check,
    /// The type of the structure.
    pub structure: &'static str,
    /// The name the geometry was given; callers put its seed there.
    pub geometry: String,
    /// The ray, as an expression that makes it again bit for bit.
    pub ray: Option<String>,
    /// What differed.
    pub detail: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} of {} over {}: {}", self.check, self.structure, self.geometry, self.detail)?;
        match &self.ray {
            Some(ray) => write!(f, "\n  ray: {ray}"),
            None => Ok(()),
        }
    }
}

impl core::error::Error for Failure {}

/// Builds `S` over `geometry` and compares all it says with [`Exhaustive`].
///
/// Rays given are asked as they are, and with intervals that end at, just before and just after their hit. Hostile rays are
/// added: along the axes through the corners of bounds, within their faces, from their middles, with zero, NaN and infinite
/// components and with inverted intervals.
///
/// `name` should say how to make the geometry again: scene and seed. `G::At` is compared by its `Debug` text, in which derived
/// implementations show every bit of a number, so that NaN equals NaN.
///
/// Cost: some twenty queries of the exhaustive structure for each ray.
///
/// # Errors
///
/// The first [`Failure`].
///
/// ```
/// use rt_accel::{Exhaustive, Hit, Primitive, WorldBound};
/// use rt_bounds::Aabb;
/// use rt_geom::{Ray, glam::Vec3A};
/// use rt_measure::{conform::conform, rays};
///
/// struct Plane(f32);
/// impl WorldBound for Plane {
///     fn world_bound(&self) -> Aabb {
///         let side = Vec3A::new(f32::INFINITY, f32::INFINITY, 0.0);
///         Aabb::new(Vec3A::Z * self.0 - side, Vec3A::Z * self.0 + side)
///     }
/// }
/// impl Primitive for Plane {
///     type At = ();
///     fn intersect(&self, ray: &Ray) -> Option<Hit<()>> {
///         let t = (self.0 as f64 - ray.origin.z as f64) / ray.dir.z as f64;
///         if ray.dir.z == 0.0 { None } else { ray.admit(t).map(|t| Hit { t, at: () }) }
///     }
/// }
/// let planes: Vec<Plane> = (0..9).map(|z| Plane(z as f32)).collect();
/// let rays = rays::uniform(1, &Aabb::new(Vec3A::ZERO, Vec3A::ONE), 100);
/// conform::<Exhaustive, f32, _>("nine planes", &planes, &(), &rays).unwrap();
/// ```
pub fn conform<S: Structure, R: Real, G: Geometry<R>>(
    name: &str,
    geometry: &G,
    params: &S::Params,
    rays: &[Ray<R>],
) -> Result<(), Failure>
where
    G::At: fmt::Debug,
{
    conform_all::<S, R, G>(name, geometry, core::slice::from_ref(params), rays)
}

/// [`conform`] for several sets of parameters, in the time of little more than one: the exhaustive answers are found once.
///
/// # Errors
///
/// The first [`Failure`].
pub fn conform_all<S: Structure, R: Real, G: Geometry<R>>(
    name: &str,
    geometry: &G,
    params: &[S::Params],
    rays: &[Ray<R>],
) -> Result<(), Failure>
where
    G::At: fmt::Debug,
{
    let trial = Trial::<S> { name, marker: core::marker::PhantomData };
    let exhaustive = trial.built(Aggregate::<Exhaustive, _>::build(geometry, &()))?;
    let truth = Truth::of(&exhaustive, &all_rays(geometry, rays));
    for params in params {
        trial.watched(geometry, params)?;
        let mine = trial.built(Aggregate::<S, _>::build(geometry, params))?;
        trial.shape(geometry, mine.structure(), exhaustive.structure())?;
        let again = trial.built(Aggregate::<S, _>::build(geometry, params))?;
        trial.same_shape(mine.structure(), again.structure())?;
        trial.answers(&mine, &truth, &again)?;
    }
    Ok(())
}

/// Builds `S` over `before`, refits it to `after`, and compares all it then says with [`Exhaustive`] over `after`.
///
/// The two must have the same number of primitives, and valid bounds for the same ones. See [`conform`] for the rest.
///
/// # Errors
///
/// The first [`Failure`].
pub fn conform_refit<S: Refit, R: Real, G: Geometry<R>>(
    name: &str,
    before: &G,
    after: &G,
    params: &S::Params,
    rays: &[Ray<R>],
) -> Result<(), Failure>
where
    G::At: fmt::Debug,
{
    let trial = Trial::<S> { name, marker: core::marker::PhantomData };
    let refitted = || {
        let mut mine = trial.built(Aggregate::<S, _>::build(before, params))?;
        mine.update(|geometry| *geometry = after);
        Ok(mine)
    };
    let (mine, again) = (refitted()?, refitted()?);
    let truth = trial.built(Aggregate::<Exhaustive, _>::build(after, &()))?;
    trial.shape(after, mine.structure(), truth.structure())?;
    trial.same_shape(mine.structure(), again.structure())?;
    trial.answers(&mine, &Truth::of(&truth, &all_rays(after, rays)), &again)
}

/// The same ray, as an expression that makes it again bit for bit.
pub fn paste<R: Real>(ray: &Ray<R>) -> String {
    let single = size_of::<R>() == size_of::<f32>();
    let number = |x: f64| match single {
        true => format!("f32::from_bits({:#x})", (x as f32).to_bits()),
        false => format!("f64::from_bits({:#x})", x.to_bits()),
    };
    let vector = |v: DVec3| {
        let kind = if single { "Vec3A" } else { "DVec3" };
        format!("{kind}::new({}, {}, {})", number(v.x), number(v.y), number(v.z))
    };
    format!(
        "Ray::new({}, {}).between({}, {}) // {} {} {} {}",
        vector(ray.origin.widen()),
        vector(ray.dir.widen()),
        number(ray.t_min.into()),
        number(ray.t_max.into()),
        ray.origin.widen(),
        ray.dir.widen(),
        ray.t_min,
        ray.t_max,
    )
}

/// A structure on trial over a named geometry.
struct Trial<'a, S> {
    name: &'a str,
    marker: core::marker::PhantomData<S>,
}

impl<S: Structure> Trial<'_, S> {
    fn fail<T>(&self, check: Check, detail: String) -> Result<T, Failure> {
        let structure = core::any::type_name::<S>();
        Err(Failure { check, structure, geometry: self.name.to_string(), ray: None, detail })
    }

    fn built<T>(&self, built: Result<T, BuildError>) -> Result<T, Failure> {
        built.or_else(|error| self.fail(Check::Build, error.to_string()))
    }

    /// Equal texts, or a failure that shows both.
    fn equal<R: Real>(&self, check: Check, ray: &Ray<R>, mine: &str, truth: &str) -> Result<(), Failure> {
        if mine == truth {
            return Ok(());
        }
        let failed = self.fail(check, format!("found {mine}, exhaustively {truth}"));
        failed.map_err(|failure| Failure { ray: Some(paste(ray)), ..failure })
    }

    fn watched(&self, prims: &dyn Bounded, params: &S::Params) -> Result<(), Failure> {
        let mut heard = Vec::new();
        self.built(S::build_watched(prims, params, &mut |progress| {
            heard.push(progress);
            ControlFlow::Continue(())
        }))?;
        let in_order = heard.windows(2).all(|pair| pair[0] <= pair[1]);
        if !in_order || heard.first().is_some_and(|x| *x < 0.0) || heard.last() != Some(&1.0) {
            heard.truncate(100);
            return self.fail(Check::Watch, format!("progress was {heard:?}"));
        }
        match S::build_watched(prims, params, &mut |_| ControlFlow::Break(())) {
            Err(BuildError::Cancelled) => Ok(()),
            Err(error) => self.fail(Check::Watch, format!("cancelled, it said: {error}")),
            Ok(_) => self.fail(Check::Watch, "it was built although the watcher said stop".to_string()),
        }
    }

    /// What a structure says of itself.
    fn shape<G: Bounded>(&self, prims: &G, mine: &S, truth: &Exhaustive) -> Result<(), Failure> {
        if let Err(invalid) = mine.validate(prims) {
            return self.fail(Check::Validate, invalid.to_string());
        }
        if mine.skipped() != truth.skipped() {
            return self
                .fail(Check::Skipped, format!("left out {:?}, not {:?}", mine.skipped(), truth.skipped()));
        }
        let skipped: HashSet<u32> = truth.skipped().iter().copied().collect();
        let valid: Vec<u32> = (0..prims.prim_count() as u32).filter(|prim| !skipped.contains(prim)).collect();
        let origin = mine.origin();
        for &prim in &valid {
            let bound = prims.bound_from(prim, origin);
            if !mine.local_bound().contains(bound) {
                let bounds = format!("{:?} does not contain {bound:?}", mine.local_bound());
                return self.fail(Check::Bound, format!("{bounds} of primitive {prim}, from {origin}"));
            }
        }
        self.gathers(prims, mine, &valid)
    }

    fn gathers<G: Bounded>(&self, prims: &G, mine: &S, valid: &[u32]) -> Result<(), Failure> {
        let (mut names, mut times) = (HashSet::new(), vec![0u32; prims.prim_count()]);
        let mut strange = None;
        mine.gather(&mut |_| true, &mut |leaf| {
            if !names.insert(leaf.first) {
                strange = Some(format!("two leaves are named {}", leaf.first));
            }
            for &prim in leaf.prims {
                match times.get_mut(prim as usize) {
                    Some(times) => *times += 1,
                    None => strange = Some(format!("there is no primitive {prim}")),
                }
            }
        });
        if let Some(strange) = strange {
            return self.fail(Check::Gather, strange);
        }
        let listed = valid.iter().map(|&prim| (prim, times[prim as usize]));
        if let Some((prim, times)) = listed.clone().find(|l| l.1 == 0 || l.1 > 1 && !mine.repeats()) {
            return self.fail(Check::Gather, format!("primitive {prim} is listed {times} times"));
        }
        if times.iter().filter(|times| **times > 0).count() > valid.len() {
            return self.fail(Check::Gather, "a primitive without a valid bound is listed".to_string());
        }
        // Boxes in world space, as the structure sees them: from its own origin and back.
        let bound = |prim: u32| prims.bound_from(prim, mine.origin()).relative_to(-mine.origin());
        for &prim in sample(valid, 24).iter() {
            let query = bound(prim);
            let mut found = HashSet::new();
            mine.gather(&mut |b| !b.overlap(query).is_empty(), &mut |leaf| {
                found.extend(leaf.prims.iter().copied())
            });
            // A structure that repeats may know that a primitive meets less than its bound does, but not less than itself.
            let expected = |other: u32| match mine.repeats() {
                true => query.contains(bound(other)),
                false => !query.overlap(bound(other)).is_empty(),
            };
            if let Some(lost) = valid.iter().find(|other| expected(**other) && !found.contains(other)) {
                return self.fail(Check::Gather, format!("primitive {lost} is not found by {query:?}"));
            }
        }
        Ok(())
    }

    fn same_shape(&self, mine: &S, again: &S) -> Result<(), Failure> {
        let leaves = |structure: &S| {
            let mut all = Vec::new();
            structure.gather(&mut |_| true, &mut |leaf| all.push((leaf.first, leaf.prims.to_vec())));
            (all, structure.origin(), structure.local_bound(), structure.bytes(), structure.repeats())
        };
        if leaves(mine) != leaves(again) {
            return self.fail(
                Check::Rebuild,
                "two builds of the same differ in leaves, bounds or bytes".to_string(),
            );
        }
        Ok(())
    }

    fn answers<R: Real, G: Geometry<R>>(
        &self,
        mine: &Aggregate<S, &G>,
        truth: &Truth<R>,
        again: &Aggregate<S, &G>,
    ) -> Result<(), Failure>
    where
        G::At: fmt::Debug,
    {
        let asked = &truth.asked;
        let mut closest = vec![None; asked.len() + 1];
        let mut any = vec![false; asked.len() + 1];
        mine.intersect_many(asked, &mut closest);
        mine.intersect_p_many(asked, &mut any);
        if closest.last().is_some_and(Option::is_some) || any.last() == Some(&true) {
            return self.fail(Check::Many, "wrote past the last ray".to_string());
        }
        for (i, ray) in asked.iter().enumerate() {
            let expected = truth.closest[i].as_str();
            let hit = expected != text(&None::<Hit<G::At, R>>);
            self.equal(Check::Closest, ray, &text(&mine.intersect(ray)), expected)?;
            self.equal(Check::Any, ray, flag(mine.intersect_p(ray)), flag(hit))?;
            self.equal(Check::Many, ray, &text(&closest[i]), expected)?;
            self.equal(Check::Many, ray, flag(any[i]), flag(hit))?;
            let Some(all) = truth.all.get(i) else { continue };
            self.equal(Check::All, ray, &all_hits(mine, ray), all)?;
            let mut heard = 0;
            let _: ControlFlow<()> = mine.all_hits(ray, &mut |_| {
                heard += 1;
                ControlFlow::Break(())
            });
            if heard != usize::from(!all.is_empty()) {
                self.equal(Check::All, ray, &format!("{heard} after being told to stop"), all)?;
            }
            self.equal(Check::Rebuild, ray, &text(&again.intersect(ray)), expected)?;
            let mut counts = Counts::default();
            self.equal(Check::Counted, ray, &text(&mine.intersect_counted(ray, &mut counts)), expected)?;
            let mut counts_p = Counts::default();
            self.equal(Check::Counted, ray, flag(mine.intersect_p_counted(ray, &mut counts_p)), flag(hit))?;
            if hit && (counts.leaves == 0 || counts_p.leaves == 0) {
                self.equal(Check::Counted, ray, "a hit without a leaf", expected)?;
            }
        }
        Ok(())
    }
}

/// How many hits are asked for again, with intervals that end at them, just before and just after.
const ENDS: usize = 40;

/// What [`Exhaustive`] answers, as text.
struct Truth<R: Real> {
    /// The rays of a trial first, then the first [`ENDS`] hits once more from and to their ends.
    asked: Vec<Ray<R>>,
    /// The closest hit of each.
    closest: Vec<String>,
    /// All hits of the rays of the trial.
    all: Vec<String>,
}

impl<R: Real> Truth<R> {
    fn of<G: Geometry<R>>(exhaustive: &Aggregate<Exhaustive, &G>, rays: &[Ray<R>]) -> Truth<R>
    where
        G::At: fmt::Debug,
    {
        let mut asked = rays.to_vec();
        for (ray, hit) in rays.iter().filter_map(|ray| Some((ray, exhaustive.intersect(ray)?))).take(ENDS) {
            let (t, before, after) = (hit.t, hit.t.next_down(), hit.t.next_up());
            let ends = [(t, t), (ray.t_min, t), (t, ray.t_max), (ray.t_min, before), (after, ray.t_max)];
            asked.extend(ends.map(|(t_min, t_max)| ray.between(t_min, t_max)));
            asked.push(ray.between(before, after));
        }
        let closest = asked.iter().map(|ray| text(&exhaustive.intersect(ray))).collect();
        let all = rays.iter().map(|ray| all_hits(exhaustive, ray)).collect();
        Truth { asked, closest, all }
    }
}

fn flag(hit: bool) -> &'static str {
    if hit { "a hit" } else { "no hit" }
}

fn text<A: fmt::Debug, R: Real>(hit: &Option<Hit<A, R>>) -> String {
    match hit {
        // Debug shows -0.0 and every digit that tells two numbers apart.
        Some(hit) => format!("t = {:?} at {:?}", hit.t, hit.at),
        None => "nothing".to_string(),
    }
}

/// All hits in an order of their own, so that multisets compare.
fn all_hits<R: Real, P: Primitive<R>>(primitive: &P, ray: &Ray<R>) -> String
where
    P::At: fmt::Debug,
{
    let mut all = Vec::new();
    let _: ControlFlow<()> = primitive.all_hits(ray, &mut |hit| {
        all.push(text(&Some(hit)));
        ControlFlow::Continue(())
    });
    all.sort_unstable();
    all.join("; ")
}

#[cfg(test)]
mod tests;

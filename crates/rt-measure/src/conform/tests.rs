use super::*;
use crate::rays;
use core::sync::atomic::{AtomicU32, Ordering};
use rt_accel::Leaf;
use rt_accel::{Invalid, Visitor, Watch, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::Vec3A;

/// A horizontal square.
#[derive(Clone, Copy)]
struct Square {
    center: Vec3A,
    half: f32,
}

impl WorldBound for Square {
    fn world_bound(&self) -> Aabb {
        let side = Vec3A::new(self.half, self.half, 0.0);
        Aabb::new(self.center - side, self.center + side)
    }
}

impl<R: Real> Primitive<R> for Square {
    type At = [f64; 2];
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<[f64; 2], R>> {
        let (o, d, c) = (ray.origin.widen(), ray.dir.widen(), self.center.as_dvec3());
        let t = (c.z - o.z) / d.z;
        let at = o + d * t - c;
        let inside = d.z != 0.0 && at.x.abs().max(at.y.abs()) <= self.half as f64;
        inside.then_some(Hit { t: ray.admit(t)?, at: [at.x, at.y] })
    }
}

/// A few squares, some of them at the same place, some of them nowhere.
fn squares(seed: u64) -> Vec<Square> {
    let mut seeded = rays::Seeded::new(seed);
    let mut at = |size: f64| seeded.between(-size, size) as f32;
    let mut squares: Vec<Square> =
        (0..30).map(|_| Square { center: Vec3A::new(at(2.0), at(2.0), at(4.0)), half: 1.5 }).collect();
    squares.extend_from_within(5..20);
    squares[3].center.x = f32::NAN;
    squares[8].half = -1.0;
    squares
}

fn aim<R: Real>(seed: u64) -> Vec<Ray<R>> {
    rays::uniform(seed, &Aabb::new(Vec3A::splat(-3.0), Vec3A::splat(3.0)), 60)
}

/// What is wrong with a [`Toy`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Flaw {
    #[default]
    None,
    NotBuilt,
    Silent,
    NeverDone,
    NotCancelled,
    Invalid,
    SkipsNone,
    NoBound,
    DropsLeaf,
    SameNames,
    Unsteady,
    LosesFar,
    TiesToLast,
    AnyLosesFar,
    ShowsTwice,
    ManyShuffles,
    AnswersNonsense,
    ForgetsToRefit,
}

/// One primitive a leaf, and one flaw.
struct Toy {
    inner: Exhaustive,
    prims: Vec<u32>,
    flaw: Flaw,
}

static BUILDS: AtomicU32 = AtomicU32::new(0);

impl Structure for Toy {
    type Params = Flaw;

    fn build_watched(prims: &dyn Bounded, flaw: &Flaw, watch: Watch<'_>) -> Result<Toy, BuildError> {
        let flow = match flaw {
            Flaw::NotBuilt => return Err(BuildError::BadParam { name: "flaw", why: "it is one" }),
            Flaw::Silent => ControlFlow::Continue(()),
            Flaw::NeverDone => watch(0.5),
            _ => watch(1.0),
        };
        if flow.is_break() && *flaw != Flaw::NotCancelled {
            return Err(BuildError::Cancelled);
        }
        let inner = Exhaustive::build(prims, &())?;
        let mut numbers = Vec::new();
        inner.gather(&mut |_| true, &mut |leaf| numbers.extend_from_slice(leaf.prims));
        numbers.reverse();
        if *flaw == Flaw::Unsteady && BUILDS.fetch_add(1, Ordering::Relaxed).is_multiple_of(2) {
            numbers.reverse();
        }
        Ok(Toy { inner, prims: numbers, flaw: *flaw })
    }

    fn origin(&self) -> DVec3 {
        self.inner.origin()
    }
    fn local_bound(&self) -> Aabb {
        if self.flaw == Flaw::NoBound { Aabb::EMPTY } else { self.inner.local_bound() }
    }
    fn skipped(&self) -> &[u32] {
        if self.flaw == Flaw::SkipsNone { &[] } else { self.inner.skipped() }
    }
    fn repeats(&self) -> bool {
        false
    }
    fn bytes(&self) -> usize {
        self.inner.bytes()
    }

    fn traverse<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if !ray.is_valid() && self.flaw != Flaw::AnswersNonsense {
            return;
        }
        let last = ray.t_max;
        for (i, prim) in self.prims.iter().enumerate() {
            if self.flaw == Flaw::LosesFar && i == 20 {
                continue;
            }
            if self.flaw == Flaw::TiesToLast && ray.t_max < last {
                ray.t_max = ray.t_max.next_down();
            }
            visit.node();
            let leaf = Leaf { first: i as u32, prims: core::slice::from_ref(prim) };
            if visit.leaf(leaf, ray).is_break() {
                return;
            }
            if self.flaw == Flaw::ShowsTwice && visit.leaf(leaf, ray).is_break() {
                return;
            }
        }
    }

    fn traverse_any<R: Real>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if self.flaw == Flaw::AnyLosesFar && ray.t_max.is_finite() {
            ray.t_max = ray.t_max.next_down();
        }
        self.traverse(ray, visit);
    }

    fn traverse_many<R: Real, F: rt_accel::Feed<R>>(&self, rays: &mut F) {
        let mut held = None;
        while let Some((mut ray, mut visitor)) = rays.next() {
            if self.flaw == Flaw::ManyShuffles {
                ray = held.replace(ray).unwrap_or(ray);
            }
            self.traverse(&mut ray, &mut visitor);
            rays.done(visitor);
        }
    }

    fn gather(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        let dropped = if self.flaw == Flaw::DropsLeaf { 1 } else { 0 };
        if keep(&self.local_bound().relative_to(-self.origin())) {
            for (i, prim) in self.prims.iter().enumerate().skip(dropped) {
                let first = if self.flaw == Flaw::SameNames { 0 } else { i as u32 };
                each(Leaf { first, prims: core::slice::from_ref(prim) });
            }
        }
    }

    fn validate(&self, prims: &dyn Bounded) -> Result<(), Invalid> {
        if self.flaw == Flaw::Invalid {
            return Err(Invalid("the flaw".to_string()));
        }
        self.inner.validate(prims)
    }
}

impl Refit for Toy {
    fn refit(&mut self, prims: &dyn Bounded) {
        if self.flaw != Flaw::ForgetsToRefit {
            self.inner.refit(prims);
        }
    }
}

fn trial<R: Real>(flaw: Flaw) -> Result<(), Failure> {
    conform::<Toy, R, _>("squares, seed 4", &squares(4), &flaw, &aim(9))
}

#[test]
fn the_exhaustive_structure_conforms() {
    for seed in 0..4 {
        conform::<Exhaustive, f32, _>("squares", &squares(seed), &(), &aim(seed)).unwrap();
        conform::<Exhaustive, f64, _>("squares", &squares(seed), &(), &aim(seed)).unwrap();
    }
    let empty: Vec<Square> = Vec::new();
    conform::<Exhaustive, f32, _>("nothing", &empty, &(), &aim(1)).unwrap();
    conform_refit::<Exhaustive, f32, _>("nothing", &empty, &empty, &(), &aim(1)).unwrap();
    let far: Vec<Square> =
        squares(1).iter().map(|s| Square { center: s.center + Vec3A::splat(1e6), ..*s }).collect();
    conform::<Exhaustive, f64, _>("far squares", &far, &(), &aim(1)).unwrap();
}

#[test]
fn a_toy_without_a_flaw_conforms() {
    trial::<f32>(Flaw::None).unwrap();
    trial::<f64>(Flaw::None).unwrap();
    let empty: Vec<Square> = Vec::new();
    conform::<Toy, f64, _>("nothing", &empty, &Flaw::None, &aim(1)).unwrap();
}

#[test]
fn every_flaw_is_found() {
    let expected = [
        (Flaw::NotBuilt, Check::Build),
        (Flaw::Silent, Check::Watch),
        (Flaw::NeverDone, Check::Watch),
        (Flaw::NotCancelled, Check::Watch),
        (Flaw::Invalid, Check::Validate),
        (Flaw::SkipsNone, Check::Skipped),
        (Flaw::NoBound, Check::Bound),
        (Flaw::DropsLeaf, Check::Gather),
        (Flaw::SameNames, Check::Gather),
        (Flaw::LosesFar, Check::Closest),
        (Flaw::TiesToLast, Check::Closest),
        (Flaw::AnyLosesFar, Check::Any),
        (Flaw::ShowsTwice, Check::All),
        (Flaw::ManyShuffles, Check::Many),
    ];
    for (flaw, check) in expected {
        let [single, double] = [trial::<f32>(flaw), trial::<f64>(flaw)].map(Result::unwrap_err);
        assert_eq!((single.check, double.check), (check, check), "{flaw:?}: {single}");
        assert!(single.structure.ends_with("Toy") && single.geometry == "squares, seed 4");
    }
    // Of two builds in a row one is turned round, whoever else builds meanwhile.
    assert_eq!(trial::<f32>(Flaw::Unsteady).unwrap_err().check, Check::Rebuild);
}

/// Hit at 1 by every ray, valid or not.
struct Yes;

impl WorldBound for Yes {
    fn world_bound(&self) -> Aabb {
        Aabb::INFINITE
    }
}

impl<R: Real> Primitive<R> for Yes {
    type At = ();
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<(), R>> {
        let t = R::nearest(1.0);
        ray.contains(t).then_some(Hit { t, at: () })
    }
    fn intersect_counted(&self, _: &Ray<R>, _: &mut Counts) -> Option<Hit<(), R>> {
        None
    }
}

/// [`Yes`] with honest counts.
struct Counted(Yes);

impl WorldBound for Counted {
    fn world_bound(&self) -> Aabb {
        self.0.world_bound()
    }
}

impl<R: Real> Primitive<R> for Counted {
    type At = ();
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<(), R>> {
        self.0.intersect(ray)
    }
}

#[test]
fn nonsense_and_wrong_counts_are_found() {
    let failure = conform::<Exhaustive, f32, _>("yes", &vec![Yes], &(), &aim(1)).unwrap_err();
    assert_eq!(failure.check, Check::Counted);
    conform::<Exhaustive, f32, _>("yes", &vec![Counted(Yes)], &(), &aim(1)).unwrap();
    let failure =
        conform::<Toy, f64, _>("yes", &vec![Counted(Yes)], &Flaw::AnswersNonsense, &aim(1)).unwrap_err();
    assert_eq!(failure.check, Check::Closest);
    let shown = failure.to_string();
    assert!(shown.contains("yes") && shown.contains("Toy") && shown.contains("f64::from_bits("), "{shown}");
}

#[test]
fn refits_answer_as_fresh_ones() {
    let before = squares(2);
    let after: Vec<Square> =
        before.iter().map(|s| Square { center: s.center * 1.5 + Vec3A::X, ..*s }).collect();
    let refit = |flaw| conform_refit::<Toy, f32, _>("squares, seed 2", &before, &after, &flaw, &aim(3));
    refit(Flaw::None).unwrap();
    assert_eq!(refit(Flaw::ForgetsToRefit).unwrap_err().check, Check::Bound);
    assert_eq!(refit(Flaw::TiesToLast).unwrap_err().check, Check::Closest);
    conform_refit::<Exhaustive, f64, _>("squares, seed 2", &before, &after, &(), &aim(3)).unwrap();
}

#[test]
fn a_pasted_ray_is_the_same_ray() {
    let ray = Ray::new(Vec3A::new(0.1, -0.0, 1e-45), Vec3A::X).between(-1.0, f32::INFINITY);
    let text = paste(&ray);
    let bits = [0.1f32, -0.0, 1e-45].map(|x| format!("f32::from_bits({:#x})", x.to_bits())).join(", ");
    assert!(text.starts_with(&format!("Ray::new(Vec3A::new({bits}), ")), "{text}");
}

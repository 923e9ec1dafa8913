//! What rays cost, and how wrong they are: the questions behind `cargo xtask bench`.
//!
//! | Question | Asks |
//! | --- | --- |
//! | [`Question::Closest`] | what does a closest hit cost, by scene, kind of rays, precision, exact or fast? |
//! | [`Question::Any`] | the same of any hit, for short rays and for rays to a light |
//! | [`Question::Build`] | what does each knob of a BVH's and of a kd-tree's build buy, in build time and in time a ray? |
//! | [`Question::Precision`] | what does the fast triangle test gain, and what does it get wrong? |
//! | [`Question::Structures`] | which structure for which scene? |
//! | [`Question::Subdivision`] | how finely should a grid divide space? |
//! | [`Question::Scaling`] | how does the cost of a ray grow with the number of primitives? |
//! | [`Question::Slab`] | which box test? |
//! | [`Question::Volumes`] | which bounding volume, and when does it pay? |
//! | [`Question::Shapes`] | what do smooth shapes cost, met directly and as triangles, and how far off are those? |
//! | [`Question::Lazy`] | what does it save to refine only what rays come near? |
//! | [`Question::Rivals`] | how do other people's structures fare on the same rays? (feature `rivals`) |
//!
//! # How a figure comes about
//!
//! All contestants of a group answer the same rays in one process, by turns, in interleaved rounds; times are medians, and the
//! speed against the first contestant is the median of the ratios within rounds. Rays are made in `f32` and widened for `f64`,
//! which is exact, so both precisions are asked the same thing.
//!
//! Before anything is timed, a sample of the rays is judged by the exact integers of [`rt_measure::exact`]: among all primitives
//! whose padded box the line of the ray meets, found by a plain loop in `f64` that shares no code with what is judged. Judged are
//! 500 rays a group with [`Effort::Quick`], 2000 with [`Effort::Normal`], 4000 with [`Effort::Full`], or all of them where a
//! set has fewer; each record says how many as `judged=`. No error in `n` judged rays means a rate below `3 / n`, with 95 %
//! confidence. Contestants that promise exactness must also agree with each other, in primitive and distance, on *all* rays. A
//! group in which one breaks its promise is not timed ([`Group::outcome`]).
//!
//! No ray is given an epsilon: those that leave a surface start within a unit in the last place of it, at `t = 0`. Exact tests
//! need no more. Fast ones then meet the surface they have just left, wherever their error in `t` is larger than that unit, and
//! show it as hits made up: a user of a fast test would give some away by an epsilon, and lose others.
//!
//! The noise of a machine shows twice: in `spread`, and in the question `build`, where several values of a knob lead to the same
//! tree, bit for bit. In the record of 2026-11-22 (AMD EPYC, two cores, shared) such twins differ by up to 17 % in one cell (a soup
//! of 100 000 triangles, chords) and by 2 % in the mean over five scenes.
//!
//! # What a record holds
//!
//! One measurement is one line with the rate of wrong answers, of whatever kind (`wrong`); for closest hits a second with the
//! largest error of a distance (`t_ulp`). Where anything was wrong two more split it into hits lost (`missed`) and made up
//! (`invented`). `params` holds, after the parameters, `judged=`, and `speed=`, the speed against the first contestant of the
//! group where there are several. Bytes count the structure alone, without the primitives.
//!
//! ```
//! use rt_bench::{Effort, Options, Question, Subject, ask};
//! use core::ops::ControlFlow;
//! let options = Options { scenes: Some(vec![Subject::named("tetra-3")?]), ..Options::new(Effort::Quick) };
//! let groups = ask(Question::Any, &options, &mut |_done| ControlFlow::Continue(()))?;
//! for measured in groups[0].outcome.as_ref().unwrap() {
//!     assert!(measured.error.is_exact() || measured.params.contains("fast"));
//! }
//! # Ok::<(), rt_bench::Trouble>(())
//! ```
//!
//! # Invariants
//!
//! Nothing here prints or touches a file. A benchmark is never a test: what is asserted anywhere is answers, not times.

mod contest;
mod fast;
mod field;
mod fractals;
mod judge;
mod knobs;
mod lazy;
mod patches;
mod queries;
#[cfg(feature = "rivals")]
mod rivals;
pub mod roster;
mod scaling;
mod schemes;
mod shapes;
mod slab;
mod space;
mod subdivision;
mod subject;
mod volumes;

pub use contest::{Group, Measured, Mismatch, Stamp};
pub use fast::{FastMesh, TextbookRay};
pub use subject::{Prims, RayKind, RaySet, Subject};

use core::fmt;
use core::ops::ControlFlow;
use core::time::Duration;
use rt_accel::BuildError;
use rt_measure::clock::Plan;

/// Whether rivals were compiled in.
pub const HAS_RIVALS: bool = cfg!(feature = "rivals");

/// A question with an answer in figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Question {
    /// What does a closest hit cost?
    Closest,
    /// What does any hit cost?
    Any,
    /// What do the knobs of a build buy?
    Build,
    /// What does the fast triangle test gain and lose?
    Precision,
    /// Which structure for which scene?
    Structures,
    /// How finely should a grid divide space?
    Subdivision,
    /// How does the cost of a ray grow with the number of primitives?
    Scaling,
    /// Which box test?
    Slab,
    /// Which bounding volume, and when does it pay?
    Volumes,
    /// What do smooth shapes cost, met directly and as triangles?
    Shapes,
    /// What does it save to refine only what rays come near?
    Lazy,
    /// How do others fare? Only with the feature `rivals`.
    Rivals,
}

impl Question {
    /// All questions.
    pub const ALL: [Question; 12] = [
        Question::Closest,
        Question::Any,
        Question::Build,
        Question::Precision,
        Question::Structures,
        Question::Subdivision,
        Question::Scaling,
        Question::Slab,
        Question::Volumes,
        Question::Shapes,
        Question::Lazy,
        Question::Rivals,
    ];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Question::Closest => "closest",
            Question::Any => "any",
            Question::Build => "build",
            Question::Precision => "precision",
            Question::Structures => "structures",
            Question::Subdivision => "subdivision",
            Question::Scaling => "scaling",
            Question::Slab => "slab",
            Question::Volumes => "volumes",
            Question::Shapes => "shapes",
            Question::Lazy => "lazy",
            Question::Rivals => "rivals",
        }
    }

    /// About how long it takes on its own scenes: measured on two cores of a server, and rough.
    pub fn estimate(self, effort: Effort) -> Duration {
        let seconds = match (self, effort) {
            (Question::Closest, Effort::Quick) => 20,
            (Question::Any, Effort::Quick) => 14,
            (Question::Build, Effort::Quick) => 120,
            (Question::Precision, Effort::Quick) => 12,
            (Question::Structures, Effort::Quick) => 150,
            (Question::Subdivision, Effort::Quick) => 90,
            (Question::Scaling, Effort::Quick) => 150,
            (Question::Slab, _) => 2,
            (Question::Volumes, Effort::Quick) => 30,
            (Question::Shapes, Effort::Quick) => 15,
            (Question::Lazy, Effort::Quick) => 30,
            (Question::Rivals, Effort::Quick) => 25,
            (Question::Closest, Effort::Normal) => 90,
            (Question::Any, Effort::Normal) => 60,
            (Question::Build, Effort::Normal) => 600,
            (Question::Precision, Effort::Normal) => 40,
            (Question::Structures, Effort::Normal) => 300,
            (Question::Subdivision, Effort::Normal) => 120,
            (Question::Scaling, Effort::Normal) => 300,
            (Question::Volumes, Effort::Normal) => 150,
            (Question::Shapes, Effort::Normal) => 60,
            (Question::Lazy, Effort::Normal) => 60,
            (Question::Rivals, Effort::Normal) => 200,
            (Question::Closest, Effort::Full) => 360,
            (Question::Any, Effort::Full) => 240,
            (Question::Build, Effort::Full) => 3000,
            (Question::Precision, Effort::Full) => 90,
            (Question::Structures, Effort::Full) => 600,
            (Question::Subdivision, Effort::Full) => 300,
            (Question::Scaling, Effort::Full) => 3000,
            (Question::Volumes, Effort::Full) => 600,
            (Question::Shapes, Effort::Full) => 180,
            (Question::Lazy, Effort::Full) => 120,
            (Question::Rivals, Effort::Full) => 480,
        };
        Duration::from_secs(seconds)
    }
}

impl fmt::Display for Question {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How much time an answer may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// All questions but that about rivals in some ten minutes.
    Quick,
    /// Some minutes.
    Normal,
    /// Scenes of a million primitives, too.
    Full,
}

impl Effort {
    /// Rays a set.
    pub fn rays(self) -> usize {
        match self {
            Effort::Quick => 1 << 14,
            Effort::Normal => 1 << 16,
            Effort::Full => 1 << 17,
        }
    }

    /// Rays judged of each set.
    pub fn judged(self) -> usize {
        match self {
            Effort::Quick => 500,
            Effort::Normal => 2000,
            Effort::Full => 4000,
        }
    }

    /// Rounds of a race.
    pub fn plan(self) -> Plan {
        match self {
            Effort::Quick => Plan { warm_up: 1, rounds: 7 },
            Effort::Normal => Plan { warm_up: 1, rounds: 9 },
            Effort::Full => Plan { warm_up: 1, rounds: 11 },
        }
    }

    /// Rounds of a race of builds.
    pub fn builds(self) -> Plan {
        match self {
            Effort::Quick => Plan { warm_up: 0, rounds: 3 },
            _ => Plan { warm_up: 1, rounds: 5 },
        }
    }
}

/// What to ask about, and how hard.
#[derive(Clone, Debug)]
pub struct Options {
    /// How hard.
    pub effort: Effort,
    /// The scenes; without them each question has its own.
    pub scenes: Option<Vec<Subject>>,
}

impl Options {
    /// Each question's own scenes.
    pub fn new(effort: Effort) -> Options {
        Options { effort, scenes: None }
    }
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Trouble {
    /// The watcher said stop.
    Stopped,
    /// No such scene; in the words of whoever was asked.
    Scene(String),
    /// A structure was not built.
    Build(BuildError),
    /// Compiled without the feature `rivals`.
    NoRivals,
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::Stopped => f.write_str("stopped"),
            Trouble::Scene(why) => f.write_str(why),
            Trouble::Build(error) => error.fmt(f),
            Trouble::NoRivals => f.write_str("compiled without the feature `rivals`"),
        }
    }
}

impl core::error::Error for Trouble {}

impl From<BuildError> for Trouble {
    fn from(error: BuildError) -> Trouble {
        match error {
            BuildError::Cancelled => Trouble::Stopped,
            error => Trouble::Build(error),
        }
    }
}

/// Hears how much of a question is done, 0 to 1, and may stop it between two races.
pub type Watch<'a> = &'a mut dyn FnMut(f32) -> ControlFlow<()>;

/// Answers a question.
///
/// # Errors
///
/// See [`Trouble`]. Wrong answers are no error here: the group they were found in says so.
pub fn ask(question: Question, options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    match question {
        Question::Closest | Question::Any | Question::Precision => queries::ask(question, options, watch),
        Question::Build => knobs::ask(options, watch),
        Question::Structures => schemes::ask(options, watch),
        Question::Subdivision => subdivision::ask(options, watch),
        Question::Scaling => scaling::ask(options, watch),
        Question::Slab => slab::ask(options.effort, watch),
        Question::Volumes => volumes::ask(options.effort, watch),
        Question::Shapes => {
            let mut groups = shapes::ask(options.effort, &mut part(watch, 0, 3))?;
            groups.extend(patches::ask(options.effort, &mut part(watch, 1, 3))?);
            groups.extend(fractals::ask(options.effort, &mut part(watch, 2, 3))?);
            Ok(groups)
        }
        Question::Lazy => lazy::ask(options.effort, watch),
        #[cfg(feature = "rivals")]
        Question::Rivals => rivals::ask(options, watch),
        #[cfg(not(feature = "rivals"))]
        Question::Rivals => Err(Trouble::NoRivals),
    }
}

/// Watches one of several parts of a question.
fn part(watch: Watch<'_>, which: usize, of: usize) -> impl FnMut(f32) -> ControlFlow<()> {
    move |done| watch((which as f32 + done) / of as f32)
}

/// `Err` once the watcher has said stop.
fn hear(watch: Watch<'_>, done: usize, of: usize) -> Result<(), Trouble> {
    match watch(done as f32 / of.max(1) as f32) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Trouble::Stopped),
    }
}

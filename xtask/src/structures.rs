//! The structures, by name: the one place where names become types.

use rt_accel::Structure;

/// Something to be done with a structure whose name was given.
pub(crate) trait Job {
    /// What comes of it.
    type Out;
    /// Does it, with the parameters that the name stands for.
    fn run<S: Structure + 'static>(self, params: S::Params) -> Self::Out;
}

/// The parameters that stand beside a name, or the default.
macro_rules! params {
    ($structure:ty) => {
        <$structure as Structure>::Params::default()
    };
    ($structure:ty, $params:expr) => {
        $params
    };
}

macro_rules! structures {
    ($($name:literal => $structure:ty $(= $params:expr)?),* $(,)?) => {
        /// All names.
        pub(crate) const NAMES: &[&str] = &[$($name),*];

        /// Does `job` with the structure called `name`; without such a structure, says which there are.
        pub(crate) fn with<J: Job>(name: &str, job: J) -> Result<J::Out, String> {
            match name {
                $($name => Ok(job.run::<$structure>(params!($structure $(, $params)?))),)*
                _ => Err(format!("there is no structure {name:?}; there are {}", NAMES.join(", "))),
            }
        }
    };
}

structures! {
    "bvh" => rt_bvh::Bvh,
    "exhaustive" => rt_accel::Exhaustive,
    "grid" => rt_grid::Grid,
    "grid:nested" => rt_grid::Grid = rt_grid::GridParams::nested(),
    "grid:two-level" => rt_grid::Grid = rt_grid::GridParams::two_level(),
}

//! The structures, by name: the one place where names become types.

use rt_accel::Structure;

/// Something to be done with a structure whose name was given.
pub(crate) trait Job {
    /// What comes of it.
    type Out;
    /// Does it, with the parameters that the name stands for.
    fn run<S: Structure + 'static>(self, params: S::Params) -> Self::Out;
}

macro_rules! structures {
    ($($name:literal => $structure:ty $(= $params:expr)?),* $(,)?) => {
        /// All names.
        pub(crate) const NAMES: &[&str] = &[$($name),*];

        /// Does `job` with the structure called `name`; without such a structure, says which there are.
        pub(crate) fn with<J: Job>(name: &str, job: J) -> Result<J::Out, String> {
            match name {
                $($name => {
                    let params = None::<<$structure as Structure>::Params>;
                    $(let params = Some($params);)?
                    Ok(job.run::<$structure>(params.unwrap_or_default()))
                })*
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

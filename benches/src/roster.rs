//! The structures, by name: the one place where names become types. Variants follow a colon.

use rt_accel::{Clip, Exhaustive, Structure};
use rt_bsp::{Bsp, BspParams};
use rt_bvh::{Bvh, BvhParams};
use rt_grid::{Grid, GridParams};
use rt_kdtree::{KdTree, KdTreeParams};
use rt_octree::{Octree, OctreeParams};

/// Something to be done with a structure whose name was given.
pub trait Job {
    /// What comes of it.
    type Out;
    /// Does it, with the parameters that the name stands for.
    fn run<S: Structure + 'static>(self, params: &S::Params) -> Self::Out;
}

macro_rules! structures {
    ($($name:literal => $structure:ty: $params:expr),* $(,)?) => {
        /// All names.
        pub const NAMES: &[&str] = &[$($name),*];

        /// Does `job` with the structure called `name`; without such a structure, says which there are.
        pub fn with<J: Job>(name: &str, job: J) -> Result<J::Out, String> {
            match name {
                $($name => Ok(job.run::<$structure>(&$params)),)*
                _ => Err(format!("there is no structure {name:?}; there are {}", NAMES.join(", "))),
            }
        }
    };
}

structures! {
    "bvh" => Bvh: BvhParams::default(),
    "kdtree" => KdTree: KdTreeParams::default(),
    "kdtree:box" => KdTree: KdTreeParams { clip: Clip::Box, ..KdTreeParams::default() },
    "bsp" => Bsp: BspParams::default(),
    "bsp:axis" => Bsp: BspParams::axis_only(),
    "grid" => Grid: GridParams::default(),
    "grid:nested" => Grid: GridParams::nested(),
    "grid:hug" => Grid: GridParams::hug(),
    "grid:two-level" => Grid: GridParams::two_level(),
    "octree" => Octree: OctreeParams::default(),
    "octree:classic" => Octree: OctreeParams::classic(4, 8),
    "octree:linear" => Octree: OctreeParams::linear(),
    "exhaustive" => Exhaustive: (),
}

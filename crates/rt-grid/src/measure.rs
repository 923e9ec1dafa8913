//! The resolution at which sampled rays cost least.

use crate::build::Part;
use crate::params::Resolution;
use crate::voxels::resolve;
use rt_accel::Sah;
use rt_bounds::Aabb;

pub(crate) fn resolution(bound: &Aabb, parts: &[Part], _rays: u32, _sah: Sah) -> [u32; 3] {
    resolve(Resolution::Density(5.0), bound, parts.len())
}

//! The resolution at which sampled rays cost least.

use crate::build::Part;
use crate::params::Resolution;
use crate::voxels::{Voxels, resolve, restrained};
use crate::walk::{Line, Walk};
use rt_accel::Sah;
use rt_bounds::Aabb;
use rt_geom::Ray;
use rt_geom::glam::DVec3;

/// Densities tried: powers of two from `2^LEAST` to `2^MOST`, from 4 on in whichever direction costs fall.
const LEAST: i32 = -4;
const MOST: i32 = 6;

/// A line through the box, and how much it may meet before it counts as stopped.
struct Sample {
    ray: Ray<f64>,
    /// Expected hits, then the distance at which the first grid says they are reached.
    stop: f64,
}

/// The cells along each axis at which isotropic lines through the box cost least, as steps and tests are counted.
///
/// A line ends where it has probably hit: primitives count as opaque flakes with a quarter of their boxes' mean projected area, spread
/// evenly over the cells that their boxes overlap; each line stands a seeded random number of expected hits, exponentially distributed.
/// Where it ends is found in the first grid and kept, so that all grids are judged by the same rays.
pub(crate) fn resolution(bound: &Aabb, parts: &[Part], rays: u32, sah: Sah) -> [u32; 3] {
    let mut samples = lines(bound, rays);
    let cost = |density: i32, samples: &mut [Sample], first: bool| {
        let rule = Resolution::Density(2f32.powi(density));
        let count =
            restrained(resolve(rule, bound, parts.len()), bound, parts, crate::build::MOST_OVERLAPS[0]);
        (count, expense(&Voxels::new(bound, count, 0), parts, samples, sah, first))
    };
    let mut at = 2;
    let mut best = cost(at, &mut samples, true);
    for step in [1, -1] {
        let mut moved = false;
        while (LEAST..=MOST).contains(&(at + step)) {
            let next = cost(at + step, &mut samples, false);
            if next.1 >= best.1 {
                break;
            }
            (best, at, moved) = (next, at + step, true);
        }
        if moved {
            break;
        }
    }
    best.0
}

/// What the samples cost in a grid; the first one says where they end.
fn expense(voxels: &Voxels, parts: &[Part], samples: &mut [Sample], sah: Sah, first: bool) -> f64 {
    let (strides, ruler) = (voxels.strides(), voxels.ruler());
    let mut refs = vec![0u32; voxels.cells()];
    let mut opaque = vec![0f32; if first { refs.len() } else { 0 }];
    let volume: f64 = voxels.width.iter().product();
    for (_, part) in parts {
        let [x, y, z] = ruler.ranges(part);
        let s = part.size().as_dvec3();
        let flake = 0.25 * DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y).length();
        let cells: f64 = [x, y, z].iter().map(|[from, to]| (to - from + 1) as f64).product();
        let share = (flake / (cells * volume)) as f32;
        for k in z[0]..=z[1] {
            for j in y[0]..=y[1] {
                let at = k as usize * strides[2] + j as usize * strides[1];
                for i in x[0]..=x[1] {
                    refs[at + i as usize] += 1;
                    if first && share.is_finite() {
                        opaque[at + i as usize] += share;
                    }
                }
            }
        }
    }
    let mut total = 0.0;
    for sample in samples {
        let line = Line::new(&sample.ray, [0.0; 3]);
        let Some([from, to]) = line.span(voxels, line.near, line.far) else { continue };
        let mut walk = Walk::enter(line, voxels, from, to);
        let (mut met, end) = (0.0, if first { f64::INFINITY } else { sample.stop });
        let mut stop = f64::INFINITY;
        loop {
            total += sah.traverse as f64 + sah.intersect as f64 * refs[walk.cell] as f64;
            let (cell, entered) = (walk.cell, walk.entered);
            let goes_on = walk.advance();
            if first {
                met += opaque[cell] as f64 * (if goes_on { walk.entered } else { to } - entered) / line.unit;
                if met >= sample.stop {
                    stop = walk.entered;
                    break;
                }
            }
            if !goes_on || walk.entered > end {
                break;
            }
        }
        if first {
            sample.stop = stop;
        }
    }
    total
}

/// Isotropic lines through the box, always the same ones.
fn lines(bound: &Aabb, count: u32) -> Vec<Sample> {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    // Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
    let mut unit = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    };
    let (low, high) = (bound.min.as_dvec3(), bound.max.as_dvec3());
    let (center, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let radius = half.length();
    let mut samples = Vec::new();
    // Flat and thin boxes are met by few; some lines are enough then.
    for _ in 0..count.saturating_mul(16) {
        let z = 2.0 * unit() - 1.0;
        let (sin, cos) = (core::f64::consts::TAU * unit()).sin_cos();
        let flat = (1.0 - z * z).max(0.0).sqrt();
        let dir = DVec3::new(flat * cos, flat * sin, z);
        let across = dir.any_orthonormal_vector();
        let (sin, cos) = (core::f64::consts::TAU * unit()).sin_cos();
        let offset = (across * cos + dir.cross(across) * sin) * (radius * unit().sqrt());
        let stop = -(1.0 - unit()).ln();
        let ray = Ray::new(center + offset - dir * radius, dir).between(0.0, 2.0 * radius);
        let line = Line::new(&ray, [0.0; 3]);
        let whole = Voxels::new(bound, [1; 3], 0);
        if ray.is_valid() && line.span(&whole, line.near, line.far).is_some() {
            samples.push(Sample { ray, stop });
            if samples.len() == count as usize {
                break;
            }
        }
    }
    samples
}

//! [`mount`]: a fractal mountain under four glass balls.

use super::{Pile, SKY, view};
use crate::numbers::{Random, ln};
use crate::scene::sized;
use crate::{Facet, Light, Material, Scene, SceneError};
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// How much rougher than flat a terrain of fractal dimension 2.2 is: `sqrt((2 / 2^(1 / (D - 1)))^2 - 1)`.
const ROUGH: f64 = 0.509_824_528_533_958_7;

/// A fractal mountain of dimension 2.2 with four glass balls over it, `mount`: `2 * 4^size` triangles, 8192 at the default size of
/// 6, at most 8 388 608 at size 11, then the balls.
///
/// Squares are divided in four; middles of edges and squares are displaced by a normal variate that belongs to their place on the
/// grid, so neighbours agree. To size 7 the variate is that of the databases, whose seeds are known to repeat, which shows; beyond,
/// where it is not defined, seeds are mixed well.
///
/// Source: Haines, *Standard Procedural Databases*, `mount`; Fournier, Fussell, Carpenter, "Computer rendering of stochastic
/// models", *CACM* 25(6), 1982.
///
/// # Errors
///
/// Beyond size 11.
pub fn mount(size: u32) -> Result<Scene, SceneError> {
    let size = sized("mount", size, 0, 11)?;
    let n = 1u32 << size;
    let mut pile = Pile::new(2 * (n as usize).pow(2) + 4);
    for facet in Facet::all(terrain(size)) {
        pile.push(facet, 0);
    }
    let middle = DVec3::new(-0.8, 0.8, 1.0);
    let out = 0.17 * 1.5f64.sqrt();
    // A regular tetrahedron, one corner up; the others a third of a turn apart, towards (1, -1) first.
    let (down, side) = (-out / 3.0, out * 8f64.sqrt() / 3.0);
    let toward = DVec3::new(1.0, -1.0, 0.0) / 2f64.sqrt();
    let across = DVec3::new(1.0, 1.0, 0.0) / 2f64.sqrt();
    pile.sphere(middle + DVec3::Z * out, 0.17, 1);
    for (cos, sin) in [(1.0, 0.0), (-0.5, 0.75f64.sqrt()), (-0.5, -(0.75f64.sqrt()))] {
        pile.sphere(middle + DVec3::Z * down + (toward * cos + across * sin) * side, 0.17, 1);
    }
    let rock = Material { color: [0.5, 0.45, 0.35], ..Material::default() };
    let glass = Material { color: [1.0; 3], kd: 0.1, ks: 0.1, shine: 3.0827, transmittance: 0.9, ior: 1.5 };
    Ok(Scene {
        lights: Light::shared(&[[-100.0, -100.0, 100.0]]),
        view: view([-1.6, 1.6, 1.7], [0.0; 3], [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("mount", vec![rock, glass])
    })
}

fn terrain(size: u32) -> TriangleMesh<f64> {
    let n = 1u32 << size;
    let mut heights = Heights { size, n, of: vec![0.0; (n as usize + 1).pow(2)] };
    let mut triangles = Vec::with_capacity(2 * (n as usize).pow(2));
    heights.divide([0, 0], n, &mut triangles);
    let place = |i: u32| -1.0 + 2.0 * f64::from(i) / f64::from(n);
    let vertex = |i: usize| {
        let (x, y) = (i as u32 % (n + 1), i as u32 / (n + 1));
        [place(x), place(y), heights.of[i]]
    };
    crate::numbers::mesh((0..heights.of.len()).map(vertex).collect(), triangles)
}

struct Heights {
    size: u32,
    /// Cells per side.
    n: u32,
    /// Of the corners of cells, row by row.
    of: Vec<f64>,
}

impl Heights {
    fn index(&self, [x, y]: [u32; 2]) -> u32 {
        y * (self.n + 1) + x
    }

    fn height(&self, at: [u32; 2]) -> f64 {
        self.of[self.index(at) as usize]
    }

    /// Gives heights to the square of `width` cells whose lower left corner is `[x, y]`, whose corners have theirs, and cuts its
    /// cells in triangles.
    fn divide(&mut self, [x, y]: [u32; 2], width: u32, triangles: &mut Vec<[u32; 3]>) {
        let corners = [[x, y], [x + width, y], [x + width, y + width], [x, y + width]];
        if width == 1 {
            let [ll, lr, ur, ul] = corners.map(|at| self.index(at));
            triangles.extend([[ll, lr, ur], [ur, ul, ll]]);
            return;
        }
        let half = width / 2;
        let rise = f64::from(width) / f64::from(self.n) * ROUGH;
        let [ll, lr, ur, ul] = corners.map(|at| self.height(at));
        let edges = [
            ([x + half, y], ll + lr),
            ([x + width, y + half], lr + ur),
            ([x + half, y + width], ur + ul),
            ([x, y + half], ul + ll),
        ];
        for (at, sum) in edges {
            self.set(at, sum * 0.5, rise);
        }
        self.set([x + half, y + half], (ll + lr + ur + ul) * 0.25, rise * std::f64::consts::SQRT_2);
        for [dx, dy] in [[0, 0], [half, 0], [half, half], [0, half]] {
            self.divide([x + dx, y + dy], half, triangles);
        }
    }

    fn set(&mut self, at: [u32; 2], mean: f64, rise: f64) {
        let index = self.index(at) as usize;
        self.of[index] = mean + rise * normal_variate(self.seed(at));
    }

    fn seed(&self, [x, y]: [u32; 2]) -> u64 {
        if self.size <= 7 {
            let left = |i: u32, by: u32| u64::from(i) << (by - self.size);
            return 21 + ((left(x, 23) + left(y, 15) + left(x, 7)) & 0xffff);
        }
        // As coarse points are fine points too, all sizes beyond have the same mountain.
        Random::at(21, x << (11 - self.size), y << (11 - self.size)) % MODULUS
    }
}

const MODULUS: u64 = 134_456;

/// A normal variate by the polar method from a linear congruential generator.
///
/// Source: Marsaglia and Bray, "A convenient method for generating normal variables", *SIAM Review* 6(3), 1964.
fn normal_variate(seed: u64) -> f64 {
    let mut x = seed;
    let mut next = || {
        x = (28_411 + 8_121 * x) % MODULUS;
        2.0 * x as f64 / MODULUS as f64 - 1.0
    };
    loop {
        let (a, b) = (next(), next());
        let square = a * a + b * b;
        if square > 0.0 && square < 1.0 {
            return a * (-2.0 * ln(square) / square).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SceneGeometry, Solid};

    #[test]
    fn heights_and_balls_are_those_of_the_databases() {
        let rough = ((2.0 / 2f64.powf(1.0 / 1.2)).powi(2) - 1.0).sqrt();
        assert!((rough - ROUGH).abs() < 1e-15, "{rough}");
        let mesh = terrain(6);
        let (low, high) =
            mesh.vertices().iter().fold((0.0f64, 0.0f64), |(l, h), v| (l.min(v[2]), h.max(v[2])));
        assert!((low + 0.7029533).abs() < 1e-7 && (high - 0.9231396).abs() < 1e-7, "{low} {high}");
        let SceneGeometry::Solids(solids) = mount(0).unwrap().geometry else { panic!() };
        let known = [
            [-0.8, 0.8, 1.20821],
            [-0.661196, 0.661196, 0.930598],
            [-0.749194, 0.98961, 0.930598],
            [-0.98961, 0.749194, 0.930598],
        ];
        for place in known.map(DVec3::from_array) {
            let near = |s: &Solid| matches!(s, Solid::Sphere(s) if s.center().distance(place) < 1e-5);
            assert!(solids.iter().any(near), "{place}");
        }
    }

    #[test]
    fn large_mountains_are_alike() {
        let (coarse, fine) = (terrain(8), terrain(9));
        let at = |mesh: &TriangleMesh<f64>, n: usize, x: usize, y: usize| mesh.vertices()[y * (n + 1) + x];
        assert_eq!(at(&coarse, 256, 31, 200), at(&fine, 512, 62, 400));
        assert!(coarse.vertices().iter().all(|v| v[2].abs() < 1.5));
    }
}

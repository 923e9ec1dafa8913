//! [`terrain`]: fractal mountains and a lake, a million triangles.

use crate::numbers::{Random, mesh, turn};
use crate::scene::sized;
use crate::spd::SKY;
use crate::{Light, Material, Scene, SceneError, SceneGeometry, View};
use rt_geom::glam::{DVec2, DVec3};

/// Half the side of the land.
const HALF: f64 = 10.0;
/// How high mountains may be.
const HIGH: f64 = 2.4;

/// Fractal mountains around lakes, on a grid of `size x size` cells of two triangles: a million at the default size of 708, 50
/// million at 5000, the most.
///
/// The land is a ridged multifractal of gradient noise, ten octaves of it, whatever the size: a larger size shows the same land
/// finer. It is 20 wide, z is up, water lies at 0 and is flat: many coplanar triangles among rough ones. Steep parts are rock, high
/// ones snow, and water mirrors.
///
/// Sources: Perlin, "Improving noise", *SIGGRAPH* 2002 (the gradients here are of all directions); Musgrave, "Procedural fractal
/// terrains", in Ebert et al., *Texturing and Modeling* (2003).
///
/// # Errors
///
/// For size 0 and beyond size 5000.
///
/// ```
/// let scene = rt_scenes::terrain::terrain(100)?;
/// assert_eq!(scene.prim_count(), 20_000);
/// assert_eq!(scene.world_bound().min.z, 0.0);
/// # Ok::<(), rt_scenes::SceneError>(())
/// ```
pub fn terrain(size: u32) -> Result<Scene, SceneError> {
    let n = sized("terrain", size, 1, 5000)?;
    let land = Land::new();
    let place = |i: u32| HALF * (2.0 * f64::from(i) / f64::from(n) - 1.0);
    let mut vertices = Vec::with_capacity((n as usize + 1).pow(2));
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (place(i), place(j));
            vertices.push([x as f32, y as f32, land.height(DVec2::new(x, y)).max(0.0) as f32]);
        }
    }
    let mut triangles = Vec::with_capacity(2 * (n as usize).pow(2));
    let mut material_of = Vec::with_capacity(triangles.capacity());
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            // Cut the same way everywhere would show as stripes.
            let cuts = if (i + j) % 2 == 0 { [[a, b, c], [c, d, a]] } else { [[b, c, d], [d, a, b]] };
            for cut in cuts {
                triangles.push(cut);
                material_of.push(cover(cut.map(|v| DVec3::from_array(vertices[v as usize].map(f64::from)))));
            }
        }
    }
    let diffuse = |color| Material { color, ..Material::default() };
    let water = Material { color: [0.1, 0.25, 0.35], kd: 0.5, ks: 0.4, shine: 100.0, ..Material::default() };
    Ok(Scene {
        name: "terrain".to_string(),
        geometry: SceneGeometry::Mesh(mesh(vertices, triangles)),
        materials: vec![
            water,
            diffuse([0.3, 0.45, 0.15]),
            diffuse([0.5, 0.45, 0.4]),
            diffuse([0.95, 0.95, 1.0]),
        ],
        material_of,
        lights: Light::shared(&[[-60.0, -30.0, 50.0]]),
        view: View {
            from: DVec3::new(-3.0, -12.5, 4.5),
            at: DVec3::new(0.0, -1.0, 0.2),
            up: DVec3::Z,
            angle: std::f64::consts::FRAC_PI_4,
        },
        background: SKY,
        warnings: Vec::new(),
    })
}

/// The number of the material of a triangle: 0 water, 1 grass, 2 rock, 3 snow.
fn cover([a, b, c]: [DVec3; 3]) -> u32 {
    if a.z == 0.0 && b.z == 0.0 && c.z == 0.0 {
        return 0;
    }
    let normal = (b - a).cross(c - a);
    let flat = normal.z * normal.z / normal.length_squared();
    let height = (a.z + b.z + c.z) / 3.0;
    // Where it is steep nothing grows, and snow slides off.
    match height {
        _ if flat < 0.45 => 2,
        h if h > 0.5 * HIGH => 3,
        h if h > 0.36 * HIGH => 2,
        _ => 1,
    }
}

/// Heights over the plane.
struct Land {
    gradients: [DVec2; 256],
}

impl Land {
    fn new() -> Land {
        let gradient = |i: usize| {
            let (sin, cos) = turn(i as u64, 256);
            DVec2::new(cos, sin)
        };
        Land { gradients: core::array::from_fn(gradient) }
    }

    /// Ridges, finer ones on what is high already.
    fn height(&self, at: DVec2) -> f64 {
        let (mut sum, mut weight, mut share) = (0.0, 1.0, 0.5);
        let mut p = at * 0.12 + DVec2::new(5.3, 9.1);
        for octave in 0..10 {
            let ridge = 1.0 - 1.6 * self.noise(p, octave).abs();
            let signal = ridge * ridge * weight;
            sum += signal * share;
            weight = (1.6 * signal).clamp(0.0, 1.0);
            share *= 0.48;
            p *= 2.03;
        }
        HIGH * (sum - 0.3) / 0.7
    }

    /// Gradient noise, in `[-1, 1]`: 0 at grid points, with the slope that belongs to each.
    fn noise(&self, p: DVec2, octave: u64) -> f64 {
        let cell = p.floor();
        let (f, x, y) = (p - cell, cell.x as i64 as u32, cell.y as i64 as u32);
        let slope = |dx: u32, dy: u32| {
            let hash = Random::at(octave, x.wrapping_add(dx), y.wrapping_add(dy)) >> 56;
            self.gradients[hash as usize].dot(f - DVec2::new(f64::from(dx), f64::from(dy)))
        };
        let ease = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (u, v) = (ease(f.x), ease(f.y));
        let row = |dy: u32| slope(0, dy) * (1.0 - u) + slope(1, dy) * u;
        (row(0) * (1.0 - v) + row(1) * v) * std::f64::consts::SQRT_2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_land_and_water_and_a_finer_grid_shows_the_same() {
        let (coarse, fine) = (terrain(50).unwrap(), terrain(100).unwrap());
        for kind in 0..4 {
            let share = fine.material_of.iter().filter(|&&m| m == kind).count();
            assert!(share > 400, "{kind}: {share}");
        }
        let vertex = |scene: &Scene, n: usize, i: usize, j: usize| {
            let SceneGeometry::Mesh(mesh) = &scene.geometry else { panic!() };
            mesh.vertices()[j * (n + 1) + i]
        };
        assert!((0..50).all(|i| vertex(&coarse, 50, i, 7) == vertex(&fine, 100, 2 * i, 14)));
        assert!(terrain(0).is_err() && terrain(5001).is_err());
    }
}

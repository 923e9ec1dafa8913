//! [`interior`]: rooms with pillars, stairs and furniture.

use crate::numbers::{Random, turn};
use crate::scene::sized;
use crate::soup::Soup;
use crate::{Light, Material, Scene, SceneError, SceneGeometry, View};
use rt_geom::glam::DVec3;

/// The side of a room, in metres.
const ROOM: f64 = 8.0;
/// Its height.
const HIGH: f64 = 4.0;
/// How thick walls are.
const WALL: f64 = 0.3;

const PLASTER: u32 = 0;
const FLOOR: u32 = 1;
const STONE: u32 = 2;
const WOOD: u32 = 3;
const LAMP: u32 = 4;
/// The first of four.
const BOOK: u32 = 5;

/// A building of `size x size` rooms seen from inside: about 11 000 triangles a room, 97 000 at the default size of 3; 11 million at
/// size 32, the most.
///
/// Walls with doors between rooms and windows to the outside, and what stands in the rooms, by turns: a dining table with chairs, a
/// staircase with a balustrade, shelves of books, rows of pillars. z is up, units are metres. What a building has and soups lack:
/// large walls parallel to the axes that hide nearly everything, beside small curved things, in clusters; the eye and the lights
/// inside; rays that nearly all hit. Floors mirror a little.
///
/// # Errors
///
/// For size 0 and beyond size 32.
///
/// ```
/// let scene = rt_scenes::interior::interior(3)?;
/// assert!((80_000..120_000).contains(&scene.prim_count()));
/// # Ok::<(), rt_scenes::SceneError>(())
/// ```
pub fn interior(size: u32) -> Result<Scene, SceneError> {
    let n = sized("interior", size, 1, 32)?;
    let mut site = Site { soup: Soup::new(0), material_of: Vec::new(), random: Random::new(8) };
    for line in 0..=n {
        let outside = line == 0 || line == n;
        for i in 0..n {
            site.wall(line, i, outside, DVec3::new);
            site.wall(line, i, outside, |along, across, z| DVec3::new(across, along, z));
        }
    }
    for y in 0..n {
        for x in 0..n {
            let middle = DVec3::new((f64::from(x) + 0.5) * ROOM, (f64::from(y) + 0.5) * ROOM, 0.0);
            site.shell(middle);
            for (dx, dy) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
                site.pillar(middle + DVec3::new(2.9 * dx, 2.9 * dy, 0.0));
            }
            site.lamp(middle);
            match (x + 2 * y) % 4 {
                0 => site.dining(middle),
                1 => site.library(middle),
                2 => site.stairs(middle),
                _ => site.colonnade(middle),
            }
        }
    }
    let diffuse = |color| Material { color, ..Material::default() };
    let materials = vec![
        diffuse([0.85, 0.82, 0.75]),
        Material { color: [0.45, 0.3, 0.2], kd: 0.8, ks: 0.15, shine: 60.0, ..Material::default() },
        diffuse([0.7, 0.7, 0.68]),
        diffuse([0.5, 0.3, 0.15]),
        diffuse([1.0, 0.95, 0.8]),
        diffuse([0.6, 0.1, 0.1]),
        diffuse([0.1, 0.3, 0.15]),
        diffuse([0.15, 0.2, 0.45]),
        diffuse([0.7, 0.6, 0.3]),
    ];
    // The lamps nearest to the eye, below their shades; more would only multiply shadow rays.
    let near = n.min(2);
    let lamps: Vec<[f64; 3]> = (0..near * near)
        .map(|i| [(f64::from(i % near) + 0.5) * ROOM, (f64::from(i / near) + 0.5) * ROOM, 2.55])
        .collect();
    Ok(Scene {
        name: "interior".to_string(),
        geometry: SceneGeometry::Mesh(site.soup.mesh()),
        materials,
        material_of: site.material_of,
        lights: lamps
            .into_iter()
            .map(|at| Light { position: DVec3::from_array(at), color: [0.5; 3] })
            .collect(),
        view: View {
            from: DVec3::new(0.9, 1.6, 1.75),
            at: DVec3::new(6.0, 4.6, 1.25),
            up: DVec3::Z,
            angle: 75f64.to_radians(),
        },
        background: [0.75, 0.85, 0.95],
        warnings: Vec::new(),
    })
}

/// What has been built.
struct Site {
    soup: Soup,
    material_of: Vec<u32>,
    random: Random,
}

impl Site {
    fn triangle(&mut self, corners: [DVec3; 3], material: u32) {
        self.soup.push(corners);
        self.material_of.push(material);
    }

    fn quad(&mut self, [a, b, c, d]: [DVec3; 4], material: u32) {
        self.triangle([a, b, c], material);
        self.triangle([a, c, d], material);
    }

    /// A closed box around `middle`, turned by `facing`, a unit vector.
    fn block(&mut self, middle: DVec3, half: DVec3, facing: DVec3, material: u32) {
        let side = DVec3::new(-facing.y, facing.x, 0.0);
        let at = |x: f64, y: f64, z: f64| {
            middle + facing * (x * half.x) + side * (y * half.y) + DVec3::Z * (z * half.z)
        };
        let around = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        self.quad(around.map(|(x, y)| at(x, y, 1.0)), material);
        self.quad(around.map(|(x, y)| at(x, -y, -1.0)), material);
        for i in 0..4 {
            let ((x, y), (u, v)) = (around[i], around[(i + 1) % 4]);
            self.quad([at(x, y, -1.0), at(u, v, -1.0), at(u, v, 1.0), at(x, y, 1.0)], material);
        }
    }

    /// What turning a profile of radii and heights about the vertical through `foot` makes, open at both ends.
    fn turned(&mut self, foot: DVec3, profile: &[(f64, f64)], sectors: u64, material: u32) {
        let at = |(r, z): (f64, f64), sector: u64| {
            let (sin, cos) = turn(sector, sectors);
            foot + DVec3::new(r * cos, r * sin, z)
        };
        for pair in profile.windows(2) {
            let (low, high) = (pair[0], pair[1]);
            for s in 0..sectors {
                let corners = [at(low, s), at(low, s + 1), at(high, s + 1), at(high, s)];
                match (low.0 == 0.0, high.0 == 0.0) {
                    (true, _) => self.triangle([corners[0], corners[2], corners[3]], material),
                    (_, true) => self.triangle([corners[0], corners[1], corners[2]], material),
                    _ => self.quad(corners, material),
                }
            }
        }
    }

    /// One room's part of a wall, number `line`, with a door inside and a window outside.
    fn wall(&mut self, line: u32, i: u32, outside: bool, place: impl Fn(f64, f64, f64) -> DVec3) {
        let start = f64::from(i) * ROOM;
        let across = f64::from(line) * ROOM;
        let (low, high, half) = if outside { (0.9, 2.9, 1.6) } else { (0.0, 2.5, 1.1) };
        let (left, right) = (start + ROOM * 0.5 - half, start + ROOM * 0.5 + half);
        let mut piece = |from: f64, to: f64, bottom: f64, top: f64| {
            let a = place(from, across - WALL * 0.5, bottom);
            let b = place(to, across + WALL * 0.5, top);
            self.block((a + b) * 0.5, (b - a) * 0.5, DVec3::X, PLASTER);
        };
        piece(start, left, 0.0, HIGH);
        piece(right, start + ROOM, 0.0, HIGH);
        piece(left, right, high, HIGH);
        if outside {
            piece(left, right, 0.0, low);
        }
    }

    /// Floor boards, and the ceiling.
    fn shell(&mut self, middle: DVec3) {
        let board = ROOM / 16.0;
        for i in 0..16 {
            let x = middle.x - ROOM * 0.5 + board * (f64::from(i) + 0.5);
            // A little below the next, so that edges show.
            let drop = if i % 2 == 0 { 0.0 } else { 0.004 };
            let half = DVec3::new(board * 0.5, ROOM * 0.5, 0.02);
            self.block(DVec3::new(x, middle.y, -0.02 - drop), half, DVec3::X, FLOOR);
        }
        let h = ROOM * 0.5;
        let corners = [(h, h), (h, -h), (-h, -h), (-h, h)];
        self.quad(corners.map(|(x, y)| middle + DVec3::new(x, y, HIGH)), PLASTER);
    }

    fn pillar(&mut self, foot: DVec3) {
        let mut profile = vec![(0.32, 0.15), (0.33, 0.22), (0.27, 0.3), (0.28, 0.36), (0.23, 0.42)];
        // The shaft swells a little: entasis.
        for i in 0..=8 {
            let t = f64::from(i) / 8.0;
            profile.push((0.22 - 0.05 * t * t, 0.45 + 2.95 * t));
        }
        profile.extend([(0.2, 3.45), (0.19, 3.5), (0.26, 3.65), (0.27, 3.75)]);
        self.turned(foot, &profile, 24, STONE);
        self.block(foot + DVec3::Z * 0.075, DVec3::new(0.36, 0.36, 0.075), DVec3::X, STONE);
        self.block(foot + DVec3::Z * 3.875, DVec3::new(0.32, 0.32, 0.125), DVec3::X, STONE);
    }

    fn lamp(&mut self, middle: DVec3) {
        self.turned(middle, &[(0.01, 3.0), (0.01, HIGH)], 6, WOOD);
        let shade: Vec<(f64, f64)> = (0..=8)
            .map(|i| {
                let (sin, cos) = turn(i, 32);
                (0.32 * cos, 2.7 + 0.3 * sin)
            })
            .collect();
        self.turned(middle, &shade[..8], 24, LAMP);
    }

    fn leg(&mut self, foot: DVec3, height: f64, thick: f64) {
        let shape = [
            (0.6, 0.0),
            (0.8, 0.04),
            (0.5, 0.08),
            (0.7, 0.3),
            (1.0, 0.55),
            (0.8, 0.75),
            (0.6, 0.8),
            (1.0, 0.86),
        ];
        let mut profile: Vec<(f64, f64)> = shape.map(|(r, z)| (r * thick, z * height)).to_vec();
        profile.push((thick, height));
        self.turned(foot, &profile, 12, WOOD);
    }

    fn dining(&mut self, middle: DVec3) {
        let top = [(0.0, 0.72), (1.15, 0.72), (1.2, 0.735), (1.2, 0.75), (1.17, 0.765), (0.0, 0.765)];
        self.turned(middle, &top, 48, WOOD);
        for i in 0..4 {
            let (sin, cos) = turn(2 * i + 1, 8);
            self.leg(middle + DVec3::new(cos, sin, 0.0) * 0.8, 0.72, 0.05);
        }
        for i in 0..8 {
            // Nobody puts chairs back where they belong.
            let (sin, cos) = turn(100 * i + self.random.below(24), 800);
            let away = DVec3::new(cos, sin, 0.0);
            let (sin, cos) = turn(100 * i + self.random.below(70), 800);
            let out = 1.35 + 0.2 * self.random.signed();
            self.chair(middle + away * out, DVec3::new(cos, sin, 0.0));
        }
        let vase =
            [(0.0, 0.0), (0.08, 0.0), (0.13, 0.08), (0.12, 0.16), (0.05, 0.24), (0.05, 0.28), (0.08, 0.32)];
        self.turned(middle + DVec3::Z * 0.765, &vase, 32, BOOK + 2);
    }

    fn chair(&mut self, at: DVec3, facing: DVec3) {
        let side = DVec3::new(-facing.y, facing.x, 0.0);
        for (x, y) in [(0.18, 0.18), (-0.18, 0.18), (-0.18, -0.18), (0.18, -0.18)] {
            self.leg(at + facing * x + side * y, 0.44, 0.025);
        }
        self.block(at + DVec3::Z * 0.46, DVec3::new(0.22, 0.22, 0.02), facing, WOOD);
        let back = at + facing * 0.19;
        for i in -3..=3 {
            let slat = back + side * (0.06 * f64::from(i)) + DVec3::Z * 0.7;
            self.block(slat, DVec3::new(0.012, 0.015, 0.22), facing, WOOD);
        }
        self.block(back + DVec3::Z * 0.95, DVec3::new(0.02, 0.23, 0.04), facing, WOOD);
    }

    fn stairs(&mut self, middle: DVec3) {
        let (rise, run) = (HIGH / 22.0, 0.24);
        for i in 0..22 {
            let step = f64::from(i);
            let at = middle + DVec3::new(-2.4 + run * step, 2.2, rise * (step + 0.5));
            self.block(at, DVec3::new(run * 0.5 + 0.02, 0.9, rise * 0.5), DVec3::X, STONE);
            let foot = DVec3::new(at.x, middle.y + 1.35, rise * (step + 1.0));
            self.leg(foot, 0.9, 0.035);
        }
        // The hand-rail, from the first baluster to the last.
        let rail = |step: f64, y: f64, z: f64| {
            middle + DVec3::new(-2.4 + run * step, 1.35 + y, rise * (step + 1.0) + 0.92 + z)
        };
        let around = [(0.04, 0.03), (-0.04, 0.03), (-0.04, -0.03), (0.04, -0.03)];
        for i in 0..4 {
            let ((y, z), (u, v)) = (around[i], around[(i + 1) % 4]);
            self.quad([rail(-0.5, y, z), rail(21.5, y, z), rail(21.5, u, v), rail(-0.5, u, v)], WOOD);
        }
    }

    fn library(&mut self, middle: DVec3) {
        for (y, away) in [(-2.2, -1.0), (2.2, 1.0)] {
            let case = middle + DVec3::new(0.0, y, 0.0);
            for board in 0..6 {
                let z = 0.1 + 0.4 * f64::from(board);
                self.block(case + DVec3::Z * z, DVec3::new(2.0, 0.18, 0.015), DVec3::X, WOOD);
            }
            for x in [-2.0, 2.0] {
                self.block(case + DVec3::new(x, 0.0, 1.1), DVec3::new(0.02, 0.18, 1.1), DVec3::X, WOOD);
            }
            self.block(case + DVec3::new(0.0, 0.19 * away, 1.1), DVec3::new(2.0, 0.01, 1.1), DVec3::X, WOOD);
            for shelf in 0..5 {
                let mut x = -1.95;
                let bottom = 0.115 + 0.4 * f64::from(shelf);
                while x < 1.85 {
                    let thick = 0.035 + 0.015 * self.random.signed();
                    let high = 0.14 + 0.03 * self.random.signed();
                    let deep = 0.11 + 0.02 * self.random.signed();
                    let book = case + DVec3::new(x + thick, 0.0, bottom + high);
                    let number = BOOK + self.random.below(4) as u32;
                    self.block(book, DVec3::new(thick * 0.95, deep, high), DVec3::X, number);
                    x += 2.0 * thick;
                }
            }
        }
        self.chair(middle + DVec3::new(0.4, 0.3, 0.0), DVec3::X);
    }

    fn colonnade(&mut self, middle: DVec3) {
        for (x, y) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
            self.pillar(middle + DVec3::new(1.2 * x, 2.9 * y, 0.0));
            self.pillar(middle + DVec3::new(2.9 * x, 1.2 * y, 0.0));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_has_area_and_a_look() {
        let scene = interior(2).unwrap();
        let SceneGeometry::Mesh(mesh) = &scene.geometry else { panic!() };
        assert_eq!((mesh.degenerate(), scene.material_of.len()), (0, mesh.triangles().len()));
        let used: std::collections::BTreeSet<u32> = scene.material_of.iter().copied().collect();
        assert!(used.into_iter().eq(0..scene.materials.len() as u32));
        assert!(interior(0).is_err() && interior(33).is_err());
    }
}

//! [`stadium`]: a teapot in a stadium: much detail in a small place of a large scene.

use crate::numbers::turn;
use crate::soup::Soup;
use crate::spd::SKY;
use crate::{Light, Material, Scene, SceneError, SceneGeometry, View, teapot};
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// Half the outer length and width of the bowl, in metres.
const OUTER: (f64, f64) = (130.0, 105.0);
/// Half the length and width of the field.
const FIELD: (f64, f64) = (75.0, 50.0);
/// How high the last row of seats is.
const HEIGHT: f64 = 45.0;

/// The Utah teapot on a table in the middle of a stadium, `ratio` times smaller than it.
///
/// An elliptical bowl 260 long, 210 wide and 45 high, of 40 rows of seats in 72 sectors, with a field and four masts: 11 816
/// triangles. The pot is real, of `64 n^2 - 8 n` triangles for `n = detail`: 9120 for 12. It is `260 / ratio` long; at about 870 it has
/// the size of a pot. z is up. The view is filled by the pot; [`grandstand`] is another. What one grid can do ends where the whole pot
/// lies in one cell; hierarchies should not notice `ratio`.
///
/// The mesh is of `f32` around the pot, which stands about zero, so that it keeps its shape at any ratio.
///
/// Source: the name is Haines', in the early *Ray Tracing News*; nobody published data.
///
/// # Errors
///
/// When `ratio` is not between 1 and `1e7`, or `detail` not between 1 and 200.
///
/// ```
/// let scene = rt_scenes::stadium::stadium(870.0, 12)?;
/// assert_eq!(scene.prim_count(), 11_816 + 9_120 + 10);
/// # Ok::<(), rt_scenes::SceneError>(())
/// ```
pub fn stadium(ratio: f64, detail: u32) -> Result<Scene, SceneError> {
    crate::scene::sized("stadium", detail, 1, 200)?;
    if !(1.0..=1e7).contains(&ratio) {
        return Err(SceneError::Ratio { ratio });
    }
    let size = 2.0 * OUTER.0 / ratio;
    let (mesh, material_of) = build(40, 72, detail, size);
    let diffuse = |color| Material { color, ..Material::default() };
    Ok(Scene {
        name: "stadium".to_string(),
        geometry: SceneGeometry::Mesh(mesh),
        materials: vec![
            diffuse([0.55, 0.55, 0.6]),
            diffuse([0.25, 0.6, 0.2]),
            diffuse([0.5, 0.35, 0.2]),
            Material { color: [1.0, 0.5, 0.1], kd: 0.75, ks: 0.25, shine: 30.0, ..Material::default() },
        ],
        material_of,
        lights: Light::shared(&[[100.0, 70.0, 60.0], [-100.0, 70.0, 60.0], [0.0, -110.0, 70.0]]),
        view: View {
            from: DVec3::new(0.75, -1.2, 0.75) * size,
            at: DVec3::new(0.0, 0.0, 0.22) * size,
            up: DVec3::Z,
            angle: std::f64::consts::FRAC_PI_4,
        },
        background: SKY,
        warnings: Vec::new(),
    })
}

/// The view from the upper rows, in which the pot is smaller than a pixel.
pub fn grandstand() -> View {
    View {
        from: DVec3::new(-20.0, -95.0, 42.0),
        at: DVec3::ZERO,
        up: DVec3::Z,
        angle: std::f64::consts::FRAC_PI_3,
    }
}

/// A stadium of few seats: a trial for structures.
pub(crate) fn small(ratio: f64) -> TriangleMesh {
    build(5, 24, 3, 2.0 * OUTER.0 / ratio).0
}

/// The mesh, and the material number of each triangle: 0 seats and masts, 1 field, 2 table, 3 pot.
fn build(rows: u32, sectors: u32, detail: u32, size: f64) -> (TriangleMesh, Vec<u32>) {
    let mut soup = Soup::new(0);
    let mut material_of = Vec::new();
    let mut done = |soup: &Soup, number: u32| material_of.resize(soup.len(), number);

    // The table top is at zero, the field below by the height of a table for a pot of this size.
    let ground = -2.0 * size;
    let ring = |share: f64, sector: u32, z: f64| {
        let (sin, cos) = turn(u64::from(sector % sectors), u64::from(sectors));
        let along = FIELD.0 + (OUTER.0 - FIELD.0) * share;
        let across = FIELD.1 + (OUTER.1 - FIELD.1) * share;
        DVec3::new(along * cos, across * sin, ground + z)
    };
    for row in 0..rows {
        let share = |row: u32| f64::from(row) / f64::from(rows);
        let (inner, outer) = (share(row), share(row + 1));
        let (low, high) = (HEIGHT * inner, HEIGHT * outer);
        for sector in 0..sectors {
            let [a, b] = [sector, sector + 1].map(|s| ring(inner, s, low));
            let [c, d] = [sector + 1, sector].map(|s| ring(inner, s, high));
            let [e, f] = [sector + 1, sector].map(|s| ring(outer, s, high));
            // The riser, and the tread.
            quad(&mut soup, [b, a, d, c]);
            quad(&mut soup, [c, d, f, e]);
        }
    }
    for sector in 0..sectors {
        let [a, b] = [sector, sector + 1].map(|s| ring(1.0, s, 0.0));
        let [c, d] = [sector + 1, sector].map(|s| ring(1.0, s, HEIGHT));
        quad(&mut soup, [a, b, c, d]);
    }
    for (x, y) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
        let foot = DVec3::new(100.0 * x, 80.0 * y, ground);
        slab(&mut soup, foot - DVec3::new(0.5, 0.5, 0.0), foot + DVec3::new(0.5, 0.5, 60.0));
        slab(&mut soup, foot + DVec3::new(-4.0, -4.0, 60.0), foot + DVec3::new(4.0, 4.0, 62.0));
    }
    done(&soup, 0);
    for sector in 0..sectors {
        let middle = DVec3::new(0.0, 0.0, ground);
        soup.push([middle, ring(0.0, sector, 0.0), ring(0.0, sector + 1, 0.0)]);
    }
    done(&soup, 1);
    slab(&mut soup, DVec3::new(-0.6, -0.4, -0.05) * size, DVec3::new(0.6, 0.4, 0.0) * size);
    done(&soup, 2);
    let scale = size / 6.434075;
    for corners in teapot::triangles(detail) {
        soup.push(corners.map(|p| p * scale));
    }
    done(&soup, 3);
    (soup.mesh(), material_of)
}

fn quad(soup: &mut Soup, [a, b, c, d]: [DVec3; 4]) {
    soup.push([a, b, c]);
    soup.push([a, c, d]);
}

/// A box, without its underside.
fn slab(soup: &mut Soup, min: DVec3, max: DVec3) {
    let at = |x: bool, y: bool, z: bool| {
        let pick = |high: bool, axis: usize| if high { max[axis] } else { min[axis] };
        DVec3::new(pick(x, 0), pick(y, 1), pick(z, 2))
    };
    let corners = [(false, false), (true, false), (true, true), (false, true)];
    quad(soup, corners.map(|(x, y)| at(x, y, true)));
    for i in 0..4 {
        let ((x, y), (u, v)) = (corners[i], corners[(i + 1) % 4]);
        quad(soup, [at(x, y, false), at(u, v, false), at(u, v, true), at(x, y, true)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pot_keeps_its_shape_at_any_ratio() {
        for ratio in [1.0, 870.0, 1e7] {
            let scene = stadium(ratio, 12).unwrap();
            let SceneGeometry::Mesh(mesh) = &scene.geometry else { panic!() };
            let pot = (0..mesh.triangles().len() as u32).filter(|&i| scene.material_of[i as usize] == 3);
            let (mut min, mut max, mut count) = (DVec3::MAX, DVec3::MIN, 0);
            for corner in pot.flat_map(|i| mesh.triangle(i).corners) {
                (min, max, count) = (min.min(corner), max.max(corner), count + 1);
            }
            assert_eq!(count, 3 * 9120);
            assert!(((max.x - min.x) * ratio / 260.0 - 1.0).abs() < 1e-2, "ratio {ratio}");
            assert_eq!(mesh.degenerate(), 0);
            assert!(ratio < 2.0 || scene.world_bound().max.x == 130.0);
        }
        for ratio in [0.5, 2e7, f64::NAN] {
            assert!(stadium(ratio, 12).is_err());
        }
        assert!(stadium(1.0, 0).is_err() && stadium(1.0, 201).is_err());
    }
}

//! [`gears`]: meshing gears, some of glass, in layers.

use super::{Pile, SKY, view};
use crate::numbers::turn;
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::{DVec2, DVec3};

/// `size^3` gears of 36 teeth, `gears`: a layer of `size x size` that mesh, and `size` layers. One in five is of glass.
///
/// Primitive 0 is the ground. Each gear follows with its upper face, a concave polygon of 144 corners, its lower one, and 144
/// quadrilaterals between: `146 size^3 + 1` polygons, 9345 at the default size of 4, at most 1 168 001 at size 20. Its box is
/// `[-2, 2]^2 x [0, 1]`.
///
/// Source: Haines, *Standard Procedural Databases*, `gears`.
///
/// # Errors
///
/// For size 0 and beyond size 20.
pub fn gears(size: u32) -> Result<Scene, SceneError> {
    let n = sized("gears", size, 1, 20)?;
    let mut pile = Pile::new(146 * (n as usize).pow(3) + 1);
    let mut materials =
        vec![Material { color: [1.0, 0.85, 0.7], kd: 0.3, ks: 0.6, shine: 4.8188, ..Material::default() }];
    let ground = [(2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (2.0, -2.0)];
    pile.polygon(&ground.map(|(x, y)| DVec3::new(x, y, 0.0)), 0);

    let count = f64::from(n);
    let radius = 1.0 / (count - 0.05 * (count - 1.0));
    let thickness = (0.5 / count).min(0.1);
    for iz in 0..n {
        for iy in 0..n {
            for ix in 0..n {
                let place = |i: u32| -1.0 + radius + 1.9 * radius * f64::from(i);
                let top = 1.0 - f64::from(iz) / count;
                let center = DVec2::new(place(ix), place(iy));
                let upper = outline(center, radius, (ix + iy + iz) % 2 == 1).map(|p| p.extend(top));
                let lower = upper.map(|p| DVec3::new(p.x, p.y, top - thickness));
                let number = materials.len() as u32;
                materials.push(material([ix, iy, iz]));
                pile.polygon(&upper, number);
                for i in 0..144 {
                    let next = (i + 1) % 144;
                    pile.polygon(&[upper[i], lower[i], lower[next], upper[next]], number);
                }
                let mut below = lower;
                below.reverse();
                pile.polygon(&below, number);
            }
        }
    }
    let lights =
        [[2.0, 4.0, 4.0], [-2.0, 4.0, 3.0], [2.0, -2.5, 2.5], [-1.0, -4.0, 2.0], [-1.111, -2.121, 2.626]];
    Ok(Scene {
        lights: Light::shared(&lights),
        view: view([-1.1, -2.1, 2.6], [0.0; 3], [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("gears", materials)
    })
}

/// Four corners for each tooth, turning left: its land, and the gap behind it. Every other gear is turned by half a tooth.
fn outline(center: DVec2, radius: f64, turned: bool) -> [DVec2; 144] {
    core::array::from_fn(|i| {
        // In hundredths of the 10 degrees of a tooth.
        let (from_middle, share) = [(-19, 0.995), (19, 0.995), (30, 0.9), (70, 0.9)][i % 4];
        let angle = 100 * (i as i64 / 4) + if turned { 50 } else { 0 } + from_middle;
        let (sin, cos) = turn((angle + 3600) as u64, 3600);
        center + DVec2::new(cos, sin) * (share * radius)
    })
}

fn material([x, y, z]: [u32; 3]) -> Material {
    let share = |sum: u32, sevenths: u32| f64::from((sum + 1) * sevenths % 7) / 7.0 + 0.01;
    let rgb = [share(3 * x + 2 * y + z, 5), share(3 * y + 2 * z + x, 3), share(3 * z + 2 * x + y, 2)];
    let most = rgb.into_iter().fold(0.0, f64::max);
    let color = rgb.map(|c| (c / most) as f32);
    if (4 * x + 2 * y + z).is_multiple_of(5) {
        Material { color, kd: 0.2, transmittance: 0.8, ior: 1.1, ..Material::default() }
    } else {
        Material { color, ..Material::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SceneGeometry, Solid};

    #[test]
    fn faces_look_outward_and_edges_meet() {
        let SceneGeometry::Solids(solids) = gears(1).unwrap().geometry else { panic!() };
        let mut edges = std::collections::HashMap::<[u64; 6], i32>::new();
        for solid in &solids[1..] {
            let Solid::Polygon(polygon) = solid else { panic!() };
            let corners = polygon.corners();
            let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
            assert!(corners.len() > 4 || polygon.normal().dot(middle - DVec3::Z * 0.9) > 0.0);
            for (a, b) in (0..corners.len()).map(|i| (corners[i], corners[(i + 1) % corners.len()])) {
                let key = |a: DVec3, b: DVec3| [a.x, a.y, a.z, b.x, b.y, b.z].map(|x| (x + 0.0).to_bits());
                *edges.entry(key(a, b)).or_default() += 1;
                *edges.entry(key(b, a)).or_default() -= 1;
            }
        }
        assert!(edges.len() == 2 * 432 && edges.values().all(|&n| n == 0));
    }
}

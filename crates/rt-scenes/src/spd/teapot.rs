//! [`teapot`]: the Utah teapot on a board.

use super::{Pile, SKY, view};
use crate::scene::sized;
use crate::{Facet, Light, Material, Scene, SceneError, teapot};
use rt_geom::glam::DVec3;

/// The Utah teapot on a board of `size x size` squares, `teapot`: each of its 32 patches in `size x size` cells.
///
/// `64 size^2 - 8 size` triangles with normals, then the squares: 9264 primitives at the default size of 12, at most 4 257 792 at
/// size 256. The pot is not closed, and is seen from both sides. Its box is `[-4, 4]^2 x [0, 3.15]`.
///
/// Source: Haines, *Standard Procedural Databases*, `teapot`; Crow, "The origins of the teapot", *IEEE Computer Graphics and
/// Applications* 7(1), 1987.
///
/// # Errors
///
/// For size 0 and beyond size 256.
pub fn teapot(size: u32) -> Result<Scene, SceneError> {
    let n = sized("teapot", size, 1, 256)?;
    let mut pile = Pile::new((65 * n * n - 8 * n) as usize);
    for facet in Facet::all(teapot::smooth(n)) {
        pile.push(facet, 0);
    }
    let place = |i: u32| -4.0 + 8.0 * f64::from(i) / f64::from(n);
    for i in 0..n {
        for j in 0..n {
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            pile.polygon(&corners.map(|(x, y)| DVec3::new(place(x), place(y), 0.0)), 1 + (i + j) % 2);
        }
    }
    let pot = Material { color: [1.0, 0.5, 0.1], kd: 0.75, ks: 0.25, shine: 3.0827, ..Material::default() };
    let square = |grey| Material { color: [grey; 3], kd: 0.5, ks: 0.5, shine: 3.0827, ..Material::default() };
    Ok(Scene {
        lights: Light::shared(&[[-3.1, 9.8, 12.1], [11.3, 5.1, 8.8]]),
        view: view([4.86, 7.2, 5.4], [0.0; 3], [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("teapot", vec![pot, square(1.0), square(0.5)])
    })
}

//! [`patches`]: the Utah teapot, without a triangle.

use super::{Pile, glazed, lamps, place, view};
use crate::numbers::turns;
use crate::scene::sized;
use crate::{Material, Placed, Scene, SceneError, teapot};
use rt_geom::Transform;
use rt_geom::glam::DVec3;
use rt_shapes::{BezierPatch, BilinearPatch, Shape, Uv};
use std::sync::Arc;

/// The Utah teapot by its 32 bicubic patches, on a cloth of 144 bilinear ones that lies flat under the pot and in waves around it:
/// outlines are smooth at any distance. `size x size` pots, at most `32 x 32`, share their patches; one is the default.
///
/// # Errors
///
/// For size 0 and beyond size 32.
pub fn patches(size: u32) -> Result<Scene, SceneError> {
    let n = sized("patches", size, 1, 32)?;
    let pot: Vec<Arc<dyn Shape<f64, At = Uv>>> = teapot::teapot_nets()
        .map(|net| {
            // The parameters of the pot turn right seen from outside; normals shall point there.
            let patch = BezierPatch::new(net).expect("a generator's patch").flipped();
            Arc::new(patch) as Arc<dyn Shape<f64, At = Uv>>
        })
        .collect();
    let mut pile = Pile::new(32 * (n * n) as usize + 144);
    let scale = 1.0 / f64::from(n);
    for k in 0..n * n {
        let at = |i: u32| 8.0 * scale * (f64::from(i) + 0.5) - 4.0;
        let to = DVec3::new(at(k % n), at(k / n), 0.0);
        // One looks at the eye, others where they like.
        let turned = if n == 1 { 0.0 } else { f64::from(k) * 0.381_966 };
        let to = place(turned, 0.0, scale, if n == 1 { DVec3::ZERO } else { to });
        for patch in &pot {
            pile.push(Placed::new("a Bézier patch", Arc::clone(patch), to), k % 5);
        }
    }
    for k in 0..144 {
        let (i, j) = (k % 12, k / 12);
        let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].map(|(i, j)| cloth(i, j));
        let patch = BilinearPatch::new(corners).expect("a generator's patch");
        pile.placed("a bilinear patch", patch, Transform::IDENTITY, 5 + (i + j) % 2);
    }
    let china = |color| Material { kd: 0.7, ks: 0.25, shine: 120.0, ..glazed(color) };
    let cloth = |color| Material { kd: 0.75, ks: 0.12, shine: 20.0, ..glazed(color) };
    let materials = vec![
        china([1.0, 0.5, 0.1]),
        china([0.2, 0.55, 0.6]),
        china([0.85, 0.8, 0.7]),
        china([0.65, 0.2, 0.25]),
        china([0.3, 0.4, 0.75]),
        cloth([0.9, 0.88, 0.82]),
        cloth([0.45, 0.2, 0.22]),
    ];
    let lights = lamps([-3.1, 9.8, 12.1], [11.3, 5.1, 8.8]);
    Ok(pile.exhibition("patches", materials, lights, view([3.9, 8.0, 5.2], [0.2, 0.0, 0.9], 42.0)))
}

/// A corner of the cloth, `i` and `j` from 0 to 12.
fn cloth(i: u32, j: u32) -> DVec3 {
    let at = |i: u32| 13.0 * (f64::from(i) / 12.0 - 0.5);
    let (x, y) = (at(i), at(j));
    let far = ((x * x + y * y).sqrt() - 2.6).clamp(0.0, 2.0);
    let wave = turns(0.19 * x + 0.11 * y).0 + turns(0.07 * x - 0.23 * y + 0.2).0;
    DVec3::new(x, y, 0.16 * far * wave)
}

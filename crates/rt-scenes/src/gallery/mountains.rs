//! [`mountains`]: millions of facets, none of them stored.

use super::{Pile, lamps, matt, view};
use crate::scene::sized;
use crate::{Material, Scene, SceneError};
use rt_geom::Transform;
use rt_geom::glam::{DVec2, DVec3};
use rt_shapes::{Fractal, Terrain, TerrainParams};

/// A fractal terrain of `2 * 4^size` facets around a lake, which exist only while a ray looks at them: 8 million at the default size of
/// 11, two thousand million at 15, the most. Two primitives: the land, and the water.
///
/// # Errors
///
/// For size 0 and beyond size 15.
pub fn mountains(size: u32) -> Result<Scene, SceneError> {
    let level = sized("mountains", size, 1, 15)?;
    let heights = Fractal { seed: 8, rise: 1.25, hurst: 0.95, corners: [-0.5, -0.3, 1.4, 1.0] };
    let params = TerrainParams {
        min: DVec2::splat(-10.0),
        size: DVec2::splat(20.0),
        level,
        cached: level.min(8),
        ..TerrainParams::default()
    };
    let land = Terrain::new(heights, params).expect("a generator's terrain");
    let mut pile = Pile::new(2);
    pile.placed("a fractal terrain", land, Transform::IDENTITY, 0);
    pile.polygon(
        &[[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]].map(|[x, y]| DVec3::new(x, y, 0.0)),
        1,
    );
    let water = Material { kd: 0.35, ks: 0.45, shine: 200.0, ..matt([0.1, 0.25, 0.35]) };
    let scene = pile.exhibition(
        "mountains",
        vec![matt([0.62, 0.56, 0.48]), water],
        lamps([-60.0, -10.0, 28.0], [40.0, -60.0, 60.0]),
        view([-1.5, -12.5, 3.3], [0.3, 0.0, 0.4], 45.0),
    );
    Ok(Scene { background: [0.5, 0.68, 0.88], ..scene })
}

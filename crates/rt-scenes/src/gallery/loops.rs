//! [`loops`]: one cage, four surfaces.

use super::{Pile, glazed, lamps, matt, view};
use crate::scene::sized;
use crate::{Facet, Material, Scene, SceneError};
use rt_geom::glam::DVec3;
use rt_shapes::{LoopError, LoopSurface};

/// Loop subdivision surfaces of four control nets, called `loop`, which stand about them as cages of wire: an hourglass, smooth; its
/// rims half sharp; its rims sharp for ever; and open at the top, with a boundary. In `size` levels of subdivision, at most 8, of
/// which 4 are the default.
///
/// # Errors
///
/// Beyond size 8.
pub fn loops(size: u32) -> Result<Scene, SceneError> {
    let level = sized("loop", size, 0, 8)?;
    let mut pile = Pile::new(0);
    pile.board(6, 1.25, 0.0, [0, 1]);
    let stands = [[-1.75, 1.7], [1.75, 1.7], [-1.75, -1.7], [1.75, -1.7]];
    for (k, ([x, y], kind)) in
        (2..).zip(stands.into_iter().zip([Rims::Smooth, Rims::Half, Rims::Sharp, Rims::Open]))
    {
        exhibit(&mut pile, DVec3::new(x, y, 1.3), kind, level, k).expect("a generator's net");
    }
    let board = |grey: f32| Material {
        kd: 0.65,
        ks: 0.15,
        shine: 100_000.0,
        ..glazed([grey, grey * 0.97, grey * 0.9])
    };
    let wire = Material { kd: 0.7, ks: 0.2, shine: 80.0, ..matt([0.95, 0.85, 0.55]) };
    let materials = vec![
        board(0.75),
        board(0.4),
        glazed([0.3, 0.6, 0.8]),
        glazed([0.4, 0.7, 0.4]),
        glazed([0.85, 0.35, 0.3]),
        glazed([0.7, 0.5, 0.85]),
        wire,
    ];
    let lights = lamps([-6.0, -9.0, 13.0], [9.0, -5.0, 9.0]);
    Ok(pile.exhibition("loop", materials, lights, view([0.9, -9.6, 7.6], [0.0, -0.1, 0.9], 38.0)))
}

#[derive(Clone, Copy, PartialEq)]
enum Rims {
    Smooth,
    Half,
    Sharp,
    Open,
}

/// A surface and its cage around a middle.
fn exhibit(pile: &mut Pile, middle: DVec3, rims: Rims, level: u32, material: u32) -> Result<(), LoopError> {
    // Three rings of six, the middle one narrow, and a vertex at either end.
    let corners = [[2, 0], [1, 2], [-1, 2], [-2, 0], [-1, -2], [1, -2]];
    let ring = |z: f64, wide: f64| {
        corners.map(|[x, y]: [i32; 2]| DVec3::new(0.5 * f64::from(x) * wide, 0.433 * f64::from(y) * wide, z))
    };
    let mut points: Vec<DVec3> = [ring(-1.25, 1.15), ring(0.0, 0.6), ring(1.25, 1.15)].concat();
    points.extend([DVec3::Z * -1.25, DVec3::Z * 1.25]);
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for i in 0..6 {
        let j = (i + 1) % 6;
        for low in [0, 6] {
            let (a, b, c, d) = (low + i, low + j, low + 6 + j, low + 6 + i);
            // Cut both ways in turn, so that the net mirrors itself.
            triangles.extend(if (i + low / 6) % 2 == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
            edges.push(if (i + low / 6) % 2 == 0 { [a, c] } else { [b, d] });
            edges.push([a, d]);
        }
        triangles.push([18, j, i]);
        edges.extend([[i, j], [6 + i, 6 + j], [12 + i, 12 + j], [18, i]]);
        if rims != Rims::Open {
            triangles.push([19, 12 + i, 12 + j]);
            edges.push([19, 12 + i]);
        }
    }
    if rims == Rims::Open {
        points.truncate(19);
    }
    let sharp = match rims {
        Rims::Half => 1.5,
        Rims::Sharp => f32::INFINITY,
        Rims::Smooth | Rims::Open => 0.0,
    };
    let rim = |i: u32| [[i, (i + 1) % 6], [12 + i, 12 + (i + 1) % 6]];
    let creases: Vec<([u32; 2], f32)> = (0..6).flat_map(rim).map(|edge| (edge, sharp)).collect();
    let vertices = points.iter().map(|&p| (middle + p).to_array()).collect();
    let surface = LoopSurface::new::<f64>(vertices, triangles)?.with_creases(&creases)?;
    for facet in Facet::all(surface.refine(level)?) {
        pile.push(facet, material);
    }
    for [a, b] in edges {
        let ends = [a, b].map(|i| middle + points[i as usize]);
        pile.frustum(ends, [0.016; 2], 6);
    }
    for point in points {
        pile.sphere(middle + point, 0.045, 6);
    }
    Ok(())
}

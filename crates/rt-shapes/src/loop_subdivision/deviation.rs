//! How far a tessellation is from the surface it stands for.

use super::{LoopError, LoopSurface};
use rt_geom::glam::DVec3;

/// Which vertices a tessellation has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vertices {
    /// Those of the subdivided control net, as [`LoopSurface::control`] gives them.
    Control,
    /// Their limits, as [`LoopSurface::refine`] gives them.
    Limit,
}

/// How far the limit surface is from a tessellation of it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Deviation {
    /// How many triangles the tessellation has.
    pub triangles: usize,
    /// The largest distance found from a point of the limit surface to the triangle that stands for its patch.
    pub largest: f64,
    /// The root of the mean squared distance, by area of the triangles.
    pub rms: f64,
}

impl LoopSurface {
    /// Measures the tessellation of level `level` in `fineness^2` points of each triangle, evenly spread and none on an edge; the
    /// largest distance also at its corners.
    ///
    /// The distance goes from a point of the limit surface to the nearest point of the triangle whose parameters it shares; the
    /// nearest point of the whole tessellation may be nearer.
    ///
    /// Pushing vertices to the limit brings the largest distance down by a third or more, but not the mean: with limit vertices
    /// all of a convex surface is on one side of its triangles, with control vertices parts are on either. At a round corner of
    /// a boundary control vertices come nearer by a half a level only, limit vertices by a quarter as everywhere.
    ///
    /// Cost: two or three microseconds a point, more beside extraordinary vertices.
    ///
    /// # Errors
    ///
    /// As [`LoopSurface::refine`].
    pub fn deviation(&self, level: u32, vertices: Vertices, fineness: u32) -> Result<Deviation, LoopError> {
        let net = self.net_at(level)?;
        let limits: Vec<DVec3> = net.starts().iter().map(|&start| net.limit(start).0).collect();
        let corners = match vertices {
            Vertices::Control => &net.points,
            Vertices::Limit => &limits,
        };
        let fineness = fineness.max(1);
        let (mut largest, mut squares, mut area) = (0.0f64, 0.0, 0.0);
        for (face, triangle) in (0..).zip(net.corners.chunks_exact(3)) {
            let patch = net.patch(face);
            let [a, b, c] = [0, 1, 2].map(|k| corners[triangle[k] as usize]);
            let off = |p: DVec3| (p - nearest(p, [a, b, c])).length_squared();
            for &v in triangle {
                largest = largest.max(off(limits[v as usize]));
            }
            let weight = (b - a).cross(c - a).length() / (fineness * fineness) as f64;
            for [u, v] in centres(fineness) {
                let off = off(patch.evaluate([1.0 - u - v, u, v]).point);
                largest = largest.max(off);
                squares += off * weight;
                area += weight;
            }
        }
        let rms = if area > 0.0 { (squares / area).sqrt() } else { 0.0 };
        Ok(Deviation { triangles: net.corners.len() / 3, largest: largest.sqrt(), rms })
    }
}

/// The centres of the `n^2` equal parts of a triangle, as weights of its second and third corner.
fn centres(n: u32) -> impl Iterator<Item = [f64; 2]> {
    let at = move |i: u32, j: u32, third: f64| [i, j].map(|i| (i as f64 + third) / n as f64);
    (0..n).flat_map(move |i| {
        (0..n - i).flat_map(move |j| {
            let upright = at(i, j, 1.0 / 3.0);
            let inverted = (i + j + 1 < n).then(|| at(i, j, 2.0 / 3.0));
            core::iter::once(upright).chain(inverted)
        })
    })
}

/// The point of the triangle nearest to `p`.
fn nearest(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let n = (b - a).cross(c - a);
    let inside = |x: DVec3, y: DVec3| n.dot((y - x).cross(p - x)) >= 0.0;
    if n != DVec3::ZERO && inside(a, b) && inside(b, c) && inside(c, a) {
        return p - n * (n.dot(p - a) / n.length_squared());
    }
    let on = |x: DVec3, y: DVec3| {
        let along = y - x;
        let share = along.dot(p - x) / along.length_squared();
        if share.is_finite() { x + along * share.clamp(0.0, 1.0) } else { x }
    };
    let nearer =
        |x: DVec3, y: DVec3| if (p - x).length_squared() <= (p - y).length_squared() { x } else { y };
    nearer(nearer(on(a, b), on(b, c)), on(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_their_centres_inside() {
        for n in 1..6 {
            let all: Vec<[f64; 2]> = centres(n).collect();
            assert_eq!(all.len() as u32, n * n);
            let mean = all.iter().map(|c| c[0] + c[1]).sum::<f64>() / all.len() as f64;
            assert!((mean - 2.0 / 3.0).abs() < 1e-14 && all.iter().all(|c| c[0] > 0.0 && c[0] + c[1] < 1.0));
        }
    }

    #[test]
    fn the_nearest_point_is_on_the_face_the_edge_or_the_corner() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let to = |x, y, z| nearest(DVec3::new(x, y, z), triangle).to_array();
        assert_eq!(to(0.25, 0.25, 3.0), [0.25, 0.25, 0.0]);
        assert_eq!(to(0.5, -2.0, 1.0), [0.5, 0.0, 0.0]);
        assert_eq!(to(1.0, 1.0, -1.0), [0.5, 0.5, 0.0]);
        assert_eq!(to(-1.0, -1.0, 0.0), [0.0, 0.0, 0.0]);
        assert_eq!(to(5.0, 1.0, 0.0), [1.0, 0.0, 0.0]);
    }
}

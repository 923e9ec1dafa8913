//! [`Tessellation`]: patches cut into triangles.

use super::BezierPatch;
use crate::{Refine, TriangleMesh};
use rt_accel::{BuildError, WorldBound};
use rt_bounds::Aabb;
use rt_geom::gamma;
use rt_geom::glam::DVec3;

/// Patches to be cut into triangles: each on a grid of `segments` by `segments` cells of two triangles, fewer where an edge
/// is a point.
///
/// Free of cracks: points on a border depend on the control points of the border alone, whichever way it runs in either
/// patch, so that neighbours sharing them share the points to the last bit, and rays through them are decided exactly.
///
/// Triangles come patch by patch, row by row; vertices carry the normals of the patch and its parameters as texture
/// coordinates. Triangles turn left seen from where the normals of the patch point to. 48 bytes a vertex, 24 a cell.
///
/// Error: falls as `1 / segments^2`: the distance of triangles from the patch is at most an eighth of the second derivatives
/// over `segments^2`.
///
/// ```
/// use rt_geom::glam::DVec3;
/// use rt_shapes::{BezierPatch, Refine, Tessellation};
/// let flat = core::array::from_fn(|k| DVec3::new((k / 4) as f64, (k % 4) as f64, 0.0));
/// let patches = vec![BezierPatch::new(flat)?];
/// assert_eq!(Tessellation { patches, segments: 3 }.refine()?.triangles().len(), 18);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Tessellation {
    /// The patches.
    pub patches: Vec<BezierPatch>,
    /// Cells along each parameter, from 1.
    pub segments: u32,
}

impl WorldBound for Tessellation {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }

    /// The box of the patches, with room for the rounding of points.
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        self.patches.iter().fold(Aabb::EMPTY, |all, patch| {
            let slack = DVec3::splat(patch.size * gamma(20));
            all.union(Aabb::from_f64(patch.min - slack, patch.max + slack, origin))
        })
    }
}

impl Refine for Tessellation {
    type Parts = TriangleMesh<f64>;

    /// # Errors
    ///
    /// [`BuildError::BadParam`] for no segments; [`BuildError::TooManyPrimitives`] and [`BuildError::OutOfMemory`] for too many.
    fn refine(&self) -> Result<TriangleMesh<f64>, BuildError> {
        let n = self.segments;
        if n == 0 {
            return Err(BuildError::BadParam { name: "segments", why: "must be at least 1" });
        }
        let rows = u64::from(n) + 1;
        let (cells, corners) = (u64::from(n) * u64::from(n), rows.saturating_mul(rows));
        let all = |each: u64| each.saturating_mul(self.patches.len() as u64);
        let max = u32::MAX as usize - 2;
        if all(cells.saturating_mul(2)).max(all(corners)) > max as u64 {
            let len = usize::try_from(all(cells.saturating_mul(2))).unwrap_or(usize::MAX);
            return Err(BuildError::TooManyPrimitives { len, max });
        }
        let (mut vertices, mut normals, mut uvs, mut triangles) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::<[u32; 3]>::new());
        reserve(&mut vertices, all(corners))?;
        reserve(&mut normals, all(corners))?;
        reserve(&mut uvs, all(corners))?;
        reserve(&mut triangles, all(2 * cells))?;
        for patch in &self.patches {
            let first = vertices.len() as u32;
            for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                vertices.push(patch.sample(i, j, n).to_array());
                normals.push(patch.normal(u, v).as_vec3().to_array());
                uvs.push([u as f32, v as f32]);
            }
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let [a, b, c, d] =
                    [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| first + i * (n + 1) + j);
                let at = |i: u32| vertices[i as usize];
                for [p, q, r] in [[a, b, c], [a, c, d]] {
                    if at(p) != at(q) && at(q) != at(r) && at(r) != at(p) {
                        triangles.push([p, q, r]);
                    }
                }
            }
        }
        Ok(TriangleMesh::new(vertices, triangles)?.with_normals(normals)?.with_uvs(uvs)?)
    }
}

fn reserve<T>(list: &mut Vec<T>, len: u64) -> Result<(), BuildError> {
    let len = usize::try_from(len).unwrap_or(usize::MAX);
    let needed = len.saturating_mul(size_of::<T>());
    list.try_reserve_exact(len).map_err(|_| BuildError::OutOfMemory { needed, limit: isize::MAX as usize })
}

impl BezierPatch {
    /// The point at `i / n`, `j / n`; on a border from its four control points alone, and the same from either end.
    fn sample(&self, i: u32, j: u32, n: u32) -> DVec3 {
        let c = &self.control;
        match (i, j) {
            (0, _) => border([c[0], c[1], c[2], c[3]], j, n),
            (_, 0) => border([c[0], c[4], c[8], c[12]], i, n),
            _ if i == n => border([c[12], c[13], c[14], c[15]], j, n),
            _ if j == n => border([c[3], c[7], c[11], c[15]], i, n),
            _ => self.point(f64::from(i) / f64::from(n), f64::from(j) / f64::from(n)),
        }
    }
}

/// The point of a cubic at `k / n`, from the end that comes first in order of coordinates.
fn border(p: [DVec3; 4], k: u32, n: u32) -> DVec3 {
    // A curve that is a point is exactly that point.
    if p.iter().all(|q| *q == p[0]) || k == 0 {
        return p[0];
    }
    if k == n {
        return p[3];
    }
    let [a, b, c, d] = p;
    let key = |p: [DVec3; 4]| p.map(|q| q.to_array());
    let backward = key([d, c, b, a]) < key(p);
    let (k, p) = if backward { (n - k, [d, c, b, a]) } else { (k, p) };
    super::curve(p, f64::from(k) / f64::from(n)).p
}

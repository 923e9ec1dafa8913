//! Meshes by rule and by chance: random triangles, clusters, sticks, grids, closed surfaces.
//!
//! Each is the same for the same numbers, on every machine. What is random takes a seed. Counts are cut off at [`MOST`].

use crate::numbers::{Random, mesh, turn};
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// The most triangles a mesh is made of here: beyond, it would fill more memory than most machines have.
pub const MOST: u32 = 50_000_000;

/// `n` triangles, with corners within a distance of a middle that is uniform in `[-1, 1]^3`, such that each touches a few
/// others: their size falls as the cube root of `n`.
///
/// ```
/// let soup = rt_scenes::soup::uniform(1000, 42);
/// assert_eq!(soup.triangles().len(), 1000);
/// assert_eq!(soup, rt_scenes::soup::uniform(1000, 42));
/// ```
pub fn uniform(n: u32, seed: u64) -> TriangleMesh {
    let n = n.min(MOST);
    let mut random = Random::new(seed);
    let size = reach(n);
    let mut soup = Soup::new(n);
    for _ in 0..n {
        let middle = cube_point(&mut random);
        soup.push([0; 3].map(|_| middle + cube_point(&mut random) * size));
    }
    soup.mesh()
}

/// `n` triangles in a dozen clusters whose sizes range from 1 to `1e-5`: what defeats grids.
pub fn clusters(n: u32, seed: u64) -> TriangleMesh {
    let n = n.min(MOST);
    let mut random = Random::new(seed);
    let mut size = 1.0;
    let clusters = [0; 12].map(|_| {
        let cluster = (cube_point(&mut random), size);
        size *= 0.35;
        cluster
    });
    let mut soup = Soup::new(n);
    for i in 0..n {
        let (middle, size) = clusters[i as usize % clusters.len()];
        let at = middle + cube_point(&mut random) * size;
        let size = size * reach(n / 12);
        soup.push([0; 3].map(|_| at + cube_point(&mut random) * size));
    }
    soup.mesh()
}

/// `n` long thin triangles in random directions, of lengths about 1, `aspect` times as long as wide: their boxes are all void.
///
/// An `aspect` below 1 or not finite is taken for 1.
pub fn sticks(n: u32, aspect: f64, seed: u64) -> TriangleMesh {
    let n = n.min(MOST);
    let aspect = if aspect.is_finite() { aspect.max(1.0) } else { 1.0 };
    let mut random = Random::new(seed);
    let mut soup = Soup::new(n);
    for _ in 0..n {
        let (middle, along, aside) =
            (cube_point(&mut random), cube_point(&mut random), cube_point(&mut random));
        let wide = along.cross(aside).normalize_or(DVec3::X) * (along.length() / aspect);
        soup.push([middle - along, middle + along, middle + wide]);
    }
    soup.mesh()
}

/// `n` parallel needles along the diagonal of the unit cube, all through its middle plane: any hierarchy of boxes must look at a
/// share of them that does not fall with `n`.
pub fn needles(n: u32) -> TriangleMesh {
    let n = n.min(MOST);
    let mut soup = Soup::new(n);
    for i in 0..n {
        let at = (f64::from(i) + 0.5) / f64::from(n.max(1)) - 0.5;
        let start = DVec3::new(at, -at, 0.0);
        let width = 0.1 / f64::from(n.max(1));
        soup.push([start, start + DVec3::ONE, start + DVec3::new(1.0 + width, 1.0 - width, 1.0)]);
    }
    soup.mesh()
}

/// `n x n` squares, each of two triangles, in the plane `z = 0`, on whole numbers from 0 to `n`: rays along the plane, and through its
/// points, are where structures fail. `n` is at most 5000.
pub fn grid(n: u32) -> TriangleMesh {
    let n = n.min(5000);
    let side = n + 1;
    let vertices = (0..side * side).map(|i| [(i % side) as f32, (i / side) as f32, 0.0]).collect();
    let corner = |i: u32| i / n * side + i % n;
    let triangles = (0..n * n)
        .map(corner)
        .flat_map(|a| [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]])
        .collect();
    mesh(vertices, triangles)
}

/// A closed tetrahedron about zero, of corners of the cube `[-1, 1]^3`.
pub fn tetrahedron() -> TriangleMesh {
    mesh(
        vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]],
        vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    )
}

/// The cube `[-1, 1]^3`, closed, two triangles a side.
pub fn cube() -> TriangleMesh {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let vertices = (0..8).map(|i| [sign(i, 0), sign(i, 1), sign(i, 2)]).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    mesh(vertices, sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// The unit sphere about zero as `20 * 4^level` triangles, closed. `level` is at most 10.
pub fn icosphere(level: u32) -> TriangleMesh {
    let (vertices, triangles) = sphere(level);
    mesh(vertices.iter().map(|v| v.as_vec3().to_array()).collect(), triangles)
}

/// An icosphere whose vertices are pulled out to distances from 1 to `most`, each by chance, evenly in the logarithm: closed, seen from
/// zero without overlap, and a bed of needles from anywhere else.
///
/// A `most` below 1 or not finite is taken for 1. `level` is at most 10.
pub fn crumpled(level: u32, most: f64, seed: u64) -> TriangleMesh {
    let most = if most.is_finite() { most.max(1.0) } else { 1.0 };
    let mut random = Random::new(seed);
    let (vertices, triangles) = sphere(level);
    let pulled = |v: DVec3| {
        // The power by halving: sqrt rounds the same everywhere, powf does not.
        let (mut factor, mut root) = (1.0, most);
        for _ in 0..24 {
            root = root.sqrt();
            if random.below(2) == 1 {
                factor *= root;
            }
        }
        (v * factor).as_vec3().to_array()
    };
    mesh(vertices.into_iter().map(pulled).collect(), triangles)
}

/// A torus about the z axis, of radius 1 from zero to the middle of the tube, and the tube's `thickness` as its radius; closed, of
/// `2 * around * tube` triangles.
///
/// `around` and `tube` are at least 3 and at most 5000 each; a `thickness` that is not in `(0, 1)` is taken for 0.25.
pub fn torus(around: u32, tube: u32, thickness: f64) -> TriangleMesh {
    let (around, tube) = (around.clamp(3, 5000), tube.clamp(3, 5000));
    let thickness = if thickness > 0.0 && thickness < 1.0 { thickness } else { 0.25 };
    let mut vertices = Vec::new();
    for i in 0..around {
        let (sin, cos) = turn(i.into(), around.into());
        for j in 0..tube {
            let (up, out) = turn(j.into(), tube.into());
            let radius = 1.0 + thickness * out;
            vertices.push([radius * cos, radius * sin, thickness * up].map(|x| x as f32));
        }
    }
    let at = |i: u32, j: u32| i % around * tube + j % tube;
    let quad = |i: u32, j: u32| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
    let triangles = (0..around)
        .flat_map(|i| (0..tube).map(move |j| quad(i, j)))
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    mesh(vertices, triangles)
}

/// The icosahedron, each side of its triangles halved `level` times, on the unit sphere.
fn sphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0f64.sqrt()) * 0.5;
    let mut vertices = Vec::new();
    for axis in 0..3 {
        for (one, long) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
            let mut v = DVec3::ZERO;
            v[axis] = one;
            v[(axis + 1) % 3] = long;
            vertices.push(v.normalize());
        }
    }
    // All trios of neighbours, which are 2 apart before they are scaled to the sphere.
    let near = 2.5 / (1.0 + golden * golden).sqrt();
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| vertices[i as usize]);
                if p.distance(q) < near && q.distance(r) < near && r.distance(p) < near {
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..level.min(10) {
        // Each edge is met twice, once in each direction; sorted, the two stand together and share a number.
        let mut edges: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)])
            .filter(|(from, to)| from < to)
            .collect();
        edges.sort_unstable();
        let first = vertices.len() as u32;
        for &(a, b) in &edges {
            vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
        }
        let middle = |a: u32, b: u32| {
            let edge = (a.min(b), a.max(b));
            first + edges.partition_point(|&other| other < edge) as u32
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (vertices, triangles)
}

/// Uniform in `[-1, 1)^3`.
fn cube_point(random: &mut Random) -> DVec3 {
    let (x, y, z) = (random.signed(), random.signed(), random.signed());
    DVec3::new(x, y, z)
}

/// How far the corners of one of `n` triangles reach: about the distance between neighbours. The cube root by powers of two, because
/// libraries' own differ by machine.
fn reach(n: u32) -> f64 {
    let mut cells = 1.0;
    while cells * cells * cells * 8.0 <= f64::from(n.max(1)) {
        cells *= 2.0;
    }
    0.5 / cells
}

/// Triangles that share no vertices.
pub(crate) struct Soup {
    vertices: Vec<[f32; 3]>,
}

impl Soup {
    pub(crate) fn new(triangles: u32) -> Soup {
        Soup { vertices: Vec::with_capacity(3 * triangles as usize) }
    }

    pub(crate) fn push(&mut self, corners: [DVec3; 3]) {
        self.vertices.extend(corners.map(|p| p.as_vec3().to_array()));
    }

    /// How many triangles there are.
    pub(crate) fn len(&self) -> usize {
        self.vertices.len() / 3
    }

    pub(crate) fn mesh(self) -> TriangleMesh {
        let n = self.vertices.len() as u32 / 3;
        mesh(self.vertices, (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts() {
        assert_eq!([0, 1, 2, 4].map(|level| icosphere(level).triangles().len()), [20, 80, 320, 5120]);
        assert_eq!(torus(7, 5, 0.2).triangles().len(), 70);
        assert_eq!(grid(3).triangles().len(), 18);
        assert_eq!(grid(0).triangles().len(), 0);
        assert_eq!(
            [uniform(0, 0), clusters(0, 0), sticks(0, 0.0, 0), needles(0)].map(|m| m.triangles().len()),
            [0; 4]
        );
    }

    #[test]
    fn sticks_are_thin_and_nothing_is_flat() {
        let sticks = sticks(200, 1e4, 3);
        for i in 0..200 {
            let [a, b, c] = sticks.triangle(i).corners;
            let aspect = a.distance_squared(b) / (b - a).cross(c - a).length();
            assert!((5e3..2e5).contains(&aspect), "{aspect}");
        }
        for mesh in [sticks, uniform(3000, 1), clusters(3000, 2), needles(1000), crumpled(3, 1000.0, 3)] {
            assert_eq!(mesh.degenerate(), 0);
        }
    }
}

//! Which way triangles turn, and whether they close.

use super::TriangleMesh;
use crate::triangle::power_of_two;
use rt_geom::Real;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::DVec3;
use std::collections::HashMap;

/// How the triangles of a mesh hang together. Edges are pairs of vertex numbers, the lesser first, in order.
///
/// Vertices with equal positions are one here, whatever their number, normal or texture: files repeat them. The least number
/// stands for all. Triangles with two equal corners are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Orientation {
    /// Edges of one triangle.
    pub boundary: Vec<[u32; 2]>,
    /// Edges along which two triangles run in the same direction, so that one has its inside where the other has its outside.
    pub clashing: Vec<[u32; 2]>,
    /// Edges of more than two triangles.
    pub crowded: Vec<[u32; 2]>,
    /// Triangles joined by edges, by the first of each.
    pub components: Vec<Component>,
    /// For each triangle the component it belongs to; `None` for those left out.
    pub component_of: Vec<Option<u32>>,
}

/// Triangles joined by edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// The lowest triangle number.
    pub first: u32,
    /// How many triangles there are.
    pub triangles: usize,
    /// Whether every edge has an even number of triangles.
    pub closed: bool,
    /// Whether every edge is run along as often in either direction, once more or less at a boundary.
    pub consistent: bool,
    /// The volume enclosed, negative if the triangles face inward; where closed and consistent. Infinite beyond the range.
    ///
    /// Error: one rounding, while the terms do not cancel to less than `2^-40` of the bounding cube.
    pub volume: Option<f64>,
    /// The sign of the volume, where rounding leaves no doubt.
    facing: Option<Facing>,
}

/// Which way a closed surface faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// Seen from outside, triangles run counter-clockwise.
    Outward,
    /// Seen from outside, triangles run clockwise.
    Inward,
}

impl Component {
    /// Which way it faces; `None` if it is open or inconsistent, or encloses nothing within rounding.
    pub fn facing(&self) -> Option<Facing> {
        self.facing
    }
}

/// A triangle's edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    edge: [u32; 2],
    triangle: u32,
    /// Whether the triangle runs from the lesser number to the greater.
    up: bool,
}

impl<V: Real> TriangleMesh<V> {
    /// How the triangles hang together: boundaries, clashes, components, volumes.
    ///
    /// ```
    /// use rt_shapes::{Facing, TriangleMesh};
    /// let corners = vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mut mesh = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 3, 2]])?;
    /// assert_eq!(mesh.orientation().clashing, [[1, 2], [1, 3], [2, 3]]);
    /// assert_eq!(mesh.orient(), 1);
    /// let whole = mesh.orientation().components[0];
    /// assert_eq!((whole.volume, whole.facing()), (Some(1.0 / 6.0), Some(Facing::Outward)));
    /// # Ok::<(), rt_shapes::MeshError>(())
    /// ```
    ///
    /// Cost: `O(n log n)`.
    pub fn orientation(&self) -> Orientation {
        let (corners, sides) = self.sides();
        let mut report = Orientation {
            boundary: Vec::new(),
            clashing: Vec::new(),
            crowded: Vec::new(),
            components: Vec::new(),
            component_of: Vec::new(),
        };
        let mut joined = Joined::new(corners.len());
        for group in sides.chunk_by(|x, y| x.edge == y.edge) {
            let list = match group {
                [_] => Some(&mut report.boundary),
                [x, y] if x.up == y.up => Some(&mut report.clashing),
                [_, _] => None,
                _ => Some(&mut report.crowded),
            };
            list.into_iter().for_each(|list| list.push(group[0].edge));
            group.windows(2).for_each(|w| joined.join(w[0].triangle, w[1].triangle));
        }
        let mut number: HashMap<u32, u32> = HashMap::new();
        for (triangle, corners) in (0..).zip(&corners) {
            let component = corners.map(|_| {
                let next = report.components.len() as u32;
                let found = *number.entry(joined.root(triangle)).or_insert(next);
                if found == next {
                    let (closed, consistent) = (true, true);
                    let (volume, facing) = (None, None);
                    report.components.push(Component {
                        first: triangle,
                        triangles: 0,
                        closed,
                        consistent,
                        volume,
                        facing,
                    });
                }
                report.components[found as usize].triangles += 1;
                found
            });
            report.component_of.push(component);
        }
        for group in sides.chunk_by(|x, y| x.edge == y.edge) {
            let up = group.iter().filter(|side| side.up).count();
            if let Some(found) = report.component_of[group[0].triangle as usize] {
                let component = &mut report.components[found as usize];
                component.closed &= group.len().is_multiple_of(2);
                component.consistent &= up.abs_diff(group.len() - up) <= 1;
            }
        }
        self.measure(&corners, &mut report);
        report
    }

    /// Turns triangles over until neighbours agree and each closed component faces outward of its own volume; says how many. Those of
    /// a one-sided surface, and across edges of more than two triangles, cannot agree: [`TriangleMesh::orientation`] names
    /// what is left.
    ///
    /// Vertex normals stay: where a mesh has such, they decide the side of a hit.
    pub fn orient(&mut self) -> usize {
        let (corners, sides) = self.sides();
        let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); corners.len()];
        for group in sides.chunk_by(|x, y| x.edge == y.edge) {
            if let [x, y] = group {
                neighbours[x.triangle as usize].push((y.triangle, x.up == y.up));
                neighbours[y.triangle as usize].push((x.triangle, x.up == y.up));
            }
        }
        let mut turned: Vec<Option<bool>> = vec![None; corners.len()];
        let mut reached = Vec::new();
        for first in 0..corners.len() as u32 {
            if turned[first as usize].is_none() {
                turned[first as usize] = Some(false);
                reached.push(first);
            }
            while let Some(triangle) = reached.pop() {
                let own = turned[triangle as usize] == Some(true);
                for &(other, clashes) in &neighbours[triangle as usize] {
                    if turned[other as usize].is_none() {
                        turned[other as usize] = Some(own != clashes);
                        reached.push(other);
                    }
                }
            }
        }
        let before = self.triangles.clone();
        self.turn_where(|triangle| turned[triangle] == Some(true));
        let report = self.orientation();
        let inward = |found: u32| report.components[found as usize].facing == Some(Facing::Inward);
        self.turn_where(|triangle| report.component_of[triangle].is_some_and(inward));
        self.triangles.iter().zip(&before).filter(|(now, then)| now != then).count()
    }

    /// Turns every triangle over, and vertex normals with them.
    pub fn flip(&mut self) {
        self.turn_where(|_| true);
        self.normals.iter_mut().for_each(|n| *n = n.map(|x| -x));
    }

    fn turn_where(&mut self, turned: impl Fn(usize) -> bool) {
        for (triangle, corners) in self.triangles.iter_mut().enumerate() {
            if turned(triangle) {
                corners.swap(1, 2);
            }
        }
    }

    /// The same mesh with vertices that are equal in position, normal and texture stored once: the first of each stays, and so does
    /// the order of triangles. Zeros of either sign are equal; what is not a number equals nothing.
    ///
    /// ```
    /// use rt_shapes::TriangleMesh;
    /// let soup = vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-0.0; 3], [0.0, -1.0, 0.0]];
    /// let mesh = TriangleMesh::new(soup, vec![[0, 1, 2], [3, 4, 5]])?.merged();
    /// assert_eq!((mesh.vertices().len(), mesh.triangles()), (4, &[[0, 1, 2], [1, 0, 3]][..]));
    /// # Ok::<(), rt_shapes::MeshError>(())
    /// ```
    pub fn merged(self) -> Self {
        let same = |v: usize| {
            let mut key: Vec<u64> = self.vertices[v].iter().map(|&x| bits(x.into())).collect();
            key.extend(self.normals.get(v).into_iter().flatten().map(|&x| bits(x.into())));
            key.extend(self.uvs.get(v).into_iter().flatten().map(|&x| bits(x.into())));
            key
        };
        let nan = |v: usize| same(v).iter().any(|&x| f64::from_bits(x).is_nan());
        let first = firsts(self.vertices.len(), same, nan);
        let mut renamed = vec![0; first.len()];
        let mut kept = Vec::new();
        for (v, &first) in first.iter().enumerate() {
            renamed[v] = if first as usize == v {
                kept.push(v);
                kept.len() as u32 - 1
            } else {
                renamed[first as usize]
            };
        }
        let pick = |v: &usize| *v;
        TriangleMesh {
            vertices: kept.iter().map(pick).map(|v| self.vertices[v]).collect(),
            triangles: self.triangles.iter().map(|t| t.map(|v| renamed[v as usize])).collect(),
            normals: kept.iter().filter_map(|&v| self.normals.get(v).copied()).collect(),
            uvs: kept.iter().filter_map(|&v| self.uvs.get(v).copied()).collect(),
        }
    }

    /// Triangles by the first vertices in the places of their corners, `None` where two are equal; and all their edges, in order.
    fn sides(&self) -> (Vec<Option<[u32; 3]>>, Vec<Side>) {
        let key = |v: usize| self.vertices[v].map(|x| bits(x.into()));
        let nan = |v: usize| self.vertices[v].iter().any(|&x| x.into().is_nan());
        let first = firsts(self.vertices.len(), key, nan);
        let distinct = |[a, b, c]: [u32; 3]| (a != b && b != c && c != a).then_some([a, b, c]);
        let corners: Vec<Option<[u32; 3]>> =
            self.triangles.iter().map(|t| distinct(t.map(|v| first[v as usize]))).collect();
        let of = |(triangle, corners): (u32, &Option<[u32; 3]>)| {
            let edges = (*corners).into_iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
            edges.map(move |[a, b]| Side { edge: [a.min(b), a.max(b)], triangle, up: a < b })
        };
        let mut sides: Vec<Side> = (0..).zip(&corners).flat_map(of).collect();
        sides.sort_unstable();
        (corners, sides)
    }

    /// Adds the volumes of closed components: six times that between each triangle and the component's first vertex.
    fn measure(&self, corners: &[Option<[u32; 3]>], report: &mut Orientation) {
        let place = |v: u32| super::widen(self.vertices[v as usize]);
        let count = report.components.len();
        let bounds: Vec<(DVec3, f64)> = {
            let of = |c: &Component| place(corners[c.first as usize].map_or(0, |t| t[0]));
            let mut bounds: Vec<(DVec3, f64)> = report.components.iter().map(|c| (of(c), 0.0)).collect();
            for (found, triangle) in report.component_of.iter().zip(corners) {
                if let (Some(found), Some(triangle)) = (found, triangle) {
                    let (origin, size) = &mut bounds[*found as usize];
                    // Halves, because differences may leave the range.
                    let far = |v: &u32| (place(*v) * 0.5 - *origin * 0.5).abs().max_element();
                    *size =
                        triangle.iter().map(far).fold(*size, |m, x| if x > m || x.is_nan() { x } else { m });
                }
            }
            bounds
        };
        let mut sums = vec![(DoubleDouble::from(0.0), 0.0f64); count];
        for (found, triangle) in report.component_of.iter().zip(corners) {
            let (Some(found), Some(triangle)) = (*found, triangle) else { continue };
            let (origin, size) = bounds[found as usize];
            let unit = power_of_two(size) * 0.5;
            let edge = |v: u32| {
                let p = place(v);
                [0, 1, 2].map(|i| DoubleDouble::difference(p[i] * 0.25 / unit, origin[i] * 0.25 / unit))
            };
            let [a, b, c] = triangle.map(edge);
            let (sum, terms) = &mut sums[found as usize];
            for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                let (x, y) = (a[i] * (b[j] * c[k]), a[i] * (b[k] * c[j]));
                *sum = *sum + (x - y);
                *terms += x.value().abs() + y.value().abs();
            }
        }
        for ((component, (sum, terms)), (_, size)) in report.components.iter_mut().zip(sums).zip(bounds) {
            let sum = sum.value();
            if component.closed && component.consistent && sum.is_finite() {
                let unit = power_of_two(size) * 2.0;
                component.volume = Some(sum / 6.0 * unit * unit * unit);
                // Each sum and product loses at most 2^-100 of the terms so far.
                let doubt = terms * component.triangles as f64 * (2f64).powi(-96);
                component.facing = match sum {
                    _ if sum.abs() <= doubt => None,
                    _ if sum > 0.0 => Some(Facing::Outward),
                    _ => Some(Facing::Inward),
                };
            }
        }
    }
}

/// The bits of a number, those of zero for minus zero.
fn bits(x: f64) -> u64 {
    (x + 0.0).to_bits()
}

/// For each of `count` things the first with the same key, itself for those that equal nothing.
fn firsts<K: Eq + core::hash::Hash>(
    count: usize,
    key: impl Fn(usize) -> K,
    alone: impl Fn(usize) -> bool,
) -> Vec<u32> {
    let mut seen = HashMap::with_capacity(count);
    let first = |v: usize| if alone(v) { v as u32 } else { *seen.entry(key(v)).or_insert(v as u32) };
    (0..count).map(first).collect()
}

/// Sets that grow together.
struct Joined(Vec<u32>);

impl Joined {
    fn new(count: usize) -> Joined {
        Joined((0..count as u32).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let above = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = above;
            i = above;
        }
        i
    }

    fn join(&mut self, i: u32, j: u32) {
        let (i, j) = (self.root(i), self.root(j));
        self.0[i.max(j) as usize] = i.min(j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of two triangles a side, at `corner`, of this size.
    fn cube(corner: [f64; 3], size: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let at = |i: u32| [0, 1, 2].map(|a: usize| corner[a] + if i >> a & 1 == 1 { size } else { 0.0 });
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        ((0..8).map(at).collect(), faces)
    }

    fn mesh((points, faces): (Vec<[f64; 3]>, Vec<[u32; 3]>)) -> TriangleMesh<f64> {
        TriangleMesh::new(points, faces).unwrap()
    }

    #[test]
    fn cubes_of_all_sizes_are_closed_and_face_outward() {
        for (corner, size) in [
            ([0.0; 3], 1.0),
            ([1e6, -3.0, 0.5], 0.25),
            ([0.0; 3], 2f64.powi(-200)),
            ([-1.0; 3], 2f64.powi(300)),
        ] {
            let mut cube = mesh(cube(corner, size));
            let report = cube.orientation();
            assert_eq!(report.boundary.len() + report.clashing.len() + report.crowded.len(), 0);
            let whole = report.components[0];
            assert_eq!((whole.triangles, whole.closed, whole.consistent), (12, true, true));
            assert_eq!((whole.volume, whole.facing()), (Some(size * size * size), Some(Facing::Outward)));
            cube.flip();
            let inside_out = cube.orientation().components[0];
            assert_eq!(
                (inside_out.volume, inside_out.facing()),
                (Some(-size * size * size), Some(Facing::Inward))
            );
            assert_eq!(cube.orient(), 12);
            assert_eq!(cube.orient(), 0);
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let (points, mut faces) = cube([0.0; 3], 1.0);
        faces[5].swap(0, 1);
        let mut turned = mesh((points.clone(), faces.clone()));
        let report = turned.orientation();
        assert_eq!((report.clashing.len(), report.boundary.len()), (3, 0));
        assert_eq!((report.components[0].closed, report.components[0].consistent), (true, false));
        assert_eq!(report.components[0].volume, None);
        assert_eq!(turned.orient(), 1);
        assert_eq!(turned.orientation().components[0].volume, Some(1.0));
        faces.remove(5);
        let open = mesh((points.clone(), faces.clone())).orientation();
        assert_eq!(
            (open.boundary.len(), open.components[0].closed, open.components[0].consistent),
            (3, false, true)
        );
        faces.push([0, 1, 0]);
        let report = mesh((points, faces)).orientation();
        assert_eq!((report.component_of[11], report.components[0].triangles), (None, 11));
    }

    #[test]
    fn a_soup_is_closed_where_positions_are_equal() {
        // Every triangle with corners of its own, two cubes: apart, and along a common edge.
        for (shift, components, crowded) in [(5.0, 2, 0), (1.0, 1, 1)] {
            let (mut points, mut faces) = (Vec::new(), Vec::new());
            for corner in [[0.0, 0.0, -0.0], [shift, shift, 0.0]] {
                let (p, f) = cube(corner, 1.0);
                for t in f {
                    let n = points.len() as u32;
                    points.extend(t.map(|v| p[v as usize]));
                    faces.push([n, n + 1, n + 2]);
                }
            }
            let soup = mesh((points, faces));
            let report = soup.orientation();
            assert_eq!((report.components.len(), report.crowded.len()), (components, crowded));
            assert!(report.components.iter().all(|c| c.facing() == Some(Facing::Outward)));
            let total: f64 = report.components.iter().filter_map(|c| c.volume).sum();
            assert_eq!(total, 2.0);
            let merged = soup.merged();
            assert_eq!(merged.vertices().len(), if shift == 5.0 { 16 } else { 14 });
            assert_eq!(merged.orientation().components.len(), components);
        }
    }

    #[test]
    fn a_strip_with_half_a_twist_has_one_side() {
        let n = 8u32;
        let points = (0..2 * n).map(|i| [i as f64, (i * i) as f64, (i % 3) as f64]).collect();
        let mut faces = Vec::new();
        for k in 0..n {
            let (a, b) = (2 * k, 2 * k + 1);
            let (c, d) = if k + 1 < n { (a + 2, b + 2) } else { (1, 0) };
            faces.extend([[a, c, b], [b, c, d]]);
        }
        let mut strip = mesh((points, faces));
        strip.orient();
        let report = strip.orientation();
        assert_eq!((report.clashing.len(), report.components[0].consistent), (1, false));
    }

    #[test]
    fn bad_numbers_do_no_harm() {
        for x in [f64::NAN, f64::INFINITY, f64::MAX] {
            let (mut points, faces) = cube([0.0; 3], 1.0);
            points[3][1] = x;
            let mut spoilt = mesh((points, faces));
            assert!(spoilt.orientation().components.iter().all(|c| x == f64::MAX || c.volume.is_none()));
            spoilt.orient();
            assert!(spoilt.area() > 0.0);
        }
        let pillow = mesh((vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2], [2, 1, 0]]));
        assert_eq!(pillow.orientation().components[0].facing(), None);
        assert_eq!(mesh((vec![], vec![])).orientation().components.len(), 0);
        // What merges keeps its attributes apart.
        let seam =
            mesh((vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]], vec![[0, 1, 2], [3, 2, 1]]));
        let seam = seam.with_uvs(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]).unwrap();
        assert_eq!(seam.merged().vertices().len(), 4);
    }
}

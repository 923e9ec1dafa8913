//! Areas, and points spread evenly by area.

use super::TriangleMesh;
use crate::surface::unit;
use crate::triangle::{exact_cross, power_of_two};
use crate::{Surface, Triangle};
use rt_geom::Real;
use rt_geom::expansion::{DoubleDouble, Expansion, two_sum};
use rt_geom::glam::{DVec2, DVec3};

const U: f64 = f64::EPSILON / 2.0;

/// The difference of two vectors: rounded, and what rounding lost.
fn difference(p: DVec3, q: DVec3) -> [(f64, f64); 3] {
    [0, 1, 2].map(|i| two_sum(p[i], -q[i]))
}

fn wide((hi, lo): (f64, f64), unit: f64) -> DoubleDouble {
    DoubleDouble::difference(hi / unit, -(lo / unit))
}

fn exact((hi, lo): (f64, f64), unit: f64) -> Expansion<2> {
    Expansion::difference(hi / unit, -(lo / unit))
}

impl Triangle {
    /// The area. NaN if a corner is not finite.
    ///
    /// Error: 0.51 units in the last place, needles included, while the nonzero components of the edges are within a factor of
    /// 1e120 of each other and the result is neither subnormal nor beyond the range.
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.corners;
        let edges = [difference(b, a), difference(c, a)];
        let size = edges.iter().flatten().fold(0.0f64, |m, e| m.max(e.0.abs()));
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return f64::NAN;
        }
        if size == f64::INFINITY {
            // Differences leave the range: a quarter of everything.
            return Triangle { corners: self.corners.map(|v| v * 0.25) }.area() * 16.0;
        }
        if size == 0.0 {
            return 0.0;
        }
        let unit = power_of_two(size);
        let [p, q] = edges.map(|edge| edge.map(|e| wide(e, unit)));
        let pairs = [(1, 2), (2, 0), (0, 1)];
        let terms = pairs.map(|(i, j)| (p[i] * q[j], p[j] * q[i]));
        let mut cross = terms.map(|(x, y)| x - y);
        // Twice the digits leave more than those of one f64, unless the terms cancel to a millionth of a millionth.
        let size = terms.iter().fold(0.0f64, |m, (x, y)| m.max(x.value().abs()).max(y.value().abs()));
        let left = cross.iter().fold(0.0f64, |m, x| m.max(x.value().abs()));
        if left < size * (2f64).powi(-40) {
            let [p, q] = edges.map(|edge| edge.map(|e| exact(e, unit)));
            cross = exact_cross(&p, &q).map(|x| x.rounded());
        }
        let left = cross.iter().fold(0.0f64, |m, x| m.max(x.value().abs()));
        if left == 0.0 {
            return 0.0;
        }
        // Squares of needles stay in range, too.
        let scale = power_of_two(left);
        let squares = cross.map(|x| {
            let x = x / DoubleDouble::from(scale);
            x * x
        });
        (squares[0] + squares[1] + squares[2]).sqrt().value() * (scale * 0.5) * unit * unit
    }

    /// Whether the triangle has no area: equal or collinear corners, decided exactly, for coordinates whose nonzero differences
    /// span at most `2^500` on each axis. False if a corner is not finite.
    pub fn is_degenerate(&self) -> bool {
        let [a, b, c] = self.corners;
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return false;
        }
        let (e1, e2) = (b - a, c - a);
        let (p, q) = (e1.abs(), e2.abs());
        let terms = DVec3::new(p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x);
        let cross = e1.cross(e2).abs();
        // Two roundings of differences, one of products, one of the sum; and nothing underflows.
        if (0..3).any(|i| cross[i] > 8.0 * U * terms[i] && cross[i] > 1e-280 && cross[i].is_finite()) {
            return false;
        }
        let mut edges = [difference(b, a), difference(c, a)];
        if edges.iter().flatten().any(|e| !e.0.is_finite()) {
            edges = [difference(b * 0.25, a * 0.25), difference(c * 0.25, a * 0.25)];
        }
        // A unit for each axis changes no zero.
        let unit = [0, 1, 2].map(|i| power_of_two(edges[0][i].0.abs().max(edges[1][i].0.abs())));
        let [p, q] = edges.map(|edge| [0, 1, 2].map(|i| exact(edge[i], unit[i])));
        exact_cross(&p, &q).iter().all(|x| x.sign() == 0)
    }
}

impl<V: Real> TriangleMesh<V> {
    /// How many triangles have no area: equal or collinear corners, decided exactly. No ray hits them.
    ///
    /// Cost: about 10 nanoseconds a triangle, some hundred for those in doubt.
    pub fn degenerate(&self) -> usize {
        (0..self.triangles.len() as u32).filter(|&prim| self.triangle(prim).is_degenerate()).count()
    }

    /// The area of all triangles, but those with a vertex that is not finite.
    ///
    /// Error: 0.51 units in the last place of each triangle's, and one rounding.
    ///
    /// ```
    /// use rt_geom::glam::{DVec2, DVec3};
    /// use rt_shapes::TriangleMesh;
    /// let corners = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
    /// let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3], [0, 1, 1]])?;
    /// assert_eq!((mesh.area(), mesh.degenerate()), (2.0, 1));
    /// let sampler = mesh.sampler().unwrap();
    /// let spot = sampler.sample(DVec2::new(0.75, 0.9));
    /// assert_eq!((spot.point, sampler.area()), (DVec3::new(0.25, 1.8, 0.0), 2.0));
    /// # Ok::<(), rt_shapes::MeshError>(())
    /// ```
    pub fn area(&self) -> f64 {
        let sum = self.areas().fold(DoubleDouble::from(0.0), |sum, area| sum + area.into()).value();
        // No term is negative or NaN, so that only infinities can have met.
        if sum.is_nan() { f64::INFINITY } else { sum }
    }

    fn areas(&self) -> impl Iterator<Item = f64> {
        let area = |prim| self.triangle(prim).area();
        (0..self.triangles.len() as u32).map(area).map(|area| if area.is_nan() { 0.0 } else { area })
    }

    /// What is needed to pick points evenly by area: 8 bytes a triangle. `None` for a mesh without area, or one whose area
    /// leaves the range of `f64`.
    pub fn sampler(&self) -> Option<MeshSampler<'_, V>> {
        let ends: Vec<f64> = ends(self.areas()).collect();
        let area = ends.last().copied()?;
        (area > 0.0 && area.is_finite()).then_some(MeshSampler { mesh: self, ends, area })
    }
}

/// Picks points of a mesh evenly by area.
#[derive(Clone, Debug)]
pub struct MeshSampler<'a, V: Real = f32> {
    mesh: &'a TriangleMesh<V>,
    /// For each triangle the area up to its end.
    ends: Vec<f64>,
    area: f64,
}

impl<V: Real> MeshSampler<'_, V> {
    /// The area of all triangles: points are picked at density `1 / area`.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`, as
    /// [`Quadric::sample`](crate::Quadric::sample). Numbers outside are moved to the nearest inside, NaN to 0.
    ///
    /// The first number picks the triangle, and what it leaves of its digits places the point there with the second: evenly spread
    /// numbers give evenly spread points. Triangles without area are never picked. Cost: `O(log n)`.
    ///
    /// Source: Heitz, "A low-distortion map between triangle and square" (2019).
    pub fn sample(&self, xi: DVec2) -> Surface {
        let (prim, weights) = self.place(xi);
        self.mesh.surface_at(prim, weights)
    }

    /// The triangle and the weights of its corners.
    fn place(&self, xi: DVec2) -> (u32, [f64; 3]) {
        pick(&self.ends, xi)
    }
}

/// The areas of triangles, summed up to the end of each.
pub(crate) fn ends(areas: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    areas.scan(DoubleDouble::from(0.0), |sum, area| {
        *sum = *sum + area.into();
        Some(sum.value())
    })
}

/// The triangle that two numbers pick by area, and the weights of its corners there. For each triangle the area up to its end; the
/// last is positive and finite.
pub(crate) fn pick(ends: &[f64], xi: DVec2) -> (u32, [f64; 3]) {
    let DVec2 { x: share, y } = unit(xi);
    let area = ends[ends.len() - 1];
    let reach = (share * area).min(area.next_down());
    let prim = ends.partition_point(|&end| end <= reach);
    let start = if prim == 0 { 0.0 } else { ends[prim - 1] };
    let x = (reach - start) / (ends[prim] - start);
    let (u, v) = if y > x { (x * 0.5, y - x * 0.5) } else { (x - y * 0.5, y * 0.5) };
    (prim as u32, [(1.0 - u) - v, u, v])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn triangle(v: [f64; 9]) -> Triangle {
        let corner = |i: usize| DVec3::new(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
        Triangle { corners: [0, 1, 2].map(corner) }
    }

    #[test]
    fn areas_of_known_triangles_at_any_size() {
        for exponent in [-480, -300, -149, -20, 0, 3, 120, 480] {
            let s = (2f64).powi(exponent);
            let right = triangle([0.0, 0.0, 0.0, 3.0 * s, 0.0, 0.0, 0.0, 4.0 * s, 0.0]);
            assert_eq!(right.area(), 6.0 * s * s, "{exponent}");
            assert!(!right.is_degenerate());
            // A needle far from the origin: an ulp wide.
            let needle =
                triangle([s, s, s, 2.0 * s, 2.0 * s, 2.0 * s, 3.0 * s, 3.0 * s, (3.0 * s).next_up()]);
            let ulp = (3.0 * s).next_up() - 3.0 * s;
            assert_eq!(needle.area(), s * ulp * 2f64.sqrt() * 0.5, "{exponent}");
            assert!(!needle.is_degenerate());
            let line = triangle([s, s, s, 2.0 * s, 2.0 * s, 2.0 * s, 3.0 * s, 3.0 * s, 3.0 * s]);
            assert_eq!((line.area(), line.is_degenerate()), (0.0, true));
        }
        let huge = triangle([-1e308, 0.0, 0.0, 1e308, 0.0, 0.0, 0.0, 1e-308, 0.0]);
        assert!(!huge.is_degenerate());
        let long = triangle([f64::MIN, 0.0, 0.0, f64::MAX, 0.0, 0.0, 0.0, 1e-300, 0.0]);
        assert!(!long.is_degenerate());
        let wide = triangle([f64::MIN, 0.0, 0.0, f64::MAX, 0.0, 0.0, 0.0, 1e250, 0.0]);
        assert_eq!((wide.area(), wide.is_degenerate()), (f64::INFINITY, false));
        let spoilt = triangle([f64::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        assert!(spoilt.area().is_nan() && !spoilt.is_degenerate());
    }

    #[test]
    fn no_area_is_never_picked_and_all_else_evenly() {
        let corners: Vec<[f64; 3]> =
            vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        let mesh =
            TriangleMesh::new(corners, vec![[0, 3, 1], [0, 1, 2], [0, 0, 1], [0, 1, 4], [0, 2, 4]]).unwrap();
        assert_eq!((mesh.degenerate(), mesh.area()), (3, 8.0));
        let sampler = mesh.sampler().unwrap();
        let mut counts = [0; 5];
        let mut mean = [DVec3::ZERO; 5];
        let n = 256;
        for k in 0..n * n {
            let at = |i: usize| (i % n) as f64 / n as f64 + 0.5 / n as f64;
            let xi = DVec2::new(at(k), at(k / n));
            let (prim, point) = (sampler.place(xi).0 as usize, sampler.sample(xi).point);
            assert!(point.cmpge(DVec3::ZERO).all());
            counts[prim] += 1;
            mean[prim] += point;
        }
        assert_eq!((counts, sampler.area()), ([0, n * n / 4, 0, n * n * 3 / 4, 0], 8.0));
        for (prim, centre) in
            [(1, DVec3::new(4.0 / 3.0, 1.0 / 3.0, 0.0)), (3, DVec3::new(4.0 / 3.0, 1.0, 0.0))]
        {
            // On the diagonal of the square the map has its fold: the mean of a grid is off by half a cell there.
            assert!((mean[prim] / counts[prim] as f64 - centre).length() < 8.0 / n as f64);
        }
        for xi in
            [DVec2::ONE, DVec2::NAN, DVec2::new(-3.0, 2.0), DVec2::new(f64::INFINITY, f64::NEG_INFINITY)]
        {
            let prim = sampler.place(xi).0;
            assert!(sampler.sample(xi).point.is_finite() && [1, 3].contains(&prim));
        }
        let flat = TriangleMesh::new(vec![[0.0f32; 3]; 3], vec![[0, 1, 2]]).unwrap();
        assert!(flat.sampler().is_none() && flat.area() == 0.0);
    }

    proptest! {
        #[test]
        fn integers_decide_the_same(v in prop::array::uniform9(-40..40i64), e in prop::array::uniform3(-250..250i32), far: i16) {
            // Small integers on three axes of any scale, shifted by a number that leaves no room for rounding.
            let cross = |i: usize, j: usize| {
                let (b, c) = ([v[3 + i] - v[i], v[3 + j] - v[j]], [v[6 + i] - v[i], v[6 + j] - v[j]]);
                b[0] * c[1] - b[1] * c[0]
            };
            let flat = [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| cross(i, j) == 0);
            let scaled = |k: usize| (v[k] + far as i64) as f64 * (2f64).powi(e[k % 3]);
            let t = triangle([0, 1, 2, 3, 4, 5, 6, 7, 8].map(scaled));
            prop_assert_eq!(t.is_degenerate(), flat);
            // Collinear in thirds and sevenths, which no f64 holds: exactly in line all the same.
            let line = |k: i64| (0..3).map(|i| (v[i] * k) as f64 * (2f64).powi(e[i])).collect::<Vec<f64>>();
            let all: Vec<f64> = [0, 3, 7].into_iter().flat_map(line).collect();
            prop_assert!(triangle(all.try_into().unwrap()).is_degenerate());
            // And never hit, not even through a corner.
            let in_line = |k: i64| DVec3::new((v[0] * k) as f64, (v[1] * k) as f64, (v[2] * k) as f64);
            let (none, o) = (Triangle { corners: [0, 3, 7].map(in_line) }, DVec3::new(9.0, -5.0, 3.0));
            for dir in [in_line(3) - o, in_line(5) - o, in_line(1), DVec3::X] {
                let ray = rt_geom::Ray::new(o, dir);
                prop_assert!(none.intersect(&ray).is_none() && none.cross(&ray).is_none());
            }
            // Without scales: the squared area is an integer over four.
            let t = triangle(v.map(|x| (x + far as i64) as f64));
            let square: i64 = [(0, 1), (1, 2), (2, 0)].iter().map(|&(i, j)| cross(i, j).pow(2)).sum();
            let area = (square as f64).sqrt() * 0.5;
            prop_assert!((t.area() - area).abs() <= area * f64::EPSILON);
        }
    }
}

//! [`Triangle`]: the exact test of a ray against a triangle.

use rt_geom::expansion::{DoubleDouble, Expansion, two_sum};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Ray, Real};

/// Unit roundoff of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// Beyond these sizes of a triangle or a direction, everything is scaled before it is computed: products of three factors, and
/// their errors, then neither under- nor overflow. No `f32` triangle and ray comes near them.
const SMALL: f64 = 1e-80;
const LARGE: f64 = 1e80;

/// Whether products of three such factors stay in range; false for NaN.
#[inline(always)]
fn moderate(size: f64, speed: f64) -> bool {
    size > SMALL && size < LARGE && speed > SMALL && speed < LARGE
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting<R: Real = f32> {
    /// The distance, in lengths of the ray's direction.
    pub t: R,
    /// The weight of the second corner, in `[0, 1]`.
    pub u: f64,
    /// The weight of the third corner, in `[0, 1]`; `u + v <= 1`.
    pub v: f64,
}

/// Three corners, in the widest precision; `f32` corners widen exactly.
///
/// The test works in three stages: rounded `f64` with an error bound settles almost all rays; then exact expansions settle
/// the sign of each edge volume the bound leaves open. The distance comes from `f64`, from double-double or from expansions,
/// whichever first is certain to round as the exact one does: `t` is the exact distance, correctly rounded.
///
/// ```
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::Triangle;
/// let small = Triangle { corners: [DVec3::ZERO, DVec3::X * 1e-15, DVec3::Y * 1e-15] };
/// let ray = Ray::new(Vec3A::new(0.0, 0.0, -1.0), Vec3A::Z); // at a corner
/// assert_eq!(small.intersect(&ray).unwrap().t, 1.0);
/// ```
///
/// Error: none in the decision, for corners and origins whose nonzero differences, and directions whose nonzero components,
/// span at most `2^300`; half a unit in the last place in `t`.
///
/// Source: edge volumes after Segura and Feito, "Algorithms to test ray-triangle intersection" (2001); filter and fallback
/// after Shewchuk 1997; the perturbation after Edelsbrunner and Mücke, "Simulation of simplicity" (1990).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// The corners.
    pub corners: [DVec3; 3],
}

/// What an edge met exactly means.
#[derive(Clone, Copy, PartialEq)]
enum Edges {
    /// It belongs to the triangle.
    Closed,
    /// It belongs to the triangle that the ray would cross if its origin moved by `(e, e^2, e^3)`, `e` positive and as small
    /// as one likes: to exactly one of two neighbours on either side.
    Perturbed,
}

impl Triangle {
    /// Where the ray meets the closed triangle, if `t` is in its interval.
    #[inline]
    pub fn intersect<R: Real>(&self, ray: &Ray<R>) -> Option<Meeting<R>> {
        self.meet(ray, Edges::Closed)
    }

    /// Where the ray crosses the triangle: as [`Triangle::intersect`], but an edge met exactly belongs to one of the two
    /// triangles that share it, and a vertex to as few triangles as make the number of crossings of a closed surface right.
    #[inline]
    pub fn cross<R: Real>(&self, ray: &Ray<R>) -> Option<Meeting<R>> {
        self.meet(ray, Edges::Perturbed)
    }

    #[inline(always)]
    fn meet<R: Real>(&self, ray: &Ray<R>, edges: Edges) -> Option<Meeting<R>> {
        let Ray { origin: o, dir: d, .. } = ray.widen();
        let [a, b, c] = self.corners.map(|v| v - o);
        // Six times the volumes spanned by the direction and each edge; their signs say on which side the ray passes.
        let volumes = [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))];
        let size = a.abs().max(b.abs()).max(c.abs()).max_element();
        // Differences, products and sums: at most 8 roundings of the 6 terms, each at most |d_i| size^2.
        let bound = 16.0 * U * d.abs().element_sum() * size * size;
        let moderate = moderate(size, d.abs().max_element());
        if moderate && volumes.iter().any(|&v| v > bound) && volumes.iter().any(|&v| v < -bound) {
            return None;
        }
        if moderate && volumes.iter().all(|v| v.abs() > bound) {
            return self.distance(o, d, ray, volumes);
        }
        self.settle(o, d, ray, volumes, bound, edges)
    }

    /// The decision where rounding leaves it open.
    #[cold]
    fn settle<R: Real>(
        &self,
        o: DVec3,
        d: DVec3,
        ray: &Ray<R>,
        volumes: [f64; 3],
        bound: f64,
        edges: Edges,
    ) -> Option<Meeting<R>> {
        if !(self.corners.iter().all(|v| v.is_finite()) && o.is_finite() && d.is_finite()) {
            return None;
        }
        let [a, b, c] = self.corners;
        let size = self.size_from(o);
        let speed = d.abs().max_element();
        if size == 0.0 || speed == 0.0 {
            return None;
        }
        if !moderate(size, speed) {
            return self.settle_scaled(o, d, ray, edges);
        }
        let pairs = [(b, c), (c, a), (a, b)];
        let mut exact = volumes;
        let mut signs = [0; 3];
        for i in 0..3 {
            let (p, q) = pairs[i];
            signs[i] = if volumes[i].abs() > bound {
                if volumes[i] > 0.0 { 1 } else { -1 }
            } else {
                let volume = edge_volume(o, d, p, q);
                exact[i] = volume.value();
                match (volume.sign(), edges) {
                    (0, Edges::Perturbed) => perturbed_sign(d, p, q),
                    (sign, _) => sign,
                }
            };
        }
        let (least, most) = (signs.into_iter().min()?, signs.into_iter().max()?);
        let met = match edges {
            Edges::Closed => least * most >= 0 && (least, most) != (0, 0),
            Edges::Perturbed => least * most > 0,
        };
        if !met {
            return None;
        }
        self.distance(o, d, ray, exact)
    }

    /// The largest component of the way from `o` to a corner; where that overflows, of a corner or of `o`.
    fn size_from(&self, o: DVec3) -> f64 {
        let size = self.corners.iter().fold(DVec3::ZERO, |m, &v| m.max((v - o).abs())).max_element();
        if size.is_finite() {
            size
        } else {
            self.corners.iter().fold(o.abs(), |m, v| m.max(v.abs())).max_element()
        }
    }

    /// [`Triangle::settle`] for sizes whose products leave the range of `f64`: the same triangle and ray, in other units.
    #[cold]
    fn settle_scaled<R: Real>(&self, o: DVec3, d: DVec3, ray: &Ray<R>, edges: Edges) -> Option<Meeting<R>> {
        let (unit, pace) = (power_of_two(self.size_from(o)), power_of_two(d.abs().max_element()));
        let near: f64 = ray.t_min.into();
        let scaled = Triangle { corners: self.corners.map(|v| v / unit) };
        let slow = Ray {
            origin: o / unit,
            dir: d / pace,
            t_min: if near == 0.0 { 0.0 } else { f64::NEG_INFINITY },
            t_max: f64::INFINITY,
        };
        let Ray { origin: o, dir: d, .. } = slow;
        let size = scaled.size_from(o);
        if !moderate(size, d.abs().max_element()) {
            return None;
        }
        let [a, b, c] = scaled.corners.map(|v| v - o);
        let volumes = [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))];
        let bound = 16.0 * U * d.abs().element_sum() * size * size;
        let met = scaled.settle(o, d, &slow, volumes, bound, edges)?;
        // In the order that stays in range.
        let t = met.t * unit;
        let t = if t.is_finite() { t / pace } else { met.t / pace * unit };
        Some(Meeting { t: ray.admit(t)?, u: met.u, v: met.v })
    }

    /// The distance to the plane, for a ray that meets the triangle with these edge volumes.
    #[inline(always)]
    fn distance<R: Real>(&self, o: DVec3, d: DVec3, ray: &Ray<R>, volumes: [f64; 3]) -> Option<Meeting<R>> {
        let [v0, v1, v2] = self.corners;
        let (a, e1, e2) = (v0 - o, v1 - v0, v2 - v0);
        let n = e1.cross(e2);
        let (above, along) = (n.dot(a), n.dot(d));
        // The same with absolute values: 8 roundings of these bound the errors.
        let (p1, p2) = (e1.abs(), e2.abs());
        let p = DVec3::new(p1.y * p2.z + p1.z * p2.y, p1.z * p2.x + p1.x * p2.z, p1.x * p2.y + p1.y * p2.x);
        let error = |value: f64, terms: f64| 9.0 * U * terms / value.abs();
        let relative = error(above, p.dot(a.abs())) + error(along, p.dot(d.abs()));
        let t = above / along;
        let near: f64 = ray.t_min.into();
        let slack = t.abs() * (relative + f64::EPSILON) * 2.0;
        // The error decides neither the near end nor the last place.
        let rounds = || R::nearest(t - slack) == R::nearest(t + slack);
        let t = if relative < R::ROOT_ERROR && (t - near).abs() > slack && rounds() {
            ray.admit(t)?
        } else {
            // Far outside the interval whatever the error: no need for more digits.
            if relative < 0.25 && (t + slack < near || t - slack > ray.t_max.reach()) {
                return None;
            }
            ray.admit(self.distance_wide::<R>(o, d, near)?.into())?
        };
        let sum = volumes[0] + volumes[1] + volumes[2];
        let u = (volumes[1] / sum).clamp(0.0, 1.0);
        let v = (volumes[2] / sum).clamp(0.0, 1.0 - u);
        Some(Meeting { t, u, v })
    }

    /// The distance, correctly rounded, with twice the digits, and with all of them where that is not enough; `None` if it is
    /// less than `near`.
    #[cold]
    fn distance_wide<R: Real>(&self, o: DVec3, d: DVec3, near: f64) -> Option<R> {
        let [v0, v1, v2] = self.corners;
        let minus = |p: DVec3, q: DVec3| [0, 1, 2].map(|i| DoubleDouble::difference(p[i], q[i]));
        let (a, e1, e2) = (minus(v0, o), minus(v1, v0), minus(v2, v0));
        let n = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| e1[i] * e2[j] - e1[j] * e2[i]);
        let above = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
        let along = n[0] * d.x.into() + n[1] * d.y.into() + n[2] * d.z.into();
        let size = |v: [DoubleDouble; 3]| DVec3::new(v[0].value(), v[1].value(), v[2].value()).abs();
        let (p1, p2, pa) = (size(e1), size(e2), size(a));
        let p = DVec3::new(p1.y * p2.z + p1.z * p2.y, p1.z * p2.x + p1.x * p2.z, p1.x * p2.y + p1.y * p2.x);
        // At most eight operations, each within 2^-102.
        let error = |value: f64, terms: f64| 128.0 * U * U * terms / value.abs();
        let relative = error(above.value(), p.dot(pa)) + error(along.value(), p.dot(d.abs()));
        let wide = above / along;
        let t = wide.value();
        let relative = relative + 256.0 * U * U;
        if relative < f64::ROOT_ERROR && (t - near).abs() > t.abs() * (2.0 * f64::EPSILON) {
            let slack = DoubleDouble::from(t.abs() * relative);
            let rounded = R::nearest_wide(wide - slack);
            if t < near {
                return None;
            }
            if rounded == R::nearest_wide(wide + slack) {
                return Some(rounded);
            }
        }
        self.distance_exact(o, d, near)
    }

    /// The distance from exact numbers, correctly rounded, and compared with `near` exactly: a ray may begin just where it hits.
    #[cold]
    fn distance_exact<R: Real>(&self, o: DVec3, d: DVec3, near: f64) -> Option<R> {
        let [v0, v1, v2] = self.corners;
        let (a, e1, e2) = (exact_minus(v0, o), exact_minus(v1, v0), exact_minus(v2, v0));
        let n = exact_cross(&e1, &e2);
        let product = |i: usize| -> Expansion<64> { n[i].times(&a[i]) };
        let above: Expansion<128> = product(0).plus(&product(1));
        let above: Expansion<192> = above.plus(&product(2));
        let along = exact_dot(&n, d);
        // The sign of the distance less `x + y`.
        let beyond = |x: f64, y: f64| {
            let (x, y): (Expansion<192>, Expansion<192>) = (along.scaled(x), along.scaled(y));
            let point: Expansion<384> = x.plus(&y);
            let rest: Expansion<576> = above.minus(&point);
            rest.sign() * along.sign()
        };
        let wide = above.rounded() / along.rounded();
        let t = wide.value();
        if (t - near).abs() > t.abs() * (2.0 * f64::EPSILON) {
            // An end far from `t`, or at infinity, needs no exact comparison.
            if t < near {
                return None;
            }
        } else if beyond(near, 0.0) < 0 {
            return None;
        }
        let rounded = R::nearest_wide(wide);
        let value: f64 = rounded.into();
        for next in [rounded.next_up(), rounded.next_down()] {
            let half = (next.into() - value) * 0.5;
            if half.is_finite() && half != 0.0 && value.is_finite() {
                let past = beyond(value, half) * if half > 0.0 { 1 } else { -1 };
                if past > 0 {
                    return Some(next);
                }
                if past == 0 {
                    return Some(R::nearest(value + half)); // the even one
                }
            }
        }
        Some(rounded)
    }
}

/// `2^k`, `k` the exponent of `x`, kept where it and its inverse are normal.
pub(crate) fn power_of_two(x: f64) -> f64 {
    let exponent = (x.to_bits() >> 52 & 0x7ff).clamp(30, 2000);
    f64::from_bits(exponent << 52)
}

fn exact_minus(p: DVec3, q: DVec3) -> [Expansion<2>; 3] {
    [0, 1, 2].map(|i| Expansion::difference(p[i], q[i]))
}

pub(crate) fn exact_cross(p: &[Expansion<2>; 3], q: &[Expansion<2>; 3]) -> [Expansion<16>; 3] {
    let minor = |i: usize, j: usize| -> Expansion<16> {
        let (left, right): (Expansion<8>, Expansion<8>) = (p[i].times(&q[j]), p[j].times(&q[i]));
        left.minus(&right)
    };
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

fn exact_dot(p: &[Expansion<16>; 3], d: DVec3) -> Expansion<96> {
    let term = |i: usize| -> Expansion<32> { p[i].scaled(d[i]) };
    let sum: Expansion<64> = term(0).plus(&term(1));
    sum.plus(&term(2))
}

/// `det [d, p - o, q - o]`, exactly.
#[cold]
fn edge_volume(o: DVec3, d: DVec3, p: DVec3, q: DVec3) -> Expansion<96> {
    let (a, b) = (p - o, q - o);
    // Differences that need no second component, as those of f32 seldom do, keep everything four times shorter.
    let exact = |v: DVec3, difference: DVec3| {
        (0..3).all(|i| two_sum(v[i], -o[i]).1 == 0.0 && difference[i].is_finite())
    };
    if exact(p, a) && exact(q, b) {
        let term = |i: usize, j: usize, k: usize| -> Expansion<8> {
            let left: Expansion<2> = Expansion::<1>::new(a[i]).scaled(b[j]);
            let right: Expansion<2> = Expansion::<1>::new(a[j]).scaled(b[i]);
            let minor: Expansion<4> = left.minus(&right);
            minor.scaled(d[k])
        };
        let sum: Expansion<16> = term(1, 2, 0).plus(&term(2, 0, 1));
        return sum.plus(&term(0, 1, 2));
    }
    exact_dot(&exact_cross(&exact_minus(p, o), &exact_minus(q, o)), d)
}

/// The sign that an edge volume of exactly zero takes when the origin moves by `(e, e^2, e^3)`: that of the first component of
/// `d x (q - p)` that is not zero.
#[cold]
fn perturbed_sign(d: DVec3, p: DVec3, q: DVec3) -> i32 {
    let e = exact_minus(q, p);
    for (i, j) in [(1, 2), (2, 0), (0, 1)] {
        let left: Expansion<4> = e[j].scaled(d[i]);
        let right: Expansion<4> = e[i].scaled(d[j]);
        let difference: Expansion<8> = left.minus(&right);
        if difference.sign() != 0 {
            return difference.sign();
        }
    }
    0
}

/// Möller and Trumbore's test in plain `f32`: the fast choice, which may err.
///
/// Error, on adversarial input against exact answers: some 31 000 hits missed per million that `f64` would find, 63 000 leaks
/// per million rays aimed at seams, and everything lost at scales below `1e-15`; on ordinary scenes about one decision in
/// `10^5`, all at edges. `t` is off by tens of units in the last place where the ray grazes.
///
/// Returns `t`, and the weights of the second and third corner.
///
/// Source: Möller and Trumbore, "Fast, minimum storage ray-triangle intersection", JGT 2(1) 1997.
#[inline]
pub fn moller_trumbore(ray: &Ray, [v0, v1, v2]: [Vec3A; 3]) -> Option<(f32, f32, f32)> {
    let (e1, e2) = (v1 - v0, v2 - v0);
    let p = ray.dir.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let s = ray.origin - v0;
    let u = s.dot(p) * inverse;
    let q = s.cross(e1);
    let v = ray.dir.dot(q) * inverse;
    let t = e2.dot(q) * inverse;
    // Written so that a NaN misses.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ray.contains(t)).then_some((t, u, v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn triangle(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> Triangle {
        Triangle { corners: [a, b, c].map(DVec3::from_array) }
    }

    #[test]
    fn corners_and_edges_belong_to_the_triangle() {
        for exponent in [-300, -60, 0, 50, 300] {
            let s = (2f64).powi(exponent);
            let t = triangle([0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0]);
            for (x, y, met) in [
                (0.0, 0.0, true),
                (1.0, 0.0, true),
                (0.0, 1.0, true),
                (0.5, 0.5, true),
                (0.25, 0.0, true),
                (0.25, 0.25, true),
                (-f64::EPSILON, 0.5, false),
                (0.5, 0.5 + f64::EPSILON, false),
            ] {
                for pace in [1e-30, 1.0, 1e30] {
                    let ray = Ray::new(DVec3::new(x * s, y * s, -s), DVec3::new(0.0, 0.0, pace));
                    let meeting = t.intersect(&ray);
                    assert_eq!(meeting.is_some(), met, "{x} {y} at 2^{exponent}");
                    if let Some(m) = meeting {
                        assert!((m.t * pace / s - 1.0).abs() < 4e-16, "{m:?}");
                        assert!((m.u - x).abs() < 1e-15 && (m.v - y).abs() < 1e-15);
                    }
                }
            }
        }
    }

    #[test]
    fn a_small_triangle_is_met_in_f32() {
        for exponent in -100..60 {
            let s = (2f32).powi(exponent) as f64;
            let t = triangle([0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0]);
            let ray = Ray::new(Vec3A::new(s as f32 / 3.0, s as f32 / 3.0, -1.0), Vec3A::Z);
            assert_eq!(t.intersect(&ray).map(|m| m.t), Some(1.0));
        }
    }

    #[test]
    fn no_area_no_hit() {
        let ray = Ray::new(Vec3A::new(0.0, 0.0, -1.0), Vec3A::Z);
        for t in [
            triangle([0.0; 3], [0.0; 3], [0.0; 3]),
            triangle([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]),
            triangle([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            triangle([0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]), // edge on
            triangle([f64::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            triangle([f64::INFINITY, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]),
        ] {
            assert_eq!(t.intersect(&ray), None, "{t:?}");
            assert_eq!(t.cross(&ray), None);
        }
        let t = triangle([-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!(t.intersect(&Ray { dir: Vec3A::ZERO, ..ray }), None);
        assert_eq!(t.intersect(&Ray { dir: Vec3A::NAN, ..ray }), None);
        assert_eq!(t.intersect(&Ray { origin: Vec3A::NAN, ..ray }), None);
    }

    #[test]
    fn intervals_are_closed() {
        let t = triangle([-1.0, -1.0, 3.0], [1.0, -1.0, 3.0], [0.0, 1.0, 3.0]);
        let ray = Ray::new(Vec3A::ZERO, Vec3A::Z);
        assert!(t.intersect(&ray.between(3.0, 3.0)).is_some());
        assert!(t.intersect(&ray.between(0.0, 3.0f32.next_down())).is_none());
        assert!(t.intersect(&ray.between(3.0f32.next_up(), 9.0)).is_none());
        assert_eq!(
            t.intersect(&Ray::new(Vec3A::ZERO, -Vec3A::Z).between(-9.0, 0.0)).map(|m| m.t),
            Some(-3.0)
        );
    }

    #[test]
    fn a_ray_may_begin_where_it_hits() {
        let t = triangle(
            [-895092.0, -1297893.0, 371957.0],
            [1124488.0, -1097414.0, 329892.0],
            [225464.0, -1829161.0, -1161905.0],
        );
        let ray =
            Ray::new(Vec3A::new(642033.0, -720754.0, -249796.0), Vec3A::new(-163471.0, -229134.0, 32148.0));
        for (t_min, t_max, met) in [
            (0.0, 9.0, true),
            (3.0, 3.0, true),
            (3.0, 9.0, true),
            (0.0, 3.0, true),
            (3.0f32.next_up(), 9.0, false),
            (0.0, 3.0f32.next_down(), false),
        ] {
            assert_eq!(
                t.intersect(&ray.between(t_min, t_max)).map(|m| m.t),
                met.then_some(3.0),
                "{t_min} {t_max}"
            );
        }
    }

    #[test]
    fn sizes_and_speeds_beyond_any_product_are_met() {
        for size in [1e-300, 1e-165, 1e-120, 1e-90, 1.0, 1e104, 1e130, 1e160, 1e300] {
            for speed in [1e-250, 1e-150, 1e-60, 1.0, 1e100, 1e150, 1e250] {
                let t = triangle([-size, -size, size], [size, -size, size], [0.0, size, size]);
                let ray = Ray::new(DVec3::new(size * 0.1, size * 0.1, 0.0), DVec3::Z * speed);
                let (exact, met) = (size / speed, t.intersect(&ray));
                assert!(met.is_some(), "{size:e} {speed:e}");
                if exact.is_normal() {
                    assert!((met.unwrap().t / exact - 1.0).abs() < 1e-15, "{size:e} {speed:e} {met:?}");
                }
                let beside = Ray { origin: DVec3::new(size * 1.1, 0.0, 0.0), ..ray };
                assert_eq!(t.intersect(&beside), None);
            }
        }
    }

    /// Around a vertex and along the edges of a fan, a perturbed ray crosses exactly one triangle.
    #[test]
    fn a_fan_is_crossed_once() {
        let directions =
            [(3.0, 1.0), (1.0, 2.0), (-1.0, 3.0), (-2.0, 0.0), (-1.0, -2.0), (0.0, -3.0), (2.0, -1.0)];
        let rim = directions.map(|(x, y): (f64, f64)| [x, y, 0.25 * x - y]);
        let fan: Vec<Triangle> = (0..7).map(|i| triangle([0.0; 3], rim[i], rim[(i + 1) % 7])).collect();
        for k in 0..7 {
            for w in [0.0, 0.5, 0.25] {
                let p = DVec3::from_array(rim[k]) * w;
                let ray = Ray::new(p - DVec3::new(1.0, 0.5, 4.0), DVec3::new(1.0, 0.5, 4.0));
                assert_eq!(fan.iter().filter(|t| t.cross(&ray).is_some()).count(), 1);
                let closed = fan.iter().filter(|t| t.intersect(&ray).is_some()).count();
                assert_eq!(closed, if w == 0.0 { 7 } else { 2 });
            }
        }
    }

    proptest! {
        #[test]
        fn all_stages_agree_on_the_distance(v in prop::array::uniform9(-1.0..1.0f64), o in prop::array::uniform3(-4.0..4.0f64),
                                            w in (0.0..1.0f64, 0.0..1.0f64)) {
            let t = triangle([v[0], v[1], v[2]], [v[3], v[4], v[5]], [v[6], v[7], v[8]]);
            let (u, w) = if w.0 + w.1 > 1.0 { (1.0 - w.0, 1.0 - w.1) } else { w };
            let [a, b, c] = t.corners;
            let o = DVec3::from_array(o);
            let d = a + (b - a) * u + (c - a) * w - o;
            if let Some(m) = t.intersect(&Ray::new(o, d)) {
                let exact: f64 = t.distance_exact(o, d, 0.0).unwrap();
                prop_assert_eq!(m.t, exact);
                prop_assert_eq!(t.distance_wide::<f64>(o, d, 0.0).unwrap(), exact);
                let narrow = Ray::new(o, d).between(0.0, f64::INFINITY);
                let single: Option<f32> = t.distance_exact(narrow.origin, narrow.dir, 0.0);
                prop_assert_eq!(t.distance_wide::<f32>(o, d, 0.0), single);
                prop_assert!(m.u >= 0.0 && m.v >= 0.0 && m.u + m.v <= 1.0);
            }
        }
    }
}

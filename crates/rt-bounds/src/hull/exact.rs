//! Exact signs: on which side of a plane or a line a point lies.
//!
//! A filter in `f64` settles nearly all, one with twice the digits nearly all of the rest, and expansions what is left.
//! Coordinates are multiples of `2^-340` up to `2^300` (the hull scales them), so no product of three differences overflows or
//! underflows.

use core::cell::OnceCell;
use rt_geom::Axis;
use rt_geom::expansion::{DoubleDouble, Expansion};
use rt_geom::glam::DVec3;

/// The oriented plane through three points: its normal is `(b - a) x (c - a)`.
#[derive(Debug)]
pub(super) struct Plane {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    normal: DVec3,
    /// What a computed distance, times the length of the normal, may be wrong by.
    bound: f64,
    /// The normal with twice the digits, and exactly, once they were asked for.
    finer: OnceCell<[DoubleDouble; 3]>,
    exact: OnceCell<Box<[Expansion<16>; 3]>>,
}

impl Plane {
    /// `reach` is no less than any coordinate of any point's distance from `a`.
    pub(super) fn new(a: DVec3, b: DVec3, c: DVec3, reach: DVec3) -> Plane {
        let (u, v) = (b - a, c - a);
        let size = DVec3::new(
            (u.y * v.z).abs() + (u.z * v.y).abs(),
            (u.z * v.x).abs() + (u.x * v.z).abs(),
            (u.x * v.y).abs() + (u.y * v.x).abs(),
        );
        // Eight roundings on the way to a product of three rounded differences; twice that, for the bound's own.
        let bound = size.dot(reach) * (8.0 * f64::EPSILON);
        Plane { a, b, c, normal: u.cross(v), bound, finer: OnceCell::new(), exact: OnceCell::new() }
    }

    /// 1 on the side of the normal, 0 on the plane, -1 below it.
    #[inline(always)]
    pub(super) fn side(&self, p: DVec3) -> i32 {
        let distance = self.normal.dot(p - self.a);
        if distance > self.bound {
            1
        } else if distance < -self.bound {
            -1
        } else {
            self.side_finely(p)
        }
    }

    /// With twice the digits of `f64`. Each operation is wrong by at most `2^-102` of its terms: two on the way to a component
    /// of the normal and three on to the distance make `5 * 2^-102` where `bound` is `2^-49`. Four times that is allowed.
    #[inline(never)]
    fn side_finely(&self, p: DVec3) -> i32 {
        let normal = self.finer.get_or_init(|| {
            let w = |p: DVec3, i: usize| DoubleDouble::difference(p[i], self.a[i]);
            let minor = |i, j| w(self.b, i) * w(self.c, j) - w(self.b, j) * w(self.c, i);
            [minor(1, 2), minor(2, 0), minor(0, 1)]
        });
        let term = |i: usize| normal[i] * DoubleDouble::difference(p[i], self.a[i]);
        let distance = (term(0) + term(1) + term(2)).value();
        if distance.abs() > self.bound * (1.0 / (1u64 << 48) as f64) {
            if distance > 0.0 { 1 } else { -1 }
        } else {
            self.side_exactly(p)
        }
    }

    /// Whether the point is below the plane beyond doubt.
    #[inline(always)]
    pub(super) fn is_clearly_below(&self, p: DVec3) -> bool {
        self.normal.dot(p - self.a) < -self.bound
    }

    #[cold]
    #[inline(never)]
    fn side_exactly(&self, p: DVec3) -> i32 {
        let w = |i: usize| Expansion::<2>::difference(p[i], self.a[i]);
        let [x, y, z] = &**self.exact.get_or_init(|| Box::new(cross(self.a, self.b, self.c)));
        let xy: Expansion<128> = x.times::<2, 64>(&w(0)).plus(&y.times::<2, 64>(&w(1)));
        let sum: Expansion<192> = xy.plus(&z.times::<2, 64>(&w(2)));
        sum.sign()
    }
}

/// Points in coordinates that tell those near one plane apart: two coordinates as they are, and instead of the third the height
/// above a plane, with twice the digits.
///
/// The points of a turned disc lie within roundings of a plane, so in their own coordinates every decision among them is too
/// close for `f64`. Seen as heights the roundings are all there is, and `f64` tells them well. A shear keeps the sign of a volume.
#[derive(Debug)]
pub(super) struct Sheared {
    /// Two coordinates and the height.
    at: Vec<DVec3>,
    /// What the height is more than that.
    rest: Vec<f64>,
    reach: DVec3,
    /// What the difference of two heights may be wrong by, besides its relative error.
    wrong: f64,
}

/// The plane through three sheared points.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShearedPlane {
    a: DVec3,
    rest: f64,
    normal: DVec3,
    bound: f64,
}

impl Sheared {
    /// The points, at least one, seen along a plane with about that normal.
    pub(super) fn new(at: &[DVec3], normal: DVec3) -> Sheared {
        // Heights are multiples of 2^-390: no product with two differences underflows. Any normal will do, as long as it is
        // the same for all.
        const STEPS: f64 = (1u64 << 50) as f64;
        let axis = Axis::longest_f64(normal.abs()).index();
        let n = normal * (STEPS / normal[axis]);
        let n = n.to_array().map(|x| x.round() / STEPS);
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let (mut sheared, mut rest, mut size) =
            (Vec::with_capacity(at.len()), Vec::with_capacity(at.len()), 0.0f64);
        let n_abs = DVec3::from_array(n).abs();
        for p in at {
            let term = |a: usize| DoubleDouble::from(n[a]) * DoubleDouble::difference(p[a], at[0][a]);
            let height = term(0) + term(1) + term(2);
            let high = height.value();
            sheared.push(DVec3::new(p[i], p[j], high));
            rest.push((height - DoubleDouble::from(high)).value());
            size = size.max(n_abs.dot((*p - at[0]).abs()));
        }
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in &sheared {
            (min, max) = (min.min(*p), max.max(*p));
        }
        // A height is wrong by three times `2^-102` of `size`, its rest's difference by `2^-104`: for two of them, less than
        // `2^-99`. Twice that.
        let wrong = size * (1.0 / (1u128 << 98) as f64);
        Sheared { at: sheared, rest, reach: max - min, wrong }
    }

    /// The plane through three of the points.
    pub(super) fn plane(&self, a: u32, b: u32, c: u32) -> ShearedPlane {
        let at = |i: u32| (self.at[i as usize], self.rest[i as usize]);
        let (a, rest) = at(a);
        let [u, v] = [at(b), at(c)].map(|(p, r)| DVec3::new(p.x - a.x, p.y - a.y, (p.z - a.z) + (r - rest)));
        let size = DVec3::new(
            (u.y * v.z).abs() + (u.z * v.y).abs(),
            (u.z * v.x).abs() + (u.x * v.z).abs(),
            (u.x * v.y).abs() + (u.y * v.x).abs(),
        );
        // Nine roundings for a product, one height in each being the sum of two differences; nearly twice that. And what the
        // heights are wrong by, times what each is multiplied with; twice that too.
        let beside = size.z + (u.y.abs() + v.y.abs()) * self.reach.x + (u.x.abs() + v.x.abs()) * self.reach.y;
        let bound = size.dot(self.reach) * (8.0 * f64::EPSILON) + beside * (2.0 * self.wrong);
        ShearedPlane { a, rest, normal: u.cross(v), bound }
    }

    /// The points, for [`ShearedPlane::side`].
    pub(super) fn points(&self) -> impl Iterator<Item = (&DVec3, &f64)> {
        self.at.iter().zip(&self.rest)
    }
}

impl ShearedPlane {
    /// 1 on the side of the normal, -1 below it, 0 where that is too close to tell.
    #[inline(always)]
    pub(super) fn side(&self, p: &DVec3, rest: &f64) -> i32 {
        let w = DVec3::new(p.x - self.a.x, p.y - self.a.y, (p.z - self.a.z) + (rest - self.rest));
        let distance = self.normal.dot(w);
        if distance < -self.bound { -1 } else { i32::from(distance > self.bound) }
    }
}

/// `(b - a) x (c - a)`, exactly.
fn cross(a: DVec3, b: DVec3, c: DVec3) -> [Expansion<16>; 3] {
    [minor(a, b, c, 1, 2), minor(a, b, c, 2, 0), minor(a, b, c, 0, 1)]
}

fn minor(a: DVec3, b: DVec3, c: DVec3, i: usize, j: usize) -> Expansion<16> {
    let difference = |p: DVec3, axis: usize| Expansion::<2>::difference(p[axis], a[axis]);
    let left: Expansion<8> = difference(b, i).times(&difference(c, j));
    let right: Expansion<8> = difference(b, j).times(&difference(c, i));
    left.minus(&right)
}

/// `(b - a) x (c - a)`, each component rounded once or so; zero only where it is.
pub(super) fn normal(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    let [x, y, z] = cross(a, b, c);
    DVec3::new(x.value(), y.value(), z.value())
}

/// The turn from `a` through `b` to `c` seen in the coordinates `i` and `j`: 1 counter-clockwise, 0 straight, -1 clockwise.
#[inline]
pub(super) fn turn(a: DVec3, b: DVec3, c: DVec3, i: usize, j: usize) -> i32 {
    let (left, right) = ((b[i] - a[i]) * (c[j] - a[j]), (b[j] - a[j]) * (c[i] - a[i]));
    let bound = (left.abs() + right.abs()) * (4.0 * f64::EPSILON);
    if left - right > bound {
        1
    } else if right - left > bound {
        -1
    } else {
        minor(a, b, c, i, j).sign()
    }
}

/// Whether three points lie on a line, or coincide.
pub(super) fn collinear(a: DVec3, b: DVec3, c: DVec3) -> bool {
    turn(a, b, c, 0, 1) == 0 && turn(a, b, c, 1, 2) == 0 && turn(a, b, c, 2, 0) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points of small integers times powers of two far apart: exact in `i128` where the powers are equal.
    fn point(v: [i32; 3], scale: f64) -> DVec3 {
        DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64) * scale
    }

    fn volume(p: [[i32; 3]; 4]) -> i128 {
        let w = |k: usize, a: usize| p[k][a] as i128 - p[0][a] as i128;
        let m = |i, j| w(1, i) * w(2, j) - w(1, j) * w(2, i);
        m(1, 2) * w(3, 0) + m(2, 0) * w(3, 1) + m(0, 1) * w(3, 2)
    }

    proptest! {
        #[test]
        fn sides_are_exact(p in prop::array::uniform4(prop::array::uniform3(any::<i32>())), shift in -150i32..=130,
                           flat: bool) {
            let mut p = p;
            if flat {
                for q in &mut p {
                    q[2] = (q[0] >> 1) - (q[1] >> 2);
                    q[0] &= !1;
                    q[1] &= !3;
                }
            }
            let scale = 2f64.powi(shift);
            let [a, b, c, v] = p.map(|v| point(v, scale));
            let reach = (v - a).abs();
            prop_assert_eq!(Plane::new(a, b, c, reach).side(v) as i128, volume(p).signum());
        }
    }

    proptest! {
        #[test]
        fn seen_along_a_plane_no_side_is_wrong(p in prop::array::uniform4(prop::array::uniform3(any::<i32>())),
                                               noise in prop::array::uniform4(-3i32..=3), shift in -150i32..=130,
                                               along in prop::array::uniform3(-1.0f64..1.0), near: bool) {
            let mut p = p;
            for (q, step) in p.iter_mut().zip(noise) {
                q[2] = (q[0] >> 1) - (q[1] >> 2) + step;
            }
            let at = p.map(|v| point(v, 2f64.powi(shift)));
            let normal = if near { DVec3::new(-0.5, 0.25, 1.0) } else { DVec3::from_array(along) };
            prop_assume!(normal != DVec3::ZERO);
            let sheared = Sheared::new(&at, normal);
            let side = sheared.plane(0, 1, 2).side(&sheared.at[3], &sheared.rest[3]) as i128;
            prop_assert!(side == 0 || side == volume(p).signum());
        }
    }

    /// Heights of some roundings, told by `f64` alone.
    #[test]
    fn seen_along_a_plane_roundings_are_told() {
        let turned = |x: f64, y: f64| DVec3::new(0.6 * x, y, 0.8 * x + 0.3 * y);
        let at: Vec<DVec3> = (0..200).map(|i| turned((i as f64).cos(), (i as f64).sin())).collect();
        let sheared = Sheared::new(&at, normal(at[0], at[2], at[4]));
        let (plane, filter) = (Plane::new(at[0], at[2], at[4], DVec3::splat(2.0)), sheared.plane(0, 2, 4));
        let told = |i: &usize| filter.side(&sheared.at[*i], &sheared.rest[*i]) != 0;
        let others = || (5..200).filter(|i| plane.side_exactly(at[*i]) != 0);
        assert!(others().all(|i| {
            let side = filter.side(&sheared.at[i], &sheared.rest[i]);
            side == 0 || side == plane.side_exactly(at[i])
        }));
        assert!(others().filter(told).count() * 10 > others().count() * 9 && others().count() > 100);
    }

    #[test]
    fn a_point_one_step_off_a_plane() {
        let (a, b, c) = (DVec3::splat(0.1), DVec3::new(0.7, 0.1, 0.1), DVec3::new(0.1, 0.9, 0.1));
        let plane = Plane::new(a, b, c, DVec3::splat(1e10));
        for x in [0.3, -1e9, 1e9] {
            let at = |z| plane.side(DVec3::new(x, 0.2, z));
            assert_eq!((at(0.1), at(0.1f64.next_up()), at(0.1f64.next_down())), (0, 1, -1));
        }
        assert!(collinear(DVec3::ZERO, DVec3::new(1.0, 3.0, -0.5), DVec3::new(1e9, 3e9, -0.5e9)));
        assert!(!collinear(
            DVec3::ZERO,
            DVec3::new(1.0, 3.0, -0.5),
            DVec3::new(1e9, 3e9, -0.5e9f64.next_up())
        ));
    }
}

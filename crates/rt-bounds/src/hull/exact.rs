//! Exact signs: on which side of a plane or a line a point lies.
//!
//! A filter in `f64` settles nearly all; the rest is decided by expansions. Coordinates are multiples of `2^-340` up to `2^300`
//! (the hull scales them), so no product of three differences overflows or underflows.

use rt_geom::expansion::Expansion;
use rt_geom::glam::DVec3;

/// The oriented plane through three points: its normal is `(b - a) x (c - a)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    normal: DVec3,
    /// What a computed distance, times the length of the normal, may be wrong by.
    bound: f64,
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
        Plane { a, b, c, normal: u.cross(v), bound: size.dot(reach) * (8.0 * f64::EPSILON) }
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
        let [x, y, z] = cross(self.a, self.b, self.c);
        let xy: Expansion<128> = x.times::<2, 64>(&w(0)).plus(&y.times::<2, 64>(&w(1)));
        let sum: Expansion<192> = xy.plus(&z.times::<2, 64>(&w(2)));
        sum.sign()
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

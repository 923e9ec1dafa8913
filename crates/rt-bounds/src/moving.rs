//! Boxes around moving boxes: [`Aabb::moving`].

use crate::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Motion, Path};

impl Aabb {
    /// A box around everything that `motion` carries this one through between two times, in `[0, 1]` (what is beyond is
    /// cut off, NaN opens that end), given relative to `origin` and rounded outward, and grown as by
    /// [`Aabb::transformed`].
    ///
    /// Neither a sample of times nor the boxes at both ends are enough: a turning corner swings out between them. Each
    /// coordinate of each corner is a known function of time, and its extremes are enclosed by interval Newton steps.
    /// All of space where a corner leaves the range of `f64` on the way. The box fits the curves within `2^-34` of their size, and so within the rounding to `f32`.
    ///
    /// Cost: some tens of microseconds where there is rotation.
    ///
    /// Source: Pharr, Jakob, Humphreys, *Physically Based Rendering*, 3rd ed. (2016), section 2.9.4; Moore, *Interval
    /// Analysis* (1966).
    ///
    /// ```
    /// use rt_bounds::Aabb;
    /// use rt_geom::{Motion, Transform, glam::{DVec3, Vec3A}};
    /// let turn = Transform::rotation(DVec3::Z, std::f64::consts::FRAC_PI_2).unwrap();
    /// let motion = Motion::new(Transform::IDENTITY, turn).unwrap();
    /// let point = Aabb::new(Vec3A::new(1.0, 1.0, 0.0), Vec3A::new(1.0, 1.0, 0.0));
    /// let swept = point.moving(&motion, [0.0, 1.0], DVec3::ZERO);
    /// assert!((swept.max.y - 2f32.sqrt()).abs() < 1e-6);
    /// ```
    pub fn moving(self, motion: &Motion, times: [f64; 2], origin: DVec3) -> Aabb {
        if !self.is_valid() {
            return self;
        }
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        if !(min.is_finite() && max.is_finite()) {
            return Aabb::INFINITE;
        }
        let first = if times[0] >= 0.0 { times[0].min(1.0) } else { 0.0 };
        let last = if times[1] <= 1.0 { times[1].max(first) } else { 1.0 };
        let (mut lo, mut hi, mut known) = (DVec3::INFINITY, DVec3::NEG_INFINITY, true);
        for corner in 0..8 {
            let p = DVec3::select(
                rt_geom::glam::BVec3::new(corner & 1 != 0, corner & 2 != 0, corner & 4 != 0),
                max,
                min,
            );
            let path = motion.path(p);
            // The rounding of the curve, of the map, and of a ray carried back through it: 48 times `|A| |A^-1|`, or more.
            let pad = path.size * (motion.condition() * 4.0 * f64::EPSILON).min(1.0);
            for a in 0..3 {
                let [least, most] = Curve::new(&path, a).extremes(first, last);
                let (least, most) = (least - pad[a], most + pad[a]);
                // A minimum passes over NaN.
                known &= least <= most;
                (lo[a], hi[a]) = (lo[a].min(least), hi[a].max(most));
            }
        }
        if known { Aabb::from_f64(lo, hi, origin) } else { Aabb::INFINITE }
    }
}

/// `fixed + linear t + (p0 + p1 t) cos(w t) + (q0 + q1 t) sin(w t)`, for `w` in `[0, pi]`.
#[derive(Clone, Copy)]
struct Curve {
    fixed: f64,
    linear: f64,
    p: [f64; 2],
    q: [f64; 2],
    w: f64,
}

/// A closed interval. Its ends carry the rounding of what made them: the caller pads.
#[derive(Clone, Copy)]
struct Interval(f64, f64);

impl Interval {
    fn plus(self, b: Interval) -> Interval {
        Interval(self.0 + b.0, self.1 + b.1)
    }
    fn times(self, b: Interval) -> Interval {
        let [x, y, z, w] = [self.0 * b.0, self.0 * b.1, self.1 * b.0, self.1 * b.1];
        Interval(x.min(y).min(z.min(w)), x.max(y).max(z.max(w)))
    }
    fn holds(self, x: f64) -> bool {
        self.0 <= x && x <= self.1
    }
    fn size(self) -> f64 {
        self.0.abs().max(self.1.abs())
    }
}

impl Curve {
    fn new(path: &Path, axis: usize) -> Curve {
        Curve {
            fixed: path.fixed[axis],
            linear: path.linear[axis],
            p: path.cos.map(|v| v[axis]),
            q: path.sin.map(|v| v[axis]),
            w: path.angle,
        }
    }

    fn at(&self, t: f64) -> f64 {
        let (sin, cos) = (self.w * t).sin_cos();
        self.fixed + self.linear * t + (self.p[0] + self.p[1] * t) * cos + (self.q[0] + self.q[1] * t) * sin
    }

    fn derivative(&self) -> Curve {
        let ([p0, p1], [q0, q1], w) = (self.p, self.q, self.w);
        Curve { fixed: self.linear, linear: 0.0, p: [p1 + w * q0, w * q1], q: [q1 - w * p0, -w * p1], w }
    }

    /// The sum of the sizes of the terms, for times in `[0, 1]`.
    fn size(&self) -> f64 {
        [self.fixed, self.linear, self.p[0], self.p[1], self.q[0], self.q[1]].iter().map(|x| x.abs()).sum()
    }

    /// What the curve does between two times, enclosed.
    fn over(&self, t: Interval) -> Interval {
        let (a, b) = (self.w * t.0, self.w * t.1);
        // From 0 to pi, the cosine falls and the sine rises and falls.
        let top = if a <= core::f64::consts::FRAC_PI_2 && core::f64::consts::FRAC_PI_2 <= b {
            1.0
        } else {
            a.sin().max(b.sin())
        };
        let (cos, sin) = (Interval(b.cos(), a.cos()), Interval(a.sin().min(b.sin()), top));
        let line = |c: f64, d: f64| Interval(c, c).plus(Interval(d, d).times(t));
        let sum = line(self.fixed, self.linear)
            .plus(line(self.p[0], self.p[1]).times(cos))
            .plus(line(self.q[0], self.q[1]).times(sin));
        let rounding = self.size() * (16.0 * f64::EPSILON);
        Interval(sum.0 - rounding, sum.1 + rounding)
    }

    /// Bounds of the curve between two times in `[0, 1]`.
    fn extremes(&self, first: f64, last: f64) -> [f64; 2] {
        let slope = self.derivative();
        let bend = slope.derivative();
        let fine = self.size() * (1.0 / (1u64 << 34) as f64);
        let (start, end) = (self.at(first), self.at(last));
        let (mut lo, mut hi) = (start.min(end), start.max(end));
        let mut open = vec![Interval(first, last)];
        while let Some(t) = open.pop() {
            let rate = slope.over(t);
            if !rate.holds(0.0) {
                continue; // Monotone, and both ends are counted.
            }
            let middle = t.0 + (t.1 - t.0) * 0.5;
            let x = self.at(middle);
            let off = rate.size() * (t.1 - t.0) * 0.5;
            // As near as is needed; or as near as times can be told apart; or not a number.
            if off <= fine || off.is_nan() || middle <= t.0 || middle >= t.1 {
                (lo, hi) = (lo.min(x - off), hi.max(x + off));
                if off.is_nan() {
                    return [f64::NAN; 2];
                }
                continue;
            }
            (lo, hi) = (lo.min(x), hi.max(x));
            // Where the slope can be zero, by the mean value theorem: outside it the curve is monotone up to t's ends.
            let turn = bend.over(t);
            let mut root = t;
            if !turn.holds(0.0) {
                let at = slope.at(middle);
                let rounding = slope.size() * (16.0 * f64::EPSILON);
                let step =
                    Interval(-at - rounding, -at + rounding).times(Interval(1.0 / turn.1, 1.0 / turn.0));
                root = Interval(t.0.max((middle + step.0).next_down()), t.1.min((middle + step.1).next_up()));
                if root.0 > root.1 {
                    continue;
                }
            }
            if root.1 - root.0 < (t.1 - t.0) * 0.5 {
                for end in [root.0, root.1] {
                    let x = self.at(end);
                    (lo, hi) = (lo.min(x), hi.max(x));
                }
                open.push(root);
            } else {
                open.push(Interval(t.0, middle));
                open.push(Interval(middle, t.1));
            }
        }
        [lo, hi]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn extremes_enclose_the_curve_and_touch_it(c in prop::array::uniform6(-3.0..3.0f64), w in 0.0..std::f64::consts::PI,
                                                   a in 0.0..1.0f64, b in 0.0..1.0f64) {
            let curve = Curve { fixed: c[0], linear: c[1], p: [c[2], c[3]], q: [c[4], c[5]], w };
            let (a, b) = (a.min(b), a.max(b));
            let [lo, hi] = curve.extremes(a, b);
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for i in 0..=4000 {
                let x = curve.at(a + (b - a) * (i as f64 / 4000.0));
                (least, most) = (least.min(x), most.max(x));
            }
            let rounding = curve.size() * 1e-15;
            prop_assert!(lo <= least + rounding && most - rounding <= hi);
            // A sample misses an extreme by half its step at most, squared.
            let missed = curve.derivative().derivative().size() * ((b - a) / 8000.0).powi(2) + curve.size() * 1e-10;
            prop_assert!(least - lo <= missed && hi - most <= missed, "{} {}", least - lo, hi - most);
        }
    }

    #[test]
    fn still_curves_are_points() {
        let curve = Curve { fixed: 2.0, linear: 0.0, p: [0.0; 2], q: [0.0; 2], w: 1.0 };
        let [lo, hi] = curve.extremes(0.0, 1.0);
        assert!(lo <= 2.0 && hi >= 2.0 && hi - lo < 1e-14);
    }
}

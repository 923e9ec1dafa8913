//! [`DAabb`]: boxes in `f64`, met exactly.

use crate::Aabb;
use rt_geom::expansion::{Expansion, two_sum};
use rt_geom::glam::{DMat3, DVec3};
use rt_geom::{Ray, Transform};

/// Below this size, and above its reciprocal, no product of two differences leaves the range of `f64`.
const LARGE: f64 = f64::from_bits((1023 + 450) << 52);

/// An axis-aligned box in `f64`: the points between `min` and `max`, both included.
///
/// What is carried by a transform is bounded in `f64` first, and from there by `f32` boxes about whatever origin. Invalid boxes
/// are as those of [`Aabb`]: empty where a `min` exceeds its `max`, bad where there is a NaN.
///
/// ```
/// use rt_bounds::DAabb;
/// use rt_geom::{Ray, glam::DVec3};
/// let third = DAabb { min: DVec3::ZERO, max: DVec3::splat(1.0 / 3.0) };
/// let along = |x: f64| Ray::new(DVec3::new(x, 0.0, -1e9), DVec3::Z);
/// assert!(third.span(&along(1.0 / 3.0)).is_some());
/// assert!(third.span(&along((1.0f64 / 3.0).next_up())).is_none());
/// assert!(third.relative_to(DVec3::ONE).max.x >= 1.0f32 / 3.0 - 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DAabb {
    /// The least corner.
    pub min: DVec3,
    /// The greatest corner.
    pub max: DVec3,
}

impl DAabb {
    /// The box of nothing.
    pub const EMPTY: DAabb = DAabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The least box around both. A NaN yields to the number on the other side, as in [`Aabb::union`].
    #[inline]
    pub fn union(self, other: DAabb) -> DAabb {
        DAabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether every point of `other` lies in this box; false when either holds a NaN.
    #[inline]
    pub fn contains(self, other: DAabb) -> bool {
        (self.min.cmple(other.min) & other.max.cmple(self.max)).all()
    }

    /// The box in `f32` relative to `origin`, rounded outward.
    pub fn relative_to(self, origin: DVec3) -> Aabb {
        if self.min.cmpgt(self.max).any() {
            return Aabb::EMPTY;
        }
        Aabb::from_f64(self.min, self.max, origin)
    }

    /// A box around some points carried by `map`, with room for the roundings of that and of rays carried back through the map
    /// from nearby. Empty for none; all NaN where a point is not finite.
    pub fn around_carried(points: impl IntoIterator<Item = DVec3>, map: &Transform) -> DAabb {
        let (mut there, mut here, mut sound) = (DAabb::EMPTY, DAabb::EMPTY, true);
        for p in points {
            let q = map.point(p);
            sound &= q.is_finite();
            there = there.union(DAabb { min: q, max: q });
            here = here.union(DAabb { min: p, max: p });
        }
        match (sound, there.min.cmple(there.max).all()) {
            (false, _) => DAabb { min: DVec3::NAN, max: DVec3::NAN },
            (true, false) => there,
            (true, true) => there.room(here, map),
        }
    }

    /// This box, to which `map` carried what lies in `here`, grown by eight times the error of carrying its corners there and
    /// back ([`Transform::point_with_error`]), seen from this side: rays that start as near as the box is large are off by less.
    pub fn room(self, here: DAabb, map: &Transform) -> DAabb {
        let by = self.doubt(here, map);
        DAabb { min: self.min - by, max: self.max + by }
    }

    /// How far [`DAabb::room`] grows the box on each side.
    pub(crate) fn doubt(self, here: DAabb, map: &Transform) -> DVec3 {
        let off = |map: &Transform, b: DAabb| {
            let [low, high] = [b.min, b.max].map(|corner| map.point_with_error(corner, DVec3::ZERO).1);
            low + high
        };
        let back = map.linear().abs() * off(&map.inverse(), self);
        (off(map, here) + back) * 8.0
    }

    /// Where the line of the ray is inside, of the ray's interval, each end rounded outward by at most `4` units in the last
    /// place; `None` where the ray does not meet the closed box. Whether it does is decided exactly: in `f64` almost always, by
    /// exact products where that is in doubt. A ray that is not [valid](Ray::is_valid) meets no box, and no ray a box that is not:
    /// one empty or inverted along any axis, all at infinity, or with a NaN.
    ///
    /// Exactly, where coordinates, components of the direction and ends of the interval, as far as they are neither zero nor
    /// infinite, lie between `2^-450` and `2^450` in size. Of what is larger a ray meets every box, along its whole interval; what
    /// is smaller may be taken for zero beside what is not.
    pub fn span(&self, ray: &Ray<f64>) -> Option<[f64; 2]> {
        let (o, d) = (ray.origin, ray.dir);
        let (mut enter, mut exit) = (ray.t_min, ray.t_max);
        let mut moderate = o.abs().max_element() <= LARGE;
        for a in 0..3 {
            if d[a] == 0.0 {
                if o[a] < self.min[a] || o[a] > self.max[a] {
                    return None;
                }
                continue;
            }
            let [near, far] = self.planes(a, d[a]);
            let size = d[a].abs();
            moderate &= (1.0 / LARGE..=LARGE).contains(&size);
            moderate &=
                (near.abs() <= LARGE || near.is_infinite()) && (far.abs() <= LARGE || far.is_infinite());
            enter = enter.max((near - o[a]) / d[a]);
            exit = exit.min((far - o[a]) / d[a]);
        }
        // Asked of what seems to be met only: a NaN makes no comparison above a miss.
        let sound = || {
            let holds = self.min.cmple(self.max)
                & self.min.cmplt(DVec3::INFINITY)
                & self.max.cmpgt(DVec3::NEG_INFINITY);
            let most = DVec3::MAX;
            let finite = o.abs().cmple(most) & d.abs().cmple(most);
            (holds & finite).all() && d != DVec3::ZERO && ray.t_min <= ray.t_max
        };
        if !moderate {
            return sound().then_some([ray.t_min, ray.t_max]);
        }
        // Two roundings each, of the difference and of the quotient, so the error is relative: what is certain of the greatest
        // entry and the least exit is certain of all.
        let doubt =
            |t: f64| if t.is_finite() { t.abs() * (2.0 * f64::EPSILON) + f64::MIN_POSITIVE } else { 0.0 };
        let (enter_doubt, exit_doubt) = (doubt(enter), doubt(exit));
        if enter - enter_doubt > exit + exit_doubt || !sound() {
            return None;
        }
        let certain = enter + enter_doubt <= exit - exit_doubt;
        (certain || self.meets(ray)).then_some([enter - enter_doubt, exit + exit_doubt])
    }

    #[inline(always)]
    fn planes(&self, a: usize, d: f64) -> [f64; 2] {
        if d > 0.0 { [self.min[a], self.max[a]] } else { [self.max[a], self.min[a]] }
    }

    /// Whether every entry is at most every exit, as fractions.
    #[cold]
    fn meets(&self, ray: &Ray<f64>) -> bool {
        // Numerators and denominators above zero.
        let mut entries = [(Expansion::<2>::new(ray.t_min), 1.0); 4];
        let mut exits = [(Expansion::<2>::new(ray.t_max), 1.0); 4];
        let (mut n, mut m) = (ray.t_min.is_finite() as usize, ray.t_max.is_finite() as usize);
        for a in 0..3 {
            let (o, d) = (ray.origin[a], ray.dir[a]);
            if d == 0.0 {
                continue;
            }
            let over = |plane: f64| {
                if d > 0.0 { Expansion::difference(plane, o) } else { Expansion::difference(o, plane) }
            };
            let [near, far] = self.planes(a, d);
            if near.is_finite() {
                entries[n] = (over(near), d.abs());
                n += 1;
            }
            if far.is_finite() {
                exits[m] = (over(far), d.abs());
                m += 1;
            }
        }
        let at_most = |(p, q): &(Expansion<2>, f64), (r, s): &(Expansion<2>, f64)| {
            p.scaled::<4>(*s).minus::<4, 8>(&r.scaled::<4>(*q)).sign() <= 0
        };
        entries[..n].iter().all(|entry| exits[..m].iter().all(|exit| at_most(entry, exit)))
    }
}

impl From<Aabb> for DAabb {
    fn from(b: Aabb) -> DAabb {
        DAabb { min: b.min.as_dvec3(), max: b.max.as_dvec3() }
    }
}

impl Aabb {
    /// A box in `f64` around this one carried by `map`, with room for the roundings of that and of rays
    /// carried back through the map from nearby. Of a map that only permutes, mirrors, scales by
    /// powers of two and moves, it is the carried box itself, rounded outward. Boxes without end become all of space; boxes that
    /// are not valid stay so.
    ///
    /// Source: Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems (1990), in centre and half-size form.
    pub fn carried(self, map: &Transform) -> DAabb {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        if !self.is_valid() {
            return self.into();
        }
        if !(min.is_finite() && max.is_finite()) {
            return DAabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        }
        let m = map.linear();
        let by = map.affine().translation;
        if exact(m) && map.inverse().point(by) == DVec3::ZERO {
            let (p, q) = (m * min, m * max);
            return DAabb { min: sum_below(p.min(q), by), max: -sum_below(-p.max(q), -by) };
        }
        let half = (max - min) * 0.5;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let center = map.point((min + max) * 0.5);
        DAabb { min: center - reach, max: center + reach }.room(self.into(), map)
    }
}

/// Whether a linear map only permutes, mirrors and scales by powers of two: then nothing rounds.
fn exact(m: DMat3) -> bool {
    let power_of_two = |x: f64| x.to_bits() << 12 == 0; // or zero
    m.to_cols_array().into_iter().all(power_of_two)
        && [m.x_axis, m.y_axis, m.z_axis]
            .into_iter()
            .all(|c| c.to_array().iter().filter(|x| **x == 0.0).count() == 2)
}

/// `a + b`, rounded down.
fn sum_below(a: DVec3, b: DVec3) -> DVec3 {
    let below = |a: f64, b: f64| match two_sum(a, b) {
        (x, error) if error < 0.0 => x.next_down(),
        (x, _) => x,
    };
    DVec3::new(below(a.x, b.x), below(a.y, b.y), below(a.z, b.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_and_boxes_that_are_not_valid_do_not_meet() {
        let unit = DAabb { min: DVec3::NEG_ONE, max: DVec3::ONE };
        let ray = Ray::new(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.0)).between(f64::NEG_INFINITY, f64::INFINITY);
        assert!(unit.span(&ray).is_some());
        let all = DAabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        for b in [unit, all] {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                for a in 0..3 {
                    let mut v = DVec3::ZERO;
                    v[a] = bad;
                    assert_eq!(b.span(&Ray { origin: v, ..ray }), None);
                    assert_eq!(b.span(&Ray { dir: v + DVec3::X, ..ray }), None);
                }
            }
            assert_eq!(b.span(&Ray { dir: DVec3::ZERO, ..ray }), None);
            for (t_min, t_max) in [(f64::NAN, 1.0), (0.0, f64::NAN), (1.0, 0.0)] {
                assert_eq!(b.span(&ray.between(t_min, t_max)), None);
            }
        }
        for a in 0..3 {
            for origin in [DVec3::ZERO, DVec3::splat(1e200)] {
                let ray = Ray { origin, ..ray };
                let with = |min: f64, max: f64| {
                    let mut b = all;
                    (b.min[a], b.max[a]) = (min, max);
                    b.span(&ray)
                };
                assert_eq!(with(f64::NAN, 1.0), None);
                assert_eq!(with(-1.0, f64::NAN), None);
                assert_eq!(with(1.0, -1.0), None);
                assert_eq!(with(f64::INFINITY, f64::INFINITY), None);
                assert_eq!(with(f64::NEG_INFINITY, f64::NEG_INFINITY), None);
            }
        }
        assert_eq!(DAabb::EMPTY.span(&ray), None);
    }
}

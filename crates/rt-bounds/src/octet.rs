//! [`BoxOctet`] and [`WideRay`]: eight boxes, tested by one ray at once.

use crate::lanes::{Eight, Lanes};
use crate::{Aabb, SlabRay};

/// Eight boxes side by side, in the order the slab test reads them: for each axis the eight `min`, then the eight `max`.
///
/// 192 bytes, three cache lines. Places that hold no box hold [`Aabb::EMPTY`], which is the default.
///
/// ```
/// use rt_bounds::{Aabb, BoxOctet, SlabRay};
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
///
/// let boxes = [1.0, 3.0, 5.0].map(|z| Aabb::new(Vec3A::new(-1.0, -1.0, z), Vec3A::new(1.0, 1.0, z + 1.0)));
/// let octet = BoxOctet::new(&boxes);
/// let ray = Ray::new(Vec3A::ZERO, Vec3A::Z).between(0.0, 4.0);
/// let slab = SlabRay::new(&ray, DVec3::ZERO, &boxes[2]);
/// let (met, entry) = slab.enter_eight(&octet);
/// assert_eq!(met, 0b011);
/// assert!(entry[0] <= 1.0 && (2.999..=3.0).contains(&entry[1]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct BoxOctet {
    /// Along x, y and z: the eight `min`, then the eight `max`.
    pub planes: [[[f32; 8]; 2]; 3],
}

impl Default for BoxOctet {
    fn default() -> BoxOctet {
        BoxOctet { planes: [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3] }
    }
}

impl BoxOctet {
    /// The first eight of some boxes; the places beyond the last hold [`Aabb::EMPTY`].
    pub fn new(boxes: &[Aabb]) -> BoxOctet {
        let mut octet = BoxOctet::default();
        for (i, b) in boxes.iter().take(8).enumerate() {
            octet.put(i, b);
        }
        octet
    }

    /// Puts a box in place `i`.
    ///
    /// # Panics
    ///
    /// From place 8 on.
    #[inline]
    pub fn put(&mut self, i: usize, b: &Aabb) {
        for a in 0..3 {
            self.planes[a][0][i] = b.min[a];
            self.planes[a][1][i] = b.max[a];
        }
    }

    /// The eight boxes.
    pub fn boxes(&self) -> [Aabb; 8] {
        let [x, y, z] = self.planes;
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
            let corner = |end: usize| [x[end][i], y[end][i], z[end][i]].into();
            Aabb::new(corner(0), corner(1))
        })
    }
}

impl SlabRay {
    /// [`SlabRay::entry`] of eight boxes at once: which are met (bit `i` box `i`), and where. The entry of a box that is not
    /// met means nothing.
    ///
    /// The instructions are chosen by the CPU at hand, at every call: a loop over many octets chooses once, outside, with
    /// [`dispatch!`](crate::dispatch), and asks a [`WideRay`]. All choices answer alike, bit for bit, and as
    /// [`SlabRay::enter_pair`] does: what it proves of its roundings holds here.
    ///
    /// A box that is [empty](Aabb::EMPTY) is not met by a ray whose origin lies within `2^126` of zero; who keeps octets that
    /// are not full masks the bits of places that hold none.
    #[inline]
    pub fn enter_eight(&self, boxes: &BoxOctet) -> (u32, [f32; 8]) {
        crate::dispatch!(lanes => self.wide(lanes).enter_eight(boxes))
    }

    /// The same ray, spread over lanes.
    #[inline(always)]
    pub fn wide<L: Lanes>(&self, lanes: L) -> WideRay<L> {
        // Written out: closures given to `map` are compiled for the least of CPUs, and cost many times as much.
        let [[ax, _, bx, _], [ay, _, by, _], [az, _, bz, _]] =
            [self.origin[0].to_array(), self.origin[1].to_array(), self.origin[2].to_array()];
        let [[sx, _, fx, _], [sy, _, fy, _], [sz, _, fz, _]] =
            [self.inverse[0].to_array(), self.inverse[1].to_array(), self.inverse[2].to_array()];
        WideRay {
            ahead: [lanes.splat(ax), lanes.splat(ay), lanes.splat(az)],
            behind: [lanes.splat(bx), lanes.splat(by), lanes.splat(bz)],
            steep: [lanes.splat(sx), lanes.splat(sy), lanes.splat(sz)],
            flat: [lanes.splat(-fx), lanes.splat(-fy), lanes.splat(-fz)],
            near_plane: [self.negative[0] as usize, self.negative[1] as usize, self.negative[2] as usize],
            near: lanes.splat(self.near),
            far: lanes.splat(self.far),
            lanes,
        }
    }
}

/// A [`SlabRay`] that tests eight boxes at once with instructions already chosen: 14 numbers, each in eight lanes.
///
/// For loops that hold one ray in registers. Who walks with many rays keeps their slab rays, which are a quarter of the size,
/// and spreads one at every test: that costs half as much again as the test of a ray that is spread already.
#[derive(Clone, Copy, Debug)]
pub struct WideRay<L: Lanes> {
    /// The origin rounded for near planes, and for far ones.
    ahead: [L::Eight; 3],
    behind: [L::Eight; 3],
    /// The reciprocal of the direction shrunk for near planes, and grown for far ones.
    steep: [L::Eight; 3],
    flat: [L::Eight; 3],
    /// Which planes are near: 0 the `min`, 1 the `max`.
    near_plane: [usize; 3],
    near: L::Eight,
    far: L::Eight,
    lanes: L,
}

impl<L: Lanes> WideRay<L> {
    /// Ends the ray where `slab` ends, the ray it was made from.
    #[inline(always)]
    pub fn shorten(&mut self, slab: &SlabRay) {
        self.far = self.lanes.splat(slab.far());
    }

    /// [`SlabRay::enter_eight`].
    #[inline(always)]
    pub fn enter_eight(&self, boxes: &BoxOctet) -> (u32, [f32; 8]) {
        let (mut enter, mut exit) = (self.near, self.far);
        for a in 0..3 {
            // Masked, which the compiler would not know of a number in memory.
            let near = self.near_plane[a] & 1;
            let planes = &boxes.planes[a];
            let entry = self.lanes.load(&planes[near]).minus(self.ahead[a]).times(self.steep[a]);
            let leave = self.lanes.load(&planes[1 - near]).minus(self.behind[a]).times(self.flat[a]);
            // What was found before stands second: a NaN yields to it.
            enter = entry.or_greater(enter);
            exit = leave.or_less(exit);
        }
        (enter.at_most(exit), enter.store())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Portable;
    use rt_geom::Ray;
    use rt_geom::glam::{DVec3, Vec3A};

    #[test]
    fn boxes_go_in_and_out() {
        let boxes = [1.0, 2.0, 3.0].map(|x| Aabb::new(Vec3A::splat(-x), Vec3A::new(x, 2.0 * x, 3.0 * x)));
        let octet = BoxOctet::new(&boxes);
        assert_eq!(octet.boxes()[..3], boxes);
        assert_eq!(octet.boxes()[3..], [Aabb::EMPTY; 5]);
        assert_eq!(BoxOctet::default().boxes(), [Aabb::EMPTY; 8]);
        assert_eq!(BoxOctet::new(&[Aabb::INFINITE; 9]).boxes(), [Aabb::INFINITE; 8]);
        assert_eq!((size_of::<BoxOctet>(), align_of::<BoxOctet>()), (192, 64));
    }

    #[test]
    fn a_ray_shortened_meets_less_and_empty_places_are_not_met() {
        let boxes = [1.0, 2.0, 3.0, 4.0].map(|z| Aabb::new(Vec3A::splat(z), Vec3A::splat(z)));
        let octet = BoxOctet::new(&boxes);
        let ray = Ray::new(Vec3A::ZERO, Vec3A::ONE);
        let mut slab = SlabRay::new(&ray, DVec3::ZERO, &boxes[3]);
        let mut wide = slab.wide(Portable);
        assert_eq!(
            (slab.enter_eight(&octet), wide.enter_eight(&octet).0),
            (wide.enter_eight(&octet), 0b1111)
        );
        slab.shorten(2.5f32);
        wide.shorten(&slab);
        assert_eq!((slab.enter_eight(&octet).0, wide.enter_eight(&octet).0), (0b11, 0b11));
    }
}

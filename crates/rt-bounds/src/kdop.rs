//! [`Kdop`]: slabs in `K / 2` fixed directions.

use crate::slab::SlabSide;
use crate::solid;
use crate::{Aabb, BoundingVolume, SlabRay};
use rt_geom::expansion::{Expansion, two_sum};
use rt_geom::glam::{BVec4A, DVec3, Vec3A, Vec4};
use rt_geom::{Ray, Real, Vector, f32_below};

/// Beyond this size an outward-rounded extent becomes infinite: differences of two smaller ones never overflow.
const FAR: f64 = (1u128 << 126) as f64;

/// Axes, corners and edges of the cube, as integers: so a dot product is a sum of coordinates.
const NORMALS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
];

/// A convex polytope between `K / 2` pairs of parallel planes with fixed normals: the points `x` with
/// `lo <= n . x <= hi` for each normal `n`.
///
/// `K` is 6 (the axes: a box), 14 (and the corners of a cube), 18 (axes and edges) or 26 (all three); any other does not
/// compile. Normals are integers and not unit: `(1, 0, 0)`, `(1, 1, 1)`, `(1, 1, 0)` and their like with other signs, one of
/// each opposite pair, so that dot products are sums, and their length cancels in the ray test. Extents are `f32`, relative to
/// an `origin` of the caller, rounded outward and no further than need be; beyond `2^126` they are infinite. `4 K` bytes.
///
/// A k-DOP may be flat or a point. It is [empty](Kdop::EMPTY) when some `lo` exceeds its `hi`.
///
/// Source: Kay and Kajiya, "Ray tracing complex scenes" (1986); Klosowski et al., "Efficient collision detection using
/// bounding volume hierarchies of k-DOPs" (1998).
///
/// ```
/// use rt_bounds::{Aabb, BoundingVolume, Kdop};
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
///
/// // A diagonal rod: in its box a ray beside it is a hit, in its 14-DOP it is not.
/// let rod = [Vec3A::ZERO, Vec3A::ONE];
/// let dop = Kdop::<14>::from_points(rod, DVec3::ZERO);
/// let beside = Ray::new(Vec3A::new(0.9, 0.1, -1.0), Vec3A::Z);
/// assert!(dop.entry(&Kdop::ready(&beside, DVec3::ZERO, &dop.aabb())).is_none());
/// assert!(dop.surface_area() < 0.7 * dop.aabb().surface_area() as f64);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Kdop<const K: usize> {
    /// `lo` of each normal, then `hi` of each.
    planes: [f32; K],
}

impl<const K: usize> Kdop<K> {
    const H: usize = {
        assert!(matches!(K, 6 | 14 | 18 | 26), "a k-DOP has 6, 14, 18 or 26 planes");
        K / 2
    };
    /// Groups of four slabs; the last one starts early enough to be full.
    const GROUPS: usize = Self::H.div_ceil(4);

    /// The k-DOP of nothing: neutral under [`Kdop::union`].
    pub const EMPTY: Kdop<K> = {
        let mut planes = [f32::NEG_INFINITY; K];
        let mut i = 0;
        while i < Self::H {
            planes[i] = f32::INFINITY;
            i += 1;
        }
        Kdop { planes }
    };

    /// The normal of slab `i`, for `i` from 0 to `K / 2 - 1`: a vector of integers. The axes come first.
    #[inline]
    pub const fn normal(i: usize) -> DVec3 {
        // 18 leaves out the corners.
        DVec3::from_array(NORMALS[if K == 18 && i >= 3 { i + 4 } else { i }])
    }

    /// The extents of slab `i`: the least and the greatest `n . x`, for `i` from 0 to `K / 2 - 1`.
    #[inline]
    pub fn extent(&self, i: usize) -> (f32, f32) {
        (self.planes[i], self.planes[Self::H + i])
    }

    /// The k-DOP of some points, relative to `origin`; empty for none. A NaN in any point or in `origin` makes it all NaN, so
    /// that no bad point hides; an infinite one makes it infinite.
    ///
    /// Each point is inside in exact arithmetic, and each plane is the tightest `f32` plane that holds all points, unless
    /// `n . x` lies within `2^-50` of it, relative to the coordinates.
    pub fn from_points<V: Vector>(points: impl IntoIterator<Item = V>, origin: DVec3) -> Kdop<K> {
        let (mut lo, mut hi) = ([f64::INFINITY; 13], [f64::NEG_INFINITY; 13]);
        let mut poisoned = origin.is_nan();
        for p in points {
            let p = p.widen();
            poisoned |= p.is_nan();
            let at = Place::new(p, origin);
            for i in 0..Self::H {
                let (below, above) = at.along(Self::normal(i));
                (lo[i], hi[i]) = (lo[i].min(below), hi[i].max(above));
            }
        }
        if poisoned {
            return Kdop { planes: [f32::NAN; K] };
        }
        let mut dop = Kdop::EMPTY;
        for i in 0..Self::H {
            (dop.planes[i], dop.planes[Self::H + i]) = (below(lo[i]), -below(-hi[i]));
        }
        dop
    }

    /// The k-DOP of a convex thing known by its support: `support(n)` is the greatest `n . x` of its points, or a little more,
    /// for each normal and its opposite, in coordinates relative to the k-DOP's origin. A NaN leaves that side open.
    ///
    /// For a thing carried by a map `A x + t`, ask its support for `A^T n` and add `n . t`.
    ///
    /// ```
    /// use rt_bounds::{BoundingVolume, Kdop};
    /// use rt_geom::glam::DVec3;
    /// // A unit sphere. The product is rounded: grown by a rounding, it is no less than the exact one.
    /// let dop = Kdop::<14>::from_support(|n: DVec3| n.length() * (1.0 + 2.0 * f64::EPSILON));
    /// assert!((dop.surface_area() - 16.0770).abs() < 1e-4);
    /// ```
    pub fn from_support(mut support: impl FnMut(DVec3) -> f64) -> Kdop<K> {
        let mut dop = Kdop::EMPTY;
        let open = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        for i in 0..Self::H {
            let n = Self::normal(i);
            dop.planes[i] = below(-open(support(-n)));
            dop.planes[Self::H + i] = -below(-open(support(n)));
        }
        dop
    }

    /// The k-DOP of a box in the same coordinates; empty for an empty box, all NaN for one that holds a NaN.
    pub fn from_aabb(b: &Aabb) -> Kdop<K> {
        if b.is_empty() {
            return Kdop::EMPTY;
        }
        if b.min.is_nan() || b.max.is_nan() {
            return Kdop { planes: [f32::NAN; K] };
        }
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        Kdop::from_support(|n| {
            // A zero takes no part, even of an infinite side.
            let term = |a: usize| if n[a] == 0.0 { 0.0 } else { (n[a] * min[a]).max(n[a] * max[a]) };
            Place::new(DVec3::new(term(0), term(1), term(2)), DVec3::ZERO).along(DVec3::ONE).1
        })
    }

    /// The least k-DOP around both: exactly that of the points of both, so repeated unions stay tight, and tightening planes
    /// against their neighbours (Coming and Staadt 2008) would gain nothing.
    ///
    /// A NaN plane yields to that of the other side: after a union with a good k-DOP nothing shows that one was bad. So what
    /// may hold a NaN is checked before: it does not [contain](Kdop::contains) itself.
    #[inline]
    pub fn union(self, other: Kdop<K>) -> Kdop<K> {
        self.merged(other, f32::min, f32::max)
    }

    /// What both k-DOPs share, exactly. It may be empty although no slab is, and planes may lie off it.
    #[inline]
    pub fn overlap(self, other: Kdop<K>) -> Kdop<K> {
        self.merged(other, f32::max, f32::min)
    }

    #[inline]
    fn merged(mut self, other: Kdop<K>, lo: fn(f32, f32) -> f32, hi: fn(f32, f32) -> f32) -> Kdop<K> {
        for i in 0..Self::H {
            self.planes[i] = lo(self.planes[i], other.planes[i]);
            self.planes[Self::H + i] = hi(self.planes[Self::H + i], other.planes[Self::H + i]);
        }
        self
    }

    /// Whether every slab of `other` lies in that of this one: then every point does. True for an [empty](Kdop::is_empty)
    /// `other`, false when either holds a NaN.
    pub fn contains(&self, other: &Kdop<K>) -> bool {
        let within =
            |i| self.planes[i] <= other.planes[i] && other.planes[Self::H + i] <= self.planes[Self::H + i];
        other.is_empty() || (0..Self::H).all(within)
    }

    /// Whether some `lo` exceeds its `hi`. An [overlap](Kdop::overlap) may have no point and yet not be empty in this sense.
    pub fn is_empty(&self) -> bool {
        (0..Self::H).any(|i| self.planes[i] > self.planes[Self::H + i])
    }

    /// Four slabs: their `lo` and their `hi`.
    #[inline(always)]
    fn group(&self, g: usize) -> (Vec4, Vec4) {
        if K == 6 {
            let p = &self.planes;
            return (Vec4::new(p[0], p[1], p[2], p[2]), Vec4::new(p[3], p[4], p[5], p[5]));
        }
        let i = first_of_group::<K>(g);
        (
            Vec4::from_slice(&self.planes[i..i + 4]),
            Vec4::from_slice(&self.planes[Self::H + i..Self::H + i + 4]),
        )
    }

    /// The part of the ray between all slabs, in the unit of [`KdopRay::far`]: entry and exit, rounded outward.
    #[inline(always)]
    pub(crate) fn span(&self, ray: &KdopRay<K>) -> Option<(f32, f32)> {
        let (mut t0, mut t1) = (Vec4::splat(ray.near), Vec4::splat(ray.far));
        for g in 0..Self::GROUPS {
            let (lo, hi) = self.group(g);
            let lanes = &ray.lanes[g];
            let near = Vec4::select(lanes.negative, hi, lo);
            let far = Vec4::select(lanes.negative, lo, hi);
            // The product first: a NaN, which arises only where the exact answer is a miss, is dropped.
            t0 = ((near - lanes.ahead) * lanes.near).max(t0);
            t1 = ((far - lanes.behind) * lanes.far).min(t1);
            if g == 0 && Self::GROUPS > 1 && t0.max_element() > t1.min_element() {
                return None;
            }
        }
        let (t0, t1) = (t0.max_element(), t1.min_element());
        (t0 <= t1).then_some((t0, t1))
    }
}

/// The number of the first slab of a group of four.
const fn first_of_group<const K: usize>(g: usize) -> usize {
    let last = (K / 2).saturating_sub(4);
    if 4 * g < last { 4 * g } else { last }
}

/// A place relative to an origin: each coordinate with its rounding error.
struct Place {
    x: [f64; 3],
    error: [f64; 3],
}

impl Place {
    #[inline]
    fn new(p: DVec3, origin: DVec3) -> Place {
        let [x, y, z] = [0, 1, 2].map(|a| two_sum(p[a], -origin[a]));
        Place { x: [x.0, y.0, z.0], error: [x.1, y.1, z.1] }
    }

    /// Bounds of `n . x` for an `n` of -1, 0 and 1, equal where nothing rounds.
    #[inline]
    fn along(&self, n: DVec3) -> (f64, f64) {
        let (mut sum, mut errors, mut sizes) = (0.0, 0.0, 0.0);
        for a in 0..3 {
            if n[a] != 0.0 {
                let (s, e) = two_sum(sum, n[a] * self.x[a]);
                sum = s;
                errors += e + n[a] * self.error[a];
                sizes += e.abs() + self.error[a].abs();
            }
        }
        if sizes == 0.0 {
            return (sum, sum);
        }
        // The exact value is `sum` and the errors, themselves added with a few roundings.
        let slack = sizes * (8.0 * f64::EPSILON);
        if slack.is_nan() {
            return out_of_range(n, &self.x);
        }
        ((sum + (errors - slack)).next_down(), (sum + (errors + slack)).next_up())
    }
}

/// Bounds of `n . x` where a sum overflows or a coordinate is infinite: then errors are NaN.
#[cold]
fn out_of_range(n: DVec3, x: &[f64; 3]) -> (f64, f64) {
    let mut used = (0..3).filter(|a| n[*a] != 0.0).map(|a| n[a] * x[a]);
    match (used.next(), used.next()) {
        (Some(x), None) if x > 0.0 => (f64::MAX, f64::INFINITY),
        (Some(x), None) if x < 0.0 => (f64::NEG_INFINITY, f64::MIN),
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    }
}

/// `x` rounded down to `f32`; minus infinity beyond reach.
fn below(x: f64) -> f32 {
    match x {
        x if x < -FAR => f32::NEG_INFINITY,
        f64::INFINITY => f32::INFINITY,
        x if x > FAR => FAR as f32,
        x => f32_below(x),
    }
}

/// What a traversal derives from a ray, once, for k-DOPs: for each normal where and how steeply the ray meets its planes,
/// rounded outward as by [`SlabRay`].
///
/// Along the axes it is the [`SlabRay`], bit for bit, so that a `Kdop<6>` is entered where its box is. Along the other normals
/// `n . dir`, a sum of three numbers, is known exactly, so a ray is parallel to a slab only if it truly is; `n . o` is enclosed
/// between two `f32`.
///
/// A ray that is not [valid](Ray::is_valid) meets nothing.
///
/// Cost: that of [`SlabRay::new`], and a division and some twenty additions in `f64` for each further slab.
#[derive(Clone, Copy, Debug)]
pub struct KdopRay<const K: usize> {
    slab: SlabRay,
    lanes: [Lanes; 4],
    near: f32,
    far: f32,
    valid: bool,
}

/// [`SlabSide`] for four slabs.
#[derive(Clone, Copy, Debug)]
struct Lanes {
    ahead: Vec4,
    behind: Vec4,
    near: Vec4,
    far: Vec4,
    negative: BVec4A,
}

impl<const K: usize> KdopRay<K> {
    /// Prepares `ray` for k-DOPs given relative to `origin` that all lie in `world`, itself relative to `origin`.
    ///
    /// `world` matters only to rays with a negative `t_min`.
    pub fn new<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> KdopRay<K> {
        let slab = SlabRay::new(ray, origin, world);
        let (near, start, unit) = slab.scale();
        let mut sides = [slab.side(0); 13];
        for a in 1..3 {
            sides[a] = slab.side(a);
        }
        if K > 6 {
            let (o, d) = (ray.origin.widen(), ray.dir.widen());
            let at = Place::new(o, origin);
            let shift = d * start;
            // The rounding of the shift, of its sum with the place, and of the sums along the normal.
            let reach = (o.abs() + shift.abs() + origin.abs()).element_sum();
            let slack = if start == 0.0 { 0.0 } else { reach * (8.0 * f64::EPSILON) };
            for i in 3..Kdop::<K>::H {
                let n = Kdop::<K>::normal(i);
                let (low, high) = at.along(n);
                let moved = if start == 0.0 { 0.0 } else { n.dot(shift) };
                let (low, high) = (low + moved - slack, high + moved + slack);
                let x = low * 0.5 + high * 0.5;
                let error = if low == high { 0.0 } else { high - low };
                sides[i] = match climb(n, d, unit) {
                    Some(climb) => SlabSide::new(x, error, 1.0 / climb),
                    None => OPEN,
                };
            }
        }
        let lanes = [0, 1, 2, 3].map(|g| {
            let i = if K == 6 { 0 } else { first_of_group::<K>(g) };
            let last = if K == 6 { 2 } else { i + 3 };
            let four = [sides[i], sides[i + 1], sides[i + 2], sides[last]];
            let lane = |of: fn(&SlabSide) -> f32| Vec4::from_array(four.each_ref().map(of));
            Lanes {
                ahead: lane(|s| s.ahead),
                behind: lane(|s| s.behind),
                near: lane(|s| s.near),
                far: lane(|s| s.far),
                negative: BVec4A::from_array(four.map(|s| s.negative)),
            }
        });
        let valid = ray.is_valid();
        let near = if valid { near } else { f32::INFINITY };
        let far = if valid { slab.far() } else { f32::NEG_INFINITY };
        KdopRay { slab, lanes, near, far, valid }
    }

    /// Ends the ray at `t_max`, included, with room for the rounding of a computed `t`.
    #[inline]
    pub fn shorten<R: Real>(&mut self, t_max: R) {
        self.slab.shorten(t_max);
        if self.valid {
            self.far = self.slab.far();
        }
    }

    /// The distance beyond which no volume matters, in the unit of the entries.
    #[inline]
    pub fn far(&self) -> f32 {
        self.far
    }

    /// What [`SlabRay::scale`] is.
    pub(crate) fn scale(&self) -> (f32, f64, f64) {
        self.slab.scale()
    }
}

/// A slab that never rejects.
const OPEN: SlabSide =
    SlabSide { ahead: f32::INFINITY, behind: f32::NEG_INFINITY, near: 1.0, far: 1.0, negative: false };

/// `n . d / unit` with the sign of the exact value and an error of a few units in the last place; `None` where the range of
/// `f64` does not allow it.
fn climb(n: DVec3, d: DVec3, unit: f64) -> Option<f64> {
    // Sums of numbers up to 2^1020 do not overflow.
    if d.abs().max_element() > f64::MAX / 16.0 {
        return None;
    }
    let (s, e) = two_sum(n.x * d.x, n.y * d.y);
    let (t, f) = two_sum(s, n.z * d.z);
    let exact = if e == 0.0 && f == 0.0 { t } else { sum(n * d) };
    let climb = exact / unit;
    // Units are powers of two; what underflows keeps its sign and is as good as level.
    Some(if climb == 0.0 && exact != 0.0 { f64::from_bits(1).copysign(exact) } else { climb })
}

/// The sum of the components, which has the sign of the exact sum and an error of a few units in the last place.
#[cold]
fn sum(v: DVec3) -> f64 {
    Expansion::<2>::difference(v.x, -v.y).plus::<1, 3>(&Expansion::new(v.z)).value()
}

impl<const K: usize> BoundingVolume for Kdop<K> {
    type Ready = KdopRay<K>;

    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<Kdop<K>> {
        let good = origin.is_finite() && !points.is_empty() && points.iter().all(|p| p.widen().is_finite());
        good.then(|| Kdop::from_points(points.iter().copied(), origin))
    }

    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> KdopRay<K> {
        KdopRay::new(ray, origin, world)
    }

    #[inline]
    fn entry(&self, ready: &KdopRay<K>) -> Option<f32> {
        self.span(ready).map(|(entry, _)| entry)
    }

    /// The area of the faces that the planes truly have, found by cutting the box with the other planes: a few microseconds.
    /// 0 when empty, infinite when an axis is.
    fn surface_area(&self) -> f64 {
        let b = self.aabb();
        if self.is_empty() {
            return 0.0;
        }
        if K == 6 || !(b.min.is_finite() && b.max.is_finite()) {
            return BoundingVolume::surface_area(&b);
        }
        let planes = (3..Self::H).flat_map(|i| {
            let (n, (lo, hi)) = (Self::normal(i), self.extent(i));
            let inverse = 1.0 / n.length();
            [(-n * inverse, -lo as f64 * inverse), (n * inverse, hi as f64 * inverse)]
        });
        solid::area(b.min.as_dvec3(), b.max.as_dvec3(), planes.filter(|(_, d)| d.is_finite()))
    }

    #[inline]
    fn aabb(&self) -> Aabb {
        let p = &self.planes;
        let h = Self::H;
        Aabb::new(Vec3A::new(p[0], p[1], p[2]), Vec3A::new(p[h], p[h + 1], p[h + 2]))
    }
}

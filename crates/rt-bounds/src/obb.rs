//! [`Obb`]: oriented boxes.

mod fit;

use crate::cloud::Cloud;
use crate::unit_ray::{U, U32};
use crate::{Aabb, BoundingVolume, DAabb, UnitRay};
use rt_geom::glam::{DVec3, Vec3, Vec3A, Vec4, Vec4Swizzles};
use rt_geom::{Ray, Real, Transform, Vector, f32_above, f32_below};

/// Beyond this size of a coordinate or half width a box is all of space.
const FAR: f64 = (1u128 << 126) as f64;
/// The least volume that three unit normals may span: below, rounding them to `f32` would bend the box.
const LEAST_VOLUME: f64 = 1.0 / (1u64 << 16) as f64;
/// A direction less steep against a slab than this moves nowhere across it.
const LEVEL: f64 = f64::from_bits((1023 - 1000) << 52);

/// A box that lies askew in space, sheared where a map has sheared it: the points `x` with `|n . (x - c)| <= h` for
/// three normals `n`, each with a half width `h` of its own, about one centre `c`.
///
/// Sixteen `f32`, 64 bytes: normals, half widths, centre (relative to the origin the box was made with) and the radius
/// of a ball about the centre that holds the box. The normals are of length about 1 and *are* what is stored: half
/// widths are taken along them, after rounding, so that the box holds its points as real numbers whatever rounding did
/// to the normals. Where points are out of reach, beyond `2^126`, the box is all of space.
///
/// | constructor | area over the least: mean, most | of 24 points | of `10^5` points |
/// | --- | --- | --- | --- |
/// | [`pca`](Obb::pca) | 1.11, 1.57 | 1.2 us | 1.1 ms |
/// | [`dito`](Obb::dito) | 1.07, 2.26 | 2.0 us | 1.6 ms |
/// | [`tight`](Obb::tight) | 1.0005, 1.046 | 93 us | 21 ms |
///
/// Measured on 300 random sets of 4 to 10 points, against a search that tries every pair and triple of them and
/// thousands of rotations besides; such small sets are the hardest. Times on a busy virtual machine, the least of many
/// runs.
///
/// ```
/// use rt_bounds::{Aabb, BoundingVolume, Obb};
/// use rt_geom::{Transform, glam::{DVec3, Vec3A}};
/// let rod = Aabb::new(Vec3A::ZERO, Vec3A::new(10.0, 1.0, 1.0));
/// let turn = Transform::rotation(DVec3::new(1.0, 2.0, 3.0), 0.7).unwrap();
/// let carried = Obb::carried(&rod, &turn, DVec3::ZERO).unwrap();
/// assert!((carried.surface_area() - 42.0).abs() < 1e-4);
/// assert!(BoundingVolume::surface_area(&rod.transformed(&turn, DVec3::ZERO)) > 100.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb {
    /// For x, y and z: that component of the three normals, then of the centre.
    columns: [Vec4; 3],
    /// The three half widths, then the radius.
    widths: Vec4,
}

impl Obb {
    /// All of space.
    pub const INFINITE: Obb = Obb { columns: [Vec4::X, Vec4::Y, Vec4::Z], widths: Vec4::INFINITY };

    /// A box as what it is already. `None` where it is not [valid](Aabb::is_valid); all of space where it is infinite.
    pub fn of_aabb(b: &Aabb) -> Option<Obb> {
        if !b.is_valid() {
            return None;
        }
        let center = b.center();
        // The box seen from its centre, rounded outward.
        let seen = Aabb::from_f64(b.min.as_dvec3(), b.max.as_dvec3(), center.as_dvec3());
        let half = seen.max.max(-seen.min);
        Some(Obb::from_parts(ALIGNED, half.to_array(), center))
    }

    /// The parallelepiped that `map` makes of a box, relative to `origin`. Sheared where the map shears; its normals
    /// are the rows of the inverse map, so that testing it is testing the box in its own space, axis by axis and only
    /// as far as needed.
    ///
    /// It holds the carried box and what rounding may add to rays carried back through the map from nearby, as
    /// [`Aabb::transformed`] does. All of space for an infinite box; `None` for one that is not
    /// [valid](Aabb::is_valid). Where the map flattens so much that normals in `f32` could not tell its faces apart, it
    /// is the axis-aligned box instead.
    pub fn carried(b: &Aabb, map: &Transform, origin: DVec3) -> Option<Obb> {
        if !b.is_valid() {
            return None;
        }
        if !(b.min.is_finite() && b.max.is_finite()) {
            return Some(Obb::INFINITE);
        }
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let rows = map.inverse().linear().transpose();
        let normals = [rows.x_axis, rows.y_axis, rows.z_axis].map(unit);
        let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let m = map.linear();
        let center = map.point(middle);
        // A corner is off by a few roundings of the terms by which the map carries it, before they cancel, and so is a ray
        // moved into the box's space.
        let spread = m.abs() * half;
        let error = DAabb { min: center - spread, max: center + spread }.doubt((*b).into(), map);
        let place = (center - origin).as_vec3a();
        let reached = center.is_finite() && place.abs().max_element() as f64 <= FAR;
        if !reached || !normals.iter().all(|n| n.is_finite()) {
            return Some(Obb::INFINITE);
        }
        let normals = normals.map(|n| n.as_vec3a());
        if volume(normals).abs() < LEAST_VOLUME {
            return Obb::of_aabb(&b.transformed(map, origin));
        }
        let edges = [m.x_axis * half.x, m.y_axis * half.y, m.z_axis * half.z];
        // From the stored centre to the true one: zero but for rounding.
        let x = center - origin;
        let off = x - place.as_dvec3();
        let error = error + (x.abs() + center.abs() + origin.abs()) * (2.0 * U);
        let widths = normals.map(|n| {
            let n = n.as_dvec3();
            let across = |v: DVec3| n.dot(v).abs() + n.abs().dot(v.abs()) * (4.0 * U);
            let reach = across(off) + edges.iter().map(|e| across(*e)).sum::<f64>() + n.abs().dot(error);
            f32_above(reach * (1.0 + 8.0 * U))
        });
        Some(Obb::from_parts(normals, widths, place))
    }

    /// A box around some points, relative to `origin`, whose axes are those of their covariance: of the surface of
    /// `triangles`, which number the points, or, where there is no surface, of the points themselves. The axis-aligned
    /// box where that is the better one. `None` for no points, or where one or `origin` is not
    /// finite; triangles that name no points are
    /// passed over.
    ///
    /// The surface, not the points, so that finely divided parts pull no harder. Symmetric things, a cube, have no axes
    /// of their own and get arbitrary ones: see [`Obb::dito`].
    ///
    /// Cost: four passes over the points and one over the triangles.
    ///
    /// Source: Gottschalk, Lin, Manocha, "OBBTree: a hierarchical structure for rapid interference detection", SIGGRAPH
    /// 1996.
    pub fn pca<V: Vector>(points: &[V], triangles: &[[u32; 3]], origin: DVec3) -> Option<Obb> {
        let cloud = Cloud::new(points, origin)?;
        Some(Obb::along(fit::pca(&cloud.points, triangles), &cloud, points, origin))
    }

    /// A box around some points, relative to `origin`, whose axes are an edge, the normal and what is across of one of
    /// seven triangles between extreme points: the one of least area around fourteen such points. The axis-aligned box
    /// where that is the better one. `None` for no points, or where one or `origin` is not
    /// finite.
    ///
    /// Cost: five passes, one of them with seven dot products a point.
    ///
    /// Source: Larsson and Källberg, "Fast computation of tight-fitting oriented bounding boxes", Game Engine Gems 2
    /// (2011): DiTO-14.
    pub fn dito<V: Vector>(points: &[V], origin: DVec3) -> Option<Obb> {
        let cloud = Cloud::new(points, origin)?;
        Some(Obb::along(fit::dito(&cloud.points), &cloud, points, origin))
    }

    /// A box around some points, relative to `origin`, that no turn about one of its axes makes much smaller: started
    /// from the best of the axes that [`Obb::dito`] and [`Obb::pca`] look at and those of space, and turned until a
    /// thousandth is no longer gained. Where few points are extreme, faces along every two of their differences are
    /// tried too. `None` for no points, or where one or `origin` is not
    /// finite.
    ///
    /// About one axis the best turn is known: of all rectangles around points in a plane the least has a side along an
    /// edge of their convex hull. Turns are found for a few extreme points, and a point that the turned box leaves out
    /// joins them.
    ///
    /// Cost: twenty to sixty passes over the points, and some hundred microseconds.
    ///
    /// Source: the turns, Freeman and Shapira, "Determining the minimum-area encasing rectangle for an arbitrary closed
    /// curve" (1975), taken about each axis in turn as Barequet and Har-Peled, "Efficiently approximating the
    /// minimum-volume bounding box" (2001), do; the growing set of points after Badoiu and Clarkson's core sets (2003).
    pub fn tight<V: Vector>(points: &[V], origin: DVec3) -> Option<Obb> {
        let cloud = Cloud::new(points, origin)?;
        Some(Obb::along(fit::tight(&cloud.points), &cloud, points, origin))
    }

    /// The box along three perpendicular axes around all points, or the axis-aligned one where it is no larger.
    fn along<V: Vector>(axes: [DVec3; 3], cloud: &Cloud, points: &[V], origin: DVec3) -> Obb {
        let aligned = <Aabb as BoundingVolume>::around(points, origin).and_then(|b| Obb::of_aabb(&b));
        let fitted = Obb::fitted(axes, cloud, points, origin);
        match (fitted, aligned) {
            (Some(fitted), Some(aligned)) if fitted.surface_area() < aligned.surface_area() => fitted,
            (_, aligned) => aligned.unwrap_or(Obb::INFINITE),
        }
    }

    fn fitted<V: Vector>(axes: [DVec3; 3], cloud: &Cloud, points: &[V], origin: DVec3) -> Option<Obb> {
        let stored = axes.map(|n| n.as_vec3a());
        let determinant = volume(stored);
        let spanned = determinant.abs() >= LEAST_VOLUME;
        if !spanned {
            return None;
        }
        let normals = stored.map(|n| n.as_dvec3());
        // The middle of the extents.
        let mut middle = DVec3::ZERO;
        for (i, n) in normals.iter().enumerate() {
            let (low, high) = fit::extent(&cloud.points, *n);
            let across = normals[(i + 1) % 3].cross(normals[(i + 2) % 3]);
            middle += across * ((low + high) * 0.5 / determinant);
        }
        let center = cloud.place(middle, origin).as_vec3a();
        let reached = center.abs().max_element() as f64 <= FAR;
        if !reached {
            return None;
        }
        // Their reach from the centre as stored, along the normals as stored, and the rounding of it.
        let c = center.as_dvec3();
        let mut reach = DVec3::ZERO;
        let mut most = DVec3::ZERO;
        for p in points {
            let x = p.widen() - origin;
            let q = x - c;
            most = most.max(x.abs().max(q.abs()));
            reach = reach.max(DVec3::from_array(normals.map(|n| n.dot(q).abs())));
        }
        // `u |x|` for `x`, `u |q|` for `q` and `3 u |q|` for the product, each at most by the sum of the components.
        let error = most.element_sum() * (6.0 * U) + f64::MIN_POSITIVE;
        Some(Obb::from_parts(stored, (reach + error).to_array().map(f32_above), center))
    }

    #[inline(always)]
    fn normal(&self, i: usize) -> DVec3 {
        let [x, y, z] = self.columns;
        DVec3::new(x[i] as f64, y[i] as f64, z[i] as f64)
    }

    fn normals(&self) -> [Vec3A; 3] {
        let [x, y, z] = self.columns;
        [0, 1, 2].map(|i| Vec3A::new(x[i], y[i], z[i]))
    }

    #[inline(always)]
    fn center(&self) -> DVec3 {
        let [x, y, z] = self.columns;
        DVec3::new(x.w as f64, y.w as f64, z.w as f64)
    }

    /// From the centre half along each edge, rounded. In each component off by at most `2^-32` of the longest edge,
    /// because the normals are of length about 1 and span [`LEAST_VOLUME`] at least.
    fn edges(&self) -> [DVec3; 3] {
        let volume = volume(self.normals());
        [0, 1, 2].map(|i| {
            let across = self.normal((i + 1) % 3).cross(self.normal((i + 2) % 3));
            across * (self.widths[i] as f64 / volume)
        })
    }

    /// With the radius that belongs to the rest; all of space where something is out of reach.
    fn from_parts(normals: [Vec3A; 3], half: [f32; 3], center: Vec3A) -> Obb {
        let [a, b, c] = normals;
        let columns = [0, 1, 2].map(|i| Vec4::new(a[i], b[i], c[i], center[i]));
        let within = |x: f32| x.abs() as f64 <= FAR;
        if !(half.into_iter().all(within) && center.to_array().into_iter().all(within)) {
            return Obb::INFINITE;
        }
        let mut made = Obb { columns, widths: Vec3::from_array(half).extend(0.0) };
        let [a, b, c] = made.edges();
        let diagonals = [a + b + c, a + b - c, a - b + c, a - b - c];
        let most = diagonals.iter().fold(0.0f64, |most, d| most.max(d.length()));
        // Beside the error of the edges, squares that underflow.
        let radius = f32_above(most * (1.0 + 1.0 / (1u64 << 28) as f64) + f32::MIN_POSITIVE as f64 * U);
        made.widths.w = radius;
        if within(radius) { made } else { Obb::INFINITE }
    }

    /// What [`BoundingVolume::entry`] decides last.
    #[inline]
    fn entry_f64(&self, ray: &UnitRay) -> Option<f32> {
        let m = ray.origin - self.center();
        let e = ray.slack + (m.abs().element_sum() + self.widths.w as f64) * (32.0 * U);
        let (mut enter, mut exit) = (ray.near, ray.far);
        for i in 0..3 {
            let n = self.normal(i);
            let (start, pace) = (n.dot(m), n.dot(ray.dir));
            let half = self.widths[i] as f64 + e;
            if pace.abs() < LEVEL {
                if start.abs() > half {
                    return None;
                }
                continue;
            }
            let inverse = 1.0 / pace;
            let (a, b) = ((-half - start) * inverse, (half - start) * inverse);
            enter = enter.max(a.min(b));
            exit = exit.min(a.max(b));
            if enter > exit {
                return None;
            }
        }
        (enter <= exit).then(|| f32_below(enter))
    }

    /// The three slabs whose common part the box is, relative to its origin: normal, a point half way between the
    /// planes, and half of `n . (far - near)`.
    pub fn slabs(&self) -> [(DVec3, DVec3, f64); 3] {
        [0, 1, 2].map(|i| (self.normal(i), self.center(), self.widths[i] as f64))
    }
}

/// Normals along the axes.
const ALIGNED: [Vec3A; 3] = [Vec3A::X, Vec3A::Y, Vec3A::Z];

/// The volume that normals of length about 1 span, with its sign: off by at most `16 u`.
fn volume(normals: [Vec3A; 3]) -> f64 {
    let [a, b, c] = normals.map(|n| n.as_dvec3());
    a.dot(b.cross(c))
}

/// `v` with length 1, whatever its size.
fn unit(v: DVec3) -> DVec3 {
    let size = v.abs().max_element();
    (v / size).normalize()
}

impl BoundingVolume for Obb {
    type Ready = UnitRay;

    /// By [`Obb::dito`]: ten to forty times quicker than [`Obb::tight`], whose boxes are some 6 % smaller.
    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<Obb> {
        Obb::dito(points, origin)
    }

    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, _world: &Aabb) -> UnitRay {
        UnitRay::new(ray, origin)
    }

    /// In `f32` first, all three slabs in lanes, which dismisses most; then in `f64`, one slab after another, each only
    /// if the ray has met those before.
    ///
    /// Why no hit is lost, with `u = 2^-53` (or `2^-24`), `m` from the centre to the ray's origin `o` and distances `x`
    /// along the direction `d`: a point of the box lies no farther along than `|x| <= |m| + radius`. There `n . m + x
    /// (n . d)` is off by at most `u |o| + 4 u |m|` for the first term and `8 u |x|` for the second, the direction's
    /// own `4 u` included. A quotient that is off by `3 u` of itself is the exact one for an `n . d` off by as much:
    /// another `3 u |x|`. So within `e = 2 u |o| + 32 u (|m| + radius)` the slab is that of the computed numbers, taken
    /// as exact. A slope so small that its reciprocal is cut off or that `f64` leaves out moves less than `e` across
    /// the slab.
    #[inline]
    fn entry(&self, ray: &UnitRay) -> Option<f32> {
        const STEEPEST: Vec4 = Vec4::splat((1u128 << 126) as f32);
        let rough = &ray.rough;
        let [x, y, z] = self.columns;
        let m = rough.origin - Vec3A::new(x.w, y.w, z.w);
        let size = m.abs();
        let e = rough.slack + (size.x + size.y + size.z + self.widths.w) * (32.0 * U32);
        // Lane i: slab i. The last lane holds nothing and is not looked at.
        let start = x * m.x + y * m.y + z * m.z;
        let inverse = (x * rough.dir.x + y * rough.dir.y + z * rough.dir.z).recip();
        let inverse = inverse.min(STEEPEST).max(-STEEPEST);
        let half = self.widths + e;
        let (a, b) = ((-half - start) * inverse, (half - start) * inverse);
        let (near, far) = (a.min(b), a.max(b));
        let enter = near.max(near.yzxw()).max(near.zxyw()).x;
        let exit = far.min(far.yzxw()).min(far.zxyw()).x;
        if enter > exit || enter > rough.far || rough.near > exit {
            return None;
        }
        self.entry_f64(ray)
    }

    fn surface_area(&self) -> f64 {
        if self.widths.w == f32::INFINITY {
            return f64::INFINITY;
        }
        let [a, b, c] = self.edges();
        8.0 * (a.cross(b).length() + b.cross(c).length() + c.cross(a).length())
    }

    fn aabb(&self) -> Aabb {
        if self.widths.w == f32::INFINITY {
            return Aabb::INFINITE;
        }
        let edges = self.edges();
        let reach = edges.iter().fold(DVec3::ZERO, |sum, e| sum + e.abs());
        // Rounding of the edges; a box along the axes has none.
        let exact = self.normals() == ALIGNED;
        let longest = edges.iter().fold(0.0f64, |most, e| most.max(e.length()));
        let pad = if exact { 0.0 } else { longest / (1u64 << 29) as f64 + f32::MIN_POSITIVE as f64 * U };
        let reach = reach + pad;
        let low = Aabb::from_f64(self.center(), self.center(), reach).min;
        Aabb::new(low, Aabb::from_f64(self.center(), self.center(), -reach).max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::DMat3;

    #[test]
    fn a_box_along_the_axes_stays_itself() {
        let b = Aabb::new(Vec3A::new(-1.0, 0.0, 5.0), Vec3A::new(1.0, 0.0, 7.5));
        let obb = Obb::of_aabb(&b).unwrap();
        assert_eq!(obb.aabb(), b);
        assert_eq!(obb.surface_area(), BoundingVolume::surface_area(&b));
        assert_eq!(size_of::<Obb>(), 64);
        assert_eq!(Obb::of_aabb(&Aabb::INFINITE), Some(Obb::INFINITE));
        assert_eq!(Obb::of_aabb(&Aabb::EMPTY), None);
    }

    #[test]
    fn maps_that_shear_stretch_and_flatten() {
        let cube = Aabb::new(Vec3A::splat(-1.0), Vec3A::ONE);
        let map = |m: [f64; 9]| {
            let matrix3 = DMat3::from_cols_array(&m);
            Transform::new(rt_geom::glam::DAffine3 { matrix3, translation: DVec3::splat(3.0) }).unwrap()
        };
        let sheared = map([1.0, 0.0, 0.0, 0.7, 1.0, 0.0, 0.0, 0.0, 2.0]);
        let obb = Obb::carried(&cube, &sheared, DVec3::ZERO).unwrap();
        // Parallelogram 2 x 2 twice, sides 4 x 2 and 4 x |(1.4, 2)| twice.
        let area = 2.0 * (4.0 + 8.0 + 4.0 * (1.4f64 * 1.4 + 4.0).sqrt());
        assert!((obb.surface_area() / area - 1.0).abs() < 1e-6, "{}", obb.surface_area());
        // So thin that f32 normals cannot span it: the box around it.
        let thin = map([1.0, 1.0, 0.0, 1.0, 1.0 + 1e-7, 0.0, 0.0, 0.0, 1.0]);
        let obb = Obb::carried(&cube, &thin, DVec3::ZERO).unwrap();
        assert_eq!(obb.normals(), ALIGNED);
        assert_eq!(Obb::carried(&Aabb::INFINITE, &thin, DVec3::ZERO), Some(Obb::INFINITE));
        assert_eq!(Obb::carried(&Aabb::EMPTY, &thin, DVec3::ZERO), None);
        let huge = Transform::scale(DVec3::splat(1e200)).unwrap();
        assert_eq!(Obb::carried(&cube, &huge, DVec3::ZERO), Some(Obb::INFINITE));
    }
}

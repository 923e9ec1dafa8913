//! [`Quadric`]: spheres, cylinders, cones, paraboloids and hyperboloids about the z axis, whole or in part.

use super::form::{Extent, Form, Number, Terms};
use super::partials::weingarten;
use super::sweep::{Sweep, arc, direction, share};
use super::{LARGEST, QuadricError, Root, solve, surface};
use crate::surface::unit;
use crate::{Partials, Shape, Surface, Uv};
use core::f64::consts::TAU;
use core::ops::ControlFlow;
use rt_accel::{Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::expansion::DoubleDouble;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real};

/// A sphere, cylinder, cone, paraboloid or hyperboloid about the z axis: all of it, or from one height to another and from one
/// angle to another. Open where it is cut.
///
/// In object space and kept in `f64`; an [`Instance`](rt_accel::Instance) places it in the world. Answers rays of both
/// precisions. Its borders belong to it. The normal points away from the axis; `u` goes counter-clockwise around from the first angle to the
/// last, `v` upward: as the angle from the pole does on a sphere, as `z` does on the others.
///
/// # How it is decided
///
/// The equation is a signed sum of squares of linear functions. Its coefficients are taken about the point of the line
/// nearest to the middle of the surface, so that nothing cancels for a small far or a huge near one, first in `f64` with a
/// bound on their error. What the bound leaves open (tangents, lines along a ruling, a vanishing leading coefficient) is
/// computed again with twice the digits. What even these leave open is a hit: none is missed. That is some `2^-90` of size and
/// distance for surfaces of moderate shape. Of cones and hyperboloids a million times longer than wide, or wider than long, and
/// of cuts as thin as a rounding it is more: of rays aimed at the borders of such, one in three hundred was met beyond that band.
///
/// Roots that need it are polished by Newton's steps on the equation with twice the digits. They are within one unit in
/// the last place of the exact ones while the condition is below `10^6`, and always within the error that
/// [`Quadric::roots`] reports. Limits of height and angle are decided by signs at the root, never by an arc tangent; a root
/// that may lie on a border by twice the digits does; a distance that may be 0 is. A line that lies in the surface does not
/// meet it.
///
/// The ends of a sweep belong to it. They are the directions that `cos` and `sin` of the angles round to; the axes within `2^-50`
/// of a turn of quarter turns, up to two turns. So parts of a turn that abut lose nothing of the whole between them, also where
/// it closes: as from 0 to `PI` and on to `TAU`. Other ends outside of `[0, TAU)` reach `2^-49` of the angle, or of a turn,
/// further: such a number may be another with a turn added, which rounds. Sizes, distances and components of directions may span `2^150`; beyond, all is rounded as `f64` rounds. Sizes end at `1e290`;
/// [`Surface`] records and areas want sizes from `1e-70` to `1e70`.
///
/// Source: the parametrisations: Pharr and Humphreys, *Physically Based Rendering* (2004), sections 3.2 to 3.5; double-double
/// arithmetic: Dekker (1971), see [`DoubleDouble`].
///
/// ```
/// use rt_accel::{Instance, Primitive};
/// use rt_geom::{Ray, Transform, glam::{DVec3, Vec3A}};
/// use rt_shapes::Quadric;
/// use std::f64::consts::PI;
/// // A bowl: the lower half of a sphere, seen from above.
/// let bowl = Quadric::sphere(1.0)?.cut(-1.0, 0.0)?;
/// let down = Ray::new(Vec3A::new(0.0, 0.0, 5.0), Vec3A::NEG_Z);
/// assert_eq!(bowl.intersect(&down).unwrap().t, 6.0);
/// // A quarter of a pipe, lifted.
/// let gutter = Quadric::cylinder(2.0, 0.0, 3.0)?.swept(0.0, PI / 2.0)?;
/// let lifted = Instance::new(gutter, Transform::translation(DVec3::new(0.0, 0.0, 10.0)));
/// assert_eq!(lifted.intersect(&Ray::new(Vec3A::new(0.0, 0.0, 11.0), Vec3A::new(0.6, 0.8, 0.0))).unwrap().t, 2.0);
/// assert!(!lifted.intersect_p(&Ray::new(Vec3A::new(0.0, 0.0, 11.0), Vec3A::NEG_X)));
/// # Ok::<(), rt_shapes::QuadricError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Quadric {
    kind: Kind,
    z: [f64; 2],
    angles: [f64; 2],
    sweep: Option<Sweep>,
    extent: Extent,
    /// The third and fourth square at the anchor, and how they grow with z.
    at_anchor: [DoubleDouble; 2],
    grows: [DoubleDouble; 2],
    third: f64,
    slope: DoubleDouble,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Sphere { radius: f64 },
    Cylinder { radius: f64 },
    Cone { height: f64, radius: f64 },
    Paraboloid { height: f64, radius: f64 },
    Hyperboloid { from: DVec3, to: DVec3 },
}

fn positive(radius: f64) -> Result<f64, QuadricError> {
    if radius > 0.0 && radius <= LARGEST { Ok(radius) } else { Err(QuadricError::Radius(radius)) }
}

/// One over the power of two next to a size: a unit in which products of sizes stay in range.
fn reciprocal(size: f64) -> f64 {
    1.0 / f64::from_bits((size.to_bits() >> 52).clamp(30, 2000) << 52)
}

/// The length, where squares may leave the range of `f64`.
fn length(p: DVec2) -> f64 {
    p.x.hypot(p.y)
}

fn range(min: f64, max: f64) -> Result<[f64; 2], QuadricError> {
    let large = min.abs().max(max.abs()).max(max - min);
    if min < max && large <= LARGEST { Ok([min, max]) } else { Err(QuadricError::Range { min, max }) }
}

impl Quadric {
    /// The sphere of a radius around the origin.
    ///
    /// # Errors
    ///
    /// When the radius is not finite and positive.
    pub fn sphere(radius: f64) -> Result<Quadric, QuadricError> {
        let radius = positive(radius)?;
        Ok(Quadric::new(Kind::Sphere { radius }, [-radius, radius]))
    }

    /// The side of the cylinder of a radius between two heights.
    ///
    /// # Errors
    ///
    /// When the radius is not finite and positive, or the range of heights empty, inverted or not finite.
    pub fn cylinder(radius: f64, z_min: f64, z_max: f64) -> Result<Quadric, QuadricError> {
        Ok(Quadric::new(Kind::Cylinder { radius: positive(radius)? }, range(z_min, z_max)?))
    }

    /// The side of the cone from a circle of a radius at height 0 to its apex at a height.
    ///
    /// # Errors
    ///
    /// When one of them is not finite and positive.
    pub fn cone(height: f64, radius: f64) -> Result<Quadric, QuadricError> {
        if !(height > 0.0 && height <= LARGEST) {
            return Err(QuadricError::Height(height));
        }
        Ok(Quadric::new(Kind::Cone { height, radius: positive(radius)? }, [0.0, height]))
    }

    /// The paraboloid with its vertex in the origin that has a radius at the upper one of two heights.
    ///
    /// # Errors
    ///
    /// When the radius is not finite and positive, or the range of heights empty, inverted, not finite or partly below 0.
    pub fn paraboloid(radius: f64, z_min: f64, z_max: f64) -> Result<Quadric, QuadricError> {
        let (radius, z) = (positive(radius)?, range(z_min, z_max)?);
        if z_min < 0.0 {
            return Err(QuadricError::Range { min: z_min, max: z_max });
        }
        Ok(Quadric::new(Kind::Paraboloid { height: z_max, radius }, z))
    }

    /// What the segment between two points sweeps out about the z axis: in general a hyperboloid of one sheet, with its waist at
    /// any height; a cone where the segment's line meets the axis, a cylinder where it is parallel to it.
    ///
    /// Angles count from the segment, so that a part of a turn is bounded by two rulings. `v` is 0 at the lower point, whichever
    /// comes first.
    ///
    /// # Errors
    ///
    /// When a point is not finite, both are at the same height (which makes a [`Disk`](crate::Disk)), or both lie on the axis.
    pub fn hyperboloid(p: DVec3, q: DVec3) -> Result<Quadric, QuadricError> {
        for point in [p, q] {
            if !(point.abs().max_element() <= LARGEST && point.is_finite()) {
                return Err(QuadricError::Point(point));
            }
        }
        let (from, to) = if p.z < q.z { (p, q) } else { (q, p) };
        let z = range(from.z, to.z)?;
        if from.truncate() == DVec2::ZERO && to.truncate() == DVec2::ZERO {
            return Err(QuadricError::Radius(0.0));
        }
        Ok(Quadric::new(Kind::Hyperboloid { from, to }, z))
    }

    /// Only the part between two heights; beyond those it has, it has nothing.
    ///
    /// # Errors
    ///
    /// When nothing with an extent is left, or a height is NaN.
    pub fn cut(self, z_min: f64, z_max: f64) -> Result<Quadric, QuadricError> {
        let z = [self.z[0].max(z_min), self.z[1].min(z_max)];
        if z_min.is_nan() || z_max.is_nan() || z[0] >= z[1] {
            return Err(QuadricError::Range { min: z_min, max: z_max });
        }
        let cut = Quadric::new(self.kind, z);
        Ok(Quadric { angles: self.angles, sweep: self.sweep, ..cut })
    }

    /// Only the part from one angle counter-clockwise to another, in radians from the x axis (of a hyperboloid: from its segment);
    /// at most a full turn. Both ends belong to it.
    ///
    /// # Errors
    ///
    /// When the range is empty, or narrower than rounding, inverted, not finite, more than a turn, or an angle is beyond `2^20` either
    /// way: the rounding of such is no small angle.
    pub fn swept(self, from: f64, to: f64) -> Result<Quadric, QuadricError> {
        Ok(Quadric { angles: [from, to], sweep: Sweep::new([from, to])?, ..self })
    }

    fn new(kind: Kind, z: [f64; 2]) -> Quadric {
        let wide = DoubleDouble::from;
        let zero = wide(0.0);
        // Where z counts from: where what is squared has its least numbers.
        let (anchor, at_anchor, grows, third, slope) = match kind {
            Kind::Sphere { radius } => (0.0, [zero, wide(radius)], [wide(1.0), zero], 1.0, zero),
            Kind::Cylinder { radius } => (z[0], [zero, wide(radius)], [zero, zero], 1.0, zero),
            Kind::Cone { height, radius } => {
                let by = reciprocal(height.max(radius));
                (height, [zero, zero], [zero, wide(radius * by) / wide(height * by)], 1.0, zero)
            }
            Kind::Paraboloid { height, radius } => {
                let by = reciprocal(height.max(radius));
                let slope = wide(radius * by) / wide(height * by) * wide(radius * by) / wide(by);
                (0.0, [zero, zero], [zero, zero], 1.0, slope)
            }
            Kind::Hyperboloid { from, to } => {
                let by = reciprocal(from.abs().max(to.abs()).max_element());
                let difference = |i: usize| DoubleDouble::difference(to[i] * by, from[i] * by);
                let grows = [0, 1].map(|i| difference(i) / difference(2));
                (from.z, [wide(from.x), wide(from.y)], grows, -1.0, zero)
            }
        };
        let half = 0.5 * (z[1] - z[0]);
        let quadric = Quadric {
            kind,
            z,
            angles: [0.0, TAU],
            sweep: None,
            extent: Extent {
                anchor: DVec3::new(0.0, 0.0, anchor),
                middle: DVec3::new(0.0, 0.0, z[0] - anchor + half),
                radius: 0.0,
                gain: grows.iter().fold(1.0, |m, x| m.max(x.value().abs())),
                constant: at_anchor.iter().fold(0.0, |m, x| m.max(x.value().abs())),
                limits: z.map(|z| DoubleDouble::difference(z, anchor)),
            },
            at_anchor,
            grows,
            third,
            slope,
        };
        let radius = half.hypot(quadric.radii()[1]) * (1.0 + 16.0 * f64::EPSILON);
        Quadric { extent: Extent { radius, ..quadric.extent }, ..quadric }
    }

    /// Both roots of the whole line on the surface, the lesser first, whatever their sign.
    pub fn roots(&self, origin: DVec3, dir: DVec3) -> [Option<Root>; 2] {
        solve::roots(self, origin, dir)
    }

    /// The heights between which it lies.
    pub fn heights(&self) -> [f64; 2] {
        self.z
    }

    /// The angles between which it lies, in radians.
    pub fn angles(&self) -> [f64; 2] {
        self.angles
    }

    /// The point of the generating curve at a height: the curve at the angle 0.
    fn generator(&self, z: f64) -> DVec2 {
        match self.kind {
            Kind::Sphere { radius } => DVec2::new(((radius - z) * (radius + z)).max(0.0).sqrt(), 0.0),
            Kind::Cylinder { radius } => DVec2::new(radius, 0.0),
            Kind::Cone { height, radius } => DVec2::new(radius * ((height - z) / height), 0.0),
            Kind::Paraboloid { height, radius } => DVec2::new(radius * (z / height).max(0.0).sqrt(), 0.0),
            Kind::Hyperboloid { from, to } => {
                // From the nearer end, so that both ends are exact.
                let (a, b) = if z - from.z < to.z - z { (from, to) } else { (to, from) };
                a.truncate() + (b - a).truncate() * ((z - a.z) / (b.z - a.z))
            }
        }
    }

    /// The least and the greatest distance from the axis, up to rounding.
    fn radii(&self) -> [f64; 2] {
        let [a, b] = self.z.map(|z| length(self.generator(z)));
        let middle = match self.kind {
            Kind::Sphere { radius } if self.z[0] <= 0.0 && self.z[1] >= 0.0 => radius,
            _ => a,
        };
        [a.min(b), a.max(b).max(middle)]
    }

    /// The area, of a sweep by its angles as given. Relative error below `2^-45`.
    pub fn area(&self) -> f64 {
        (self.angles[1] - self.angles[0]) * self.strip(self.z[1])
    }

    /// The area from the lowest height to `z`, for each radian.
    fn strip(&self, z: f64) -> f64 {
        let (low, rise) = (self.z[0], z - self.z[0]);
        match self.kind {
            Kind::Sphere { radius } | Kind::Cylinder { radius } => radius * rise,
            Kind::Cone { height, radius } => {
                let slant = radius.hypot(height) / height;
                0.5 * (self.generator(low).x + self.generator(z).x) * rise * slant
            }
            Kind::Paraboloid { height, radius } => {
                // With g = r^2 / h: the integral of sqrt(g z + g^2 / 4), as (x - y)(x^2 + x y + y^2) / (x^1.5 + y^1.5).
                let g = radius / height * radius;
                let [x, y] = [z, low].map(|z| g * (z + 0.25 * g));
                let cubes = x * x.sqrt() + y * y.sqrt();
                2.0 / 3.0 * rise * (x * x + x * y + y * y) / cubes
            }
            Kind::Hyperboloid { .. } => self.ruled_strip(z),
        }
    }

    /// The integral over z of `sqrt(rho^2 + (g . m)^2)`, where the generator `g` moves by `m` for each unit of z: with `s = g . m`,
    /// which moves by `m . m`, that of `sqrt(a s^2 + c)`; `rho^2 = (s^2 + twist^2) / m . m`.
    fn ruled_strip(&self, z: f64) -> f64 {
        let rise = z - self.z[0];
        let m = DVec2::new(self.grows[0].value(), self.grows[1].value());
        let [g0, g1] = [self.z[0], z].map(|z| self.generator(z));
        let (turn, twist) = (m.length_squared(), g0.perp_dot(m));
        if turn < f64::MIN_POSITIVE {
            return rise * g0.length();
        }
        let (a, c) = ((1.0 + turn) / turn, twist * twist / turn);
        let [s0, s1] = [g0, g1].map(|g| g.dot(m));
        let root = |s: f64| (a * s * s + c).sqrt();
        let shape = |x: f64| (1.0 + x * x).sqrt();
        let scale = ((1.0 + turn) / (twist * twist)).sqrt();
        let (x0, x1) = (s0 * scale, s1 * scale);
        // The primitive is s sqrt(a s^2 + c) / 2 + c / (2 sqrt a) asinh(s sqrt(a / c)); its difference without cancellation.
        let (line, bend) = if s0 * s1 > 0.0 {
            let both = rise * (s0 + s1);
            (
                both * (a * (s0 * s0 + s1 * s1) + c) / (s1 * root(s1) + s0 * root(s0)),
                (turn * both * scale * scale / (x1 * shape(x0) + x0 * shape(x1))).asinh() / turn,
            )
        } else {
            ((s1 * root(s1) - s0 * root(s0)) / turn, (x1.asinh() - x0.asinh()) / turn)
        };
        let bend = if twist == 0.0 || !bend.is_finite() { 0.0 } else { bend * c / a.sqrt() };
        0.5 * (line + bend)
    }

    /// A point of the surface for two numbers from 0 to 1: uniform by area if they are uniform, at density `1 / area`. Numbers
    /// outside are moved to the nearest inside, NaN to 0.
    pub fn sample(&self, xi: DVec2) -> Surface {
        let xi = unit(xi);
        let [low, high] = self.z;
        let share = xi.y;
        let z = match self.kind {
            Kind::Sphere { .. } | Kind::Cylinder { .. } => low + (high - low) * share,
            // The area grows with z: halve until it fits. The density is continuous, so sixty steps leave nothing.
            _ => {
                let goal = share * self.strip(high);
                let (mut a, mut b) = (low, high);
                for _ in 0..60 {
                    let middle = 0.5 * (a + b);
                    if self.strip(middle) < goal { a = middle } else { b = middle }
                }
                0.5 * (a + b)
            }
        };
        let turn = direction(self.angles[0] + (self.angles[1] - self.angles[0]) * xi.x);
        let p = self.generator(z).rotate(turn).extend(z);
        surface::of(self, p - self.extent.anchor, |w| self.uv(w))
    }

    /// `p` beside the generator at its height: the direction that angles are counted by.
    fn beside(&self, p: DVec3) -> DVec2 {
        match self.kind {
            Kind::Hyperboloid { .. } => {
                let g = self.generator(p.z);
                DVec2::new(g.dot(p.truncate()), g.perp_dot(p.truncate()))
            }
            _ => p.truncate(),
        }
    }

    fn uv(&self, w: DVec3) -> DVec2 {
        let p = w + self.extent.anchor;
        let v = match self.kind {
            Kind::Sphere { .. } => {
                let [low, high] = self.polar();
                (p.truncate().length().atan2(p.z) - low) / (high - low)
            }
            _ => (p.z - self.z[0]) / (self.z[1] - self.z[0]),
        };
        DVec2::new(share(self.angles, self.beside(p)), v.clamp(0.0, 1.0))
    }

    /// Derivatives at a point of the surface.
    fn partials_at(&self, point: DVec3, normal: DVec3) -> Partials {
        let range = self.angles[1] - self.angles[0];
        let (rise, p) = (self.z[1] - self.z[0], point.truncate());
        let around = |v: DVec2| (v.perp() * range).extend(0.0);
        let rho = p.length();
        let out = p.try_normalize().unwrap_or(DVec2::X);
        let (dpdu, inward) = (around(p), (-p * (range * range)).extend(0.0));
        // The derivative along v, and the second one; that along both is the former turned.
        let (dpdv, bent) = match self.kind {
            Kind::Sphere { radius } => {
                let [low, high] = self.polar();
                let dpdv = (out * point.z).extend(-rho) * (high - low);
                // The normal is the point, over the radius: at the poles, too.
                return Partials { dpdu, dpdv, dndu: dpdu / radius, dndv: dpdv / radius };
            }
            Kind::Cylinder { .. } => (DVec3::Z * rise, DVec3::ZERO),
            Kind::Cone { height, radius } => ((out * (-radius / height)).extend(1.0) * rise, DVec3::ZERO),
            Kind::Paraboloid { height, radius } => {
                // rho = sqrt(g z), hence rho' = g / (2 rho).
                let grows = 0.5 * radius / height * radius / rho;
                if !grows.is_finite() {
                    return Partials { dpdu, ..Partials::default() };
                }
                let bent = out * (-grows * grows / rho * (rise * rise));
                ((out * grows).extend(1.0) * rise, bent.extend(0.0))
            }
            Kind::Hyperboloid { .. } => {
                let m = DVec2::new(self.grows[0].value(), self.grows[1].value());
                let turn = self.beside(point).try_normalize().unwrap_or(DVec2::X);
                (m.rotate(turn).extend(1.0) * rise, DVec3::ZERO)
            }
        };
        weingarten(dpdu, dpdv, [inward, around(dpdv.truncate()), bent], normal)
    }

    /// The angles from the pole at the lower and the upper end of a sphere.
    fn polar(&self) -> [f64; 2] {
        self.z.map(|z| self.generator(z).x.atan2(z))
    }
}

impl Form for Quadric {
    #[inline(always)]
    fn extent(&self) -> &Extent {
        &self.extent
    }
    #[inline(always)]
    fn signs(&self) -> [f64; 4] {
        [1.0, 1.0, self.third, -1.0]
    }
    #[inline(always)]
    fn slope(&self) -> DoubleDouble {
        self.slope
    }
    #[inline(always)]
    fn linear<T: Number>(&self, w: [T; 3]) -> Terms<T> {
        let grows = self.grows.map(T::wide);
        Terms { squares: [w[0], w[1], grows[0] * w[2], grows[1] * w[2]], axial: w[2] }
    }
    #[inline(always)]
    fn constants<T: Number>(&self) -> [T; 4] {
        let [a, b] = self.at_anchor.map(T::wide);
        [T::from(0.0), T::from(0.0), a, b]
    }
    fn transposed(&self, weights: [f64; 4], axial: f64) -> DVec3 {
        let up = weights[2] * self.grows[0].value() + weights[3] * self.grows[1].value() + axial;
        DVec3::new(weights[0], weights[1], up)
    }
    #[inline(always)]
    fn sweep(&self) -> Option<&Sweep> {
        self.sweep.as_ref()
    }
    #[inline(always)]
    fn twisted(&self) -> bool {
        matches!(self.kind, Kind::Hyperboloid { .. })
    }
    fn scaled(&self, by: f64) -> Quadric {
        let times = |x: DoubleDouble| x * DoubleDouble::from(by);
        // The kind and the heights serve the surface record only, which is not asked of this copy.
        Quadric {
            extent: self.extent.scaled(by),
            at_anchor: self.at_anchor.map(times),
            slope: times(self.slope),
            ..self.clone()
        }
    }
}

impl WorldBound for Quadric {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }

    /// Exact up to rounding, also of parts of a turn: the ends of arcs, and where they run along an axis.
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let sweep = self.sweep.as_ref();
        let (least, most) = (1.0 - 8.0 * f64::EPSILON, 1.0 + 8.0 * f64::EPSILON);
        let arcs = match self.kind {
            // Along a ruling coordinates are linear: the ends say all.
            Kind::Hyperboloid { .. } => self.z.map(|z| {
                let g = self.generator(z);
                // At its own ends the generator is exact, and its length too beside the x or y axis.
                let exact = matches!(self.kind, Kind::Hyperboloid { from, to } if z == from.z || z == to.z);
                let exact = exact && (g.x == 0.0 || g.y == 0.0);
                let radius = if exact { length(g) } else { length(g) * most };
                if g == DVec2::ZERO { [DVec2::ZERO; 2] } else { arc(sweep, g, radius) }
            }),
            // At each angle the distance from the axis takes all values between the least and the greatest.
            Kind::Sphere { radius }
            | Kind::Cylinder { radius }
            | Kind::Cone { radius, .. }
            | Kind::Paraboloid { radius, .. } => {
                let [low, high] = self.radii();
                let high = if high == radius { high } else { (high * most).min(radius) };
                [arc(sweep, DVec2::X, low * least), arc(sweep, DVec2::X, high)]
            }
        };
        let (min, max) = (arcs[0][0].min(arcs[1][0]), arcs[0][1].max(arcs[1][1]));
        Aabb::from_f64(min.extend(self.z[0]), max.extend(self.z[1]), origin)
    }
}

impl<R: Real> Primitive<R> for Quadric {
    type At = Uv;

    #[inline]
    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        solve::closest(self, ray)
    }
    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        solve::hits(self, ray, |t| each(Hit { t, at: Uv::default() }))
    }
}

impl<R: Real> Shape<R> for Quadric {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        surface::of(self, surface::offset(self, ray, hit.t), |w| self.uv(w))
    }

    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let Surface { point, normal, .. } = self.surface(ray, hit);
        self.partials_at(point, normal)
    }
}

//! Whether boxes meet cones and beams: [`ConeTest`] and [`BeamTest`].

use crate::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Beam, Cone, unit};

/// A cone made ready, once, to be tested against boxes.
///
/// Never misses a box that meets the exact cone. Says *met* wrongly only within `64 u` of the distance between the
/// cone's origin and the far side of the box, `u = 2^-53`, and for boxes that are infinite (where it may say *met*
/// always, except that a cone of finite length is as exact as ever). Empty and invalid boxes meet nothing.
///
/// How far a point lies outside the mantle is a convex function up to a right angle, so its least value over the box,
/// cut to the cone's range, is taken where the axis pierces a face or somewhere on an edge, in closed form; beyond a
/// right angle the function is concave and the corners tell. All of it is written so that what is computed is right for
/// a cone and a range that differ by some roundings from the given one, and so differs by no more than the `64 u` that
/// are added.
///
/// Cost: most boxes are decided by their middle (some 10 ns); the others by up to 12 edges (some 100 ns).
///
/// Source: after Eberly, *Intersection of a Box and a Cone or Cone Frustum* (2015), which enumerates the same features.
///
/// ```
/// use rt_bounds::{Aabb, ConeTest};
/// use rt_geom::{Cone, glam::{DVec3, Vec3A}};
/// let cone = ConeTest::new(&Cone::new(DVec3::ZERO, DVec3::Z, 0.5).unwrap());
/// let b = Aabb::new(Vec3A::new(0.5, 0.0, 0.5), Vec3A::new(1.5, 1.0, 1.0));
/// assert!(cone.meets(&b)); // its lower edge, at (0.5, 0, 1)
/// assert!(!cone.meets(&Aabb { min: b.min.with_x(0.6), ..b }));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ConeTest {
    cone: Cone,
    near: f64,
    far: f64,
    edges: [EdgeKind; 3],
}

/// What all edges along one axis share.
#[derive(Clone, Copy, Debug)]
struct EdgeKind {
    /// The direction of the edge, without its part along the cone's axis.
    across: DVec3,
    /// Its squared length.
    across2: f64,
    /// From the point of an edge nearest to the axis to where it is least outside, in units of the distance there;
    /// infinite where the edge only gets deeper.
    lead: f64,
}

impl ConeTest {
    /// Prepares `cone`.
    pub fn new(cone: &Cone) -> ConeTest {
        let (a, (sin, cos)) = (cone.axis(), cone.sin_cos());
        let edges = [0, 1, 2].map(|k| {
            let along = a[k];
            let mut across = a * -along;
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let across2 = a[i] * a[i] + a[j] * a[j];
            across[k] = across2;
            let (steep, drop) = (cos * across2.sqrt(), sin * along.abs());
            let lead = if drop == 0.0 {
                0.0
            } else if steep > drop {
                // The squares in factors: right to some roundings of steep and drop.
                drop / (across2.sqrt() * ((steep - drop) * (steep + drop)).sqrt())
            } else {
                f64::INFINITY
            };
            EdgeKind { across, across2, lead: lead.copysign(along) }
        });
        let [near, far] = cone.range();
        ConeTest { cone: *cone, near, far, edges }
    }

    /// Whether a box, in the space of the cone, meets it.
    pub fn meets(&self, b: &Aabb) -> bool {
        if !b.is_valid() {
            return false;
        }
        let (mut lo, mut hi) = (b.min.as_dvec3() - self.cone.origin(), b.max.as_dvec3() - self.cone.origin());
        if !(lo.is_finite() && hi.is_finite()) {
            let Some(reach) = self.reach() else { return true };
            (lo, hi) = (lo.max(DVec3::splat(-reach)), hi.min(DVec3::splat(reach)));
            if lo.cmpgt(hi).any() {
                return false;
            }
        }
        let (middle, half) = ((lo + hi) * 0.5, (hi - lo) * 0.5);
        let slack = ((middle.abs() + half).element_sum() + self.cone.radius()) * (32.0 * f64::EPSILON);
        let (near, far) = (self.near - slack, self.far + slack);
        let axis = self.cone.axis();
        let (t, extent) = (middle.dot(axis), half.dot(axis.abs()));
        if t + extent < near || t - extent > far || near > far {
            return false;
        }
        let outside = self.cone.outside(middle);
        if outside <= 0.0 && near <= t && t <= far {
            return true;
        }
        if outside > half.length() + slack {
            return false;
        }
        let inside = |p: DVec3| self.cone.outside(p) <= slack;
        // From beyond the range of f64.
        if !(outside.is_finite() && slack.is_finite()) {
            return true;
        }
        let convex = self.cone.sin_cos().1 > 0.0;
        if convex && self.pierced(lo, hi, near, far).is_some_and(|t| inside(axis * t)) {
            return true;
        }
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            for corner in 0..4 {
                let mut p = lo;
                p[i] = if corner & 1 == 0 { lo[i] } else { hi[i] };
                p[j] = if corner & 2 == 0 { lo[j] } else { hi[j] };
                let t = p.dot(axis);
                // The part of the edge within the range.
                let (mut start, mut end) = (0.0, hi[k] - lo[k]);
                if axis[k] != 0.0 {
                    let (x, y) = ((near - t) / axis[k], (far - t) / axis[k]);
                    (start, end) = (x.min(y).max(start), x.max(y).min(end));
                } else if t < near || t > far {
                    continue;
                }
                if start > end {
                    continue;
                }
                let along = |s: f64| {
                    let mut q = p;
                    q[k] = lo[k] + s;
                    q
                };
                if convex {
                    if inside(along(self.edges[k].deepest(p - axis * t).clamp(start, end))) {
                        return true;
                    }
                } else if inside(along(start)) || inside(along(end)) {
                    return true;
                }
            }
        }
        convex && [near, far].into_iter().any(|t| t.is_finite() && self.section(t, lo, hi, &inside))
    }

    /// The last point of the axis within the box and the range.
    fn pierced(&self, lo: DVec3, hi: DVec3, near: f64, far: f64) -> Option<f64> {
        let axis = self.cone.axis();
        let (mut first, mut last) = (near, far);
        for k in 0..3 {
            if axis[k] == 0.0 {
                if lo[k] > 0.0 || hi[k] < 0.0 {
                    return None;
                }
                continue;
            }
            let (x, y) = (lo[k] / axis[k], hi[k] / axis[k]);
            (first, last) = (first.max(x.min(y)), last.min(x.max(y)));
        }
        (first <= last).then_some(last)
    }

    /// Whether the disc of the cone at distance `t` meets the outline of the section of the box there: for each face,
    /// the point of the section's edge nearest to the axis.
    fn section(&self, t: f64, lo: DVec3, hi: DVec3, inside: &impl Fn(DVec3) -> bool) -> bool {
        let axis = self.cone.axis();
        let center = axis * t;
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let (a, b) = (axis[i], axis[j]);
            let square = a * a + b * b;
            if square == 0.0 {
                continue; // The face lies along the section, and its edges tell.
            }
            for face in [lo[k], hi[k]] {
                let off = (t - face * axis[k] - center[i] * a - center[j] * b) / square;
                let foot = [center[i] + a * off, center[j] + b * off];
                // Along (-b, a) from the foot.
                let (mut start, mut end) = (f64::NEG_INFINITY, f64::INFINITY);
                for (x, step, axis) in [(foot[0], -b, i), (foot[1], a, j)] {
                    if step != 0.0 {
                        let (s, e) = ((lo[axis] - x) / step, (hi[axis] - x) / step);
                        (start, end) = (start.max(s.min(e)), end.min(s.max(e)));
                    } else if x < lo[axis] || x > hi[axis] {
                        (start, end) = (1.0, 0.0);
                    }
                }
                if start > end {
                    continue;
                }
                let s = 0.0f64.clamp(start, end);
                let mut p = DVec3::ZERO;
                (p[k], p[i], p[j]) = (face, foot[0] - b * s, foot[1] + a * s);
                if inside(p) {
                    return true;
                }
            }
        }
        false
    }

    /// No point of the cone is farther from the origin; `None` if there is no end to it.
    fn reach(&self) -> Option<f64> {
        let [near, far] = self.cone.range();
        let width = self.cone.radius_at(near.abs().max(far.abs()));
        let reach = (near.abs().max(far.abs()) + width) * (1.0 + 1e-12);
        reach.is_finite().then_some(reach)
    }
}

impl EdgeKind {
    /// Where an edge is least outside the mantle: from its start, which is `p` without the part along the cone's axis.
    fn deepest(&self, p: DVec3) -> f64 {
        if self.across2 == 0.0 {
            return self.lead;
        }
        let nearest = -p.dot(self.across) / self.across2;
        if self.lead.is_infinite() {
            return self.lead;
        }
        nearest + self.lead * (p + self.across * nearest).length()
    }
}

/// A beam made ready, once, to be tested against boxes.
///
/// Never misses a box that meets the exact beam, the set between its [corner rays](Beam::corners). Says *met* wrongly
/// only within some `32 u` of the distances involved. Empty and invalid boxes meet nothing.
///
/// By separating directions, which are all tried: of the faces of both, and across each pair of edges. First the beam
/// is cut to the depths of the box, so that no direction is spoilt by what happens to its rounding far away.
///
/// Cost: two dot products a direction, up to some 40 for a beam of four sides; most boxes are decided within the first
/// 8.
///
/// Source: Gottschalk, *Separating axis theorem* (1996); the choice of directions after Greene, "Detecting intersection
/// of a rectangular solid and a convex polyhedron", Graphics Gems IV (1994), which tries fewer of them.
///
/// ```
/// use rt_bounds::{Aabb, BeamTest};
/// use rt_geom::{Beam, glam::{DVec3, Vec3A}};
/// let window = [[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]].map(DVec3::from_array);
/// let beam = BeamTest::new(&Beam::from_apex(DVec3::ZERO, &window).unwrap());
/// let b = Aabb::new(Vec3A::new(3.0, 0.0, 2.0), Vec3A::new(4.0, 1.0, 3.0));
/// assert!(beam.meets(&b)); // along an edge
/// assert!(!beam.meets(&Aabb { min: b.min.with_x(3.001), ..b }));
/// ```
#[derive(Clone, Debug)]
pub struct BeamTest {
    /// What the boxes are taken relative to.
    origin: DVec3,
    depth: DVec3,
    near: f64,
    far: f64,
    /// The box's faces, the beam's, then the pairs of edges.
    directions: Vec<Extent>,
    /// How many of them belong to faces.
    faces: usize,
    /// The greatest size of an origin, and of a direction, of the corner rays.
    size: [f64; 2],
}

/// How far a beam goes along a direction: at depth `s`, from `origin[0] + s dir[0]` to `origin[1] + s dir[1]`.
#[derive(Clone, Copy, Debug)]
struct Extent {
    direction: DVec3,
    origin: [f64; 2],
    dir: [f64; 2],
}

impl BeamTest {
    /// Prepares `beam`. Cost: microseconds.
    pub fn new(beam: &Beam) -> BeamTest {
        let corners = beam.corners();
        let origin = corners[0].origin;
        let extent = |direction: DVec3| {
            let (mut o, mut d) = ([f64::INFINITY, f64::NEG_INFINITY], [f64::INFINITY, f64::NEG_INFINITY]);
            for c in corners {
                let (x, y) = (direction.dot(c.origin - origin), direction.dot(c.dir));
                (o, d) = ([o[0].min(x), o[1].max(x)], [d[0].min(y), d[1].max(y)]);
            }
            Extent { direction, origin: o, dir: d }
        };
        let mut directions: Vec<Extent> = DVec3::AXES.into_iter().map(extent).collect();
        directions.extend(beam.sides().map(|(normal, _)| extent(normal)));
        let faces = directions.len();
        let [near, far] = beam.range();
        let n = corners.len();
        let parallel = corners.iter().all(|c| c.dir == corners[0].dir);
        let arms = corners.iter().map(|c| c.dir).take(if parallel { 1 } else { n });
        // From an apex to infinity there are no other edges.
        let rims = if parallel || near > 0.0 || far < f64::INFINITY { n } else { 0 };
        let section = |i: usize| corners[i % n].origin + corners[i % n].dir;
        let rims = (0..rims).map(|i| section(i + 1) - section(i));
        for edge in arms.chain(rims) {
            // Any direction may be tried; those that rounding leaves nothing of decide nothing.
            directions.extend(DVec3::AXES.into_iter().filter_map(|axis| unit(axis.cross(edge))).map(extent));
        }
        let greatest = |v: fn(&rt_geom::Ray<f64>, DVec3) -> DVec3| {
            corners.iter().fold(0.0f64, |m, c| m.max(v(c, origin).abs().element_sum()))
        };
        let size = [greatest(|c, o| c.origin - o), greatest(|c, _| c.dir)];
        BeamTest { origin, depth: beam.depth(), near, far, directions, faces, size }
    }

    /// Whether a box, in the space of the beam, meets it.
    pub fn meets(&self, b: &Aabb) -> bool {
        const ROUNDINGS: f64 = 16.0 * f64::EPSILON;
        if !b.is_valid() {
            return false;
        }
        let (lo, hi) = (b.min.as_dvec3() - self.origin, b.max.as_dvec3() - self.origin);
        // Infinite sides do not round.
        let finite = |v: DVec3| v.to_array().map(|x| if x.is_finite() { x.abs() } else { 0.0 });
        let reach = DVec3::from_array(finite(lo)).max(DVec3::from_array(finite(hi))).element_sum();
        // The depths of the box. A corner's direction has depth 1 but for rounding.
        let [first, last] = span(self.depth, lo, hi);
        let slack = reach * self.depth.abs().max_element() * ROUNDINGS;
        let unsure = self.depth.abs().max_element() * self.size[1] * ROUNDINGS;
        let (first, last) = (first - slack, last + slack);
        if last < 0.0 || unsure >= 0.5 {
            return last >= 0.0;
        }
        let (near, far) = (self.near.max(first / (1.0 + unsure)), self.far.min(last / (1.0 - unsure)));
        if near > far {
            return false;
        }
        // Where there is no end, a direction that seems to go along the beam may lead out of it by rounding.
        let (end, tilt) = if far < f64::INFINITY { (far, 0.0) } else { (near, self.size[1] * ROUNDINGS) };
        let slack = (reach + self.size[0] + end * self.size[1]) * ROUNDINGS;
        let middle = (lo + hi) * 0.5;
        let mut holds_middle = middle.is_finite() && {
            let depth = middle.dot(self.depth);
            self.near <= depth && depth <= self.far
        };
        for (i, e) in self.directions.iter().enumerate() {
            if i == self.faces && holds_middle {
                return true;
            }
            let [first, last] = span(e.direction, lo, hi);
            let least = e.origin[0] + (near * e.dir[0]).min(far * (e.dir[0] - tilt));
            let most = e.origin[1] + (near * e.dir[1]).max(far * (e.dir[1] + tilt));
            // NaN, from beyond the range, decides nothing.
            if last < least - slack || first > most + slack {
                return false;
            }
            if i >= 3 && i < self.faces {
                holds_middle &= middle.dot(e.direction) <= e.origin[1];
            }
        }
        true
    }
}

/// How far a box goes along a direction. A side at infinity counts unless the direction is exactly across it.
#[inline]
fn span(direction: DVec3, lo: DVec3, hi: DVec3) -> [f64; 2] {
    let (mut first, mut last) = (0.0, 0.0);
    for a in 0..3 {
        let d = direction[a];
        if d != 0.0 {
            let (x, y) = (lo[a] * d, hi[a] * d);
            first += x.min(y);
            last += x.max(y);
        }
    }
    [first, last]
}

//! [`Polytope`]: a box and further planes around points.

use super::{Hull, extreme, scaled, without_inner};
use crate::{Aabb, BoundingVolume, Kdop, KdopRay, solid, solid::Solid};
use rt_geom::expansion::Expansion;
use rt_geom::glam::{DVec3, Vec4};
use rt_geom::{Ray, Real, Vector, f32_above};

/// Beyond this size a coordinate of the ray's origin says nothing: sums of three products stay finite.
const FAR: f64 = (1u128 << 124) as f64;
/// Planes further off than this are left out.
const REACH: f64 = (1u128 << 127) as f64;
/// Added to offsets, so that a product that underflows is still rounded outward.
const STEP: f64 = 1.0 / (1u128 << 120) as f64;
/// Eight roundings of `f32`.
const ROUNDINGS: f64 = 8.0 / (1u64 << 24) as f64;
/// Added to a support in `f64`, for products that underflow.
const TINY: f64 = f64::from_bits((1023 - 900) << 52);
/// The planes of [`Polytope`]'s `around`, box included.
const AROUND: usize = 32;
/// With more points than this left, `around` looks at the extreme ones in as many directions only: see [`lattice`].
const MANY: usize = 602;

/// A convex volume between planes: the six of a box, and as many others as asked for.
///
/// A plane is four `f32`: the points `x` with `n . x <= d`, relative to the `origin` that the polytope was made with. The
/// largest component of `n` is 1 or -1. Each `d` is the support of all points along the stored `n`, rounded up, hence every
/// point is inside in exact arithmetic, whatever the normals: the choice of normals decides only how tight it is. The box
/// makes every polytope bounded and rejects most rays for the price of a slab test; the other planes follow in the order in
/// which they cut the most area.
///
/// `24 + 16 (K - 6)` bytes of planes, rounded up to groups of four.
///
/// Source: Haines, "Fast ray-convex polyhedron intersection", Graphics Gems II (1991), after Cyrus and Beck (1978).
///
/// ```
/// use rt_bounds::{BoundingVolume, Hull, Polytope};
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
///
/// let octahedron = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
/// let hull = Hull::new(&octahedron).unwrap();
/// let polytope = hull.polytope(DVec3::ZERO);
/// assert_eq!(polytope.plane_count(), 6 + 8);
/// // Beside an edge, in the box.
/// let ray = Ray::new(Vec3A::new(0.6, 0.6, -3.0), Vec3A::Z);
/// assert!(polytope.entry(&Polytope::ready(&ray, DVec3::ZERO, &polytope.aabb())).is_none());
/// // Four planes more than the box leave 2/3 of its area.
/// let coarse = hull.reduced(10, DVec3::ZERO);
/// assert!(coarse.plane_count() == 10 && coarse.surface_area() < 20.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Polytope {
    bounds: Kdop<6>,
    blocks: Vec<Block>,
    count: usize,
    area: f64,
}

/// Four planes, component by component. The last ones may be open: normal 0, offset infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    n: [[f32; 4]; 3],
    d: [f32; 4],
}

impl Hull {
    /// The volume between the planes of all facets and those of the box, relative to `origin`.
    ///
    /// The facets come by falling area. Of a flat hull each edge gives a plane too; points on a line are fenced in by six
    /// planes. It is larger than the hull only by the rounding of planes to `f32`.
    ///
    /// Cost: `O(F (V + F))` for the offsets of `F` planes over `V` corners and for the area: 0.1 s for 2000
    /// facets, 2 s for 10^4.
    pub fn polytope(&self, origin: DVec3) -> Polytope {
        Polytope::between(self.directions(), self, None, self.corners(), origin)
    }

    /// The volume between at most `k` planes, those of the box included: after these the planes that cut the most area, one
    /// after another. Fewer where no plane cuts anything more; the box alone for a `k` up to 6; all planes of
    /// [`polytope`](Hull::polytope), in its order, for a `k` that has room for them.
    ///
    /// Fewer than six are not offered: four planes of a tetrahedron take 16 floats and 8 dot products, the box 6 and none.
    ///
    /// Cost: after the hull, `O(F V)` for the planes of all facets, and some `k` trial cuts, each of `O(k)`, for each of the
    /// most promising: at worst `O(F k^2)`. With `k = 64` 0.05 s for 2000 facets and 1 s for 10^4, with
    /// `k` near the 10^4 a quarter of a minute.
    pub fn reduced(&self, k: usize, origin: DVec3) -> Polytope {
        let directions = self.directions();
        let limit = k.saturating_sub(6);
        let limit = (limit < directions.len()).then_some(limit);
        Polytope::between(directions, self, limit, self.corners(), origin)
    }

    /// Normals worth a plane: those of the facets by falling area, and of what bounds a flat hull sideways.
    fn directions(&self) -> Vec<DVec3> {
        let normals = self.normals();
        let at = self.corners();
        if at.len() == 1 {
            return Vec::new();
        }
        if normals.is_empty() {
            let along = unit(at[1] - at[0]);
            let side = unit(along.cross(if along.x.abs() < 0.5 { DVec3::X } else { DVec3::Y }));
            let other = along.cross(side);
            return vec![side, -side, other, -other, along, -along];
        }
        if let [n, _] = normals[..] {
            let facet = self.facets().next().unwrap_or_default();
            let edge = |i: usize| at[facet[(i + 1) % facet.len()] as usize] - at[facet[i] as usize];
            let sides = (0..facet.len()).map(|i| unit(unit(edge(i)).cross(n)));
            return normals.iter().copied().chain(sides).collect();
        }
        let area = |facet: &[u32]| {
            let first = at[facet[0] as usize];
            let corner = |i: u32| at[i as usize] - first;
            facet[1..].windows(2).map(|w| corner(w[0]).cross(corner(w[1]))).sum::<DVec3>().length()
        };
        let mut by_area: Vec<(f64, DVec3)> = self.facets().map(area).zip(normals).collect();
        by_area.sort_by(|a, b| b.0.total_cmp(&a.0));
        by_area.into_iter().map(|(_, n)| n).collect()
    }
}

/// A vector of length 1, or zero; without overflow or underflow.
fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize_or_zero()
}

impl Polytope {
    /// How many planes there are, the six of the box included.
    pub fn plane_count(&self) -> usize {
        6 + self.count
    }

    /// The planes as `[n.x, n.y, n.z, d]`: the points `x` with `n . x <= d`, relative to the origin. First the six of the box.
    pub fn planes(&self) -> impl Iterator<Item = [f32; 4]> {
        let side = |i: usize| {
            let (a, (lo, hi)) = (i / 2, self.bounds.extent(i / 2));
            let mut plane = [0.0; 4];
            (plane[a], plane[3]) = if i.is_multiple_of(2) { (-1.0, -lo) } else { (1.0, hi) };
            plane
        };
        (0..6).map(side).chain((0..self.count).map(|i| self.blocks[i / 4].plane(i % 4)))
    }

    /// Around `points`, with planes along some of `directions`: all, or as many as given, chosen by `hull`.
    fn between<V: Vector>(
        directions: Vec<DVec3>,
        hull: &Hull,
        limit: Option<usize>,
        points: &[V],
        origin: DVec3,
    ) -> Polytope {
        let bounds = Kdop::<6>::from_points(points.iter().copied(), origin);
        let mut polytope = Polytope { bounds, blocks: Vec::new(), count: 0, area: 0.0 };
        let b = bounds.aabb();
        let directions = directions.into_iter().filter_map(rounded);
        let chosen: Vec<[f32; 3]> = match limit {
            None => directions.collect(),
            Some(0) => Vec::new(),
            Some(count) => choose(&directions.collect::<Vec<_>>(), hull, &b, count, origin),
        };
        for n in chosen {
            let d = support(n, points, origin);
            if d.is_finite() {
                polytope.push(n, d);
            }
        }
        polytope.blocks.shrink_to_fit();
        polytope.area = if b.min.is_finite() && b.max.is_finite() {
            let planes = polytope.planes().skip(6).map(|[x, y, z, d]| {
                let n = DVec3::new(x as f64, y as f64, z as f64);
                (n.normalize(), d as f64 / n.length())
            });
            solid::area(b.min.as_dvec3(), b.max.as_dvec3(), planes)
        } else {
            f64::INFINITY
        };
        polytope
    }

    fn push(&mut self, n: [f32; 3], d: f32) {
        let lane = self.count % 4;
        if lane == 0 {
            self.blocks.push(Block { n: [[0.0; 4]; 3], d: [f32::INFINITY; 4] });
        }
        if let Some(block) = self.blocks.last_mut() {
            for a in 0..3 {
                block.n[a][lane] = n[a];
            }
            block.d[lane] = d;
        }
        self.count += 1;
    }
}

impl Block {
    fn plane(&self, lane: usize) -> [f32; 4] {
        [self.n[0][lane], self.n[1][lane], self.n[2][lane], self.d[lane]]
    }
}

/// A direction as a normal whose largest component is 1 or -1; `None` for one along an axis, which the box has.
fn rounded(n: DVec3) -> Option<[f32; 3]> {
    let n = (n / n.abs().max_element()).to_array().map(|x| x as f32 + 0.0);
    let crooked = n.iter().filter(|x| **x != 0.0).count() > 1;
    (crooked && n.iter().all(|x| x.is_finite())).then_some(n)
}

/// The least `f32` that is no less than `n . (p - origin)` for any point, in exact arithmetic; sometimes the next one where
/// coordinates are smaller than `2^-800`. Infinite beyond reach.
fn support<V: Vector>(n: [f32; 3], points: &[V], origin: DVec3) -> f32 {
    let normal = DVec3::from_array(n.map(f64::from));
    let (mut most, mut size) = (f64::NEG_INFINITY, 0.0f64);
    for p in points {
        let p = p.widen();
        most = most.max(normal.dot(p - origin));
        size = size.max((p.abs() + origin.abs()).element_sum());
    }
    // Five roundings, with components up to 1.
    let error = size * (8.0 * f64::EPSILON) + TINY;
    let (low, high) = (f32_above(most - error), f32_above(most + error));
    if most.is_nan() || most + error > REACH {
        return f32::INFINITY;
    }
    if low == high {
        return high;
    }
    let above_low = |p: &V| {
        let p = p.widen();
        normal.dot(p - origin) + error > low as f64 && exceeds(n, p, origin, low)
    };
    if points.iter().any(above_low) { high } else { low }
}

/// Whether `n . (p - origin) > d`, exactly; true where that cannot be told for the range of `f64`.
fn exceeds(n: [f32; 3], p: DVec3, origin: DVec3, d: f32) -> bool {
    let tiny = f64::from_bits((1023 - 800) << 52);
    let told = |x: f64| x == 0.0 || x.abs() >= tiny;
    if ![p, origin].iter().flat_map(|v| v.to_array()).all(told) {
        return true;
    }
    let term = |a: usize| Expansion::<2>::difference(p[a], origin[a]).scaled::<4>(n[a] as f64);
    let xy: Expansion<8> = term(0).plus(&term(1));
    let z: Expansion<5> = term(2).plus(&Expansion::<1>::new(-(d as f64)));
    xy.plus::<5, 13>(&z).sign() > 0
}

/// The normals of `count` planes that together leave little of the box.
///
/// First those that cut the most area, one after another. What a plane cuts only shrinks as others cut before it (nearly so),
/// so it is reckoned again only where it may be the most.
///
/// Tried and left out: taking three times as many planes and then dropping those missed least (areas as a rule
/// within 2 % either way, though 10 % apart was seen; a hundred times slower), and exchanging planes until nothing falls (areas at most 1 % less).
fn choose(normals: &[[f32; 3]], hull: &Hull, b: &Aabb, count: usize, origin: DVec3) -> Vec<[f32; 3]> {
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    let (middle, size) = (min * 0.5 + max * 0.5, (max * 0.5 - min * 0.5).max_element());
    if !(size > 0.0 && size.is_finite()) {
        return Vec::new();
    }
    let scaled = |p: DVec3| (p - middle) / size;
    let corners: Vec<DVec3> = hull.corners().iter().map(|p| scaled(*p - origin)).collect();
    let plane = |n: &[f32; 3]| {
        let n = DVec3::from_array(n.map(f64::from)).normalize();
        (n, corners.iter().fold(f64::NEG_INFINITY, |d, p| d.max(n.dot(*p))))
    };
    let planes: Vec<(DVec3, f64)> = normals.iter().map(plane).collect();
    let mut solid = Solid::cuboid(scaled(min), scaled(max));
    let mut gains: Vec<(f64, usize)> =
        planes.iter().map(|(n, d)| (solid.area() - solid.area_if_cut(*n, *d), 0)).collect();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count {
        let Some(i) = (0..gains.len()).max_by(|i, j| gains[*i].0.total_cmp(&gains[*j].0)) else { break };
        let ((n, d), area) = (planes[i], solid.area());
        // Less than the roundings of planes to `f32` is no gain.
        if gains[i].0.is_nan() || gains[i].0 <= area * 1e-9 {
            break;
        }
        if gains[i].1 < chosen.len() {
            gains[i] = (area - solid.area_if_cut(n, d), chosen.len());
            continue;
        }
        solid.cut(n, d);
        chosen.push(i);
        gains[i].0 = 0.0;
    }
    chosen.into_iter().map(|i| normals[i]).collect()
}

/// What a traversal derives from a ray, once, for polytopes: what it derives for their boxes, and the ray in `f32` with
/// bounds of its error.
///
/// Entries are distances as those of [`SlabRay`](crate::SlabRay). A ray that is not [valid](Ray::is_valid) meets nothing.
#[derive(Clone, Copy, Debug)]
pub struct PolytopeRay {
    axes: KdopRay<6>,
    /// The origin and the direction, each component four times.
    origin: [Vec4; 3],
    dir: [Vec4; 3],
    /// What `n . origin` and the roundings after it may be wrong by.
    reach: Vec4,
    /// What `n . dir` may be wrong by.
    turn: Vec4,
}

impl PolytopeRay {
    /// Prepares `ray` for polytopes given relative to `origin` that all lie in `world`, itself relative to `origin`.
    pub fn new<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> PolytopeRay {
        let axes = KdopRay::new(ray, origin, world);
        let (_, start, unit) = axes.scale();
        let (o, d) = (ray.origin.widen(), ray.dir.widen());
        let shift = if start == 0.0 { DVec3::ZERO } else { d * start };
        let at = (o - origin) + shift;
        let dir = d / unit;
        // Of f64, on the way to `at`.
        let lost = (o.abs() + shift.abs() + origin.abs()).element_sum() * (4.0 * f64::EPSILON);
        let near = at.abs().max_element() <= FAR && lost <= FAR;
        // Of f32: one for the component, three for the dot product; as many again for what the difference then adds.
        let reach = if near { at.abs().element_sum() * ROUNDINGS + lost + STEP } else { f64::INFINITY };
        let splat = |v: DVec3| v.to_array().map(|x| Vec4::splat(x as f32));
        PolytopeRay {
            axes,
            origin: splat(if near { at } else { DVec3::ZERO }),
            dir: splat(dir),
            reach: Vec4::splat(f32_above(reach)),
            turn: Vec4::splat(f32_above(dir.abs().element_sum() * ROUNDINGS + STEP)),
        }
    }

    /// Ends the ray at `t_max`, included, with room for the rounding of a computed `t`.
    #[inline]
    pub fn shorten<R: Real>(&mut self, t_max: R) {
        self.axes.shorten(t_max);
    }

    /// The distance beyond which no volume matters, in the unit of the entries.
    #[inline]
    pub fn far(&self) -> f32 {
        self.axes.far()
    }
}

impl Block {
    /// Narrows the interval to the inner side of four planes.
    ///
    /// A ray is inside while `t (n . dir) <= d - n . origin`. With the left factor rounded down and the right side up, by
    /// more than their roundings, that holds for all `t >= 0` where it holds exactly, and the quotient bounds `t` from above
    /// or from below by the sign of the divisor: also for a ray that is parallel to the plane as far as one can tell.
    #[inline(always)]
    fn narrow(&self, ray: &PolytopeRay, t0: Vec4, t1: Vec4) -> (Vec4, Vec4) {
        // The roundings of the difference, the quotient and the product: four, and two more.
        const SHRINK: f32 = 1.0 - 3.0 * f32::EPSILON;
        const GROW: f32 = 1.0 + 3.0 * f32::EPSILON;
        let [x, y, z] = self.n.map(Vec4::from_array);
        let at = x * ray.origin[0] + y * ray.origin[1] + z * ray.origin[2];
        let along = (x * ray.dir[0] + y * ray.dir[1] + z * ray.dir[2]) - ray.turn;
        let t = ((Vec4::from_array(self.d) - at) + ray.reach) / along;
        let leaves = along.cmpge(Vec4::ZERO);
        // The product first: a NaN is dropped.
        let enter = Vec4::select(leaves, Vec4::NEG_INFINITY, t * SHRINK).max(t0);
        let exit = Vec4::select(leaves, t * GROW, Vec4::INFINITY).min(t1);
        (enter, exit)
    }
}

impl BoundingVolume for Polytope {
    type Ready = PolytopeRay;

    /// Thirty-two planes around the points: the box and the facets of their hull that cut the most area. Of more than 602
    /// points that may be on the hull, those furthest along 602 directions stand for all in the choice of facets; the planes
    /// hold all points.
    ///
    /// Cost: `O(n)` for `n` points, beside a hull of at most 602: 0.1 ms for eight points, 0.05 s at most for 1500, 0.1 s
    /// for 10^5 and 1.5 s for 10^6 on a sphere. Points of a turned disc or cylinder take no longer.
    fn around<V: Vector>(points: &[V], origin: DVec3) -> Option<Polytope> {
        let all: Vec<DVec3> = points.iter().map(|p| p.widen()).collect();
        if all.is_empty() || all.iter().any(|p| !p.is_finite()) {
            return None;
        }
        let most = all.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        // Digits too small for an exact hull do not matter for its directions.
        let coarse: Vec<DVec3> =
            all.iter().map(|p| p.map(|x| if x.abs() < most * 1e-150 { 0.0 } else { x })).collect();
        let at = scaled(&coarse).ok()?;
        let mut left = without_inner(&at, (0..u32::try_from(at.len()).ok()?).collect());
        if left.len() > MANY {
            left = extreme(&at, &left, &lattice());
        }
        let sample: Vec<DVec3> = left.iter().map(|i| coarse[*i as usize]).collect();
        let hull = Hull::new(&sample).ok()?;
        Some(Polytope::between(hull.directions(), &hull, Some(AROUND - 6), points, origin))
    }

    fn ready<R: Real>(ray: &Ray<R>, origin: DVec3, world: &Aabb) -> PolytopeRay {
        PolytopeRay::new(ray, origin, world)
    }

    #[inline]
    fn entry(&self, ray: &PolytopeRay) -> Option<f32> {
        let (entry, exit) = self.bounds.span(&ray.axes)?;
        let (mut t0, mut t1) = (Vec4::splat(entry), Vec4::splat(exit));
        for block in &self.blocks {
            (t0, t1) = block.narrow(ray, t0, t1);
            if t0.max_element() > t1.min_element() {
                return None;
            }
        }
        Some(t0.max_element())
    }

    /// The area of the faces that the stored planes truly have.
    fn surface_area(&self) -> f64 {
        self.area
    }

    fn aabb(&self) -> Aabb {
        self.bounds.aabb()
    }

    fn bytes(&self) -> usize {
        size_of::<Self>() + self.blocks.capacity() * size_of::<Block>()
    }
}

/// 602 directions spread over the sphere: the surface of a cube of 11 x 11 x 11 whole numbers.
fn lattice() -> Vec<DVec3> {
    let line = || (-5..=5).map(f64::from);
    let all = line().flat_map(|x| line().flat_map(move |y| line().map(move |z| DVec3::new(x, y, z))));
    all.filter(|v| v.abs().max_element() == 5.0).map(|v| v.normalize()).collect()
}

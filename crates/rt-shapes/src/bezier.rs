//! [`BezierPatch`]: bicubic patches, met directly.

mod bilinear;
mod net;
mod search;
mod tessellation;

pub use bilinear::BilinearPatch;
pub use search::{PatchCounts, PatchRoot};
pub use tessellation::Tessellation;

use crate::{Partials, Shape, Surface, Uv};
use core::fmt;
use core::ops::ControlFlow;
use rt_accel::{Counts, Hit, Primitive, WorldBound};
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real, gamma};
use search::{Frame, Next, Search};

/// A bicubic Bézier patch in world space, kept in `f64`: `S(u, v)` is the sum of `B_i(u) B_j(v) P[4 i + j]`.
///
/// Rays of both precisions meet the patch itself, not triangles in its place. *No meeting is lost*: a piece of the patch is
/// passed over only when its control points, rounding included, lie beside the ray, or when Krawczyk's operator proves that it
/// holds no root. Pieces are cut until a root is proved to be the only one, and then a Newton iteration finds it; or until they
/// are as small as rounding, and then they are met. So a ray that grazes the patch within rounding hits it, and neighbours that
/// share the control points of a border leave no crack between them: each is closed.
///
/// Rounding means some `2^-50` of the larger of the patch's coordinates and the distance of the ray's origin: within that of the
/// outline or of an open border a hit may be made up; never beyond `2^-45` of its size from the box of the patch, so that every
/// structure finds the same hits. A ray that runs along the patch for a stretch meets it at the near end.
///
/// Close pairs are one: two meetings between which the patch leaves the ray by less than some `2^-44` of that size (the
/// deepest of ten thousand tried), or that lie within each other's [error](PatchRoot::error), are reported as one root whose error
/// covers both; to [`Primitive::all_hits`] they are one hit. Along a ray that grazes, such a pair is apart by the square root of
/// its depth: by a millionth of the size, not by rounding. The error says so.
///
/// Edges may be points (the lid of the teapot), control points may coincide, surfaces may fold and cross themselves. Cost: some
/// tens of pieces for a ray that hits, one or two for most that miss; never more than 16384, then what is left is met
/// ([`PatchCounts::unresolved`]).
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::BezierPatch;
/// // z = x^2 over the unit square: the control points of a parabola of degree 3 have heights 0, 0, 1/3, 1.
/// let heights = [0.0, 0.0, 1.0 / 3.0, 1.0];
/// let patch = BezierPatch::new(core::array::from_fn(|k| {
///     DVec3::new((k / 4) as f64 / 3.0, (k % 4) as f64 / 3.0, heights[k / 4])
/// }))?;
/// let hit = patch.intersect(&Ray::new(Vec3A::new(0.5, 0.25, -1.0), Vec3A::Z)).unwrap();
/// assert_eq!((hit.t, hit.at.u, hit.at.v), (1.25, 0.5, 0.25));
/// # Ok::<(), rt_shapes::PatchError>(())
/// ```
///
/// Error: `t` is off by [`PatchRoot::error`] at most: some `2^-50` of the distance where the ray is steep, up to `2^-44` at a border.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierPatch {
    control: [DVec3; 16],
    min: DVec3,
    max: DVec3,
    size: f64,
}

/// Why control points make no patch.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PatchError {
    /// A control point is not finite.
    Control {
        /// Its number.
        index: usize,
        /// Where it is.
        point: DVec3,
    },
}

impl fmt::Display for PatchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PatchError::Control { index, point } = self;
        write!(f, "control point {index} at {point} is not finite")
    }
}

impl core::error::Error for PatchError {}

/// A point of a patch with its derivatives.
#[derive(Clone, Copy, Debug)]
struct Jet {
    p: DVec3,
    du: DVec3,
    dv: DVec3,
    duu: DVec3,
    duv: DVec3,
    dvv: DVec3,
}

impl BezierPatch {
    /// The patch of these control points, row by row: entry `4 i + j` goes with `B_i(u) B_j(v)`.
    ///
    /// # Errors
    ///
    /// When a control point is not finite.
    pub fn new(control: [DVec3; 16]) -> Result<BezierPatch, PatchError> {
        if let Some(index) = control.iter().position(|p| !p.is_finite()) {
            return Err(PatchError::Control { index, point: control[index] });
        }
        let size = control.iter().fold(DVec3::ZERO, |m, p| m.max(p.abs())).max_element();
        // Each level of cutting rounds three times in each direction.
        let (min, max) = bounds(&control, BOUND_LEVELS);
        let slack = size * gamma(8 * BOUND_LEVELS);
        let whole = control.iter().fold((control[0], control[0]), |(l, h), &p| (l.min(p), h.max(p)));
        let [min, max] = roomy((min - slack).max(whole.0), (max + slack).min(whole.1), size);
        Ok(BezierPatch { control, min, max, size })
    }

    /// The control points.
    pub fn control(&self) -> &[DVec3; 16] {
        &self.control
    }

    /// The same surface with u and v exchanged: its normals point the other way.
    pub fn flipped(&self) -> BezierPatch {
        let control = core::array::from_fn(|k| self.control[k % 4 * 4 + k / 4]);
        BezierPatch { control, ..self.clone() }
    }

    /// The point at `u`, `v`, both in `[0, 1]`, within `gamma(24)` of the largest control point.
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        self.jet(u, v).p
    }

    /// The unit normal at `u`, `v`: the direction of `dS/du x dS/dv`. Where that vanishes, the limit from inside the patch: at an
    /// edge that is a point, and in its corners. Zero where the patch has no area.
    pub fn normal(&self, u: f64, v: f64) -> DVec3 {
        self.normal_of(&self.jet(u, v), u, v)
    }

    fn normal_of(&self, at: &Jet, u: f64, v: f64) -> DVec3 {
        let unit = |n: DVec3| (n / n.abs().max_element()).normalize_or_zero();
        let size = |d: DVec3| d.abs().max_element();
        let steep = |n: DVec3, d: DVec3, e: DVec3| size(n) > 1e-12 * size(d) * size(e);
        // Derivatives as small as rounding have no direction.
        let noise = self.size * gamma(64);
        let n = at.du.cross(at.dv);
        if size(at.du) > noise && size(at.dv) > noise && steep(n, at.du, at.dv) {
            return unit(n);
        }
        // Towards the middle the first derivatives change by the second ones.
        let inward = DVec2::new(0.5 - u, 0.5 - v);
        let (du, dv) = (at.duu * inward.x + at.duv * inward.y, at.duv * inward.x + at.dvv * inward.y);
        let still = |d: DVec3| if size(d) > noise { d } else { DVec3::ZERO };
        let n = du.cross(still(at.dv)) + still(at.du).cross(dv);
        if size(n) > 1e-9 * (size(du) * size(at.dv)).max(size(at.du) * size(dv)) && size(n) > 0.0 {
            return unit(n);
        }
        let near = self.jet(u + inward.x * 2e-4, v + inward.y * 2e-4);
        unit(near.du.cross(near.dv))
    }

    /// The area, by Gauss's eight points on `8 x 8` cells: to ten digits or so where the patch is smooth.
    pub fn area(&self) -> f64 {
        let cells = 8;
        let mut sum = 0.0;
        for (i, j) in (0..cells * cells).map(|k| (k / cells, k % cells)) {
            for (a, wa) in GAUSS {
                for (b, wb) in GAUSS {
                    let at = |cell: i32, x: f64| (f64::from(cell) + 0.5 + 0.5 * x) / f64::from(cells);
                    let jet = self.jet(at(i, a), at(j, b));
                    sum += wa * wb * jet.du.cross(jet.dv).length();
                }
            }
        }
        sum / f64::from(4 * cells * cells)
    }

    /// Every meeting in the ray's interval, nearest first, each once, with its error. What work it was is added to `counts`.
    pub fn roots(&self, ray: &Ray<f64>, counts: &mut PatchCounts) -> Vec<PatchRoot> {
        let mut roots: Vec<PatchRoot> = Vec::new();
        self.search(ray, counts, |root| {
            roots.push(root);
            Next::On
        });
        apart(roots, ray)
    }

    #[inline]
    fn search(&self, ray: &Ray<f64>, counts: &mut PatchCounts, mut each: impl FnMut(PatchRoot) -> Next) {
        let bound = DAabb { min: self.min, max: self.max };
        let (Some(held), Some(frame)) = (Held::new(bound, ray, counts), Frame::new(ray, self.size)) else {
            return;
        };
        let piece = frame.piece(&self.control);
        Search::run(&frame, &piece, &held.search, counts, |root| each(held.hold(root)));
    }

    fn closest<R: Real>(&self, ray: &Ray<R>, counts: &mut PatchCounts) -> Option<Hit<Uv, R>> {
        let mut best: Option<(f64, Hit<Uv, R>)> = None;
        self.search(&reaching(ray), counts, |root| match ray.admit(root.t) {
            Some(t) => {
                if best.is_none_or(|(least, _)| root.t < least) {
                    best = Some((root.t, hit(t, &root)));
                }
                Next::Nearer
            }
            None => Next::On,
        });
        best.map(|(_, hit)| hit)
    }

    fn any<R: Real>(&self, ray: &Ray<R>, counts: &mut PatchCounts) -> bool {
        let mut found = false;
        self.search(&reaching(ray), counts, |root| {
            found |= ray.admit(root.t).is_some();
            if found { Next::Stop } else { Next::On }
        });
        found
    }

    /// The parameters of a hit in full precision.
    fn parameters<R: Real>(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> (f64, f64) {
        let rough = (f64::from(hit.at.u), f64::from(hit.at.v));
        let refined = Frame::new(&ray.widen(), self.size).and_then(|frame| {
            let whole = frame.piece(&self.control);
            Search::refine(&frame, &whole, rough)
        });
        refined.unwrap_or(rough)
    }

    /// De Casteljau in both directions.
    fn jet(&self, u: f64, v: f64) -> Jet {
        let row = |i: usize| core::array::from_fn(|j| self.control[4 * i + j]);
        let rows: [Curve; 4] = core::array::from_fn(|i| curve(row(i), v));
        let p = curve(rows.map(|row| row.p), u);
        let d = curve(rows.map(|row| row.d), u);
        let dd = curve(rows.map(|row| row.dd), u);
        Jet { p: p.p, du: p.d, dv: d.p, duu: p.dd, duv: d.d, dvv: dd.p }
    }
}

/// A point of a cubic with its derivatives.
#[derive(Clone, Copy)]
struct Curve {
    p: DVec3,
    d: DVec3,
    dd: DVec3,
}

fn curve([a, b, c, d]: [DVec3; 4], t: f64) -> Curve {
    let s = 1.0 - t;
    let (ab, bc, cd) = (a * s + b * t, b * s + c * t, c * s + d * t);
    let (abc, bcd) = (ab * s + bc * t, bc * s + cd * t);
    Curve { p: abc * s + bcd * t, d: (bcd - abc) * 3.0, dd: ((cd - bc) - (bc - ab)) * 6.0 }
}

/// Levels of halving, in turn, before the box of a patch is taken.
const BOUND_LEVELS: u32 = 6;

/// The box of the control points of all pieces after some levels of halving.
fn bounds(control: &[DVec3; 16], levels: u32) -> (DVec3, DVec3) {
    if levels == 0 {
        return control.iter().fold((control[0], control[0]), |(l, h), &p| (l.min(p), h.max(p)));
    }
    let (mut left, mut right) = (*control, *control);
    let (step, across) = if levels.is_multiple_of(2) { (4, 1) } else { (1, 4) };
    for k in 0..4 {
        let at = |i: usize| k * across + i * step;
        let p: [DVec3; 4] = core::array::from_fn(|i| control[at(i)]);
        // Halves first, so that nothing overflows.
        let middle = |a: DVec3, b: DVec3| a * 0.5 + b * 0.5;
        let (ab, bc, cd) = (middle(p[0], p[1]), middle(p[1], p[2]), middle(p[2], p[3]));
        let (abc, bcd) = (middle(ab, bc), middle(bc, cd));
        let mid = middle(abc, bcd);
        (left[at(1)], left[at(2)], left[at(3)]) = (ab, abc, mid);
        (right[at(0)], right[at(1)], right[at(2)]) = (mid, bcd, cd);
    }
    let ((l, h), (m, g)) = (bounds(&left, levels - 1), bounds(&right, levels - 1));
    (l.min(m), h.max(g))
}

/// Abscissas and weights of Gauss and Legendre for eight points in `[-1, 1]`.
#[allow(clippy::excessive_precision)]
const GAUSS: [(f64, f64); 8] = [
    (-0.960_289_856_497_536_23, 0.101_228_536_290_376_26),
    (-0.796_666_477_413_626_74, 0.222_381_034_453_374_47),
    (-0.525_532_409_916_328_99, 0.313_706_645_877_887_29),
    (-0.183_434_642_495_649_80, 0.362_683_783_378_361_98),
    (0.183_434_642_495_649_80, 0.362_683_783_378_361_98),
    (0.525_532_409_916_328_99, 0.313_706_645_877_887_29),
    (0.796_666_477_413_626_74, 0.222_381_034_453_374_47),
    (0.960_289_856_497_536_23, 0.101_228_536_290_376_26),
];

/// Roots in the ray's interval, nearest first, those that cannot be told apart as one.
fn apart(mut roots: Vec<PatchRoot>, ray: &Ray<f64>) -> Vec<PatchRoot> {
    // First, lest one outside stands for one inside.
    roots.retain(|root| ray.contains(root.t));
    roots.sort_by(|a, b| (a.t - a.error).total_cmp(&(b.t - b.error)));
    // Of those that cannot be told apart, the surest stands for all, with the stretch of all for its error.
    let mut apart: Vec<(PatchRoot, f64, f64)> = Vec::with_capacity(roots.len());
    for root in roots {
        let (start, end) = (root.t - root.error, root.t + root.error);
        match apart.last_mut() {
            Some((last, first, until)) if start <= *until => {
                (*first, *until) = (start.min(*first), end.max(*until));
                if root.error < last.error {
                    *last = root;
                }
            }
            _ => apart.push((root, start, end)),
        }
    }
    let stretch = |(root, start, end): (PatchRoot, f64, f64)| PatchRoot {
        error: (root.t - start).max(end - root.t),
        ..root
    };
    apart.into_iter().map(stretch).collect()
}

/// A box with room for what rounding makes of rays that are aimed at its faces from some tens of times its size.
fn roomy(min: DVec3, max: DVec3, size: f64) -> [DVec3; 2] {
    let room = size * (2f64).powi(-45);
    [(min - room).max(DVec3::MIN), (max + room).min(DVec3::MAX)]
}

/// Where hits of a patch lie: in its box.
///
/// What rounding makes up beside a patch may lie beside its box, which a structure passes over where the ray does not meet it. So
/// whether it does is decided exactly, and hits are held within: then every structure finds the same.
struct Held {
    near: f64,
    far: f64,
    /// The ray to search along: one that starts before the box and ends behind it starts and ends nowhere, so that what is found
    /// does not depend on where exactly.
    search: Ray<f64>,
}

impl Held {
    /// `None` if the line of the ray does not meet the box within the ray's interval.
    fn new(bound: DAabb, ray: &Ray<f64>, counts: &mut PatchCounts) -> Option<Held> {
        let Some([near, far]) = bound.span(&ray.between(f64::NEG_INFINITY, f64::INFINITY)) else {
            counts.pieces += 1;
            return None;
        };
        let t_min = if ray.t_min <= near { f64::NEG_INFINITY } else { ray.t_min };
        let t_max = if ray.t_max >= far { f64::INFINITY } else { ray.t_max };
        (ray.t_max >= near && ray.t_min <= far).then(|| Held { near, far, search: ray.between(t_min, t_max) })
    }

    /// The same, in the box: a bound on the error stays one, for what was exact was there.
    fn hold(&self, root: PatchRoot) -> PatchRoot {
        // NaN stays NaN.
        let t = if root.t < self.near { self.near } else { root.t };
        PatchRoot { t: if t > self.far { self.far } else { t }, ..root }
    }
}

/// The ray in `f64`, reaching as far as numbers that round to its end.
fn reaching<R: Real>(ray: &Ray<R>) -> Ray<f64> {
    Ray { t_max: ray.t_max.reach(), ..ray.widen() }
}

fn hit<R: Real>(t: R, root: &PatchRoot) -> Hit<Uv, R> {
    Hit { t, at: Uv { prim: 0, u: root.u as f32, v: root.v as f32 } }
}

impl WorldBound for BezierPatch {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        Aabb::from_f64(self.min, self.max, origin)
    }
}

impl<R: Real> Primitive<R> for BezierPatch {
    type At = Uv;

    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.closest(ray, &mut PatchCounts::default())
    }

    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.any(ray, &mut PatchCounts::default())
    }

    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        for root in self.roots(&reaching(ray), &mut PatchCounts::default()) {
            if let Some(t) = ray.admit(root.t) {
                each(hit(t, &root))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Pieces count as nodes.
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Uv, R>> {
        let mut work = PatchCounts::default();
        let hit = self.closest(ray, &mut work);
        *counts += Counts { nodes: work.pieces, prims: 1, ..Counts::default() };
        hit
    }

    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        let mut work = PatchCounts::default();
        let hit = self.any(ray, &mut work);
        *counts += Counts { nodes: work.pieces, prims: 1, ..Counts::default() };
        hit
    }
}

impl<R: Real> Shape<R> for BezierPatch {
    /// The point is that of the patch at the parameters of the hit, so its error is that of an evaluation, whatever the ray.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let (u, v) = self.parameters(ray, hit);
        let jet = self.jet(u, v);
        // Twice three steps of three roundings, and four more where the control points themselves were computed.
        let error = self.control.iter().fold(DVec3::ZERO, |m, p| m.max(p.abs())) * gamma(28);
        let normal = self.normal_of(&jet, u, v);
        let normal = if normal == DVec3::ZERO { -ray.widen().dir.normalize_or(DVec3::Z) } else { normal };
        Surface { point: jet.p, error, normal, shading: normal, uv: DVec2::new(u, v) }
    }

    /// The derivatives of the normal are zero where the first derivatives of the patch do not span a plane.
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let (u, v) = self.parameters(ray, hit);
        let at = self.jet(u, v);
        let n = self.normal_of(&at, u, v);
        let (dndu, dndv) = weingarten(at.du, at.dv, [at.duu, at.duv, at.dvv], n);
        Partials { dpdu: at.du, dpdv: at.dv, dndu, dndv }
    }
}

/// The derivatives of the unit normal from those of the point; zero where they are not defined.
pub(crate) fn weingarten(du: DVec3, dv: DVec3, [duu, duv, dvv]: [DVec3; 3], n: DVec3) -> (DVec3, DVec3) {
    let (e, f, g) = (du.dot(du), du.dot(dv), dv.dot(dv));
    let det = e * g - f * f;
    if det <= 1e-24 * e * g || det.is_nan() {
        return (DVec3::ZERO, DVec3::ZERO);
    }
    let (l, m, k) = (n.dot(duu), n.dot(duv), n.dot(dvv));
    let along = |a: f64, b: f64| (du * (f * b - g * a) + dv * (f * a - e * b)) / det;
    (along(l, m), along(m, k))
}

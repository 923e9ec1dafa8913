//! [`BilinearPatch`]: the surface between four points.

use super::net::{Piece, U};
use super::search::{Frame, Next, Search};
use super::{BezierPatch, Held, PatchCounts, PatchError, PatchRoot, apart, hit, reaching, roomy};
use crate::{Partials, Shape, Surface, Uv};
use core::ops::ControlFlow;
use rt_accel::{Counts, Hit, Primitive, WorldBound};
use rt_bounds::{Aabb, DAabb};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real};

/// A bilinear patch in world space, kept in `f64`:
/// `S(u, v) = (1 - u) (1 - v) p00 + u (1 - v) p10 + (1 - u) v p01 + u v p11`; 104 bytes.
///
/// The lines of constant `u` that a ray meets are the roots of a quadratic, solved without cancellation. Where rounding leaves
/// open whether there is a root, or on which side of an edge (its error is bounded along the way), the patch is cut in pieces as a
/// [`BezierPatch`] is, which loses no root: so edges are closed, neighbours leave no cracks, and tangents hit. Both roots are
/// reported by [`Primitive::all_hits`]. See there for the error, and for rays along the patch, which every planar patch has.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, Vec3A}};
/// use rt_shapes::BilinearPatch;
/// // z = x y.
/// let saddle = BilinearPatch::new([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE])?;
/// let hit = saddle.intersect(&Ray::new(Vec3A::new(0.5, 0.25, -1.0), Vec3A::Z)).unwrap();
/// assert_eq!((hit.t, hit.at.u, hit.at.v), (1.125, 0.5, 0.25));
/// # Ok::<(), rt_shapes::PatchError>(())
/// ```
///
/// Source: Reshetov, "Cool patches: a geometric approach to ray/bilinear patch intersections", *Ray Tracing Gems* (2019), chapter 8.
#[derive(Clone, Debug, PartialEq)]
pub struct BilinearPatch {
    corners: [DVec3; 4],
    size: f64,
}

/// What the quadratic knows.
enum Known {
    /// There is no root.
    None,
    /// Roots lie near these parameters, and nowhere else.
    Near([Option<(f64, f64)>; 2]),
    /// Nothing for certain.
    Open,
}

/// How near the parameters of a root are known, for decisions against edges to be taken.
const SURE: f64 = 1e-10;

impl BilinearPatch {
    /// The patch between `p00`, `p10`, `p01`, `p11`: the first digit is `u`.
    ///
    /// # Errors
    ///
    /// When a corner is not finite.
    pub fn new(corners: [DVec3; 4]) -> Result<BilinearPatch, PatchError> {
        if let Some(index) = corners.iter().position(|p| !p.is_finite()) {
            return Err(PatchError::Control { index, point: corners[index] });
        }
        let size = corners.iter().fold(DVec3::ZERO, |m, p| m.max(p.abs())).max_element();
        Ok(BilinearPatch { corners, size })
    }

    /// The corners, as they were given.
    pub fn corners(&self) -> &[DVec3; 4] {
        &self.corners
    }

    /// The same patch with control points of degree three, for whatever is not asked of every ray.
    pub fn elevated(&self) -> BezierPatch {
        let [a, b, c, d] = self.corners;
        let control = core::array::from_fn(|k| match k {
            // Borders that are points stay points.
            0 => a,
            12 => b,
            3 => c,
            15 => d,
            _ => {
                let (u, v) = ((k / 4) as f64 / 3.0, (k % 4) as f64 / 3.0);
                let between = |p: DVec3, q: DVec3, t: f64| if p == q { p } else { p * (1.0 - t) + q * t };
                between(between(a, b, u), between(c, d, u), v)
            }
        });
        let [min, max] = self.extent();
        BezierPatch { control, min, max, size: self.size }
    }

    fn extent(&self) -> [DVec3; 2] {
        let [a, b, c, d] = self.corners;
        roomy(a.min(b).min(c.min(d)), a.max(b).max(c.max(d)), self.size)
    }

    /// The area, as [`BezierPatch::area`] finds it.
    pub fn area(&self) -> f64 {
        self.elevated().area()
    }

    /// Every meeting in the ray's interval, nearest first, each once, with its error. What work it was is added to `counts`: the
    /// quadratic is a piece.
    pub fn roots(&self, ray: &Ray<f64>, counts: &mut PatchCounts) -> Vec<PatchRoot> {
        let mut roots = Vec::new();
        self.search(ray, counts, |root| {
            roots.push(root);
            Next::On
        });
        apart(roots, ray)
    }

    fn search(&self, ray: &Ray<f64>, counts: &mut PatchCounts, mut each: impl FnMut(PatchRoot) -> Next) {
        let [min, max] = self.extent();
        let (Some(held), Some(frame)) =
            (Held::new(DAabb { min, max }, ray, counts), Frame::new(ray, self.size))
        else {
            return;
        };
        let [a, b, c, d] = self.corners;
        // Only the corners count for the quadratic; the rest is filled in when there is something to be found.
        let mut piece = frame.piece(&core::array::from_fn(|k| match k {
            12 => b,
            3 => c,
            15 => d,
            _ => a,
        }));
        counts.pieces += 1;
        let known = quadratic(&piece);
        if let Known::None = known {
            return;
        }
        elevate(&mut piece);
        if let Known::Near(roots) = known {
            let found = roots.map(|root| root.map(|at| Search::near(&frame, &piece, at, counts)));
            if found.iter().flatten().all(Option::is_some) {
                for root in found.into_iter().flatten().flatten() {
                    counts.roots += 1;
                    if let Next::Stop = each(held.hold(root)) {
                        return;
                    }
                }
                return;
            }
        }
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
}

/// The points between the corners of a piece.
fn elevate(piece: &mut Piece) {
    let mut size = 0.0f64;
    for grid in [&mut piece.x, &mut piece.y, &mut piece.z] {
        let [a, b, c, d] = [grid[0], grid[12], grid[3], grid[15]];
        for (k, value) in grid.iter_mut().enumerate() {
            let (u, v) = ((k / 4) as f64 / 3.0, (k % 4) as f64 / 3.0);
            let (near, far) = (a * (1.0 - u) + b * u, c * (1.0 - u) + d * u);
            *value = near * (1.0 - v) + far * v;
            size = size.max(value.abs());
        }
    }
    // Two steps of four roundings.
    piece.slack += 8.0 * U * size;
    piece.slack_z += 8.0 * U * size;
}

/// Where in the patch the ray can be: seen along it, `A + u B + v C + u v D = 0`, and without `v`,
/// `(A + u B) x (C + u D) = 0`.
///
/// Error: with values up to `S` known within `s >= 6 U S`, the coefficients are off by at most `48 S s`: differences double both at
/// each step, and a cross product is two products of them.
fn quadratic(piece: &Piece) -> Known {
    let at = |k: usize| [piece.x[k], piece.y[k]];
    let [p00, p10, p01, p11] = [at(0), at(12), at(3), at(15)];
    let minus = |p: [f64; 2], q: [f64; 2]| [p[0] - q[0], p[1] - q[1]];
    let cross = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let (a, b, c) = (p00, minus(p10, p00), minus(p01, p00));
    let d = minus(minus(p11, p10), c);
    let size = [p00, p10, p01, p11].iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    let error = 48.0 * size * piece.slack;
    let (c0, c1, c2) = (cross(a, c), cross(a, d) + cross(b, c), cross(b, d));
    // In Bernstein form its values lie between these.
    let hull = [c0, c0 + 0.5 * c1, c0 + c1 + c2];
    let clear = 4.0 * error;
    if hull.iter().all(|&q| q > clear) || hull.iter().all(|&q| q < -clear) {
        return Known::None;
    }
    let disc = c1 * c1 - 4.0 * c0 * c2;
    let unsure = 8.0 * error * (c0.abs() + c1.abs() + c2.abs() + error);
    if disc < -unsure {
        return Known::None;
    }
    // Sixteen times as sure, so that the error of a root is that of the values over the slope, and a little.
    if disc <= 16.0 * unsure || disc.is_nan() {
        return Known::Open;
    }
    let root = disc.sqrt();
    let off = 8.0 * error / root;
    if off > SURE {
        return Known::Open;
    }
    let q = -0.5 * (c1 + root.copysign(c1));
    let mut near = [None; 2];
    for (place, u) in near.iter_mut().zip([q / c2, c0 / q]) {
        // Also where the quadratic is a line, and the other root infinite.
        if !(-SURE..=1.0 + SURE).contains(&u) {
            continue;
        }
        let (p, e) = ([a[0] + u * b[0], a[1] + u * b[1]], [c[0] + u * d[0], c[1] + u * d[1]]);
        let long = e[0] * e[0] + e[1] * e[1];
        let v = -(p[0] * e[0] + p[1] * e[1]) / long;
        // Both vectors are known within eight slacks and what the root is off by.
        let off = (16.0 * piece.slack + 8.0 * size * off) * (1.0 + v.abs()) / long.sqrt();
        if off > SURE || off.is_nan() {
            return Known::Open;
        }
        if !(-SURE..=1.0 + SURE).contains(&v) {
            continue;
        }
        let inside = |x: f64| x > SURE && x < 1.0 - SURE;
        if !(inside(u) && inside(v)) {
            return Known::Open;
        }
        *place = Some((u, v));
    }
    match near {
        [None, None] => Known::None,
        _ => Known::Near(near),
    }
}

impl WorldBound for BilinearPatch {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let [min, max] = self.extent();
        Aabb::from_f64(min, max, origin)
    }
}

impl<R: Real> Primitive<R> for BilinearPatch {
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

impl<R: Real> Shape<R> for BilinearPatch {
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        self.elevated().surface(ray, hit)
    }
    fn partials(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        self.elevated().partials(ray, hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;
    use proptest::prelude::*;
    use rt_geom::glam::DVec2;

    fn point(v: [f64; 3]) -> DVec3 {
        DVec3::from_array(v)
    }

    #[test]
    fn a_saddle_is_the_quadratic_it_is() {
        let saddle = BilinearPatch::new([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE]).unwrap();
        let mut both = 0;
        for k in 0..4000 {
            let unit = |m: f64| (f64::from(k) * m).fract();
            let on = |x: f64, y: f64| DVec3::new(x, y, x * y);
            let (p, q) = (on(unit(0.618_03), unit(0.754_87)), on(unit(0.569_84), unit(0.819_17)));
            // A third of the rays leave the chord between two points.
            let q = if k % 3 == 0 { q + DVec3::Z * unit(0.414_21) } else { q };
            let ray = Ray::new(p - (q - p) * 2.0, q - p);
            // z - x y = 0 along the ray.
            let (o, d) = (ray.origin, ray.dir);
            let (a, b, c) = (-d.x * d.y, d.z - o.x * d.y - o.y * d.x, o.z - o.x * o.y);
            let root = (b * b - 4.0 * a * c).sqrt();
            let mut wanted: Vec<f64> = [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
                .into_iter()
                .filter(|&t| {
                    let p = ray.at(t);
                    t >= 0.0 && p.x >= 0.0 && p.x <= 1.0 && p.y >= 0.0 && p.y <= 1.0
                })
                .collect();
            wanted.sort_by(f64::total_cmp);
            let found = saddle.roots(&ray, &mut PatchCounts::default());
            assert_eq!(found.len(), wanted.len(), "{ray:?}");
            for (root, t) in found.iter().zip(&wanted) {
                assert!((root.t - t).abs() <= root.error + 1e-11 * (1.0 + t), "{root:?} {t}");
            }
            both += (wanted.len() == 2) as usize;
        }
        assert!(both > 1000, "{both}");
        assert!((saddle.area() - 1.280789).abs() < 1e-6, "{}", saddle.area());
    }

    #[test]
    fn edges_corners_and_flat_ones_are_met() {
        let flat = BilinearPatch::new([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)]).unwrap();
        for (x, y) in [(0.0, 0.0), (1.0, 1.0), (0.5, 0.0), (1.0, 0.25), (0.0, 1.0)] {
            let ray = Ray::new(DVec3::new(x, y, -2.0), DVec3::Z);
            let hit = flat.intersect(&ray).unwrap();
            assert!((hit.t - 2.0).abs() < 1e-15);
            assert_eq!((hit.at.u as f64, hit.at.v as f64), (x, y));
            assert_eq!(flat.roots(&ray, &mut PatchCounts::default()).len(), 1);
        }
        // Two corners in one: a triangle.
        let triangle = BilinearPatch::new([DVec3::ZERO, DVec3::ZERO, DVec3::Y, DVec3::X]).unwrap();
        let ray = Ray::new(DVec3::new(0.0, 0.0, -2.0), DVec3::Z);
        let surface = triangle.surface(&ray, &triangle.intersect(&ray).unwrap());
        assert!(surface.normal.z.abs() == 1.0, "{surface:?}");
        assert!(BilinearPatch::new([DVec3::NAN; 4]).is_err());
    }

    proptest! {
        #[test]
        fn a_parallelogram_is_two_triangles(p in prop::array::uniform3(-1.0..1.0f64), e in prop::array::uniform3(-1.0..1.0f64),
                                            f in prop::array::uniform3(-1.0..1.0f64), o in prop::array::uniform3(-3.0..3.0f64), w in (-0.2..1.2f64, -0.2..1.2f64)) {
            let (p, e, f, o) = (point(p), point(e), point(f), point(o));
            prop_assume!(e.cross(f).length() > 0.05);
            let patch = BilinearPatch::new([p, p + e, p + f, p + e + f]).unwrap();
            let ray = Ray::new(o, p + e * w.0 + f * w.1 - o);
            prop_assume!(ray.dir.dot(e.cross(f)).abs() > 1e-3);
            let border = [w.0, w.1, 1.0 - w.0, 1.0 - w.1].iter().any(|x| x.abs() < 1e-9);
            let halves = [[p, p + e, p + e + f], [p, p + e + f, p + f]];
            let wanted = halves.iter().find_map(|&corners| Triangle { corners }.intersect(&ray));
            let found = patch.intersect(&ray);
            prop_assert!(border || found.is_some() == wanted.is_some());
            if let (Some(found), Some(wanted)) = (found, wanted) {
                prop_assert!((found.t - wanted.t).abs() < 1e-12);
                let uv = patch.surface(&ray, &found).uv;
                prop_assert!((uv - DVec2::new(w.0, w.1)).length() < 1e-9);
            }
        }

        #[test]
        fn the_quadratic_and_the_pieces_agree(c in prop::array::uniform12(-1.0..1.0f64), o in prop::array::uniform3(-3.0..3.0f64), w in (0.0..1.0f64, 0.0..1.0f64)) {
            let corners: [DVec3; 4] = core::array::from_fn(|k| DVec3::new(c[3 * k], c[3 * k + 1], c[3 * k + 2]));
            let patch = BilinearPatch::new(corners).unwrap();
            let whole = patch.elevated();
            let ray = Ray::new(point(o), whole.point(w.0, w.1) - point(o));
            let (found, wanted) = (patch.roots(&ray, &mut PatchCounts::default()), whole.roots(&ray, &mut PatchCounts::default()));
            prop_assert!(found.iter().any(|root| (root.t - 1.0).abs() <= root.error + 1e-9));
            prop_assert_eq!(found.len(), wanted.len());
            for (a, b) in found.iter().zip(&wanted) {
                prop_assert!((a.t - b.t).abs() <= a.error + b.error + 1e-12);
            }
        }
    }
}

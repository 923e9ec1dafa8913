//! [`Search`]: every meeting of a ray and a patch.

use super::net::{Along, Grid, Piece, Span, Spans, U};
use core::ops::ControlFlow;
use rt_geom::Ray;
use rt_geom::glam::DVec3;

/// The work of ray against patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PatchCounts {
    /// Pieces of the patch looked at, itself included.
    pub pieces: u64,
    /// Pieces cut in halves.
    pub splits: u64,
    /// Pieces cut to what a contraction left.
    pub clips: u64,
    /// Newton steps.
    pub newton: u64,
    /// Meetings reported.
    pub roots: u64,
    /// Pieces taken for meetings because the work allowed for one ray was done. Only rays that run along the patch come to that.
    pub unresolved: u64,
}

/// Where a ray meets a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchRoot {
    /// The distance, in lengths of the ray's direction.
    pub t: f64,
    /// What `t` may be off by. Where the ray grazes the patch or runs along it, the stretch of the ray that cannot be told
    /// from the patch: every meeting on it is within `error` of `t`.
    pub error: f64,
    /// The first parameter, in `[0, 1]`.
    pub u: f64,
    /// The second parameter, in `[0, 1]`.
    pub v: f64,
}

/// How a search goes on after a meeting.
pub(super) enum Next {
    /// To the next.
    On,
    /// To nearer ones only.
    Nearer,
    /// Not at all.
    Stop,
}

/// Pieces as small as this in both parameters are not cut: half the digits, because where a ray grazes a patch a rounding
/// in space is as much as its root in the parameters.
const LEAST: f64 = 1.0 / (1u64 << 27) as f64;
/// Pieces looked at for one ray, at most. Ordinary rays need some tens, grazing ones some hundreds.
const ALLOWED: u32 = 1 << 14;
/// Newton steps, at most.
const STEPS: usize = 12;

/// A ray as the patches' control points are seen from: along its longest component, in units that keep products in range.
pub(super) struct Frame {
    axes: [usize; 3],
    shear: [f64; 2],
    dir: f64,
    origin: DVec3,
    /// Control points are multiplied by this, and so is the origin.
    scale: f64,
    /// Units of the direction: `t` is a distance here, times `unit`, over `pace`.
    pace: f64,
}

impl Frame {
    /// For control points no larger than `size` in any component. `None` for rays that are not valid.
    pub(super) fn new(ray: &Ray<f64>, size: f64) -> Option<Frame> {
        if !ray.is_valid() {
            return None;
        }
        let scale = 1.0 / power_of_two(size.max(ray.origin.abs().max_element()));
        let pace = power_of_two(ray.dir.abs().max_element());
        let d = ray.dir / pace;
        let longest = d.abs();
        let kz = if longest.x >= longest.y && longest.x >= longest.z {
            0
        } else if longest.y >= longest.z {
            1
        } else {
            2
        };
        let axes = [(kz + 1) % 3, (kz + 2) % 3, kz];
        let shear = [d[axes[0]] / d[kz], d[axes[1]] / d[kz]];
        Some(Frame { axes, shear, dir: d[kz], origin: ray.origin * scale, scale, pace })
    }

    /// The patch as the ray sees it.
    pub(super) fn piece(&self, control: &[DVec3; 16]) -> Piece {
        let mut piece = Piece {
            x: [0.0; 16],
            y: [0.0; 16],
            z: [0.0; 16],
            u: Span { lo: 0.0, hi: 1.0 },
            v: Span { lo: 0.0, hi: 1.0 },
            slack: 0.0,
            slack_z: 0.0,
        };
        let mut size = DVec3::ZERO;
        for k in 0..16 {
            let a = control[k] * self.scale - self.origin;
            size = size.max(a.abs());
            let z = a[self.axes[2]];
            piece.x[k] = a[self.axes[0]] - self.shear[0] * z;
            piece.y[k] = a[self.axes[1]] - self.shear[1] * z;
            piece.z[k] = z / self.dir;
        }
        // A difference, a slope, a product and a sum; and what multiplying by the scale may have lost below the range.
        let size = size.element_sum();
        piece.slack = 6.0 * U * size + f64::MIN_POSITIVE;
        piece.slack_z = 2.0 * U * size + f64::MIN_POSITIVE;
        piece
    }

    /// A distance here, in lengths of the ray's direction.
    pub(super) fn t(&self, z: f64) -> f64 {
        let t = z / self.scale;
        if t.is_finite() { t / self.pace } else { z / self.pace / self.scale }
    }

    /// The other way.
    fn z(&self, t: f64) -> f64 {
        let z = t * self.scale;
        if z != 0.0 && z.is_finite() { z * self.pace } else { t * self.pace * self.scale }
    }
}

/// `2^k`, `k` the exponent of `x`, kept where it and its inverse are normal.
fn power_of_two(x: f64) -> f64 {
    f64::from_bits((x.to_bits() >> 52 & 0x7ff).clamp(30, 2000) << 52)
}

/// Value and derivatives of the three coordinates.
#[derive(Clone, Copy)]
struct Local {
    f: [f64; 3],
    du: [f64; 3],
    dv: [f64; 3],
}

/// A walk through the pieces of a patch, nearest first.
pub(super) struct Search<'a, F> {
    frame: &'a Frame,
    whole: &'a Piece,
    lo: f64,
    hi: f64,
    left: u32,
    counts: &'a mut PatchCounts,
    each: F,
}

impl<'a> Search<'a, fn(PatchRoot) -> Next> {
    /// Parameters of a root near rough ones, in full precision, where Newton finds them.
    pub(super) fn refine(frame: &'a Frame, whole: &'a Piece, (u, v): (f64, f64)) -> Option<(f64, f64)> {
        Search::near(frame, whole, (u, v), &mut PatchCounts::default()).map(|root| (root.u, root.v))
    }

    /// The root near rough parameters, where Newton finds it.
    pub(super) fn near(
        frame: &'a Frame,
        whole: &'a Piece,
        (u, v): (f64, f64),
        counts: &'a mut PatchCounts,
    ) -> Option<PatchRoot> {
        let each: fn(PatchRoot) -> Next = |_| Next::On;
        let mut search = Search { frame, whole, lo: 0.0, hi: 0.0, left: 0, counts, each };
        // As far as f32 may have moved them.
        let around = |x: f64| Span { lo: x - 1e-7, hi: x + 1e-7 };
        search.newton(around(u), around(v)).map(|(_, root)| root)
    }
}

impl<'a, F: FnMut(PatchRoot) -> Next> Search<'a, F> {
    /// Shows `each` all meetings in the ray's interval, and perhaps some just outside it.
    pub(super) fn run(
        frame: &'a Frame,
        whole: &'a Piece,
        ray: &Ray<f64>,
        counts: &'a mut PatchCounts,
        each: F,
    ) {
        // What conversion rounds is given away on either side.
        let lo = frame.z(ray.t_min);
        let hi = frame.z(ray.t_max);
        let (lo, hi) = (lo - lo.abs() * (8.0 * U), hi + hi.abs() * (8.0 * U));
        let (lo, hi) =
            (if lo.is_nan() { f64::NEG_INFINITY } else { lo }, if hi.is_nan() { f64::INFINITY } else { hi });
        let mut search = Search { frame, whole, lo, hi, left: ALLOWED, counts, each };
        let _ = search.walk(*whole);
    }

    fn walk(&mut self, mut piece: Piece) -> ControlFlow<()> {
        loop {
            self.counts.pieces += 1;
            self.left = self.left.saturating_sub(1);
            let spans = piece.spans();
            let in_reach = spans.z.hi + piece.slack_z >= self.lo && spans.z.lo - piece.slack_z <= self.hi;
            if !(in_reach && spans.x.has_zero(piece.slack) && spans.y.has_zero(piece.slack)) {
                return ControlFlow::Continue(());
            }
            let point = 16.0 * piece.slack;
            let small = piece.u.len() <= LEAST && piece.v.len() <= LEAST;
            if small || spans.x.len() <= point && spans.y.len() <= point || self.left == 0 {
                return self.accept(&piece, &spans);
            }
            if let Some(rest) = piece.contract(&spans) {
                let (ulen, vlen) = (rest.u.len(), rest.v.len());
                if ulen < 0.0 || vlen < 0.0 {
                    return ControlFlow::Continue(());
                }
                if rest.one {
                    let [us, vs] = piece.place(&rest);
                    if let Some(root) = self.newton(us, vs) {
                        return self.found(root);
                    }
                } else if ulen * vlen <= 0.5 {
                    self.counts.clips += 1;
                    piece = piece.cut(&rest, &spans);
                    continue;
                }
            } else if piece.beside(&spans) {
                return ControlFlow::Continue(());
            }
            // One direction may go far below the least, where an edge is a point: but not below what numbers can tell apart.
            let along = match piece.longer() {
                Along::U if piece.u.len() <= 4.0 * U => Along::V,
                Along::V if piece.v.len() <= 4.0 * U => Along::U,
                along => along,
            };
            self.counts.splits += 1;
            let [a, b] = piece.halves(along, &spans);
            let sum = |grid: &Grid| grid.iter().sum::<f64>();
            let (near, far) = if sum(&a.z) <= sum(&b.z) { (a, b) } else { (b, a) };
            self.walk(near)?;
            piece = far;
        }
    }

    /// The root that a Newton iteration from the middle of a part of the patch finds, if it stays near that part.
    fn newton(&mut self, us: Span, vs: Span) -> Option<(f64, PatchRoot)> {
        let (mut u, mut v) = (us.middle(), vs.middle());
        // Twice the part around its middle, and what rounding may move.
        let (reach_u, reach_v) = (us.len() + 1e-12, vs.len() + 1e-12);
        for _ in 0..STEPS {
            self.counts.newton += 1;
            let at = self.local(u, v);
            let det = at.du[0] * at.dv[1] - at.dv[0] * at.du[1];
            let su = (at.dv[1] * at.f[0] - at.dv[0] * at.f[1]) / det;
            let sv = (at.du[0] * at.f[1] - at.du[1] * at.f[0]) / det;
            u -= su;
            v -= sv;
            if !((u - us.middle()).abs() <= reach_u && (v - vs.middle()).abs() <= reach_v) {
                return None;
            }
            let step = su.abs().max(sv.abs());
            if step <= 1e-8 {
                // The step is right to twice its digits, and so is what it changes.
                let z = at.f[2] - (at.du[2] * su + at.dv[2] * sv);
                let weight = ((at.du[2] * at.dv[1] - at.dv[2] * at.du[1]) / det).abs()
                    + ((at.dv[2] * at.du[0] - at.du[2] * at.dv[0]) / det).abs();
                let whole = self.whole;
                let size = |grid: &Grid| grid.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                let slack = whole.slack + 16.0 * U * size(&whole.x).max(size(&whole.y));
                let error = weight * slack
                    + whole.slack_z
                    + 16.0 * U * size(&whole.z) * (1.0 + step * step / U * 1e-2);
                return error.is_finite().then(|| (z, self.root(z, error, u, v)));
            }
        }
        None
    }

    fn root(&self, z: f64, error: f64, u: f64, v: f64) -> PatchRoot {
        let t = self.frame.t(z);
        PatchRoot { t, error: self.frame.t(error).abs(), u: u.clamp(0.0, 1.0), v: v.clamp(0.0, 1.0) }
    }

    /// Takes a piece that nothing excludes, and that is too small to be cut, for a meeting.
    #[cold]
    fn accept(&mut self, piece: &Piece, spans: &Spans) -> ControlFlow<()> {
        if self.left == 0 {
            self.counts.unresolved += 1;
        } else if let Some((z, root)) = self.newton(piece.u, piece.v) {
            // A root at the border of the patch, or of pieces. Where it may not be the only one, it stands for all of the piece.
            let near = (root.u - piece.u.middle()).abs() <= piece.u.len()
                && (root.v - piece.v.middle()).abs() <= piece.v.len();
            if near && piece.holds_one(spans) {
                return self.found((z, root));
            }
            let reach = (spans.z.hi - z).max(z - spans.z.lo) + 2.0 * piece.slack_z;
            let error = root.error.max(self.frame.t(reach).abs());
            return self.found((z, PatchRoot { error, ..root }));
        }
        let stretch = spans.z.len() + 2.0 * piece.slack_z;
        let point = 16.0 * piece.slack;
        if spans.x.len() <= point && spans.y.len() <= point {
            // All of it lies on the ray: the near end.
            let corners = [
                (0, piece.u.lo, piece.v.lo),
                (3, piece.u.lo, piece.v.hi),
                (12, piece.u.hi, piece.v.lo),
                (15, piece.u.hi, piece.v.hi),
            ];
            let nearest = corners.into_iter().min_by(|a, b| piece.z[a.0].total_cmp(&piece.z[b.0]));
            let (_, u, v) = nearest.unwrap_or((0, piece.u.lo, piece.v.lo));
            let z = if spans.z.len() > 64.0 * piece.slack_z {
                spans.z.lo.max(self.lo.min(spans.z.hi))
            } else {
                spans.z.middle()
            };
            return self.found((z, self.root(z, stretch, u, v)));
        }
        let (u, v) = self.closest(piece);
        let z = self.local(u, v).f[2];
        self.found((z, self.root(z, stretch, u, v)))
    }

    /// The point of a small piece that comes closest to the ray, roughly.
    fn closest(&mut self, piece: &Piece) -> (f64, f64) {
        let (mut u, mut v) = (piece.u.middle(), piece.v.middle());
        let (mut best, mut least) = ((u, v), f64::INFINITY);
        for _ in 0..STEPS {
            self.counts.newton += 1;
            let Local { f, du, dv } = self.local(u, v);
            let off = f[0] * f[0] + f[1] * f[1];
            if off >= least || off.is_nan() {
                break;
            }
            (best, least) = ((u, v), off);
            // Least squares, damped, because the Jacobian is singular somewhere here.
            let (e, g, h) =
                (du[0] * du[0] + du[1] * du[1], dv[0] * dv[0] + dv[1] * dv[1], du[0] * dv[0] + du[1] * dv[1]);
            let damp = 1e-9 * (e + g);
            let (p, q) = (du[0] * f[0] + du[1] * f[1], dv[0] * f[0] + dv[1] * f[1]);
            let det = (e + damp) * (g + damp) - h * h;
            u = (u - ((g + damp) * p - h * q) / det).clamp(piece.u.lo, piece.u.hi);
            v = (v - ((e + damp) * q - h * p) / det).clamp(piece.v.lo, piece.v.hi);
        }
        best
    }

    fn found(&mut self, (z, root): (f64, PatchRoot)) -> ControlFlow<()> {
        self.counts.roots += 1;
        match (self.each)(root) {
            Next::On => {}
            Next::Nearer => self.hi = self.hi.min(z),
            Next::Stop => return ControlFlow::Break(()),
        }
        ControlFlow::Continue(())
    }

    fn local(&self, u: f64, v: f64) -> Local {
        let ((bu, du), (bv, dv)) = (bernstein(u), bernstein(v));
        let mut local = Local { f: [0.0; 3], du: [0.0; 3], dv: [0.0; 3] };
        for (k, grid) in [&self.whole.x, &self.whole.y, &self.whole.z].into_iter().enumerate() {
            let (mut f, mut fu, mut fv) = ([0.0; 4], [0.0; 4], 0.0);
            for i in 0..4 {
                for j in 0..4 {
                    f[j] += bu[i] * grid[4 * i + j];
                    fu[j] += du[i] * grid[4 * i + j];
                }
            }
            for j in 0..4 {
                local.f[k] += bv[j] * f[j];
                local.du[k] += bv[j] * fu[j];
                fv += dv[j] * f[j];
            }
            local.dv[k] = fv;
        }
        local
    }
}

/// The cubic Bernstein polynomials and their derivatives.
#[inline(always)]
fn bernstein(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    let (ss, st, tt) = (s * s, s * t, t * t);
    (
        [s * ss, 3.0 * s * st, 3.0 * st * t, t * tt],
        [-3.0 * ss, 3.0 * ss - 6.0 * st, 6.0 * st - 3.0 * tt, 3.0 * tt],
    )
}

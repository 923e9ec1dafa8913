//! [`Piece`]: a part of a patch as a ray sees it, bounded, cut and contracted.

/// Unit roundoff of `f64`.
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// Control values of one coordinate, row by row: entry `4 i + j` belongs to `B_i(u) B_j(v)`.
pub(super) type Grid = [f64; 16];

/// The least and the greatest of a range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) lo: f64,
    pub(super) hi: f64,
}

/// The span of nothing.
const EMPTY: Span = Span { lo: f64::INFINITY, hi: f64::NEG_INFINITY };

impl Span {
    #[inline(always)]
    fn of(grid: &Grid) -> Span {
        let mut lo = [grid[0], grid[1], grid[2], grid[3]];
        let mut hi = lo;
        for row in 1..4 {
            for j in 0..4 {
                let x = grid[4 * row + j];
                lo[j] = if x < lo[j] { x } else { lo[j] };
                hi[j] = if x > hi[j] { x } else { hi[j] };
            }
        }
        Span { lo: lo[0].min(lo[1]).min(lo[2].min(lo[3])), hi: hi[0].max(hi[1]).max(hi[2].max(hi[3])) }
    }

    #[inline(always)]
    pub(super) fn len(self) -> f64 {
        self.hi - self.lo
    }

    /// The greatest absolute value.
    #[inline(always)]
    fn size(self) -> f64 {
        self.hi.max(-self.lo)
    }

    #[inline(always)]
    pub(super) fn has_zero(self, slack: f64) -> bool {
        self.lo <= slack && self.hi >= -slack
    }

    #[inline(always)]
    pub(super) fn middle(self) -> f64 {
        (self.lo + self.hi) * 0.5
    }

    /// The part at `[a, b]` of `[0, 1]`.
    fn part(self, part: Span) -> Span {
        Span { lo: self.lo + self.len() * part.lo, hi: self.lo + self.len() * part.hi }
    }
}

/// The spans of the three coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spans {
    pub(super) x: Span,
    pub(super) y: Span,
    pub(super) z: Span,
}

/// What contraction leaves of a piece, as parts of its own parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    pub(super) u: Span,
    pub(super) v: Span,
    /// Whether it holds exactly one root for certain.
    pub(super) one: bool,
}

/// A direction of the parameter square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Along {
    U,
    V,
}

/// A part of a patch, seen along the ray: the ray is where `x` and `y` are zero, `z` is the distance.
///
/// `x` and `y` are known within `slack`, `z` within `slack_z`: every cut adds what it rounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) x: Grid,
    pub(super) y: Grid,
    pub(super) z: Grid,
    /// Where in the patch it lies.
    pub(super) u: Span,
    pub(super) v: Span,
    pub(super) slack: f64,
    pub(super) slack_z: f64,
}

impl Piece {
    #[inline(always)]
    pub(super) fn spans(&self) -> Spans {
        Spans { x: Span::of(&self.x), y: Span::of(&self.y), z: Span::of(&self.z) }
    }

    /// Where a root can be, after Krawczyk, in Bernstein form: with `Y` an approximate inverse of the Jacobian in the middle,
    /// a root `p` of `f` is a fixed point of `p - Y f(p)`, which is a patch, and lies in the hull of its control points. A hull
    /// inside the piece proves that there is a root; a contraction, that there is one only. `None` where there is no inverse.
    ///
    /// This is Bézier clipping against two lines at once, the better ones of all directions.
    ///
    /// Source: Krawczyk, "Newton-Algorithmen zur Bestimmung von Nullstellen mit Fehlerschranken", *Computing* 4 (1969); Toth,
    /// "On ray tracing parametric surfaces", SIGGRAPH 1985; Nishita, Sederberg, Kakimoto, "Ray tracing trimmed rational
    /// surface patches", SIGGRAPH 1990; Efremov, Havran, Seidel, "Robust and numerically stable Bézier clipping method for
    /// ray tracing NURBS surfaces", SCCG 2005.
    #[inline]
    pub(super) fn contract(&self, spans: &Spans) -> Option<Rest> {
        let ([xu, xv], [yu, yv]) = (slopes(&self.x), slopes(&self.y));
        let det = xu * yv - xv * yu;
        let r = 1.0 / det;
        let first = self.fixed([yv * r, -xv * r], spans);
        let second = self.fixed([-yu * r, xu * r], spans);
        // Any inverse is right, but where rounding is as much as the piece, it is of no use. False for NaN.
        if !(first.1 < 0.25 && second.1 < 0.25) {
            return None;
        }
        let (mut u, mut v) = (EMPTY, EMPTY);
        for i in 0..4 {
            for j in 0..4 {
                let (a, b) = (THIRDS[i] - first.0[4 * i + j], THIRDS[j] - second.0[4 * i + j]);
                u = Span { lo: u.lo.min(a), hi: u.hi.max(a) };
                v = Span { lo: v.lo.min(b), hi: v.hi.max(b) };
            }
        }
        // And what rounding moves the ends of a cut.
        // Values that are all on one side of zero have no root either.
        let clear = |(grid, error): &(Grid, f64)| !Span::of(grid).has_zero(*error);
        if clear(&first) || clear(&second) {
            return Some(Rest { u: EMPTY, v: EMPTY, one: false });
        }
        let (u, v) = (widened(u, first.1 + 16.0 * U), widened(v, second.1 + 16.0 * U));
        let inside = u.lo > 0.0 && u.hi < 1.0 && v.lo > 0.0 && v.hi < 1.0;
        let one = inside && slope(&first, Along::U) < 0.9 && slope(&second, Along::V) < 0.9;
        let clip = |s: Span| Span { lo: s.lo.max(0.0), hi: s.hi.min(1.0) };
        Some(Rest { u: clip(u), v: clip(v), one })
    }

    /// Whether the piece, with half its length on all sides, holds one root at most: there, values of polynomials of degrees two
    /// and three are `2^2 2^3` times their control values at most, and `p - Y f(p)` contracts if its derivatives are so much
    /// smaller. False where they are as small as rounding.
    pub(super) fn holds_one(&self, spans: &Spans) -> bool {
        let ([xu, xv], [yu, yv]) = (slopes(&self.x), slopes(&self.y));
        let r = 1.0 / (xu * yv - xv * yu);
        let first = self.fixed([yv * r, -xv * r], spans);
        let second = self.fixed([-yu * r, xu * r], spans);
        32.0 * slope(&first, Along::U) < 0.9 && 32.0 * slope(&second, Along::V) < 0.9
    }

    /// Whether the piece, which is almost a line as the ray sees it, lies beside the ray: to one side of a line along it.
    pub(super) fn beside(&self, spans: &Spans) -> bool {
        let ([xu, xv], [yu, yv]) = (slopes(&self.x), slopes(&self.y));
        let (dx, dy) = if xu.abs() + yu.abs() >= xv.abs() + yv.abs() { (xu, yu) } else { (xv, yv) };
        let size = dx.abs() + dy.abs();
        let (across, error) = self.fixed([-dy / size, dx / size], spans);
        let across = Span::of(&across);
        // False for NaN.
        across.lo > error || across.hi < -error
    }

    /// A linear combination of `x` and `y`, and what it may be off by.
    #[inline(always)]
    fn fixed(&self, [a, b]: [f64; 2], spans: &Spans) -> (Grid, f64) {
        let mut grid = [0.0; 16];
        for k in 0..16 {
            grid[k] = a * self.x[k] + b * self.y[k];
        }
        let rounding = (a.abs() * spans.x.size() + b.abs() * spans.y.size()) * (4.0 * U);
        (grid, (a.abs() + b.abs()) * self.slack + rounding)
    }

    /// Where in the patch `rest` lies.
    pub(super) fn place(&self, rest: &Rest) -> [Span; 2] {
        [self.u.part(rest.u), self.v.part(rest.v)]
    }

    /// The part at `rest`.
    pub(super) fn cut(&self, rest: &Rest, spans: &Spans) -> Piece {
        let mut piece = *self;
        for grid in [&mut piece.x, &mut piece.y, &mut piece.z] {
            cut(grid, rest.u, Along::U);
            cut(grid, rest.v, Along::V);
        }
        // Two cuts a direction, three steps each, of three roundings.
        piece.slack += 36.0 * U * spans.x.size().max(spans.y.size());
        piece.slack_z += 36.0 * U * spans.z.size();
        [piece.u, piece.v] = self.place(rest);
        piece
    }

    /// Both halves.
    pub(super) fn halves(&self, along: Along, spans: &Spans) -> [Piece; 2] {
        let (mut left, mut right) = (*self, *self);
        halve(&mut left.x, &mut right.x, along);
        halve(&mut left.y, &mut right.y, along);
        halve(&mut left.z, &mut right.z, along);
        let (slack, slack_z) = (3.0 * U * spans.x.size().max(spans.y.size()), 3.0 * U * spans.z.size());
        for piece in [&mut left, &mut right] {
            piece.slack += slack;
            piece.slack_z += slack_z;
        }
        match along {
            Along::U => (left.u.hi, right.u.lo) = (self.u.middle(), self.u.middle()),
            Along::V => (left.v.hi, right.v.lo) = (self.v.middle(), self.v.middle()),
        }
        [left, right]
    }

    /// The direction in which the piece is longer in space.
    pub(super) fn longer(&self) -> Along {
        let mut sizes = [0.0f64; 2];
        for grid in [&self.x, &self.y, &self.z] {
            let (mut du, mut dv) = ([0.0f64; 4], [0.0f64; 4]);
            for i in 0..3 {
                for j in 0..4 {
                    du[j] = du[j].max((grid[4 * i + 4 + j] - grid[4 * i + j]).abs());
                    dv[j] = dv[j].max((grid[4 * j + i + 1] - grid[4 * j + i]).abs());
                }
            }
            sizes[0] = sizes[0].max(du[0].max(du[1]).max(du[2].max(du[3])));
            sizes[1] = sizes[1].max(dv[0].max(dv[1]).max(dv[2].max(dv[3])));
        }
        if sizes[0] >= sizes[1] { Along::U } else { Along::V }
    }
}

const THIRDS: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

fn widened(s: Span, by: f64) -> Span {
    Span { lo: s.lo - by, hi: s.hi + by }
}

/// The derivatives in the middle of the square.
#[inline(always)]
fn slopes(p: &Grid) -> [f64; 2] {
    // Sums over rows and columns, weighted as the middle weights them.
    let (mut rows, mut columns) = ([0.0; 4], [0.0; 4]);
    for k in 0..4 {
        rows[k] = (p[4 * k] + p[4 * k + 3]) + 3.0 * (p[4 * k + 1] + p[4 * k + 2]);
        columns[k] = (p[k] + p[12 + k]) + 3.0 * (p[4 + k] + p[8 + k]);
    }
    let slope = |s: [f64; 4]| 0.09375 * ((s[3] - s[0]) + (s[2] - s[1]));
    [slope(rows), slope(columns)]
}

/// What the derivatives of `p - grid`, that of `along` apart from 1, sum up to at most: below 1, it contracts in that row.
#[inline]
fn slope((grid, error): &(Grid, f64), along: Along) -> f64 {
    let [one_u, one_v] = if along == Along::U { [1.0, 0.0] } else { [0.0, 1.0] };
    let (mut du, mut dv) = (0.0f64, 0.0f64);
    for i in 0..3 {
        for j in 0..4 {
            du = du.max((one_u - 3.0 * (grid[4 * i + 4 + j] - grid[4 * i + j])).abs());
            dv = dv.max((one_v - 3.0 * (grid[4 * j + i + 1] - grid[4 * j + i])).abs());
        }
    }
    // Three times a difference of two that are off, in both directions.
    du + dv + 12.0 * error
}

/// The four indices of a line of control values.
#[inline(always)]
fn line(k: usize, along: Along) -> [usize; 4] {
    match along {
        Along::U => [k, k + 4, k + 8, k + 12],
        Along::V => [4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3],
    }
}

/// De Casteljau at one half; `left` and `right` both hold the whole at first.
#[inline(always)]
fn halve(left: &mut Grid, right: &mut Grid, along: Along) {
    for k in 0..4 {
        let [a, b, c, d] = line(k, along);
        let p = [left[a], left[b], left[c], left[d]];
        let (ab, bc, cd) = ((p[0] + p[1]) * 0.5, (p[1] + p[2]) * 0.5, (p[2] + p[3]) * 0.5);
        let (abc, bcd) = ((ab + bc) * 0.5, (bc + cd) * 0.5);
        let middle = (abc + bcd) * 0.5;
        (left[b], left[c], left[d]) = (ab, abc, middle);
        (right[a], right[b], right[c]) = (middle, bcd, cd);
    }
}

/// De Casteljau at both ends of a part.
#[inline(always)]
fn cut(grid: &mut Grid, part: Span, along: Along) {
    let lo = part.lo;
    // Where the other end lies in what is left.
    let hi = (part.hi - lo) / (1.0 - lo);
    let (low, high) = (1.0 - lo, 1.0 - hi);
    for k in 0..4 {
        let [a, b, c, d] = line(k, along);
        let p = [grid[a], grid[b], grid[c], grid[d]];
        let (ab, bc, cd) = (p[0] * low + p[1] * lo, p[1] * low + p[2] * lo, p[2] * low + p[3] * lo);
        let (abc, bcd) = (ab * low + bc * lo, bc * low + cd * lo);
        let p = [abc * low + bcd * lo, bcd, cd, p[3]];
        let (ab, bc, cd) = (p[0] * high + p[1] * hi, p[1] * high + p[2] * hi, p[2] * high + p[3] * hi);
        let (abc, bcd) = (ab * high + bc * hi, bc * high + cd * hi);
        (grid[a], grid[b], grid[c], grid[d]) = (p[0], ab, abc, abc * high + bcd * hi);
    }
}

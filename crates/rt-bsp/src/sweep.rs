//! The sweep: the cheapest plane across an axis.

use crate::cell::Cell;
use crate::node::unit_of;
use crate::part::Parts;
use crate::plane::cut_box;
use rt_bounds::Aabb;
use rt_geom::Axis;
use rt_geom::glam::Vec3A;

/// What splits cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prices {
    pub(crate) axis: f64,
    pub(crate) slanted: f64,
    pub(crate) test: f64,
    pub(crate) empty_bonus: f64,
}

impl Prices {
    /// The expected cost of a split, with the bonus where it cuts off empty space.
    #[inline(always)]
    pub(crate) fn cost(&self, split: f64, shares: [f64; 2], counts: [usize; 2], cuts: bool) -> f64 {
        let tests = shares[0] * counts[0] as f64 + shares[1] * counts[1] as f64;
        let cost = split + self.test * tests;
        let empties = cuts && (counts[0] == 0 || counts[1] == 0);
        if empties { cost * (1.0 - self.empty_bonus) } else { cost }
    }
}

/// A plane across an axis, what it costs, and where those that lie in it go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Across {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    pub(crate) planar_below: bool,
    pub(crate) cost: f64,
}

/// A region that is split: a box, and the polytope within, where slanted planes have cut it.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// The world, cut by the planes across axes.
    pub(crate) bound: Aabb,
    pub(crate) cell: Option<Cell>,
}

impl Region {
    pub(crate) fn area(&self) -> f64 {
        self.cell.as_ref().map_or_else(|| area(&self.bound), Cell::area)
    }
}

/// The surface area, in `f64`, where boxes of `f32` stay in range; infinite sides count as the largest finite ones.
#[inline]
pub(crate) fn area(b: &Aabb) -> f64 {
    let s = b.size().min(Vec3A::splat(f32::MAX)).as_dvec3();
    2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
}

const END: u64 = 0;
const PLANAR: u64 = 1;
const START: u64 = 2;

/// What happens to a sweep at a position, as a number in the order of positions, then of kinds.
#[inline(always)]
fn event(position: f32, kind: u64) -> u64 {
    // Both zeros are one position; bits of a float in the order of their values.
    let bits = (position + 0.0).to_bits();
    let ordered = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
    (ordered as u64) << 2 | kind
}

fn position(event: u64) -> f32 {
    let ordered = (event >> 2) as u32;
    f32::from_bits(if ordered >> 31 == 1 { ordered & !(1 << 31) } else { !ordered })
}

/// The cheapest plane across an axis through a region; of equals the first along the earliest axis.
///
/// Source: Wald and Havran, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)", RT 2006, algorithm 3; with
/// events sorted in each node.
pub(crate) fn cheapest(parts: &Parts, region: &Region, prices: &Prices) -> Option<Across> {
    let whole = region.area();
    // A line or a point cannot be met by a share of rays.
    if whole <= 0.0 {
        return None;
    }
    let mut best: Option<Across> = None;
    let mut events = Vec::with_capacity(2 * parts.list.len());
    for axis in Axis::ALL {
        let a = axis.index();
        let (low, high) = (region.bound.min[a], region.bound.max[a]);
        if low >= high {
            continue;
        }
        events.clear();
        for part in &parts.list {
            let (min, max) = (part.bound.min[a], part.bound.max[a]);
            if min == max {
                events.push(event(min, PLANAR));
            } else {
                events.extend([event(min, START), event(max, END)]);
            }
        }
        events.sort_unstable();
        let mut shares = Shares::new(region, axis, events.len());
        let (mut below, mut above) = (0usize, parts.list.len());
        let mut rest = events.as_slice();
        while let Some(&first) = rest.first() {
            let here = rest.iter().take_while(|event| *event >> 2 == first >> 2).count();
            let mut counts = [0usize; 3];
            for event in &rest[..here] {
                counts[(event & 3) as usize] += 1;
            }
            rest = &rest[here..];
            let [ends, planar, starts] = counts;
            above -= planar + ends;
            let position = position(first);
            let inside = low < position && position < high;
            // At a box's own faces only to cut off what lies in them.
            let at_face = planar > 0 && region.cell.is_none() && (position == low || position == high);
            if position.is_finite() && (inside || at_face) {
                // A cut adds to the surface: no plane costs less than this.
                let least = prices.test * below.min(above) as f64 * (1.0 - prices.empty_bonus);
                let cheap =
                    best.is_none_or(|best| prices.axis * (1.0 - prices.empty_bonus) + least < best.cost);
                if cheap && let Some(areas) = shares.at(position) {
                    let shares = [areas[0] / whole, areas[1] / whole];
                    for planar_below in [true, false] {
                        let counts =
                            if planar_below { [below + planar, above] } else { [below, above + planar] };
                        let cost = prices.cost(prices.axis, shares, counts, inside);
                        // A face that cuts off nothing would be chosen for ever.
                        let flat = if position == low { counts[0] } else { counts[1] };
                        let idle = !inside && flat == 0;
                        if !idle && best.is_none_or(|best| cost < best.cost) {
                            best = Some(Across { axis, position, planar_below, cost });
                        }
                        if planar == 0 {
                            break;
                        }
                    }
                }
            }
            below += starts + planar;
        }
    }
    best
}

/// The surfaces of the parts below and above planes across an axis.
enum Shares<'a> {
    Box {
        bound: &'a Aabb,
        axis: Axis,
    },
    Cell {
        cell: &'a Cell,
        axis: Axis,
        heights: Vec<f64>,
    },
    /// Between two corners the surfaces are quadratic: by their positions, start and three samples each.
    Pieces {
        pieces: Vec<Piece>,
        next: usize,
    },
}

struct Piece {
    from: f64,
    to: f64,
    /// At a sixth, a half and five sixths of the way.
    samples: [[f64; 2]; 3],
}

impl<'a> Shares<'a> {
    fn new(region: &'a Region, axis: Axis, positions: usize) -> Shares<'a> {
        let Some(cell) = &region.cell else { return Shares::Box { bound: &region.bound, axis } };
        let mut heights = Vec::new();
        if positions < 4 * cell.corners().len() {
            return Shares::Cell { cell, axis, heights };
        }
        let mut ends: Vec<f64> = cell.corners().iter().map(|p| p[axis.index()]).collect();
        ends.sort_unstable_by(f64::total_cmp);
        ends.dedup();
        let piece = |pair: &[f64]| {
            let samples = [1.0 / 6.0, 0.5, 5.0 / 6.0].map(|x| {
                cell.heights(unit_of(axis), pair[0] + (pair[1] - pair[0]) * x, &mut heights);
                cell.areas(&heights)
            });
            Piece { from: pair[0], to: pair[1], samples }
        };
        Shares::Pieces { pieces: ends.windows(2).map(piece).collect(), next: 0 }
    }

    /// At a position, each one above the last; `None` where the plane does not cut.
    fn at(&mut self, position: f32) -> Option<[f64; 2]> {
        match self {
            Shares::Box { bound, axis } => Some(cut_box(bound, *axis, position).map(|b| area(&b))),
            Shares::Cell { cell, axis, heights } => {
                let [low, high] = cell.heights(unit_of(*axis), position as f64, heights);
                (low < 0.0 && high > 0.0).then(|| cell.areas(heights))
            }
            Shares::Pieces { pieces, next } => {
                let x = position as f64;
                while pieces.get(*next).is_some_and(|piece| piece.to < x) {
                    *next += 1;
                }
                let piece = pieces.get(*next)?;
                if x <= piece.from && *next == 0 || x >= piece.to && *next + 1 == pieces.len() {
                    return None;
                }
                // Lagrange's form, in thirds of the piece from its middle.
                let t = ((x - piece.from) / (piece.to - piece.from) - 0.5) * 3.0;
                let [a, b, c] = piece.samples;
                let weights = [t * (t - 1.0) * 0.5, 1.0 - t * t, t * (t + 1.0) * 0.5];
                Some([0, 1].map(|i| a[i] * weights[0] + b[i] * weights[1] + c[i] * weights[2]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::DVec3;

    #[test]
    fn events_are_ordered_as_positions_are() {
        let positions = [-f32::MAX, -1.5, -1e-40, 0.0, 1e-40, 2.0, f32::MAX];
        assert!(positions.windows(2).all(|p| event(p[0], START) < event(p[1], END)));
        assert!(positions.iter().all(|p| position(event(*p, PLANAR)) == *p));
        assert_eq!(event(-0.0, END), event(0.0, END));
    }

    #[test]
    fn pieces_are_what_cutting_says() {
        let bound = Aabb::new(Vec3A::ZERO, Vec3A::new(1.0, 2.0, 3.0));
        let (mut cell, mut heights) = (Cell::of_box(&bound), Vec::new());
        for normal in [DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, -0.6, 0.8), DVec3::new(0.36, 0.48, -0.8)] {
            let middle = cell.corners().iter().sum::<DVec3>() / cell.corners().len() as f64;
            cell.heights(normal, normal.dot(middle), &mut heights);
            let [below, _] = cell.split(&heights);
            cell = below;
        }
        let region = Region { bound, cell: Some(cell) };
        for axis in Axis::ALL {
            let (mut pieces, mut direct) = (Shares::new(&region, axis, 1000), Shares::new(&region, axis, 1));
            assert!(matches!(pieces, Shares::Pieces { .. }));
            let mut cuts = 0;
            for i in 1..100 {
                let x = i as f32 * 0.03;
                match (pieces.at(x), direct.at(x)) {
                    (Some(a), Some(b)) => {
                        cuts += 1;
                        assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-12 * region.area());
                    }
                    (a, b) => assert_eq!(a, b),
                }
            }
            assert!(cuts > 10, "{cuts}");
        }
    }
}

//! The sweep: events along three axes, sorted once, and the cheapest plane among them.

use crate::build::KdTreeParams;
use crate::node::{area, cut};
use rt_bounds::Aabb;
use rt_geom::Axis;

/// What happens where a plane sweeps over a bound; in this order at one position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// A bound ends.
    End,
    /// A bound without extent along this axis lies here.
    Planar,
    /// A bound starts.
    Start,
}

/// Something that happens to reference `slot` at a position. 8 bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Event {
    pub(crate) position: f32,
    /// The reference, and in the low two bits the kind.
    tag: u32,
}

impl Event {
    pub(crate) const MOST: usize = (1 << 30) - 1;

    fn new(position: f32, kind: Kind, slot: u32) -> Event {
        // Both zeros are one position.
        Event { position: position + 0.0, tag: slot << 2 | kind as u32 }
    }

    #[inline(always)]
    pub(crate) fn kind(self) -> Kind {
        match self.tag & 3 {
            0 => Kind::End,
            1 => Kind::Planar,
            _ => Kind::Start,
        }
    }

    #[inline(always)]
    pub(crate) fn slot(self) -> u32 {
        self.tag >> 2
    }

    /// By position, kind, reference: a total order, so that sorting has one result.
    #[inline(always)]
    pub(crate) fn key(self) -> (i32, u32, u32) {
        // Bits of a float in the order of their values.
        let bits = self.position.to_bits() as i32;
        (bits ^ ((bits >> 31) as u32 >> 1) as i32, self.tag & 3, self.tag >> 2)
    }
}

/// The events of some references along each axis, sorted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Events(pub(crate) [Vec<Event>; 3]);

impl Events {
    /// The events of references with these bounds, not yet sorted.
    pub(crate) fn push(&mut self, slot: u32, bound: &Aabb) {
        for (a, events) in self.0.iter_mut().enumerate() {
            let (min, max) = (bound.min[a], bound.max[a]);
            if min == max {
                events.push(Event::new(min, Kind::Planar, slot));
            } else {
                events.push(Event::new(min, Kind::Start, slot));
                events.push(Event::new(max, Kind::End, slot));
            }
        }
    }

    pub(crate) fn sort(&mut self) {
        for events in &mut self.0 {
            events.sort_unstable_by_key(|event| event.key());
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.0.iter().map(|events| events.capacity() * size_of::<Event>()).sum()
    }
}

/// A plane, what it costs, and where those that lie in it go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    pub(crate) planar_below: bool,
    pub(crate) cost: f64,
}

/// The cheapest plane through a cell of `count` references; of equals the first along the earliest axis. Costs are in the unit of
/// [`rt_accel::Sah`].
///
/// Source: Wald and Havran, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)", RT 2006, algorithm 3.
pub(crate) fn cheapest(events: &Events, count: usize, cell: &Aabb, params: &KdTreeParams) -> Option<Plane> {
    let whole = area(cell);
    // A line or a point cannot be met by a share of rays.
    if whole <= 0.0 {
        return None;
    }
    let mut best: Option<Plane> = None;
    for axis in Axis::ALL {
        let (low, high) = (cell.min[axis.index()], cell.max[axis.index()]);
        if low >= high {
            continue;
        }
        let (mut below, mut above) = (0usize, count);
        let mut rest = events.0[axis.index()].as_slice();
        while let Some(first) = rest.first() {
            let position = first.position;
            let mut counts = [0usize; 3];
            let here = rest.iter().take_while(|event| event.position == position).count();
            for event in &rest[..here] {
                counts[event.kind() as usize] += 1;
            }
            rest = &rest[here..];
            let [ends, planar, starts] = counts;
            above -= planar + ends;
            let inside = low < position && position < high;
            // At the cell's own faces only to cut off what lies in them.
            let at_face = planar > 0 && (position == low || position == high);
            if position.is_finite() && (inside || at_face) {
                let (left, right) = cut(cell, axis, position);
                let shares = [area(&left) / whole, area(&right) / whole];
                for planar_below in [true, false] {
                    let counts = if planar_below { [below + planar, above] } else { [below, above + planar] };
                    let cost = price(shares, counts, inside, params);
                    // A face that cuts off nothing would be chosen for ever.
                    let idle = !inside && (counts[0] == 0 || counts[1] == 0) && {
                        let flat = if position == low { counts[0] } else { counts[1] };
                        flat == 0
                    };
                    if !idle && best.is_none_or(|best| cost < best.cost) {
                        best = Some(Plane { axis, position, planar_below, cost });
                    }
                    if planar == 0 {
                        break;
                    }
                }
            }
            below += starts + planar;
        }
    }
    best
}

/// The expected cost of a split, with the bonus where it cuts off empty space.
fn price(shares: [f64; 2], counts: [usize; 2], inside: bool, params: &KdTreeParams) -> f64 {
    let tests = shares[0] * counts[0] as f64 + shares[1] * counts[1] as f64;
    let cost = params.sah.traverse as f64 + params.sah.intersect as f64 * tests;
    let empties = inside && (counts[0] == 0 || counts[1] == 0);
    if empties { cost * (1.0 - params.empty_bonus as f64) } else { cost }
}

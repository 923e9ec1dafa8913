//! The traversals: of rays, of boxes, and of leaves in the order in which an eye sees them.

use crate::node::{Bsp, MAX_DEPTH, Node, View, axis_of};
use arrayvec::ArrayVec;
use core::ops::ControlFlow;
use rt_accel::{Leaf, Mailbox, Visitor};
use rt_bounds::{Aabb, SlabRay};
use rt_geom::expansion::Expansion;
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};

/// A ray as slanted planes meet it: its distances are those of a [`SlabRay`].
struct SlantRay {
    /// Where distances are 0, relative to the tree.
    origin: DVec3,
    /// A unit of distance further.
    dir: DVec3,
    /// What heights of the origin may be off.
    off: f64,
    /// What heights may be off for each unit of distance, on top of that.
    drift: f64,
}

impl SlantRay {
    /// Of a tree whose coordinates reach as far as `reach`.
    ///
    /// With `u = 2^-53`: the origin takes up to three roundings, of the shift along the ray and of both sums; a height three products
    /// and three sums. That is at most 12 u of all sizes together, times the 1-norm of a normal, which is below 1.74; `off` allows
    /// 64 u. Likewise five roundings for the slope, and two for a height that is carried on, against 32 u in `drift`.
    #[inline(always)]
    fn new<R: Real>(ray: &Ray<R>, slab: &SlabRay, origin: DVec3, reach: f64) -> SlantRay {
        let [start, unit] = slab.measure();
        let (o, d) = (ray.origin.widen(), ray.dir.widen());
        let shift = d * start;
        let sizes = o.abs().max_element() + shift.abs().max_element() + origin.abs().max_element() + reach;
        let dir = d * (1.0 / unit);
        SlantRay {
            origin: o + shift - origin,
            dir,
            off: sizes * (32.0 * f64::EPSILON),
            drift: dir.abs().max_element() * (16.0 * f64::EPSILON),
        }
    }
}

impl Bsp {
    /// Shows `visit` the leaves whose cells the ray may touch, near to far.
    #[inline(always)]
    pub(crate) fn walk<R: Real, M: Mailbox>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if self.nodes.is_empty() || !ray.is_valid() {
            return;
        }
        let mut slab = SlabRay::new(ray, self.origin, &self.bound);
        let Some([mut enter, mut leave]) = slab.span(&self.bound) else { return };
        let negative = slab.negative();
        let reach = self.bound.min.abs().max(self.bound.max.abs()).max_element() as f64;
        let slant = SlantRay::new(ray, &slab, self.origin, reach);
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<(u32, f32, f32), MAX_DEPTH>::new();
        let mut at = 0usize;
        loop {
            let node = self.nodes[at];
            if node.kind() < 3 {
                visit.node();
                let axis = axis_of(node.kind());
                let [from, to] = slab.crossing(axis, node.position());
                let (first, second) =
                    if negative[axis.index()] { (node.far(), at + 1) } else { (at + 1, node.far()) };
                if from > leave {
                    at = first;
                    leave = leave.min(to);
                } else if to < enter {
                    at = second;
                    enter = enter.max(from);
                } else {
                    let _ = stack.try_push((second as u32, enter.max(from), leave));
                    at = first;
                    leave = leave.min(to);
                }
                continue;
            }
            if !node.is_leaf() {
                visit.node();
                let Some(nodes) = self.nodes[at..].first_chunk() else { return };
                let plane = Node::plane(*nodes);
                let (below, above) = (at + nodes.len(), node.far());
                let normal = plane.normal.as_dvec3();
                let rise = normal.dot(slant.dir);
                let height = normal.dot(slant.origin) - plane.shift;
                // Within this a height says nothing, anywhere on the interval.
                let room = plane.room as f64 + slant.off + slant.drift * leave as f64;
                let (h0, h1) = (height + rise * enter as f64, height + rise * leave as f64);
                if h0 > room && h1 > room {
                    at = above;
                } else if h0 < -room && h1 < -room {
                    at = below;
                } else {
                    // Of a ray that hardly rises the ends are infinite or NaN, which cut off nothing.
                    let per = 1.0 / rise;
                    let (middle, half) = (-height * per, room * per.abs());
                    let from = ((middle - half) * (1.0 - OUT)) as f32;
                    let to = ((middle + half) * (1.0 + OUT) + f32::MIN_POSITIVE as f64) as f32;
                    let (first, second) = if rise < 0.0 { (above, below) } else { (below, above) };
                    let _ = stack.try_push((second as u32, enter.max(from), leave));
                    at = first;
                    leave = leave.min(to);
                }
                continue;
            }
            let first = node.first();
            if node.far() > 0 {
                let prims = self.prims.get(first as usize..first as usize + node.far()).unwrap_or(&[]);
                let before = ray.t_max;
                if mailbox.show(Leaf { first, prims }, ray, visit).is_break() {
                    return;
                }
                if ray.t_max != before {
                    slab.shorten(ray.t_max);
                }
            }
            // Pop what is not beyond the closest hit so far.
            loop {
                let Some(next) = stack.pop() else { return };
                if next.1 <= slab.far() {
                    (at, enter, leave) = (next.0 as usize, next.1, next.2.min(slab.far()));
                    break;
                }
            }
        }
    }

    pub(crate) fn gather_under(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        let mut stack = ArrayVec::<(u32, Aabb), { MAX_DEPTH + 1 }>::new();
        stack.push((0, self.bound));
        while let Some((index, cell)) = stack.pop() {
            let Some((view, size)) = View::at(&self.nodes, index as usize) else { continue };
            if !keep(&cell.relative_to(-self.origin)) {
                continue;
            }
            match view {
                View::Leaf { first, count } => {
                    let prims = self.prims.get(first as usize..first as usize + count).unwrap_or(&[]);
                    if !prims.is_empty() {
                        each(Leaf { first, prims });
                    }
                }
                View::Axis { above, .. } | View::Slanted { above, .. } => {
                    let [low, high] = self.cut(&cell, &view);
                    let _ = stack.try_push((above as u32, high));
                    let _ = stack.try_push((index + size as u32, low));
                }
            }
        }
    }

    /// The leaves with primitives, under nodes whose box, in world space, `keep` accepts, in the order in which an eye at `from` (in
    /// world space) sees their cells: for painters, for beams, and for whatever shall meet what is near before what is far.
    ///
    /// Along no ray from the eye does a cell come before another that was named earlier (front to back; the other way round later),
    /// exactly: on which side of a plane the eye is, is decided without rounding. A primitive that stands in several leaves comes
    /// several times. One that lies in a plane of the tree stands on one side of it only, and may be named before or after what else
    /// touches that plane. An eye that is not finite sees nothing. `Break` ends it.
    ///
    /// Cost: `O(1)` for each node that `keep` accepts, besides `keep`.
    ///
    /// Source: Fuchs, Kedem and Naylor, "On visible surface generation by a priori tree structures", SIGGRAPH 1980.
    pub fn ordered(
        &self,
        from: DVec3,
        order: Order,
        keep: &mut dyn FnMut(&Aabb) -> bool,
        each: &mut dyn FnMut(Leaf<'_>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if !from.is_finite() {
            return ControlFlow::Continue(());
        }
        let mut stack = ArrayVec::<(u32, Aabb), { MAX_DEPTH + 1 }>::new();
        stack.push((0, self.bound));
        while let Some((index, cell)) = stack.pop() {
            let Some((view, size)) = View::at(&self.nodes, index as usize) else { continue };
            if !keep(&cell.relative_to(-self.origin)) {
                continue;
            }
            let (above, side) = match view {
                View::Leaf { first, count } => {
                    let prims = self.prims.get(first as usize..first as usize + count).unwrap_or(&[]);
                    if !prims.is_empty() {
                        each(Leaf { first, prims })?;
                    }
                    continue;
                }
                View::Axis { axis, position, above } => {
                    let a = axis.index();
                    (above, side(from[a], self.origin[a], position as f64))
                }
                View::Slanted { plane, above } => {
                    (above, side_of_plane(from, self.origin, plane.normal.as_dvec3(), plane.shift))
                }
            };
            let [low, high] = self.cut(&cell, &view);
            let (low, high) = ((index + size as u32, low), (above as u32, high));
            let above_first = (side > 0) == (order == Order::FrontToBack);
            let (first, second) = if above_first { (high, low) } else { (low, high) };
            let _ = stack.try_push(second);
            let _ = stack.try_push(first);
        }
        ControlFlow::Continue(())
    }
}

/// Twice the rounding of a distance to `f32`.
const OUT: f64 = 1.0 / (1u64 << 22) as f64;

/// Which leaves come first; see [`Bsp::ordered`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// What is near before what is far.
    FrontToBack,
    /// What is far before what is near: what painters want.
    BackToFront,
}

/// The sign of `from - origin - position`.
fn side(from: f64, origin: f64, position: f64) -> i32 {
    Expansion::<2>::difference(from, origin).plus::<1, 3>(&Expansion::new(-position)).sign()
}

/// The sign of `normal . (from - origin) - shift`: in `f64` almost always, else exactly.
fn side_of_plane(from: DVec3, origin: DVec3, normal: DVec3, shift: f64) -> i32 {
    let height = normal.dot(from - origin) - shift;
    let size = (from.abs() + origin.abs()).dot(normal.abs()) + shift.abs();
    if height.abs() > size * (8.0 * f64::EPSILON) {
        return if height > 0.0 { 1 } else { -1 };
    }
    let along = |a: usize| Expansion::<2>::difference(from[a], origin[a]).scaled::<4>(normal[a]);
    let sum = along(0).plus::<4, 8>(&along(1)).plus::<4, 12>(&along(2));
    sum.plus::<1, 13>(&Expansion::new(-shift)).sign()
}

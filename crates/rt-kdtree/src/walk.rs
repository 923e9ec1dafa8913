//! The traversal: near child first, far child on the stack, each with its interval of the ray.

use crate::node::{KdTree, MAX_DEPTH, cut};
use arrayvec::ArrayVec;
use rt_accel::{Leaf, Mailbox, Visitor};
use rt_bounds::{Aabb, SlabRay};
use rt_geom::{Ray, Real};

impl KdTree {
    /// Shows `visit` the leaves whose cells the ray may touch, near to far.
    #[inline(always)]
    pub(crate) fn walk<R: Real, M: Mailbox>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if self.nodes.is_empty() || !ray.is_valid() {
            return;
        }
        let mut slab = SlabRay::new(ray, self.origin, &self.bound);
        let Some([mut enter, mut leave]) = slab.span(&self.bound) else { return };
        let negative = slab.negative();
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<(u32, f32, f32), MAX_DEPTH>::new();
        let mut at = 0usize;
        loop {
            let node = self.nodes[at];
            if !node.is_leaf() {
                visit.node();
                let axis = node.axis();
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
            let Some(&node) = self.nodes.get(index as usize) else { continue };
            if !keep(&cell.relative_to(-self.origin)) {
                continue;
            }
            if node.is_leaf() {
                let first = node.first();
                let prims = self.prims.get(first as usize..first as usize + node.far()).unwrap_or(&[]);
                if !prims.is_empty() {
                    each(Leaf { first, prims });
                }
            } else {
                let (low, high) = cut(&cell, node.axis(), node.position());
                let _ = stack.try_push((node.far() as u32, high));
                let _ = stack.try_push((index + 1, low));
            }
        }
    }
}

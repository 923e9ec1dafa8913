//! The traversal: near child first, far child on the stack, each with its interval of the ray.

use crate::node::{KdTree, MAX_DEPTH, View, cut};
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
        // All ones where a ray descends: it then meets the child above first.
        let descends = slab.negative().map(|negative| (negative as u32).wrapping_neg());
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<(u32, f32, f32), MAX_DEPTH>::new();
        let mut at = 0u32;
        loop {
            let node = self.nodes[at as usize];
            let next = if !node.is_leaf() {
                visit.node();
                let axis = node.axis();
                let [from, to] = slab.crossing(axis, node.position());
                // Both numbers, 0 for a child that is empty, in the order of the ray; a branch would be guessed wrong too often.
                let above = node.far() as u32;
                let below = if above == at + 1 { 0 } else { at + 1 };
                let swap = (below ^ above) & descends[axis.index()];
                let (first, second) = (below ^ swap, above ^ swap);
                if from > leave {
                    first
                } else if to < enter {
                    second
                } else if second == 0 {
                    leave = leave.min(to);
                    first
                } else if first == 0 {
                    enter = enter.max(from);
                    second
                } else {
                    let _ = stack.try_push((second, enter.max(from), leave));
                    leave = leave.min(to);
                    first
                }
            } else {
                let first = node.first();
                let prims = self.prims.get(first as usize..first as usize + node.far()).unwrap_or(&[]);
                let before = ray.t_max;
                if mailbox.show(Leaf { first, prims }, ray, visit).is_break() {
                    return;
                }
                if ray.t_max != before {
                    slab.shorten(ray.t_max);
                }
                0
            };
            if next != 0 {
                at = next;
                continue;
            }
            // Pop what is not beyond the closest hit so far.
            loop {
                let Some(next) = stack.pop() else { return };
                if next.1 <= slab.far() {
                    (at, enter, leave) = (next.0, next.1, next.2.min(slab.far()));
                    break;
                }
            }
        }
    }

    pub(crate) fn gather_under(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        let mut stack = ArrayVec::<(usize, Aabb), { MAX_DEPTH + 1 }>::new();
        stack.push((0, self.bound));
        while let Some((index, cell)) = stack.pop() {
            let Some(&node) = self.nodes.get(index) else { continue };
            if !keep(&cell.relative_to(-self.origin)) {
                continue;
            }
            match node.view(index) {
                View::Leaf { first, count } => {
                    let prims = self.prims.get(first as usize..first as usize + count).unwrap_or(&[]);
                    if !prims.is_empty() {
                        each(Leaf { first, prims });
                    }
                }
                View::Split { axis, position, children: [below, above] } => {
                    let (low, high) = cut(&cell, axis, position);
                    for (child, cell) in [(above, high), (below, low)] {
                        let _ = child.map(|child| stack.try_push((child, cell)));
                    }
                }
            }
        }
    }
}

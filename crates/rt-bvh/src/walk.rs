//! The traversal: near child first, far child on the stack.

use crate::node::{Bvh, Child, MAX_DEPTH};
use arrayvec::ArrayVec;
use core::ops::ControlFlow;
use rt_accel::{Leaf, Visitor};
use rt_bounds::{Aabb, SlabRay};
use rt_geom::{Ray, Real};

/// A walk pushes at most one child a level; a stack that is full stays so, and never is.
type Stack<T> = ArrayVec<T, { MAX_DEPTH + 1 }>;

impl Bvh {
    #[inline(always)]
    pub(crate) fn leaf(&self, child: Child) -> Leaf<'_> {
        Leaf { first: child.index, prims: self.prims.get(child.range()).unwrap_or(&[]) }
    }

    /// Shows `visit` the leaves that `ray` may touch; near to far unless `ANY`, where order buys nothing.
    #[inline(always)]
    pub(crate) fn walk<R: Real, const ANY: bool>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if self.nodes.is_empty() || !ray.is_valid() {
            return;
        }
        let mut slab = SlabRay::new(ray, self.origin, &self.bound);
        let mut stack = Stack::<(Child, f32)>::new();
        let mut at = Child::node(0);
        loop {
            if at.is_leaf() {
                let before = ray.t_max;
                if let ControlFlow::Break(()) = visit.leaf(self.leaf(at), ray) {
                    return;
                }
                if ray.t_max != before {
                    slab.shorten(ray.t_max);
                }
            } else {
                visit.node();
                let node = &self.nodes[at.index as usize];
                let (met, entry) = slab.enter_pair(&node.pair());
                if met != 0 {
                    // Both met: the nearer first, the left one of equals.
                    let near = if met == 3 { (entry[1] < entry[0]) as usize } else { (met >> 1) as usize };
                    at = node.child(near);
                    if met == 3 {
                        let _ = stack.try_push((node.child(1 - near), entry[1 - near]));
                    }
                    continue;
                }
            }
            // Pop what is not beyond the closest hit so far.
            loop {
                let Some((child, entry)) = stack.pop() else { return };
                if ANY || entry <= slab.far() {
                    at = child;
                    break;
                }
            }
        }
    }

    pub(crate) fn gather_under(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        let out = |b: &Aabb| b.relative_to(-self.origin);
        if self.nodes.is_empty() || !keep(&out(&self.bound)) {
            return;
        }
        let mut stack = Stack::<u32>::new();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            let boxes = node.boxes();
            // The right child is pushed first, so that the left comes first.
            let mut inner = [None; 2];
            for side in 0..2 {
                let child = node.child(side);
                if boxes[side].is_valid() && keep(&out(&boxes[side])) {
                    if child.is_leaf() {
                        each(self.leaf(child));
                    } else {
                        inner[1 - side] = Some(child.index);
                    }
                }
            }
            for index in inner.into_iter().flatten() {
                let _ = stack.try_push(index);
            }
        }
    }
}

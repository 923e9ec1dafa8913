//! New bounds, same tree.

use crate::node::Bvh;
use rt_accel::{Bounded, Refit};
use rt_bounds::Aabb;

impl Refit for Bvh {
    /// `O(n)`, children before parents. A bound that has become invalid leaves its primitive unreachable until the next refit.
    fn refit(&mut self, source: &dyn Bounded) {
        let mut bounds = vec![Aabb::EMPTY; self.nodes.len()];
        for i in (0..self.nodes.len()).rev() {
            let [left, right] = [0, 1].map(|side| {
                let child = self.nodes[i].child(side);
                if child.is_leaf() {
                    let bound = |&prim: &u32| source.bound_from(prim, self.origin);
                    let prims = self.prims.get(child.range()).unwrap_or(&[]);
                    prims.iter().map(bound).filter(|b| b.is_valid()).fold(Aabb::EMPTY, Aabb::union)
                } else {
                    bounds[child.index as usize]
                }
            });
            self.nodes[i].set_boxes(&left, &right);
            bounds[i] = left.union(right);
        }
        self.bound = bounds.first().copied().unwrap_or(Aabb::EMPTY);
    }
}

//! [`Node`] and [`Bvh`]: the tree.

use bytemuck::{Pod, Zeroable};
use rt_accel::{Bounded, Invalid, Sah};
use rt_bounds::{Aabb, BoxPair};
use rt_geom::glam::DVec3;

/// The greatest number of nodes on a way from the root to a leaf.
pub const MAX_DEPTH: usize = 64;

/// An inner node: its two children, their boxes side by side. 64 bytes.
///
/// A child is a leaf if the [`LEAF`](Node::LEAF) bit of its `count` is set: then `child` is the first of its `count`
/// references. Else `child` is the number of a node.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Node {
    planes: [[f32; 4]; 3],
    child: [u32; 2],
    count: [u32; 2],
}

/// What a node's slot leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Child {
    pub(crate) index: u32,
    /// Zero for a node, else `LEAF` and the number of primitives.
    pub(crate) count: u32,
}

impl Child {
    pub(crate) fn node(index: usize) -> Child {
        Child { index: index as u32, count: 0 }
    }

    pub(crate) fn leaf(first: usize, len: usize) -> Child {
        Child { index: first as u32, count: Node::LEAF | len as u32 }
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.count & Node::LEAF != 0
    }

    /// The references of a leaf.
    #[inline(always)]
    pub(crate) fn range(self) -> core::ops::Range<usize> {
        let first = self.index as usize;
        first..first + (self.count & !Node::LEAF) as usize
    }
}

impl Node {
    /// The bit of a count that marks a leaf.
    pub const LEAF: u32 = 1 << 31;

    /// A node to be filled: two empty leaves in empty boxes.
    pub(crate) fn blank() -> Node {
        let mut node = Node { planes: [[0.0; 4]; 3], child: [0; 2], count: [Node::LEAF; 2] };
        node.set_boxes(&Aabb::EMPTY, &Aabb::EMPTY);
        node
    }

    #[inline(always)]
    pub(crate) fn pair(&self) -> BoxPair {
        BoxPair { planes: self.planes }
    }

    pub(crate) fn boxes(&self) -> [Aabb; 2] {
        self.pair().boxes()
    }

    pub(crate) fn set_boxes(&mut self, left: &Aabb, right: &Aabb) {
        self.planes = BoxPair::new(left, right).planes;
    }

    #[inline(always)]
    pub(crate) fn child(&self, side: usize) -> Child {
        Child { index: self.child[side], count: self.count[side] }
    }

    pub(crate) fn set_child(&mut self, side: usize, child: Child) {
        self.child[side] = child.index;
        self.count[side] = child.count;
    }

    /// The same node with `nodes` added to the numbers of nodes and `refs` to those of references, wrapping.
    pub(crate) fn shifted(mut self, nodes: u32, refs: u32) -> Node {
        for side in 0..2 {
            let by = if self.child(side).is_leaf() { refs } else { nodes };
            self.child[side] = self.child[side].wrapping_add(by);
        }
        self
    }
}

/// A two-wide bounding volume hierarchy in `f32`, for rays of both precisions.
///
/// 64 bytes a node and 4 bytes a reference: about 36 bytes a primitive at four to a leaf.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    pub(crate) origin: DVec3,
    pub(crate) bound: Aabb,
    /// Empty only when there is nothing to hit.
    pub(crate) nodes: Vec<Node>,
    pub(crate) prims: Vec<u32>,
    pub(crate) skipped: Vec<u32>,
    pub(crate) sah: Sah,
    pub(crate) built_cost: f32,
}

impl Bvh {
    /// The nodes, the root first, each before its children: `bytemuck` casts them to bytes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The primitive numbers that leaves refer to.
    pub fn references(&self) -> &[u32] {
        &self.prims
    }

    /// The expected cost of a ray through the bound by the surface area heuristic, in the unit of the build's [`Sah`].
    ///
    /// `O(n)`. Grows when a refit loosens the tree: against [`Bvh::built_sah_cost`] it says when to rebuild.
    pub fn sah_cost(&self) -> f32 {
        let whole = area(&self.bound);
        let mut cost = 0.0;
        for node in &self.nodes {
            for (side, b) in node.boxes().iter().enumerate() {
                let child = node.child(side);
                let price = if child.is_leaf() {
                    self.sah.intersect * child.range().len() as f32
                } else {
                    self.sah.traverse
                };
                if price > 0.0 {
                    cost += area(b) * price as f64;
                }
            }
        }
        if whole > 0.0 { self.sah.traverse + (cost / whole) as f32 } else { 0.0 }
    }

    /// [`Bvh::sah_cost`] when the tree was built.
    pub fn built_sah_cost(&self) -> f32 {
        self.built_cost
    }

    /// The number of nodes on the longest way from the root to a leaf.
    pub fn depth(&self) -> usize {
        let mut deepest = 0;
        let mut depths = vec![0u8; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let depth = depths[i] + 1;
            deepest = deepest.max(depth as usize);
            for side in 0..2 {
                let child = node.child(side);
                if !child.is_leaf() {
                    depths[child.index as usize] = depth;
                }
            }
        }
        deepest
    }

    pub(crate) fn check(&self, source: &dyn Bounded) -> Result<(), Invalid> {
        let fail = |what: String| Err(Invalid(what));
        let mut seen = vec![false; source.prim_count()];
        let mut reached = vec![false; self.nodes.len()];
        if let Some(root) = reached.first_mut() {
            *root = true;
        }
        let mut parents = vec![self.bound; self.nodes.len()];
        let mut next_ref = 0;
        let mut leaves = Vec::new();
        for (i, node) in self.nodes.iter().enumerate() {
            if !reached[i] {
                return fail(format!("node {i} has no parent before it"));
            }
            for (side, b) in node.boxes().into_iter().enumerate() {
                let child = node.child(side);
                if !parents[i].contains(b) {
                    return fail(format!("child {side} of node {i} sticks out of its parent: {b:?}"));
                }
                if !child.is_leaf() {
                    let Some(reached) = reached.get_mut(child.index as usize) else {
                        return fail(format!(
                            "child {side} of node {i} is node {}, which is none",
                            child.index
                        ));
                    };
                    if core::mem::replace(reached, true) {
                        return fail(format!("node {} has two parents", child.index));
                    }
                    parents[child.index as usize] = b;
                    continue;
                }
                let Some(prims) = self.prims.get(child.range()) else {
                    return fail(format!("leaf {side} of node {i} ends beyond the references"));
                };
                for &prim in prims {
                    let Some(seen) = seen.get_mut(prim as usize) else {
                        return fail(format!(
                            "leaf {side} of node {i} names primitive {prim}, which is none"
                        ));
                    };
                    if core::mem::replace(seen, true) {
                        return fail(format!("primitive {prim} stands in two leaves"));
                    }
                    if !b.contains(source.bound_from(prim, self.origin)) {
                        return fail(format!("primitive {prim} sticks out of leaf {side} of node {i}"));
                    }
                }
                if !prims.is_empty() {
                    leaves.push(child.range());
                }
            }
        }
        leaves.sort_by_key(|range| range.start);
        for leaf in leaves {
            if leaf.start != next_ref {
                return fail(format!("references {next_ref}..{} belong to no leaf or to two", leaf.start));
            }
            next_ref = leaf.end;
        }
        for &prim in &self.skipped {
            if core::mem::replace(&mut seen[prim as usize], true) {
                return fail(format!("primitive {prim} is both skipped and in the tree"));
            }
        }
        match seen.iter().position(|seen| !seen) {
            Some(prim) => fail(format!("primitive {prim} is missing")),
            None if self.depth() > MAX_DEPTH => fail(format!("the tree is {} deep", self.depth())),
            None => Ok(()),
        }
    }
}

/// Half the surface area, in `f64`, where neither small nor large boxes of `f32` leave the range; infinite sides count as the
/// largest finite ones.
#[inline]
pub(crate) fn area(b: &Aabb) -> f64 {
    let s = b.size().min(rt_geom::glam::Vec3A::splat(f32::MAX)).as_dvec3();
    s.x * s.y + s.y * s.z + s.z * s.x
}

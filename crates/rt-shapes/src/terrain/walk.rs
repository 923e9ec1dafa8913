//! [`Walk`]: the facets of a terrain that a ray may meet, near to far.

use super::{Heights, Terrain, first_of};
use crate::Triangle;
use crate::near::Near;
use core::ops::ControlFlow;
use rt_accel::Counts;
use rt_geom::glam::DVec2;
use rt_geom::{Ray, Real};

/// Vertices are named by whole numbers of this many binary digits, whatever the level.
pub(super) const DIGITS: u32 = 30;
/// The far side.
pub(super) const FULL: u32 = 1 << DIGITS;

const U: f64 = f64::EPSILON / 2.0;

/// A triangle of the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Its corners, turning left seen from above.
    pub(super) at: [[u32; 2]; 3],
    /// Their heights.
    pub(super) z: [f64; 3],
    pub(super) level: u32,
    /// Its number among those of its level.
    pub(super) prim: u32,
}

impl Node {
    pub(super) fn new(corners: [([u32; 2], f64); 3], prim: u32) -> Node {
        Node { at: corners.map(|c| c.0), z: corners.map(|c| c.1), level: 0, prim }
    }

    pub(super) fn lowest(&self) -> f64 {
        self.z[0].min(self.z[1]).min(self.z[2])
    }

    pub(super) fn highest(&self) -> f64 {
        self.z[0].max(self.z[1]).max(self.z[2])
    }

    /// Its number among all.
    #[inline]
    pub(super) fn index(&self) -> usize {
        first_of(self.level) + self.prim as usize
    }

    /// The heights of the middles of its edges.
    #[inline]
    pub(super) fn middles(&self, heights: &impl Heights) -> [f64; 3] {
        [(0, 1), (1, 2), (2, 0)].map(|(a, b)| {
            heights.middle(middle(self.at[a], self.at[b]), self.level + 1, [self.z[a], self.z[b]])
        })
    }

    /// Its four quarters: those at the corners, and that in the middle.
    #[inline]
    pub(super) fn children(&self, middles: &[f64; 3]) -> [Node; 4] {
        let [a, b, c] = core::array::from_fn(|k| (self.at[k], self.z[k]));
        let between = |i: usize, j: usize, k: usize| (middle(self.at[i], self.at[j]), middles[k]);
        let (ab, bc, ca) = (between(0, 1, 0), between(1, 2, 1), between(2, 0, 2));
        let level = self.level + 1;
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
            .map(|corners| Node { level, ..Node::new(corners, 0) })
            .map({
                let mut k = 0;
                move |node| {
                    k += 1;
                    Node { prim: self.prim * 4 + k - 1, ..node }
                }
            })
    }
}

#[inline]
fn middle(a: [u32; 2], b: [u32; 2]) -> [u32; 2] {
    [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
}

/// A walk of a ray through the tree.
pub(super) struct Walk<'a, R: Real, H, F> {
    terrain: &'a Terrain<H>,
    ray: &'a mut Ray<R>,
    /// Its line: spans are along this.
    near: Near,
    /// What a coordinate, relative to a vertex, may be off by.
    error: f64,
    /// What heights may be off by: of vertices, by two roundings a level; of the ray's origin, where that was moved.
    height_error: f64,
    counts: &'a mut Counts,
    each: F,
}

impl<'a, R: Real, H: Heights, F: FnMut(u32, Triangle, &mut Ray<R>) -> ControlFlow<()>> Walk<'a, R, H, F> {
    /// Shows `each` every facet that the ray may meet; it may shorten the ray.
    pub(super) fn run(
        terrain: &'a Terrain<H>,
        ray: &'a mut Ray<R>,
        counts: &'a mut Counts,
        each: F,
    ) -> ControlFlow<()> {
        if !ray.is_valid() {
            return ControlFlow::Continue(());
        }
        let [min, max] = terrain.bound;
        let size = min.abs().max(max.abs()).max_element();
        let near = Near::new(&ray.widen(), (min + max) * 0.5, size);
        let mut span = Span { from: near.before(ray.t_min.into()), to: near.after(ray.t_max.reach()) };
        for a in 0..3 {
            // The rounding of vertices and of what lies between them and the origin.
            let error = near.error[a] + 8.0 * U * (near.origin[a].abs() + size);
            span.keep(near.origin[a] - min[a], near.dir[a], error);
            span.keep(max[a] - near.origin[a], -near.dir[a], error);
        }
        if span.is_empty() || !(span.from.is_finite() && span.to.is_finite()) {
            return ControlFlow::Continue(());
        }
        let error = near.error.max_element() + 8.0 * U * (near.origin.abs().max_element() + size);
        let height_error = 64.0 * f64::EPSILON * terrain.tall + near.error.z;
        let mut walk = Walk { terrain, ray, near, error, height_error, counts, each };
        let roots = terrain.roots();
        let spans = roots.map(|node| walk.enter(&node, span));
        let order = if spans[0].from <= spans[1].from { [0, 1] } else { [1, 0] };
        for k in order {
            walk.open(&roots[k], spans[k])?;
        }
        ControlFlow::Continue(())
    }

    /// Opens a node that the ray is in during `span`.
    fn open(&mut self, node: &Node, mut span: Span) -> ControlFlow<()> {
        span.to = span.to.min(self.near.after(self.ray.t_max.reach()));
        if span.is_empty() {
            return ControlFlow::Continue(());
        }
        if node.level == self.terrain.params.level {
            self.counts.prims += 1;
            return (self.each)(node.prim, self.terrain.triangle(node), self.ray);
        }
        self.counts.nodes += 1;
        let children = node.children(&node.middles(&self.terrain.heights));
        let spans = children.map(|child| self.enter(&child, span));
        let mut order = [0, 1, 2, 3];
        order.sort_unstable_by(|&a, &b| spans[a].from.total_cmp(&spans[b].from));
        for k in order {
            if !spans[k].is_empty() {
                self.open(&children[k], spans[k])?;
            }
        }
        ControlFlow::Continue(())
    }

    /// The part of `span` in which the ray is in the prism over the node.
    ///
    /// In each edge function, two products of differences: 4 roundings of each of the factors, `error` for those of their
    /// operands. The height over the plane is a sum of these times heights.
    #[inline]
    fn enter(&self, node: &Node, mut span: Span) -> Span {
        let p: [DVec2; 3] = node.at.map(|at| self.terrain.place(at));
        let Near { origin, dir, .. } = self.near;
        let (o, d) = (origin.truncate(), dir.truncate());
        let far = span.from.abs().max(span.to.abs());
        let (mut above, mut along, mut bound, mut area) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..3 {
            let (a, b) = (p[k], p[(k + 1) % 3]);
            let edge = b - a;
            let at = edge.perp_dot(o - a);
            let slope = edge.perp_dot(d);
            let size = edge.abs().element_sum();
            let slack = size * self.error * 2.0 + 4.0 * U * far * size * d.abs().max_element();
            span.keep(at, slope, slack);
            // The weight of the opposite corner.
            let z = node.z[(k + 2) % 3];
            above += z * at;
            along += z * slope;
            area += at;
            bound += z.abs() * (slack + 4.0 * U * (at.abs() + far * slope.abs()));
        }
        let reach = match self.terrain.reach.get(node.index()) {
            Some(reach) if node.level < self.terrain.params.cached => *reach,
            _ => {
                let beyond = self.terrain.beyond.get(node.level as usize).copied().unwrap_or(0.0);
                [-beyond, beyond]
            }
        };
        // Heights, too, were rounded on their way: twice a level.
        let (at, slope) = (origin.z * area - above, dir.z * area - along);
        let size = area.abs();
        let slack = 2.0 * bound
            + 4.0 * U * size * (origin.z.abs() + far * dir.z.abs())
            + size * self.height_error
            + (origin.z.abs() + far * dir.z.abs()) * 6.0 * bound_of_area(&p, self.error);
        span.keep(at - reach[0] * area, slope, slack);
        span.keep(reach[1] * area - at, -slope, slack);
        span
    }
}

/// What the sum of the three edge functions may be off by.
fn bound_of_area(p: &[DVec2; 3], error: f64) -> f64 {
    let size = (p[1] - p[0]).abs().max((p[2] - p[0]).abs()).element_sum();
    size * error * 2.0
}

/// An interval of the ray.
#[derive(Clone, Copy, Debug)]
struct Span {
    from: f64,
    to: f64,
}

impl Span {
    #[inline(always)]
    fn is_empty(self) -> bool {
        self.from > self.to
    }

    /// Keeps what fulfils `at + slope t >= -slack`, and a rounding more; products may have underflowed.
    #[inline(always)]
    fn keep(&mut self, at: f64, slope: f64, slack: f64) {
        let at = at + (slack + f64::MIN_POSITIVE);
        let t = -at / slope;
        let t = (t, t.abs() * (4.0 * U));
        if slope > 0.0 {
            self.from = self.from.max(t.0 - t.1);
        } else if slope < 0.0 {
            self.to = self.to.min(t.0 + t.1);
        } else if at < 0.0 {
            self.to = f64::NEG_INFINITY;
        }
    }
}

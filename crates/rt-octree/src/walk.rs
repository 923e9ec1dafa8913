//! The traversal: eight intervals at once, the nearest child first, the others on the stack.

use crate::linear::{level, run_of};
use crate::octree::{LEAF, Octree, Place, Run, STACK, View};
use crate::params::Storage;
use crate::planes::{child, middle};
use arrayvec::ArrayVec;
use rt_accel::{Leaf, Mailbox, Visitor};
use rt_bounds::{Aabb, SlabRay};
use rt_geom::glam::Vec4;
use rt_geom::{Axis, Ray, Real};

/// Which bits are set in a number whose bits were numbered by how they are met: `MIRRORED[m][full]` has bit `c` where
/// `full` has `c ^ m`.
const MIRRORED: [[u8; 256]; 8] = {
    let mut table = [[0u8; 256]; 8];
    let mut m = 0;
    while m < 8 {
        let mut full = 0;
        while full < 256 {
            let mut c = 0;
            while c < 8 {
                table[m][full] |= ((full >> (c ^ m) & 1) as u8) << c;
                c += 1;
            }
            full += 1;
        }
        m += 1;
    }
    table
};

/// Where a ray enters and leaves the eight children of a node, numbered as it meets them; rounded outward.
struct Spans {
    enter: [[f32; 4]; 2],
    leave: [[f32; 4]; 2],
    /// Bit `c` is set where child `c` may be met.
    met: u32,
}

impl Spans {
    #[inline(always)]
    fn new(slab: &SlabRay, planes: [f32; 3], enter: f32, leave: f32) -> Spans {
        let [fx, tx] = slab.crossing(Axis::X, planes[0]);
        let [fy, ty] = slab.crossing(Axis::Y, planes[1]);
        let [fz, tz] = slab.crossing(Axis::Z, planes[2]);
        // Children 0 to 3: not, along x, along y, along both. Where a crossing is not a number its child is empty.
        let from =
            Vec4::new(enter, fx, enter, fx).max(Vec4::new(enter, enter, fy, fy)).max(Vec4::splat(enter));
        let to = Vec4::new(tx, leave, tx, leave).min(Vec4::new(ty, ty, leave, leave)).min(Vec4::splat(leave));
        let (from_z, to_z) = (Vec4::splat(fz).max(from), Vec4::splat(tz).min(to));
        let met = from.cmple(to_z).bitmask() | from_z.cmple(to).bitmask() << 4;
        Spans { enter: [from.to_array(), from_z.to_array()], leave: [to_z.to_array(), to.to_array()], met }
    }

    #[inline(always)]
    fn of(&self, c: usize) -> (f32, f32) {
        (self.enter[c >> 2 & 1][c & 3], self.leave[c >> 2 & 1][c & 3])
    }
}

impl Octree {
    /// Shows `visit` the leaves whose cells the ray may touch, near to far.
    #[inline(always)]
    pub(crate) fn walk<R: Real, M: Mailbox>(&self, ray: &mut Ray<R>, visit: &mut impl Visitor<R>) {
        if self.prims.is_empty() || !ray.is_valid() {
            return;
        }
        let mut slab = SlabRay::new(ray, self.origin, &self.bound);
        let Some(span) = slab.span(&self.bound) else { return };
        match self.storage {
            Storage::Nodes => self.walk_nodes::<R, M>(&mut slab, span, ray, visit),
            Storage::Linear => self.walk_keys::<R, M>(&mut slab, span, ray, visit),
        }
    }

    #[inline(always)]
    fn walk_nodes<R: Real, M: Mailbox>(
        &self,
        slab: &mut SlabRay,
        [mut enter, mut leave]: [f32; 2],
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) {
        let mirror = mirror(slab);
        let mirrored = &MIRRORED[mirror];
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<(u32, f32, f32), STACK>::new();
        let mut at = if self.nodes.is_empty() { LEAF } else { 0 };
        loop {
            if at & LEAF == 0 {
                visit.node();
                let node = &self.nodes[at as usize];
                let spans = Spans::new(slab, node.planes, enter, leave);
                let mut met = spans.met & mirrored[node.full as usize] as u32;
                if met != 0 {
                    // The nearest is gone to, the others are left behind, the farthest first.
                    let nearest = met.trailing_zeros() as usize;
                    met &= met - 1;
                    while met != 0 {
                        let c = 31 - met.leading_zeros() as usize;
                        let (enter, leave) = spans.of(c);
                        let _ = stack.try_push((node.link(c ^ mirror), enter, leave));
                        met ^= 1 << c;
                    }
                    at = node.link(nearest ^ mirror);
                    (enter, leave) = spans.of(nearest);
                    continue;
                }
            } else {
                let (first, prims) = self.leaf(at & !LEAF);
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
                    (at, enter, leave) = (next.0, next.1, next.2.min(slab.far()));
                    break;
                }
            }
        }
    }

    /// The same without nodes: cells are halved anew, and children are searched for.
    fn walk_keys<R: Real, M: Mailbox>(
        &self,
        slab: &mut SlabRay,
        [enter, leave]: [f32; 2],
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) {
        let mirror = mirror(slab);
        let mut mailbox = M::default();
        let mut stack = ArrayVec::<(Run, Aabb, f32, f32), STACK>::new();
        let all = Run { first: 0, last: self.keys.len() as u32, prefix: 0, level: 0 };
        let mut next = Some((all, self.bound, enter, leave));
        while let Some((run, cell, enter, leave)) = next {
            if run.last - run.first == 1 && level(self.keys[run.first as usize]) <= run.level {
                let (first, prims) = self.leaf(run.first);
                let before = ray.t_max;
                if mailbox.show(Leaf { first, prims }, ray, visit).is_break() {
                    return;
                }
                if ray.t_max != before {
                    slab.shorten(ray.t_max);
                }
            } else {
                visit.node();
                let planes = middle(&cell, &self.core);
                let spans = Spans::new(slab, planes, enter, leave);
                let mut met = spans.met;
                while met != 0 {
                    let c = 31 - met.leading_zeros() as usize;
                    met ^= 1 << c;
                    let real = c ^ mirror;
                    if let Some(run) = run_of(&self.keys, &run, real as u64) {
                        let (enter, leave) = spans.of(c);
                        let _ = stack.try_push((run, child(&cell, planes, real), enter, leave));
                    }
                }
            }
            next = None;
            while let Some((run, cell, enter, leave)) = stack.pop() {
                if enter <= slab.far() {
                    next = Some((run, cell, enter, leave.min(slab.far())));
                    break;
                }
            }
        }
    }

    pub(crate) fn gather_under(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        let mut stack = ArrayVec::<(Place, Aabb), STACK>::new();
        stack.extend(self.root().map(|root| (root, self.bound)));
        while let Some((place, cell)) = stack.pop() {
            if !keep(&cell.relative_to(-self.origin)) {
                continue;
            }
            match self.view(place, &cell) {
                View::Leaf(number) => {
                    let (first, prims) = self.leaf(number);
                    if !prims.is_empty() {
                        each(Leaf { first, prims });
                    }
                }
                View::Split { planes, children } => {
                    for (c, place) in children.into_iter().enumerate().rev() {
                        if let Some(place) = place {
                            let _ = stack.try_push((place, child(&cell, planes, c)));
                        }
                    }
                }
            }
        }
    }
}

/// The bits of the axes along which a ray descends.
#[inline(always)]
fn mirror(slab: &SlabRay) -> usize {
    let [x, y, z] = slab.negative();
    x as usize | (y as usize) << 1 | (z as usize) << 2
}

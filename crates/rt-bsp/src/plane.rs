//! [`Plane`]: a slanted plane with room on both sides.

use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3};
use rt_geom::{Axis, f32_above, unit};

/// A plane through some of the scene, as nodes keep it: the points where `normal . p = shift`, relative to the tree's origin.
///
/// It is as thick as rounding makes it. What lies below belongs to the points where `normal . p <= shift + room`, what lies
/// above to those where `normal . p >= shift - room`; the two overlap, so nothing falls between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    /// Of length 1, within `2^-23`.
    pub(crate) normal: Vec3,
    pub(crate) shift: f64,
    pub(crate) room: f32,
}

/// Where something lies as a plane sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Below,
    Above,
    Both,
    /// In the plane: it may go to either side.
    Planar,
}

impl Side {
    /// Of what reaches from `low` to `high` above a plane, where `touch` is nothing.
    #[inline(always)]
    pub(crate) fn of(low: f64, high: f64, touch: f64) -> Side {
        match (high <= touch, low >= -touch) {
            (true, true) => Side::Planar,
            (true, false) => Side::Below,
            (false, true) => Side::Above,
            (false, false) => Side::Both,
        }
    }
}

/// How far coordinates of a tree reach, and what their roundings amount to.
///
/// A polygon is cut up to [`MAX_DEPTH`](crate::MAX_DEPTH) times. Each cut puts new corners on edges that are there, with an error
/// of at most ten roundings of the largest coordinate, and errors of corners that are there do not grow: so all corners stay
/// within `64 * 10 * 2^-53`, a little more than `2^-44`, of where they should be, in units of the reach. `grain` is four times
/// that, and outweighs the `2^-48` of evaluating a plane beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// What is within this is the same.
    pub(crate) grain: f64,
}

impl Scale {
    /// Of a tree with this bound; `None` where slanted planes might leave the range of `f32`: then there are none.
    pub(crate) fn of(bound: &Aabb) -> Option<Scale> {
        let reach = bound.min.abs().max(bound.max.abs()).max_element() as f64;
        let range = 2f64.powi(-80)..=2f64.powi(100);
        range.contains(&reach).then_some(Scale { grain: reach * 2f64.powi(-42) })
    }
}

impl Plane {
    /// The plane across `normal`, of any length, that lies best through `points`; `None` where there is none.
    ///
    /// Error: `room` is the points' own distance, which rounding the normal causes, and four grains: two within which
    /// a plane counts as touched ([`Plane::touch`]), two for what corners of polygons and their heights may be off.
    pub(crate) fn through(points: &[DVec3], normal: DVec3, scale: Scale) -> Option<Plane> {
        let normal = unit(normal)?.as_vec3();
        let (mut low, mut high, mut far) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
        for &p in points {
            let h = normal.as_dvec3().dot(p);
            (low, high) = (low.min(h), high.max(h));
            far = far.max((p - points[0]).abs().max_element());
        }
        let off = (high - low) * 0.5;
        // The normal of a sliver says little: a plane that thick parts nothing.
        if off > far * 2f64.powi(-20) + scale.grain {
            return None;
        }
        let shift = low + off;
        Some(Plane { normal, shift, room: f32_above(off * (1.0 + 8.0 * f64::EPSILON) + 4.0 * scale.grain) })
    }

    /// The height within which a point counts as in the plane: room for two grains less than there is.
    pub(crate) fn touch(&self, scale: Scale) -> f64 {
        self.room as f64 - 2.0 * scale.grain
    }

    /// How far above the plane a point is, within `2^-48` of the reach.
    #[inline(always)]
    pub(crate) fn height(&self, p: DVec3) -> f64 {
        self.normal.as_dvec3().dot(p) - self.shift
    }

    /// Where a box lies.
    pub(crate) fn side_of_box(&self, b: &Aabb, touch: f64) -> Side {
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let (at, by) = (self.height(middle), self.normal.abs().as_dvec3().dot(half));
        Side::of(at - by, at + by, touch)
    }

    /// A box around the parts of a box below and above, rounded outward; both hold the plane and its room.
    pub(crate) fn cut(&self, b: &Aabb, scale: Scale) -> [Aabb; 2] {
        let n = self.normal.as_dvec3();
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        [1.0, -1.0].map(|side| {
            let n = n * side;
            // All that is kept has n . p <= most; of the sum the least that the others add.
            let most = self.shift * side + self.room as f64 + scale.grain;
            let least = DVec3::from_array([0, 1, 2].map(|a| (n[a] * min[a]).min(n[a] * max[a])));
            let (mut low, mut high) = (min, max);
            for a in 0..3 {
                let others = least.element_sum() - least[a];
                let end = (most - others) / n[a];
                // Off by some roundings of the reach, for which the grain is, and by the division's own.
                let end = end + end.abs() * (4.0 * f64::EPSILON) * n[a].signum();
                if n[a] > 0.0 {
                    high[a] = high[a].min(end);
                } else if n[a] < 0.0 {
                    low[a] = low[a].max(end);
                }
            }
            // Rounded past each other, the plane only touches the box: then the part is thin, not nothing.
            Aabb::from_f64(low.min(high), high.max(low), DVec3::ZERO).overlap(*b)
        })
    }
}

/// The parts of a cell's box below and above an axis-aligned plane; both hold the plane.
#[inline]
pub(crate) fn cut_box(cell: &Aabb, axis: Axis, position: f32) -> [Aabb; 2] {
    let (mut low, mut high) = (*cell, *cell);
    low.max[axis.index()] = position;
    high.min[axis.index()] = position;
    [low, high]
}

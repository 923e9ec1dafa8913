//! The control net: triangles, who is beside whom, and how sharp the edges are.

use super::{Boundaries, LoopError, LoopRules};
use rt_geom::glam::DVec3;

/// The weight of the far end in the odd rule, where nothing is special.
pub(super) const PLAIN: f64 = 3.0 / 8.0;

/// A manifold net as half-edges: half-edge `3 f + k` runs from corner `k` of face `f` to the next, and has the face on its left.
#[derive(Clone, Debug, Default)]
pub(super) struct Net {
    pub(super) points: Vec<DVec3>,
    /// The vertex each half-edge leaves.
    pub(super) corners: Vec<u32>,
    /// The half-edge that runs the other way; at a boundary the half-edge itself.
    pub(super) twin: Vec<u32>,
    /// How sharp each half-edge is, the same from both sides. Empty where no inner edge is; boundaries need not be told.
    pub(super) sharp: Vec<f32>,
    /// By half-edge, the weight of its far end in the odd rule, as the vertex it leaves wishes it. Empty where all are plain.
    pub(super) pull: Vec<f64>,
    pub(super) rules: LoopRules,
}

/// The next half-edge of the face.
pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The one before.
pub(super) fn prev(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// A neighbour of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spoke {
    pub(super) at: DVec3,
    /// Infinite at boundaries.
    pub(super) sharp: f32,
}

/// What lies around a vertex, counter-clockwise. Face `j` is between spokes `j` and `j + 1`.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    pub(super) spokes: Vec<Spoke>,
    /// The half-edge each face sends out from the vertex, along spoke `j`.
    pub(super) outs: Vec<u32>,
    /// Whether the vertex is on a boundary: then there is one spoke more than faces.
    pub(super) open: bool,
}

impl Ring {
    /// Spoke `j`, around and around.
    pub(super) fn spoke(&self, j: usize) -> Spoke {
        self.spokes[j % self.spokes.len()]
    }

    /// How many spokes are sharper than `than`.
    pub(super) fn sharper(&self, than: f32) -> usize {
        self.spokes.iter().filter(|spoke| spoke.sharp > than).count()
    }

    /// The face which sends out `h`.
    pub(super) fn place(&self, h: u32) -> usize {
        self.outs.iter().position(|&out| out == h).unwrap_or(0)
    }

    /// The spokes of the sector that holds face `j`, from one infinitely sharp spoke to the next, and the place of face `j`
    /// among its faces. Only where there are two such spokes or more.
    pub(super) fn sector(&self, j: usize) -> (Vec<DVec3>, usize) {
        let n = self.spokes.len();
        let mut back = 0;
        while back < n && self.spoke(j + n - back).sharp != f32::INFINITY {
            back += 1;
        }
        let first = j + n - back;
        let mut sector = vec![self.spoke(first).at];
        for i in 1..=n {
            let spoke = self.spoke(first + i);
            sector.push(spoke.at);
            if spoke.sharp == f32::INFINITY {
                break;
            }
        }
        (sector, back)
    }
}

impl Net {
    /// Builds the half-edges, or says what is no manifold.
    pub(super) fn new(
        points: Vec<DVec3>,
        triangles: &[[u32; 3]],
        rules: LoopRules,
    ) -> Result<(Net, Vec<u32>), LoopError> {
        if triangles.len() > u32::MAX as usize / 3 {
            return Err(LoopError::TooManyTriangles { len: triangles.len() });
        }
        for (vertex, p) in (0..).zip(&points) {
            if !(p.abs().max_element() <= super::LARGEST && p.is_finite()) {
                return Err(LoopError::NotFinite { vertex });
            }
        }
        for (triangle, corners) in (0..).zip(triangles) {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= points.len()) {
                return Err(LoopError::IndexOutOfRange { triangle, index, vertices: points.len() });
            }
            let [a, b, c] = *corners;
            if a == b || b == c || c == a {
                return Err(LoopError::RepeatedCorner { triangle, vertex: if a == b { a } else { c } });
            }
        }
        let corners: Vec<u32> = triangles.iter().flatten().copied().collect();
        let twin = twins(&corners)?;
        let net = Net { points, corners, twin, rules, ..Net::default() };
        let starts = net.starts();
        net.check_fans(&starts)?;
        let mut net = net;
        net.wish(&starts);
        Ok((net, starts))
    }

    /// Makes these edges sharp, and no others.
    pub(super) fn sharpen(&mut self, edges: &[([u32; 2], f32)], starts: &[u32]) -> Result<(), LoopError> {
        let mut sharp = vec![0.0; self.corners.len()];
        for &(edge, sharpness) in edges {
            let [a, b] = edge;
            if sharpness.is_nan() || sharpness < 0.0 {
                return Err(LoopError::BadSharpness { edge, sharpness });
            }
            let from = |a: u32, b: u32| {
                let start = *starts.get(a as usize)?;
                self.fan(start).find(|&h| self.corners[next(h) as usize] == b)
            };
            let h = from(a, b).or_else(|| from(b, a)).ok_or(LoopError::NoSuchEdge { edge })?;
            // What stays sharp longer than anyone can subdivide is sharp for ever.
            let sharpness = if sharpness > super::FOR_EVER { f32::INFINITY } else { sharpness };
            sharp[h as usize] = sharpness;
            sharp[self.twin[h as usize] as usize] = sharpness;
        }
        self.sharp = if sharp.iter().any(|&s| s > 0.0) { sharp } else { Vec::new() };
        self.wish(starts);
        Ok(())
    }

    /// Tells the edges what the vertices of boundaries and creases wish of them.
    pub(super) fn wish(&mut self, starts: &[u32]) {
        self.pull = Vec::new();
        if self.rules.boundaries == Boundaries::Plain {
            return;
        }
        let mut pull = vec![PLAIN; self.corners.len()];
        let mut ring = Ring::default();
        for &start in starts {
            self.ring(start, &mut ring);
            let sharp = ring.spokes.iter().filter(|spoke| spoke.sharp == f32::INFINITY).count();
            if sharp < 2 {
                continue;
            }
            let corner = sharp > 2 || self.is_fixed(&ring);
            for (j, &out) in ring.outs.iter().enumerate() {
                if ring.spokes[j].sharp < f32::INFINITY {
                    let faces = ring.sector(j).0.len() - 1;
                    pull[out as usize] = far_weight(faces, corner);
                }
            }
        }
        if pull.iter().any(|&w| w != PLAIN) {
            self.pull = pull;
        }
    }

    /// Whether this is the corner of a single face that is to stay where it is.
    pub(super) fn is_fixed(&self, ring: &Ring) -> bool {
        ring.open && ring.outs.len() == 1 && self.rules.corners == super::Corners::Fixed
    }

    /// For each vertex a half-edge that leaves it, at a boundary the one that runs along it.
    pub(super) fn starts(&self) -> Vec<u32> {
        let mut starts = vec![u32::MAX; self.points.len()];
        for h in 0..self.corners.len() as u32 {
            let start = &mut starts[self.corners[h as usize] as usize];
            if *start == u32::MAX || self.twin[h as usize] == h {
                *start = h;
            }
        }
        starts
    }

    /// The half-edges that leave a vertex, from `h` on counter-clockwise, to the boundary if there is one.
    pub(super) fn fan(&self, h: u32) -> impl Iterator<Item = u32> {
        core::iter::successors((h != u32::MAX).then_some(h), move |&out| {
            let into = prev(out);
            let following = self.twin[into as usize];
            (following != into && following != h).then_some(following)
        })
    }

    /// The first half-edge counter-clockwise of those that leave the vertex: `h`, unless there is a boundary.
    fn first(&self, h: u32) -> u32 {
        let mut out = h;
        loop {
            let twin = self.twin[out as usize];
            if twin == out {
                return out;
            }
            out = next(twin);
            if out == h {
                return h;
            }
        }
    }

    pub(super) fn sharpness(&self, h: u32) -> f32 {
        if self.twin[h as usize] == h {
            f32::INFINITY
        } else {
            self.sharp.get(h as usize).copied().unwrap_or(0.0)
        }
    }

    pub(super) fn far_weight(&self, h: u32) -> f64 {
        self.pull.get(h as usize).copied().unwrap_or(PLAIN)
    }

    /// Fills `ring` with what lies around the vertex that `h` leaves.
    pub(super) fn ring(&self, h: u32, ring: &mut Ring) {
        ring.spokes.clear();
        ring.outs.clear();
        let first = self.first(h);
        ring.outs.extend(self.fan(first));
        let far = |h: u32| self.points[self.corners[h as usize] as usize];
        for &out in &ring.outs {
            ring.spokes.push(Spoke { at: far(next(out)), sharp: self.sharpness(out) });
        }
        ring.open = self.twin[first as usize] == first;
        if let (true, Some(&last)) = (ring.open, ring.outs.last()) {
            ring.spokes.push(Spoke { at: far(prev(last)), sharp: f32::INFINITY });
        }
    }

    /// Each vertex must have faces, and these one fan.
    fn check_fans(&self, starts: &[u32]) -> Result<(), LoopError> {
        let mut faces = vec![0u32; self.points.len()];
        for &v in &self.corners {
            faces[v as usize] += 1;
        }
        for (vertex, &start) in (0..).zip(starts) {
            if start == u32::MAX {
                return Err(LoopError::IsolatedVertex { vertex });
            }
            let fan: Vec<u32> = self.fan(start).collect();
            if fan.len() < faces[vertex as usize] as usize {
                let leaving = (0..self.corners.len() as u32).filter(|&h| self.corners[h as usize] == vertex);
                let other = leaving.into_iter().find(|h| !fan.contains(h)).unwrap_or(start);
                let (one, other) = (start / 3, other / 3);
                return Err(LoopError::SplitVertex { vertex, faces: [one.min(other), one.max(other)] });
            }
        }
        Ok(())
    }

    /// The faces that touch the vertices which `outs` leave, as a net of their own; face 0 is the one that sends out the first
    /// of them. Whatever of its rim follows from faces left out is wrong there, and nobody asks for it.
    pub(super) fn around(&self, outs: &[u32]) -> Net {
        let mut faces: Vec<u32> = Vec::with_capacity(16);
        for &h in outs {
            faces.extend(self.fan(self.first(h)).map(|out| out / 3));
        }
        let main = outs[0] / 3;
        faces.sort_unstable();
        faces.dedup();
        // The main face leads; the others follow in order.
        let place = |face: u32| match faces.binary_search(&face) {
            Ok(_) if face == main => Some(0),
            Ok(i) if face < main => Some(i + 1),
            found => found.ok(),
        };
        let order = || core::iter::once(main).chain(faces.iter().copied().filter(|&f| f != main));
        let halves = || order().flat_map(|f| 3 * f..3 * f + 3);
        let mut vertices: Vec<u32> = halves().map(|h| self.corners[h as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let renamed = |h: u32| vertices.partition_point(|&v| v < self.corners[h as usize]) as u32;
        let twin = (0..).zip(halves()).map(|(new, h)| {
            let twin = self.twin[h as usize];
            match place(twin / 3) {
                Some(face) if twin != h => 3 * face as u32 + twin % 3,
                _ => new,
            }
        });
        Net {
            points: vertices.iter().map(|&v| self.points[v as usize]).collect(),
            corners: halves().map(renamed).collect(),
            twin: twin.collect(),
            sharp: if self.sharp.is_empty() {
                Vec::new()
            } else {
                halves().map(|h| self.sharp[h as usize]).collect()
            },
            pull: if self.pull.is_empty() {
                Vec::new()
            } else {
                halves().map(|h| self.pull[h as usize]).collect()
            },
            rules: self.rules,
        }
    }

    /// Moves everything by `-by`.
    pub(super) fn shift(&mut self, by: DVec3) {
        for p in &mut self.points {
            *p -= by;
        }
    }
}

/// What the far end of an inner edge weighs in the odd rule, for a vertex on a boundary or crease with so many faces in the
/// sector: the weight that brings the subdominant eigenvalue to 1/2, that of the boundary itself; at a corner, taken as a right
/// angle, below it.
///
/// Source: Biermann, Levin, Zorin 2000, section 3.2.
pub(super) fn far_weight(faces: usize, corner: bool) -> f64 {
    if faces == 3 && !corner {
        return PLAIN;
    }
    let angle = core::f64::consts::PI / (faces * if corner { 2 } else { 1 }) as f64;
    0.5 - angle.cos() / 4.0
}

/// Pairs half-edges that run along the same edge in opposite directions.
fn twins(corners: &[u32]) -> Result<Vec<u32>, LoopError> {
    let mut edges: Vec<(u32, u32, u32)> = (0..corners.len() as u32)
        .map(|h| {
            let (a, b) = (corners[h as usize], corners[next(h) as usize]);
            (a.min(b), a.max(b), h)
        })
        .collect();
    edges.sort_unstable();
    let mut twin: Vec<u32> = (0..corners.len() as u32).collect();
    for group in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let edge = [group[0].0, group[0].1];
        match *group {
            [_] => {}
            [(.., g), (.., h)] if corners[g as usize] != corners[h as usize] => {
                twin[g as usize] = h;
                twin[h as usize] = g;
            }
            [(.., g), (.., h)] => return Err(LoopError::EdgeTwiceOneWay { edge, faces: [g / 3, h / 3] }),
            _ => {
                return Err(LoopError::CrowdedEdge {
                    edge,
                    faces: group.iter().map(|&(.., h)| h / 3).collect(),
                });
            }
        }
    }
    Ok(twin)
}

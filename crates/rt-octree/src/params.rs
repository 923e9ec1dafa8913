//! [`OctreeParams`]: the knobs.

use crate::octree::MAX_DEPTH;
use rt_accel::{BuildError, Clip, Mailing, Sah};

/// Where the three planes of a cell lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// In the middle. Towards infinity, at the ends of what is finite.
    ///
    /// Source: Glassner, "Space subdivision for fast ray tracing", CG&A 4(10) 1984.
    Centre,
    /// Along each axis where the surface area heuristic says, among the ends of parts next to 31 positions; none where
    /// none pays.
    ///
    /// Source: Whang, Song, Chang, Kim, Cho, Park, Song, "Octree-R: an adaptive octree for efficient ray tracing", TVCG
    /// 1(4) 1995; they try ten positions between the spatial and the object median.
    Cost,
}

/// Which cells become leaves, besides those with few references and the deepest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// No others: the textbooks' rule.
    Count,
    /// Those that cost a ray no less when split, by [`OctreeParams::sah`].
    ///
    /// Source: after Subramanian and Fussell, "Automatic termination criteria for ray tracing hierarchies", Graphics
    /// Interface 1991.
    Cost {
        /// How many splits on a way may each cost more than a leaf would, in the hope of better ones below: where the
        /// whole turns out no cheaper, a leaf is made after all.
        ahead: u32,
    },
}

/// How a tree is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// As nodes of 32 bytes: planes, and where the children are.
    Nodes,
    /// As the sorted Morton codes of the leaves that are not empty, 8 bytes each, and no nodes: rays compute the planes
    /// anew and search for the children. For [`Split::Centre`] only, since planes are not kept. Measured on spheres,
    /// cones and triangles it took 0.7 to 1.03 of the bytes of such nodes, references included, and 1.4 to 4 times the
    /// time: its merit is that leaves are one sorted list, to be merged, sent and searched.
    ///
    /// Source: Gargantini, "Linear octtrees for fast processing of three-dimensional objects", Computer Graphics and
    /// Image Processing 20 (1982).
    ///
    /// Why not hashed (Warren and Salmon, "A parallel hashed oct-tree N-body algorithm", Supercomputing 1993): a hash
    /// finds any node by its code at once, which pays where nodes lie on other machines or are looked up from their
    /// neighbours; rays come from above, where a link is as quick, and the table has to hold inner nodes and room to
    /// spare.
    Linear,
}

/// The knobs of an [`Octree`](crate::Octree).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OctreeParams {
    /// Where the planes lie.
    pub split: Split,
    /// Which cells become leaves.
    pub stop: Stop,
    /// Most splits on a way, in `0..=21`; `None` for `2 + 0.45 log2 n` by [`Split::Cost`], beyond which a mesh of 70 000
    /// triangles took 1.9 times the memory and gained nothing, and `4 + 0.6 log2 n` by [`Split::Centre`].
    pub max_depth: Option<u32>,
    /// Cells with up to this many references are not split; at least 1.
    pub max_prims: u32,
    /// Most references, as a multiple of the number of primitives, at least 1: a cell may be split into as many as fall
    /// to its share. It is what bounds the memory for primitives that no plane parts, such as one a thousand times.
    /// Long thin ones want much: sticks of aspect 100 had 49 references each at 128, and rays twice as fast as at 32;
    /// meshes and the scenes of the SPD have 2 to 14.
    pub most_references: f32,
    /// What visiting a node or a leaf and testing a primitive cost.
    pub sah: Sah,
    /// What of a primitive counts in a cell.
    pub clip: Clip,
    /// Whether rays remember whom they were tested against.
    pub mailing: Mailing,
    /// How the tree is kept.
    pub storage: Storage,
    /// Bytes the build may use, working memory included; `None` is no limit.
    pub memory_limit: Option<usize>,
}

impl Default for OctreeParams {
    fn default() -> OctreeParams {
        OctreeParams {
            split: Split::Cost,
            stop: Stop::Cost { ahead: 1 },
            max_depth: None,
            max_prims: 1,
            most_references: 128.0,
            sah: Sah { traverse: 2.0, intersect: 1.0 },
            clip: Clip::Exact,
            mailing: Mailing::None,
            storage: Storage::Nodes,
            memory_limit: None,
        }
    }
}

impl OctreeParams {
    /// The textbooks' octree: split in the middle while there are more than `max_prims` references and fewer than
    /// `max_depth` splits above. 2 to 8, and 5 to 16, are usual.
    pub fn classic(max_prims: u32, max_depth: u32) -> OctreeParams {
        OctreeParams {
            split: Split::Centre,
            stop: Stop::Count,
            max_depth: Some(max_depth),
            max_prims,
            most_references: 32.0,
            ..OctreeParams::default()
        }
    }

    /// Splits in the middle where that pays, kept as Morton codes.
    pub fn linear() -> OctreeParams {
        OctreeParams { split: Split::Centre, storage: Storage::Linear, ..OctreeParams::default() }
    }

    pub(crate) fn check(&self) -> Result<(), BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        if !(self.sah.traverse >= 0.0 && self.sah.traverse.is_finite()) {
            return bad("sah.traverse", "must be finite and not negative");
        }
        if !(self.sah.intersect > 0.0 && self.sah.intersect.is_finite()) {
            return bad("sah.intersect", "must be finite and positive");
        }
        if !(self.most_references >= 1.0 && self.most_references.is_finite()) {
            return bad("most_references", "must be finite and at least 1");
        }
        if self.max_prims == 0 {
            return bad("max_prims", "must be at least 1");
        }
        if self.max_depth.is_some_and(|depth| depth as usize > MAX_DEPTH) {
            return bad("max_depth", "must lie in 0..=21");
        }
        if self.storage == Storage::Linear && self.split != Split::Centre {
            return bad("storage", "must be Nodes unless cells are split at their centres");
        }
        Ok(())
    }

    pub(crate) fn depth(&self, prims: usize) -> u32 {
        let bits = (prims.max(1) as f64).log2();
        let usual = match self.split {
            Split::Cost => 2.0 + 0.45 * bits,
            Split::Centre => 4.0 + 0.6 * bits,
        };
        self.max_depth.unwrap_or((usual.round() as u32).min(MAX_DEPTH as u32))
    }
}

//! [`Counts`]: the work of a query, counted.

use core::ops::{Add, AddAssign};

/// What a query did: cost that does not depend on the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Nodes opened (cells entered, in a grid).
    pub nodes: u64,
    /// Leaves visited.
    pub leaves: u64,
    /// Primitives tested.
    pub prims: u64,
    /// Tests spared by a mailbox: of primitives that the ray had met before.
    pub spared: u64,
}

impl Add for Counts {
    type Output = Counts;
    fn add(self, other: Counts) -> Counts {
        Counts {
            nodes: self.nodes + other.nodes,
            leaves: self.leaves + other.leaves,
            prims: self.prims + other.prims,
            spared: self.spared + other.spared,
        }
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        *self = *self + other;
    }
}

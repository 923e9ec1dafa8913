//! [`Sah`]: the cost model that box hierarchies and kd-trees share.

/// The prices of the surface area heuristic, in a unit of one's own: only their ratio matters.
///
/// The cost of a node is `traverse + sum over children of (area / own area) * (intersect * primitives)`.
///
/// Source: Goldsmith and Salmon, "Automatic creation of object hierarchies for ray tracing", CG&A 7(5) 1987; MacDonald and
/// Booth, "Heuristics for ray tracing using space subdivision", The Visual Computer 6 1990.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sah {
    /// The price of opening one node. Finite, at least 0.
    pub traverse: f32,
    /// The price of testing one primitive. Finite, above 0.
    pub intersect: f32,
}

impl Default for Sah {
    fn default() -> Sah {
        Sah { traverse: 1.0, intersect: 1.0 }
    }
}

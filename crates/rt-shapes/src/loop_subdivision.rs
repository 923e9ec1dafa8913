//! [`LoopSurface`]: smooth surfaces of any topology, from a triangle mesh.

mod deviation;
mod limit;
mod net;
mod patch;
mod step;

pub use deviation::{Deviation, Vertices};

use crate::{Refine, TriangleMesh};
use core::fmt;
use net::{Net, Ring};
use rt_accel::{BuildError, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;
use rt_geom::{Real, f32_above, f32_below, gamma};

/// Coordinates beyond this are refused: sums and products of them would overflow.
const LARGEST: f64 = 1e70;
/// Half-edges, three a triangle, have `u32` numbers.
const MOST_TRIANGLES: usize = u32::MAX as usize / 3;
/// A crease sharper than this is sharp at every level there is memory for.
const FOR_EVER: f32 = 32.0;

/// A Loop subdivision surface: the smooth limit of a triangle mesh, the control net, whose triangles are cut into four again and
/// again, each new vertex a mean of its neighbours.
///
/// The surface has continuous curvature except at extraordinary vertices (inner ones with other than six neighbours), where it has
/// a continuous normal. Boundaries and creases are cubic B-splines of the vertices along them.
///
/// * **Sharp edges.** [`LoopSurface::with_creases`] gives edges a sharpness `s`: for `s` levels the edge is treated as a crease, a
///   fraction counts for a share of a level, infinity makes a crease of the limit. A vertex with two sharp edges is on a crease;
///   with more it is a corner and stays; with one, a dart, it is smooth. Boundaries are infinitely sharp.
/// * **Evaluation.** [`LoopSurface::limit`] gives the point, both derivatives and the normal anywhere on the limit surface: the net
///   around the point is subdivided until the point's patch is regular, and there it is a quartic box spline.
/// * **Bounds.** All weights are positive, so the surface is in the convex hull of its net.
/// * **Symmetry.** Positions do not depend on the order of vertices, triangles or corners, and a mirrored net gives a mirrored
///   surface, bit for bit.
///
/// Not done: normals at concave corners as Biermann et al. make them; user-given tangents; attributes other than position.
///
/// Cost: `refine` 0.15 to 0.5 microseconds a triangle of the result; `limit` 2 microseconds on regular patches, 8 more for each level of
/// subdivision around an extraordinary vertex, which are as many as the point is near, in powers of two.
///
/// Error: points within a few roundings of the largest coordinate of their patch's net; derivatives and normals within some of
/// their own size, down to extraordinary vertices themselves. Where the surface shrinks unevenly towards a vertex (a round corner
/// with a single face, a dart, plain boundaries) normals nearby lose about as many digits as the point is near, and have them
/// again at the vertex.
///
/// Source: Loop, *Smooth subdivision surfaces based on triangles* (1987); boundaries and creases after Hoppe et al., "Piecewise
/// smooth surface reconstruction" (1994); Biermann, Levin, Zorin, "Piecewise smooth subdivision surfaces with normal control"
/// (2000); DeRose, Kass, Truong, "Subdivision surfaces in character animation" (1998); the box spline after Stam, "Evaluation of
/// Loop subdivision surfaces" (1998).
///
/// ```
/// use rt_shapes::LoopSurface;
/// let corners = vec![[1.0f32, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
/// let faces = vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
/// let pebble = LoopSurface::new(corners, faces)?;
/// let mesh = pebble.refine::<f32>(3)?;
/// assert_eq!(mesh.triangles().len(), 4 * 64);
/// // The limit of a corner with three neighbours: two fifths of it, a fifth of each.
/// let tip = pebble.limit(0, 0.0, 0.0).unwrap();
/// assert!((tip.point.x - 0.2).abs() < 1e-15 && (tip.normal.x - 1.0 / 3f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), rt_shapes::LoopError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LoopSurface {
    net: Net,
    /// For each vertex a half-edge that leaves it.
    starts: Vec<u32>,
    memory_limit: usize,
}

/// The rules on which schools differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct LoopRules {
    /// How much the neighbours of an extraordinary vertex weigh.
    pub weights: Weights,
    /// What happens beside extraordinary vertices of boundaries and creases.
    pub boundaries: Boundaries,
    /// What happens to the corners of a boundary.
    pub corners: Corners,
}

/// How much each of the `n` neighbours of an inner vertex weighs. Both are smooth and agree for `n` of 3 and 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Weights {
    /// `(5/8 - (3/8 + cos(2 pi / n) / 4)^2) / n`: Loop's own.
    #[default]
    Loop,
    /// `3 / (8 n)`, and `3/16` for three: Warren's, simpler.
    Warren,
}

/// How an edge that ends on a boundary or crease is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Boundaries {
    /// By weights that depend on how many faces meet at the boundary vertex, which makes the surface smooth there whatever their
    /// number. With three faces they are the plain ones.
    ///
    /// Source: Biermann, Levin, Zorin 2000, section 3.2.
    #[default]
    Smooth,
    /// By 3/8, 3/8, 1/8, 1/8 as everywhere, which is what most programs do. Where six faces or more meet in a boundary vertex the
    /// surface has no tangent plane at it, and the normal given is that of the tangents along the boundary and across it.
    Plain,
}

/// Boundary vertices with a single face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Corners {
    /// Rounded like the rest of the boundary.
    #[default]
    Round,
    /// Kept where they are.
    Fixed,
}

/// The limit surface at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitPoint {
    /// The point.
    pub point: DVec3,
    /// Its derivative by the weight of the second corner. Zero at extraordinary vertices themselves, where derivatives by these
    /// parameters vanish or grow without bound.
    pub dpdu: DVec3,
    /// Its derivative by the weight of the third corner.
    pub dpdv: DVec3,
    /// The unit normal, on the side from which the triangles run counter-clockwise. Zero where the tangents span no plane.
    pub normal: DVec3,
}

/// Why a mesh is not the control net of a surface.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum LoopError {
    /// A triangle names a vertex that does not exist.
    IndexOutOfRange {
        /// The triangle.
        triangle: u32,
        /// The vertex it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A triangle names a vertex twice.
    RepeatedCorner {
        /// The triangle.
        triangle: u32,
        /// The vertex.
        vertex: u32,
    },
    /// A coordinate is not finite, or beyond 1e70.
    NotFinite {
        /// The vertex.
        vertex: u32,
    },
    /// A vertex belongs to no triangle.
    IsolatedVertex {
        /// The vertex.
        vertex: u32,
    },
    /// More than two triangles share an edge.
    CrowdedEdge {
        /// The vertices it joins.
        edge: [u32; 2],
        /// The triangles.
        faces: Vec<u32>,
    },
    /// Two triangles run along their common edge in the same direction: one must be turned over.
    EdgeTwiceOneWay {
        /// The vertices it joins.
        edge: [u32; 2],
        /// The triangles.
        faces: [u32; 2],
    },
    /// Triangles meet in a vertex without a chain of common edges between them.
    SplitVertex {
        /// The vertex.
        vertex: u32,
        /// A triangle of one fan and a triangle of another.
        faces: [u32; 2],
    },
    /// No triangle has this edge, which was to be sharp.
    NoSuchEdge {
        /// The vertices it was to join.
        edge: [u32; 2],
    },
    /// A sharpness is negative or not a number.
    BadSharpness {
        /// The edge.
        edge: [u32; 2],
        /// Its sharpness.
        sharpness: f32,
    },
    /// More triangles than can be numbered.
    TooManyTriangles {
        /// How many there are; the greatest number if that is too small.
        len: usize,
    },
    /// So fine a level takes more memory than allowed.
    OutOfMemory {
        /// Bytes needed.
        needed: usize,
        /// Bytes allowed.
        limit: usize,
    },
}

impl fmt::Display for LoopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoopError::IndexOutOfRange { triangle, index, vertices } => {
                write!(f, "triangle {triangle} names vertex {index}, but there are {vertices}")
            }
            LoopError::RepeatedCorner { triangle, vertex } => {
                write!(f, "triangle {triangle} names vertex {vertex} twice")
            }
            LoopError::NotFinite { vertex } => {
                write!(f, "vertex {vertex} is not finite or beyond {LARGEST:e}")
            }
            LoopError::IsolatedVertex { vertex } => write!(f, "vertex {vertex} belongs to no triangle"),
            LoopError::CrowdedEdge { edge: [a, b], faces } => {
                write!(
                    f,
                    "the edge from vertex {a} to {b} is shared by triangles {faces:?}: at most two may share one"
                )
            }
            LoopError::EdgeTwiceOneWay { edge: [a, b], faces: [x, y] } => write!(
                f,
                "triangles {x} and {y} run along the edge between vertices {a} and {b} in the same direction: one of them \
                 must be turned over"
            ),
            LoopError::SplitVertex { vertex, faces: [x, y] } => {
                write!(
                    f,
                    "triangles {x} and {y} meet in vertex {vertex} but not along edges: split the vertex"
                )
            }
            LoopError::NoSuchEdge { edge: [a, b] } => {
                write!(f, "no triangle has an edge from vertex {a} to {b}")
            }
            LoopError::BadSharpness { edge: [a, b], sharpness } => {
                write!(f, "the edge from vertex {a} to {b} cannot have the sharpness {sharpness}")
            }
            LoopError::TooManyTriangles { len: usize::MAX } => {
                write!(
                    f,
                    "that many triangles cannot even be counted: at most {MOST_TRIANGLES} can be numbered"
                )
            }
            LoopError::TooManyTriangles { len } => {
                write!(f, "{len} triangles are more than the {MOST_TRIANGLES} that can be numbered")
            }
            LoopError::OutOfMemory { needed, limit } => {
                write!(f, "this level takes {needed} bytes while it is made, but {limit} are allowed")
            }
        }
    }
}

impl core::error::Error for LoopError {}

impl LoopSurface {
    /// The surface whose control net has these vertices and triangles; outside is where the triangles run counter-clockwise.
    ///
    /// No triangles are a surface, too, without points.
    ///
    /// # Errors
    ///
    /// When the net is not a manifold with one orientation; see [`LoopError`].
    pub fn new<V: Real>(vertices: Vec<[V; 3]>, triangles: Vec<[u32; 3]>) -> Result<LoopSurface, LoopError> {
        let points = vertices.into_iter().map(|p| DVec3::from_array(p.map(Into::into))).collect();
        let (net, starts) = Net::new(points, &triangles, LoopRules::default())?;
        Ok(LoopSurface { net, starts, memory_limit: 1 << 31 })
    }

    /// The same net by other rules.
    pub fn with_rules(mut self, rules: LoopRules) -> LoopSurface {
        self.net.rules = rules;
        self.net.wish(&self.starts);
        self
    }

    /// The same net with these edges sharp, and no others. The later of two values for an edge counts; beyond 32 is infinite.
    ///
    /// A crease whose sharpness changes from edge to edge falls by one a level everywhere: it is not smoothed along itself as
    /// DeRose et al. propose.
    ///
    /// # Errors
    ///
    /// When there is no such edge, or a sharpness is negative or NaN.
    pub fn with_creases(mut self, edges: &[([u32; 2], f32)]) -> Result<LoopSurface, LoopError> {
        self.net.sharpen(edges, &self.starts)?;
        Ok(self)
    }

    /// The same surface; refining it may take so many bytes at once, the result included. Two gibibytes unless set.
    pub fn with_memory_limit(self, bytes: usize) -> LoopSurface {
        LoopSurface { memory_limit: bytes, ..self }
    }

    /// How many triangles the control net has: `4^level` times as many has each level.
    pub fn face_count(&self) -> usize {
        self.net.corners.len() / 3
    }

    /// A box around the limit surface and all its refinements.
    pub fn world_bound(&self) -> Aabb {
        enclose(&self.net, DVec3::ZERO)
    }

    /// A box around the part of the limit surface that belongs to triangle `face` of the control net: the box of the triangle
    /// and of its neighbours. `None` if there is no such triangle.
    pub fn face_bound(&self, face: u32) -> Option<Aabb> {
        ((face as usize) < self.face_count()).then(|| enclose(&self.net.patch(face), DVec3::ZERO))
    }

    /// The limit surface over triangle `face` of the control net, where `u` and `v` weigh its second and third corner. `None` if
    /// there is no such triangle, or the point is outside it.
    ///
    /// On an infinitely sharp edge the normal and derivatives are those of this triangle's side.
    pub fn limit(&self, face: u32, u: f64, v: f64) -> Option<LimitPoint> {
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (inside && (face as usize) < self.face_count()).then(|| {
            let w = ((1.0 - u) - v).max(0.0);
            self.net.limit_at(face, [w, u, v])
        })
    }

    /// The triangles of level `level` with their vertices pushed to the limit surface and its normals there. Triangle `i` lies
    /// over triangle `i >> (2 * level)` of the control net. Along infinitely sharp edges there is a vertex for each side, with
    /// equal positions.
    ///
    /// ```
    /// use rt_shapes::{LoopError, LoopSurface};
    /// let flap = LoopSurface::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// assert_eq!(flap.refine::<f64>(5)?.triangles().len(), 1024);
    /// assert!(matches!(flap.refine::<f64>(15), Err(LoopError::OutOfMemory { .. })));
    /// assert_eq!(flap.refine::<f64>(16).unwrap_err(), LoopError::TooManyTriangles { len: 1 << 32 });
    /// # Ok::<(), LoopError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// When that takes more memory than allowed, or has more triangles than can be numbered.
    pub fn refine<V: Real>(&self, level: u32) -> Result<TriangleMesh<V>, LoopError> {
        let net = self.net_at(level)?;
        let mut corners = net.corners.clone();
        let starts = net.starts();
        let mut points = Vec::with_capacity(starts.len());
        let mut normals = Vec::with_capacity(starts.len());
        let mut more: Vec<([V; 3], [f32; 3])> = Vec::new();
        let mut ring = Ring::default();
        for &start in &starts {
            net.ring(start, &mut ring);
            let sides = if net.sharp.is_empty() { Vec::new() } else { sides(&ring) };
            let (point, normal) = net.limit_in(sides.first().map_or(start, |side| side[0]), &mut ring);
            points.push(narrow(point));
            normals.push(normal.as_vec3().to_array());
            for side in sides.iter().skip(1) {
                let vertex = (starts.len() + more.len()) as u32;
                let (point, normal) = net.limit(side[0]);
                more.push((narrow(point), normal.as_vec3().to_array()));
                for &out in side {
                    corners[out as usize] = vertex;
                }
            }
        }
        for (point, normal) in more {
            points.push(point);
            normals.push(normal);
        }
        let too_many = |_| LoopError::TooManyTriangles { len: corners.len() / 3 };
        let triangles = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        TriangleMesh::new(points, triangles).and_then(|mesh| mesh.with_normals(normals)).map_err(too_many)
    }

    /// The control net of level `level`: vertices not pushed to the limit, no normals; level 0 is the net itself.
    ///
    /// # Errors
    ///
    /// When that takes more memory than allowed, or has more triangles than can be numbered.
    pub fn control<V: Real>(&self, level: u32) -> Result<TriangleMesh<V>, LoopError> {
        let net = self.net_at(level)?;
        let points = net.points.iter().map(|&p| narrow(p)).collect();
        let triangles: Vec<[u32; 3]> = net.corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let len = triangles.len();
        TriangleMesh::new(points, triangles).map_err(|_| LoopError::TooManyTriangles { len })
    }

    /// The net of a level.
    fn net_at(&self, level: u32) -> Result<Net, LoopError> {
        if self.net.corners.is_empty() {
            return Ok(self.net.clone());
        }
        // All levels are counted before one is made. First what no memory would help against.
        let len = match 2u32.checked_mul(level).and_then(|shift| 1usize.checked_shl(shift)) {
            Some(times) => self.face_count().saturating_mul(times),
            None => usize::MAX,
        };
        if len > MOST_TRIANGLES {
            return Err(LoopError::TooManyTriangles { len });
        }
        let (mut faces, mut vertices) = (self.face_count() as u64, self.net.points.len() as u64);
        let boundary = (0..).zip(&self.net.twin).filter(|&(h, &twin)| h == twin).count() as u64;
        let mut edges = (3 * faces + boundary) / 2;
        for _ in 0..level {
            (vertices, edges, faces) = (vertices + edges, 2 * edges + 3 * faces, 4 * faces);
        }
        let needed = self.bytes(faces, vertices);
        if level > 0 && needed > self.memory_limit as u64 {
            let needed = usize::try_from(needed).unwrap_or(usize::MAX);
            return Err(LoopError::OutOfMemory { needed, limit: self.memory_limit });
        }
        let mut net = self.net.clone();
        for _ in 0..level {
            net = net.subdivided();
        }
        Ok(net)
    }

    /// Bytes in use when a net of this size is refined and becomes a mesh.
    fn bytes(&self, faces: u64, vertices: u64) -> u64 {
        let of_half =
            8 + if self.net.sharp.is_empty() { 0 } else { 4 } + if self.net.pull.is_empty() { 0 } else { 8 };
        // The net and its parent, a quarter of it; the corners and triangles, positions and normals of the mesh.
        (3 * faces * of_half + 24 * vertices) / 4 * 5 + 24 * faces + (24 + 12 + 4) * vertices
    }
}

/// The half-edges that leave a vertex, by sides of its infinitely sharp edges. Nothing where there is one side.
fn sides(ring: &Ring) -> Vec<Vec<u32>> {
    let n = ring.outs.len();
    let begins: Vec<usize> = (0..n).filter(|&j| ring.spokes[j].sharp == f32::INFINITY).collect();
    if begins.len() < 2 {
        return Vec::new();
    }
    let ends = begins.iter().skip(1).copied().chain([begins[0] + n]);
    begins.iter().zip(ends).map(|(&begin, end)| (begin..end).map(|j| ring.outs[j % n]).collect()).collect()
}

fn narrow<V: Real>(p: DVec3) -> [V; 3] {
    p.to_array().map(V::nearest)
}

/// A box around the points and all their means, however these were rounded: each level adds less than eight roundings, and there
/// is no memory for 32 levels. Rounded outward to `f32`, whose points around it stay inside when they are rounded, before it is moved.
fn enclose(net: &Net, origin: DVec3) -> Aabb {
    if net.points.is_empty() {
        return Aabb::EMPTY;
    }
    let (min, max) =
        net.points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    let slack = min.abs().max(max.abs()) * gamma(256);
    let outward = |p: DVec3, round: fn(f64) -> f32| DVec3::from_array(p.to_array().map(|x| round(x).into()));
    Aabb::from_f64(outward(min - slack, f32_below), outward(max + slack, f32_above), origin)
}

/// A Loop surface as the `f32` mesh of one of its levels: what [`Lazy`](crate::Lazy) refines when a ray comes near.
///
/// ```
/// use rt_accel::{Exhaustive, Primitive};
/// use rt_geom::{Ray, glam::Vec3A};
/// use rt_shapes::{Lazy, LoopSurface, LoopTessellation};
/// let flap = LoopSurface::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// let lazy = Lazy::<Exhaustive, _>::new(LoopTessellation { surface: flap, level: 2 }, ());
/// assert_eq!(lazy.intersect(&Ray::new(Vec3A::new(0.3, 0.3, -2.0), Vec3A::Z)).unwrap().t, 2.0);
/// # Ok::<(), rt_shapes::LoopError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LoopTessellation {
    /// The surface.
    pub surface: LoopSurface,
    /// How often each triangle is cut into four.
    pub level: u32,
}

impl WorldBound for LoopTessellation {
    fn world_bound(&self) -> Aabb {
        self.surface.world_bound()
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        enclose(&self.surface.net, origin)
    }
}

impl Refine for LoopTessellation {
    type Parts = TriangleMesh;

    /// As [`LoopSurface::refine`].
    fn refine(&self) -> Result<TriangleMesh, BuildError> {
        self.surface.refine(self.level).map_err(|error| match error {
            LoopError::OutOfMemory { needed, limit } => BuildError::OutOfMemory { needed, limit },
            LoopError::TooManyTriangles { len: usize::MAX } => {
                BuildError::BadParam { name: "level", why: "makes more triangles than can be counted" }
            }
            LoopError::TooManyTriangles { len } => BuildError::TooManyPrimitives { len, max: MOST_TRIANGLES },
            _ => BuildError::BadParam { name: "surface", why: "it is no manifold" },
        })
    }
}

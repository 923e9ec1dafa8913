//! [`Terrain`]: heights over a square grid of triangles, made or looked up only where rays come near.

mod heights;
mod walk;

pub use heights::{Fractal, Heights, Samples};

use crate::{Partials, Refine, Shape, Surface, Triangle, TriangleMesh, Uv};
use core::ops::ControlFlow;
use rt_accel::{BuildError, Counts, Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec2, DVec3};
use rt_geom::{Ray, Real};
use walk::{Node, Walk};

/// Where a [`Terrain`] lies, and how fine it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerrainParams {
    /// The corner with the least x and y.
    pub min: DVec2,
    /// The extent along x and y; each above zero.
    pub size: DVec2,
    /// How often the two triangles of the square are each cut in four, in `0..=15`: there are `2 * 4^level` facets.
    pub level: u32,
    /// Cutting stops before `level` where all further levels together displace nothing by more than this; 0 for never. The
    /// level is the same everywhere, so that no cracks open; nothing is lost of the surface but that displacement.
    pub tolerance: f64,
    /// Levels whose nodes keep the exact reach of their heights: some `11 * 4^cached` bytes, and time to compute. The other
    /// levels know the bounds of the displacements only, which are some ten times as wide. At most `level`.
    pub cached: u32,
    /// Bytes that the cache may take, and [`Refine::refine`] besides.
    pub memory_limit: usize,
}

impl Default for TerrainParams {
    /// The unit square, half a million facets, 44 kB of cached reach, two gibibytes at most.
    fn default() -> TerrainParams {
        TerrainParams {
            min: DVec2::ZERO,
            size: DVec2::ONE,
            level: 9,
            tolerance: 0.0,
            cached: 6,
            memory_limit: 1 << 31,
        }
    }
}

/// A surface `z = h(x, y)` of triangles over a square, in world space: each side is cut in `2^level` steps, each step has two
/// triangles along its rising diagonal.
///
/// Heights come from [`Heights`]: midpoint displacement by a hash ([`Fractal`]), or a table ([`Samples`]). A ray walks the tree of
/// triangles, near to far, from the two of the square to those of the last level, which exist only while it looks at them: memory is
/// a few hundred bytes a level, whatever the number of facets, and there is nothing to build but the cache.
/// A node is passed over when the ray misses the prism over its triangle that holds everything below it, rounding included
/// (Kajiya's cheesecake). Facets are decided by [`Triangle`], exactly: so there are no cracks, and hits are those of the explicit
/// mesh ([`Refine::refine`]), bit for bit, numbers included, for rays from any distance and of any pace: from far away they are
/// first moved to the terrain, exactly as far as possible, so that they open no more nodes than from nearby. (Beyond `2^300` times a
/// facet's size from it [`Triangle`] is no longer exact, for the mesh neither.)
///
/// ```
/// use rt_accel::{Counts, Primitive};
/// use rt_geom::{Ray, glam::Vec3A};
/// use rt_shapes::{Fractal, Terrain, TerrainParams};
/// let hills = Terrain::new(Fractal::default(), TerrainParams { level: 12, ..Default::default() })?;
/// let mut counts = Counts::default();
/// let ray = Ray::new(Vec3A::new(-0.2, 0.3, 0.5), Vec3A::new(1.0, 0.2, -0.6));
/// assert!(hills.intersect_counted(&ray, &mut counts).is_some());
/// // Of 33 million facets.
/// assert!(counts.prims < 100);
/// # Ok::<(), rt_accel::BuildError>(())
/// ```
///
/// Source: Kajiya, "New techniques for ray tracing procedurally defined objects", SIGGRAPH 1983; Fournier, Fussell, Carpenter,
/// "Computer rendering of stochastic models", *CACM* 25 (1982); for tables, Tevs, Ihrke, Seidel, "Maximum mipmaps for fast,
/// accurate, and scalable dynamic height field rendering", I3D 2008, here with least and greatest departures from planes.
#[derive(Clone, Debug)]
pub struct Terrain<H> {
    heights: H,
    params: TerrainParams,
    /// By cached node, how far the surface departs from the plane of its corners.
    reach: Vec<[f64; 2]>,
    /// The same by level, for the others.
    beyond: Vec<f64>,
    /// The greatest height, either way.
    tall: f64,
    bound: [DVec3; 2],
}

/// The deepest level: facets have `u32` numbers.
const DEEPEST: u32 = 15;

impl<H: Heights> Terrain<H> {
    /// A terrain of these heights. `O(4^cached)`.
    ///
    /// # Errors
    ///
    /// [`BuildError::BadParam`] for a place that is not finite, an extent outside `[1e-60, 1e60]`, so small beside the place that
    /// steps vanish, or a level out of range; those of the heights; [`BuildError::OutOfMemory`] for the cache.
    pub fn new(heights: H, params: TerrainParams) -> Result<Terrain<H>, BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        let TerrainParams { min, size, level, tolerance, cached, .. } = params;
        if level > DEEPEST {
            return bad("level", "must lie in 0..=15");
        }
        if !(size.cmpge(DVec2::splat(1e-60)).all() && size.cmple(DVec2::splat(1e60)).all()) {
            return bad("size", "must lie in 1e-60..=1e60");
        }
        let step = size / f64::from(1u32 << level);
        if !(min.is_finite() && ((min.abs() + size) * (4.0 * f64::EPSILON)).cmplt(step).all()) {
            return bad("min", "is so far away that steps vanish");
        }
        if tolerance < 0.0 || tolerance.is_nan() {
            return bad("tolerance", "must not be negative");
        }
        heights.check(level)?;
        let level =
            (0..level).find(|&l| heights.beyond(l, level) <= tolerance && tolerance > 0.0).unwrap_or(level);
        let cached = if heights.beyond(0, level).is_finite() { cached.min(level) } else { level };
        let params = TerrainParams { level, cached, ..params };
        let beyond: Vec<f64> = (0..=level).map(|l| heights.beyond(l, level)).collect();
        let mut terrain =
            Terrain { heights, params, reach: Vec::new(), beyond, tall: 0.0, bound: [DVec3::ZERO; 2] };
        terrain.fill()?;
        Ok(terrain)
    }

    /// Fills the cache, and finds the bound.
    fn fill(&mut self) -> Result<(), BuildError> {
        let count = first_of(self.params.cached);
        let mut reach: Vec<[f64; 2]> = Vec::new();
        self.allow(count.saturating_mul(size_of::<[f64; 2]>()))?;
        reach.try_reserve_exact(count).map_err(|_| refused(count.saturating_mul(size_of::<[f64; 2]>())))?;
        reach.resize(count, [0.0; 2]);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for node in self.roots() {
            let [lo, hi] = self.reach_of(&node, &mut reach);
            low = low.min(node.lowest() + lo);
            high = high.max(node.highest() + hi);
        }
        self.reach = reach;
        if !(low.is_finite() && high.is_finite() && low.abs().max(high.abs()) <= 1e60) {
            return Err(BuildError::BadParam { name: "heights", why: "must lie within 1e60 of zero" });
        }
        self.tall = low.abs().max(high.abs());
        // Two roundings a level on the way to a facet, and those of the reach.
        let slack = self.tall * (64.0 * f64::EPSILON);
        let [min, max] = [self.place([0, 0]), self.place([walk::FULL; 2])];
        self.bound = [min.extend(low - slack), max.extend(high + slack)];
        Ok(())
    }

    /// Whether so many bytes may be taken.
    fn allow(&self, needed: usize) -> Result<(), BuildError> {
        let limit = self.params.memory_limit;
        if needed > limit { Err(BuildError::OutOfMemory { needed, limit }) } else { Ok(()) }
    }

    fn reach_of(&self, node: &Node, reach: &mut [[f64; 2]]) -> [f64; 2] {
        if node.level >= self.params.cached {
            let beyond = self.beyond.get(node.level as usize).copied().unwrap_or(0.0);
            return [-beyond, beyond];
        }
        let [a, b, c] = node.z;
        // How far the corners of each child depart from this plane: only the middles of the edges do.
        let middles = node.middles(&self.heights);
        let off = [middles[0] - (a + b) * 0.5, middles[1] - (b + c) * 0.5, middles[2] - (c + a) * 0.5];
        let (mut lo, mut hi) = (0.0f64, 0.0f64);
        for (k, child) in node.children(&middles).iter().enumerate() {
            let [l, h] = self.reach_of(child, reach);
            // Child k < 3 has one old corner and two new ones.
            let corners = match k {
                0 => [0.0, off[0], off[2]],
                1 => [0.0, off[0], off[1]],
                2 => [0.0, off[1], off[2]],
                _ => off,
            };
            lo = lo.min(corners.into_iter().fold(f64::INFINITY, f64::min) + l);
            hi = hi.max(corners.into_iter().fold(f64::NEG_INFINITY, f64::max) + h);
        }
        if let Some(entry) = reach.get_mut(node.index()) {
            *entry = [lo, hi];
        }
        [lo, hi]
    }

    /// What the heights come from.
    pub fn heights(&self) -> &H {
        &self.heights
    }

    /// Where it lies and how fine it is: with the level that the tolerance led to, and the levels that are cached.
    pub fn params(&self) -> &TerrainParams {
        &self.params
    }

    /// The number of facets: `2 * 4^level`.
    pub fn facet_count(&self) -> u32 {
        2 << (2 * self.params.level)
    }

    /// The facet of this number; `None` if there are not so many. `O(level)`.
    pub fn facet(&self, prim: u32) -> Option<Triangle> {
        if prim >= self.facet_count() {
            return None;
        }
        let mut node = self.roots()[(prim >> (2 * self.params.level)) as usize];
        for l in (0..self.params.level).rev() {
            node = node.children(&node.middles(&self.heights))[(prim >> (2 * l) & 3) as usize];
        }
        Some(self.triangle(&node))
    }

    /// Heap memory, in bytes.
    pub fn bytes(&self) -> usize {
        self.reach.capacity() * size_of::<[f64; 2]>() + self.beyond.capacity() * size_of::<f64>()
    }

    fn roots(&self) -> [Node; 2] {
        let corner = |at: [u32; 2]| (at, self.heights.corner(at));
        let far = walk::FULL;
        let [a, b, c, d] = [[0, 0], [far, 0], [far, far], [0, far]].map(corner);
        [Node::new([a, b, c], 0), Node::new([c, d, a], 1)]
    }

    /// The place of a vertex, the same for all that share it.
    #[inline(always)]
    fn place(&self, [i, j]: [u32; 2]) -> DVec2 {
        let part = |i: u32| f64::from(i) / f64::from(walk::FULL);
        self.params.min + self.params.size * DVec2::new(part(i), part(j))
    }

    #[inline(always)]
    fn triangle(&self, node: &Node) -> Triangle {
        Triangle { corners: core::array::from_fn(|k| self.place(node.at[k]).extend(node.z[k])) }
    }
}

/// The system has not so many bytes: fewer, it does not say how many.
fn refused(needed: usize) -> BuildError {
    BuildError::OutOfMemory { needed, limit: needed.saturating_sub(1) }
}

/// The number of nodes above a level.
fn first_of(level: u32) -> usize {
    (((1usize << (2 * level)) - 1) / 3) * 2
}

impl<H: Heights> WorldBound for Terrain<H> {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        Aabb::from_f64(self.bound[0], self.bound[1], origin)
    }
}

impl<R: Real, H: Heights> Primitive<R> for Terrain<H> {
    type At = Uv;

    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        self.intersect_counted(ray, &mut Counts::default())
    }

    fn intersect_p(&self, ray: &Ray<R>) -> bool {
        self.intersect_p_counted(ray, &mut Counts::default())
    }

    fn all_hits(&self, ray: &Ray<R>, each: &mut dyn FnMut(Hit<Uv, R>) -> ControlFlow<()>) -> ControlFlow<()> {
        Walk::run(self, &mut { *ray }, &mut Counts::default(), |prim, facet, ray| match facet.cross(ray) {
            Some(meeting) => each(crate::mesh::hit(prim, meeting)),
            None => ControlFlow::Continue(()),
        })
    }

    /// Nodes are those opened, primitives the facets made: out of [`Terrain::facet_count`].
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Uv, R>> {
        let mut best: Option<Hit<Uv, R>> = None;
        let _ = Walk::run(self, &mut { *ray }, counts, |prim, facet, ray| {
            if let Some(meeting) = facet.intersect(ray)
                && best.is_none_or(|best| meeting.t < best.t || prim < best.at.prim)
            {
                ray.t_max = meeting.t;
                best = Some(crate::mesh::hit(prim, meeting));
            }
            ControlFlow::Continue(())
        });
        best
    }

    fn intersect_p_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> bool {
        Walk::run(self, &mut { *ray }, counts, |_, facet, ray| match facet.intersect(ray) {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        })
        .is_break()
    }
}

impl<R: Real, H: Heights> Shape<R> for Terrain<H> {
    /// The parameters are the shares of the extent along x and y; the normal looks up. For a hit on no facet of this terrain: a
    /// point on the ray.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let Some(facet) = self.facet(hit.at.prim) else {
            let point = ray.widen().at(hit.t.into());
            return Surface {
                point,
                error: point.abs(),
                normal: DVec3::Z,
                shading: DVec3::Z,
                uv: DVec2::ZERO,
            };
        };
        let mut surface = facet.surface(facet.weights(ray, hit));
        surface.uv = (surface.point.truncate() - self.params.min) / self.params.size;
        surface
    }

    fn partials(&self, _: &Ray<R>, hit: &Hit<Uv, R>) -> Partials {
        let Some(facet) = self.facet(hit.at.prim) else { return Partials::default() };
        let [a, b, c] = facet.corners;
        let n = (b - a).cross(c - a);
        let size = self.params.size;
        Partials {
            dpdu: DVec3::new(size.x, 0.0, -size.x * n.x / n.z),
            dpdv: DVec3::new(0.0, size.y, -size.y * n.y / n.z),
            ..Partials::default()
        }
    }
}

impl<H: Heights> Refine for Terrain<H> {
    type Parts = TriangleMesh<f64>;

    /// All facets, in order of number. 24 bytes a vertex, 12 a facet.
    ///
    /// # Errors
    ///
    /// [`BuildError::OutOfMemory`]: more than [`TerrainParams::memory_limit`], or more than there is.
    fn refine(&self) -> Result<TriangleMesh<f64>, BuildError> {
        let (side, level) = ((1u32 << self.params.level) + 1, self.params.level);
        let (corners, facets) = (side as usize * side as usize, self.facet_count() as usize);
        let needed = corners.saturating_mul(24).saturating_add(facets.saturating_mul(12));
        self.allow(needed)?;
        let short = |_| refused(needed);
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        vertices.try_reserve_exact(corners).map_err(short)?;
        triangles.try_reserve_exact(facets).map_err(short)?;
        vertices.resize(corners, [0.0; 3]);
        let number =
            |at: [u32; 2]| (at[1] >> (walk::DIGITS - level)) * side + (at[0] >> (walk::DIGITS - level));
        // The tree in order of number; the last on the list comes next.
        let mut open: Vec<Node> = self.roots().into_iter().rev().collect();
        while let Some(node) = open.pop() {
            if node.level < level {
                open.extend(node.children(&node.middles(&self.heights)).into_iter().rev());
                continue;
            }
            let corners = node.at.map(number);
            for (corner, point) in corners.into_iter().zip(self.triangle(&node).corners) {
                vertices[corner as usize] = point.to_array();
            }
            triangles.push(corners);
        }
        Ok(TriangleMesh::new(vertices, triangles)?)
    }
}

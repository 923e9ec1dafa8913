//! [`Grid`]: cells, and what is in them.

use crate::clouds::{GRID, LEAF};
use crate::voxels::Voxels;
use rt_accel::{Bounded, Invalid, Leaf, Mailing};
use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

/// The most grids that may lie within each other below the first.
pub const MAX_DEPTH: usize = 12;

/// Space in equal cells, some of which may be grids. See [`GridParams`](crate::GridParams) and the crate's page.
///
/// Five bytes a cell, and four a reference.
///
/// Source: Lagae and Dutré, "Compact, fast and robust grids for ray tracing", EGSR 2008, for the layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub(crate) origin: DVec3,
    pub(crate) bound: Aabb,
    /// The first one holds all finite bounds; those within follow, level by level.
    pub(crate) grids: Vec<Voxels>,
    /// How many primitives there are.
    pub(crate) first_link: u32,
    /// What each cell is: see [`LEAF`].
    pub(crate) kinds: Vec<u8>,
    /// Where the references of each cell begin; one more, where the last ends.
    pub(crate) starts: Vec<u32>,
    /// Primitives, then grids, counted from `first_link`.
    pub(crate) refs: Vec<u32>,
    /// How many references, the first ones, are of primitives with infinite bounds.
    pub(crate) outside: usize,
    pub(crate) skipped: Vec<u32>,
    pub(crate) repeats: bool,
    pub(crate) mailing: Mailing,
    /// References there would be if boxes were registered.
    pub(crate) overlaps: u64,
}

/// What a [`Grid`] is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Grids, the first one included.
    pub grids: usize,
    /// How many grids at most lie within each other below the first.
    pub depth: usize,
    /// The cells of the first grid along x, y and z.
    pub resolution: [u32; 3],
    /// Cells of all grids.
    pub cells: usize,
    /// Those without references.
    pub empty: usize,
    /// References to primitives, in all cells.
    pub references: usize,
    /// References there were if each primitive stood in every cell that its part's box overlaps, cells that became grids included.
    /// Without inner grids, the quotient is what [`Clip::Exact`](rt_accel::Clip::Exact) saves.
    pub box_references: u64,
    /// The most references of a cell.
    pub largest_cell: usize,
    /// Primitives with infinite bounds, which every ray meets.
    pub outside: usize,
}

impl Grid {
    /// What the grid is made of. `O(cells)`.
    pub fn statistics(&self) -> Statistics {
        let mut s = Statistics {
            grids: self.grids.len(),
            resolution: self.grids.first().map_or([0; 3], |top| top.count),
            cells: self.kinds.len(),
            box_references: self.overlaps,
            outside: self.outside,
            ..Statistics::default()
        };
        let mut depths = vec![0usize; self.grids.len()];
        for (g, grid) in self.grids.iter().enumerate() {
            s.depth = s.depth.max(depths[g]);
            for cell in grid.first..grid.first + grid.cells() {
                if !matches!(self.kinds[cell], LEAF | GRID) {
                    s.empty += 1;
                    continue;
                }
                let prims = self.leaf(cell).prims.len();
                s.references += prims;
                s.largest_cell = s.largest_cell.max(prims);
                let next = depths[g] + 1;
                for inner in self.inner(cell) {
                    if let Some(depth) = depths.get_mut(inner) {
                        *depth = next.max(*depth);
                    }
                }
            }
        }
        s
    }

    /// The primitives of a cell.
    #[inline(always)]
    pub(crate) fn leaf(&self, cell: usize) -> Leaf<'_> {
        let refs = self.refs(cell);
        let links = match self.kinds[cell] {
            GRID => self.links(cell),
            _ => 0,
        };
        Leaf { first: self.starts[cell], prims: &refs[..refs.len() - links] }
    }

    /// How many grids there are in a cell.
    #[inline(always)]
    pub(crate) fn links(&self, cell: usize) -> usize {
        self.refs(cell).iter().rev().take_while(|reference| **reference >= self.first_link).count()
    }

    #[inline(always)]
    fn refs(&self, cell: usize) -> &[u32] {
        let (from, to) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
        self.refs.get(from..to).unwrap_or(&[])
    }

    /// The grid that is `links` from the end of a cell's references.
    #[inline(always)]
    pub(crate) fn link(&self, cell: usize, links: u32) -> usize {
        (self.refs[(self.starts[cell + 1] - links) as usize] - self.first_link) as usize
    }

    /// The grids in a cell.
    pub(crate) fn inner(&self, cell: usize) -> impl Iterator<Item = usize> {
        (1..=self.links(cell) as u32).rev().map(move |links| self.link(cell, links))
    }

    /// The primitives with infinite bounds.
    #[inline(always)]
    pub(crate) fn outside(&self) -> Leaf<'_> {
        Leaf { first: 0, prims: self.refs.get(..self.outside).unwrap_or(&[]) }
    }

    pub(crate) fn gather_within(&self, keep: &mut dyn FnMut(&Aabb) -> bool, each: &mut dyn FnMut(Leaf<'_>)) {
        if self.bound.is_empty() || !keep(&self.bound.relative_to(-self.origin)) {
            return;
        }
        if self.outside > 0 {
            each(self.outside());
        }
        let mut waiting: Vec<usize> = if self.grids.is_empty() { Vec::new() } else { vec![0] };
        // A grid may stand in several cells.
        let mut seen = vec![false; self.grids.len()];
        while let Some(g) = waiting.pop() {
            let grid = &self.grids[g];
            let [nx, ny, nz] = grid.count;
            let mut kept = |within: &mut Aabb, a: usize, at: u32| {
                [within.min[a], within.max[a]] = grid.slab(a, at);
                keep(&within.relative_to(-self.origin))
            };
            let mut cell = grid.first;
            let mut within = grid.bound();
            for z in 0..nz {
                within = Aabb {
                    min: grid.bound().min.with_z(within.min.z),
                    max: grid.bound().max.with_z(within.max.z),
                };
                if !kept(&mut within, 2, z) {
                    cell += nx as usize * ny as usize;
                    continue;
                }
                for y in 0..ny {
                    within.min.x = grid.bound().min.x;
                    within.max.x = grid.bound().max.x;
                    if !kept(&mut within, 1, y) {
                        cell += nx as usize;
                        continue;
                    }
                    for x in 0..nx {
                        match self.kinds[cell] {
                            LEAF | GRID if kept(&mut within, 0, x) => {
                                let leaf = self.leaf(cell);
                                if !leaf.prims.is_empty() {
                                    each(leaf);
                                }
                                if self.kinds[cell] == GRID {
                                    let new = |inner: &usize| !core::mem::replace(&mut seen[*inner], true);
                                    waiting.extend(self.inner(cell).filter(new));
                                }
                            }
                            _ => {}
                        }
                        cell += 1;
                    }
                }
            }
        }
    }

    pub(crate) fn check(&self, source: &dyn Bounded) -> Result<(), Invalid> {
        let fail = |what: String| Err(Invalid(what));
        let mut times = vec![0u32; source.prim_count()];
        let mut count = |prim: u32| match times.get_mut(prim as usize) {
            Some(times) => {
                *times += 1;
                Ok(())
            }
            None => fail(format!("a cell names primitive {prim}, which is none")),
        };
        for prim in self.outside().prims {
            count(*prim)?;
        }
        if self.grids.is_empty() {
            if !self.kinds.is_empty() || self.refs.len() != self.outside {
                return fail("there are cells, but no grid".to_string());
            }
        } else if self.starts.len() != self.kinds.len() + 1
            || self.starts.last() != Some(&(self.refs.len() as u32))
        {
            return fail(format!("{} starts for {} cells", self.starts.len(), self.kinds.len()));
        }
        if self.starts.windows(2).any(|pair| pair[0] > pair[1]) {
            return fail("cells are not in order".to_string());
        }
        let mut next_cell = 0;
        let mut linked = vec![false; self.grids.len()];
        if let Some(first) = linked.first_mut() {
            *first = true;
        }
        for (g, grid) in self.grids.iter().enumerate() {
            if grid.first != next_cell {
                return fail(format!(
                    "a grid begins at cell {}, the one before it ended at {next_cell}",
                    grid.first
                ));
            }
            next_cell += grid.cells();
            if next_cell > self.kinds.len() {
                return fail("a grid has more cells than there are".to_string());
            }
            for (index, cell) in (grid.first..next_cell).enumerate() {
                let prims = self.leaf(cell).prims;
                let at = grid.at(index);
                let bound = grid.cell(at);
                match self.kinds[cell] {
                    LEAF | GRID => {
                        if prims.is_empty() && self.kinds[cell] == LEAF {
                            return fail(format!("cell {at:?} is empty and is called a leaf"));
                        }
                        for &prim in prims {
                            count(prim)?;
                            if source.bound_from(prim, self.origin).overlap(bound).is_empty() {
                                return fail(format!(
                                    "primitive {prim} does not reach into its cell {bound:?}"
                                ));
                            }
                        }
                        if prims.windows(2).any(|pair| pair[0] >= pair[1]) {
                            return fail(format!("cell {at:?} is not in ascending order"));
                        }
                        if self.kinds[cell] == LEAF {
                            continue;
                        }
                        if self.links(cell) == 0 {
                            return fail(format!("cell {at:?} is called a grid and has none"));
                        }
                        for inner in self.inner(cell) {
                            // Each after those it is in, so that none is in itself.
                            let Some(found) = self.grids.get(inner).filter(|_| inner > g) else {
                                return fail(format!("cell {at:?} of grid {g} holds grid {inner}"));
                            };
                            if found.bound().overlap(bound).is_empty() {
                                return fail(format!("grid {inner} does not reach into its cell {bound:?}"));
                            }
                            linked[inner] = true;
                        }
                    }
                    empty => {
                        if !prims.is_empty() {
                            return fail(format!("cell {at:?} is not empty"));
                        }
                        self.check_cloud(grid, at, empty as u32)?;
                    }
                }
            }
        }
        if next_cell != self.kinds.len() || linked.contains(&false) {
            return fail(format!("{next_cell} cells hang in the grid, or not all grids do"));
        }
        for &prim in &self.skipped {
            if core::mem::replace(&mut times[prim as usize], 1) != 0 {
                return fail(format!("primitive {prim} is both skipped and in the grid"));
            }
        }
        match times.iter().position(|times| *times == 0) {
            Some(prim) => fail(format!("primitive {prim} is missing")),
            None => Ok(()),
        }
    }

    /// A distance is one more than that of some neighbour at most, which, with zero in cells that are not empty, makes it no greater
    /// than the true one everywhere.
    fn check_cloud(&self, grid: &Voxels, at: [u32; 3], distance: u32) -> Result<(), Invalid> {
        let around = |a: usize| at[a].saturating_sub(1)..=(at[a] + 1).min(grid.count[a] - 1);
        let strides = grid.strides();
        for z in around(2) {
            for y in around(1) {
                for x in around(0) {
                    let near = x as usize + y as usize * strides[1] + z as usize * strides[2];
                    let near = match self.kinds[grid.first + near] {
                        GRID => 0,
                        kind => kind as u32,
                    };
                    if near + 1 < distance {
                        return Err(Invalid(format!(
                            "cell {at:?} at {distance} from any other is near one at {near}"
                        )));
                    }
                }
            }
        }
        Ok(())
    }
}

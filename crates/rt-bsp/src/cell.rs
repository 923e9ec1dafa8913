//! [`Cell`]: a convex polytope, whose surface says how many lines meet it.

use rt_bounds::Aabb;
use rt_geom::glam::DVec3;

/// A box cut by planes: polygons around shared corners. For costs only; no answer depends on it.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    corners: Vec<DVec3>,
    /// Corners of all faces, counter-clockwise seen from outside, one face after another.
    around: Vec<u32>,
    /// Where each face ends in `around`.
    ends: Vec<u32>,
    /// Twice the area of each face as a vector, and its length.
    vectors: Vec<(DVec3, f64)>,
    /// The sum of the areas of the faces.
    area: f64,
}

impl Cell {
    pub(crate) fn of_box(b: &Aabb) -> Cell {
        let corners = b.corners().map(|c| c.as_dvec3()).to_vec();
        let around = vec![0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6];
        let mut cell =
            Cell { corners, around, ends: vec![4, 8, 12, 16, 20, 24], vectors: Vec::new(), area: 0.0 };
        cell.measure();
        cell
    }

    /// The area of the surface.
    pub(crate) fn area(&self) -> f64 {
        self.area
    }

    /// The corners.
    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    pub(crate) fn bytes(&self) -> usize {
        self.corners.capacity() * size_of::<DVec3>()
            + (self.around.capacity() + self.ends.capacity()) * 4
            + self.vectors.capacity() * size_of::<(DVec3, f64)>()
    }

    fn faces(&self) -> impl Iterator<Item = &[u32]> {
        let starts = core::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.around[start as usize..end as usize])
    }

    fn measure(&mut self) {
        let at = |i: u32| self.corners[i as usize];
        let vector = |face: &[u32]| {
            let first = at(face[0]);
            let sum: DVec3 = face[1..].windows(2).map(|w| (at(w[0]) - first).cross(at(w[1]) - first)).sum();
            (sum, sum.length())
        };
        self.vectors = self.faces().map(vector).collect();
        self.area = self.vectors.iter().map(|(_, length)| length).sum::<f64>() * 0.5;
    }

    /// How far above the plane `normal . p = shift` each corner is, and the least and greatest of that.
    pub(crate) fn heights(&self, normal: DVec3, shift: f64, heights: &mut Vec<f64>) -> [f64; 2] {
        heights.clear();
        heights.extend(self.corners.iter().map(|&p| normal.dot(p) - shift));
        heights.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &h| [a.min(h), b.max(h)])
    }

    /// The areas of the parts below and above a plane over which the corners have these heights.
    ///
    /// What of the faces lies below is added up as vectors; since the vectors of a closed surface add to nothing, their sum is
    /// the cut itself, whose polygon need not be put together.
    pub(crate) fn areas(&self, heights: &[f64]) -> [f64; 2] {
        let (mut below, mut above, mut open) = (0.0, 0.0, DVec3::ZERO);
        for (face, &(all, length)) in self.faces().zip(&self.vectors) {
            let lows = face.iter().filter(|i| heights[**i as usize] <= 0.0).count();
            if lows == face.len() {
                (below, open) = (below + length, open + all);
                continue;
            }
            if lows == 0 {
                above += length;
                continue;
            }
            // About a corner of the face, so that nothing cancels.
            let base = self.corners[face[0] as usize];
            let (mut first, mut last, mut low) = (None::<DVec3>, DVec3::ZERO, DVec3::ZERO);
            let mut emit = |p: DVec3| match first {
                None => first = Some(p),
                Some(first) => {
                    low += last.cross(p - first);
                    last = p - first;
                }
            };
            let mut i = face[face.len() - 1] as usize;
            for &j in face {
                let j = j as usize;
                let (hp, hq) = (heights[i], heights[j]);
                let q = self.corners[j] - base;
                if (hp <= 0.0) != (hq <= 0.0) {
                    let p = self.corners[i] - base;
                    emit(p + (q - p) * (hp / (hp - hq)));
                }
                if hq <= 0.0 {
                    emit(q);
                }
                i = j;
            }
            below += low.length();
            above += (all - low).length();
            open += low;
        }
        let cap = open.length();
        [(below + cap) * 0.5, (above + cap) * 0.5]
    }

    /// The parts below and above a plane over which the corners have these heights.
    pub(crate) fn split(&self, heights: &[f64]) -> [Cell; 2] {
        // A corner for each edge that is cut, the same for both faces and both parts.
        let mut crossings: Vec<((u32, u32), u32)> = Vec::new();
        let mut corners = self.corners.clone();
        let mut crossing = |i: u32, j: u32| {
            let edge = (i.min(j), i.max(j));
            if let Some(&(_, known)) = crossings.iter().find(|(other, _)| *other == edge) {
                return known;
            }
            let (p, q) = (self.corners[edge.0 as usize], self.corners[edge.1 as usize]);
            let (hp, hq) = (heights[edge.0 as usize], heights[edge.1 as usize]);
            let new = corners.len() as u32;
            corners.push(p + (q - p) * (hp / (hp - hq)));
            crossings.push((edge, new));
            new
        };
        let low = |i: u32| heights[i as usize] <= 0.0;
        let mut parts = [(Vec::new(), Vec::new()), (Vec::new(), Vec::new())];
        // Of the cut of the part below: from where a face enters the part to where it left it.
        let mut links: Vec<(u32, u32)> = Vec::new();
        for face in self.faces() {
            let starts = parts.each_ref().map(|(around, _)| around.len());
            let (mut left, mut entered) = (None, None);
            let mut i = face[face.len() - 1];
            for &j in face {
                if low(i) != low(j) {
                    let c = crossing(i, j);
                    parts[0].0.push(c);
                    parts[1].0.push(c);
                    *(if low(i) { &mut left } else { &mut entered }) = Some(c);
                }
                parts[usize::from(!low(j))].0.push(j);
                i = j;
            }
            if let (Some(left), Some(entered)) = (left, entered) {
                links.push((entered, left));
            }
            for ((around, ends), start) in parts.iter_mut().zip(starts) {
                if around.len() < start + 3 {
                    around.truncate(start);
                } else {
                    ends.push(around.len() as u32);
                }
            }
        }
        // Around the cut, from link to link.
        let mut cap = Vec::with_capacity(links.len());
        if let Some(&(first, _)) = links.first() {
            let mut at = first;
            for _ in 0..links.len() {
                cap.push(at);
                match links.iter().find(|(from, _)| *from == at) {
                    Some(&(_, to)) if to != first => at = to,
                    _ => break,
                }
            }
        }
        if cap.len() >= 3 {
            for (side, (around, ends)) in parts.iter_mut().enumerate() {
                if side == 0 {
                    around.extend(&cap);
                } else {
                    around.extend(cap.iter().rev());
                }
                ends.push(around.len() as u32);
            }
        }
        parts.map(|(around, ends)| Cell::only_used(&corners, around, ends))
    }

    /// Without the corners that no face has.
    fn only_used(all: &[DVec3], mut around: Vec<u32>, ends: Vec<u32>) -> Cell {
        let mut names = vec![u32::MAX; all.len()];
        let mut corners = Vec::new();
        for i in &mut around {
            let name = &mut names[*i as usize];
            if *name == u32::MAX {
                *name = corners.len() as u32;
                corners.push(all[*i as usize]);
            }
            *i = *name;
        }
        let mut cell = Cell { corners, around, ends, vectors: Vec::new(), area: 0.0 };
        cell.measure();
        cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::Vec3A;

    /// A number in `-1..1` that looks random.
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn volume(cell: &Cell) -> f64 {
        let about = cell.corners[0];
        let at = |i: u32| cell.corners[i as usize] - about;
        let cone = |face: &[u32]| {
            face[1..].windows(2).map(|w| at(face[0]).dot(at(w[0]).cross(at(w[1])))).sum::<f64>()
        };
        cell.faces().map(cone).sum::<f64>() / 6.0
    }

    #[test]
    fn parts_have_the_surface_of_the_whole_and_twice_the_cut() {
        let mut seed = 7;
        for _ in 0..200 {
            let mut cell = Cell::of_box(&Aabb::new(Vec3A::new(-1.0, -2.0, 0.5), Vec3A::new(1.0, 3.0, 1.0)));
            assert_eq!((cell.area(), volume(&cell)), (2.0 * (10.0 + 2.5 + 1.0), 5.0));
            for _ in 0..24 {
                let normal = DVec3::from_array([0; 3].map(|_| noise(&mut seed))).normalize();
                // Through a corner every third time, so that heights of zero occur.
                let through = match seed % 3 {
                    0 => cell.corners[0],
                    _ => cell.corners.iter().sum::<DVec3>() / cell.corners.len() as f64,
                };
                let mut heights = Vec::new();
                let [low, high] = cell.heights(normal, normal.dot(through), &mut heights);
                if low > -1e-9 || high < 1e-9 {
                    continue;
                }
                let (areas, parts) = (cell.areas(&heights), cell.split(&heights));
                let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * cell.area();
                for (area, part) in areas.iter().zip(&parts) {
                    assert!(near(*area, part.area()), "{area} {}", part.area());
                    assert_eq!(part.corners.len() + part.ends.len(), part.around.len() / 2 + 2);
                }
                assert!((volume(&parts[0]) + volume(&parts[1]) - volume(&cell)).abs() < 1e-9);
                let flat = parts[0].faces().last().map(|face| {
                    let at = |i: u32| parts[0].corners[i as usize];
                    let sum = |w: &[u32]| (at(w[0]) - at(face[0])).cross(at(w[1]) - at(face[0]));
                    face[1..].windows(2).map(sum).sum::<DVec3>().length() * 0.5
                });
                assert!(near(areas[0] + areas[1], cell.area() + 2.0 * flat.unwrap()));
                let [below, above] = parts;
                cell = if seed & 16 == 0 { below } else { above };
                if volume(&cell) < 1e-3 {
                    break;
                }
            }
        }
    }
}

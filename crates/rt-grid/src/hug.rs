//! Hierarchies of grids: primitives of like size that hang together become a grid, which is an object of the next one up.

use crate::build::Part;
use rt_bounds::Aabb;

/// Sizes that differ by less than this factor are never parted.
const ALIKE: f64 = 1.1;
/// In a cell of the search for neighbours, so many boxes are compared with each other; more count as one heap.
const HEAP: usize = 64;
/// Cells along an axis in that search, at most.
const MOST_PLACES: f64 = (1 << 21) as f64;

/// A class of size for each part, from 0 for the smallest, at most `most` of them: cut at the widest gaps between logarithms of
/// diagonals, of equals at the lowest.
pub(crate) fn classes(parts: &[Part], most: u32) -> Vec<u32> {
    let sizes: Vec<f64> = parts.iter().map(|(_, part)| diagonal(part).max(f64::MIN_POSITIVE)).collect();
    let mut sorted = sizes.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let gap = |pair: &[f64]| (pair[1] > ALIKE * pair[0]).then(|| (pair[1].log2() - pair[0].log2(), pair[1]));
    let mut gaps: Vec<(f64, f64)> = sorted.windows(2).filter_map(gap).collect();
    gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
    gaps.truncate(most.saturating_sub(1) as usize);
    let mut steps: Vec<f64> = gaps.into_iter().map(|(_, step)| step).collect();
    steps.sort_unstable_by(f64::total_cmp);
    sizes.iter().map(|size| steps.partition_point(|step| step <= size) as u32).collect()
}

/// How long a box is from corner to corner.
pub(crate) fn diagonal(b: &Aabb) -> f64 {
    (b.max.as_dvec3() - b.min.as_dvec3()).length()
}

/// The clusters of some parts: those whose boxes, grown on each side by `grown` of their diagonal, overlap or are linked by others
/// that do. Ascending numbers in each, and clusters in the order of their first. `O(n log n)`.
///
/// Boxes are sorted into cells as large as the largest of them. Where more than [`HEAP`] meet in a cell they count as linked: a cell
/// costs no more than that many comparisons for each box, and clusters only become larger.
pub(crate) fn clusters(parts: &[Part], members: &[u32], grown: f32) -> Vec<Vec<u32>> {
    let boxes: Vec<[[f64; 2]; 3]> = members
        .iter()
        .map(|slot| {
            let part = &parts[*slot as usize].1;
            let room = grown as f64 * diagonal(part);
            [0, 1, 2].map(|a| [part.min[a] as f64 - room, part.max[a] as f64 + room])
        })
        .collect();
    let mut per = [(0.0, 0.0); 3];
    let side = |b: &[[f64; 2]; 3]| b.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let largest = boxes.iter().map(side).fold(0.0, f64::max);
    for (a, per) in per.iter_mut().enumerate() {
        let low = boxes.iter().map(|b| b[a][0]).fold(f64::INFINITY, f64::min);
        let high = boxes.iter().map(|b| b[a][1]).fold(f64::NEG_INFINITY, f64::max);
        let width = largest.max((high - low) / (MOST_PLACES - 1.0));
        *per = (low, if width > 0.0 { 1.0 / width } else { 0.0 });
    }
    // Each box in each cell that it overlaps: two along an axis, rarely three.
    let mut places = Vec::with_capacity(boxes.len() * 8);
    for (i, b) in (0u32..).zip(&boxes) {
        let place = |a: usize, x: f64| ((x - per[a].0) * per[a].1).clamp(0.0, MOST_PLACES - 1.0) as u64;
        let [x, y, z] = [0, 1, 2].map(|a| place(a, b[a][0])..=place(a, b[a][1]));
        for z in z {
            for y in y.clone() {
                places.extend(x.clone().map(|x| (z << 42 | y << 21 | x, i)));
            }
        }
    }
    places.sort_unstable();
    let mut roots: Vec<u32> = (0..boxes.len() as u32).collect();
    for here in places.chunk_by(|a, b| a.0 == b.0) {
        for (n, (_, i)) in here.iter().enumerate() {
            if here.len() > HEAP {
                link(&mut roots, here[0].1, *i);
                continue;
            }
            for (_, j) in &here[..n] {
                let (p, q) = (&boxes[*i as usize], &boxes[*j as usize]);
                if (0..3).all(|a| p[a][0] <= q[a][1] && q[a][0] <= p[a][1]) {
                    link(&mut roots, *i, *j);
                }
            }
        }
    }
    let mut sorted: Vec<(u32, u32)> =
        (0..boxes.len() as u32).map(|i| (root(&mut roots, i), members[i as usize])).collect();
    sorted.sort_unstable();
    sorted.chunk_by(|a, b| a.0 == b.0).map(|some| some.iter().map(|(_, slot)| *slot).collect()).collect()
}

/// The lowest number linked to `i`.
fn root(roots: &mut [u32], mut i: u32) -> u32 {
    while roots[i as usize] != i {
        roots[i as usize] = roots[roots[i as usize] as usize];
        i = roots[i as usize];
    }
    i
}

fn link(roots: &mut [u32], i: u32, j: u32) {
    let (i, j) = (root(roots, i), root(roots, j));
    roots[i.max(j) as usize] = i.min(j);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_geom::glam::Vec3A;

    #[test]
    fn clusters_are_those_of_the_definition() {
        let mut state = 1u32;
        let mut random = |n: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % n
        };
        for round in 0..300 {
            let mut corner =
                || Vec3A::new(random(20) as f32, random(15) as f32, random(1 + round % 9) as f32);
            let parts: Vec<Part> = (0..40)
                .map(|i| {
                    let low = corner();
                    (i, Aabb::new(low, low + corner() * 0.1))
                })
                .collect();
            let members: Vec<u32> = (0..40).filter(|i| i % 7 != 0).collect();
            let near = |i: &u32, j: &u32| {
                let b = parts[*i as usize].1.overlap(parts[*j as usize].1);
                !b.is_empty()
            };
            // Every part takes the least label around it, until all are at rest.
            let mut labels: Vec<u32> = (0..40).collect();
            for _ in 0..40 {
                for i in &members {
                    for j in members.iter().filter(|j| near(i, j)) {
                        labels[*i as usize] = labels[*i as usize].min(labels[*j as usize]);
                    }
                }
            }
            for some in clusters(&parts, &members, 0.0) {
                let label = labels[some[0] as usize];
                let whole: Vec<u32> =
                    members.iter().copied().filter(|i| labels[*i as usize] == label).collect();
                assert_eq!(some, whole, "round {round}");
            }
        }
    }

    #[test]
    fn classes_part_at_the_widest_gaps() {
        let sizes = [1.0, 100.0, 1.05, 0.0, 9.0, 10.0, 0.0];
        let parts: Vec<Part> = sizes.iter().map(|s| (0, Aabb::new(Vec3A::ZERO, Vec3A::splat(*s)))).collect();
        assert_eq!(classes(&parts, 1), [0; 7]);
        assert_eq!(classes(&parts, 2), [1, 1, 1, 0, 1, 1, 0]);
        assert_eq!(classes(&parts, 3), [1, 2, 1, 0, 1, 1, 0]);
        assert_eq!(classes(&parts, 9), [1, 4, 1, 0, 2, 3, 0]);
    }
}

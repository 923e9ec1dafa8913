//! Proximity clouds: how many cells away the nearest cell that is not empty is.

/// What a cell is, in a byte: [`LEAF`], [`GRID`], or else empty, and then the number of cells to the nearest that is not, counted
/// as a king moves on a chessboard; at most 254.
pub(crate) const LEAF: u8 = 0;
/// A cell that is a grid.
pub(crate) const GRID: u8 = 255;
/// As far as counts.
const FAR: u8 = 254;

/// Turns the 1 of each empty cell into its distance. `O(cells)`: two passes over half of the neighbours each, which is exact for
/// this metric. What lies outside of the grid is as empty as can be.
///
/// Source: Rosenfeld and Pfaltz, "Distance functions on digital pictures", Pattern Recognition 1 (1968).
pub(crate) fn spread(kinds: &mut [u8], count: [u32; 3]) {
    let n = count.map(|n| n as usize);
    let index = |c: [usize; 3]| (c[2] * n[1] + c[1]) * n[0] + c[0];
    // 0 for a grid, without a branch.
    let near = |kind: u8| kind.wrapping_add(1).saturating_sub(1);
    for kind in kinds.iter_mut() {
        *kind = if *kind == 1 { FAR } else { *kind };
    }
    // The least of the rows before this one, then along the row: forth, and the same back.
    let mut row = vec![FAR; n[0] + 2];
    for back in [false, true] {
        let order = |i: usize, n: usize| if back { n - 1 - i } else { i };
        for z in (0..n[2]).map(|z| order(z, n[2])) {
            for y in (0..n[1]).map(|y| order(y, n[1])) {
                row.fill(FAR);
                let z_before = if back { z + 1 } else { z.wrapping_sub(1) };
                let y_before = if back { y + 1 } else { y.wrapping_sub(1) };
                let mut take = |y: usize, z: usize| {
                    if y < n[1] && z < n[2] {
                        let from = index([0, y, z]);
                        for (least, kind) in row[1..].iter_mut().zip(&kinds[from..from + n[0]]) {
                            *least = (*least).min(near(*kind));
                        }
                    }
                };
                for y in [y.wrapping_sub(1), y, y + 1] {
                    take(y, z_before);
                }
                take(y_before, z);
                let from = index([0, y, z]);
                let here = &mut kinds[from..from + n[0]];
                let around = row.iter().zip(&row[1..]).zip(&row[2..]);
                for (kind, ((a, b), c)) in here.iter_mut().zip(around) {
                    let least = (*a.min(b).min(c) + 1).min(FAR);
                    *kind = if *kind == GRID { GRID } else { (*kind).min(least) };
                }
                let along = |last: u8, kind: &mut u8| {
                    let least = near(*kind).min(last + 1);
                    *kind = if *kind == GRID { GRID } else { least };
                    least
                };
                match back {
                    false => here.iter_mut().fold(FAR, along),
                    true => here.iter_mut().rev().fold(FAR, along),
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_the_definition() {
        let mut state = 1u32;
        let mut random = |n: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % n
        };
        for round in 0..200 {
            let count = [1 + random(9), 1 + random(6), 1 + random(5)];
            let cells: Vec<[i64; 3]> = (0..count[2])
                .flat_map(|z| {
                    (0..count[1])
                        .flat_map(move |y| (0..count[0]).map(move |x| [x as i64, y as i64, z as i64]))
                })
                .collect();
            let mut kinds: Vec<u8> = cells
                .iter()
                .map(|_| [1, 1, 1, 1, LEAF, GRID][random(if round % 3 == 0 { 6 } else { 5 }) as usize])
                .collect();
            let full: Vec<[i64; 3]> =
                cells.iter().zip(&kinds).filter(|(_, kind)| **kind != 1).map(|(c, _)| *c).collect();
            spread(&mut kinds, count);
            for (c, kind) in cells.iter().zip(&kinds) {
                let apart = |f: &[i64; 3]| (0..3).map(|a| (f[a] - c[a]).abs()).max().unwrap_or(0);
                let nearest = full.iter().map(apart).min().unwrap_or(254);
                let kind = if *kind == GRID { 0 } else { *kind as i64 };
                assert_eq!(kind, nearest, "at {c:?} of {count:?}");
            }
        }
    }
}

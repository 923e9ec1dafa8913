//! Morton codes instead of nodes: a node is the run of those leaves whose codes begin with its own.

use crate::build::Draft;
use crate::octree::{LEAF, Run};

/// The code of the root, were it a leaf.
pub(crate) const ROOT: u64 = 1 << 63;

/// How many digits a code has.
#[inline(always)]
pub(crate) fn level(key: u64) -> u32 {
    (63 - (key | ROOT).trailing_zeros().min(63)) / 3
}

/// Where the digit after `level` of them stands in a code.
#[inline(always)]
fn shift(level: u32) -> u32 {
    61 - (3 * level).min(60)
}

/// The codes of all leaves of a tree of nodes, in their order; leaves are numbered in it.
pub(crate) fn keys(nodes: &[Draft], leaves: usize) -> Vec<u64> {
    let mut keys = vec![ROOT; leaves];
    let mut stack = vec![(0u32, 0u64, 0u32)];
    while let Some((link, prefix, level)) = stack.pop() {
        let Some(node) = nodes.get(link as usize) else { continue };
        for c in (0..8).filter(|c| node.full >> c & 1 == 1) {
            let link = node.links[c];
            let prefix = prefix | (c as u64) << shift(level);
            if link & LEAF == 0 {
                stack.push((link, prefix, level + 1));
            } else if let Some(key) = keys.get_mut((link & !LEAF) as usize) {
                *key = prefix | ROOT >> (3 * (level + 1));
            }
        }
    }
    keys
}

/// Child `c` of a run, if it is not empty.
#[inline(always)]
pub(crate) fn run_of(keys: &[u64], run: &Run, c: u64) -> Option<Run> {
    let shift = shift(run.level);
    let prefix = run.prefix | c << shift;
    let among = keys.get(run.first as usize..run.last as usize)?;
    let from = before(among, prefix);
    // The last child's codes may end at the greatest number there is.
    let greatest = prefix | ((1u64 << shift) - 1);
    let len = before(&among[from..], greatest);
    let len = len + among.get(from + len).is_some_and(|key| *key == greatest) as usize;
    let first = run.first + from as u32;
    (len > 0).then_some(Run { first, last: first + len as u32, prefix, level: run.level + 1 })
}

/// How many of some ascending codes are less than this one.
#[inline(always)]
fn before(keys: &[u64], key: u64) -> usize {
    if keys.len() <= 8 {
        return keys.iter().map(|k| (*k < key) as usize).sum();
    }
    keys.partition_point(|k| *k < key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::MAX_DEPTH;

    #[test]
    fn codes_know_their_level_and_order() {
        assert_eq!(level(ROOT), 0);
        let mut key = 0;
        for depth in 0..MAX_DEPTH as u32 {
            key |= 7 << shift(depth);
            assert_eq!(level(key | ROOT >> (3 * (depth + 1))), depth + 1);
        }
        assert_eq!(key | 1, u64::MAX);
    }

    #[test]
    fn runs_part_all_leaves() {
        // A leaf of the first level, and eight of the deepest in the last corner.
        let deep = |c: u64| u64::MAX << 4 | c << 1 | 1;
        let keys: Vec<u64> = [ROOT >> 3].into_iter().chain((0..8).map(deep)).collect();
        let mut run = Run { first: 0, last: 9, prefix: 0, level: 0 };
        let first = run_of(&keys, &run, 0).unwrap();
        assert_eq!((first.first, first.last), (0, 1));
        while (run.level as usize) < MAX_DEPTH - 1 {
            assert!(run_of(&keys, &run, 3).is_none());
            run = run_of(&keys, &run, 7).unwrap();
        }
        for c in 0..8 {
            let leaf = run_of(&keys, &run, c).unwrap();
            assert_eq!((leaf.first, leaf.last), (1 + c as u32, 2 + c as u32));
        }
    }
}

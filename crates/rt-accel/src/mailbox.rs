//! [`Mailbox`]: which primitives a ray has met; [`Mailing`]: the knob for it. For structures that repeat primitives.

use crate::{Leaf, Visitor};
use core::ops::ControlFlow;
use rt_geom::{Ray, Real};

/// Remembers some of the primitives a ray was tested against, so that one that stands in several cells is not tested in each.
///
/// It lives on the stack, one for each ray, so that threads and rays within rays share nothing. It may forget, which costs a
/// repeated test and never changes an answer: the closest hit of a primitive is the same however often it is asked. Where every
/// primitive shall be met once for certain (`all_hits`), the [`Aggregate`](crate::Aggregate) sees to it.
///
/// Worth its place where a test costs more than a look, times the share of tests that are repeated: structures count their repeats
/// at build and choose.
///
/// ```
/// use rt_accel::{HashedMailbox, Mailbox};
/// let mut met = HashedMailbox::<8>::default();
/// assert!(met.is_new(3) && met.is_new(5) && !met.is_new(3));
/// assert!(met.is_new(11) && met.is_new(3)); // 11 took the place of 3
/// ```
pub trait Mailbox: Default {
    /// Whether it never remembers anything, so that leaves need not be sifted.
    const BLANK: bool = false;

    /// Whether `prim` is not remembered; it then is.
    fn is_new(&mut self, prim: u32) -> bool;

    /// Shows `visit` a leaf without the primitives that are remembered, in one piece or several.
    #[inline(always)]
    fn show<R: Real>(
        &mut self,
        leaf: Leaf<'_>,
        ray: &mut Ray<R>,
        visit: &mut impl Visitor<R>,
    ) -> ControlFlow<()> {
        if Self::BLANK {
            return visit.leaf(leaf, ray);
        }
        for some in leaf.prims.chunks(SIFTED) {
            let (mut sifted, mut count) = ([0; SIFTED], 0);
            for &prim in some {
                if self.is_new(prim) {
                    sifted[count] = prim;
                    count += 1;
                } else {
                    visit.spared();
                }
            }
            if count > 0 {
                visit.leaf(Leaf { first: leaf.first, prims: &sifted[..count] }, ray)?;
            }
        }
        ControlFlow::Continue(())
    }
}

/// How many primitives of a leaf are sifted at a time.
const SIFTED: usize = 16;

/// Remembers nothing, at no cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoMailbox;

impl Mailbox for NoMailbox {
    const BLANK: bool = true;

    #[inline(always)]
    fn is_new(&mut self, _prim: u32) -> bool {
        true
    }
}

/// A table of `N` numbers (a power of two), each in the place that its low bits name: one comparison a look.
///
/// Source: Benthin, *Realtime Ray Tracing on Current CPU Architectures*, PhD thesis, Saarland University (2006).
#[derive(Clone, Copy, Debug)]
pub struct HashedMailbox<const N: usize>([u32; N]);

impl<const N: usize> Default for HashedMailbox<N> {
    /// Every place holds a number that belongs elsewhere, so that none is remembered by chance.
    #[inline(always)]
    fn default() -> Self {
        const { assert!(N.is_power_of_two() && N >= 2, "a mailbox has a power of two of places, at least 2") }
        let mut places = [0; N];
        places[0] = 1;
        HashedMailbox(places)
    }
}

impl<const N: usize> Mailbox for HashedMailbox<N> {
    #[inline(always)]
    fn is_new(&mut self, prim: u32) -> bool {
        let place = &mut self.0[prim as usize & (N - 1)];
        let new = *place != prim;
        *place = prim;
        new
    }
}

/// The last `N` numbers, in a ring: `N` comparisons a look, side by side in lanes.
///
/// Source: Shevtsov, Soupikov, Kapustin, "Ray-triangle intersection algorithm for modern CPU architectures", GraphiCon 2007
/// (inverse mailboxing).
#[derive(Clone, Copy, Debug)]
pub struct InverseMailbox<const N: usize> {
    last: [u32; N],
    /// How many were ever put in.
    count: usize,
}

impl<const N: usize> Default for InverseMailbox<N> {
    #[inline(always)]
    fn default() -> Self {
        const { assert!(N > 0, "a mailbox has a place") }
        InverseMailbox { last: [0; N], count: 0 }
    }
}

impl<const N: usize> Mailbox for InverseMailbox<N> {
    #[inline(always)]
    fn is_new(&mut self, prim: u32) -> bool {
        let mut known = false;
        for (i, last) in self.last.iter().enumerate() {
            known |= *last == prim && i < self.count;
        }
        if !known {
            self.last[self.count % N] = prim;
            self.count += 1;
        }
        !known
    }
}

/// Whether rays remember whom they were tested against, and how: for the knobs of structures that repeat primitives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mailing {
    /// They do not.
    None,
    /// In a [`HashedMailbox`].
    Hashed,
    /// In an [`InverseMailbox`].
    Inverse,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whoever is not new has been put in before; whoever was just put in is not new.
    fn tells_the_truth<M: Mailbox>() {
        let mut met = std::collections::HashSet::new();
        let mut mailbox = M::default();
        let mut prim = 1u32;
        for _ in 0..10_000 {
            prim = prim.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            for prim in [prim >> 26, 0, u32::MAX] {
                let new = met.insert(prim);
                assert!(!new || mailbox.is_new(prim), "{prim} was never met");
                mailbox.is_new(prim);
                assert!(!mailbox.is_new(prim));
            }
        }
    }

    #[test]
    fn what_is_remembered_was_met() {
        tells_the_truth::<HashedMailbox<2>>();
        tells_the_truth::<HashedMailbox<64>>();
        tells_the_truth::<InverseMailbox<1>>();
        tells_the_truth::<InverseMailbox<8>>();
        assert!(NoMailbox.is_new(1) && NoMailbox.is_new(1));
    }
}

//! The clock: several contestants, in one process, in turn.
//!
//! Machines drift: frequencies, neighbours, temperatures. So contestants run in interleaved rounds, each round starting with
//! another one, and are compared within rounds: the median of per-round ratios says more than the ratio of two medians.

use std::time::Instant;

/// How often to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Rounds that are not counted.
    pub warm_up: usize,
    /// Rounds that are; at least 1 is run.
    pub rounds: usize,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan { warm_up: 2, rounds: 11 }
    }
}

/// The times of some contestants, by round.
///
/// ```
/// use rt_measure::clock::{Plan, race};
/// let mut sums = [0u64; 2];
/// let [a, b] = &mut sums;
/// let race = race(
///     Plan { warm_up: 1, rounds: 5 },
///     &mut [&mut || *a += (0..1000).sum::<u64>(), &mut || *b += (0..9000).sum::<u64>()],
/// );
/// assert!(race.median(0) >= 0.0 && race.spread(1) >= 1.0);
/// assert_eq!(race.ratio(1, 1), 1.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Race {
    /// For each contestant the nanoseconds of each round.
    pub times: Vec<Vec<f64>>,
}

/// Runs all contestants in every round, in rotating order.
///
/// A contestant should run for at least some tens of microseconds, because reading the clock costs tens of nanoseconds.
pub fn race(plan: Plan, contestants: &mut [&mut dyn FnMut()]) -> Race {
    let start = Instant::now();
    race_by(plan, contestants, &mut || start.elapsed().as_nanos() as f64)
}

/// [`race`] by any clock that counts nanoseconds.
fn race_by(plan: Plan, contestants: &mut [&mut dyn FnMut()], now: &mut dyn FnMut() -> f64) -> Race {
    let n = contestants.len();
    let rounds = plan.rounds.max(1);
    let mut times = vec![Vec::with_capacity(rounds); n];
    for round in 0..plan.warm_up + rounds {
        for turn in 0..n {
            let who = (round + turn) % n;
            let begin = now();
            contestants[who]();
            let end = now();
            if round >= plan.warm_up {
                times[who].push(end - begin);
            }
        }
    }
    Race { times }
}

impl Race {
    /// The median of a contestant's rounds, in nanoseconds; NaN if there is no such contestant.
    pub fn median(&self, who: usize) -> f64 {
        self.quantile(who, 0.5)
    }

    /// The 90th percentile over the 10th, at least 1: how unsteady the machine was. NaN if there is no such contestant.
    pub fn spread(&self, who: usize) -> f64 {
        let (high, low) = (self.quantile(who, 0.9), self.quantile(who, 0.1));
        if high == low { 1.0 } else { high / low }
    }

    /// The median over rounds of one contestant's time over another's; NaN if there is no such contestant.
    pub fn ratio(&self, who: usize, against: usize) -> f64 {
        let (Some(a), Some(b)) = (self.times.get(who), self.times.get(against)) else { return f64::NAN };
        let ratios: Vec<f64> = a.iter().zip(b).map(|(a, b)| if a == b { 1.0 } else { a / b }).collect();
        quantile(&ratios, 0.5)
    }

    fn quantile(&self, who: usize, q: f64) -> f64 {
        self.times.get(who).map_or(f64::NAN, |times| quantile(times, q))
    }
}

/// The value below which a share `q` of the numbers lies, interpolated linearly; NaN for none.
pub fn quantile(numbers: &[f64], q: f64) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = q.clamp(0.0, 1.0) * sorted.len().saturating_sub(1) as f64;
    let (low, part) = (at as usize, at.fract());
    match (sorted.get(low), sorted.get(low + 1)) {
        (Some(a), Some(b)) => a + (b - a) * part,
        (Some(a), None) => *a,
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::{Cell, RefCell};

    #[test]
    fn rounds_rotate_and_warm_ups_do_not_count() {
        let time = Cell::new(0.0);
        let order = RefCell::new(Vec::new());
        let mut a = || {
            order.borrow_mut().push('a');
            time.set(time.get() + 10.0);
        };
        let mut b = || {
            order.borrow_mut().push('b');
            time.set(time.get() * 2.0);
        };
        let race = race_by(Plan { warm_up: 1, rounds: 2 }, &mut [&mut a, &mut b], &mut || time.get());
        assert_eq!(order.into_inner(), ['a', 'b', 'b', 'a', 'a', 'b']);
        assert_eq!(race.times, [vec![10.0, 10.0], vec![20.0, 60.0]]);
        assert_eq!((race.median(1), race.ratio(1, 0), race.ratio(0, 0)), (40.0, 4.0, 1.0));
        assert_eq!(race.spread(0), 1.0);
        assert!((race.spread(1) - 56.0 / 24.0).abs() < 1e-12);
        assert!(race.median(2).is_nan() && race.ratio(0, 2).is_nan() && race.spread(2).is_nan());
    }

    #[test]
    fn quantiles() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0], 0.75), 1.75);
        assert_eq!(quantile(&[1.0], 7.0), 1.0);
        assert!(quantile(&[], 0.5).is_nan());
        assert!(race(Plan::default(), &mut []).times.is_empty());
    }
}

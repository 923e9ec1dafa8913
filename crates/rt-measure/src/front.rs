//! The Pareto front of error against time.

/// One measured point; less is better in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// How wrong, in any unit, the same for all points compared.
    pub error: f64,
    /// How slow, likewise.
    pub time: f64,
}

impl Point {
    /// Whether this point is no worse in both and better in one. False when either holds a NaN.
    pub fn dominates(self, other: Point) -> bool {
        self.error <= other.error
            && self.time <= other.time
            && (self.error < other.error || self.time < other.time)
    }
}

/// The positions of the points that no other dominates, by rising time; equal points all stay. A point with a NaN is never
/// among them. `O(n log n)`.
///
/// ```
/// use rt_measure::front::{Point, front};
/// let points = [(0.0, 9.0), (1.0, 2.0), (1.0, 3.0), (5.0, 1.0)].map(|(error, time)| Point { error, time });
/// assert_eq!(front(&points), [3, 1, 0]);
/// ```
pub fn front(points: &[Point]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| !points[i].error.is_nan() && !points[i].time.is_nan()).collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (points[i], points[j]);
        // Adding zero makes one of the two zeros.
        (a.time + 0.0).total_cmp(&(b.time + 0.0)).then((a.error + 0.0).total_cmp(&(b.error + 0.0)))
    });
    let mut last: Option<Point> = None;
    order.retain(|&i| {
        let kept = last.is_none_or(|last| points[i].error < last.error || points[i] == last);
        if kept {
            last = Some(points[i]);
        }
        kept
    });
    order
}

/// The positions of the others, in ascending order.
pub fn dominated(points: &[Point]) -> Vec<usize> {
    let front = front(points);
    (0..points.len()).filter(|i| !front.contains(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_front_is_who_nobody_dominates(raw in prop::collection::vec((0..6i32, 0..6i32), 0..40)) {
            let points: Vec<Point> =
                raw.iter().map(|&(error, time)| Point { error: error.into(), time: time.into() }).collect();
            let mut found = front(&points);
            found.sort_unstable();
            let free = |i: &usize| !points.iter().any(|p| p.dominates(points[*i]));
            let expected: Vec<usize> = (0..points.len()).filter(free).collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn what_is_not_a_number_is_dominated() {
        let point = |error: f64, time: f64| Point { error, time };
        let points = [point(f64::NAN, 0.0), point(1.0, f64::INFINITY), point(0.0, f64::NAN), point(1.0, 2.0)];
        assert_eq!(front(&points), [3]);
        assert_eq!(dominated(&points), [0, 1, 2]);
        assert_eq!(front(&[point(-0.0, 1.0), point(0.0, 1.0), point(0.0, -0.0), point(0.0, 0.0)]), [2, 3]);
    }
}

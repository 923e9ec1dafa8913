//! Roots found, judged by exact ones.

use rt_measure::exact::Rational;
use rt_measure::rays::Seeded;
use rt_shapes::Root;

/// A size from 1e-6 to 1e6, each magnitude as often.
pub(crate) fn size(seeded: &mut Seeded) -> f64 {
    10f64.powf(seeded.between(-6.0, 6.0))
}

#[derive(Default, Debug)]
pub(crate) struct Tally {
    pub(crate) cases: u64,
    pub(crate) roots: u64,
    pub(crate) missed: u64,
    /// Roots that are none, but cannot be told from one within their bound.
    pub(crate) doubtful: u64,
    /// Roots that are none.
    pub(crate) invented: u64,
    /// Beyond the reported bound.
    pub(crate) beyond: u64,
    /// Over 4 units in the last place where the condition is below 1e6.
    pub(crate) coarse: u64,
    pub(crate) worst: f64,
    /// The first few of these.
    pub(crate) told: Vec<String>,
}

impl Tally {
    fn tell(&mut self, what: String) {
        if self.told.len() < 6 {
            self.told.push(what);
        }
    }

    pub(crate) fn judge(
        &mut self,
        truth: &[Rational],
        found: [Option<Root>; 2],
        condition: impl Fn(f64) -> f64,
        near: impl Fn(Root) -> bool,
        case: impl core::fmt::Debug,
    ) {
        self.cases += 1;
        let mut left: Vec<Root> = found.into_iter().flatten().collect();
        for t in truth {
            self.roots += 1;
            let exact = t.to_f64();
            let near = (0..left.len())
                .min_by(|&i, &j| (left[i].t - exact).abs().total_cmp(&(left[j].t - exact).abs()));
            let Some(root) = near.map(|i| left.remove(i)) else {
                // A tangent may be reported once for its two exact roots.
                let off = |r: &Root| (t - &Rational::from_f64(r.t).unwrap()).to_f64().abs();
                let same = found.iter().flatten().any(|r| off(r) <= r.error);
                if !same {
                    self.missed += 1;
                    self.tell(format!("missed {exact:e} of {case:?}: {found:?}"));
                }
                continue;
            };
            let off = (t - &Rational::from_f64(root.t).unwrap()).to_f64().abs();
            if off > root.error || root.error.is_nan() {
                self.beyond += 1;
                self.tell(format!(
                    "off by {off:e} at {exact:e}, bound {:e}, of {case:?}: {found:?}",
                    root.error
                ));
            }
            let ulp = exact.abs().next_up() - exact.abs();
            let condition = condition(exact);
            if condition < 1e6 {
                self.worst = self.worst.max(off / ulp);
                if off > 4.0 * ulp {
                    self.coarse += 1;
                    self.tell(format!(
                        "{} ulp at {exact:e} (condition {condition:e}) of {case:?}: {found:?}",
                        off / ulp
                    ));
                }
            }
        }
        for root in left {
            if near(root) {
                self.doubtful += 1;
            } else {
                self.invented += 1;
                self.tell(format!("invented {root:?} of {case:?}: {found:?}"));
            }
        }
    }
}

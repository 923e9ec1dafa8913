//! Roots found, judged by exact ones.

use rt_geom::glam::DVec3;
use rt_measure::exact::{Rational, quadratic};
use rt_measure::rays::Seeded;
use rt_shapes::Root;

/// A size from 1e-6 to 1e6, each magnitude as often.
pub(crate) fn size(seeded: &mut Seeded) -> f64 {
    10f64.powf(seeded.between(-6.0, 6.0))
}

/// Whether this is a root, or twice the digits of `f64` cannot be blamed for taking it for one.
///
/// `f` is the exact residual of the whole surface along the line, a quadratic in units of squared length, and `size` the squared
/// size of what is met. Where within the reported error `f` is 0, or failing that where it has its extremum or the root itself
/// is, it must be below `2^-90` of `size`; and there `kept` holds, up to `2^-90` of the distance. What is known less well may be
/// further off: by the error that the root had before it was rounded to `f64`, if that is all within `2^-84` of `size` of the
/// surface.
pub(crate) fn unresolved(
    (o, d): (DVec3, DVec3),
    root: Root,
    size: f64,
    f: impl Fn(&Rational) -> Rational,
    kept: impl Fn(&Rational, f64) -> bool,
) -> bool {
    let whole = |x: f64| Rational::from_f64(x).unwrap();
    let [c, plus, minus] = [0.0, 1.0, -1.0].map(|t| f(&whole(t)));
    let a = &(&whole(0.5) * &(&plus + &minus)) - &c;
    let b = &whole(0.25) * &(&plus - &minus);
    let at = |t: &Rational| (&c + &(&(&(&whole(2.0) * &b) + &(&a * t)) * t)).to_f64().abs();
    let (t, error) = (whole(root.t), whole(root.error));
    let mut places = quadratic(&a, &b, &c);
    if a.sign() != 0 {
        places.push(&(&whole(0.0) - &b) / &a);
    }
    places.push(t.clone());
    // Distances from far away have their digits after those.
    let size = size + o.length() * size.sqrt();
    let blur = (root.error - 0.5 * f64::EPSILON * root.t.abs()).max(0.0);
    let least = (o.length() + (d * root.t).length()) * 2f64.powi(-90);
    places.iter().any(|place| {
        let close = (place - &t) <= error && (&t - place) <= error && at(place) <= size * 2f64.powi(-90);
        let spread = [&whole(blur), &whole(-blur)].map(|s| at(&(place + s)));
        let play = if spread[0].max(spread[1]) <= size * 2f64.powi(-84) { d.length() * blur } else { 0.0 };
        close && kept(place, least + play)
    })
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
    /// Over a unit in the last place where the condition is below 1e6.
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
                if off > ulp {
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

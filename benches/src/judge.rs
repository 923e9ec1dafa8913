//! [`Judge`]: what is right, found without anybody who is judged.

use crate::subject::{Prims, RaySet};
use rt_geom::{Ray, Real, Vector};
use rt_measure::error::HitError;
use rt_measure::exact::{self, Corners, Rational};
use rt_scenes::Solid;

/// What a contestant said, ray by ray.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Answers {
    /// Primitive and distance of closest hits.
    Closest32(Vec<Option<(u32, f32)>>),
    /// The same for `f64` rays.
    Closest64(Vec<Option<(u32, f64)>>),
    /// Whether anything was hit.
    Any32(Vec<bool>),
    /// The same for `f64` rays.
    Any64(Vec<bool>),
}

impl Answers {
    /// Where they differ from others, and how; `None` if they do not. Answers to other questions differ from the start.
    pub(crate) fn differ(&self, other: &Answers) -> Option<String> {
        fn first<T: PartialEq + core::fmt::Debug>(a: &[T], b: &[T]) -> Option<String> {
            let i = a.iter().zip(b).position(|(a, b)| a != b)?;
            Some(format!("ray {i}: {:?} and {:?}", a[i], b[i]))
        }
        match (self, other) {
            (Answers::Closest32(a), Answers::Closest32(b)) => first(a, b),
            (Answers::Closest64(a), Answers::Closest64(b)) => first(a, b),
            (Answers::Any32(a), Answers::Any32(b)) | (Answers::Any64(a), Answers::Any64(b)) => first(a, b),
            _ => Some("answers to different questions".into()),
        }
    }

    /// Whether both answer the same question.
    pub(crate) fn alike(&self, other: &Answers) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other)
    }
}

/// Judges answers by exact integers.
pub(crate) struct Judge<'a> {
    prims: &'a Prims,
    /// Corner by corner, padded.
    boxes: Vec<[[f64; 3]; 2]>,
}

/// A sample of a set of rays: the number of each, and the primitives that its line meets.
pub(crate) struct Sample(Vec<(usize, Vec<u32>)>);

impl Sample {
    /// How many rays.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }
}

impl<'a> Judge<'a> {
    /// Gathers a padded box around each primitive.
    pub(crate) fn new(prims: &'a Prims) -> Judge<'a> {
        let mut boxes: Vec<[[f64; 3]; 2]> =
            (0..prims.count() as u32).map(|prim| around(&points(prims, prim))).collect();
        let far =
            boxes.iter().flatten().flatten().filter(|x| x.is_finite()).fold(0.0f64, |m, x| m.max(x.abs()));
        // Rounding in the loop below is a few units of 1e-16, times the distance of a ray's origin: rays start near the scene.
        let pad = far * 1e-9;
        for [min, max] in &mut boxes {
            *min = min.map(|x| x - pad);
            *max = max.map(|x| x + pad);
        }
        Judge { prims, boxes }
    }

    /// About `count` rays of a set, evenly spread, and what their lines meet. `O(n)` a ray.
    pub(crate) fn sample(&self, set: &RaySet, count: usize) -> Sample {
        let len = set.rays.len();
        let count = count.min(len);
        let met = |i: usize| {
            let at = i * len / count;
            let ray = &set.wide[at];
            (at, self.candidates(ray).into_iter().filter(|&prim| self.meets(prim, ray)).collect())
        };
        Sample((0..count).map(met).collect())
    }

    /// The primitives whose box the whole line of the ray meets.
    fn candidates(&self, ray: &Ray<f64>) -> Vec<u32> {
        let (o, d) = (ray.origin.to_array(), ray.dir.to_array());
        let r = d.map(|x| 1.0 / x);
        let met = |[min, max]: &[[f64; 3]; 2]| {
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            for a in 0..3 {
                let (p, q) = ((min[a] - o[a]) * r[a], (max[a] - o[a]) * r[a]);
                near = near.max(p.min(q));
                far = far.min(p.max(q));
            }
            near <= far
        };
        (0..).zip(&self.boxes).filter(|(_, b)| met(b)).map(|(prim, _)| prim).collect()
    }

    fn meets(&self, prim: u32, ray: &Ray<f64>) -> bool {
        let (o, d) = (ray.origin.to_array(), ray.dir.to_array());
        match self.prims {
            Prims::Mesh(_) => exact::triangle(o, d, self.corners(prim)).is_some(),
            Prims::Solids(solids) => !roots(&solids[prim as usize], o, d).is_empty(),
        }
    }

    fn corners(&self, prim: u32) -> Corners {
        match points(self.prims, prim).as_slice() {
            [a, b, c, ..] => [*a, *b, *c],
            _ => [[0.0; 3]; 3],
        }
    }

    /// Judges the answers to the rays of a sample.
    pub(crate) fn judge(&self, sample: &Sample, set: &RaySet, answers: &Answers) -> HitError {
        let mut error = HitError::default();
        for (at, prims) in &sample.0 {
            match answers {
                Answers::Closest32(all) => self.closest(&mut error, &set.rays[*at], prims, all[*at]),
                Answers::Closest64(all) => self.closest(&mut error, &set.wide[*at], prims, all[*at]),
                Answers::Any32(all) => self.any(&mut error, &set.rays[*at], prims, all[*at]),
                Answers::Any64(all) => self.any(&mut error, &set.wide[*at], prims, all[*at]),
            }
        }
        error
    }

    fn closest<R: Real>(&self, error: &mut HitError, ray: &Ray<R>, prims: &[u32], found: Option<(u32, R)>) {
        match self.prims {
            Prims::Mesh(_) => {
                let corners: Vec<Corners> = prims.iter().map(|&prim| self.corners(prim)).collect();
                // A primitive that the line does not even meet has no number among those that it does.
                let place = |prim| prims.iter().position(|&p| p == prim).map_or(u32::MAX, |i| i as u32);
                error.judge_triangles(ray, &corners, found.map(|(prim, t)| (place(prim), t)));
            }
            Prims::Solids(solids) => {
                let root = |prim: u32| first(solids.get(prim as usize)?, ray);
                let mut best: Option<(u32, Rational)> = None;
                for &prim in prims {
                    if let Some(t) = root(prim)
                        && best.as_ref().is_none_or(|(_, least)| t < *least)
                    {
                        best = Some((prim, t));
                    }
                }
                // Equally far, exactly or after rounding: either is right.
                if let (Some((prim, t)), Some((other, _))) = (&mut best, found)
                    && *prim != other
                    && let Some(tie) = root(other)
                    && tie.nearest::<R>() == t.nearest::<R>()
                {
                    (*prim, *t) = (other, tie);
                }
                error.judge(best.as_ref().map(|(prim, t)| (*prim, t)), found);
            }
        }
    }

    fn any<R: Real>(&self, error: &mut HitError, ray: &Ray<R>, prims: &[u32], found: bool) {
        let hit = match self.prims {
            Prims::Mesh(_) => exact::closest(ray, prims.iter().map(|&prim| self.corners(prim))).is_some(),
            Prims::Solids(solids) => prims.iter().any(|&prim| first(&solids[prim as usize], ray).is_some()),
        };
        error.rays += 1;
        error.missed += (hit && !found) as u64;
        error.invented += (!hit && found) as u64;
    }
}

/// Points whose box encloses the primitive; those of a mesh are its corners.
fn points(prims: &Prims, prim: u32) -> Vec<[f64; 3]> {
    match prims {
        Prims::Mesh(mesh) => {
            mesh.triangles()[prim as usize].map(|i| mesh.vertices()[i as usize].map(f64::from)).to_vec()
        }
        Prims::Solids(solids) => match &solids[prim as usize] {
            Solid::Sphere(s) => {
                let (c, r) = (s.center().to_array(), s.radius());
                vec![c.map(|x| x - r), c.map(|x| x + r)]
            }
            Solid::Polygon(p) => {
                p.triangles().iter().flat_map(|t| t.corners).map(|corner| corner.to_array()).collect()
            }
            // The judge knows no others yet: a primitive in every box, met by no line, so that any hit on it is an error.
            _ => vec![[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]],
        },
    }
}

fn around(points: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let mut b = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for point in points {
        for a in 0..3 {
            b[0][a] = b[0][a].min(point[a]);
            b[1][a] = b[1][a].max(point[a]);
        }
    }
    b
}

/// Where a line meets a solid.
fn roots(solid: &Solid, o: [f64; 3], d: [f64; 3]) -> Vec<Rational> {
    match solid {
        Solid::Sphere(s) => {
            exact::sphere(o, d, s.center().to_array(), s.radius()).into_iter().flatten().collect()
        }
        Solid::Polygon(p) => p
            .triangles()
            .iter()
            .filter_map(|t| exact::triangle(o, d, t.corners.map(|corner| corner.to_array())))
            .map(|root| root.exact())
            .collect(),
        _ => Vec::new(),
    }
}

/// The first root in the ray's interval: the near end is compared before rounding, the far end after it.
fn first<R: Real>(solid: &Solid, ray: &Ray<R>) -> Option<Rational> {
    let roots = roots(solid, ray.origin.widen().to_array(), ray.dir.widen().to_array());
    let inside = |t: &Rational| t.within(ray.t_min.into(), f64::INFINITY) && t.nearest::<R>() <= ray.t_max;
    roots.into_iter().filter(inside).min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::{RayKind, Subject};
    use rt_accel::{Aggregate, Exhaustive, Primitive};
    use rt_geom::glam::DVec3;

    #[test]
    fn what_is_right_passes_and_what_is_not_is_counted() {
        for name in ["tetra-4", "balls-1"] {
            let subject = Subject::named(name).unwrap();
            let sets = subject.rays(&[RayKind::Chords, RayKind::Diffuse, RayKind::Shadow], 300).unwrap();
            let judge = Judge::new(&subject.prims);
            let mut all_hits = 0;
            for set in &sets {
                let sample = judge.sample(set, 200);
                let right = match &subject.prims {
                    Prims::Mesh(mesh) => {
                        let scene = Aggregate::<Exhaustive, _>::build(mesh.clone(), &()).unwrap();
                        set.rays.iter().map(|ray| scene.intersect(ray).map(|h| (h.at.prim, h.t))).collect()
                    }
                    Prims::Solids(solids) => {
                        let scene = Aggregate::<Exhaustive, _>::build(solids.clone(), &()).unwrap();
                        set.rays.iter().map(|ray| scene.intersect(ray).map(|h| (h.at.prim, h.t))).collect()
                    }
                };
                let right: Vec<Option<(u32, f32)>> = right;
                let error = judge.judge(&sample, set, &Answers::Closest32(right.clone()));
                assert!(error.is_exact() && error.t_ulp < 1.0, "{name} {:?} {error:?}", set.kind);
                let hits = sample.0.iter().filter(|(at, _)| right[*at].is_some()).count() as u64;
                all_hits += hits;
                assert_eq!(error.rays, sample.len() as u64);

                let nothing = vec![None; right.len()];
                assert_eq!(judge.judge(&sample, set, &Answers::Closest32(nothing)).missed, hits);
                let other = right.iter().map(|hit| hit.map(|(prim, t)| (prim + 1, t * 2.0 + 1.0))).collect();
                let error = judge.judge(&sample, set, &Answers::Closest32(other));
                assert!(name == "balls-1" || (error.wrong == hits && error.missed == 0), "{error:?}");
                let always = vec![true; right.len()];
                let error = judge.judge(&sample, set, &Answers::Any32(always.clone()));
                assert_eq!((error.missed, error.invented), (0, error.rays - hits));
                assert!(Answers::Any32(always).differ(&Answers::Any32(vec![false; 300])).is_some());
            }
            assert!(all_hits > 50, "{name} {all_hits}");
        }
    }

    #[test]
    fn a_line_in_a_face_finds_the_primitives_behind_it() {
        let subject = Subject::named("tetra-3").unwrap();
        let judge = Judge::new(&subject.prims);
        // Along an axis, in the plane of box faces: zeros in the direction.
        let ray = Ray::new(DVec3::new(-3.0, 1.0, 0.9375), DVec3::X);
        assert!(!judge.candidates(&ray).is_empty());
        let ray = Ray::new(DVec3::new(-3.0, 1.1, 0.9375), DVec3::X);
        assert!(judge.candidates(&ray).is_empty());
    }
}

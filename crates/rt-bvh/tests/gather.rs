//! Wide rays through a tree: what a cone or a beam meets is gathered, and little else is.

#![allow(clippy::print_stdout)] // Figures, for `--nocapture`.

use rt_accel::{Bounded, Exhaustive, Structure};
use rt_bounds::{Aabb, BeamTest, ConeTest};
use rt_bvh::{Bvh, BvhParams};
use rt_geom::glam::{DVec3, Vec3A};
use rt_geom::{Beam, Cone, Ray};
use rt_measure::rays::Seeded;

/// Points, each in a box of its own.
struct Points(Vec<Vec3A>);

impl Bounded for Points {
    fn prim_count(&self) -> usize {
        self.0.len()
    }
    fn bound(&self, prim: u32) -> Aabb {
        let p = self.0[prim as usize];
        Aabb::new(p, p)
    }
}

/// The numbers in leaves under boxes that `keep` accepts, and how many boxes it was asked about.
fn gathered<S: Structure>(structure: &S, keep: impl Fn(&Aabb) -> bool) -> (Vec<u32>, usize) {
    let (mut found, mut asked) = (Vec::new(), 0);
    structure.gather(
        &mut |b| {
            asked += 1;
            keep(b)
        },
        &mut |leaf| found.extend_from_slice(leaf.prims),
    );
    found.sort_unstable();
    (found, asked)
}

#[test]
fn every_point_in_a_cone_or_a_beam_is_gathered() {
    let mut seeded = Seeded::new(51);
    let points = Points(
        (0..20_000).map(|_| seeded.inside(DVec3::splat(-10.0), DVec3::splat(10.0)).as_vec3a()).collect(),
    );
    let tree = Bvh::build(&points, &BvhParams::default()).unwrap();
    let all = Exhaustive::build(&points, &()).unwrap();
    let (mut found, mut inside, mut asked) = (0, 0, 0);
    for case in 0..200 {
        let from = seeded.inside(DVec3::splat(-12.0), DVec3::splat(12.0));
        let axis = seeded.direction();
        let (u, v) = axis.any_orthonormal_pair();
        let (members, kept, count, brute): (Vec<u32>, Vec<u32>, usize, Vec<u32>) = if case % 2 == 0 {
            let cone = Cone::around(&Ray::new(from, axis), 0.02, 0.03).unwrap().between(0.0, 15.0);
            let test = ConeTest::new(&cone);
            let members =
                (0..points.0.len() as u32).filter(|&i| cone.contains(points.0[i as usize].as_dvec3()));
            let (kept, count) = gathered(&tree, |b| test.meets(b));
            (members.collect(), kept, count, gathered(&all, |b| test.meets(b)).0)
        } else {
            let window = [u, v, -u, -v].map(|side| from + axis + side * 0.04);
            let beam = Beam::from_apex(from, &window).unwrap().between(0.0, 15.0);
            let test = BeamTest::new(&beam);
            let members =
                (0..points.0.len() as u32).filter(|&i| beam.contains(points.0[i as usize].as_dvec3()));
            let (kept, count) = gathered(&tree, |b| test.meets(b));
            (members.collect(), kept, count, gathered(&all, |b| test.meets(b)).0)
        };
        for m in &members {
            assert!(kept.binary_search(m).is_ok(), "case {case} lost {m}");
        }
        // One leaf holds everything: the structure that is none loses nothing, and spares nothing.
        assert!(brute.is_empty() && members.is_empty() || brute.len() == points.0.len());
        (found, inside, asked) = (found + kept.len(), inside + members.len(), asked + count);
    }
    println!(
        "{} in, {} gathered, {} boxes asked, of {} a query",
        inside / 200,
        found / 200,
        asked / 200,
        points.0.len()
    );
    assert!(inside > 200 && found < inside * 40 && asked < 200 * 1500);
}

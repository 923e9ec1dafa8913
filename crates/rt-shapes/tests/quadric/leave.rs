//! Rays that leave a surface do not meet it where they start.

use crate::revolved::{Part, Plan, ray};
use rt_accel::Instance;
use rt_geom::glam::{DAffine3, DMat3, DQuat, DVec3};
use rt_geom::{Ray, Real, Transform, Vector};
use rt_measure::rays::Seeded;
use rt_shapes::{Disk, Frustum, Shape, Uv};

#[derive(Default, Debug)]
struct Left {
    spawned: u64,
    /// Left out, because `f32` hardly tells the shape from a point where it is.
    tiny: u64,
    met_again: u64,
    told: Option<String>,
}

impl Left {
    /// Lets rays of precision `R` leave from where `seen` hits, to any side, unless that is a tip: there the surface has no side,
    /// and near it another sheet is as near.
    fn leave<R: Real, S: Shape<R, At = Uv>>(
        &mut self,
        shape: &S,
        seen: &Ray<f64>,
        out: DVec3,
        size: f64,
        tip: impl Fn(DVec3) -> bool,
    ) {
        let narrow = |v: DVec3| R::Vec3::nearest(v);
        let ray = Ray::<R>::new(narrow(seen.origin), narrow(seen.dir));
        let Some(hit) = shape.intersect(&ray) else { return };
        let surface = shape.surface(&ray, &hit);
        let leaving = surface.spawn(narrow(out));
        if out.dot(surface.normal).abs() < 1e-3 || tip(surface.point) {
            return;
        }
        // A shape not much larger than a unit of the ray's precision: the origin may be on its other side.
        if (leaving.origin.widen() - surface.point).length() > 1e-2 * size {
            self.tiny += 1;
            return;
        }
        self.spawned += 1;
        // Inside of a hollow, the next hit is along a chord that is not as short.
        if let Some(again) = shape.intersect(&leaving)
            && again.t.into() < 1e-7 * size
        {
            self.met_again += 1;
            self.told.get_or_insert_with(|| format!("{ray:?} {hit:?} {surface:?} {leaving:?} {again:?}"));
        }
    }
}

/// Scales from 1e-3 to 1e3, turned, squeezed and mirrored, at up to 1e4.
fn place(seeded: &mut Seeded) -> (f64, Transform) {
    let scale = 10f64.powf(seeded.between(-3.0, 3.0));
    let turn = DQuat::from_axis_angle(seeded.direction(), seeded.between(0.0, 3.0));
    let mut factor = || seeded.between(0.3, 1.0) * [1.0, -1.0][seeded.below(2)];
    let squeeze = DMat3::from_diagonal(DVec3::new(factor(), factor(), factor()) * scale);
    let at = seeded.inside(DVec3::splat(-1e4), DVec3::splat(1e4));
    let map = DAffine3 { matrix3: DMat3::from_quat(turn) * squeeze, translation: at };
    (scale, Transform::new(map).unwrap())
}

fn run(seed: u64, count: u64) -> Left {
    let mut seeded = Seeded::new(seed);
    let mut left = Left::default();
    while left.spawned < count {
        let (scale, map) = place(&mut seeded);
        let part = Part::random(&mut seeded, 1.0);
        let (o, d) = ray(&mut seeded, &part);
        let (o, out) = (if o.length() > 100.0 { o * (20.0 / o.length()) } else { o }, seeded.direction());
        let aim = part.point(0.5 * (part.z[0] + part.z[1]), 1.0);
        let d = if seeded.below(2) == 0 { aim - o } else { d };
        if d == DVec3::ZERO {
            continue;
        }
        let shape = part.shape();
        let size = (part.z[1] - part.z[0]).min(0.1);
        let pointed = matches!(part.plan, Plan::Cone(..) | Plan::Hyperboloid(..));
        let tip = |p: DVec3| pointed && p.truncate().length() < 1e-4;
        left.leave::<f64, _>(&shape, &Ray::new(o, d), out, size, tip);
        let moved = Instance::new(shape, map);
        let there = Ray::new(map.point(o), map.vector(d));
        let back = |p: DVec3| tip(map.inverse().point(p));
        left.leave::<f64, _>(&moved, &there, out, size * scale, back);
        left.leave::<f32, _>(&moved, &there, out, size * scale, back);
        let disk = Disk::ring(seeded.between(-1.0, 1.0), 0.0, 1.0).unwrap();
        left.leave::<f64, _>(&Instance::new(disk, map), &there, out, scale, |_| false);
        let (a, b) = (map.point(DVec3::ZERO), map.point(seeded.direction()));
        let (r0, r1) = (scale * seeded.unit(), scale * seeded.unit());
        let frustum = Frustum::new(a, r0, b, r1).unwrap();
        let tip = |p: DVec3| (p - a).cross((b - a).normalize()).length() < 1e-4 * scale;
        let there = Ray::new(map.point(o), map.point(seeded.direction() * 0.5) - map.point(o));
        left.leave::<f64, _>(&frustum, &there, out, 0.1 * scale, tip);
        left.leave::<f32, _>(&frustum, &there, out, 0.1 * scale, tip);
    }
    left
}

#[test]
fn spawned_rays_leave() {
    let left = run(1, 50_000);
    assert!(left.tiny < left.spawned / 2, "{left:?}");
    assert_eq!(left.met_again, 0, "{left:?}");
}

#[test]
#[ignore = "minutes in release; RT_SEED and RT_CASES choose what"]
fn spawned_rays_leave_in_millions() {
    let number = |name, default| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(default);
    let left = run(number("RT_SEED", 1), number("RT_CASES", 1_000_000));
    println!("{left:?}");
    assert_eq!(left.met_again, 0, "{left:?}");
}

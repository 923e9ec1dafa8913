//! Over patches the tree answers as every patch in turn does: the teapot, and patches that are hard to meet.

use core::fmt::Debug;
use rt_accel::{Geometry, Primitive};
use rt_bvh::{Bvh, BvhParams};
use rt_geom::glam::DVec3;
use rt_geom::{Ray, Real, Vector};
use rt_measure::conform;
use rt_measure::rays::{Seeded, troublesome};
use rt_shapes::{BezierPatch, BilinearPatch, Uv};

type Net = [DVec3; 16];

fn params() -> [BvhParams; 2] {
    [BvhParams::default(), BvhParams { leaf_prims: 1, sweep_below: 0, ..BvhParams::default() }]
}

/// Rays at points and just beside them, from near, far and the points themselves, and along the axes.
fn aimed<R: Real>(seeded: &mut Seeded, points: &[DVec3], count: usize) -> Vec<Ray<R>> {
    let ray = |k: usize| {
        let at = points[k % points.len()];
        let toward = match seeded.below(4) {
            0 => [DVec3::X, DVec3::NEG_Y, DVec3::Z][seeded.below(3)],
            _ => seeded.direction(),
        };
        let far = [0.0, 1.0, 5.0, 1e3][seeded.below(4)];
        let beside = [0.0, 1e-15, 1e-7, 1e-2][seeded.below(4)];
        let origin = at - toward * far + seeded.direction() * beside;
        Ray::new(R::Vec3::nearest(origin), R::Vec3::nearest(toward))
    };
    (0..count).map(ray).collect()
}

fn check<R: Real, P: Primitive<R, At = Uv>>(name: &str, patches: &Vec<P>, points: &[DVec3])
where
    Vec<P>: Geometry<R, At: Debug>,
{
    let mut rays = troublesome::<R>(patches, &points[..points.len().min(12)]);
    rays.extend(aimed::<R>(&mut Seeded::new(2), points, 60));
    conform::conform_all::<Bvh, R, _>(name, patches, &params(), &rays).unwrap_or_else(|why| panic!("{why}"));
}

/// On each patch: its corners, the middles of its borders, and some points within.
fn spots(patch: &BezierPatch) -> Vec<DVec3> {
    let at = [0.0, 0.5, 1.0, 0.3, 0.71];
    at.iter().flat_map(|&u| at.map(|v| patch.point(u, v))).collect()
}

fn bezier(name: &str, nets: impl IntoIterator<Item = Net>) {
    let patches: Vec<BezierPatch> = nets.into_iter().map(|net| BezierPatch::new(net).unwrap()).collect();
    let points: Vec<DVec3> = patches.iter().flat_map(spots).collect();
    check::<f32, _>(name, &patches, &points);
    check::<f64, _>(name, &patches, &points);
}

#[test]
fn on_the_teapot() {
    bezier("the teapot's patches", rt_scenes::teapot_nets());
}

/// Sheets with borders that are points, cusps, creases, knots, flat ones, lines and points; and many in one place.
fn hostile() -> Vec<Net> {
    let mut seeded = Seeded::new(17);
    let mut nets = Vec::new();
    for kind in 0..24 {
        let place = seeded.inside(DVec3::ZERO, DVec3::splat(4.0));
        let mut net: Net = core::array::from_fn(|k| {
            place + DVec3::new((k / 4) as f64, (k % 4) as f64, 0.0) * 0.4 + seeded.direction() * 0.2
        });
        match kind % 12 {
            // An edge that is a point, two of them, a corner without a plane.
            1 => (1..4).for_each(|k| net[k] = net[0]),
            2 => (1..4).for_each(|k| (net[k], net[12 + k]) = (net[0], net[12])),
            3 => (net[1], net[4], net[5]) = (net[0], net[0], net[0]),
            // A cusp: the rows go out and come back. A crease: two rows are one.
            4 => (0..4).for_each(|k| (net[4 + k], net[8 + k]) = (net[12 + k], net[k])),
            5 => (0..4).for_each(|k| net[8 + k] = net[4 + k]),
            // A knot; a plane across the axes, and one along them.
            6 => net.iter_mut().for_each(|p| *p = place + seeded.direction()),
            7 => net.iter_mut().for_each(|p| p.z = 0.25 * p.x + 0.5 * p.y),
            8 => net.iter_mut().for_each(|p| p.z = place.z),
            // Folded flat upon itself, a line, a point.
            9 => (0..8).for_each(|k| net[15 - k] = net[k]),
            10 => net.iter_mut().for_each(|p| *p = place + DVec3::new(1.0, 2.0, -1.0) * (p.x - place.x)),
            11 => net.fill(place),
            _ => {}
        }
        nets.push(net);
    }
    // The same one again, in the same place; turned over; and next to it by a rounding.
    let again = nets[6];
    nets.extend([again, nets[0], nets[0], core::array::from_fn(|k| nets[0][k % 4 * 4 + k / 4])]);
    nets.push(nets[0].map(|p| p.map(f64::next_up)));
    nets
}

#[test]
fn on_patches_that_are_hard_to_meet() {
    bezier("hostile patches", hostile());
}

#[test]
fn on_bilinear_patches() {
    let corners = hostile().into_iter().map(|net| [net[0], net[3], net[12], net[15]]);
    let patches: Vec<BilinearPatch> =
        corners.filter_map(|[a, b, c, d]| BilinearPatch::new([a, b, c, d]).ok()).collect();
    assert!(patches.len() > 20);
    let at = [0.0, 0.5, 1.0, 0.3];
    let spots = |p: &BilinearPatch| {
        let [a, b, c, d] = *p.corners();
        at.map(|u| at.map(|v| a.lerp(b, u).lerp(c.lerp(d, u), v))).concat()
    };
    let points: Vec<DVec3> = patches.iter().flat_map(spots).collect();
    check::<f32, _>("bilinear patches", &patches, &points);
    check::<f64, _>("bilinear patches", &patches, &points);
}

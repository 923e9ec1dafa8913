//! Centres of spheres around clouds: Ritter's, Larsson's and the smallest.

use super::Extremes;
use crate::cloud::{DIRECTIONS, extremes};
use rt_geom::glam::DVec3;

/// A ball while it is being fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl Ball {
    /// Grown just enough to touch every point outside, one after another: the old ball touches the new one from inside.
    fn grown(mut self, points: &[DVec3]) -> Ball {
        let mut square = self.radius * self.radius;
        for p in points {
            let away = *p - self.center;
            let distance = away.length_squared();
            if distance > square {
                let distance = distance.sqrt();
                self.radius = (self.radius + distance) * 0.5;
                self.center = *p - away * (self.radius / distance);
                square = self.radius * self.radius;
            }
        }
        self
    }
}

pub(super) fn ritter(points: &[DVec3]) -> Ball {
    let [x, y, z] = DIRECTIONS[..3] else { unreachable!() };
    let pairs = extremes(points, &[x, y, z]).map(|[a, b]| [points[a], points[b]]);
    let mut widest = pairs[0];
    for pair in pairs {
        if pair[0].distance_squared(pair[1]) > widest[0].distance_squared(widest[1]) {
            widest = pair;
        }
    }
    let [a, b] = widest;
    Ball { center: a * 0.5 + b * 0.5, radius: a.distance(b) * 0.5 }.grown(points)
}

pub(super) fn epos(points: &[DVec3], of: Extremes) -> Ball {
    fn along<const N: usize>(points: &[DVec3]) -> Ball {
        let mut directions = [DVec3::ZERO; N];
        directions.copy_from_slice(&DIRECTIONS[..N]);
        let mut few = Vec::with_capacity(2 * N);
        few.extend(extremes(points, &directions).iter().flatten().map(|i| points[*i]));
        smallest(&few).grown(points)
    }
    match of {
        Extremes::Six => along::<3>(points),
        Extremes::Fourteen => along::<7>(points),
        Extremes::TwentySix => along::<13>(points),
    }
}

/// How far beyond the ball of its support a point may lie, as a share of the squared radius. `f32` sees none of it.
const CLOSE: f64 = 1e-13;
/// Rounds at most. The radius grows in each, and four to six do, of 24 points or `10^5`; this only ends what rounding might
/// let turn in a circle.
const ROUNDS: usize = 300;

/// The smallest ball: a support of at most four points, exchanged for a better one as long as a point lies outside.
///
/// In each round the farthest point joins, and the smallest ball of these five at most is found among all balls that
/// have the new point and some of the others on their boundary: the one whose centre has the least farthest point. No
/// sign is decided, so there is no tolerance to choose: a support that is flat or coincident yields a centre that is
/// not finite or far off, which loses against one of its parts.
///
/// It ends when the ball of the support holds all points: by then no ball of the points is smaller than that of the
/// support.
pub(super) fn smallest(points: &[DVec3]) -> Ball {
    let mut support = [points[0]; 5];
    let mut len = 1;
    let mut ball = Ball { center: points[0], radius: 0.0 };
    let mut best = Ball { center: points[0], radius: f64::INFINITY };
    for _ in 0..ROUNDS {
        let (farthest, square) = farthest(points, ball.center);
        if square < best.radius * best.radius {
            best = Ball { center: ball.center, radius: square.sqrt() };
        }
        if square <= ball.radius * ball.radius * (1.0 + CLOSE) {
            break;
        }
        support[len] = farthest;
        let old = ball.radius;
        (ball, len) = exchange(&mut support, len);
        if ball.radius <= old {
            break;
        }
    }
    best
}

fn farthest(points: &[DVec3], from: DVec3) -> (DVec3, f64) {
    let mut found = (points[0], -1.0);
    for p in points {
        let square = p.distance_squared(from);
        if square > found.1 {
            found = (*p, square);
        }
    }
    found
}

/// The smallest ball of `support[..=last]` that touches the last of them, and how many of the points it needs; they are
/// moved to the front.
fn exchange(support: &mut [DVec3; 5], last: usize) -> (Ball, usize) {
    let all = *support;
    let new = all[last];
    let mut best = (f64::INFINITY, DVec3::ZERO, 0u32);
    for chosen in 0u32..1 << last {
        if chosen.count_ones() > 3 {
            continue;
        }
        let mut sides = [DVec3::ZERO; 3];
        let mut n = 0;
        for i in 0..last {
            if chosen >> i & 1 == 1 {
                sides[n] = all[i] - new;
                n += 1;
            }
        }
        let center = new + circumcenter(&sides[..n]);
        let square = all[..=last].iter().fold(0.0f64, |most, p| most.max(p.distance_squared(center)));
        if center.is_finite() && square < best.0 {
            best = (square, center, chosen);
        }
    }
    let (square, center, chosen) = best;
    let mut n = 0;
    for i in 0..last {
        if chosen >> i & 1 == 1 {
            support[n] = all[i];
            n += 1;
        }
    }
    support[n] = new;
    (Ball { center, radius: square.sqrt() }, n + 1)
}

/// The centre of the smallest sphere through zero and up to three points; not finite where there is none.
fn circumcenter(points: &[DVec3]) -> DVec3 {
    match *points {
        [] => DVec3::ZERO,
        [a] => a * 0.5,
        [a, b] => {
            let normal = a.cross(b);
            (b * a.length_squared() - a * b.length_squared()).cross(normal) / (2.0 * normal.length_squared())
        }
        [a, b, c, ..] => {
            let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
            (bc * a.length_squared() + ca * b.length_squared() + ab * c.length_squared()) / (2.0 * a.dot(bc))
        }
    }
}

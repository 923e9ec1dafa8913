//! [`Julia`]: quaternion Julia sets, met by sphere tracing with steps that are proved.

use crate::near::Near;
use crate::{Partials, Shape, Surface, Uv};
use rt_accel::{BuildError, Counts, Hit, Primitive, WorldBound};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec2, DVec3, DVec4, Vec4Swizzles};
use rt_geom::{Ray, Real, Vector};

/// Unit roundoff of `f64`.
const U: f64 = f64::EPSILON / 2.0;
/// Beyond this modulus the distance estimate is as good as it gets.
const FAR: f64 = 1e8;

/// The filled Julia set of `q^2 + c` over the quaternions, cut by the space `w = const`: the points `(x, y, z)` whose orbit from
/// `x + y i + z j + w k` stays bounded. Around the origin, in its own units; put it elsewhere with an
/// [`Instance`](rt_accel::Instance).
///
/// A ray advances by balls that are proved to hold no point of the set. The radius is proposed by the distance estimate of Hart,
/// Sandin and Kauffman, a lower bound in the complex plane, and proved for quaternions and for rounding by carrying the ball along
/// its orbit: `(q + e)^2` departs from `q^2` by at most `2 |q| |e| + |e|^2`, and once the ball lies outside the radius of escape all
/// of it escapes. If the proof fails the radius is halved. *So no ray steps over any part of the set*: what is said to be missed is
/// missed.
///
/// A ray meets the set where the estimate says that the set is no further than [`JuliaParams::tolerance`]; where its orbit does
/// not escape in the iterations allowed; or where the steps allowed are done: such a ray is *unresolved*, counted in
/// [`JuliaCounts`], and **answered as a hit** where it came to be. A ray that begins that close to the set meets it at
/// once. Parts within the tolerance of a ray are met though the ray may pass them: the error is one-sided, and falls with the
/// tolerance. Only the closest hit is reported by [`Primitive::all_hits`]: how often a line crosses such a set is not for finite
/// arithmetic to say.
///
/// Rays that [`Surface::spawn`] sends off from a hit, to the side of the normal, begin outside of what is met if the arriving ray
/// did: that is looked at when the surface is asked for, at the origins in the precision of the ray and in `f64`, and the way there
/// from the arriving ray is proved to hold no point of the set. So they neither end where they begin nor come out behind a wall.
/// What they meet later is as right as for any other ray; that may be soon, the set being rough at every scale: one in sixty meets
/// something within the tolerance. Towards the other side there is only the set, which is solid: such rays end at once. An
/// [`Instance`](rt_accel::Instance) that turns the set makes the step up to three times as long; six such lengths are looked at,
/// too, but that is no proof.
///
/// ```
/// use rt_accel::Primitive;
/// use rt_geom::{Ray, glam::{DVec3, DVec4, Vec3A}};
/// use rt_shapes::{Julia, JuliaParams};
/// // c = 0: the unit ball.
/// let ball = Julia::new(JuliaParams { c: DVec4::ZERO, tolerance: 1e-6, ..Default::default() })?;
/// assert!(ball.clearance(DVec3::X * 1.5) <= 0.5);
/// let hit = ball.intersect(&Ray::new(Vec3A::new(0.0, 0.0, -3.0), Vec3A::Z)).unwrap();
/// assert!((1.999_998..=2.0).contains(&hit.t));
/// # Ok::<(), rt_accel::BuildError>(())
/// ```
///
/// Source: Hart, Sandin, Kauffman, "Ray tracing deterministic 3-D fractals", SIGGRAPH 1989; Hart, "Sphere tracing", *The Visual
/// Computer* 12 (1996).
#[derive(Clone, Debug, PartialEq)]
pub struct Julia {
    params: JuliaParams,
    /// Whoever is further from zero escapes.
    escape: f64,
    /// Half the side of a cube around all hits.
    reach: f64,
}

/// Which Julia set, and how closely it is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JuliaParams {
    /// The constant: `x + y i + z j + w k`.
    pub c: DVec4,
    /// Where the fourth axis is cut.
    pub w: f64,
    /// Rays meet what is no further than this, in `[1e-12, 1]`: larger is quicker and thicker.
    pub tolerance: f64,
    /// Orbits that have not escaped after as many iterations, from 1, are taken for bounded.
    pub iterations: u32,
    /// Steps of a ray, from 1; then it is unresolved.
    pub steps: u32,
}

impl Default for JuliaParams {
    /// A set with many arms, to a ten-thousandth.
    fn default() -> JuliaParams {
        JuliaParams {
            c: DVec4::new(-0.2, 0.6, 0.2, 0.2),
            w: 0.0,
            tolerance: 1e-4,
            iterations: 200,
            steps: 4096,
        }
    }
}

/// The work of rays at a [`Julia`] set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JuliaCounts {
    /// Balls stepped through.
    pub steps: u64,
    /// Iterations of orbits, proofs included.
    pub iterations: u64,
    /// Radii that were not proved and halved.
    pub halved: u64,
    /// Rays that neither met nor missed the set in the steps allowed.
    pub unresolved: u64,
}

/// What sphere tracing came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Traced {
    /// No point of the set lies on the ray in its interval.
    Missed,
    /// At this distance the set is within the tolerance.
    Met(f64),
    /// Up to this distance there is nothing; what comes then is not known.
    Unresolved(f64),
}

/// Where a ray came to an end.
#[derive(Clone, Copy, Debug)]
struct End {
    near: Near,
    /// The last place from which it stepped; none if it ended where it began.
    before: Option<f64>,
    /// Where it ended.
    s: f64,
    /// Whether it met the set, or ran out of steps.
    met: bool,
}

/// The product of two quaternions, `x` the real part.
#[inline(always)]
fn times(a: DVec4, b: DVec4) -> DVec4 {
    let (u, v) = (a.yzw(), b.yzw());
    let imaginary = v * a.x + u * b.x + u.cross(v);
    DVec4::new(a.x * b.x - u.dot(v), imaginary.x, imaginary.y, imaginary.z)
}

/// The square of a quaternion.
#[inline(always)]
fn square(q: DVec4) -> DVec4 {
    let v = q.yzw();
    let imaginary = v * (2.0 * q.x);
    DVec4::new(q.x * q.x - v.dot(v), imaginary.x, imaginary.y, imaginary.z)
}

impl Julia {
    /// A Julia set.
    ///
    /// # Errors
    ///
    /// [`BuildError::BadParam`] when `c` or `w` is not finite or larger than a million, the tolerance lies outside
    /// `[1e-12, 1]`, or a limit is zero.
    pub fn new(params: JuliaParams) -> Result<Julia, BuildError> {
        let bad = |name, why| Err(BuildError::BadParam { name, why });
        if !(params.c.abs().max_element() <= 1e6 && params.c.is_finite()) {
            return bad("c", "must lie within a million of zero");
        }
        if params.w.abs() > 1e6 || params.w.is_nan() {
            return bad("w", "must lie within a million of zero");
        }
        if !(1e-12..=1.0).contains(&params.tolerance) {
            return bad("tolerance", "must lie in 1e-12..=1");
        }
        if params.iterations == 0 || params.steps == 0 {
            return bad("iterations", "and steps must be at least 1");
        }
        // From |q|^2 - |c| > |q| on, moduli grow for ever. Rounded up.
        let escape = (1.0 + (1.0 + 4.0 * params.c.length()).sqrt()) * 0.5 * (1.0 + 16.0 * U);
        let slice = (escape * escape - params.w * params.w).max(0.0).sqrt();
        Ok(Julia { params, escape, reach: (slice + 2.0 * params.tolerance) * (1.0 + 16.0 * U) })
    }

    /// What it was made of.
    pub fn params(&self) -> &JuliaParams {
        &self.params
    }

    /// The radius of a ball around `p` that holds no point of the set: proved, and about half the distance close to the set. Zero
    /// for points of the set, and for those of which nothing is known.
    pub fn clearance(&self, p: DVec3) -> f64 {
        self.clear(p, &mut JuliaCounts::default()).0
    }

    /// The proved radius, and how far the set is at most, by the estimate.
    fn clear(&self, p: DVec3, counts: &mut JuliaCounts) -> (f64, f64) {
        let mut q = p.extend(0.0);
        q.w = self.params.w;
        let start = q;
        let (mut r, mut slope, mut power) = (q.length(), 1.0, 1.0);
        for _ in 0..self.params.iterations {
            if r > FAR {
                break;
            }
            counts.iterations += 1;
            slope *= 2.0 * r;
            power *= 0.5;
            q = square(q) + self.params.c;
            r = q.length();
        }
        if r <= FAR {
            return (0.0, 0.0);
        }
        // G, the potential, times 2^n over r'; it is ln r / 2^n.
        let potential = r.ln() * power;
        let ratio = if potential > 1e-8 { potential.sinh() / potential } else { 1.0 };
        let spread = ratio * r * r.ln() / slope;
        let mut radius = spread / potential.exp();
        let most = 2.0 * spread;
        // The bound is half of this; but twice as much can often be proved, too.
        for _ in 0..8 {
            if self.all_escape(start, radius, counts) {
                return (radius, most);
            }
            counts.halved += 1;
            radius *= 0.5;
        }
        (0.0, most)
    }

    /// Whether every orbit from the ball of this radius around `q` escapes, proved.
    fn all_escape(&self, mut q: DVec4, radius: f64, counts: &mut JuliaCounts) -> bool {
        let c = self.params.c;
        let (size, mut ball) = (c.length(), radius * (1.0 + 4.0 * U));
        for _ in 0..=self.params.iterations {
            let r = q.length();
            if r * (1.0 - 4.0 * U) - ball > self.escape {
                return true;
            }
            if ball >= r + self.escape {
                return false;
            }
            counts.iterations += 1;
            // What the ball grows, and what squaring rounds.
            ball = (ball * (2.0 * r + ball) + 8.0 * U * (r * r + size)) * (1.0 + 8.0 * U);
            q = square(q) + c;
        }
        false
    }

    /// Follows a ray, and says what is known of it. The work is added to `counts`.
    pub fn trace(&self, ray: &Ray<f64>, counts: &mut JuliaCounts) -> Traced {
        match self.follow(ray, counts) {
            // Moved and scaled, `t` may come out beside the interval by its rounding.
            Some(end) if end.met => Traced::Met(end.near.t(end.s).clamp(ray.t_min, ray.t_max)),
            Some(end) => Traced::Unresolved(end.near.t(end.s).clamp(ray.t_min, ray.t_max)),
            None => Traced::Missed,
        }
    }

    /// Where a ray comes to an end; `None` if it misses.
    fn follow(&self, ray: &Ray<f64>, counts: &mut JuliaCounts) -> Option<End> {
        if !ray.is_valid() || self.params.w.abs() > self.escape {
            return None;
        }
        let near = Near::new(ray, DVec3::ZERO, self.reach);
        let Near { origin, dir, error, .. } = near;
        let (mut from, mut to) = (near.before(ray.t_min), near.after(ray.t_max));
        for a in 0..3 {
            let (o, d, reach) = (origin[a], dir[a], self.reach + error[a]);
            if d == 0.0 {
                if o.abs() > reach {
                    return None;
                }
                continue;
            }
            // Rounded outward, by less than the cube has to spare.
            let (enter, leave) = ((-reach.copysign(d) - o) / d, (reach.copysign(d) - o) / d);
            from = from.max(enter - enter.abs() * (4.0 * U));
            to = to.min(leave + leave.abs() * (4.0 * U));
        }
        if from > to || from == f64::INFINITY {
            return None;
        }
        let speed = dir.length();
        let (mut s, mut before) = (from, None);
        for _ in 0..self.params.steps {
            counts.steps += 1;
            let (radius, most) = self.clear(origin + dir * s, counts);
            if most <= self.params.tolerance {
                return Some(End { near, before, s, met: true });
            }
            // Rounding of the point, and of the step.
            let off = error.element_sum() + 4.0 * U * (origin.abs() + dir.abs() * s.abs()).element_sum();
            let next = s + (radius - off) / speed * (1.0 - 4.0 * U);
            if next <= s || next.is_nan() {
                break;
            }
            (before, s) = (Some(s), next);
            if s > to {
                return None;
            }
        }
        counts.unresolved += 1;
        Some(End { near, before, s, met: false })
    }

    /// The radius of the proved ball around `p`, if rays that begin there get away: outside of what is met, and far enough for
    /// rounding.
    fn leaves(&self, p: DVec3) -> Option<f64> {
        let (radius, most) = self.clear(p, &mut JuliaCounts::default());
        (most > self.params.tolerance && radius > 16.0 * U * p.abs().element_sum()).then_some(radius)
    }

    /// The surface at `p` with this normal, outside of what is met by no more than `gap`, with an error that brings rays spawned on
    /// the side of its normal to where they get away, on a way without a point of the set, and does so at these multiples of the
    /// error, too; `None` if none is found.
    fn departure<R: Real>(&self, p: DVec3, normal: DVec3, gap: f64, multiples: &[f64]) -> Option<Surface> {
        let radius = self.leaves(p)?;
        let least = gap + p.abs().max_element() * (4.0 * U);
        let clear = |from: DVec3| {
            let way = Ray::new(p, from - p).between(0.0, 1.0);
            let near = way.dir.length() < radius * 0.99;
            self.leaves(from).is_some() && (near || self.follow(&way, &mut JuliaCounts::default()).is_none())
        };
        // Errors of a quarter of the ball first; less in narrow places, more where the ray's own precision is coarse.
        let sizes = [0, -2, -4, -6, 1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20, 24, 28];
        let errors = sizes.map(|k| (radius * 0.25 * f64::from(k).exp2()).max(least));
        errors.into_iter().find_map(|size| {
            let error = DVec3::splat(size);
            let surface = Surface { point: p, error, normal, shading: normal, uv: DVec2::ZERO };
            let [fine, own] =
                [surface.spawn(normal).origin, surface.spawn(R::Vec3::nearest(normal)).origin.widen()];
            let all = multiples.iter().all(|k| clear(p + normal * (size * k)));
            (all && clear(fine) && (own == fine || clear(own))).then_some(surface)
        })
    }

    /// The direction in which the potential grows, in the space of the cut; `None` where the orbit does not escape.
    fn uphill(&self, p: DVec3) -> Option<DVec3> {
        let mut q = p.extend(self.params.w);
        let mut columns = [DVec4::X, DVec4::Y, DVec4::Z];
        for _ in 0..self.params.iterations {
            if q.length_squared() > FAR * FAR {
                break;
            }
            // Of q^2 the derivative along d is q d + d q; only the direction is wanted.
            columns = columns.map(|d| times(q, d) + times(d, q));
            let size = columns.iter().fold(0.0f64, |m, d| m.max(d.abs().max_element()));
            columns = columns.map(|d| d / size);
            q = square(q) + self.params.c;
        }
        let unit = q / q.length();
        let slope = DVec3::from_array(columns.map(|d| d.dot(unit)));
        (q.length_squared() > FAR * FAR).then(|| slope.try_normalize()).flatten()
    }

    fn at<R: Real>(ray: &Ray<R>, traced: Traced) -> Option<Hit<Uv, R>> {
        match traced {
            Traced::Missed => None,
            Traced::Met(t) | Traced::Unresolved(t) => Some(Hit { t: ray.admit(t)?, at: Uv::default() }),
        }
    }
}

impl WorldBound for Julia {
    fn world_bound(&self) -> Aabb {
        self.world_bound_from(DVec3::ZERO)
    }
    fn world_bound_from(&self, origin: DVec3) -> Aabb {
        let reach = DVec3::splat(self.reach);
        Aabb::from_f64(-reach, reach, origin)
    }
}

impl<R: Real> Primitive<R> for Julia {
    type At = Uv;

    fn intersect(&self, ray: &Ray<R>) -> Option<Hit<Uv, R>> {
        Julia::at(ray, self.trace(&ray.widen(), &mut JuliaCounts::default()))
    }

    /// Steps count as nodes.
    fn intersect_counted(&self, ray: &Ray<R>, counts: &mut Counts) -> Option<Hit<Uv, R>> {
        let mut work = JuliaCounts::default();
        let hit = Julia::at(ray, self.trace(&ray.widen(), &mut work));
        *counts += Counts { nodes: work.steps, prims: 1, ..Counts::default() };
        hit
    }
}

impl<R: Real> Shape<R> for Julia {
    /// A point of the ray just outside of where it meets the set; the normal is the gradient of the potential there, by the
    /// Jacobian of the orbit, turned towards the arriving ray in the few crevices where it leads straight into another wall; there
    /// are no parameters. The error covers the way from there to what is met, not that to the set itself, which is another
    /// [`JuliaParams::tolerance`]; and it is chosen for [`Surface::spawn`], see [`Julia`].
    ///
    /// The ray is followed once more, and some twenty places are looked at: a third more work than finding the hit. For a hit that
    /// `ray` does not have, or has from its start: the point on the ray, and an error of twice the tolerance or more.
    fn surface(&self, ray: &Ray<R>, hit: &Hit<Uv, R>) -> Surface {
        let wide = ray.widen();
        let end = self.follow(&wide, &mut JuliaCounts::default());
        if let Some(End { near, before: Some(before), s, .. }) = end {
            let at = |s: f64| near.origin + near.dir * s;
            let speed = near.dir.length();
            let back = -near.dir / speed;
            let tried = |place: f64, multiples: &[f64], share: f64| {
                let normal = (self.uphill(at(place))? + back * share).try_normalize()?;
                let gap = (s - place) * speed + near.error.max_element();
                self.departure::<R>(at(place), normal, gap, multiples)
            };
            // An instance that turns the box of the error makes the step as long as one side of it, or three.
            let turned = &[1.0, 1.4, 1.8, 2.2, 2.6, 3.0][..];
            // Between the last step outside and the end: nearer and nearer to where the ray came to be inside.
            let (mut out, mut inside) = (before, s);
            let mut places = Vec::with_capacity(5);
            for gap in [0.0, 0.25, 0.0625, 0.015_625, f64::INFINITY] {
                if gap == f64::INFINITY {
                    out = before;
                } else if gap == 0.0 {
                    // Out of steps, a ray ends outside.
                    out = if self.leaves(at(s)).is_some() { s } else { continue };
                }
                for _ in 0..64 {
                    if (inside - out) * speed <= self.params.tolerance * gap {
                        break;
                    }
                    let middle = (out + inside) * 0.5;
                    *(if self.leaves(at(middle)).is_some() { &mut out } else { &mut inside }) = middle;
                }
                if let Some(surface) = tried(out, turned, 0.0) {
                    return surface;
                }
                places.push(out);
            }
            // In narrow places the gradient may lead to the other side: then halfway between it and where the ray came from.
            let rest = [(turned, 1.0), (&[], 0.0), (&[], 1.0)].into_iter();
            let found = rest
                .flat_map(|how| places.iter().map(move |&place| (place, how)))
                .find_map(|(place, (multiples, share))| tried(place, multiples, share));
            if let Some(surface) = found {
                return surface;
            }
        }
        let point = end.map_or_else(|| wide.at(hit.t.into()), |end| end.near.origin + end.near.dir * end.s);
        let back = -(wide.dir / wide.dir.abs().max_element()).normalize_or(DVec3::NEG_Z);
        // Where the orbit does not escape, a little before.
        let tried = [0.0, 1.0, 4.0, 16.0, 64.0];
        let normal = tried.into_iter().find_map(|k| self.uphill(point + back * (k * self.params.tolerance)));
        let normal = normal.unwrap_or(back);
        // Out of what is met, if that is not far.
        let out = (0..8).map(|k| self.params.tolerance * f64::from(1u32 << k));
        let out = out.into_iter().find_map(|off| self.departure::<R>(point + normal * off, normal, off, &[]));
        out.unwrap_or_else(|| {
            let half =
                point.abs().max_element() * if size_of::<R>() == 4 { f64::from(f32::EPSILON) } else { 0.0 };
            let error = point.abs() * (8.0 * U) + DVec3::splat(2.0 * self.params.tolerance + half);
            Surface { point, error, normal, shading: normal, uv: DVec2::ZERO }
        })
    }

    /// Zero: the set has no parameters.
    fn partials(&self, _: &Ray<R>, _: &Hit<Uv, R>) -> Partials {
        Partials::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn set(c: DVec4, tolerance: f64) -> Julia {
        Julia::new(JuliaParams { c, tolerance, ..JuliaParams::default() }).unwrap()
    }

    /// Whether the orbit stays bounded, by multiplication of components.
    fn bounded(c: DVec4, p: DVec3) -> bool {
        let mut q = [p.x, p.y, p.z, 0.0];
        for _ in 0..2000 {
            let [a, x, y, z] = q;
            q = [
                a * a - x * x - y * y - z * z + c.x,
                2.0 * a * x + c.y,
                2.0 * a * y + c.z,
                2.0 * a * z + c.w,
            ];
            if q.iter().map(|x| x * x).sum::<f64>() > 1e6 {
                return false;
            }
        }
        true
    }

    #[test]
    fn zero_is_the_unit_ball() {
        for tolerance in [1e-2, 1e-5, 1e-9] {
            let ball = set(DVec4::ZERO, tolerance);
            for k in 0..200 {
                let y = k as f64 * 0.01 - 0.995;
                let ray = Ray::new(DVec3::new(-3.0, y, 0.0), DVec3::X);
                let exact = 3.0 - (1.0 - y * y).max(0.0).sqrt();
                match ball.trace(&ray, &mut JuliaCounts::default()) {
                    Traced::Met(t) => {
                        let off = ray.at(t).length() - 1.0;
                        assert!((0.0..=tolerance).contains(&off) && (y >= 1.0 || t <= exact), "{t} {exact}");
                        let hit = Hit { t, at: Uv::default() };
                        let surface = ball.surface(&ray, &hit);
                        assert!(surface.normal.dot(surface.point.normalize()) > 1.0 - 1e-9, "{surface:?}");
                        let spawned: DVec3 = surface.spawn(surface.normal).origin;
                        assert!(ball.clearance(spawned) > 0.2 * tolerance);
                        let away = (spawned.length() - 1.0) / tolerance;
                        assert!((0.49..2.0).contains(&away), "{away} {tolerance:e} {surface:?}");
                    }
                    Traced::Missed => assert!(y > 1.0, "{y}"),
                    other => panic!("{other:?}"),
                }
            }
            let miss = Ray::new(DVec3::new(-3.0, 1.0 + 2.0 * tolerance, 0.0), DVec3::X);
            // A ray that grazes takes steps as short as its distance, and comes to the end of them.
            let missed = ball.trace(&miss, &mut JuliaCounts::default());
            assert_eq!(missed == Traced::Missed, tolerance > 1e-6, "{tolerance:e} {missed:?}");
        }
    }

    #[test]
    fn balls_never_reach_the_unit_ball_and_are_not_much_too_small() {
        let ball = set(DVec4::ZERO, 1e-3);
        for k in 0..2000 {
            let r = 1.0 + 2.0 * (0.99f64).powi(k);
            let p = DVec3::new(0.36, -0.48, 0.8) * r;
            let clear = ball.clearance(p);
            assert!(clear <= r - 1.0, "{r} {clear}");
            // The bound of the source is (r - 1 / r) / 4.
            assert!(clear >= (r - 1.0 / r) * 0.25 * 0.999 || r - 1.0 < 1e-8, "{r} {clear}");
        }
        assert_eq!(ball.clearance(DVec3::splat(0.5)), 0.0);
    }

    #[test]
    fn limits_and_odd_rays_have_answers() {
        let few = Julia::new(JuliaParams { steps: 3, ..JuliaParams::default() }).unwrap();
        let ray = Ray::new(DVec3::new(-3.0, 0.1, 0.2), DVec3::X);
        let mut counts = JuliaCounts::default();
        assert!(matches!(few.trace(&ray, &mut counts), Traced::Unresolved(_)));
        assert!(counts.unresolved == 1 && few.intersect_p(&ray));
        let ball = set(DVec4::ZERO, 1e-6);
        for pace in [1e-300, 1e-200, 1e-20, 1e20, 1e200, 1e300] {
            let hit = ball.intersect(&Ray::new(DVec3::X * -3.0, DVec3::X * pace)).unwrap();
            assert!((hit.t * pace - 2.0).abs() < 1e-5, "{pace:e} {hit:?}");
        }
        for dir in [DVec3::ZERO, DVec3::NAN, -DVec3::X, DVec3::INFINITY] {
            assert!(!ball.intersect_p(&Ray::new(DVec3::X * -3.0, dir)));
        }
        assert!(!ball.intersect_p(&Ray::new(DVec3::X * -3.0, DVec3::X).between(0.0, 1.9)));
        assert_eq!(ball.intersect(&Ray::new(DVec3::ZERO, DVec3::X)).map(|hit| hit.t), Some(0.0));
        let cut = Julia::new(JuliaParams { w: 9.0, ..JuliaParams::default() }).unwrap();
        assert!(!cut.intersect_p(&ray));
        assert!(Julia::new(JuliaParams { tolerance: 0.0, ..JuliaParams::default() }).is_err());
        assert!(Julia::new(JuliaParams { c: DVec4::NAN, ..JuliaParams::default() }).is_err());
        assert!(Julia::new(JuliaParams { steps: 0, ..JuliaParams::default() }).is_err());
    }

    #[test]
    fn normals_agree_with_differences_of_the_estimate() {
        let julia = set(DVec4::new(-0.2, 0.6, 0.2, 0.2), 1e-3);
        let potential = |p: DVec3| {
            let (mut q, mut power) = (p.extend(0.0), 1.0);
            while q.length() < 1e8 {
                q = square(q) + julia.params.c;
                power *= 0.5;
            }
            q.length().ln() * power
        };
        let h = 1e-6;
        for k in 0..20 {
            let p = DVec3::new(1.3, -0.3 + 0.1 * k as f64, 0.7);
            let slope = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| potential(p + e * h) - potential(p - e * h));
            let wanted = DVec3::from_array(slope).normalize();
            assert!(julia.uphill(p).unwrap().dot(wanted) > 1.0 - 1e-6);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_point_of_the_set_is_stepped_over(c in prop::array::uniform4(-0.6..0.6f64), o in prop::array::uniform3(-1.0..1.0f64),
                                               d in prop::array::uniform3(-1.0..1.0f64), seed in 0..1000u64) {
            let (c, d) = (DVec4::from_array(c), DVec3::from_array(d));
            prop_assume!(d.length() > 0.1);
            let julia = set(c, 1e-3);
            let ray = Ray::new(DVec3::from_array(o) - d.normalize() * 3.0, d.normalize());
            let mut counts = JuliaCounts::default();
            let end = match julia.trace(&ray, &mut counts) {
                Traced::Missed => 6.0,
                Traced::Met(t) | Traced::Unresolved(t) => t,
            };
            for k in 0..2000 {
                let t = end * (k as f64 / 2000.0);
                prop_assert!(!bounded(c, ray.at(t)), "{t} of {end}");
            }
            // Points of a ball said to be clear.
            let p = ray.at(end * 0.9);
            let clear = julia.clearance(p);
            let mut bits = seed;
            for _ in 0..200 {
                let mut unit = || { bits = bits.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); (bits >> 33) as f64 / (1u64 << 30) as f64 - 1.0 };
                let off = DVec3::new(unit(), unit(), unit());
                if off.length() <= 1.0 {
                    prop_assert!(!bounded(c, p + off * clear));
                }
            }
        }
    }
}

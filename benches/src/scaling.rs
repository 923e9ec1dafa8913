//! How does the cost of a ray grow with the number of primitives?
//!
//! Two series. `spheres`: as many as asked, uniform in a cube, their radius falling as `N^(-1/2)` so that a line meets one with the
//! same chance in every scene (Ward's test). `soup`: triangles whose size falls as the cube root. Rays are uniform lines. To the
//! times and the counts of each structure a power `c N^p` is fitted by least squares of logarithms; a power near 0 is a logarithm.
//!
//! Source: Ward, "The RADIANCE lighting simulation and rendering system", SIGGRAPH 1994, section 3.

use crate::contest::{Group, Measured, Mismatch, Named};
use crate::field::{Population, Truth, field_named};
use crate::schemes::{Builder, raced};
use crate::{Effort, Options, Trouble, Watch, hear, roster};
use rt_accel::{Bounded, Geometry};
use rt_bounds::Aabb;
use rt_geom::glam::{DVec3, Vec3A};
use rt_measure::rays::{self, Seeded};
use rt_scenes::soup;
use rt_shapes::Sphere;

/// Up to so many primitives the exhaustive structure is asked too.
const EXHAUSTIVE: usize = 10_000;

/// How much of a cube's face the spheres would cover side by side: a line through the middle meets one with about even chance.
const COVER: f64 = 0.7;

pub(crate) fn ask(options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let decades = match options.effort {
        Effort::Quick => 2..=5,
        Effort::Normal => 2..=6,
        Effort::Full => 2..=7,
    };
    let mut groups = Vec::new();
    let of = 2 * decades.clone().count();
    for family in ["spheres", "soup"] {
        let begin = groups.len();
        for decade in decades.clone() {
            hear(watch, groups.len(), of + 2)?;
            let n = 10usize.pow(decade);
            groups.push(match family {
                "soup" => sized(family, n, &soup::uniform(n as u32, 1), options.effort)?,
                _ => sized(family, n, &spheres(n), options.effort)?,
            });
        }
        if let Some(fits) = fits(family, &groups[begin..]) {
            groups.push(fits);
        }
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// Spheres whose discs cover the same area together, however many there are.
fn spheres(n: usize) -> Vec<Sphere> {
    let mut seeded = Seeded::new(3);
    let radius = (4.0 * COVER / (core::f64::consts::PI * n as f64)).sqrt();
    (0..n).filter_map(|_| Sphere::new(seeded.inside(DVec3::NEG_ONE, DVec3::ONE), radius).ok()).collect()
}

fn sized<G>(family: &str, n: usize, geometry: &G, effort: Effort) -> Result<Group, Trouble>
where
    G: Geometry<f32> + Bounded,
    G::At: Named,
{
    let world = Aabb::new(Vec3A::NEG_ONE, Vec3A::ONE);
    let count = effort.rays() / 2;
    let all = Population { closest: rays::uniform(2, &world, count), any: Vec::new() };
    let truth = Truth::of(geometry, &all, if n > 100_000 { 20 } else { effort.judged() })?;
    let mut schemes: Vec<(String, String, Builder<'_>)> = Vec::new();
    for &name in roster::NAMES {
        if name != "exhaustive" || n <= EXHAUSTIVE {
            schemes.push((name.into(), "f32".into(), Box::new(move || field_named(name, geometry))));
        }
    }
    let outcome = raced(family, n, &mut schemes, &all, &truth, effort)?;
    Ok(Group {
        scene: format!("{family}-{n}"),
        prims: n,
        ray_kind: "chords".into(),
        rays: count,
        judged: truth.len(),
        outcome,
    })
}

/// The powers of `N` that fit each structure's figures best; none if a promise was broken.
fn fits(family: &str, groups: &[Group]) -> Option<Group> {
    let all: Vec<(f64, &Vec<Measured>)> = groups
        .iter()
        .map(|group| Some((group.prims as f64, group.outcome.as_ref().ok()?)))
        .collect::<Option<_>>()?;
    let mut names: Vec<&str> = Vec::new();
    for m in all.iter().flat_map(|(_, measured)| measured.iter()) {
        if !names.contains(&m.structure.as_str()) {
            names.push(&m.structure);
        }
    }
    let fit = |name: &str, figure: fn(&Measured) -> f64| {
        let points: Vec<(f64, f64)> = all
            .iter()
            .filter_map(|(n, measured)| Some((*n, figure(measured.iter().find(|m| m.structure == name)?))))
            .filter(|(_, y)| *y > 0.0)
            .collect();
        power(&points)
    };
    let measured = names.iter().map(|name| {
        let (time, r2) = fit(name, |m| m.ns_per_ray);
        let (work, _) = fit(name, |m| m.nodes_per_ray.unwrap_or(0.0) + m.tests_per_ray.unwrap_or(0.0));
        let (build, _) = fit(name, |m| m.build_ms.unwrap_or(0.0));
        let (bytes, _) = fit(name, |m| m.bytes_per_prim.unwrap_or(0.0));
        let figures = vec![
            ("time_power", time),
            ("R2", r2),
            ("work_power", work),
            ("build_power", build),
            ("bytes_power", bytes),
        ];
        // The largest scene's time, for the column.
        let last = all.iter().rev().find_map(|(_, m)| m.iter().find(|m| m.structure == *name));
        Measured {
            structure: name.to_string(),
            params: "fitted".into(),
            ns_per_ray: last.map_or(f64::NAN, |m| m.ns_per_ray),
            spread: f64::NAN,
            speed: last.map_or(f64::NAN, |m| m.speed),
            figures,
            ..Measured::default()
        }
    });
    let outcome: Result<Vec<Measured>, Mismatch> = Ok(measured.collect());
    let (prims, rays) = groups.last().map_or((0, 0), |group| (group.prims, group.rays));
    Some(Group {
        scene: format!("{family}, all sizes"),
        prims,
        ray_kind: "chords".into(),
        rays,
        judged: 0,
        outcome,
    })
}

/// The power `p` of `y = c x^p` by least squares of logarithms, and the share of the variance that it explains.
fn power(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = logs.iter().fold((0.0, 0.0), |m, l| (m.0 + l.0 / n, m.1 + l.1 / n));
    let sum = |f: fn(f64, f64) -> f64| logs.iter().map(|l| f(l.0 - mean.0, l.1 - mean.1)).sum::<f64>();
    let (xx, xy, yy) = (sum(|x, _| x * x), sum(|x, y| x * y), sum(|_, y| y * y));
    (xy / xx, xy * xy / (xx * yy))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_found_again() {
        let points: Vec<(f64, f64)> =
            (1..9).map(|k| (10f64.powi(k), 3.0 * 10f64.powi(k).powf(0.34))).collect();
        let (p, r2) = power(&points);
        assert!((p - 0.34).abs() < 1e-12 && (r2 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn lines_meet_spheres_with_the_same_chance_at_every_size() {
        let share = |n: usize| {
            let rays = rays::uniform::<f32>(2, &Aabb::new(Vec3A::NEG_ONE, Vec3A::ONE), 4000);
            let spheres = spheres(n);
            let field = field_named("bvh", &spheres).unwrap();
            field.any(&rays).iter().filter(|hit| **hit).count() as f64 / 4000.0
        };
        let (few, many) = (share(100), share(10_000));
        assert!((few - many).abs() < 0.06 && many > 0.2, "{few} {many}");
    }
}

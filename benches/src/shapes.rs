//! What do smooth shapes cost as triangles, and how far are the triangles from them?

use crate::contest::{Group, Measured};
use crate::{Effort, Trouble, Watch, hear};
use core::hint::black_box;
use rt_measure::clock::race;
use rt_measure::front::{Point, front};
use rt_measure::record::ErrorKind;
use rt_shapes::{LoopError, LoopSurface, Vertices};

/// Places of a triangle where its distance is measured, along a side; their squares in all.
const FINENESS: u32 = 3;

/// Both ways to place vertices, level by level, on surfaces with and without boundary.
///
/// `ns` is a triangle's share of making the mesh; limit vertices come with normals, control vertices without. The front weighs the
/// time of the whole mesh against the largest distance. Distances are shares of the surface's size, the diagonal of its box: the
/// largest, and the root of the mean squared one in millionths.
pub(crate) fn ask(effort: Effort, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let levels = match effort {
        Effort::Quick => 4,
        Effort::Normal => 5,
        Effort::Full => 7,
    };
    let refused = |error: LoopError| Trouble::Scene(error.to_string());
    let mut groups = Vec::new();
    for (k, (name, shape)) in [("octahedron", octahedron()), ("ground", ground())].into_iter().enumerate() {
        let surface = shape.map_err(refused)?;
        let size = f64::from(surface.world_bound().size().length());
        let (mut measured, mut points) = (Vec::new(), Vec::new());
        for level in 0..levels {
            hear(watch, k * levels as usize + level as usize, 2 * levels as usize)?;
            // What level 0 refuses, the timed loop below need not look at.
            let mut limit = || {
                black_box(surface.refine::<f32>(level).is_ok());
            };
            let mut control = || {
                black_box(surface.control::<f32>(level).is_ok());
            };
            let race = race(effort.plan(), &mut [&mut limit, &mut control]);
            for (who, vertices) in [Vertices::Limit, Vertices::Control].into_iter().enumerate() {
                let deviation = surface.deviation(level, vertices, FINENESS).map_err(refused)?;
                let triangles = deviation.triangles as f64;
                points.push(Point { time: race.median(who), error: deviation.largest });
                measured.push(Measured {
                    structure: ["limit", "control"][who].into(),
                    params: format!("level={level}"),
                    build_ms: Some(race.median(who) / 1e6),
                    ns_per_ray: race.median(who) / triangles.max(1.0),
                    spread: race.spread(who),
                    speed: race.ratio(0, who),
                    off: Some((ErrorKind::Distance, deviation.largest / size)),
                    figures: vec![("triangles", triangles), ("rms_ppm", deviation.rms / size * 1e6)],
                    ..Measured::default()
                });
            }
        }
        for i in front(&points) {
            measured[i].on_front = true;
        }
        groups.push(Group {
            scene: format!("loop {name}"),
            prims: surface.face_count(),
            ray_kind: "places a triangle".into(),
            rays: (FINENESS * FINENESS) as usize,
            judged: (FINENESS * FINENESS) as usize,
            outcome: Ok(measured),
        });
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// Six vertices with four neighbours: the smallest smooth ball.
fn octahedron() -> Result<LoopSurface, LoopError> {
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let vertices = vec![x, y, z, x.map(|a: f64| -a), y.map(|a: f64| -a), z.map(|a: f64| -a)];
    let upper = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]];
    let lower = upper.map(|[a, b, _]| [b, a, 5]);
    LoopSurface::new(vertices, upper.into_iter().chain(lower).collect())
}

/// Waves over eight by eight squares: almost all of it regular, and a boundary.
fn ground() -> Result<LoopSurface, LoopError> {
    const N: u32 = 8;
    let all = || (0..=N).flat_map(|j| (0..=N).map(move |i| (i, j)));
    let height = |i: u32, j: u32| 0.5 * ((1.1 * i as f64).sin() + (1.7 * j as f64).cos());
    let vertices = all().map(|(i, j)| [i as f64, j as f64, height(i, j)]).collect();
    let cut = |(i, j): (u32, u32)| {
        let v = j * (N + 1) + i;
        [[v, v + 1, v + N + 1], [v + 1, v + N + 2, v + N + 1]]
    };
    LoopSurface::new(vertices, all().filter(|&(i, j)| i < N && j < N).flat_map(cut).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::ControlFlow;

    #[test]
    fn finer_is_nearer() {
        let groups = ask(Effort::Quick, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(groups.len(), 2);
        for group in groups {
            let all = group.outcome.unwrap();
            let off = |m: &Measured| m.off.unwrap().1;
            assert!(all.len() == 8 && all.iter().any(|m| m.on_front && m.params == "level=3"));
            for (coarse, fine) in all.iter().zip(&all[2..]) {
                assert!(off(fine) < off(coarse) && fine.ns_per_ray > 0.0, "{coarse:?} {fine:?}");
                let rms = |m: &Measured| m.figures[1].1;
                assert!(
                    rms(fine) < rms(coarse) && rms(fine) > 1.0 && rms(fine) < off(fine) * 1e6,
                    "{fine:?}"
                );
            }
        }
        assert!(ask(Effort::Quick, &mut |_| ControlFlow::Break(())).is_err());
    }
}

//! What do smooth shapes cost as triangles, and how far are the triangles from them?

use crate::{Effort, Trouble, Watch, hear};
use core::hint::black_box;
use rt_measure::clock::race;
use rt_measure::front::{Point, front};
use rt_shapes::{Deviation, LoopError, LoopSurface, Vertices};

/// One way to make triangles of a Loop surface.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tessellation {
    pub(crate) shape: &'static str,
    pub(crate) level: u32,
    pub(crate) vertices: Vertices,
    /// How many triangles, and how far from the surface they are, in units of the control net.
    pub(crate) deviation: Deviation,
    /// Nanoseconds a triangle, the median.
    pub(crate) ns_per_triangle: f64,
    /// The 90th percentile of rounds over the 10th.
    pub(crate) spread: f64,
    /// Whether nothing of the same shape beats it in both time and largest distance. Limit vertices come
    /// with normals, control vertices without.
    pub(crate) on_front: bool,
}

/// Both ways to place vertices, level by level, on surfaces with and without boundary.
pub(crate) fn ask_loop(effort: Effort, watch: Watch<'_>) -> Result<Vec<Tessellation>, Trouble> {
    let levels = match effort {
        Effort::Quick => 4,
        Effort::Normal => 5,
        Effort::Full => 7,
    };
    let refused = |error: LoopError| Trouble::Scene(error.to_string());
    let shapes = [("octahedron", octahedron()), ("ground", ground())];
    let mut all = Vec::new();
    for (name, shape) in shapes {
        let surface = shape.map_err(refused)?;
        let begin = all.len();
        for level in 0..levels {
            hear(watch, all.len(), 4 * levels as usize)?;
            // What level 0 refuses, the timed loop below need not look at.
            let mut limit = || {
                black_box(surface.refine::<f32>(level).is_ok());
            };
            let mut control = || {
                black_box(surface.control::<f32>(level).is_ok());
            };
            let race = race(effort.plan(), &mut [&mut limit, &mut control]);
            for (who, vertices) in [Vertices::Limit, Vertices::Control].into_iter().enumerate() {
                let deviation = surface.deviation(level, vertices, 3).map_err(refused)?;
                all.push(Tessellation {
                    shape: name,
                    level,
                    vertices,
                    deviation,
                    ns_per_triangle: race.median(who) / deviation.triangles.max(1) as f64,
                    spread: race.spread(who),
                    on_front: false,
                });
            }
        }
        let mine = &mut all[begin..];
        let total = |t: &Tessellation| t.ns_per_triangle * t.deviation.triangles as f64;
        let points: Vec<Point> =
            mine.iter().map(|t| Point { time: total(t), error: t.deviation.largest }).collect();
        for i in front(&points) {
            mine[i].on_front = true;
        }
    }
    hear(watch, 1, 1)?;
    Ok(all)
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
        let all = ask_loop(Effort::Quick, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(all.len(), 16);
        for shape in all.chunk_by(|a, b| a.shape == b.shape) {
            assert!(shape.iter().any(|t| t.on_front && t.level == 3));
            for (coarse, fine) in shape.iter().zip(&shape[2..]) {
                assert!(fine.deviation.largest < coarse.deviation.largest, "{coarse:?} {fine:?}");
                assert!(
                    fine.deviation.rms < coarse.deviation.rms
                        && fine.ns_per_triangle > 0.0
                        && fine.spread >= 1.0
                );
            }
        }
        assert_eq!(all[0].vertices, Vertices::Limit);
        assert!(ask_loop(Effort::Quick, &mut |_| ControlFlow::Break(())).is_err());
    }
}

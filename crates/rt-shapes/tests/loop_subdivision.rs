//! Loop surfaces against what is known of them: the box spline, their own refinements, symmetry, topology.

use rt_accel::BuildError;
use rt_geom::glam::DVec3;
use rt_shapes::{
    Boundaries, Corners, LoopError, LoopRules, LoopSurface, LoopTessellation, Refine, TriangleMesh, Vertices,
    Weights,
};
use std::collections::{BTreeMap, BTreeSet};

type Points = Vec<[f64; 3]>;
type Faces = Vec<[u32; 3]>;

/// A repeatable number in `[0, 1)`.
fn noise(i: usize) -> f64 {
    let x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x ^ (x >> 29)) as f64 / 2f64.powi(64)
}

fn tetrahedron() -> (Points, Faces) {
    let p = vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    (p, vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
}

/// Two cones over one polygon; the octahedron for four.
fn bipyramid(n: u32) -> (Points, Faces) {
    let at = |k: u32| match (n, k) {
        (4, k) => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]][k as usize],
        _ => {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
            [cos, sin, 0.0]
        }
    };
    let mut points: Points = (0..n).map(at).collect();
    points.extend([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]);
    let sides = |k: u32| [[k, (k + 1) % n, n], [(k + 1) % n, k, n + 1]];
    (points, (0..n).flat_map(sides).collect())
}

fn icosahedron() -> (Points, Faces) {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for (a, b) in [(1.0, g), (1.0, -g), (-1.0, g), (-1.0, -g)] {
        points.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let p = |i: usize| DVec3::from_array(points[i]);
    let near = |i: usize, j: usize| (p(i).distance(p(j)) - 2.0).abs() < 1e-9;
    let mut faces = Vec::new();
    for (i, j, k) in (0..12).flat_map(|i| (i..12).flat_map(move |j| (j..12).map(move |k| (i, j, k)))) {
        if near(i, j) && near(j, k) && near(k, i) {
            let out = (p(j) - p(i)).cross(p(k) - p(i)).dot(p(i)) > 0.0;
            faces.push(if out { [i, j, k] } else { [i, k, j] }.map(|i| i as u32));
        }
    }
    (points, faces)
}

/// A grid of squares cut in two, `n` by `n`, over a rough ground.
fn grid(n: u32, height: impl Fn(u32, u32) -> f64) -> (Points, Faces) {
    let across = n + 1;
    let all = || (0..across).flat_map(|j| (0..across).map(move |i| (i, j)));
    let points = all().map(|(i, j)| [i as f64, j as f64, height(i, j)]).collect();
    let cells = all().filter(|&(i, j)| i < n && j < n);
    let cut = |(i, j): (u32, u32)| {
        let v = j * across + i;
        [[v, v + 1, v + across], [v + 1, v + across + 1, v + across]]
    };
    (points, cells.flat_map(cut).collect())
}

/// A disc of `n` faces around a vertex, then of rough ones around these.
fn disc(n: u32) -> (Points, Faces) {
    let ring = |r: f64, k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
        [r * cos, r * sin, noise((r * 1000.0) as usize + k as usize)]
    };
    let mut points = vec![[0.0, 0.0, 0.3]];
    points.extend((0..n).map(|k| ring(1.0, k)));
    points.extend((0..n).map(|k| ring(2.0, k)));
    let sides = |k: u32| {
        let (a, b) = (1 + k, 1 + (k + 1) % n);
        [[0, a, b], [a, a + n, b], [b, a + n, b + n]]
    };
    (points, (0..n).flat_map(sides).collect())
}

fn surface((points, faces): (Points, Faces)) -> LoopSurface {
    LoopSurface::new(points, faces).unwrap()
}

const RULES: [LoopRules; 3] = [
    LoopRules { weights: Weights::Loop, boundaries: Boundaries::Smooth, corners: Corners::Round },
    LoopRules { weights: Weights::Warren, boundaries: Boundaries::Plain, corners: Corners::Fixed },
    LoopRules { weights: Weights::Warren, boundaries: Boundaries::Smooth, corners: Corners::Fixed },
];

/// Surfaces of every kind there is: closed, with boundaries, creases, darts, corners, extraordinary vertices.
fn all() -> Vec<(String, LoopSurface)> {
    let mut all: Vec<(String, LoopSurface)> = vec![
        ("tetrahedron".into(), surface(tetrahedron())),
        ("icosahedron".into(), surface(icosahedron())),
        ("triangle".into(), surface((vec![[0.0; 3], [2.0, 0.1, 0.3], [0.2, 1.0, -0.4]], vec![[0, 1, 2]]))),
    ];
    for n in [3, 4, 5, 7, 12] {
        all.push((format!("bipyramid {n}"), surface(bipyramid(n))));
        all.push((format!("disc {n}"), surface(disc(n))));
    }
    let rough = |i: u32, j: u32| noise((17 * i + j) as usize);
    for (k, rules) in RULES.into_iter().enumerate() {
        all.push((format!("grid, rules {k}"), surface(grid(4, rough)).with_rules(rules)));
        all.push((format!("disc 9, rules {k}"), surface(disc(9)).with_rules(rules)));
        let icosahedron = || surface(icosahedron()).with_rules(rules);
        let edges: Vec<[u32; 2]> = icosahedron_edges();
        let creased = |share: usize, sharpness: &dyn Fn(usize) -> f32| -> Vec<([u32; 2], f32)> {
            edges
                .iter()
                .enumerate()
                .filter(|(i, _)| i % share == 0)
                .map(|(i, e)| (*e, sharpness(i)))
                .collect()
        };
        let add = |name: &str, edges: Vec<([u32; 2], f32)>| {
            (format!("{name}, rules {k}"), icosahedron().with_creases(&edges).unwrap())
        };
        all.push(add("one crease", vec![(edges[0], f32::INFINITY)]));
        all.push(add("some creases", creased(3, &|_| f32::INFINITY)));
        all.push(add("many creases", creased(2, &|i| if i % 4 == 0 { f32::INFINITY } else { 1.6 })));
        all.push(add("soft creases", creased(2, &|i| 0.3 + 0.2 * (i % 7) as f32)));
    }
    all
}

fn icosahedron_edges() -> Vec<[u32; 2]> {
    let edges = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
    icosahedron().1.into_iter().flat_map(edges).filter(|e| e[0] < e[1]).collect()
}

fn positions(mesh: &TriangleMesh<f64>) -> Vec<DVec3> {
    mesh.vertices().iter().map(|&p| DVec3::from_array(p)).collect()
}

/// The quartic box spline with directions (1,0), (0,1), (1,1), each twice, by its recurrence: shares no formula with the crate.
///
/// Source: de Boor, Höllig, Riemenschneider, *Box Splines* (1993), chapter 1.
fn box_spline(counts: [u32; 3], x: [f64; 2]) -> f64 {
    const DIRECTIONS: [[f64; 2]; 3] = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let total: u32 = counts.iter().sum();
    let present: Vec<usize> = (0..3).filter(|&i| counts[i] > 0).collect();
    if present.len() < 2 {
        return 0.0;
    }
    let solve = |a: [f64; 2], b: [f64; 2]| {
        let det = a[0] * b[1] - a[1] * b[0];
        [(x[0] * b[1] - x[1] * b[0]) / det, (a[0] * x[1] - a[1] * x[0]) / det]
    };
    let (i, j) = (present[0], present[1]);
    let [s, t] = solve(DIRECTIONS[i], DIRECTIONS[j]);
    if total == 2 {
        return if (0.0..1.0).contains(&s) && (0.0..1.0).contains(&t) { 1.0 } else { 0.0 };
    }
    // Any way to write x by the directions will do; copies of one share its part.
    let mut value = 0.0;
    for (direction, part) in [(i, s), (j, t)] {
        let copies = counts[direction] as f64;
        let mut fewer = counts;
        fewer[direction] -= 1;
        let d = DIRECTIONS[direction];
        let back = [x[0] - d[0], x[1] - d[1]];
        // Each copy has the part `part / copies`, and taking any of them away leaves the same.
        value += part * box_spline(fewer, x) + (copies - part) * box_spline(fewer, back);
    }
    for &direction in present.iter().filter(|&&k| k != i && k != j) {
        let mut fewer = counts;
        fewer[direction] -= 1;
        let d = DIRECTIONS[direction];
        value += counts[direction] as f64 * box_spline(fewer, [x[0] - d[0], x[1] - d[1]]);
    }
    value / (total - 2) as f64
}

#[test]
fn a_regular_net_is_the_box_spline() {
    let n = 7;
    let (points, faces) = grid(n, |i, j| noise((31 * i + j) as usize));
    let net = surface((points.clone(), faces.clone()));
    let mut seen = 0;
    for (face, corners) in faces.iter().enumerate() {
        let [a, b, c] = corners.map(|v| points[v as usize]);
        if corners.iter().any(|&v| {
            let (i, j) = (v % (n + 1), v / (n + 1));
            // Beside the corners of the border the boundary rules reach two cells far.
            i < 2 || j < 2 || i > n - 2 || j > n - 2
        }) {
            continue;
        }
        for k in 0..20 {
            // Inside of cells: on their borders the half-open pieces of the recurrence may be off by a rounding.
            let (u, v) = (noise(2 * k + face) * 0.49 + 0.005, noise(2 * k + 1 + face) * 0.49 + 0.005);
            let x = a[0] + (b[0] - a[0]) * u + (c[0] - a[0]) * v;
            let y = a[1] + (b[1] - a[1]) * u + (c[1] - a[1]) * v;
            let mut z = 0.0;
            for p in &points {
                // The net's diagonals run the other way: one axis is mirrored. The support begins two cells before the vertex.
                z += p[2] * box_spline([2, 2, 2], [p[0] - x + 2.0, y - p[1] + 2.0]);
            }
            let at = net.limit(face as u32, u, v).unwrap();
            assert!((at.point - DVec3::new(x, y, z)).length() < 1e-12, "{at:?} {x} {y} {z}");
            seen += 1;
        }
    }
    assert!(seen >= 18 * 20, "{seen}");
}

#[test]
fn limits_do_not_depend_on_the_level_they_are_taken_from() {
    for (name, surface) in all() {
        let (coarse, fine) = (surface.refine::<f64>(0).unwrap(), surface.refine::<f64>(3).unwrap());
        let control = surface.control::<f64>(0).unwrap();
        // Even vertices keep their numbers.
        for v in 0..control.vertices().len() {
            let gap = positions(&coarse)[v].distance(positions(&fine)[v]);
            assert!(gap < 1e-12, "{name}: vertex {v} off by {gap:e}");
        }
    }
}

#[test]
fn every_vertex_of_a_refinement_is_the_limit_evaluated_there() {
    const LEVEL: u32 = 2;
    for (name, surface) in all() {
        let mesh = surface.refine::<f64>(LEVEL).unwrap();
        let points = positions(&mesh);
        for (i, corners) in mesh.triangles().iter().enumerate() {
            let face = (i >> (2 * LEVEL)) as u32;
            // From the finest digit of the path to the coarsest: corners of the child as weights in the parent.
            let mut weights = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            for level in 0..LEVEL {
                let child = i >> (2 * level) & 3;
                let middle = |k: usize| -> [f64; 3] {
                    let mut w = [0.0; 3];
                    w[k % 3] += 0.5;
                    w[(k + 1) % 3] += 0.5;
                    w
                };
                let mut corner = [0.0; 3];
                corner[child % 3] = 1.0;
                let parts = match child {
                    3 => [middle(0), middle(1), middle(2)],
                    k => [corner, middle(k), middle(k + 2)],
                };
                weights = weights.map(|w| [0, 1, 2].map(|a| (0..3).map(|b| w[b] * parts[b][a]).sum()));
            }
            for (v, [_, u, w]) in corners.iter().zip(weights) {
                let at = surface.limit(face, u, w).unwrap();
                let gap = at.point.distance(points[*v as usize]);
                assert!(gap < 1e-12, "{name}: triangle {i} off by {gap:e} at {u} {w}");
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    for (name, surface) in all() {
        let mut worst = 0.0f64;
        for face in 0..surface.face_count() as u32 {
            for k in 0..8 {
                // Patches meet where u, v or u + v is a multiple of a power of two, none below 2^-12 at this distance from the
                // corners. There second derivatives jump, so the differences stay between: a tenth of a cell is 24 of their steps.
                let place = |i: usize| noise(i + 1000 * face as usize);
                let (i, j) =
                    ((place(4 * k) * 2000.0).floor() + 20.0, (place(4 * k + 1) * 2000.0).floor() + 20.0);
                let (x, y) = (0.1 + 0.3 * place(4 * k + 2), 0.1 + 0.3 * place(4 * k + 3));
                let (x, y) = if k % 2 == 0 { (x, y) } else { (1.0 - x, 1.0 - y) };
                let (u, v) = ((i + x) / 4096.0, (j + y) / 4096.0);
                let h = 1e-6;
                let at = |u, v| surface.limit(face, u, v).unwrap();
                let here = at(u, v);
                let du = (at(u + h, v).point - at(u - h, v).point) / (2.0 * h);
                let dv = (at(u, v + h).point - at(u, v - h).point) / (2.0 * h);
                let size = here.dpdu.length().max(here.dpdv.length()).max(1e-3);
                worst = worst.max((du - here.dpdu).length().max((dv - here.dpdv).length()) / size);
                let n = here.dpdu.cross(here.dpdv);
                assert!(n.length() == 0.0 || (here.normal - n.normalize()).length() < 1e-9, "{name}");
            }
        }
        assert!(worst < 1e-7, "{name}: {worst:e}");
    }
}

#[test]
fn normals_at_vertices_are_the_limits_of_normals() {
    for (name, surface) in all() {
        if name.contains("rules 1") {
            continue; // plain boundaries of many faces have none
        }
        for face in 0..surface.face_count() as u32 {
            for corner in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                let at = |e: f64| {
                    let [_, u, v] = corner.map(|w: f64| w * (1.0 - 3.0 * e) + e);
                    surface.limit(face, u, v).unwrap().normal
                };
                let [_, u, v] = corner;
                let there = surface.limit(face, u, v).unwrap().normal;
                // Where the surface shrinks unevenly towards the vertex, normals very near it are lost to rounding.
                let best = [1e-3, 1e-5, 1e-7, 1e-12, 1e-24]
                    .map(|e| (at(e) - there).length())
                    .into_iter()
                    .fold(2.0, f64::min);
                assert!(best < 1e-6, "{name}: face {face} {corner:?} {best}");
            }
        }
    }
}

#[test]
fn topology_is_kept() {
    for (name, surface) in all() {
        let at = |level: u32| {
            let mesh = surface.control::<f64>(level).unwrap();
            let mut edges = BTreeSet::new();
            for &[a, b, c] in mesh.triangles() {
                edges.extend([[a, b], [b, c], [c, a]].map(|[x, y]| [x.min(y), x.max(y)]));
            }
            let (v, e, f) = (mesh.vertices().len() as i64, edges.len() as i64, mesh.triangles().len() as i64);
            (v - e + f, f)
        };
        let (euler, faces) = at(0);
        for level in 1..4 {
            assert_eq!(at(level), (euler, faces << (2 * level)), "{name}");
        }
    }
    for solid in [tetrahedron(), bipyramid(4), icosahedron()] {
        let mesh = surface(solid).refine::<f64>(3).unwrap();
        let orientation = mesh.orientation();
        assert_eq!(orientation.components.len(), 1);
        assert_eq!(orientation.components[0].facing(), Some(rt_shapes::Facing::Outward));
    }
}

#[test]
fn flat_nets_stay_flat_and_straight_borders_straight() {
    let n = 5;
    let flat = surface(grid(n, |_, _| 0.75));
    let mesh = flat.refine::<f64>(3).unwrap();
    for [x, y, z] in mesh.vertices() {
        assert!((z - 0.75).abs() < 1e-15 && (0.0..=5.0).contains(x) && (0.0..=5.0).contains(y));
    }
    for x in [0.0, 5.0] {
        // Between its corners, which are rounded, a straight border stays where it is.
        assert!(mesh.vertices().iter().filter(|p| p[0] == x && p[1] > 1.0 && p[1] < 4.0).count() >= 17);
    }
    let fixed = surface(grid(n, |_, _| 0.0))
        .with_rules(LoopRules { corners: Corners::Fixed, ..LoopRules::default() });
    let corner = fixed.limit(0, 0.0, 0.0).unwrap();
    assert_eq!(corner.point, DVec3::ZERO);
    assert_eq!(corner.normal, DVec3::Z);
}

#[test]
fn symmetric_nets_give_symmetric_surfaces_bit_for_bit() {
    let bits = |mesh: &TriangleMesh<f64>, map: &dyn Fn([f64; 3]) -> [f64; 3]| -> BTreeSet<[u64; 3]> {
        // Zeros of either sign are one number.
        mesh.vertices().iter().map(|&p| map(p).map(|x| (x + 0.0).to_bits())).collect()
    };
    let maps: [&dyn Fn([f64; 3]) -> [f64; 3]; 5] = [
        &|[x, y, z]| [-x, y, z],
        &|[x, y, z]| [x, -y, z],
        &|[x, y, z]| [y, x, -z],
        &|[x, y, z]| [y, z, x],
        &|[x, y, z]| [-x, -y, -z],
    ];
    let kept: [(_, &[usize]); 3] =
        [(tetrahedron(), &[3]), (bipyramid(4), &[0, 1, 2, 3, 4]), (icosahedron(), &[0, 1, 3, 4])];
    for (solid, symmetries) in kept {
        let mesh = surface(solid).refine::<f64>(4).unwrap();
        let all = bits(&mesh, &|p| p);
        assert_eq!(all.len(), mesh.vertices().len());
        for &i in symmetries {
            assert_eq!(bits(&mesh, maps[i]), all, "symmetry {i}");
        }
    }
    // No symmetry, but another order of everything.
    let (points, faces) = disc(9);
    let count = points.len() as u32;
    let moved = |v: u32| (v * 5 + 3) % count;
    let mut shuffled = points.clone();
    for (v, p) in (0..).zip(&points) {
        shuffled[moved(v) as usize] = *p;
    }
    let turned = |(i, &[a, b, c]): (usize, &[u32; 3])| [[a, b, c], [b, c, a], [c, a, b]][i % 3].map(moved);
    let mut again: Faces = faces.iter().enumerate().map(turned).collect();
    again.reverse();
    let one = surface((points, faces)).refine::<f64>(3).unwrap();
    let other = surface((shuffled, again)).refine::<f64>(3).unwrap();
    assert_eq!(bits(&one, &|p| p), bits(&other, &|p| p));
}

#[test]
fn bounds_hold_what_they_bound() {
    for (name, surface) in all() {
        let world = surface.world_bound();
        for face in 0..surface.face_count() as u32 {
            let bound = surface.face_bound(face).unwrap();
            assert!(world.contains(bound));
            for k in 0..10 {
                let (u, v) = (noise(k), noise(k + 1000) * (1.0 - noise(k)));
                let p = surface.limit(face, u, v).unwrap().point;
                let inside = p.cmpge(bound.min.as_dvec3()).all() && p.cmple(bound.max.as_dvec3()).all();
                assert!(inside, "{name} {face} {p} {bound:?}");
            }
        }
        for level in 0..3 {
            for p in surface.refine::<f32>(level).unwrap().vertices() {
                let p = DVec3::from_array(p.map(f64::from));
                assert!(p.cmpge(world.min.as_dvec3()).all() && p.cmple(world.max.as_dvec3()).all(), "{name}");
            }
        }
    }
    assert!(surface((vec![], vec![])).world_bound().is_empty());
}

#[test]
fn creases_are_splines_of_their_own_vertices() {
    // A crease around the middle of an octahedron: whatever the poles do, the crease is the same curve.
    let at = |height: f64| {
        let (mut points, faces) = bipyramid(4);
        points[4][2] = height;
        let equator: Vec<([u32; 2], f32)> = (0..4).map(|k| ([k, (k + 1) % 4], f32::INFINITY)).collect();
        surface((points, faces)).with_creases(&equator).unwrap()
    };
    let (low, high) = (at(1.0), at(7.0));
    for k in 0..=16 {
        // The uniform cubic B-spline through the same four points.
        let t = k as f64 / 16.0;
        let curve = [
            (1.0 - t).powi(3) / 6.0,
            (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
            (-3.0 * t * t * t + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
            t.powi(3) / 6.0,
        ];
        let square = [DVec3::NEG_Y, DVec3::X, DVec3::Y, DVec3::NEG_X];
        let expected: DVec3 = square.iter().zip(curve).map(|(p, w)| *p * w).sum();
        for surface in [&low, &high] {
            let p = surface.limit(0, t, 0.0).unwrap().point;
            assert!((p - expected).length() < 1e-14, "{p} {expected}");
        }
    }
    // Two normals along it: each vertex of the equator stands twice in the mesh.
    let mesh = low.refine::<f64>(2).unwrap();
    let mut places: BTreeMap<[u64; 3], usize> = BTreeMap::new();
    for p in mesh.vertices() {
        *places.entry(p.map(f64::to_bits)).or_default() += 1;
    }
    assert_eq!(places.values().filter(|&&n| n == 2).count(), 16);
    assert!(places.values().all(|&n| n <= 2));
    // Softer creases lie between smooth and sharp.
    let bulge = |sharpness: f32| {
        let (points, faces) = bipyramid(4);
        let equator: Vec<([u32; 2], f32)> = (0..4).map(|k| ([k, (k + 1) % 4], sharpness)).collect();
        surface((points, faces)).with_creases(&equator).unwrap().limit(0, 0.5, 0.0).unwrap().point.length()
    };
    let sizes = [0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 4.0, f32::INFINITY].map(bulge);
    assert!(sizes.is_sorted_by(|a, b| a < b), "{sizes:?}");
    assert!((bulge(1e-6) - bulge(0.0)).abs() < 1e-6 && (bulge(1.0001) - bulge(1.0)).abs() < 1e-3);
}

#[test]
fn tessellations_come_nearer_by_four_a_level() {
    let ball = surface(icosahedron());
    let mut last = f64::INFINITY;
    for level in 0..5 {
        let limit = ball.deviation(level, Vertices::Limit, 3).unwrap();
        let control = ball.deviation(level, Vertices::Control, 3).unwrap();
        assert_eq!(limit.triangles, 20 << (2 * level));
        assert!(limit.rms <= limit.largest && limit.largest < control.largest, "{limit:?} {control:?}");
        assert!(level < 2 || (3.0..5.0).contains(&(last / limit.largest)), "{level} {last} {limit:?}");
        last = limit.largest;
    }
    let flat = surface(grid(3, |_, _| 1.0)).deviation(1, Vertices::Limit, 2).unwrap();
    assert!(flat.largest < 0.1);
}

#[test]
fn what_is_no_manifold_is_refused_by_name() {
    let p = |n: usize| -> Points { (0..n).map(|i| [i as f64, noise(i), 0.0]).collect() };
    let error = |n: usize, faces: &[[u32; 3]]| LoopSurface::new(p(n), faces.to_vec()).unwrap_err();
    assert_eq!(
        error(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]),
        LoopError::CrowdedEdge { edge: [0, 1], faces: vec![0, 1, 2] }
    );
    assert_eq!(
        error(4, &[[0, 1, 2], [0, 1, 3]]).to_string(),
        "triangles 0 and 1 run along the edge between vertices 0 and 1 in the same direction: one of them must be turned over"
    );
    assert_eq!(error(5, &[[0, 1, 2], [0, 3, 4]]), LoopError::SplitVertex { vertex: 0, faces: [0, 1] });
    assert_eq!(error(4, &[[0, 1, 2]]), LoopError::IsolatedVertex { vertex: 3 });
    assert_eq!(error(3, &[[0, 1, 2], [2, 2, 1]]), LoopError::RepeatedCorner { triangle: 1, vertex: 2 });
    assert_eq!(error(3, &[[0, 1, 3]]), LoopError::IndexOutOfRange { triangle: 0, index: 3, vertices: 3 });
    for x in [f64::NAN, f64::INFINITY, -1e300] {
        let spoilt = LoopSurface::new(vec![[0.0; 3], [1.0, x, 0.0], [0.0, 0.0, 1.0]], vec![[0, 1, 2]]);
        assert_eq!(spoilt.unwrap_err(), LoopError::NotFinite { vertex: 1 });
    }
    let triangle = || surface((p(3), vec![[0, 1, 2]]));
    assert_eq!(
        triangle().with_creases(&[([0, 7], 1.0)]).unwrap_err(),
        LoopError::NoSuchEdge { edge: [0, 7] }
    );
    assert!(triangle().with_creases(&[([1, 0], f32::NAN)]).is_err());
    assert!(triangle().with_creases(&[([0, 1], -1.0)]).is_err());
    // The figures are those of the level asked for, whatever stands in its way.
    let refused = |level| triangle().refine::<f32>(level).unwrap_err();
    for (level, fewer, more) in [(13, 1u64 << 31, 1u64 << 34), (15, 1 << 36, 1 << 38)] {
        let LoopError::OutOfMemory { needed, limit } = refused(level) else { panic!("{:?}", refused(level)) };
        assert!((fewer..more).contains(&(needed as u64)) && limit == 1 << 31, "{needed}");
    }
    assert_eq!(refused(16), LoopError::TooManyTriangles { len: 1 << 32 });
    for level in [32, 40, u32::MAX] {
        assert_eq!(refused(level), LoopError::TooManyTriangles { len: usize::MAX });
        assert!(refused(level).to_string().contains("cannot even be counted"), "{}", refused(level));
        let tessellation = LoopTessellation { surface: triangle(), level };
        assert!(matches!(Refine::refine(&tessellation), Err(BuildError::BadParam { name: "level", .. })));
    }
    assert!(matches!(
        triangle().with_memory_limit(usize::MAX).deviation(u32::MAX, Vertices::Limit, 1),
        Err(LoopError::TooManyTriangles { .. })
    ));
    assert!(triangle().with_memory_limit(1000).refine::<f32>(3).is_err());
    let nothing = surface((vec![], vec![]));
    assert_eq!(nothing.refine::<f32>(u32::MAX).unwrap().triangles().len(), 0);
    for (face, u, v) in [(0, -0.1, 0.0), (0, 0.6, 0.6), (0, f64::NAN, 0.0), (1, 0.0, 0.0)] {
        assert_eq!(triangle().limit(face, u, v), None);
    }
}

#[test]
fn odd_sizes_are_ordinary() {
    // Scaled by powers of two, the surface is scaled, bit for bit; to the ends of what is allowed.
    let (points, faces) = disc(7);
    let whole = surface((points.clone(), faces.clone())).refine::<f64>(2).unwrap();
    for scale in [2f64.powi(-200), 2f64.powi(-40), 2f64.powi(220)] {
        let small: Points = points.iter().map(|p| p.map(|x| x * scale)).collect();
        let mesh = surface((small, faces.clone())).refine::<f64>(2).unwrap();
        let scaled: Points = whole.vertices().iter().map(|p| p.map(|x| x * scale)).collect();
        assert_eq!(mesh.vertices(), scaled);
    }
    // Two triangles back to back, and all vertices in one place: no normal, no panic.
    let pillow = surface((vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2], [2, 1, 0]]));
    assert!(pillow.refine::<f64>(3).unwrap().vertices().iter().flatten().all(|x| x.is_finite()));
    let point = surface((vec![[3.0; 3]; 4], tetrahedron().1));
    assert!(point.refine::<f64>(2).unwrap().vertices().iter().all(|p| *p == [3.0; 3]));
    assert_eq!(point.limit(0, 0.2, 0.3).unwrap().normal, DVec3::ZERO);
    // Hundreds of neighbours.
    let wheel = surface(disc(500));
    let at = wheel.limit(0, 1e-9, 1e-9).unwrap();
    assert!(at.point.is_finite() && (at.normal.length() - 1.0).abs() < 1e-12);
    // As near to an extraordinary vertex as one likes.
    let ball = surface(icosahedron());
    let tip = ball.limit(0, 0.0, 0.0).unwrap();
    for e in [1e-3, 1e-10, 1e-100, 1e-300, 5e-324] {
        let near = ball.limit(0, e, e / 3.0).unwrap();
        assert!((near.point - tip.point).length() <= 3.0 * e.powf(0.9) + 1e-15, "{e:e} {near:?}");
        assert!((near.normal - tip.normal).length() <= 20.0 * e.powf(0.5) + 1e-14, "{e:e} {near:?} {tip:?}");
    }
}

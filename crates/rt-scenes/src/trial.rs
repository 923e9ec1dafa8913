//! [`Trial`] and [`Closed`]: small named meshes for tests to loop over.

use crate::soup::Soup;
use crate::{Scene, SceneGeometry, Solid, by_name, fine, hostile, numbers::mesh, soup, spd, stadium};
use rt_geom::Real;
use rt_geom::glam::DVec3;
use rt_shapes::TriangleMesh;

/// A small mesh with a name: one case of a test that loops over many.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial<V: Real = f32> {
    /// What the case is, for messages: `"tetra 3, scaled by 1e-20"`.
    pub name: String,
    /// The mesh.
    pub mesh: TriangleMesh<V>,
}

impl<V: Real> Trial<V> {
    pub(crate) fn new(name: impl Into<String>, mesh: TriangleMesh<V>) -> Trial<V> {
        Trial { name: name.into(), mesh }
    }

    /// Where to aim: at its corners, and at the middles of some edges.
    pub fn points(&self) -> Vec<DVec3> {
        let widen = |v: &[V; 3]| DVec3::from_array(v.map(Into::into));
        let mut points: Vec<DVec3> = self.mesh.vertices().iter().map(widen).collect();
        for corners in self.mesh.triangles().iter().step_by(7) {
            let [a, b, _] = corners.map(|i| points[i as usize]);
            points.push((a + b) * 0.5);
        }
        points
    }
}

/// A closed surface, every edge of which belongs to two triangles that run along it in opposite directions; and a point strictly
/// inside.
///
/// A ray from that point hits, in whatever direction, and crosses the surface an odd number of times.
#[derive(Clone, Debug, PartialEq)]
pub struct Closed {
    /// What the case is, for messages.
    pub name: String,
    /// The surface; triangles turn left seen from outside.
    pub mesh: TriangleMesh,
    /// A point strictly inside, the same in `f32`.
    pub inside: DVec3,
}

/// What every structure must answer rightly on: soups, [hostile](crate::hostile) meshes, SPD scenes and a terrain in small sizes, the
/// smallest of stadiums; some of them scaled by `1e-20` and `1e15`, and moved far from zero.
///
/// A hundred meshes of at most 2000 triangles, most of far fewer, 34 000 in all; the same each time, in the same order. Takes about
/// 2 ms.
///
/// ```
/// use rt_accel::{Aggregate, Exhaustive};
/// for trial in rt_scenes::trials() {
///     let scene = Aggregate::<Exhaustive, _>::build(trial.mesh, &());
///     assert!(scene.is_ok(), "{}", trial.name);
/// }
/// ```
pub fn trials() -> Vec<Trial> {
    let mut plain = vec![
        Trial::new("soup of 1", soup::uniform(1, 1)),
        Trial::new("soup of 2", soup::uniform(2, 2)),
        Trial::new("soup of 3", soup::uniform(3, 3)),
        Trial::new("soup of 5", soup::uniform(5, 4)),
        Trial::new("soup of 300", soup::uniform(300, 5)),
        Trial::new("soup of 2000", soup::uniform(2000, 6)),
        Trial::new("clusters of 800", soup::clusters(800, 7)),
        Trial::new("sticks of 300, aspect 100", soup::sticks(300, 100.0, 8)),
        Trial::new("sticks of 300, aspect 1e4", soup::sticks(300, 1e4, 9)),
        Trial::new("parallel diagonal needles of 200", soup::needles(200)),
        Trial::new("grid of 16 x 16 squares", soup::grid(16)),
        Trial::new("crumpled sphere, radii to 1000", soup::crumpled(3, 1000.0, 10)),
        Trial::new("icosphere 2", soup::icosphere(2)),
        Trial::new("torus of 24 x 12", soup::torus(24, 12, 0.3)),
    ];
    for size in [1, 3, 5] {
        if let Ok(SceneGeometry::Mesh(tetra)) = spd::tetra(size).map(|scene| scene.geometry) {
            plain.push(Trial::new(format!("tetra {size}"), tetra));
        }
    }
    for (name, size) in [("sombrero", 1), ("terrain", 12), ("gears", 1), ("mount", 4), ("teapot", 3)] {
        if let Ok(scene) = by_name(name, Some(size)) {
            plain.push(Trial::new(format!("{name} {size}"), of_triangles(&scene)));
        }
    }
    plain.push(Trial::new("balls 1, of triangles", spd::balls_of_triangles(1)));
    let mut moved = Vec::new();
    for trial in &plain {
        if trial.mesh.triangles().len() > 400 {
            continue;
        }
        let name = &trial.name;
        // Powers of ten, so that coordinates do not keep their last digits.
        moved.push(Trial::new(format!("{name}, scaled by 1e-20"), map(&trial.mesh, |p| p * 1e-20)));
        moved.push(Trial::new(format!("{name}, scaled by 1e15"), map(&trial.mesh, |p| p * 1e15)));
        let far = DVec3::new(1e5, -2e5, 3e5);
        moved.push(Trial::new(format!("{name}, moved by 3e5"), map(&trial.mesh, |p| p + far)));
        let farther = DVec3::new(0.0, 1e7, 0.0);
        moved.push(Trial::new(format!("{name}, moved by 1e7"), map(&trial.mesh, |p| p + farther)));
    }
    plain.append(&mut moved);
    for ratio in [1.0, 1e3, 1e7] {
        plain.push(Trial::new(format!("teapot in a stadium, 1 : {ratio}"), stadium::small(ratio)));
    }
    plain.append(&mut hostile::meshes());
    plain
}

/// The same for rays of `f64`: millimetres at a distance of `1e7`, and more than `f32` can tell apart.
pub fn fine_trials() -> Vec<Trial<f64>> {
    vec![
        Trial::new("rubble of millimetres at 1e7", fine::rubble(300, DVec3::new(1e7, -3e6, 2e6), 11)),
        Trial::new("rubble of millimetres at zero", fine::rubble(300, DVec3::ZERO, 11)),
        Trial::new("stairs of 1e-9 at 1e7", fine::stairs(200)),
    ]
}

/// Closed surfaces for tests for leaks: smooth, crumpled, thin, large, small, far.
///
/// ```
/// for closed in rt_scenes::closed_meshes() {
///     assert_eq!(closed.inside, closed.inside.as_vec3().as_dvec3());
/// }
/// ```
pub fn closed_meshes() -> Vec<Closed> {
    let closed = |name: &str, mesh, inside| Closed { name: name.to_string(), mesh, inside };
    let ring = DVec3::new(1.0, 0.0, 0.0);
    let mut meshes = vec![
        closed("tetrahedron", soup::tetrahedron(), DVec3::ZERO),
        closed("cube", soup::cube(), DVec3::ZERO),
        closed("cube of 1e6 x 1 x 1e-6", map(&soup::cube(), |p| p * DVec3::new(1e6, 1.0, 1e-6)), DVec3::ZERO),
        closed("icosphere 0", soup::icosphere(0), DVec3::ZERO),
        closed("icosphere 3", soup::icosphere(3), DVec3::ZERO),
        closed("torus of 30 x 14", soup::torus(30, 14, 0.3), ring),
        closed("torus of 90 x 7, thin", soup::torus(90, 7, 1.0 / 64.0), ring),
        closed("crumpled sphere, radii to 2", soup::crumpled(3, 2.0, 20), DVec3::ZERO),
        closed("crumpled sphere, radii to 1000", soup::crumpled(3, 1000.0, 21), DVec3::ZERO),
    ];
    for (name, mesh) in [
        ("icosphere 2", soup::icosphere(2)),
        ("crumpled sphere, radii to 100", soup::crumpled(2, 100.0, 22)),
        ("torus of 24 x 12", soup::torus(24, 12, 0.3)),
    ] {
        let inside = if name.starts_with("torus") { ring } else { DVec3::ZERO };
        for scale in [1e-20, 1e15] {
            let at = (inside * scale).as_vec3().as_dvec3();
            meshes.push(closed(&format!("{name}, scaled by {scale:e}"), map(&mesh, |p| p * scale), at));
        }
        let far = DVec3::new(1e4, -2e4, 3e4);
        meshes.push(closed(&format!("{name}, moved by 3e4"), map(&mesh, |p| p + far), inside + far));
    }
    meshes
}

/// What triangles there are in a scene, those of its polygons too.
fn of_triangles(scene: &Scene) -> TriangleMesh {
    let solids = match &scene.geometry {
        SceneGeometry::Mesh(mesh) => return mesh.clone(),
        SceneGeometry::FineMesh(_) => &[][..],
        SceneGeometry::Solids(solids) => solids,
    };
    let mut soup = Soup::new(0);
    for solid in solids {
        match solid {
            Solid::Polygon(polygon) => polygon.triangles().iter().for_each(|t| soup.push(t.corners)),
            Solid::Facet(facet) => soup.push(facet.corners()),
            _ => {}
        }
    }
    soup.mesh()
}

/// The mesh with each vertex moved.
pub(crate) fn map(from: &TriangleMesh, place: impl Fn(DVec3) -> DVec3) -> TriangleMesh {
    let moved = |&v: &[f32; 3]| place(DVec3::from_array(v.map(f64::from))).as_vec3().to_array();
    mesh(from.vertices().iter().map(moved).collect(), from.triangles().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_accel::{Aggregate, Bounded, Exhaustive, Primitive};
    use rt_geom::Ray;
    use std::collections::{HashMap, HashSet};
    use std::ops::ControlFlow;

    #[test]
    fn trials_have_names_of_their_own_and_are_small() {
        let trials = trials();
        let names: HashSet<&str> = trials.iter().map(|trial| trial.name.as_str()).collect();
        assert_eq!(names.len(), trials.len());
        assert!((90..130).contains(&trials.len()), "{}", trials.len());
        for trial in &trials {
            assert!(trial.mesh.triangles().len() <= 2000, "{}", trial.name);
        }
        assert!(fine_trials().iter().all(|trial| trial.mesh.prim_count() <= 2000));
    }

    /// The bits of all vertices, folded: they are to be the same on every machine.
    #[test]
    fn every_machine_makes_the_same() {
        let mut sum = 0u64;
        let mut fold = |bits: u32| sum = (sum ^ u64::from(bits)).wrapping_mul(0x100_0000_01b3).rotate_left(9);
        for trial in trials() {
            for value in trial.mesh.vertices().iter().flatten() {
                fold(if value.is_nan() { 1 } else { value.to_bits() });
            }
            trial.mesh.triangles().iter().flatten().for_each(|&index| fold(index));
        }
        assert_eq!(sum, SUM, "{sum:#x}");
    }

    const SUM: u64 = 0x89df_c030_3c2a_8283;

    #[test]
    fn closed_is_closed() {
        for Closed { name, mesh, inside } in closed_meshes() {
            let places: HashSet<[u32; 3]> = mesh.vertices().iter().map(|v| v.map(f32::to_bits)).collect();
            assert_eq!(places.len(), mesh.vertices().len(), "{name}: vertices coincide");
            let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
            for &[a, b, c] in mesh.triangles() {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((from, to)).or_default() += 1;
                }
            }
            for (&(from, to), &times) in &edges {
                assert_eq!((times, edges.get(&(to, from))), (1, Some(&1)), "{name}: edge {from} {to}");
            }
            assert_eq!(mesh.degenerate(), 0, "{name}");

            let scene = Aggregate::<Exhaustive, _>::build(mesh.clone(), &()).unwrap();
            let mut random = crate::numbers::Random::new(5);
            for i in 0..60 {
                // Half of them at a vertex.
                let vertex = mesh.vertices()[random.below(mesh.vertices().len() as u64) as usize];
                let dir = if i % 2 == 0 {
                    DVec3::from_array(vertex.map(f64::from)) - inside
                } else {
                    DVec3::new(random.signed(), random.signed(), random.signed())
                };
                let ray = Ray::new(inside, dir);
                assert!(scene.intersect_p(&ray), "{name}: {ray:?}");
                let mut crossings = 0;
                let _ = scene.all_hits(&ray, &mut |_| {
                    crossings += 1;
                    ControlFlow::Continue(())
                });
                assert_eq!(crossings % 2, 1, "{name}: {ray:?}");
            }
        }
    }
}

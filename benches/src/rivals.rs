//! How do other people's structures fare on the same rays?
//!
//! | Contestant | Triangles | Closest | Any |
//! | --- | --- | --- | --- |
//! | `bvh` | exact, and fast after Möller and Trumbore | `intersect` | `intersect_p` |
//! | `obvhs-bvh2` | copied in the order of its leaves; its own test | `ray_traverse` | `ray_traverse_miss` |
//! | `obvhs-cwbvh` | likewise | `ray_traverse` | `ray_traverse_miss` |
//! | `svenstaro-bvh` | those of `bvh`, the fast test | `nearest_traverse_iterator`, to the first box too far | `traverse_iterator` |
//! | `parry3d` | its own mesh and test | `cast_local_ray` | the same: it has no other |
//!
//! The test that `svenstaro-bvh` brings along culls back faces and cannot be told not to.
//!
//! Where the errors of two contestants are equal, so are their formulas: `parry3d` and `obvhs` take `t` from the plane of the
//! triangle, `svenstaro-bvh` runs the test of `bvh fast`.
//!
//! All on one thread, as each crate comes, in `f32`, and all compiled alike. Rays start at `t = 0`, because not everyone takes
//! another start. `svenstaro-bvh` is given directions as they are, because its constructor would normalise, that is round, them.

use crate::contest::{Contestant, Group, Label, Weigh, build_all, contest, ours};
use crate::judge::{Answers, Judge};
use crate::queries::built;
use crate::subject::{Prims, RayKind, RaySet, Subject};
use crate::{Effort, FastMesh, Options, Trouble, Watch, hear};
use ::bvh::aabb::{Aabb, Bounded};
use ::bvh::bounding_hierarchy::BHShape;
use core::hint::black_box;
use core::time::Duration;
use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use parry3d::shape::{CompositeShapeRef, TriMesh};
use rt_accel::Aggregate;
use rt_bvh::{Bvh, BvhParams};
use rt_geom::Ray;
use rt_geom::glam::Vec3A;
use rt_measure::clock::Plan;
use rt_shapes::{TriangleMesh, moller_trumbore};

pub(crate) fn ask(options: &Options, watch: Watch<'_>) -> Result<Vec<Group>, Trouble> {
    let kinds = [RayKind::Primary, RayKind::Chords, RayKind::Diffuse, RayKind::Ambient, RayKind::Shadow];
    let made;
    let subjects = match &options.scenes {
        Some(scenes) => scenes,
        None => {
            let names: &[&str] = match options.effort {
                Effort::Quick => &["blob", "soup-100000"],
                Effort::Normal => &["blob", "soup-100000", "stadium-12", "sticks-10000"],
                Effort::Full => &["blob", "soup-100000", "soup-1000000", "stadium-100", "sticks-100000"],
            };
            made = names.iter().map(|name| Subject::named(name)).collect::<Result<Vec<_>, _>>()?;
            &made
        }
    };
    let mut groups = Vec::new();
    for (i, subject) in subjects.iter().enumerate() {
        let of = subjects.len() * (kinds.len() + 1);
        let done = i * (kinds.len() + 1);
        hear(watch, done, of)?;
        let Prims::Mesh(mesh) = &subject.prims else {
            return Err(Trouble::Scene(format!("{}: rivals know triangles only", subject.name)));
        };
        let sets = subject.rays(&kinds, options.effort.rays())?;
        let field = Field::new(mesh, options.effort.builds())?;
        let judge = Judge::new(&subject.prims);
        for (k, set) in sets.iter().enumerate() {
            hear(watch, done + 1 + k, of)?;
            let sample = judge.sample(set, options.effort.judged());
            let about = (subject.name.as_str(), subject.prims.count());
            let plan = options.effort.plan();
            groups.push(contest(about, set, (&judge, &sample), plan, Weigh::Error, field.contestants(set)));
        }
    }
    hear(watch, 1, 1)?;
    Ok(groups)
}

/// Everybody over one mesh, and the milliseconds each build took.
struct Field {
    exact: (Aggregate<Bvh, TriangleMesh>, f64),
    fast: (Aggregate<Bvh, FastMesh>, f64),
    bvh2: Vec<(&'static str, Bvh2Mesh, f64)>,
    cwbvh: (CwBvhMesh, f64),
    svenstaro: (SvenstaroMesh, f64),
    parry: Option<(TriMesh, f64)>,
}

impl Field {
    fn new(mesh: &TriangleMesh, plan: Plan) -> Result<Field, Trouble> {
        let corners = corners(mesh);
        let params = BvhParams::default();
        let (medium, fastest) = (BvhBuildParams::medium_build(), BvhBuildParams::fastest_build());
        Ok(Field {
            exact: built(plan, mesh, &params)?,
            fast: built(plan, &FastMesh(mesh.clone()), &params)?,
            bvh2: vec![
                timed(plan, || Bvh2Mesh::new(&corners, medium)).map(|(m, ms)| ("medium", m, ms))?,
                timed(plan, || Bvh2Mesh::new(&corners, fastest)).map(|(m, ms)| ("fastest", m, ms))?,
            ],
            cwbvh: timed(plan, || CwBvhMesh::new(&corners, medium))?,
            svenstaro: timed(plan, || SvenstaroMesh::new(&corners))?,
            parry: {
                let vertices: Vec<_> =
                    mesh.vertices().iter().map(|v| parry3d::math::Vector::from_array(*v)).collect();
                let make = || TriMesh::new(vertices.clone(), mesh.triangles().to_vec()).ok();
                let (made, ms) = timed(plan, make)?;
                made.map(|mesh| (mesh, ms))
            },
        })
    }

    fn contestants<'a>(&'a self, set: &'a RaySet) -> Vec<Contestant<'a>> {
        let label = |exact, build_ms, sah: f32| Label {
            structure: "bvh",
            build_ms,
            sah: Some(sah as f64),
            exact,
            ..Label::default()
        };
        let (exact, exact_ms) = &self.exact;
        let (fast, fast_ms) = &self.fast;
        let count = exact.geometry().triangles().len().max(1) as f64;
        let mut all = vec![
            ours::<f32, _, _>(exact, set, label(true, *exact_ms, exact.structure().sah_cost())),
            ours::<f32, _, _>(fast, set, label(false, *fast_ms, fast.structure().sah_cost())),
        ];
        let mut add = |structure: &str, params: &str, (ms, bytes): (f64, usize), (answers, shoot)| {
            all.push(Contestant {
                structure: structure.into(),
                params: params.into(),
                build_ms: Some(ms),
                bytes_per_prim: Some(bytes as f64 / count),
                sah: None,
                counts: None,
                exact: false,
                answers,
                shoot,
            });
        };
        for (quality, mesh, ms) in &self.bvh2 {
            add("obvhs-bvh2", &format!("{quality} f32 fast"), (*ms, mesh.bytes()), asked(mesh, set));
        }
        let (mesh, ms) = &self.cwbvh;
        add("obvhs-cwbvh", "medium f32 fast", (*ms, mesh.bytes()), asked(mesh, set));
        let (mesh, ms) = &self.svenstaro;
        add("svenstaro-bvh", "f32 fast", (*ms, mesh.bytes()), asked(mesh, set));
        if let Some((mesh, ms)) = &self.parry {
            add("parry3d", "f32 fast", (*ms, mesh.bvh().heap_memory_size()), asked(mesh, set));
        }
        all
    }
}

fn timed<T>(plan: Plan, mut build: impl FnMut() -> T) -> Result<(T, f64), Trouble> {
    build_all(plan, &mut [&mut build]).pop().ok_or(Trouble::Stopped)
}

fn corners(mesh: &TriangleMesh) -> Vec<[Vec3A; 3]> {
    mesh.triangles().iter().map(|t| t.map(|i| Vec3A::from(mesh.vertices()[i as usize]))).collect()
}

/// Somebody who answers rays of `f32`.
trait Rival {
    fn closest(&self, ray: &Ray) -> Option<(u32, f32)>;
    fn any(&self, ray: &Ray) -> bool;
}

/// All answers, and all again for the clock.
fn asked<'a, T: Rival>(rival: &'a T, set: &'a RaySet) -> (Answers, Box<dyn FnMut() + 'a>) {
    let rays = &set.rays;
    if set.kind.is_any() {
        let answers = Answers::Any32(rays.iter().map(|ray| rival.any(ray)).collect());
        let shoot = move || {
            for ray in rays {
                black_box(rival.any(black_box(ray)));
            }
        };
        (answers, Box::new(shoot))
    } else {
        let answers = Answers::Closest32(rays.iter().map(|ray| rival.closest(ray)).collect());
        let shoot = move || {
            for ray in rays {
                black_box(rival.closest(black_box(ray)));
            }
        };
        (answers, Box::new(shoot))
    }
}

/// The triangles in the order of its leaves.
fn reordered(corners: &[[Vec3A; 3]], order: &[u32]) -> Vec<obvhs::triangle::Triangle> {
    let triangle = |[v0, v1, v2]: [Vec3A; 3]| obvhs::triangle::Triangle { v0, v1, v2 };
    order.iter().map(|&i| triangle(corners[i as usize])).collect()
}

fn theirs(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin, ray.dir, ray.t_min, ray.t_max)
}

struct Bvh2Mesh {
    tree: Bvh2,
    triangles: Vec<obvhs::triangle::Triangle>,
}

impl Bvh2Mesh {
    fn new(corners: &[[Vec3A; 3]], params: BvhBuildParams) -> Bvh2Mesh {
        let all: Vec<u32> = (0..corners.len() as u32).collect();
        let tree = build_bvh2_from_tris(&reordered(corners, &all), params, &mut Duration::default());
        let triangles = reordered(corners, &tree.primitive_indices);
        Bvh2Mesh { tree, triangles }
    }

    fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice()) + size_of_val(self.tree.primitive_indices.as_slice())
    }
}

impl Rival for Bvh2Mesh {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(u32, f32)> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(theirs(ray), &mut hit, |ray, i| self.triangles[i].intersect(ray));
        let prim = self.tree.primitive_indices.get(hit.primitive_id as usize)?;
        Some((*prim, hit.t))
    }
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(theirs(ray), |ray, i| self.triangles[i].intersect(ray))
    }
}

struct CwBvhMesh {
    tree: CwBvh,
    triangles: Vec<obvhs::triangle::Triangle>,
}

impl CwBvhMesh {
    fn new(corners: &[[Vec3A; 3]], params: BvhBuildParams) -> CwBvhMesh {
        let all: Vec<u32> = (0..corners.len() as u32).collect();
        let tree = build_cwbvh_from_tris(&reordered(corners, &all), params, &mut Duration::default());
        let triangles = reordered(corners, &tree.primitive_indices);
        CwBvhMesh { tree, triangles }
    }

    fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice()) + size_of_val(self.tree.primitive_indices.as_slice())
    }
}

impl Rival for CwBvhMesh {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(u32, f32)> {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(theirs(ray), &mut hit, |ray, i| self.triangles[i].intersect(ray));
        let prim = self.tree.primitive_indices.get(hit.primitive_id as usize)?;
        Some((*prim, hit.t))
    }
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(theirs(ray), |ray, i| self.triangles[i].intersect(ray))
    }
}

struct Corner3 {
    corners: [Vec3A; 3],
    prim: u32,
    node: usize,
}

impl Bounded<f32, 3> for Corner3 {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = self.corners;
        Aabb::with_bounds(point(a.min(b).min(c)), point(a.max(b).max(c)))
    }
}

impl BHShape<f32, 3> for Corner3 {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }
    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn point(v: Vec3A) -> Point3<f32> {
    Point3::new(v.x, v.y, v.z)
}

struct SvenstaroMesh {
    tree: ::bvh::bvh::Bvh<f32, 3>,
    triangles: Vec<Corner3>,
}

impl SvenstaroMesh {
    fn new(corners: &[[Vec3A; 3]]) -> SvenstaroMesh {
        let mut triangles: Vec<Corner3> =
            (0..).zip(corners).map(|(prim, &corners)| Corner3 { corners, prim, node: 0 }).collect();
        let tree = ::bvh::bvh::Bvh::build(&mut triangles);
        SvenstaroMesh { tree, triangles }
    }

    fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes.as_slice())
    }

    fn ray(ray: &Ray) -> ::bvh::ray::Ray<f32, 3> {
        let direction = Vector3::new(ray.dir.x, ray.dir.y, ray.dir.z);
        let inv_direction = direction.map(|x| 1.0 / x);
        ::bvh::ray::Ray { origin: point(ray.origin), direction, inv_direction }
    }
}

impl Rival for SvenstaroMesh {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(u32, f32)> {
        let query = Self::ray(ray);
        let mut best = None;
        let mut ray = *ray;
        for triangle in self.tree.nearest_traverse_iterator(&query, &self.triangles) {
            // Boxes come by their entries: nothing after this one is closer.
            if query.intersection_slice_for_aabb(&triangle.aabb()).is_some_and(|(entry, _)| entry > ray.t_max)
            {
                break;
            }
            if let Some((t, _, _)) = moller_trumbore(&ray, triangle.corners) {
                ray.t_max = t;
                best = Some((triangle.prim, t));
            }
        }
        best
    }
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        let query = Self::ray(ray);
        self.tree
            .traverse_iterator(&query, &self.triangles)
            .any(|triangle| moller_trumbore(ray, triangle.corners).is_some())
    }
}

impl Rival for TriMesh {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<(u32, f32)> {
        let vector = |v: Vec3A| parry3d::math::Vector::new(v.x, v.y, v.z);
        let query = parry3d::query::Ray::new(vector(ray.origin), vector(ray.dir));
        CompositeShapeRef(self).cast_local_ray(&query, ray.t_max.min(f32::MAX), true)
    }
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::ControlFlow;

    #[test]
    fn rivals_answer_the_same_rays_and_mostly_rightly() {
        let scenes = Some(vec![Subject::named("soup-500").unwrap()]);
        let options = Options { scenes, ..Options::new(Effort::Quick) };
        let groups = ask(&options, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(groups.len(), 5);
        for group in groups {
            let measured = group.outcome.unwrap();
            assert_eq!(measured.len(), 7);
            assert!(measured[0].error.is_exact());
            for m in &measured {
                assert!(
                    m.error.wrong_per_million() < 20_000.0,
                    "{} {} {:?}",
                    group.ray_kind,
                    m.structure,
                    m.error
                );
            }
        }
    }
}

//! A gallery of curved shapes, each met as what it is: quadrics in part, Bézier and bilinear patches, Julia sets, a fractal terrain;
//! and Loop subdivision surfaces in their cages.
//!
//! These scenes hold few shapes, some of them costly to meet: pictures to look at rather than work for structures. All but
//! [`loops`] hold [`Placed`] shapes, which NFF has no words for.

mod julia;
mod loops;
mod mountains;
mod patches;
mod quadrics;

pub use julia::julia;
pub use loops::loops;
pub use mountains::mountains;
pub use patches::patches;
pub use quadrics::quadrics;

use crate::numbers::turns;
use crate::spd::Pile;
use crate::{Light, Material, Placed, Scene, View, spd};
use rt_geom::Transform;
use rt_geom::glam::{DAffine3, DMat3, DVec3};
use rt_shapes::{Shape, Uv};
use std::sync::Arc;

/// The backdrop.
const DUSK: [f32; 3] = [0.3, 0.36, 0.46];

impl Pile {
    fn placed(
        &mut self,
        what: &'static str,
        shape: impl Shape<f64, At = Uv> + 'static,
        to: Transform,
        material: u32,
    ) {
        self.push(Placed::new(what, Arc::new(shape), to), material);
    }

    /// `2 n x 2 n` squares around the z axis at a height, of two materials in turn.
    fn board(&mut self, n: i32, side: f64, height: f64, materials: [u32; 2]) {
        let place = |i: i32, j: i32| DVec3::new(f64::from(i) * side, f64::from(j) * side, height);
        for i in -n..n {
            for j in -n..n {
                let corners = [place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)];
                self.polygon(&corners, materials[(i + j).rem_euclid(2) as usize]);
            }
        }
    }

    /// The exhibition: z is up.
    fn exhibition(self, name: &str, materials: Vec<Material>, lights: Vec<Light>, view: View) -> Scene {
        Scene { lights, view, background: DUSK, ..self.scene(name, materials) }
    }
}

fn view(from: [f64; 3], at: [f64; 3], degrees: f64) -> View {
    spd::view(from, at, [0.0, 0.0, 1.0], degrees)
}

/// A strong warm light and a weak cool one.
fn lamps(key: [f64; 3], fill: [f64; 3]) -> Vec<Light> {
    let light = |position, color| Light { position: DVec3::from_array(position), color };
    vec![light(key, [0.9, 0.82, 0.7]), light(fill, [0.25, 0.3, 0.4])]
}

/// A colour with a highlight and a faint mirror.
fn glazed(color: [f32; 3]) -> Material {
    Material { color, kd: 0.8, ks: 0.15, shine: 60.0, ..Material::default() }
}

/// A colour that scatters all light.
fn matt(color: [f32; 3]) -> Material {
    Material { color, kd: 0.85, ..Material::default() }
}

/// Turned about z by a share of a turn, counter-clockwise, then leant over about x; scaled; then moved.
fn place(turned: f64, leant: f64, scale: f64, to: DVec3) -> Transform {
    let ((s, c), (sx, cx)) = (turns(turned), turns(leant));
    let about_z = DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(-s, c, 0.0), DVec3::Z);
    let about_x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cx, sx), DVec3::new(0.0, -sx, cx));
    let map = DAffine3 { matrix3: about_x * about_z * scale, translation: to };
    Transform::new(map).expect("a generator's place")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SceneGeometry, Solid};
    use rt_accel::{Aggregate, Exhaustive, Primitive};
    use rt_geom::Ray;

    /// What the middle of the picture shows, and a ring around it.
    #[test]
    fn each_is_seen() {
        let scenes = [quadrics(9), patches(1), julia(1), loops(2), mountains(5)];
        for scene in scenes.map(Result::unwrap) {
            let SceneGeometry::Solids(solids) = scene.geometry.clone() else { panic!("{}", scene.name) };
            let kinds = |kind: fn(&Solid) -> bool| solids.iter().filter(|solid| kind(solid)).count();
            assert_eq!(kinds(|solid| matches!(solid, Solid::Placed(_))) == 0, scene.name == "loop");
            assert_eq!(solids.len(), scene.material_of.len());
            assert!(scene.material_of.iter().all(|&m| (m as usize) < scene.materials.len()));
            let shape = Aggregate::<Exhaustive, _>::build(solids, &()).unwrap();
            let ahead = scene.view.at - scene.view.from;
            assert!(shape.intersect_p(&Ray::new(scene.view.from, ahead)), "{}", scene.name);
            assert!(
                shape.intersect_p(&Ray::new(scene.view.from.as_vec3a(), ahead.as_vec3a())),
                "{}",
                scene.name
            );
        }
    }

    #[test]
    fn sizes_end_where_they_are_said_to() {
        let bad = [
            quadrics(0),
            quadrics(13),
            patches(0),
            patches(33),
            julia(0),
            julia(7),
            loops(9),
            mountains(0),
            mountains(16),
        ];
        assert!(bad.iter().all(Result::is_err));
        assert!([quadrics(12), patches(2), julia(6), loops(0), mountains(1)].iter().all(Result::is_ok));
    }
}

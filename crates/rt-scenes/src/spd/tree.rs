//! [`tree`]: a tree on a field.

use super::{Pile, SKY, view};
use crate::numbers::turn;
use crate::scene::sized;
use crate::{Light, Material, Scene, SceneError};
use rt_geom::glam::{DMat3, DVec3};

/// A tree that forks `size` times, on a field, `tree`: each branch a cone and a sphere that hides its upper end.
///
/// Primitive 0 is the field. `2^(size + 1) - 1` of each follow, each branch before those that grow from it: 4095 of each at the
/// default size of 11, at most 1 048 575 at size 19. The field is 100 wide, the tree 3: most of the scene is in a small part of its
/// box, `[-50, 50]^2 x [0, 3.13749]`.
///
/// Source: Haines, *Standard Procedural Databases*, `tree`; Aono and Kunii, "Botanical tree image generation", *IEEE Computer
/// Graphics and Applications* 4(5), 1984.
///
/// # Errors
///
/// Beyond size 19.
pub fn tree(size: u32) -> Result<Scene, SceneError> {
    let depth = sized("tree", size, 0, 19)?;
    let mut pile = Pile::new((4 << depth) - 1);
    let field = [(50.0, 50.0), (-50.0, 50.0), (-50.0, -50.0), (50.0, -50.0)];
    pile.polygon(&field.map(|(x, y)| DVec3::new(x, y, 0.0)), 0);
    let forks = [(40, 90, 0.65), (25, 230, 0.70)].map(|(branch, around, shrink)| {
        let ((bs, bc), (s, c)) = (turn(branch, 360), turn(around, 360));
        let about_x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, bc, bs), DVec3::new(0.0, -bs, bc));
        let about_z = DMat3::from_cols(DVec3::new(c, s, 0.0), DVec3::new(-s, c, 0.0), DVec3::Z);
        about_z * about_x * shrink
    });
    grow(&mut pile, &forks, DMat3::IDENTITY, DVec3::ZERO, 1.0, depth);
    let grass = Material { color: [0.2, 0.7, 0.2], ..Material::default() };
    let bark = Material { color: [0.55, 0.4, 0.2], ..Material::default() };
    let lights = [
        [-5.0, 5.0, 50.0],
        [30.0, -30.0, 30.0],
        [-40.0, -30.0, 20.0],
        [10.0, 30.0, 40.0],
        [-30.0, 40.0, 10.0],
        [50.0, 25.0, 20.0],
        [-10.0, -60.0, 30.0],
    ];
    Ok(Scene {
        lights: Light::shared(&lights),
        view: view([4.5, 0.4, 2.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.0], 45.0),
        background: SKY,
        ..pile.scene("tree", vec![grass, bark])
    })
}

fn grow(pile: &mut Pile, forks: &[DMat3; 2], along: DMat3, base: DVec3, thick: f64, depth: u32) {
    let apex = base + along.z_axis;
    let thin = thick * 0.67;
    pile.frustum([base, apex], [0.15 * thick, 0.15 * thin], 1);
    pile.sphere(apex, 0.15 * thin, 1);
    if depth > 0 {
        for fork in forks {
            grow(pile, forks, along * *fork, apex, thin, depth - 1);
        }
    }
}

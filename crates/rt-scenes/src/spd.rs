//! Scenes of the Standard Procedural Databases.
//!
//! Source: Haines, "A proposal for standard graphics environments", *IEEE Computer Graphics and Applications* 7(11), 1987, 3-5,
//! and his *Standard Procedural Databases* 3.14. The rules are derived again from what the databases contain; no program of
//! theirs is copied. Generators compute in `f64`.
//!
//! [`KNOWN`] is what renderers of these scenes are held to: how many rays they take.

mod balls;
mod gears;
mod jacks;
mod lattice;
mod mount;
mod rings;
mod shells;
mod sombrero;
mod teapot;
mod tetra;
mod tree;

pub use balls::balls;
pub(crate) use balls::balls_of_triangles;
pub use gears::gears;
pub use jacks::jacks;
pub use lattice::lattice;
pub use mount::mount;
pub use rings::rings;
pub use shells::shells;
pub use sombrero::sombrero;
pub use teapot::teapot;
pub use tetra::tetra;
pub use tree::tree;

use crate::{Light, Material, Scene, SceneGeometry, Solid, View};
use rt_geom::glam::DVec3;
use rt_shapes::{Frustum, Polygon, Sphere};

/// The sky of most SPD scenes.
pub(crate) const SKY: [f32; 3] = [0.078, 0.361, 0.753];

/// What is known of a scene in one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// The scene.
    pub scene: &'static str,
    /// Its size.
    pub size: u32,
    /// How many primitives it has.
    pub primitives: usize,
    /// Haines' count of eye rays that hit, reflected, refracted and shadow rays, to which all renderers should come within a tenth;
    /// where he gives one.
    pub haines: Option<[u64; 4]>,
    /// The same four, then shadow rays that hit, reflected and refracted rays that hit, and rays that would be refracted but for
    /// total reflection: by brute force in `f64`, where all rules are kept.
    pub rays: [u64; 7],
}

/// Ray counts of the scenes, in pictures of 512 x 512 pixels, which take 513 x 513 eye rays.
///
/// Sources: Haines, *Standard Procedural Databases*, version 3.14, for his; recomputed from the NFF files of the databases with six
/// digits, by a program of another make, for the rest.
#[rustfmt::skip]
pub const KNOWN: [Known; 20] = [
    known("balls", 2, 92, None, [263_169, 113_455, 0, 874_391, 185_362, 68_430, 0]),
    known("balls", 3, 821, None, [263_169, 148_743, 0, 918_297, 238_927, 99_922, 0]),
    known("balls", 4, 7_382, Some([263_169, 175_095, 0, 954_368]), [263_169, 175_921, 0, 954_971, 287_384, 126_753, 0]),
    known("gears", 2, 1_169, None, [243_148, 447_618, 296_962, 2_769_246, 1_553_497, 561_614, 6_824]),
    known("gears", 4, 9_345, Some([245_086, 304_643, 207_564, 2_246_955]), [245_332, 305_430, 200_953, 2_253_531, 1_224_964, 384_049, 7_594]),
    known("jacks", 3, 657, None, [72_540, 119_805, 0, 97_780, 33_569, 49_864, 0]),
    known("lattice", 6, 1_225, None, [250_612, 212_227, 0, 1_122_201, 787_683, 134_792, 0]),
    known("lattice", 12, 8_281, None, [261_170, 237_005, 0, 1_163_406, 926_881, 175_456, 0]),
    known("mount", 4, 516, None, [173_250, 356_178, 356_178, 411_518, 248_460, 476_956, 0]),
    known("mount", 6, 8_196, Some([173_125, 354_769, 354_769, 412_922]), [173_686, 356_178, 356_178, 414_445, 254_279, 476_908, 0]),
    known("rings", 3, 841, None, [263_169, 179_452, 0, 942_809, 323_232, 93_721, 0]),
    known("rings", 7, 8_401, Some([263_169, 315_236, 0, 1_085_002]), [263_169, 315_863, 0, 1_084_970, 515_841, 179_785, 0]),
    known("shells", 5, 5_761, None, [79_186, 87_794, 0, 84_732, 1_582, 8_608, 0]),
    known("sombrero", 1, 1_922, None, [112_209, 0, 0, 110_241, 2_247, 0, 0]),
    known("teapot", 6, 2_292, None, [161_449, 224_760, 0, 406_020, 38_279, 65_928, 0]),
    known("teapot", 12, 9_264, Some([161_120, 225_248, 0, 407_656]), [161_546, 226_314, 0, 409_579, 38_926, 67_732, 0]),
    known("tetra", 5, 1_024, None, [53_807, 0, 0, 50_135, 4_651, 0, 0]),
    known("tetra", 6, 4_096, Some([49_788, 0, 0, 46_112]), [49_950, 0, 0, 46_261, 5_557, 0, 0]),
    known("tree", 8, 1_023, None, [166_903, 0, 0, 1_088_877, 38_171, 0, 0]),
    known("tree", 11, 8_191, Some([169_836, 0, 0, 1_097_419]), [169_909, 0, 0, 1_097_835, 43_396, 0, 0]),
];

const fn known(
    scene: &'static str,
    size: u32,
    primitives: usize,
    haines: Option<[u64; 4]>,
    rays: [u64; 7],
) -> Known {
    Known { scene, size, primitives, haines, rays }
}

pub(crate) fn view(from: [f64; 3], at: [f64; 3], up: [f64; 3], degrees: f64) -> View {
    let [from, at, up] = [from, at, up].map(DVec3::from_array);
    View { from, at, up, angle: degrees.to_radians() }
}

/// Solids and their looks, while a scene is being made. Dimensions are a generator's own, so that none is refused.
pub(crate) struct Pile {
    solids: Vec<Solid>,
    material_of: Vec<u32>,
}

impl Pile {
    pub(crate) fn new(count: usize) -> Pile {
        Pile { solids: Vec::with_capacity(count), material_of: Vec::with_capacity(count) }
    }

    pub(crate) fn push(&mut self, solid: impl Into<Solid>, material: u32) {
        self.solids.push(solid.into());
        self.material_of.push(material);
    }

    pub(crate) fn sphere(&mut self, center: DVec3, radius: f64, material: u32) {
        self.push(Sphere::new(center, radius).expect("a generator's sphere"), material);
    }

    pub(crate) fn polygon(&mut self, corners: &[DVec3], material: u32) {
        self.push(Polygon::new(corners).expect("a generator's polygon"), material);
    }

    pub(crate) fn frustum(&mut self, [base, top]: [DVec3; 2], [r0, r1]: [f64; 2], material: u32) {
        self.push(Frustum::new(base, r0, top, r1).expect("a generator's frustum"), material);
    }

    /// The scene, without lights and not looked at.
    pub(crate) fn scene(self, name: &str, materials: Vec<Material>) -> Scene {
        Scene {
            name: name.to_string(),
            geometry: SceneGeometry::Solids(self.solids),
            materials,
            material_of: self.material_of,
            lights: Vec::<Light>::new(),
            view: view([0.0; 3], [0.0; 3], [0.0; 3], 0.0),
            background: SKY,
            warnings: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::by_name;

    /// The sizes whose counts follow from the rules.
    #[test]
    fn primitives_are_as_many_as_the_rules_say() {
        let count = |name, size| by_name(name, Some(size)).unwrap().prim_count();
        for n in 1..=7u32 {
            let m = n as usize;
            assert_eq!(count("tetra", n), 4usize.pow(n));
            assert_eq!(count("mount", n), 2 * 4usize.pow(n) + 4);
            assert_eq!(count("tree", n), 4 * 2usize.pow(n) - 1);
            assert_eq!(count("rings", n), 10 * m * (m + 1) * (2 * m + 1) + 1);
            assert_eq!(count("teapot", n), 65 * m * m - 8 * m);
            assert_eq!(count("lattice", n), (m + 1).pow(3) + 3 * m * (m + 1).pow(2));
            assert_eq!(count("shells", n), 180 * 2usize.pow(n) + 1);
        }
        assert_eq!([1, 2, 3, 5, 9].map(|n| count("gears", n)), [147, 1_169, 3_943, 18_251, 106_435]);
        assert_eq!([0, 1, 2, 5].map(|n| count("balls", n)), [2, 11, 92, 66_431]);
        assert_eq!([1, 2, 3, 4, 5].map(|n| count("jacks", n)), [9, 81, 657, 5_265, 42_129]);
        assert_eq!([1, 2, 3, 4].map(|n| count("sombrero", n)), [1_922, 7_938, 32_258, 130_050]);
        assert_eq!(
            [count("teapot", 40), count("lattice", 29), count("tree", 15)],
            [103_680, 105_300, 131_071]
        );
    }

    #[test]
    fn boxes_are_as_published() {
        let inside = |name, size, min: [f32; 3], max: [f32; 3]| {
            let bound = by_name(name, Some(size)).unwrap().world_bound();
            let near = |a: [f32; 3], b: [f32; 3]| {
                a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.01e-4 * b.abs().max(1.0))
            };
            let (low, high) = (bound.min.to_array(), bound.max.to_array());
            assert!(near(low, min) && near(high, max), "{name}: {bound:?}");
        };
        inside("gears", 4, [-2.0, -2.0, 0.0], [2.0, 2.0, 1.0]);
        inside("mount", 6, [-1.15961, -1.0, -0.70295], [1.0, 1.15961, 1.37821]);
        inside("teapot", 12, [-4.0, -4.0, 0.0], [4.0, 4.0, 3.15]);
        inside("tree", 11, [-50.0, -50.0, 0.0], [50.0, 50.0, 3.13749]);
        inside("lattice", 12, [-1.0 / 48.0; 3], [1.0 + 1.0 / 48.0; 3]);
        inside("shells", 5, [-27.3134, -21.5798, -50.706], [17.0498, 33.804, -0.0035]);
        inside("jacks", 1, [-0.85477, -0.79952, -0.76035], [0.85477, 0.79952, 0.76035]);
        inside("rings", 7, [-10.8389, 1.65358, -9.33895], [8.83895, 20.905, 10.3389]);
    }

    #[test]
    fn primitives_are_as_many_as_published() {
        for known in KNOWN {
            let scene = by_name(known.scene, Some(known.size)).unwrap();
            assert_eq!(scene.prim_count(), known.primitives, "{} {}", known.scene, known.size);
            assert!(
                known.scene == "tetra"
                    || known.scene == "sombrero"
                    || scene.material_of.len() == known.primitives
            );
            assert!(scene.material_of.iter().all(|&m| (m as usize) < scene.materials.len()));
        }
    }
}

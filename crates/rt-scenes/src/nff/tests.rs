use super::*;
use crate::{by_name, names};
use proptest::prelude::*;

fn again(scene: &Scene) -> Scene {
    let mut file = Vec::new();
    write(scene, &mut file).unwrap();
    read(&file, &scene.name).unwrap()
}

/// Triangles by their corners and normals, whatever the numbers of their vertices.
fn facets(geometry: &SceneGeometry) -> Vec<Solid> {
    let all = |mesh: rt_shapes::TriangleMesh<f64>| Facet::all(mesh).into_iter().map(Solid::from).collect();
    match geometry {
        SceneGeometry::Solids(solids) => solids.clone(),
        SceneGeometry::FineMesh(mesh) => all(mesh.clone()),
        SceneGeometry::Mesh(mesh) => {
            let wide = mesh.vertices().iter().map(|v| v.map(f64::from)).collect();
            let wide = numbers::mesh(wide, mesh.triangles().to_vec());
            all(if mesh.normals().is_empty() {
                wide
            } else {
                wide.with_normals(mesh.normals().to_vec()).unwrap()
            })
        }
    }
}

/// Why it is not written, having seen that nothing of it was.
fn refusal(scene: &Scene) -> String {
    let mut file = Vec::new();
    let error = write(scene, &mut file).unwrap_err();
    assert_eq!((error.kind(), file.len()), (std::io::ErrorKind::InvalidData, 0));
    error.to_string()
}

#[test]
fn what_is_written_and_read_is_the_same() {
    let mut left = Vec::new();
    for name in names() {
        let size = match name {
            "soup" | "clusters" | "sticks" | "needles" | "rubble" => Some(300),
            "terrain" => Some(30),
            _ => by_name(name, Some(2)).map_or(Some(3), |_| Some(2)),
        };
        let scene = by_name(name, size).unwrap();
        let placed = |solid: &Solid| matches!(solid, Solid::Placed(_));
        if matches!(&scene.geometry, SceneGeometry::Solids(solids) if solids.iter().any(placed)) {
            left.push(refusal(&scene));
            continue;
        }
        let back = again(&scene);
        assert!(back.warnings.is_empty(), "{name}: {:?}", back.warnings);
        assert_eq!(facets(&back.geometry), facets(&scene.geometry), "{name}");
        let kind = std::mem::discriminant::<SceneGeometry>;
        assert_eq!(kind(&back.geometry), kind(&scene.geometry), "{name}");
        let same = |prim| back.material(prim) == scene.material(prim);
        assert!((0..scene.prim_count() as u32).all(same), "{name}");
        assert_eq!((back.lights, back.view), (scene.lights, scene.view), "{name}");
        assert_eq!((back.background, back.name), (scene.background, scene.name));
    }
    let words = "which NFF has no word for";
    assert_eq!(
        left,
        [
            format!("patches: solid 0 is a Bézier patch, {words}"),
            format!("quadrics: solid 144 is a quadric, {words}"),
            format!("julia: solid 1 is a Julia set, {words}"),
            format!("mountains: solid 0 is a fractal terrain, {words}"),
        ]
    );
    let mesh = numbers::mesh(vec![[0.0f32; 3], [f32::NAN; 3]], vec![[0, 0, 0], [0, 1, 1]]);
    let scene = scene::framed("odd".into(), SceneGeometry::Mesh(mesh), View::framing(&Aabb::EMPTY));
    assert_eq!(refusal(&scene), "odd: triangle 1 has a vertex that is not finite");
}

#[test]
fn blanks_and_lines_mean_nothing() {
    let plain = "v from 1 2 3 at 0 0 0 up 0 0 1 angle 45 hither 1 resolution 512 512 b 0 0 0 l 1 2 3 l 1 1 1 .5 .5 .5\n\
                 f 1 1 1 .5 .5 3 0 1 s 0 0 0 1 c 0 0 0 1 0 0 2 .5 p 4 0 0 0 1 0 0 1 1 0 0 1 0 \
                 pp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1";
    let scene = read(plain.as_bytes(), "x").unwrap();
    assert_eq!(scene.prim_count(), 4);
    let strength = 2f32.sqrt() / 4.0;
    assert_eq!((scene.lights[0].color, scene.lights[1].color), ([strength; 3], [0.5; 3]));
    assert_eq!(scene.view.angle, 45f64.to_radians());
    for blank in ["\n", "\r\n", "\t \n", " # anything, even 1 2 3\n", "\n#\n"] {
        assert_eq!(read(plain.replace(' ', blank).as_bytes(), "x").unwrap(), scene, "{blank:?}");
    }
    let shuffled = plain.replace("from 1 2 3 at 0 0 0", "at 0 0 0 from 1 2 3");
    assert_eq!(read(shuffled.as_bytes(), "x").unwrap(), scene);
}

#[test]
fn faults_are_named() {
    let fault = |text: &str| read(text.as_bytes(), "x.nff").unwrap_err().to_string();
    for (text, says) in [
        ("", "x.nff: holds nothing to hit"),
        ("# nothing\nb 0 0 0\n", "x.nff: holds nothing to hit"),
        ("\n\nq 1", "x.nff:3: \"q\" begins nothing: there are v, b, l, f, c, s, p and pp"),
        ("s 0 0", "x.nff:1: the file ends before the centre of a sphere"),
        ("s 0 0 0", "x.nff:1: the file ends before the radius of a sphere"),
        ("s 0\n0,5 0 1", "x.nff:2: the centre of a sphere must be a number, not \"0,5\""),
        ("s 0 0 nan 1", "x.nff:1: the centre of a sphere must be finite, not nan"),
        ("s 0 0 1e999 1", "x.nff:1: the centre of a sphere must be finite, not 1e999"),
        ("s 0 0 0\n0", "x.nff:2: sphere radius 0 is not a positive number"),
        ("f 1 1 1e39 1 0 0 0 1", "x.nff:1: a surface's colour must be finite, not 1e39"),
        ("p 2 0 0 0 1 1 1", "x.nff:1: a polygon needs a whole number of corners, 3 or more, not 2"),
        ("p 3.5", "x.nff:1: a polygon needs a whole number of corners, 3 or more, not 3.5"),
        ("p 4000000000 0 0 0", "x.nff:1: the file ends before a corner"),
        ("p 3 0 0 0 1 0 0 0 1 s", "x.nff:1: a corner must be a number, not \"s\""),
        ("v from 0 0 0 at 1 0 0 up 0 0 1", "x.nff:1: the file ends before the angle of the view"),
        ("v\nangle 180\n", "x.nff:2: the field of view must be between 0 and 180 degrees, not 180"),
        (
            "v\nfrom 1e300 0 0\nat -1e300 0 0\nup 0 0 1\nangle 45\ns 0 0 0 1",
            "x.nff:5: the view looks from 1e300 0.0 0.0 at -1e300 0.0 0.0: so far that the square of the distance is no number",
        ),
        (
            "s 0 0 0 1\nv from 1 2 3\nat 1 2 3\nup 0 0 1 angle 45",
            "x.nff:4: the view looks from 1.0 2.0 3.0 at the same point",
        ),
    ] {
        assert_eq!(fault(text), says, "{text}");
    }
    assert_eq!(read(b"s 0 0 0 1\n\xff\xfe", "x").unwrap_err().problem, NffProblem::NotText);
    // But for the mark that a file of UTF-8 may begin with.
    assert_eq!(read(b"\xef\xbb\xbfs 0 0 0 1\n", "x").unwrap().prim_count(), 1);
    let inner = read(b"s 0 0 0 1\n\xef\xbb\xbfs 0 0 0 1\n", "x").unwrap_err();
    assert!(matches!(inner.problem, NffProblem::Unknown(_)) && inner.line == Some(2), "{inner}");
    let folder = std::env::temp_dir();
    assert_eq!(load(&folder).unwrap_err().problem, NffProblem::Directory);
    let missing = load(folder.join("there is no such file.nff")).unwrap_err();
    assert!(matches!(missing.problem, NffProblem::Unreadable(_)), "{missing}");
}

#[test]
fn what_is_odd_is_kept_and_said() {
    let scene = read(b"p 3 0 0 0 1 1 1 2 2 2 p 4 0 0 0 1 0 0 2 0 0 3 0 0 s 0 0 0 -2\n", "x").unwrap();
    assert_eq!((scene.prim_count(), scene.warnings.len()), (4, 3));
    assert!(scene.view.from.is_finite() && scene.material(0) == Material::default());
    // Corners that f32 rounds together; those that it does not.
    let near = read(b"p 3 1e7 0 0 10000000.001 0 0 1e7 1 0", "x").unwrap();
    assert!(matches!(near.geometry, SceneGeometry::FineMesh(_)));
    let apart = read(b"p 3 .1 0 0 .2 0 0 .1 1 0 pp 3 0 0 0 1 0 0 1 0 0 0 0 1 0 1 0 0 0 1", "x").unwrap();
    let SceneGeometry::Mesh(mesh) = &apart.geometry else { panic!() };
    assert_eq!((mesh.normals().len(), mesh.normals()[0]), (6, [0.0; 3]));
    assert_eq!(facets(&again(&apart).geometry), facets(&apart.geometry));
}

proptest! {
    #[test]
    fn no_file_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = read(&bytes, "x");
    }

    #[test]
    fn no_words_panic(words in proptest::collection::vec("v|b|l|f|c|s|p|pp|3|4|-1|0|1e308|0.5|from|angle|#", 0..60)) {
        if let Ok(scene) = read(words.join(" ").as_bytes(), "x") {
            let back = again(&scene);
            prop_assert_eq!(back.prim_count(), scene.prim_count());
        }
    }

    #[test]
    fn every_vertex_comes_back(x in any::<f32>(), y in any::<f32>(), z in any::<f32>()) {
        prop_assume!(x.is_finite() && y.is_finite() && z.is_finite());
        // A number whose digits f64 rounds to the middle of two of f32.
        let mesh = numbers::mesh(vec![[7.038531e-26, y, z], [x, 1.0, z], [x, y, 2.0]], vec![[0, 1, 2]]);
        let geometry = SceneGeometry::Mesh(mesh);
        let scene = scene::framed("x".into(), geometry, View::framing(&Aabb::EMPTY));
        prop_assert_eq!(again(&scene).geometry, scene.geometry);
    }

    #[test]
    fn every_number_comes_back(x in any::<f64>(), y in any::<f32>()) {
        prop_assume!(x.is_finite() && x != 0.0 && y.is_finite());
        let ball = Solid::from(Sphere::new(DVec3::new(x, -x, y.into()), x.abs()).unwrap());
        let geometry = SceneGeometry::Solids(vec![ball]);
        let look = Material { kd: y, ..Material::default() };
        let scene = scene::framed("x".into(), geometry, View::framing(&Aabb::EMPTY));
        let scene = Scene { materials: vec![look], ..scene };
        let back = again(&scene);
        prop_assert_eq!(back.geometry, scene.geometry);
        prop_assert_eq!(back.materials[0].kd, y);
    }
}

//! Wavefront OBJ files, read strictly: what is wrong is named by file, line and value.
//!
//! | In the file | Here |
//! | --- | --- |
//! | faces of more than three corners, concave ones too | cut into triangles |
//! | `v`, `v/vt`, `v//vn`, `v/vt/vn`, also counted back from the last | all read; corners without a normal are shaded flat |
//! | a fourth number after a vertex | divides the other three |
//! | colours of vertices, groups, objects, smoothing | passed over |
//! | points, lines, curves, unknown words | passed over, with a warning |
//! | triangles without area | kept, never hit, with a warning |
//! | a material library that is not there, or a bad line in one | a warning; the look is the default one |
//! | vertices that are not finite, numbers and indices that are none | an error |
//!
//! The grammar is read by `tobj`. Before, each line is checked here and written anew, because `tobj` reads lines as faces,
//! misplaces normals that only some corners have, takes NaN for a coordinate, and never says where it failed.
//!
//! ```
//! let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
//! let scene = rt_scenes::obj::read(square, "square.obj")?;
//! assert_eq!(scene.prim_count(), 2);
//!
//! let error = rt_scenes::obj::read(b"v 0 0 0\nf 1 2 3\n", "short.obj").unwrap_err();
//! assert_eq!(error.to_string(), "short.obj:2: vertex 3 does not exist: there is 1");
//! # Ok::<(), rt_scenes::obj::ObjError>(())
//! ```

mod clean;
mod materials;

use crate::{Material, Scene, SceneGeometry, View, scene};
use core::fmt;
use rt_geom::glam::DVec3;
use rt_shapes::{MeshError, Polygon, TriangleMesh};
use std::cell::RefCell;
use std::io::Cursor;
use std::path::Path;

/// Why a file is not a scene: which file, where, and what is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjError {
    /// The file.
    pub file: String,
    /// The line, from 1, where it is known.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: ObjProblem,
}

/// What is wrong with an OBJ file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ObjProblem {
    /// It cannot be read: the operating system's words.
    Unreadable(String),
    /// It is a directory.
    Directory,
    /// There is nothing in it.
    Empty,
    /// It is not text.
    NotText,
    /// It holds no face.
    NoFaces,
    /// A line ends too soon, or has more numbers than make sense.
    Count {
        /// What the line is about.
        what: &'static str,
        /// How many numbers or corners there must be.
        needed: &'static str,
        /// How many there are.
        found: usize,
    },
    /// Not a number.
    Number(String),
    /// A coordinate that is NaN, infinite, or too large for `f32`.
    NotFinite(String),
    /// A vertex whose fourth number is 0 is nowhere.
    ZeroWeight,
    /// Not a corner of a face, such as `7`, `7/1`, `7//3`, `7/1/3`.
    Corner(String),
    /// A corner is numbered 0; numbers count from 1, or back from -1.
    ZeroIndex(String),
    /// A corner names what does not exist.
    OutOfRange {
        /// What it names: a vertex, texture coordinate or normal.
        what: &'static str,
        /// Its number.
        index: i64,
        /// How many there are.
        count: usize,
    },
    /// There is more than a mesh can hold.
    Mesh(MeshError),
    /// The reader of the grammar refuses it: its words.
    Grammar(String),
}

impl fmt::Display for ObjError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file, self.problem),
            None => write!(f, "{}: {}", self.file, self.problem),
        }
    }
}

impl fmt::Display for ObjProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ObjProblem::Unreadable(why) => write!(f, "cannot be read: {why}"),
            ObjProblem::Directory => write!(f, "is a directory, not a file"),
            ObjProblem::Empty => write!(f, "is empty"),
            ObjProblem::NotText => write!(f, "this is not text, so not an OBJ file"),
            ObjProblem::NoFaces => write!(f, "holds no faces"),
            ObjProblem::Count { what, needed, found } => write!(f, "{what} needs {needed}, not {found}"),
            ObjProblem::Number(value) => write!(f, "{value:?} is not a number"),
            ObjProblem::NotFinite(value) => write!(f, "coordinate {value} is not finite in 32 bits"),
            ObjProblem::ZeroWeight => write!(f, "a vertex divided by 0 is nowhere"),
            ObjProblem::Corner(value) => {
                write!(f, "{value:?} is not a corner: write 7, 7/1, 7//3 or 7/1/3")
            }
            ObjProblem::ZeroIndex(value) => {
                write!(f, "{value:?}: numbers count from 1, or back from -1; 0 names nothing")
            }
            ObjProblem::OutOfRange { what, index, count } => {
                let verb = if *count == 1 { "is" } else { "are" };
                write!(f, "{what} {index} does not exist: there {verb} {count}")
            }
            ObjProblem::Mesh(error) => error.fmt(f),
            ObjProblem::Grammar(why) => write!(f, "{why}"),
        }
    }
}

impl core::error::Error for ObjError {}

/// Reads the OBJ file at `path`, and the material libraries it names from the same folder.
///
/// The scene has a view of the whole mesh, from above, with one light. What was passed over stands in its
/// [`warnings`](Scene::warnings). A million triangles take about two seconds.
///
/// # Errors
///
/// When it cannot be read, or [`read`] fails.
pub fn load(path: impl AsRef<Path>) -> Result<Scene, ObjError> {
    let path = path.as_ref();
    let fail = |problem| ObjError { file: path.display().to_string(), line: None, problem };
    if path.is_dir() {
        return Err(fail(ObjProblem::Directory));
    }
    let bytes = std::fs::read(path).map_err(|error| fail(ObjProblem::Unreadable(error.to_string())))?;
    parse(&bytes, &path.display().to_string(), Some(path.parent().unwrap_or(Path::new(""))))
}

/// Reads the contents of an OBJ file; `name` is what the scene and errors call it. Material libraries are not looked for.
///
/// # Errors
///
/// For a line that is [wrong](ObjProblem), or when there is no face.
pub fn read(bytes: &[u8], name: &str) -> Result<Scene, ObjError> {
    parse(bytes, name, None)
}

/// Past the mark that some editors begin a file of UTF-8 with.
pub(crate) fn past_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

fn parse(bytes: &[u8], name: &str, folder: Option<&Path>) -> Result<Scene, ObjError> {
    let fail = |line, problem| ObjError { file: name.to_string(), line, problem };
    let bytes = past_mark(bytes);
    if bytes.is_empty() {
        return Err(fail(None, ObjProblem::Empty));
    }
    let clean = clean::clean(bytes).map_err(|(line, problem)| fail(line, problem))?;
    let mut warnings = clean.warnings;
    let library = materials::load(&clean.libraries, folder, &mut warnings);
    let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let library = RefCell::new(Some(library));
    let (models, looks) = tobj::load_obj_buf(&mut Cursor::new(clean.text), &options, |_| {
        library.take().ok_or(tobj::LoadError::GenericFailure)
    })
    .map_err(|error| fail(None, ObjProblem::Grammar(error.to_string())))?;

    // The first look is for faces that name none, or one that is not there.
    let looks = looks.unwrap_or_default();
    let mut unknown: Vec<&String> =
        clean.used.iter().filter(|used| !looks.iter().any(|look| look.name == **used)).collect();
    unknown.sort();
    if !unknown.is_empty() {
        warnings.push(format!("materials not found, so drawn in the default look: {unknown:?}"));
    }
    let mut shown = vec![Material::default()];
    shown.extend(looks.iter().map(materials::look));

    let (mut vertices, mut triangles) = (Vec::<[f32; 3]>::new(), Vec::new());
    let (mut normals, mut uvs, mut material_of) = (Vec::new(), Vec::new(), Vec::new());
    for tobj::Model { mesh, .. } in models {
        let len = vertices.len() + mesh.positions.len() / 3;
        if u32::try_from(len).is_err() {
            return Err(fail(None, ObjProblem::Mesh(MeshError::TooManyTriangles { len })));
        }
        let first = vertices.len() as u32;
        vertices.extend(mesh.positions.as_chunks::<3>().0);
        normals.extend(mesh.normals.as_chunks::<3>().0);
        uvs.extend(mesh.texcoords.as_chunks::<2>().0);
        let mut cut = |corners: &[u32]| match corners {
            &[a, b, c] => triangles.push([a, b, c].map(|i| first + i)),
            _ => {
                let place = |&i: &u32| DVec3::from_array(vertices[(first + i) as usize].map(f64::from));
                let places: Vec<DVec3> = corners.iter().map(place).collect();
                // A polygon that has no area becomes triangles that have none.
                let cuts = Polygon::triangulate(&places).unwrap_or_else(|_| {
                    (1..corners.len().saturating_sub(1)).map(|i| [0, i, i + 1]).collect()
                });
                triangles.extend(cuts.into_iter().map(|cut| cut.map(|i| first + corners[i])));
            }
        };
        if mesh.face_arities.is_empty() {
            mesh.indices.as_chunks::<3>().0.iter().for_each(|corners| cut(corners));
        } else {
            let mut rest = &mesh.indices[..];
            for &arity in &mesh.face_arities {
                let (corners, behind) = rest.split_at_checked(arity as usize).unwrap_or((rest, &[]));
                cut(corners);
                rest = behind;
            }
        }
        let number = mesh.material_id.map_or(0, |number| number as u32 + 1);
        material_of.resize(triangles.len(), number);
    }
    if triangles.is_empty() {
        return Err(fail(None, ObjProblem::NoFaces));
    }

    let too_much = |error| fail(None, ObjProblem::Mesh(error));
    let mut mesh = TriangleMesh::new(vertices, triangles).map_err(too_much)?;
    if clean.has_normals {
        mesh = mesh.with_normals(normals).map_err(too_much)?;
    }
    if clean.has_uvs {
        mesh = mesh.with_uvs(uvs).map_err(too_much)?;
    }
    let degenerate = mesh.degenerate();
    if degenerate > 0 {
        let of = mesh.triangles().len();
        warnings.push(format!("{degenerate} of {of} triangles have no area; rays never hit them"));
    }
    if material_of.iter().all(|&number| number == 0) {
        material_of.clear();
        shown.truncate(1);
    }
    let view = View::framing(&scene::bound(&mesh));
    let plain = scene::framed(name.to_string(), SceneGeometry::Mesh(mesh), view);
    Ok(Scene { materials: shown, material_of, warnings, ..plain })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mesh(text: &str) -> TriangleMesh {
        match read(text.as_bytes(), "test.obj").unwrap().geometry {
            SceneGeometry::Mesh(mesh) => mesh,
            other => panic!("{other:?}"),
        }
    }

    fn fault(text: impl AsRef<[u8]>) -> String {
        read(text.as_ref(), "x.obj").unwrap_err().to_string()
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    #[test]
    fn a_byte_order_mark_is_passed_over() {
        let text = format!("{TRIANGLE}f 1 2 3\n");
        assert_eq!(mesh(&format!("\u{feff}{text}")), mesh(&text));
        assert_eq!(fault("\u{feff}"), "x.obj: is empty");
        // One only, and only where the file begins.
        for odd in [format!("\u{feff}\u{feff}{text}"), format!("# a\n\u{feff}{text}")] {
            assert!(fault(odd).contains("this is not text"));
        }
        assert_eq!(fault(b"\xff\xfev\x00"), "x.obj:1: this is not text, so not an OBJ file");
    }

    #[test]
    fn faults_are_named() {
        let with = |line: &str| fault(format!("{TRIANGLE}{line}\n"));
        for (text, says) in [
            (fault(""), "x.obj: is empty"),
            (fault("# nothing\n"), "x.obj: holds no faces"),
            (fault(TRIANGLE), "x.obj: holds no faces"),
            (fault("\u{89}PNG\r\n"), "x.obj:1: this is not text, so not an OBJ file"),
            (fault(b"v 0 0 0\n\xff\xfe\x00"), "x.obj:2: this is not text, so not an OBJ file"),
            (with("f 1 2"), "x.obj:4: a face needs 3 corners or more, not 2"),
            (with("f"), "x.obj:4: a face needs 3 corners or more, not 0"),
            (with("f 1 2 4"), "x.obj:4: vertex 4 does not exist: there are 3"),
            (with("f 1 2 99999999999999"), "x.obj:4: vertex 99999999999999 does not exist: there are 3"),
            (with("f -1 -2 -4"), "x.obj:4: vertex -4 does not exist: there are 3"),
            (with("f 0 1 2"), "x.obj:4: \"0\": numbers count from 1, or back from -1; 0 names nothing"),
            (with("f 1/1 2 3"), "x.obj:4: texture coordinate 1 does not exist: there are 0"),
            (with("f 1//1 2 3"), "x.obj:4: normal 1 does not exist: there are 0"),
            (with("f 1 2 x"), "x.obj:4: \"x\" is not a corner: write 7, 7/1, 7//3 or 7/1/3"),
            (with("f 1 2 /1"), "x.obj:4: \"/1\" is not a corner: write 7, 7/1, 7//3 or 7/1/3"),
            (with("f 1 2 3/1/1/1"), "x.obj:4: \"3/1/1/1\" is not a corner: write 7, 7/1, 7//3 or 7/1/3"),
            (with("f 1 2 3////"), "x.obj:4: \"3////\" is not a corner: write 7, 7/1, 7//3 or 7/1/3"),
            (with("f 1 2 //"), "x.obj:4: \"//\" is not a corner: write 7, 7/1, 7//3 or 7/1/3"),
            (
                with("v 1 2"),
                "x.obj:4: a vertex needs 3 numbers (4 with a weight, 3 more with a colour), not 2",
            ),
            (with("v 1 2 3 0"), "x.obj:4: a vertex divided by 0 is nowhere"),
            (with("v 1 2,5 3"), "x.obj:4: \"2,5\" is not a number"),
            (with("v 1 nan 3"), "x.obj:4: coordinate nan is not finite in 32 bits"),
            (with("v 1 2 -inf"), "x.obj:4: coordinate -inf is not finite in 32 bits"),
            (with("v 1e39 2 3"), "x.obj:4: coordinate 1e39 is not finite in 32 bits"),
            (with("v 1 2 3 1e-45"), "x.obj:4: coordinate inf is not finite in 32 bits"),
            (with("vn 1 0"), "x.obj:4: a normal needs 3 numbers, not 2"),
            (with("usemtl"), "x.obj:4: usemtl needs a name, not 0"),
        ] {
            assert_eq!(text, says);
        }
        let folder = std::env::temp_dir();
        assert_eq!(load(&folder).unwrap_err().problem, ObjProblem::Directory);
        let missing = load(folder.join("there is no such file.obj")).unwrap_err();
        assert!(matches!(missing.problem, ObjProblem::Unreadable(_)), "{missing}");
        assert!(missing.to_string().contains("there is no such file.obj: cannot be read:"), "{missing}");
    }

    #[test]
    fn every_way_to_write_a_triangle() {
        let plain = mesh("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        for text in [
            "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1",
            "  v\t0 0 0 # zero\nv 1 0 0 0.5 0.5 0.5\n#v\nv 0 2 0 2\ng a b\no c\ns off\nf 1 2 3 # face",
            "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n 2 \\\n 3",
            "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
            "v 0e0 +0 -0\nv 1. .0 0\nv 0 1 0\n# caf\u{e9}\nf 1 2 3\nf 1 2 3",
        ] {
            let read = mesh(text);
            assert_eq!(read.vertices(), plain.vertices(), "{text}");
            assert_eq!(read.triangles()[0], [0, 1, 2]);
        }
        let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n# caf\xe9\ng caf\xe9\nf 1 2 3\n";
        assert!(read(text, "latin").is_ok());
    }

    #[test]
    fn attributes_in_every_form() {
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt .5\nvt 1 2 3\nvn 0 0 2\nvn nan 0 0\n";
        let flat = mesh(&format!("{head}f 1 2 3"));
        let all = mesh(&format!("{head}f 1/1/1 2/2/1 3/-1/-2"));
        let some = mesh(&format!("{head}f 1//1 2 3/1"));
        assert_eq!(flat.vertices(), all.vertices());
        assert_ne!(flat, all);
        let square = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].to_vec();
        let made = TriangleMesh::new(square, vec![[0, 1, 2]]).unwrap();
        assert_eq!(flat, made);
        let uvs = |list: [[f32; 2]; 3]| list.to_vec();
        let normals = |list: [[f32; 3]; 3]| list.to_vec();
        let z = [0.0, 0.0, 2.0];
        let expected = made.clone().with_uvs(uvs([[0.5, 0.0], [1.0, 2.0], [1.0, 2.0]])).unwrap();
        assert_eq!(all, expected.with_normals(normals([z; 3])).unwrap());
        let expected = made.with_uvs(uvs([[0.0; 2], [0.0; 2], [0.5, 0.0]])).unwrap();
        assert_eq!(some, expected.with_normals(normals([z, [0.0; 3], [0.0; 3]])).unwrap());
    }

    #[test]
    fn polygons_are_cut_and_the_rest_is_told() {
        // An arrow head, concave at its last corner: a fan from the first corner would leave it.
        let arrow = "v 2 -1 0\nv 0 3 0\nv -2 -1 0\nv 0 0 0\nf 1 2 3 4\n";
        let cut = mesh(arrow);
        let area = |mesh: &TriangleMesh| {
            (0..mesh.triangles().len() as u32)
                .map(|i| mesh.triangle(i).corners)
                .map(|[a, b, c]| (b - a).cross(c - a).z)
                .fold([0.0, 0.0], |[sum, least]: [f64; 2], z| [sum + z, least.min(z)])
        };
        assert_eq!((cut.triangles().len(), area(&cut)), (2, [12.0, 0.0]));

        let scene = read(
            b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2 3\np 1\nl 1 2\nf 1 2 3 4\nf 1 2 2\nf 1 1 1 1\nusemtl red\n\
              mtllib a.mtl\ncurv 0 1 1 2\nf 2 3 4",
            "odd.obj",
        )
        .unwrap();
        assert_eq!(scene.prim_count(), 2 + 1 + 2 + 1);
        assert_eq!(
            scene.warnings,
            [
                "passed over 1 x curv, first in line 13",
                "passed over 2 x lines, first in line 5",
                "passed over 1 x points, first in line 6",
                "material library \"a.mtl\" was not looked for",
                "materials not found, so drawn in the default look: [\"red\"]",
                "3 of 6 triangles have no area; rays never hit them",
            ]
        );
        assert!(scene.material_of.is_empty());
    }

    #[test]
    fn materials_come_from_the_library() {
        let folder = std::env::temp_dir().join(format!("rt-scenes {}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let library = "newmtl red paint\nKd 0.5 0 0\nKs .2 .2 .2\nillum 2\nNs 30\nmap_Kd\nnewmtl glass # 2\n\
                       Kd 0 0 0\nKs 1 1 1\nd 0.1\nNi 1.5\nKd 0.5\nNs\nnewmtl haze\nTr 0.25\nKd 1 1 1\n";
        std::fs::write(folder.join("two words.mtl"), format!("\u{feff}{library}")).unwrap();
        let text = format!(
            "mtllib two words.mtl\nmtllib gone.mtl\n{TRIANGLE}f 1 2 3\nusemtl red paint\nf 1 2 3\nf 3 2 1\nusemtl glass # 2\n\
             f 1 2 3\nusemtl haze\nf 1 2 3\nusemtl nobody\nf 1 2 3"
        );
        std::fs::write(folder.join("a.obj"), text).unwrap();
        let scene = load(folder.join("a.obj")).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(scene.material_of, [0, 1, 1, 2, 3, 0]);
        let red = scene.material(1);
        assert_eq!((red.color, red.kd, red.ks, red.shine), ([1.0, 0.0, 0.0], 0.5, 0.0, 30.0));
        let glass = scene.material(3);
        assert_eq!((glass.color, glass.kd, glass.ks, glass.ior), ([1.0; 3], 0.0, 1.0, 1.5));
        assert!((glass.transmittance - 0.9).abs() < 1e-6);
        assert_eq!(scene.material(4).transmittance, 0.25);
        assert_eq!(scene.material(5), Material::default());
        let warnings = scene.warnings.join("\n");
        for part in ["gone.mtl cannot be read", "two words.mtl:12: passed over \"Kd 0.5\"", "[\"nobody\"]"] {
            assert!(warnings.contains(part), "{part}: {warnings}");
        }
    }

    #[test]
    fn a_large_file_loads() {
        use std::fmt::Write;
        let side = 316;
        let mut text = String::new();
        for i in 0..side * side {
            let (x, y) = ((i % side) as f64, (i / side) as f64);
            let _ = writeln!(text, "v {:.6} {:.6} {:.6}\nvn 0 0 1", x * 0.01, y * 0.01, x * y * 1e-4);
        }
        for i in (0..side * (side - 1)).filter(|i| i % side != side - 1) {
            let [a, b, c, d] = [i + 1, i + 2, i + side + 2, i + side + 1];
            let _ = writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}\nf {a}//{a} {c}//{c} {d}//{d}");
        }
        let mesh = mesh(&text);
        assert_eq!(mesh.triangles().len(), 2 * (side - 1) * (side - 1));
    }

    #[test]
    fn well_known_meshes() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
        for (file, triangles) in [
            ("stanford-bunny", 69_451),
            ("fandisk", 12_946),
            ("beetle-alt", 38_656),
            ("cow", 5_804),
            ("spot", 5_856),
            ("teapot", 6_320),
        ] {
            let path = folder.join(file).with_extension("obj");
            if !path.exists() {
                continue;
            }
            let scene = load(&path).unwrap();
            assert_eq!(scene.prim_count(), triangles, "{file}: {:?}", scene.warnings);
            assert!(scene.world_bound().is_valid());
        }
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = read(&bytes, "noise");
        }

        #[test]
        fn no_lines_panic(lines in prop::collection::vec(
            ("(v|vt|vn|f|l|p|usemtl|mtllib|o|#)", "[-0-9/. e\\\\#naif]{0,16}"), 0..40)) {
            let text: String = lines.iter().map(|(word, rest)| format!("{word} {rest}\n")).collect();
            let _ = read(text.as_bytes(), "noise");
        }
    }
}

//! [`clean`]: the text of an OBJ file, each line checked, and written anew in the plainest form.

use super::ObjProblem;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// What is left of a file.
#[derive(Default)]
pub(super) struct Clean {
    /// Vertices, `f` lines whose corners are all `v/vt/vn`, counted from 1, and `usemtl` lines. Texture coordinate 1 and normal 1 are
    /// zero: those of corners that have none.
    pub(super) text: String,
    /// Whether any corner has a normal.
    pub(super) has_normals: bool,
    /// Whether any corner has texture coordinates.
    pub(super) has_uvs: bool,
    /// What follows each `mtllib`.
    pub(super) libraries: Vec<String>,
    /// The materials used.
    pub(super) used: BTreeSet<String>,
    /// What was passed over.
    pub(super) warnings: Vec<String>,
}

/// A problem and its line.
type Fault = (Option<usize>, ObjProblem);

/// Words that mean nothing to rays.
const SILENT: [&str; 12] = [
    "o",
    "g",
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "usemap",
    "maplib",
    "shadow_obj",
    "trace_obj",
];

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

pub(super) fn clean(bytes: &[u8]) -> Result<Clean, Fault> {
    // Names and comments may be in any encoding; a number or a keyword that is not ASCII is found below.
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::default();
    let mut faces = String::with_capacity(text.len() / 2);
    let mut lines = text.split('\n').enumerate();
    let mut joined = String::new();
    while let Some((number, line)) = lines.next() {
        let mut line = line.trim();
        if line.ends_with('\\') && !line.starts_with('#') {
            joined.clear();
            while let Some(start) = line.strip_suffix('\\') {
                joined.push_str(start);
                joined.push(' ');
                line = lines.next().map_or("", |(_, next)| next.trim());
            }
            joined.push_str(line);
            line = &joined;
        }
        reader.line(line, number + 1, &mut faces).map_err(|problem| (Some(number + 1), problem))?;
    }
    reader.finish(faces)
}

#[derive(Default)]
struct Reader {
    out: Clean,
    /// How many vertices, texture coordinates and normals there were so far.
    counts: [usize; 3],
    /// The greatest number of each that a face named, and the line.
    greatest: [(usize, usize); 3],
    /// Normals that are not finite.
    bad_normals: usize,
    /// Keywords passed over: how often, and where first.
    passed: BTreeMap<String, (usize, usize)>,
}

impl Reader {
    fn line(&mut self, line: &str, number: usize, faces: &mut String) -> Result<(), ObjProblem> {
        if line.contains('\0') {
            return Err(ObjProblem::NotText);
        }
        let keyword = line.split_whitespace().next().unwrap_or("");
        let rest = &line[keyword.len()..];
        // A number sign ends a line of numbers, but may be part of a name.
        let words = || rest.split('#').next().unwrap_or("").split_whitespace();
        match keyword {
            "" => {}
            _ if keyword.starts_with('#') => {}
            "v" => self.vertex(words())?,
            "vt" => self.uv(words())?,
            "vn" => self.normal(words())?,
            "f" => self.face(words(), number, faces)?,
            "usemtl" => {
                let name = rest.trim();
                if name.is_empty() {
                    return Err(ObjProblem::Count { what: "usemtl", needed: "a name", found: 0 });
                }
                let _ = writeln!(faces, "usemtl {name}");
                self.out.used.insert(name.to_string());
            }
            "mtllib" => self.out.libraries.push(rest.trim().to_string()),
            _ if SILENT.contains(&keyword) => {}
            _ if !keyword.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') => {
                return Err(ObjProblem::NotText);
            }
            _ => self.passed.entry(keyword.to_string()).or_insert((0, number)).0 += 1,
        }
        Ok(())
    }

    fn vertex<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), ObjProblem> {
        let mut at = [0.0f32; 4];
        let mut found = 0;
        let start = self.out.text.len();
        self.out.text.push('v');
        for word in words {
            let value = parsed(word)?;
            if let Some(slot) = at.get_mut(found) {
                *slot = value;
            }
            if found < 3 {
                self.coordinate(word, value)?;
                self.out.text.push(' ');
                self.out.text.push_str(word);
            }
            found += 1;
        }
        match found {
            // With a colour, or without.
            3 | 6 => self.out.text.push('\n'),
            // With a weight; and a colour.
            4 | 7 => {
                let [x, y, z, w] = at;
                if w == 0.0 {
                    return Err(ObjProblem::ZeroWeight);
                }
                let divided = [x, y, z].map(|value| value / w);
                for value in divided {
                    self.coordinate(&format!("{value}"), value)?;
                }
                self.out.text.truncate(start);
                self.write("v", &divided);
            }
            _ => {
                let needed = "3 numbers (4 with a weight, 3 more with a colour)";
                return Err(ObjProblem::Count { what: "a vertex", needed, found });
            }
        }
        self.counts[0] += 1;
        Ok(())
    }

    fn uv<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), ObjProblem> {
        let mut at = [0.0f32; 3];
        let mut found = 0;
        for word in words {
            let value = parsed(word)?;
            self.coordinate(word, value)?;
            if let Some(slot) = at.get_mut(found) {
                *slot = value;
            }
            found += 1;
        }
        if !(1..=3).contains(&found) {
            return Err(ObjProblem::Count { what: "a texture coordinate", needed: "1 to 3 numbers", found });
        }
        self.write("vt", &at[..2]);
        self.counts[1] += 1;
        Ok(())
    }

    fn normal<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), ObjProblem> {
        let mut at = [0.0f32; 3];
        let mut found = 0;
        for word in words {
            let value = parsed(word)?;
            if let Some(slot) = at.get_mut(found) {
                *slot = value;
            }
            found += 1;
        }
        if found != 3 {
            return Err(ObjProblem::Count { what: "a normal", needed: "3 numbers", found });
        }
        // Exporters write NaN for the normals of triangles without area: those are shaded flat, if seen at all.
        if !at.iter().all(|value| value.is_finite()) {
            self.bad_normals += 1;
            at = [0.0; 3];
        }
        self.write("vn", &at);
        self.counts[2] += 1;
        Ok(())
    }

    fn coordinate(&self, word: &str, value: f32) -> Result<(), ObjProblem> {
        if value.is_finite() { Ok(()) } else { Err(ObjProblem::NotFinite(word.to_string())) }
    }

    fn write(&mut self, keyword: &str, values: &[f32]) {
        self.out.text.push_str(keyword);
        for value in values {
            // The shortest digits that read back as the same number.
            let _ = write!(self.out.text, " {value:e}");
        }
        self.out.text.push('\n');
    }

    fn face<'a>(
        &mut self,
        words: impl Iterator<Item = &'a str>,
        line: usize,
        faces: &mut String,
    ) -> Result<(), ObjProblem> {
        faces.push('f');
        let mut found = 0;
        for word in words {
            let mut corner = [0usize; 3];
            let mut parts = 0;
            for (kind, part) in word.split('/').enumerate() {
                parts = kind + 1;
                if parts > 3 {
                    break;
                }
                if !part.is_empty() {
                    corner[kind] = self.resolve(kind, part, word, line)?;
                }
            }
            if parts > 3 || corner[0] == 0 {
                return Err(ObjProblem::Corner(word.to_string()));
            }
            self.out.has_uvs |= corner[1] > 0;
            self.out.has_normals |= corner[2] > 0;
            // Numbers 1 of textures and normals are those of corners that have none.
            let _ = write!(faces, " {}/{}/{}", corner[0], corner[1] + 1, corner[2] + 1);
            found += 1;
        }
        if found < 3 {
            return Err(ObjProblem::Count { what: "a face", needed: "3 corners or more", found });
        }
        faces.push('\n');
        Ok(())
    }

    /// The number, from 1, that `part` of a corner means.
    fn resolve(&mut self, kind: usize, part: &str, word: &str, line: usize) -> Result<usize, ObjProblem> {
        let index: i64 = part.parse().map_err(|_| ObjProblem::Corner(word.to_string()))?;
        let count = self.counts[kind];
        let out_of_range = ObjProblem::OutOfRange { what: KINDS[kind], index, count };
        if index == 0 {
            return Err(ObjProblem::ZeroIndex(word.to_string()));
        }
        if index < 0 {
            let back = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
            return if back <= count { Ok(count - back + 1) } else { Err(out_of_range) };
        }
        // It may yet come: files are allowed to name what follows.
        let Ok(index) = u32::try_from(index).map(|index| index as usize) else { return Err(out_of_range) };
        if index > count && index > self.greatest[kind].0 {
            self.greatest[kind] = (index, line);
        }
        Ok(index)
    }

    fn finish(mut self, faces: String) -> Result<Clean, Fault> {
        for ((&(index, line), what), count) in self.greatest.iter().zip(KINDS).zip(self.counts) {
            if index > count {
                return Err((Some(line), ObjProblem::OutOfRange { what, index: index as i64, count }));
            }
        }
        if self.bad_normals > 0 {
            self.out.warnings.push(format!("{} normals are not finite; shaded flat there", self.bad_normals));
        }
        // A few are enough to see what kind of file it is.
        for (keyword, (count, line)) in self.passed.iter().take(8) {
            let what = match keyword.as_str() {
                "l" => "lines",
                "p" => "points",
                other => other,
            };
            self.out.warnings.push(format!("passed over {count} x {what}, first in line {line}"));
        }
        let mut text = String::with_capacity(self.out.text.len() + faces.len() + 64);
        text.push_str("mtllib library\nvt 0 0\nvn 0 0 0\n");
        text.push_str(&self.out.text);
        text.push_str(&faces);
        self.out.text = text;
        Ok(self.out)
    }
}

fn parsed(word: &str) -> Result<f32, ObjProblem> {
    word.parse().map_err(|_| ObjProblem::Number(word.to_string()))
}

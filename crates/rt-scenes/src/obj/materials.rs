//! Material libraries: MTL files.

use crate::Material;
use std::fmt::Write;
use std::io::Cursor;
use std::path::Path;

/// The materials of all libraries, and warnings about what is missing or wrong.
pub(super) fn load(
    names: &[String],
    folder: Option<&Path>,
    warnings: &mut Vec<String>,
) -> (Vec<tobj::Material>, std::collections::HashMap<String, usize>) {
    let mut text = String::new();
    for name in names {
        let Some(folder) = folder else {
            warnings.push(format!("material library {name:?} was not looked for"));
            continue;
        };
        // One name that may hold spaces; else several names.
        let whole = [name.as_str()];
        let several: Vec<&str> = name.split_whitespace().collect();
        let name = |name: &str| folder.join(name.replace('\\', "/"));
        let names = if name(whole[0]).is_file() { &whole[..] } else { &several[..] };
        for path in names.iter().copied().map(name) {
            match std::fs::read(&path) {
                Ok(bytes) => clean(&bytes, &path.display().to_string(), &mut text, warnings),
                Err(error) => {
                    warnings.push(format!("material library {} cannot be read: {error}", path.display()));
                }
            }
        }
    }
    tobj::load_mtl_buf(&mut Cursor::new(text)).unwrap_or_default()
}

/// Adds to `text` the lines of a library that matter here and are right: `tobj` panics on a colour of two numbers.
fn clean(bytes: &[u8], file: &str, text: &mut String, warnings: &mut Vec<String>) {
    let lossy = String::from_utf8_lossy(super::past_mark(bytes));
    let mut bad = None;
    for (number, line) in lossy.lines().enumerate() {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or("");
        let values: Vec<&str> = words.take_while(|word| !word.starts_with('#')).collect();
        let finite = |word: &&str| word.parse::<f32>().is_ok_and(f32::is_finite);
        let right = match keyword {
            "newmtl" => !values.is_empty(),
            "Kd" | "Ks" => values.len() == 3 && values.iter().all(finite),
            "Ns" | "Ni" | "d" | "Tr" => values.len() == 1 && values.iter().all(finite),
            "illum" => values.len() == 1 && values[0].parse::<u8>().is_ok(),
            _ => continue,
        };
        if right {
            let rest =
                if keyword == "newmtl" { line.trim()[keyword.len()..].trim() } else { &values.join(" ") };
            let _ = writeln!(text, "{keyword} {rest}");
        } else {
            bad.get_or_insert((number + 1, line.trim().to_string()));
        }
    }
    if let Some((number, line)) = bad {
        warnings.push(format!("{file}:{number}: passed over {line:?}, and what else is wrong there"));
    }
}

/// What a material of a library looks like here.
///
/// Colour and diffuse share are its `Kd`. It mirrors by its `Ks` unless its `illum` says, by being below 3, that this is meant for
/// highlights alone.
pub(super) fn look(from: &tobj::Material) -> Material {
    let greatest = |color: [f32; 3]| color[0].max(color[1]).max(color[2]).clamp(0.0, 1.0);
    let scaled = |color: [f32; 3]| color.map(|c| (c / greatest(color)).clamp(0.0, 1.0));
    let neutral = Material::default();
    let diffuse = from.diffuse.unwrap_or(neutral.color);
    let specular = from.specular.unwrap_or([0.0; 3]);
    let kd = greatest(diffuse);
    let mirrors = from.illumination_model.is_none_or(|model| model >= 3);
    let transparent = from.unknown_param.get("Tr").and_then(|value| value.parse().ok()).unwrap_or(0.0f32);
    Material {
        color: match (kd > 0.0, greatest(specular) > 0.0) {
            (true, _) => scaled(diffuse),
            (false, true) => scaled(specular),
            (false, false) => [0.0; 3],
        },
        kd,
        ks: if mirrors { greatest(specular) } else { 0.0 },
        shine: from.shininess.filter(|&power| power > 0.0).unwrap_or(neutral.shine),
        transmittance: from.dissolve.map_or(transparent, |opaque| 1.0 - opaque).clamp(0.0, 1.0),
        ior: from.optical_density.filter(|&ior| ior > 0.0).unwrap_or(neutral.ior),
    }
}

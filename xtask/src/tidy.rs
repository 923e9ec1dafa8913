//! `cargo xtask tidy`: the rules of the house that no compiler knows.

use crate::failure::Failure;
use crate::output::{root, say};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Check the rules of the house that no compiler knows.
///
/// Crates depend on lower layers only; `unsafe` stands in files called kernel.rs; every crate takes the lints of the
/// workspace; dependencies say what they spare us; no words for unfinished work; no module for odds and ends.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {}

const EXAMPLES: &str = "\
Examples:
  cargo xtask tidy    lists every breach as file:line, exits with 1 if there is one";

pub(crate) fn run(_: &Args) -> Result<(), Failure> {
    let findings = check(&root())?;
    for finding in &findings {
        say!("{finding}");
    }
    match findings.len() {
        0 => {
            say!("tidy");
            Ok(())
        }
        n => Err(Failure::Check(format!("{n} breaches of the rules of the house"))),
    }
}

/// The layer of each crate. A crate depends on lower ones only, never on a sibling.
const LAYERS: &[(u8, &[&str])] = &[
    (0, &["rt-geom"]),
    (1, &["rt-bounds"]),
    (2, &["rt-accel"]),
    (3, &["rt-shapes", "rt-grid", "rt-kdtree", "rt-octree", "rt-bsp", "rt-bvh", "rt-direction"]),
    (4, &["rt-scenes", "rt-measure"]),
    (5, &["rt-render"]),
    (6, &["rt-bench"]),
    (7, &["xtask"]),
];

/// The highest layer that tests of lower ones may use.
const TESTS_REACH: u8 = 4;

fn layer(name: &str) -> Option<u8> {
    LAYERS.iter().find(|(_, names)| names.contains(&name)).map(|&(layer, _)| layer)
}

/// Every breach under `root`.
fn check(root: &Path) -> Result<Vec<String>, Failure> {
    let mut findings = Vec::new();
    let workspace = root.join("Cargo.toml");
    let text = read(&workspace)?;
    let comments = ["workspace.dependencies"];
    uncommented(&text, &comments, &mut |line, what| findings.push(format!("Cargo.toml:{line}: {what}")));
    for folder in members(root)? {
        let path = folder.join("Cargo.toml");
        let text = read(&path)?;
        let shown = shown(root, &path);
        let manifest: Table = text.parse().map_err(|e| Failure::file(&path, e))?;
        manifest_rules(&manifest, &mut |what| findings.push(format!("{shown}: {what}")));
        let tables = ["dependencies", "dev-dependencies", "build-dependencies"];
        uncommented(&text, &tables, &mut |line, what| findings.push(format!("{shown}:{line}: {what}")));
    }
    for path in files(root)? {
        let shown = shown(root, &path);
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        text_rules(&path, &text, &mut |line, what| findings.push(format!("{shown}:{line}: {what}")));
    }
    Ok(findings)
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))
}

fn shown(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}

/// The folders of all crates, in order.
pub(crate) fn members(root: &Path) -> Result<Vec<PathBuf>, Failure> {
    let crates = root.join("crates");
    let entries = std::fs::read_dir(&crates).map_err(|e| Failure::file(&crates, e))?;
    let mut folders: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    folders.extend([root.join("benches"), root.join("xtask")]);
    folders.retain(|folder| folder.join("Cargo.toml").is_file());
    folders.sort();
    Ok(folders)
}

/// Layers and lints.
fn manifest_rules(manifest: &Table, found: &mut dyn FnMut(String)) {
    let table =
        |table: &Table, key: &str| table.get(key).and_then(Value::as_table).cloned().unwrap_or_default();
    let name = table(manifest, "package").get("name").and_then(Value::as_str).unwrap_or("").to_string();
    if table(manifest, "lints").get("workspace") != Some(&Value::Boolean(true)) {
        found("[lints] workspace = true is missing".into());
    }
    let Some(own) = layer(&name) else {
        found(format!("crate {name:?} has no layer"));
        return;
    };
    for (kind, limit) in
        [("dependencies", None), ("build-dependencies", None), ("dev-dependencies", Some(TESTS_REACH))]
    {
        for dependency in table(manifest, kind).keys() {
            let Some(other) = layer(dependency) else { continue };
            let allowed = other < own || limit.is_some_and(|reach| other <= reach);
            if !allowed {
                let found_in = format!("{name} (layer {own}) depends on {dependency} (layer {other})");
                found(format!("[{kind}] {found_in}; only lower layers are allowed"));
            }
        }
    }
}

/// Dependencies on crates of others without a comment above them, or above the ones they stand together with.
fn uncommented(manifest: &str, tables: &[&str], found: &mut dyn FnMut(usize, String)) {
    let mut inside = false;
    let mut commented = false;
    for (number, line) in (1..).zip(manifest.lines()) {
        let line = line.trim();
        if let Some(table) = line.strip_prefix('[') {
            inside = tables.contains(&table.trim_end_matches(']'));
            commented = false;
        } else if line.is_empty() {
            commented = false;
        } else if line.starts_with('#') {
            commented = true;
        } else if inside && let Some((name, value)) = line.split_once('=') {
            let ours = layer(name.split('.').next().unwrap_or(name).trim()).is_some();
            let inherited = name.contains(".workspace") || value.contains("workspace = true");
            if ours {
                commented = false;
            } else if !inherited && !commented {
                found(number, format!("{} has no comment that says what it spares us", name.trim()));
            }
        }
    }
}

/// Text files of the repository: sources, manifests, notes.
fn files(root: &Path) -> Result<Vec<PathBuf>, Failure> {
    const KINDS: &[&str] = &["rs", "toml", "md", "csv", "yml"];
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|e| Failure::file(&folder, e))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            // Symbolic links lead out, or in circles.
            if path.is_symlink() {
                continue;
            }
            if path.is_dir() {
                if !(name.starts_with('.') || folder == root && ["target", "out"].contains(&name.as_str())) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| KINDS.iter().any(|kind| e == *kind)) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Words, names and the end of the file.
fn text_rules(path: &Path, text: &str, found: &mut dyn FnMut(usize, String)) {
    let last = text.lines().count().max(1);
    if !text.is_empty() && !text.ends_with('\n') {
        found(last, "does not end with a newline".into());
    }
    if path.extension().is_none_or(|e| e != "rs") {
        return;
    }
    const ODDS_AND_ENDS: &[&str] = &["common", "core", "utils", "util", "misc", "helpers"];
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned();
    for name in [&stem, &folder] {
        if ODDS_AND_ENDS.contains(&name.as_str()) {
            found(1, format!("{name:?} is no name for a module: say what is in it"));
        }
    }
    for (number, line) in (1..).zip(text.lines()) {
        // In two parts each, so that this line is none of them.
        for word in [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X")] {
            if has_word(line, word) {
                found(number, format!("{word}: finish it, or leave it out"));
            }
        }
    }
    for (number, line) in (1..).zip(code(text).lines()) {
        if has_word(line, "unsafe") && stem != "kernel" {
            found(number, "unsafe outside a kernel.rs".into());
        }
        for name in ["dbg", "todo", "unimplemented"] {
            if has_word(line, name) && line.contains(&format!("{name}!")) {
                found(number, format!("{name}! is for unfinished work"));
            }
        }
    }
}

fn has_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let letter = |c: char| c.is_alphanumeric() || c == '_';
        !line[..at].ends_with(letter) && !line[at + word.len()..].starts_with(letter)
    })
}

/// Rust source with comments, strings and character literals blanked; lines stay where they are.
fn code(source: &str) -> String {
    let chars: Vec<char> = source.chars().collect();
    let mut code = String::with_capacity(source.len());
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let mut i = 0;
    while i < chars.len() {
        let end = match at(i) {
            '/' if at(i + 1) == '/' => (i..chars.len()).find(|&j| at(j) == '\n').unwrap_or(chars.len()),
            '/' if at(i + 1) == '*' => {
                let (mut depth, mut j) = (1, i + 2);
                while depth > 0 && j < chars.len() {
                    match (at(j), at(j + 1)) {
                        ('/', '*') => (depth, j) = (depth + 1, j + 2),
                        ('*', '/') => (depth, j) = (depth - 1, j + 2),
                        _ => j += 1,
                    }
                }
                j
            }
            'r' if at(i + 1) == '"' || at(i + 1) == '#' => {
                let hashes = (i + 1..chars.len()).take_while(|&j| at(j) == '#').count();
                let open = i + 1 + hashes;
                if at(open) == '"' {
                    let close = |j: &usize| at(*j) == '"' && (1..=hashes).all(|k| at(*j + k) == '#');
                    (open + 1..chars.len()).find(close).map_or(chars.len(), |j| j + 1 + hashes)
                } else {
                    i
                }
            }
            '"' => quoted(&chars, i, '"'),
            // A character, not a lifetime.
            '\'' if at(i + 1) == '\\' || at(i + 2) == '\'' => quoted(&chars, i, '\''),
            _ => i,
        };
        if end == i {
            code.push(at(i));
            i += 1;
        } else {
            code.extend(chars[i..end].iter().map(|&c| if c == '\n' { '\n' } else { ' ' }));
            i = end;
        }
    }
    code
}

/// One past the end of what is quoted from `from` on.
fn quoted(chars: &[char], from: usize, quote: char) -> usize {
    let mut i = from + 1;
    while i < chars.len() && chars[i] != quote {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    (i + 1).min(chars.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_house_is_tidy() {
        assert_eq!(check(&root()).unwrap(), Vec::<String>::new());
    }

    fn breaches(manifest: &str) -> Vec<String> {
        let mut found = Vec::new();
        manifest_rules(&manifest.parse().unwrap(), &mut |what| found.push(what));
        found
    }

    #[test]
    fn layers_are_kept() {
        let manifest = |name: &str, kind: &str, on: &str| {
            format!(
                "[package]\nname = \"{name}\"\n[{kind}]\n{on}.workspace = true\n[lints]\nworkspace = true\n"
            )
        };
        assert!(breaches(&manifest("rt-bvh", "dependencies", "rt-accel")).is_empty());
        assert_eq!(breaches(&manifest("rt-bvh", "dependencies", "rt-shapes")).len(), 1);
        assert_eq!(breaches(&manifest("rt-geom", "dependencies", "rt-bounds")).len(), 1);
        assert!(breaches(&manifest("rt-bvh", "dev-dependencies", "rt-scenes")).is_empty());
        assert_eq!(breaches(&manifest("rt-bvh", "dev-dependencies", "rt-render")).len(), 1);
        assert_eq!(breaches(&manifest("rt-new", "dependencies", "rt-geom")).len(), 1);
        assert_eq!(breaches("[package]\nname = \"rt-geom\"\n").len(), 1);
    }

    #[test]
    fn dependencies_say_why() {
        let count = |text: &str| {
            let mut n = 0;
            uncommented(text, &["dependencies"], &mut |_, _| n += 1);
            n
        };
        assert_eq!(count("[dependencies]\n# Vectors.\nglam = \"1\"\nglum = \"1\"\n"), 0);
        assert_eq!(count("[dependencies]\nglam = \"1\"\n\n[lints]\nworkspace = true\n"), 1);
        assert_eq!(
            count("[dependencies]\n# Why.\nrt-geom.workspace = true\nglam = { version = \"1\" }\n"),
            1
        );
        assert_eq!(count("[dependencies]\nglam.workspace = true\nrayon = { workspace = true }\n"), 0);
    }

    #[test]
    fn words_are_found_in_code_and_not_in_strings() {
        let found = |name: &str, text: &str| {
            let mut lines = Vec::new();
            text_rules(Path::new(name), text, &mut |line, _| lines.push(line));
            lines
        };
        assert!(
            found("src/a.rs", "// unsafe\nlet a = \"unsafe \\\" unsafe\"; #![forbid(unsafe_code)]\n")
                .is_empty()
        );
        assert!(
            found("src/a.rs", "let a = r#\"unsafe \" {\"#; let b: &'a u8 = b'\\''; /* unsafe */\n")
                .is_empty()
        );
        assert_eq!(found("src/a.rs", "fn f<'a>() {\n    let c = '\"'; unsafe { g() }\n}\n"), [2]);
        assert!(found("src/kernel.rs", "unsafe { g() }\n").is_empty());
        assert_eq!(found("src/a.rs", concat!("\n// TO", "DO: later\ndbg", "!(1);\n")), [2, 3]);
        assert_eq!(found("src/utils.rs", "\n"), [1]);
        assert_eq!(found("notes.md", "no end"), [1]);
    }
}

//! Wavefront OBJ files.

use crate::Scene;
use core::fmt;
use std::path::Path;

/// Why a file is not a scene.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ObjError {
    /// The file.
    pub file: String,
    /// What is wrong.
    pub problem: String,
}

impl fmt::Display for ObjError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file, self.problem)
    }
}

impl core::error::Error for ObjError {}

/// Reads the OBJ file at `path`, and the material libraries it names.
///
/// # Errors
///
/// See [`ObjError`].
pub fn load(path: impl AsRef<Path>) -> Result<Scene, ObjError> {
    let file = path.as_ref().display().to_string();
    let bytes =
        std::fs::read(path).map_err(|error| ObjError { file: file.clone(), problem: error.to_string() })?;
    read(&bytes, &file)
}

/// Reads the text of an OBJ file; `name` is what errors call it.
///
/// # Errors
///
/// See [`ObjError`].
pub fn read(bytes: &[u8], name: &str) -> Result<Scene, ObjError> {
    let _ = bytes;
    Err(ObjError { file: name.to_string(), problem: "OBJ files are not read yet".to_string() })
}

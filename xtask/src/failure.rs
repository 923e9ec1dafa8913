//! [`Failure`]: why a task failed, and with which exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

/// Why a task failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A check found something wrong.
    Check(String),
    /// The command line asks for what there is not.
    Usage(String),
    /// A file is missing, malformed or cannot be written.
    File(String),
    /// The user pressed Ctrl-C.
    Interrupted,
}

impl Failure {
    pub(crate) fn code(&self) -> ExitCode {
        ExitCode::from(match self {
            Failure::Check(_) => 1,
            Failure::Usage(_) => 2,
            Failure::File(_) => 3,
            Failure::Interrupted => 130,
        })
    }

    /// A file that could not be read or written.
    pub(crate) fn file(path: &Path, error: impl fmt::Display) -> Failure {
        Failure::File(format!("{}: {error}", path.display()))
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Check(why) | Failure::Usage(why) | Failure::File(why) => f.write_str(why),
            Failure::Interrupted => f.write_str("interrupted; nothing was written"),
        }
    }
}

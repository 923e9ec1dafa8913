//! What leaves a task: files written whole or not at all, progress on stderr, numbers people can read.

use crate::failure::Failure;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The root of the workspace.
pub(crate) fn root() -> PathBuf {
    // Set by cargo when it runs or tests this program; the place it was built from otherwise.
    let here = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    PathBuf::from(here).parent().map_or_else(PathBuf::new, Path::to_path_buf)
}

/// Prints a line of results to stdout. Whoever read them may have left: that ends the program, quietly and without error.
macro_rules! say {
    ($($arg:tt)*) => { $crate::output::line(format_args!($($arg)*)) };
}
pub(crate) use say;

/// See [`say`].
pub(crate) fn line(text: std::fmt::Arguments<'_>) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_fmt(text).and_then(|()| out.write_all(b"\n")) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: stdout: {error}");
        std::process::exit(3);
    }
}

/// Writes a file under a temporary name beside it and renames it, making its folder. A link is followed; what is no file, such
/// as a device, is refused; a file that is replaced keeps its permissions.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let linked = std::fs::symlink_metadata(path).is_ok_and(|there| there.is_symlink());
    let target =
        if linked { std::fs::canonicalize(path).map_err(|e| Failure::file(path, e))? } else { path.into() };
    let there = std::fs::metadata(&target).ok();
    if there.as_ref().is_some_and(|there| !there.is_file()) {
        return Err(Failure::file(path, "is there and is not a file"));
    }
    let path = target.as_path();
    let name = path.file_name().ok_or_else(|| Failure::file(path, "this is not the name of a file"))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
    let part = folder.join(format!(".{}.{}.part", name.to_string_lossy(), std::process::id()));
    let written = std::fs::File::create(&part)
        .and_then(|mut file| {
            if let Some(there) = &there {
                file.set_permissions(there.permissions())?;
            }
            file.write_all(bytes).and_then(|()| file.sync_all())
        })
        .and_then(|()| std::fs::rename(&part, path));
    written.map_err(|e| {
        // What could not be finished is not left behind; that it cannot be removed either adds nothing to the error.
        let _ = std::fs::remove_file(&part);
        Failure::file(path, e)
    })
}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on the first Ctrl-C asks to stop, so that no file is left half-written; the second one ends the program.
pub(crate) fn catch_interrupts() {
    // Without a handler Ctrl-C ends the program at once, which is no worse than not starting it.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
}

/// Whether Ctrl-C was pressed.
pub(crate) fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Progress on stderr: a bar on a terminal, else a line every few seconds, or nothing.
pub(crate) struct Progress {
    what: String,
    bar: Option<ProgressBar>,
    last: Option<Mutex<Instant>>,
}

/// How long stderr is silent between two lines.
const SILENCE: Duration = Duration::from_secs(3);

impl Progress {
    pub(crate) fn new(what: &str, quiet: bool) -> Progress {
        let terminal = std::io::stderr().is_terminal();
        let bar = (!quiet && terminal).then(|| {
            let plain = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
            let bar = if plain { "{bar:40}" } else { "{bar:40.cyan/blue}" };
            // A template that does not parse would be a mistake of this line; the plain bar serves as well.
            let style = ProgressStyle::with_template(&format!("{{msg:10}} {bar} {{percent:>3}} % {{eta}}"))
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr())
                .with_style(style)
                .with_message(what.to_string())
        });
        let last = (!quiet && !terminal).then(|| Mutex::new(Instant::now()));
        Progress { what: what.to_string(), bar, last }
    }

    /// Shows how much is done, 0 to 1; `Break` after Ctrl-C.
    pub(crate) fn hear(&self, progress: f32) -> ControlFlow<()> {
        if let Some(bar) = &self.bar {
            bar.set_position(bar.position().max((progress * 1000.0) as u64));
        }
        if let Some(last) = &self.last
            && let Ok(mut last) = last.try_lock()
            && last.elapsed() >= SILENCE
        {
            *last = Instant::now();
            eprintln!("{} {:.0} %", self.what, progress * 100.0);
        }
        if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A whole number with its thousands apart.
pub(crate) fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A value of a JSON object.
pub(crate) enum Json {
    Text(String),
    Whole(u64),
    Number(f64),
    List(Vec<Json>),
    Object(Vec<(&'static str, Json)>),
}

impl std::fmt::Display for Json {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Json::Text(text) => {
                f.write_str("\"")?;
                for c in text.chars() {
                    match c {
                        '"' | '\\' => write!(f, "\\{c}")?,
                        c if c < ' ' => write!(f, "\\u{:04x}", c as u32)?,
                        c => write!(f, "{c}")?,
                    }
                }
                f.write_str("\"")
            }
            Json::Whole(n) => write!(f, "{n}"),
            Json::Number(x) if x.is_finite() => write!(f, "{x}"),
            Json::Number(_) => f.write_str("null"),
            Json::List(items) => {
                f.write_str("[")?;
                for (i, item) in items.iter().enumerate() {
                    write!(f, "{}{item}", if i == 0 { "" } else { "," })?;
                }
                f.write_str("]")
            }
            Json::Object(fields) => {
                f.write_str("{")?;
                for (i, (key, value)) in fields.iter().enumerate() {
                    write!(f, "{}\"{key}\":{value}", if i == 0 { "" } else { "," })?;
                }
                f.write_str("}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_whole_or_absent() {
        let folder = std::env::temp_dir().join(format!("xtask-write-{}", std::process::id()));
        let path = folder.join("deeper").join("file");
        write_whole(&path, b"one").unwrap();
        write_whole(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert!(write_whole(&path.join("under a file"), b"three").is_err());
        assert!(write_whole(&folder.join("deeper"), b"over a folder").is_err());
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        assert_eq!(std::fs::read_dir(folder.join("deeper")).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn numbers_and_json_read_well() {
        let all = [(0, "0"), (999, "999"), (1000, "1 000"), (1_234_567, "1 234 567")];
        assert!(all.iter().all(|&(n, text)| thousands(n) == text));
        let json = Json::Object(vec![
            ("text", Json::Text("a \"b\"\n".into())),
            ("list", Json::List(vec![Json::Whole(1), Json::Number(0.5), Json::Number(f64::NAN)])),
        ]);
        assert_eq!(json.to_string(), r#"{"text":"a \"b\"\u000a","list":[1,0.5,null]}"#);
    }
}

//! `cargo xtask ci`: everything a server checks, but for the tests.

use crate::failure::Failure;
use crate::output::{root, say};
use crate::{golden, tidy};
use std::ffi::OsString;
use std::process::Command;
use std::time::Instant;
use toml::{Table, Value};

/// Everything a server checks, except the tests, which `cargo test --workspace` runs.
///
/// Runs every step, whatever the others say, prints its time, and lists what failed.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Only steps whose name contains this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask ci                    all steps; exits with 1 if one fails
  cargo xtask ci --only clippy      one step
  cargo xtask ci --only features    each crate with each of its features alone";

enum Step {
    /// A run of cargo, with environment variables.
    Cargo(Vec<String>, &'static [(&'static str, &'static str)]),
    /// A check with an older toolchain.
    Oldest(String),
    Tidy,
    Golden,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut steps = steps()?;
    if let Some(only) = &args.only {
        steps.retain(|(name, _)| name.contains(only.as_str()));
        if steps.is_empty() {
            return Err(Failure::Usage(format!("no step is called {only:?}")));
        }
    }
    let mut failed = Vec::new();
    let mut times = Vec::new();
    for (name, step) in steps {
        eprintln!("--- {name}");
        let start = Instant::now();
        let result = match step {
            Step::Cargo(arguments, environment) => {
                let cargo = std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
                command(Command::new(cargo).args(arguments).envs(environment.iter().copied()))
            }
            Step::Oldest(toolchain) => command(
                // Not `cargo +version`: the cargo that runs this program does not know that.
                Command::new("rustup")
                    .args(["run", &toolchain, "cargo", "check", "--quiet", "--workspace", "--all-targets"])
                    .env_remove("CARGO")
                    .env_remove("RUSTC")
                    .env_remove("RUSTUP_TOOLCHAIN"),
            ),
            Step::Tidy => tidy::run(&tidy::Args {}),
            Step::Golden => golden::run(&golden::Args::default()),
        };
        times.push((name.clone(), start.elapsed(), result.is_ok()));
        if let Err(why) = result {
            eprintln!("{name}: {why}");
            failed.push(name);
        }
    }
    for (name, time, ok) in times {
        say!("{} {:7.1} s  {name}", if ok { "ok  " } else { "FAIL" }, time.as_secs_f64());
    }
    if failed.is_empty() { Ok(()) } else { Err(Failure::Check(format!("failed: {}", failed.join(", ")))) }
}

fn command(command: &mut Command) -> Result<(), Failure> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.current_dir(root()).status().map_err(|e| Failure::File(format!("{name}: {e}")))?;
    if status.success() { Ok(()) } else { Err(Failure::Check(status.to_string())) }
}

fn steps() -> Result<Vec<(String, Step)>, Failure> {
    let cargo =
        |text: &str, environment| Step::Cargo(text.split(' ').map(String::from).collect(), environment);
    let mut steps = vec![
        ("tidy".to_string(), Step::Tidy),
        ("fmt".to_string(), cargo("fmt --all --check", &[])),
        ("clippy".to_string(), cargo("clippy --quiet --workspace --all-targets -- -D warnings", &[])),
        ("doc".to_string(), cargo("doc --quiet --workspace --no-deps", &[("RUSTDOCFLAGS", "-D warnings")])),
        ("golden".to_string(), Step::Golden),
    ];
    for folder in tidy::members(&root())? {
        let path = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&path).map_err(|e| Failure::file(&path, e))?;
        let manifest: Table = text.parse().map_err(|e| Failure::file(&path, e))?;
        let package = manifest.get("package").and_then(Value::as_table);
        let Some(name) = package.and_then(|p| p.get("name")).and_then(Value::as_str) else { continue };
        let check = format!("check --quiet -p {name} --no-default-features");
        steps.push((format!("features: {name} with none"), cargo(&check, &[])));
        let features = manifest.get("features").and_then(Value::as_table);
        for feature in features.into_iter().flat_map(Table::keys).filter(|f| *f != "default") {
            let check = format!("{check} --features {feature}");
            steps.push((format!("features: {name} with {feature}"), cargo(&check, &[])));
        }
    }
    match oldest()? {
        Some(toolchain) => {
            steps.push((format!("oldest compiler: {toolchain}"), Step::Oldest(toolchain)));
        }
        None => eprintln!("note: the oldest compiler promised is not installed; not checked with it"),
    }
    Ok(steps)
}

/// The oldest toolchain the workspace promises to build with, if it is installed.
fn oldest() -> Result<Option<String>, Failure> {
    let path = root().join("Cargo.toml");
    let text = std::fs::read_to_string(&path).map_err(|e| Failure::file(&path, e))?;
    let manifest: Table = text.parse().map_err(|e| Failure::file(&path, e))?;
    let version = manifest
        .get("workspace")
        .and_then(|w| w.get("package"))
        .and_then(|p| p.get("rust-version"))
        .and_then(Value::as_str)
        .ok_or_else(|| Failure::file(&path, "names no rust-version"))?;
    let Ok(list) = Command::new("rustup").args(["toolchain", "list"]).output() else { return Ok(None) };
    let list = String::from_utf8_lossy(&list.stdout).into_owned();
    let fits = |line: &&str| line.strip_prefix(version).is_some_and(|rest| rest.starts_with(['-', '.']));
    Ok(list.lines().find(fits).and_then(|line| line.split(' ').next()).map(String::from))
}

//! The tasks of the workspace. `cargo xtask --help` lists them.
//!
//! Results go to stdout, everything else to stderr. Exit codes: 0 all is well, 1 a check failed, 2 the command line is
//! wrong, 3 a file is missing, malformed or cannot be written, 130 interrupted.

// The one place of the workspace that talks to people.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod bench;
mod ci;
mod failure;
mod golden;
mod output;
mod render;
mod spd;
mod stability;
mod stage;

mod tidy;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Tasks of the rt workspace.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, after_help = EXAMPLES)]
struct Args {
    #[command(subcommand)]
    task: Task,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask render                    a picture of balls in out/balls.png
  cargo xtask render tetra --explain    another scene, and what it leaves out
  cargo xtask stability --rays 10000000 stiff and extreme cases against exact arithmetic
  cargo xtask bench --quick             what rays cost, in some ten minutes
  cargo xtask spd                       do Haines' scenes take the rays they are known for?
  cargo xtask golden                    has any reference picture changed?
  cargo xtask ci                        everything a server checks

Exit codes: 0 ok, 1 a check failed, 2 wrong usage, 3 a file is missing, malformed or not writable, 130 interrupted.";

#[derive(Subcommand)]
enum Task {
    /// Make a picture, and say what it took.
    Render(render::Args),
    /// Compare small pictures of every structure with the reference ones, bit for bit.
    Golden(golden::Args),
    /// Count the rays of Haines' scenes, and compare with what is known of them.
    Spd(spd::Args),
    /// Measure what rays cost, and how wrong the answers are.
    Bench(bench::Args),
    /// Ask about stiff and extreme cases, and judge by exact arithmetic.
    Stability(stability::Args),
    /// Check the rules of the house that no compiler knows.
    Tidy(tidy::Args),
    /// Everything a server checks: format, lints, docs, tidy, golden, features one by one.
    Ci(ci::Args),
}

fn main() -> ExitCode {
    let result = match Args::parse().task {
        Task::Render(args) => render::run(&args),
        Task::Spd(args) => spd::run(&args),
        Task::Golden(args) => golden::run(&args),
        Task::Bench(args) => bench::run(&args),
        Task::Stability(args) => stability::run(&args),
        Task::Tidy(args) => tidy::run(&args),
        Task::Ci(args) => ci::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.code()
        }
    }
}

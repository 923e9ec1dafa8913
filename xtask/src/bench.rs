//! `cargo xtask bench`: what rays cost, and how wrong they are.

use crate::failure::Failure;
use crate::output::{Json, Progress, catch_interrupts, root, say, thousands, write_whole};
use clap::ValueEnum;
use rt_bench::{Effort, Group, Measured, Options, Question, Stamp, Subject, Trouble, ask};
use rt_measure::record::{ErrorKind, HEADER, Row, parse};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Measure what rays cost, and how wrong the answers are.
///
/// All contestants of a group answer the same rays, by turns; `speed` is against the first of them, the median over rounds.
/// A sample of the rays is judged by exact integers first: wrong, missed, invented are rates per million rays judged; t ulp is
/// the largest error of a distance. An asterisk marks what nobody in the group beats in both error and time (for `build`: in
/// both build time and time).
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// What to ask. Without any, all but rivals.
    #[arg(value_enum, value_name = "QUESTION")]
    questions: Vec<Asked>,
    /// Some ten minutes for all questions, on few rays.
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Scenes of a million primitives, too.
    #[arg(long)]
    full: bool,
    /// Only this scene: a name such as soup-100000 or blob, or a file that ends in .obj. May be given again.
    #[arg(long = "scene", value_name = "NAME|FILE")]
    scenes: Vec<String>,
    /// Form of the result.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Where records are kept.
    #[arg(long, value_name = "DIR", default_value = "benches/records", conflicts_with = "no_record")]
    records: PathBuf,
    /// Keep no record.
    #[arg(long)]
    no_record: bool,
    /// Threads that builds may use; rays use one.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Say nothing but the result.
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask bench --quick                       all questions in some ten minutes
  cargo xtask bench closest any                   two questions, in some minutes
  cargo xtask bench build --scene soup-1000000    what the knobs of a build do to one scene
  cargo xtask bench --scene bunny.obj --no-record a mesh of one's own
  cargo run --release -p xtask --features rivals -- bench rivals
                                                  other people's structures on the same rays

Exit codes: 0 ok, 1 an exact structure gave wrong answers (then nothing is recorded), 2 wrong usage, 3 a file is missing,
malformed or not writable, 130 interrupted.";

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Asked {
    /// What does a closest hit cost?
    Closest,
    /// What does any hit cost?
    Any,
    /// What do the knobs of a build buy?
    Build,
    /// What does the fast triangle test gain and lose?
    Precision,
    /// Which structure for which scene?
    Structures,
    /// How finely should a grid divide space?
    Subdivision,
    /// How does the cost of a ray grow with the number of primitives?
    Scaling,
    /// Which box test?
    Slab,
    /// Which bounding volume, and when does it pay?
    Volumes,
    /// What do smooth shapes cost, met directly and as triangles?
    Shapes,
    /// What does it save to refine only what rays come near?
    Lazy,
    /// How do other people's structures fare?
    Rivals,
}

impl Asked {
    fn question(self) -> Question {
        match self {
            Asked::Closest => Question::Closest,
            Asked::Any => Question::Any,
            Asked::Build => Question::Build,
            Asked::Precision => Question::Precision,
            Asked::Structures => Question::Structures,
            Asked::Subdivision => Question::Subdivision,
            Asked::Scaling => Question::Scaling,
            Asked::Slab => Question::Slab,
            Asked::Volumes => Question::Volumes,
            Asked::Shapes => Question::Shapes,
            Asked::Lazy => Question::Lazy,
            Asked::Rivals => Question::Rivals,
        }
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    Text,
    Json,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut questions: Vec<Question> = Vec::new();
    for asked in args.questions.iter().map(|asked| asked.question()) {
        if !questions.contains(&asked) {
            questions.push(asked);
        }
    }
    if questions.is_empty() {
        questions = Question::ALL.into_iter().filter(|q| *q != Question::Rivals).collect();
    }
    if questions.contains(&Question::Rivals) && !rt_bench::HAS_RIVALS {
        let command = "cargo run --release -p xtask --features rivals -- bench rivals";
        return Err(Failure::Usage(format!("rivals are compiled only where they are asked for: {command}")));
    }
    let effort = match (args.quick, args.full) {
        (true, _) => Effort::Quick,
        (_, true) => Effort::Full,
        _ => Effort::Normal,
    };
    let scenes = args.scenes.iter().map(|name| subject(name)).collect::<Result<Vec<_>, _>>()?;
    let options = Options { effort, scenes: (!scenes.is_empty()).then_some(scenes) };
    let stamp = Stamp { date: today(), machine: machine(), commit: commit() };
    // Refused before minutes of work, not after.
    let path = (!args.no_record).then(|| record_path(&args.records, &stamp));
    let before = path.as_deref().map_or(Ok(String::new()), read_record)?;
    if !args.quiet {
        introduce(args, &stamp, &questions, &options);
    }
    catch_interrupts();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(args.threads))
        .build()
        .map_err(|e| Failure::Usage(format!("--threads {}: {e}", args.threads)))?;
    let mut answers = Vec::new();
    for question in questions {
        let progress = Progress::new(question.name(), args.quiet);
        let groups = pool
            .install(|| ask(question, &options, &mut |done| progress.hear(done)))
            .map_err(|trouble| failure(question, &trouble))?;
        drop(progress);
        if args.format == Format::Text {
            say!("{}", text(question, &groups).trim_end_matches('\n'));
        }
        answers.push((question, groups));
    }
    if args.format == Format::Json {
        say!("{}", json(&stamp, args.threads, &answers));
    }
    let broken = answers.iter().flat_map(|(_, groups)| groups).filter(|group| group.outcome.is_err()).count();
    if broken > 0 {
        return Err(Failure::Check(format!(
            "{broken} groups were not timed: see above; nothing was recorded"
        )));
    }
    if let Some(path) = path {
        if cfg!(debug_assertions) {
            eprintln!("note: nothing was recorded, because this program was compiled for debugging");
            return Ok(());
        }
        let rows = answers.iter().flat_map(|(_, groups)| groups).flat_map(|group| group.rows(&stamp));
        let count = append(&path, before, rows, args.threads)?;
        if !args.quiet {
            eprintln!("{count} rows appended to {}", path.display());
        }
    }
    Ok(())
}

/// What will happen, and about how long it takes.
fn introduce(args: &Args, stamp: &Stamp, questions: &[Question], options: &Options) {
    eprintln!("{}, commit {}, {} threads for builds", stamp.machine, stamp.commit, args.threads);
    if stamp.commit.ends_with("-dirty") {
        eprintln!("note: the work tree differs from the commit; so will the record");
    }
    if options.scenes.is_none() {
        let time: Duration = questions.iter().map(|question| question.estimate(options.effort)).sum();
        eprintln!("about {} s", time.as_secs());
    }
}

fn failure(question: Question, trouble: &Trouble) -> Failure {
    match trouble {
        Trouble::Stopped => Failure::Interrupted,
        Trouble::Scene(_) | Trouble::NoRivals => Failure::Usage(format!("{question}: {trouble}")),
        _ => Failure::Check(format!("{question}: {trouble}")),
    }
}

/// A scene by its name, or from a file, which in records goes by the name of the file alone.
fn subject(name: &str) -> Result<Subject, Failure> {
    let path = Path::new(name);
    let made = match path.extension() {
        Some(suffix) if suffix.eq_ignore_ascii_case("obj") => {
            // The error names the file.
            let scene = rt_scenes::obj::load(path).map_err(|e| Failure::File(e.to_string()))?;
            Subject::new(&path.file_stem().unwrap_or_default().to_string_lossy(), scene)
        }
        _ => Subject::named(name),
    };
    made.map_err(|trouble| Failure::Usage(trouble.to_string()))
}

/// The machine's kind of processor and its cores, as the name of a folder.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let said = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.to_string())
    });
    let said = said.or_else(|| ask_program("sysctl", &["-n", "machdep.cpu.brand_string"]));
    let said = said.or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok());
    let model = said.unwrap_or_else(|| std::env::consts::ARCH.to_string());
    format!("{}-{cores}-cores", sanitised(&model))
}

/// Lower case letters and digits, with hyphens between.
fn sanitised(text: &str) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let words: Vec<String> = words.map(str::to_ascii_lowercase).collect();
    if words.is_empty() { "unknown".into() } else { words.join("-") }
}

/// The commit measured, marked where what is compiled differs from it.
fn commit() -> String {
    let Some(commit) = ask_program("git", &["rev-parse", "--short", "HEAD"]) else { return "unknown".into() };
    let compiled =
        ["status", "--porcelain", "--", "crates", "benches/src", "benches/Cargo.toml", "Cargo.toml"];
    match ask_program("git", &compiled) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit}-dirty"),
    }
}

/// What a program says, run in the workspace; `None` if it cannot be asked.
fn ask_program(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).current_dir(root()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

/// The day, as in 2026-01-31, in Greenwich.
fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    date(seconds / 86_400)
}

/// The date so many days after the first of January 1970.
///
/// Source: Hinnant, "chrono-compatible low-level date algorithms", 2013, `civil_from_days`.
fn date(days: u64) -> String {
    // Years begin in March, so that leap days end them; eras of 400 years have 146 097 days.
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{day:02}", era * 400 + year + next)
}

fn record_path(records: &Path, stamp: &Stamp) -> PathBuf {
    let folder = if records.is_absolute() { records.to_path_buf() } else { root().join(records) };
    folder.join(&stamp.machine).join(format!("{}.csv", stamp.date))
}

/// The record of earlier runs, or its first line.
fn read_record(path: &Path) -> Result<String, Failure> {
    match std::fs::read_to_string(path) {
        Ok(text) => {
            parse(&text).map_err(|e| Failure::file(path, e))?;
            Ok(text)
        }
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(format!("{HEADER}\n")),
        Err(e) => Err(Failure::file(path, e)),
    }
}

/// Writes a record anew with more rows; returns how many.
fn append(
    path: &Path,
    mut text: String,
    rows: impl Iterator<Item = Row>,
    threads: u16,
) -> Result<usize, Failure> {
    if !text.ends_with('\n') {
        text.push('\n');
    }
    let mut count = 0;
    for mut row in rows {
        if threads != 1 {
            row.params += &format!(" threads={threads}");
        }
        text += &row.to_csv().map_err(|e| Failure::Check(e.to_string()))?;
        text.push('\n');
        count += 1;
    }
    write_whole(path, text.as_bytes())?;
    Ok(count)
}

/// A table for each group, and over all of them each contestant's mean speed.
fn text(question: Question, groups: &[Group]) -> String {
    let mut out = format!("{question}\n");
    for group in groups {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(
            out,
            "\n{}: {} primitives, {} {}, {} judged",
            group.scene,
            thousands(group.prims as u64),
            thousands(group.rays as u64),
            if matches!(question, Question::Slab | Question::Volumes) {
                format!("tests, {}", group.ray_kind)
            } else {
                group.ray_kind.clone()
            },
            thousands(group.judged as u64)
        );
        match &group.outcome {
            Ok(measured) => {
                out += &table(measured);
                out += &predictions(measured);
            }
            Err(mismatch) => {
                let _ = writeln!(out, "  NOT TIMED: {mismatch}");
            }
        }
    }
    if let Some(mean) = means(groups) {
        out += &mean;
    }
    out.push('\n');
    out
}

/// How the predictions of a group did, where there were any.
fn predictions(measured: &[Measured]) -> String {
    let off: Vec<f64> = measured
        .iter()
        .flat_map(|m| &m.figures)
        .filter(|(name, _)| *name == "off_%")
        .map(|(_, off)| off.abs())
        .collect();
    if off.is_empty() {
        return String::new();
    }
    let near = off.iter().filter(|off| **off <= 10.0).count();
    let median = rt_measure::clock::quantile(&off, 0.5);
    format!(" {near} of {} predictions within 10 %; half within {median:.1} %\n", off.len())
}

/// A table of all that anybody in the group tells.
fn table(measured: &[Measured]) -> String {
    let optional = |x: Option<f64>, digits: usize| x.map_or_else(String::new, |x| format!("{x:.digits$}"));
    let mut names: Vec<&'static str> = Vec::new();
    for (name, _) in measured.iter().flat_map(|m| &m.figures) {
        if !names.contains(name) {
            names.push(name);
        }
    }
    let mut header = vec![
        "",
        "structure",
        "params",
        "build ms",
        "B/prim",
        "ns",
        "spread",
        "speed",
        "nodes",
        "tests",
        "wrong/M",
        "missed/M",
        "invented/M",
        "t ulp",
        "void",
        "distance",
    ];
    header.extend(&names);
    let mut lines: Vec<Vec<String>> = vec![header.into_iter().map(String::from).collect()];
    for m in measured {
        let error = &m.error;
        let rate = |x: f64| if error.rays > 0 { format!("{x:.0}") } else { String::new() };
        let mut line = vec![
            if m.on_front { "*" } else { "" }.to_string(),
            m.structure.clone(),
            m.params.clone(),
            optional(m.build_ms, if m.build_ms.is_some_and(|ms| ms < 0.1) { 4 } else { 1 }),
            optional(m.bytes_per_prim, 1),
            format!("{:.1}", m.ns_per_ray),
            format!("{:.2}", m.spread),
            format!("{:.2}", m.speed),
            optional(m.nodes_per_ray, 1),
            optional(m.tests_per_ray, 1),
            rate(error.wrong_per_million()),
            rate(error.missed_per_million()),
            rate(error.invented_per_million()),
            match m.has_t.then_some(error.t_ulp) {
                Some(ulps) if ulps > 1e5 => format!("{ulps:.1e}"),
                ulps => optional(ulps, 2),
            },
            optional(m.off.filter(|(kind, _)| *kind == ErrorKind::Void).map(|(_, off)| off), 3),
            m.off
                .filter(|(kind, _)| *kind == ErrorKind::Distance)
                .map_or_else(String::new, |(_, off)| format!("{off:.2e}")),
        ];
        for name in &names {
            let told = m.figures.iter().find(|(own, _)| own == name);
            line.push(optional(told.map(|(_, x)| *x), 3));
        }
        lines.push(line);
    }
    // What nobody tells takes no room.
    let told: Vec<bool> = (0..lines[0].len())
        .map(|column| column < 3 || lines[1..].iter().any(|line| !line[column].is_empty()))
        .collect();
    for line in &mut lines {
        let mut kept = told.iter();
        line.retain(|_| *kept.next().unwrap_or(&true));
        line.iter_mut().skip(3).filter(|cell| cell.is_empty()).for_each(|cell| *cell = "-".into());
    }
    aligned(&lines)
}

/// Columns under each other; the first three to the left, numbers to the right.
fn aligned(lines: &[Vec<String>]) -> String {
    let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |column: usize| lines.iter().filter_map(|line| line.get(column)).map(|s| s.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    let mut out = String::new();
    for line in lines {
        let mut row = String::new();
        for (column, (cell, width)) in line.iter().zip(&widths).enumerate() {
            let _ = match column {
                0 => write!(row, "{cell:width$}"),
                1 | 2 => write!(row, " {cell:width$}"),
                _ => write!(row, "  {cell:>width$}"),
            };
        }
        out += row.trim_end();
        out.push('\n');
    }
    out
}

/// For contestants in several groups: the geometric mean of the speed against the first, and of build times against its.
fn means(groups: &[Group]) -> Option<String> {
    let timed: Vec<&Vec<Measured>> = groups.iter().filter_map(|group| group.outcome.as_ref().ok()).collect();
    let who = |m: &Measured| (m.structure.clone(), m.params.clone());
    // Groups that begin with the same contestant are measured by the same rod.
    let mut rods: Vec<(String, String)> = Vec::new();
    for first in timed.iter().filter_map(|group| group.first()) {
        if !rods.contains(&who(first)) {
            rods.push(who(first));
        }
    }
    let tables: String = rods
        .iter()
        .filter_map(|rod| {
            let same: Vec<&Vec<Measured>> = timed
                .iter()
                .copied()
                .filter(|group| group.first().is_some_and(|first| who(first) == *rod))
                .collect();
            means_against(rod, &same)
        })
        .collect();
    (!tables.is_empty()).then_some(tables)
}

/// Means over groups that begin with the same contestant.
fn means_against(rod: &(String, String), timed: &[&Vec<Measured>]) -> Option<String> {
    let mut names: Vec<(&str, &str)> = Vec::new();
    for m in timed.iter().copied().flatten() {
        if !names.contains(&(&m.structure, &m.params)) {
            names.push((&m.structure, &m.params));
        }
    }
    if timed.len() < 2 || names.len() < 2 {
        return None;
    }
    let mut lines =
        vec![["", "structure", "params", "groups", "speed", "build time"].map(String::from).to_vec()];
    for (structure, params) in names {
        let (mut speeds, mut builds) = (Vec::new(), Vec::new());
        for group in timed {
            let Some(m) = group.iter().find(|m| m.structure == structure && m.params == params) else {
                continue;
            };
            speeds.push(m.speed);
            if let (Some(own), Some(first)) = (m.build_ms, group.first().and_then(|first| first.build_ms)) {
                builds.push(own / first);
            }
        }
        lines.push(vec![
            String::new(),
            structure.to_string(),
            params.to_string(),
            speeds.len().to_string(),
            format!("{:.3}", geometric_mean(&speeds)),
            if builds.is_empty() { "-".into() } else { format!("{:.2}", geometric_mean(&builds)) },
        ]);
    }
    let rod = format!("{} {}", rod.0, rod.1);
    Some(format!("\ngeometric means against {}\n{}", rod.trim_end(), aligned(&lines)))
}

fn geometric_mean(numbers: &[f64]) -> f64 {
    (numbers.iter().map(|x| x.ln()).sum::<f64>() / numbers.len().max(1) as f64).exp()
}

fn json(stamp: &Stamp, threads: u16, answers: &[(Question, Vec<Group>)]) -> Json {
    let optional = |x: Option<f64>| Json::Number(x.unwrap_or(f64::NAN));
    let measured = |m: &Measured| {
        Json::Object(vec![
            ("structure", Json::Text(m.structure.clone())),
            ("params", Json::Text(m.params.clone())),
            ("build_ms", optional(m.build_ms)),
            ("bytes_per_prim", optional(m.bytes_per_prim)),
            ("ns_per_ray", Json::Number(m.ns_per_ray)),
            ("spread", Json::Number(m.spread)),
            ("speed", Json::Number(m.speed)),
            ("nodes_per_ray", optional(m.nodes_per_ray)),
            ("tests_per_ray", optional(m.tests_per_ray)),
            ("sah", optional(m.sah)),
            ("wrong_per_million", Json::Number(m.error.wrong_per_million())),
            ("missed_per_million", Json::Number(m.error.missed_per_million())),
            ("invented_per_million", Json::Number(m.error.invented_per_million())),
            ("t_ulp", optional(m.has_t.then_some(m.error.t_ulp))),
            ("off", optional(m.off.map(|(_, off)| off))),
            ("off_kind", Json::Text(m.off.map_or_else(String::new, |(kind, _)| kind.name().to_string()))),
            ("figures", Json::Object(m.figures.iter().map(|(name, x)| (*name, Json::Number(*x))).collect())),
            ("on_front", Json::Whole(m.on_front.into())),
        ])
    };
    let group = |group: &Group| {
        let mut fields = vec![
            ("scene", Json::Text(group.scene.clone())),
            ("primitives", Json::Whole(group.prims as u64)),
            ("ray_kind", Json::Text(group.ray_kind.clone())),
            ("rays", Json::Whole(group.rays as u64)),
            ("judged", Json::Whole(group.judged as u64)),
        ];
        match &group.outcome {
            Ok(all) => fields.push(("measured", Json::List(all.iter().map(measured).collect()))),
            Err(mismatch) => fields.push(("mismatch", Json::Text(mismatch.to_string()))),
        }
        Json::Object(fields)
    };
    let answer = |(question, groups): &(Question, Vec<Group>)| {
        Json::Object(vec![
            ("question", Json::Text(question.name().into())),
            ("groups", Json::List(groups.iter().map(group).collect())),
        ])
    };
    Json::Object(vec![
        ("schema", Json::Whole(1)),
        ("date", Json::Text(stamp.date.clone())),
        ("machine", Json::Text(stamp.machine.clone())),
        ("commit", Json::Text(stamp.commit.clone())),
        ("threads", Json::Whole(threads.into())),
        ("answers", Json::List(answers.iter().map(answer).collect())),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates_and_machines_names() {
        let all = [(0, "1970-01-01"), (59, "1970-03-01"), (11_016, "2000-02-29"), (19_723, "2024-01-01")];
        assert_eq!(all.map(|(days, _)| date(days)), all.map(|(_, text)| text.to_string()));
        assert_eq!(date(20_818), "2026-12-31");
        assert_eq!(sanitised(" AMD EPYC(tm) 9R14/2 "), "amd-epyc-tm-9r14-2");
        assert_eq!(sanitised("../.."), "unknown");
        assert!(machine().ends_with("-cores"));
    }

    #[test]
    fn records_grow_and_are_never_spoilt() {
        let folder = std::env::temp_dir().join(format!("xtask-record-{}", std::process::id()));
        let stamp = Stamp { date: "2026-01-31".into(), machine: "m".into(), commit: "c".into() };
        let path = record_path(&folder, &stamp);
        let options =
            Options { scenes: Some(vec![Subject::named("tetra-3").unwrap()]), effort: Effort::Quick };
        let groups = ask(Question::Any, &options, &mut |_| std::ops::ControlFlow::Continue(())).unwrap();
        let rows = || groups.iter().flat_map(|group| group.rows(&stamp));
        let count = rows().count();
        assert!(count >= 6 && text(Question::Any, &groups).contains("exhaustive"));
        for round in 1..=2 {
            let before = read_record(&path).unwrap();
            assert_eq!(append(&path, before, rows(), 2).unwrap(), count);
            let read = parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
            assert_eq!(read.len(), round * count);
            assert!(read[0].params.ends_with(" threads=2"), "{}", read[0].params);
        }
        std::fs::write(&path, "something else\n").unwrap();
        assert!(matches!(read_record(&path), Err(Failure::File(_))));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

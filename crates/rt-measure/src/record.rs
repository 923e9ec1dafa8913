//! Records: one measurement, one row of CSV.
//!
//! A measurement without an error is no measurement: a [`Row`] has no place for a missing one, and refuses a NaN. What a rival
//! does not tell (nodes per ray, say) is `None` and an empty field.

use core::fmt;
use core::str::FromStr;

/// What an error counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// Hits lost, per million rays.
    Missed,
    /// Hits made up, per million rays.
    Invented,
    /// The share of rays, per million, whose hit, miss or primitive differs from the exact one.
    Wrong,
    /// The largest error of `t`, in units in the last place.
    TUlp,
    /// What a bounding volume encloses in vain: the share of the lines that meet it which miss the thing inside.
    Void,
    /// The largest distance of an approximate surface from the exact one, as a share of its size.
    Distance,
    /// The root mean squared difference of images.
    Rmse,
}

impl ErrorKind {
    /// All kinds.
    pub const ALL: [ErrorKind; 7] = [
        ErrorKind::Missed,
        ErrorKind::Invented,
        ErrorKind::Wrong,
        ErrorKind::TUlp,
        ErrorKind::Void,
        ErrorKind::Distance,
        ErrorKind::Rmse,
    ];

    /// The word in the record.
    pub fn name(self) -> &'static str {
        match self {
            ErrorKind::Missed => "missed",
            ErrorKind::Invented => "invented",
            ErrorKind::Wrong => "wrong",
            ErrorKind::TUlp => "t_ulp",
            ErrorKind::Void => "void",
            ErrorKind::Distance => "distance",
            ErrorKind::Rmse => "rmse",
        }
    }
}

impl FromStr for ErrorKind {
    type Err = ();
    fn from_str(name: &str) -> Result<ErrorKind, ()> {
        ErrorKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or(())
    }
}

impl fmt::Display for ErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One measurement.
///
/// ```
/// use rt_measure::record::{ErrorKind, HEADER, Row, parse};
/// let row = Row {
///     date: "2026-01-31".into(), machine: "two cores".into(), commit: "4f0b8ff".into(),
///     scene: "balls, 3".into(), structure: "bvh".into(), params: "leaf=4".into(), ray_kind: "primary".into(),
///     rays: 1 << 20, build_ms: Some(8.5), bytes_per_prim: Some(64.0), ns_per_ray: 102.5, spread: 1.05,
///     nodes_per_ray: Some(20.25), tests_per_ray: Some(3.5), sah: None,
///     error_kind: ErrorKind::Wrong, error: 0.0,
/// };
/// let text = format!("{HEADER}\n{}\n", row.to_csv().unwrap());
/// assert_eq!(parse(&text).unwrap(), [row]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The day, as in 2026-01-31.
    pub date: String,
    /// The machine.
    pub machine: String,
    /// The commit measured.
    pub commit: String,
    /// The scene and its size.
    pub scene: String,
    /// The structure, or the rival.
    pub structure: String,
    /// Its parameters.
    pub params: String,
    /// The kind of rays: primary, shadow, diffuse, uniform.
    pub ray_kind: String,
    /// How many rays.
    pub rays: u64,
    /// Milliseconds to build.
    pub build_ms: Option<f64>,
    /// Heap bytes of the structure, by primitive.
    pub bytes_per_prim: Option<f64>,
    /// Nanoseconds a ray, the median of rounds.
    pub ns_per_ray: f64,
    /// The 90th percentile of rounds over the 10th.
    pub spread: f64,
    /// Nodes opened, by ray.
    pub nodes_per_ray: Option<f64>,
    /// Primitives tested, by ray.
    pub tests_per_ray: Option<f64>,
    /// The cost that the surface area heuristic predicts.
    pub sah: Option<f64>,
    /// What `error` counts.
    pub error_kind: ErrorKind,
    /// The error; exact methods show 0. Never NaN, never negative; may be infinite.
    pub error: f64,
}

/// The names of the columns.
const COLUMNS: [&str; 17] = [
    "date",
    "machine",
    "commit",
    "scene",
    "structure",
    "params",
    "ray_kind",
    "rays",
    "build_ms",
    "bytes_per_prim",
    "ns_per_ray",
    "spread",
    "nodes_per_ray",
    "tests_per_ray",
    "sah",
    "error_kind",
    "error",
];

/// The first line of a record.
pub const HEADER: &str = "date,machine,commit,scene,structure,params,ray_kind,rays,build_ms,bytes_per_prim,ns_per_ray,\
                          spread,nodes_per_ray,tests_per_ray,sah,error_kind,error";

impl Row {
    /// The row as a line of CSV, without its end. Numbers are written so that they read back exactly.
    ///
    /// # Errors
    ///
    /// [`RecordError`] with line 0 when the error or a time is NaN or negative.
    pub fn to_csv(&self) -> Result<String, RecordError> {
        let numbers = [("ns_per_ray", self.ns_per_ray), ("spread", self.spread), ("error", self.error)];
        for (column, value) in numbers {
            if value.is_nan() || value < 0.0 {
                return Err(RecordError { line: 0, column, value: value.to_string() });
            }
        }
        let optional = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
        let texts = [
            &self.date,
            &self.machine,
            &self.commit,
            &self.scene,
            &self.structure,
            &self.params,
            &self.ray_kind,
        ];
        let mut fields: Vec<String> = texts.map(|text| quoted(text)).to_vec();
        fields.push(self.rays.to_string());
        fields.extend([self.build_ms, self.bytes_per_prim].map(optional));
        fields.extend([self.ns_per_ray.to_string(), self.spread.to_string()]);
        fields.extend([self.nodes_per_ray, self.tests_per_ray, self.sah].map(optional));
        fields.extend([self.error_kind.to_string(), self.error.to_string()]);
        Ok(fields.join(","))
    }
}

/// A field that cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordError {
    /// The line of the text, counted from 1; 0 for a row that is not in a text.
    pub line: usize,
    /// The column; `"header"` for a first line that is not [`HEADER`], `"row"` for one with too few or too many fields or an
    /// open quote.
    pub column: &'static str,
    /// What stands there.
    pub value: String,
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.line > 0 {
            write!(f, "line {}: ", self.line)?;
        }
        write!(f, "{} cannot be {:?}", self.column, self.value)
    }
}

impl core::error::Error for RecordError {}

/// Reads a record: the header, then rows. Empty lines are passed over.
///
/// # Errors
///
/// The first field that does not fit, by line and column.
pub fn parse(text: &str) -> Result<Vec<Row>, RecordError> {
    let mut lines = split(text)?.into_iter();
    match lines.next() {
        Some(Line { fields, .. }) if fields == COLUMNS => {}
        first => {
            let value = first.map(|line| line.fields.join(",")).unwrap_or_default();
            return Err(RecordError { line: 1, column: "header", value });
        }
    }
    lines.map(row).collect()
}

/// The fields of one row, and where it begins.
struct Line {
    number: usize,
    fields: Vec<String>,
}

fn row(line: Line) -> Result<Row, RecordError> {
    let number = line.number;
    let Ok(fields) = <[String; 17]>::try_from(line.fields) else {
        return Err(RecordError { line: number, column: "row", value: "too few or too many fields".into() });
    };
    let error = |at: usize| RecordError { line: number, column: COLUMNS[at], value: fields[at].clone() };
    // Times, sizes and errors: no NaN, nothing below zero.
    let positive = |at: usize| fields[at].parse::<f64>().ok().filter(|x| *x >= 0.0).ok_or_else(|| error(at));
    let optional = |at: usize| if fields[at].is_empty() { Ok(None) } else { positive(at).map(Some) };
    let text = |at: usize| fields[at].clone();
    Ok(Row {
        date: text(0),
        machine: text(1),
        commit: text(2),
        scene: text(3),
        structure: text(4),
        params: text(5),
        ray_kind: text(6),
        rays: fields[7].parse().map_err(|_| error(7))?,
        build_ms: optional(8)?,
        bytes_per_prim: optional(9)?,
        ns_per_ray: positive(10)?,
        spread: positive(11)?,
        nodes_per_ray: optional(12)?,
        tests_per_ray: optional(13)?,
        sah: optional(14)?,
        error_kind: fields[15].parse().map_err(|()| error(15))?,
        error: positive(16)?,
    })
}

/// A text in quotes where it needs them.
///
/// Source: RFC 4180, "Common Format and MIME Type for CSV Files", 2005, section 2.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_string()
    }
}

/// The rows of a text; quoted fields may hold commas, quotes and ends of lines.
fn split(text: &str) -> Result<Vec<Line>, RecordError> {
    let (mut lines, mut fields, mut field) = (Vec::new(), Vec::new(), String::new());
    let (mut number, mut begin, mut quoted) = (1, 1, false);
    // An end for the last line, if it has none.
    let mut chars = text.chars().chain(['\n']).peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                field.push('"');
            }
            '"' if quoted || field.is_empty() => quoted = !quoted,
            ',' if !quoted => fields.push(core::mem::take(&mut field)),
            '\n' if !quoted => {
                if !(fields.is_empty() && field.is_empty()) {
                    fields.push(core::mem::take(&mut field));
                    lines.push(Line { number: begin, fields: core::mem::take(&mut fields) });
                }
                begin = number + 1;
            }
            '\r' if !quoted && chars.peek() == Some(&'\n') => {}
            _ => field.push(c),
        }
        number += (c == '\n') as usize;
    }
    if quoted {
        return Err(RecordError { line: begin, column: "row", value: field });
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> Row {
        Row {
            date: "2026-01-31".into(),
            machine: "m".into(),
            commit: "c".into(),
            scene: "s".into(),
            structure: "bvh".into(),
            params: String::new(),
            ray_kind: "uniform".into(),
            rays: 10,
            build_ms: Some(0.1),
            bytes_per_prim: None,
            ns_per_ray: 1e-7,
            spread: 1.0,
            nodes_per_ray: None,
            tests_per_ray: Some(1.0 / 3.0),
            sah: Some(12.0),
            error_kind: ErrorKind::TUlp,
            error: 0.5,
        }
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(scene in "[a\",\n\r ]{0,9}", params in "\\PC{0,9}", ns in 0.0..1e300f64) {
            let row = Row { scene, params, ns_per_ray: ns, ..sample() };
            let text = format!("{HEADER}\r\n\r\n{}\r\n{}", row.to_csv().unwrap(), sample().to_csv().unwrap());
            prop_assert_eq!(parse(&text).unwrap(), [row, sample()]);
        }

        #[test]
        fn no_text_panics(text in "(date|[,\"\n\r]|\\PC){0,40}") {
            let _: Result<_, _> = parse(&text);
            let _: Result<_, _> = parse(&format!("{HEADER}\n{text}"));
        }
    }

    #[test]
    fn a_row_without_an_error_is_refused() {
        for error in [f64::NAN, -1.0] {
            let refused = Row { error, ..sample() }.to_csv().unwrap_err();
            assert_eq!((refused.line, refused.column), (0, "error"));
        }
        assert!(Row { ns_per_ray: f64::NAN, ..sample() }.to_csv().is_err());
        assert!(Row { error: f64::INFINITY, ..sample() }.to_csv().is_ok());
    }

    #[test]
    fn errors_name_line_and_value() {
        assert_eq!(HEADER.split(',').collect::<Vec<_>>(), COLUMNS);
        let good = sample().to_csv().unwrap();
        let of = |line: &str| parse(&format!("{HEADER}\n{good}\n\n{line}\n")).unwrap_err();
        let error = of(&good.replace("t_ulp", "tulp"));
        assert_eq!((error.line, error.column, error.value.as_str()), (4, "error_kind", "tulp"));
        assert_eq!(error.to_string(), "line 4: error_kind cannot be \"tulp\"");
        assert_eq!(of(&good.replace(",0.5", ",NaN")).column, "error");
        assert_eq!(of(&good.replace(",0.5", ",")).column, "error");
        assert_eq!(of(&good.replace(",10,", ",ten,")).column, "rays");
        assert_eq!(of("a,b").column, "row");
        assert_eq!(of("\"a,b").column, "row");
        assert_eq!(parse("").unwrap_err().column, "header");
        assert_eq!(parse("date,machine\n").unwrap_err().value, "date,machine");
    }
}

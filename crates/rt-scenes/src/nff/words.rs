//! [`Words`]: what stands between blanks.

use super::NffProblem;
use rt_geom::glam::DVec3;

/// The words of a file, one after another, and the line of the last.
pub(super) struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

/// A point of either precision.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) wide: DVec3,
    pub(super) single: [f32; 3],
}

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Words<'a> {
        Words { bytes, at: 0, line: 1 }
    }

    /// The line of the last word, from 1.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// Where the next word begins and ends, past comments; and its line.
    fn find(&self) -> Option<(usize, usize, usize)> {
        let (mut at, mut line) = (self.at, self.line);
        loop {
            match *self.bytes.get(at)? {
                b'\n' => line += 1,
                b'#' => {
                    let rest = &self.bytes[at..];
                    // To the end of the line, which is counted next.
                    at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                    continue;
                }
                b if b.is_ascii_whitespace() => {}
                _ => break,
            }
            at += 1;
        }
        let word = &self.bytes[at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || *b == b'#';
        Some((at, at + word.iter().position(ends).unwrap_or(word.len()), line))
    }

    /// The next word, if there is one.
    pub(super) fn next(&mut self) -> Result<Option<&'a str>, NffProblem> {
        let Some((from, to, line)) = self.find() else { return Ok(None) };
        (self.at, self.line) = (to, line);
        let word = &self.bytes[from..to];
        if word.contains(&0) {
            return Err(NffProblem::NotText);
        }
        std::str::from_utf8(word).map(Some).map_err(|_| NffProblem::NotText)
    }

    /// The next word, which stays next.
    pub(super) fn peek(&self) -> Result<Option<&'a str>, NffProblem> {
        Words { ..*self }.next()
    }

    /// Past the next word.
    pub(super) fn skip(&mut self) -> &mut Self {
        if let Some((_, to, line)) = self.find() {
            (self.at, self.line) = (to, line);
        }
        self
    }

    /// Whether the next word is a number.
    pub(super) fn number_follows(&self) -> Result<bool, NffProblem> {
        Ok(self.peek()?.is_some_and(|word| word.parse::<f64>().is_ok()))
    }

    /// The next word, which must be a finite number, and that number.
    fn digits(&mut self, what: &'static str) -> Result<(&'a str, f64), NffProblem> {
        let word = self.next()?.ok_or(NffProblem::Ends { what })?;
        let value: f64 = word.parse().map_err(|_| NffProblem::Number { what, found: start(word) })?;
        if value.is_finite() {
            Ok((word, value))
        } else {
            Err(NffProblem::NotFinite { what, found: start(word) })
        }
    }

    pub(super) fn number(&mut self, what: &'static str) -> Result<f64, NffProblem> {
        self.digits(what).map(|(_, value)| value)
    }

    /// A number as `f32` reads it.
    pub(super) fn single(&mut self, what: &'static str) -> Result<f32, NffProblem> {
        let (word, _) = self.digits(what)?;
        let value = word.parse().unwrap_or(f32::NAN);
        if value.is_finite() { Ok(value) } else { Err(NffProblem::NotFinite { what, found: start(word) }) }
    }

    pub(super) fn point(&mut self, what: &'static str) -> Result<DVec3, NffProblem> {
        Ok(DVec3::new(self.number(what)?, self.number(what)?, self.number(what)?))
    }

    /// A point as `f64` and as `f32` read it: rounding the one does not always give the other.
    pub(super) fn place(&mut self, what: &'static str) -> Result<Place, NffProblem> {
        let (mut wide, mut single) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (word, value) = self.digits(what)?;
            (wide[i], single[i]) = (value, word.parse().unwrap_or(f32::NAN));
        }
        Ok(Place { wide: DVec3::from_array(wide), single })
    }

    /// Three numbers of `f32`.
    pub(super) fn color(&mut self, what: &'static str) -> Result<[f32; 3], NffProblem> {
        Ok([self.single(what)?, self.single(what)?, self.single(what)?])
    }
}

/// Enough of a word for a message.
pub(super) fn start(word: &str) -> String {
    word.chars().take(40).collect()
}

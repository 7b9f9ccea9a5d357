//! The error type of the crate, and the flag by which a caller stops a long call.

use std::fmt;
use std::path::Path;

use serde::Serialize;

/// An error, in kinds that a caller can distinguish.
///
/// Each text is one line: the place, the value there, and what is valid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Bytes or files with invalid content.
    #[error("{0}")]
    Format(Reason),
    /// Arguments, spike trains or a learning problem that are not valid.
    #[error("{0}")]
    Problem(Reason),
    /// An error of the board, its registers or its commands.
    #[error("{0}")]
    Device(Reason),
    /// A simulated scene that cannot be played.
    #[error("{0}")]
    Scene(Reason),
    /// The caller asked to stop (Ctrl-C).
    #[error("stopped before the end")]
    Interrupted,
}

impl Error {
    /// The error of bytes or a file. Its text stays as it is: a file's name may hold many digits.
    #[must_use]
    pub fn format(text: impl Into<String>) -> Self {
        Self::Format(Reason { text: text.into(), place: None, argument: None, hint: None })
    }

    /// The error of a board.
    #[must_use]
    pub fn device(text: impl Into<Reason>) -> Self {
        Self::Device(text.into())
    }

    /// The error of a scene.
    #[must_use]
    pub fn scene(text: impl Into<Reason>) -> Self {
        Self::Scene(text.into())
    }

    /// The same error as one of bytes or a file.
    #[must_use]
    pub fn into_format(self) -> Self {
        if let Self::Problem(reason) = self { Self::Format(reason) } else { self }
    }

    /// What is refused and why; `None` if the caller asked to stop.
    #[must_use]
    pub fn reason(&self) -> Option<&Reason> {
        match self {
            Self::Format(reason) | Self::Problem(reason) | Self::Device(reason) | Self::Scene(reason) => Some(reason),
            Self::Interrupted => None,
        }
    }

    /// The error of a parameter: its text continues after the parameter's name.
    #[must_use]
    pub fn argument(name: impl Into<String>, text: &str) -> Self {
        Self::Problem(Reason { argument: Some(name.into()), ..text.into() })
    }

    /// The same error with a remedy, of which `argument` is the parameter that helps.
    #[must_use]
    pub fn with_hint(self, argument: &str, hint: Hint) -> Self {
        self.with(|reason| Reason { argument: Some(argument.to_owned()), hint: Some(hint), ..reason })
    }

    /// The same error of a file, or of a line or byte; what it knows of its place already stays.
    #[must_use]
    pub fn at(self, place: Place) -> Self {
        self.with(|reason| {
            let known = reason.place.unwrap_or_default();
            let line_or_byte = if known.line.or(known.byte).is_some() { &known } else { &place };
            let (line, byte) = (line_or_byte.line, line_or_byte.byte);
            Reason { place: Some(Place { file: known.file.or(place.file), line, byte }), ..reason }
        })
    }

    /// The same error, with the name of the part that it is of in front of its text.
    #[must_use]
    pub fn in_part(self, part: &str) -> Self {
        self.with(|reason| reason.in_part(part))
    }

    fn with(self, change: impl FnOnce(Reason) -> Reason) -> Self {
        match self {
            Self::Format(reason) => Self::Format(change(reason)),
            Self::Problem(reason) => Self::Problem(change(reason)),
            Self::Device(reason) => Self::Device(change(reason)),
            Self::Scene(reason) => Self::Scene(change(reason)),
            Self::Interrupted => self,
        }
    }
}

/// What is refused and why, and what helps, as data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reason {
    /// What is wrong. It continues after the name of the parameter unless there is a hint.
    pub text: String,
    /// Where it is wrong, in a file or in a text or bytes in memory.
    pub place: Option<Place>,
    /// The parameter that is wrong, or that helps, as the caller writes it.
    pub argument: Option<String>,
    /// The kind of remedy.
    pub hint: Option<Hint>,
}

impl Reason {
    /// The parameter is one of the part, so that a caller of the whole has no argument of that name; a remedy stays.
    fn in_part(self, part: &str) -> Self {
        match self.hint {
            None => {
                let text = format!("{part}: {}{}", self.argument.unwrap_or_default(), self.text);
                Self { text, argument: None, ..self }
            }
            Some(_) => Self { text: format!("{part}: {}", self.text), ..self },
        }
    }
}

/// A place in a file, or in a text or bytes in memory.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// The file; `None` in memory.
    pub file: Option<String>,
    /// The line, counted from 1.
    pub line: Option<u64>,
    /// The byte, counted from 0.
    pub byte: Option<u64>,
}

impl Place {
    /// A whole file.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self { file: Some(path.display().to_string()), ..Self::default() }
    }

    /// A line, counted from 1.
    #[must_use]
    pub fn line(line: u64) -> Self {
        Self { line: Some(line), ..Self::default() }
    }

    /// A byte, counted from 0.
    #[must_use]
    pub fn byte(byte: u64) -> Self {
        Self { byte: Some(byte), ..Self::default() }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = self.line.map(|line| format!("line {line}"));
        let byte = self.byte.map(|byte| format!("byte {byte}"));
        let parts: Vec<String> = [self.file.clone(), line, byte].into_iter().flatten().collect();
        f.write_str(&parts.join(", "))
    }
}

/// Without the remedy, which the command line and the page put into words of their own.
impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{place}: ")?;
        }
        if let (None, Some(argument)) = (self.hint, &self.argument) {
            f.write_str(argument)?;
        }
        f.write_str(&self.text)
    }
}

impl From<&str> for Reason {
    fn from(text: &str) -> Self {
        Self { text: readable(text), place: None, argument: None, hint: None }
    }
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        text.as_str().into()
    }
}

/// What helps against an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Hint {
    /// Give the parameter, which is left out.
    Give,
    /// Give the grid of which a row of channels are the taxels.
    LayOut,
    /// Give the distance of the taxels.
    Pitch,
}

/// Digits of a number that people read: more than that of any time in us or ns, or of a rounded fraction.
const READ: usize = 24;

/// The text with numbers of more digits in scientific notation: `format!` writes 1e308 with 309 digits.
fn readable(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    for piece in text.split_inclusive(|c| !is_part(c)) {
        let digits = piece.trim_end_matches(|c| !is_part(c));
        let number = digits.trim_end_matches('.');
        match number.parse::<f64>() {
            Ok(value) if number.len() > READ => out.extend([&format!("{value:e}"), &piece[number.len()..]]),
            _ => out.push_str(piece),
        }
    }
    out
}

/// The result of each function in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Makes an [`Error::Problem`] from a format string; after a parameter's name and a semicolon, one of that parameter.
#[macro_export]
macro_rules! problem {
    ($argument:expr; $($text:tt)*) => { $crate::Error::argument($argument, &format!($($text)*)) };
    ($($text:tt)*) => { $crate::Error::Problem(format!($($text)*).into()) };
}

/// Checks at intervals whether the caller asked a long call to end early.
///
/// A loop that can take longer than a tenth of a second must call [`Stop::check`] every few milliseconds of work.
#[derive(Clone, Copy)]
pub struct Stop<'a>(&'a (dyn Fn() -> bool + Sync));

impl<'a> Stop<'a> {
    /// Stops when `asked` returns true.
    #[must_use]
    pub fn when(asked: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self(asked)
    }

    /// Never stops.
    #[must_use]
    pub fn never() -> Stop<'static> {
        Stop(&|| false)
    }

    /// Whether the caller asked to stop.
    #[must_use]
    pub fn asked(&self) -> bool {
        (self.0)()
    }

    /// Ends the call if the caller asked to stop.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] if the caller asked to stop.
    pub fn check(&self) -> Result<()> {
        if self.asked() { Err(Error::Interrupted) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{Error, Place};

    #[test]
    fn an_error_of_a_file_keeps_what_it_knows_of_its_place() {
        let of_text = Error::format("is not a number").at(Place::line(3)).in_part("rest");
        let of_file = of_text.at(Place::file(Path::new("a.json"))).at(Place::file(Path::new("b.zip")));
        let place = of_file.reason().unwrap().place.clone().unwrap();
        assert_eq!((place.file.as_deref(), place.line, place.byte), (Some("a.json"), Some(3), None));
        assert_eq!(of_file.to_string(), "a.json, line 3: rest: is not a number");
    }

    #[test]
    fn a_number_that_nobody_reads_digit_by_digit_is_in_scientific_notation() {
        let told = |value: f64| problem!("tau"; " is {value} ms: must be below 1.5").to_string();
        assert_eq!(told(1e308), "tau is 1e308 ms: must be below 1.5");
        assert_eq!(told(-5e-324), "tau is -5e-324 ms: must be below 1.5");
        assert_eq!(told(1_700_000_000_000_000_000.0), "tau is 1700000000000000000 ms: must be below 1.5");
        assert_eq!(problem!("up to {}.", 1e30).to_string(), "up to 1e30.");
        assert_eq!(problem!("é {} é", 1e30).to_string(), "é 1e30 é");
    }
}

//! The error type of the crate, and the flag by which a caller stops a long call.

/// An error, in kinds that a caller can distinguish.
///
/// Each text is one line: the place, the value there, and what is valid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Bytes or files with invalid content.
    #[error("{0}")]
    Format(String),
    /// Arguments, spike trains or a learning problem that are not valid.
    #[error("{}", readable(.0))]
    Problem(String),
    /// An error of the board, its registers or its commands.
    #[error("{}", readable(.0))]
    Device(String),
    /// A simulated scene that cannot be played.
    #[error("{}", readable(.0))]
    Scene(String),
    /// The caller asked to stop (Ctrl-C).
    #[error("stopped before the end")]
    Interrupted,
}

impl Error {
    /// The same error, with the name of the part that it is of in front of its text.
    #[must_use]
    pub fn of(self, part: &str) -> Self {
        if let Self::Problem(text) = self { Self::Problem(format!("{part}: {text}")) } else { self }
    }
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

/// Makes an [`Error::Problem`] from a format string.
#[macro_export]
macro_rules! problem {
    ($($text:tt)*) => { $crate::Error::Problem(format!($($text)*)) };
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
    #[test]
    fn a_number_that_nobody_reads_digit_by_digit_is_in_scientific_notation() {
        let told = |value: f64| problem!("tau is {value} ms: must lie below 1.5").to_string();
        assert_eq!(told(1e308), "tau is 1e308 ms: must lie below 1.5");
        assert_eq!(told(-5e-324), "tau is -5e-324 ms: must lie below 1.5");
        assert_eq!(told(1_700_000_000_000_000_000.0), "tau is 1700000000000000000 ms: must lie below 1.5");
        assert_eq!(problem!("up to {}.", 1e30).to_string(), "up to 1e30.");
        assert_eq!(problem!("é {} é", 1e30).to_string(), "é 1e30 é");
    }
}

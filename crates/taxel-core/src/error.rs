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
    #[error("{0}")]
    Problem(String),
    /// An error of the board, its registers or its commands.
    #[error("{0}")]
    Device(String),
    /// A simulated scene that cannot be played.
    #[error("{0}")]
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

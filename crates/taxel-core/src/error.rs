//! The one family of errors, and the flag by which a caller stops a long call.

/// What can go wrong, in kinds that a caller can tell apart.
///
/// Each text is one line: the place, what is there, what would be right.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Bytes or files that do not hold what they should.
    #[error("{0}")]
    Format(String),
    /// Arguments, spike trains or a learning problem that make no sense.
    #[error("{0}")]
    Problem(String),
    /// The board, its registers or its commands.
    #[error("{0}")]
    Device(String),
    /// A simulated scene that cannot be played.
    #[error("{0}")]
    Scene(String),
    /// The caller asked to stop (Ctrl-C).
    #[error("stopped before the end")]
    Interrupted,
}

/// The result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Makes an [`Error::Problem`] from a format string.
#[macro_export]
macro_rules! problem {
    ($($text:tt)*) => { $crate::Error::Problem(format!($($text)*)) };
}

/// Asks the caller, now and then, whether a long call should end early.
///
/// A loop that can take longer than a tenth of a second calls [`Stop::check`] every few milliseconds of work.
#[derive(Clone, Copy)]
pub struct Stop<'a>(&'a (dyn Fn() -> bool + Sync));

impl<'a> Stop<'a> {
    /// Stops when `asked` gives true.
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

    /// Ends the call where the caller asked to stop.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] where it did.
    pub fn check(&self) -> Result<()> {
        if self.asked() { Err(Error::Interrupted) } else { Ok(()) }
    }
}

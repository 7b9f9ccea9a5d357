//! What a client has received already, so that a frame contains only what it lacks.

use crate::columns::LATE_US;

/// What a client has received, so that a frame contains only what the client lacks.
pub(super) struct Delivered {
    /// The next frame replaces all columns of time that the client has.
    restart: bool,
    /// First column of time that the client lacks.
    from: i64,
    /// Restarts of the live source that the client knows.
    source_restarts: u64,
}

impl Delivered {
    pub(super) fn nothing() -> Self {
        Self { restart: true, from: i64::MIN, source_restarts: 0 }
    }

    /// All columns of time that the client has are of no more use.
    pub(super) fn invalidate(&mut self) {
        self.restart = true;
    }

    /// As [`Delivered::invalidate`], if the live source has restarted since the last call.
    pub(super) fn note_source_restarts(&mut self, restarts: u64) {
        self.restart |= std::mem::replace(&mut self.source_restarts, restarts) != restarts;
    }

    pub(super) fn is_restart(&self) -> bool {
        self.restart
    }

    /// First column of time that the next frame contains.
    pub(super) fn from(&self) -> i64 {
        if self.restart { i64::MIN } else { self.from }
    }

    /// Notes a frame up to column `last`, of columns of `column_us`.
    pub(super) fn frame(&mut self, last: i64, column_us: i64) {
        self.restart = false;
        // Late events still change the last columns, so they are sent again.
        self.from = last.saturating_sub(LATE_US / column_us + 1);
    }
}

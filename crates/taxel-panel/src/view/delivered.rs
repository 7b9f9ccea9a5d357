//! What a client has received already, so that a frame contains only what it lacks.

use std::time::{Duration, Instant};

use crate::columns::LATE_US;

/// Minimum time from one rest to the next, while the view moves.
const REST_EVERY: Duration = Duration::from_millis(500);

/// What a client has received, so that a frame contains only what the client lacks.
pub(super) struct Delivered {
    /// The next frame replaces all columns of time that the client has.
    restart: bool,
    /// First column of time that the client lacks.
    from: i64,
    /// The rest that the client has, and when it was sent.
    rest: Option<(u64, Instant)>,
    /// Restarts of the live source that the client knows.
    source_restarts: u64,
}

impl Delivered {
    pub(super) fn nothing() -> Self {
        Self { restart: true, from: i64::MIN, rest: None, source_restarts: 0 }
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

    /// The rest that the client has is of another state, whose numbers say nothing of this one's.
    pub(super) fn invalidate_rest(&mut self) {
        self.rest = None;
    }

    /// Whether the next frame contains the rest, of which this is the number. While the view `moves` another frame follows;
    /// one that stands may be the last, so it has its own rest.
    pub(super) fn needs_rest(&self, rests: u64, moves: bool) -> bool {
        let due = |at: Instant| !moves || at.elapsed() >= REST_EVERY;
        self.restart || self.rest.is_none_or(|(known, at)| known != rests && due(at))
    }

    /// Notes a frame up to column `last`, of columns of `column_us`; `rests` where it contains the rest.
    pub(super) fn frame(&mut self, last: i64, column_us: i64, rests: Option<u64>) {
        if let Some(rests) = rests {
            self.rest = Some((rests, Instant::now()));
        }
        self.restart = false;
        // Late events still change the last columns, so they are sent again.
        self.from = last.saturating_sub(LATE_US / column_us + 1);
    }
}

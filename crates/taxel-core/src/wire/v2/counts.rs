//! Counts of what a decoder of version 2 received and missed, and the board's own totals.

use serde::{Deserialize, Serialize};

/// The board's own totals since reset, as its status datagrams report them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BoardTotals {
    /// Number of scanned frames.
    pub frames: u64,
    /// Number of events sent in datagrams.
    pub events: u64,
    /// Number of events dropped because the queue was full.
    pub dropped: u64,
    /// Number of datagrams sent before this one.
    pub datagrams: u64,
    /// Number of conversions whose comparator had not returned.
    pub faults: u64,
}

/// Counts of what a decoder received and, by cause, missed.
///
/// `datagrams = intact + repeated + old + short + long + foreign + checksum`; `missing` counts, for each session, the
/// numbers up to its last intact datagram that never arrived: of the first session from its first intact one on, else from 0 on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Number of datagrams passed to the decoder.
    pub datagrams: u64,
    /// Number of datagrams that were decoded.
    pub intact: u64,
    /// Datagrams whose number was received before, with the same contents, or in a session that began again before this was
    /// recognised; not decoded.
    pub repeated: u64,
    /// Datagrams more than 65 536 numbers late, for which it is unknown whether they were received before; not decoded.
    pub old: u64,
    /// Refused datagrams: too short.
    pub short: u64,
    /// Refused datagrams: longer than 1400 bytes.
    pub long: u64,
    /// Refused datagrams: not of version 2, or of another board.
    pub foreign: u64,
    /// Datagrams among these that are intact, and of another board than the first: by its number, or as the session and number
    /// came before with other contents.
    pub other_board: u64,
    /// Refused datagrams: the checksum does not match.
    pub checksum: u64,
    /// Sequence numbers that never arrived intact: between the first and the last of a session, and after a reset from 0 on.
    pub missing: u64,
    /// By how much fewer numbers from before the beginning of a recording are missing since it began.
    #[serde(skip)]
    pub filled: i64,
    /// Datagrams of an unknown kind; skipped.
    pub unknown_kind: u64,
    /// Datagrams with unknown flags; decoded.
    pub unknown_flags: u64,
    /// Bodies that end within a word or have an offset that is too late; the words before are decoded.
    pub malformed: u64,
    /// Number of events on the array.
    pub events: u64,
    /// Events among these that were decoded from a state because its value differed from the taxel's.
    pub repaired: u64,
    /// Number of states on the array.
    pub states: u64,
    /// States among these that were too late: the taxel's value is newer, or the board was reset since.
    pub stale: u64,
    /// Number of events and states outside the array.
    pub outside: u64,
    /// Number of starts and stops.
    pub markers: u64,
    /// Markers with an unknown code; dropped.
    pub unknown_marker: u64,
    /// Datagrams that report events dropped by the board.
    pub dropped: u64,
    /// Events that the board dropped, by its own totals: from its reset or from its first totals on.
    pub events_dropped: u64,
    /// Number of detected resets.
    pub resets: u64,
    /// Differences from an unknown value; their events have no value.
    pub unknown_value: u64,
}

impl Counts {
    /// The difference from an earlier state of these counts, that at the beginning of a recording.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let missing = self.missing.saturating_add_signed(self.filled - earlier.filled);
        crate::counts_since! {
            self, earlier;
            datagrams, intact, repeated, old, short, long, foreign, other_board, checksum, unknown_kind, unknown_flags,
            malformed, events, repaired, states, stale, outside, markers, unknown_marker, dropped, events_dropped, resets,
            unknown_value;
            missing: missing.saturating_sub(earlier.missing), filled: 0
        }
    }
}

//! What a decoder of version 2 received and missed, and the board's own totals.

use serde::{Deserialize, Serialize};

/// The board's own totals since reset, as its status datagrams say them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Status {
    /// Frames scanned.
    pub frames: u64,
    /// Events put into datagrams.
    pub events: u64,
    /// Events dropped, because the queue was full.
    pub dropped: u64,
    /// Datagrams made before this one.
    pub datagrams: u64,
    /// Conversions whose comparator had not returned.
    pub faults: u64,
}

/// What a decoder received, and all that it missed, by cause.
///
/// `datagrams = intact + repeated + old + short + long + foreign + checksum`; of each session `missing` numbers lie between the first and the last
/// intact one and never came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Datagrams given to the decoder.
    pub datagrams: u64,
    /// Those that were decoded.
    pub intact: u64,
    /// Came again, and were not decoded again.
    pub repeated: u64,
    /// Came more than 65 536 numbers late, so that it is unknown whether they came before; not decoded.
    pub old: u64,
    /// Refused: too short.
    pub short: u64,
    /// Refused: longer than 1400 bytes.
    pub long: u64,
    /// Refused: not of version 2, or of another board.
    pub foreign: u64,
    /// Refused: the checksum disagrees.
    pub checksum: u64,
    /// Sequence numbers that never came intact, between the first and the last of each session.
    pub missing: u64,
    /// Of a kind that is not known; skipped.
    pub unknown_kind: u64,
    /// With flags that are not known; decoded.
    pub unknown_flags: u64,
    /// Bodies that end within a word or have an offset that is too late; what stands before is decoded.
    pub malformed: u64,
    /// Events on the array.
    pub events: u64,
    /// Of these, those that a state gave, because its value differed from the held one.
    pub repaired: u64,
    /// States on the array.
    pub states: u64,
    /// Of these, those that came too late: the taxel's value is newer, or the board was reset since.
    pub stale: u64,
    /// Events and states outside the array.
    pub outside: u64,
    /// Starts and stops.
    pub markers: u64,
    /// Markers of a code that is not known; left out.
    pub unknown_marker: u64,
    /// Datagrams in which the board reports dropped events.
    pub dropped: u64,
    /// Resets that were noticed.
    pub resets: u64,
    /// Differences from an unknown value: their events have none.
    pub unknown_value: u64,
}

impl Counts {
    /// What was counted since an earlier time; numbers that were missing then and came later leave none missing.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            datagrams: self.datagrams - earlier.datagrams,
            intact: self.intact - earlier.intact,
            repeated: self.repeated - earlier.repeated,
            old: self.old - earlier.old,
            short: self.short - earlier.short,
            long: self.long - earlier.long,
            foreign: self.foreign - earlier.foreign,
            checksum: self.checksum - earlier.checksum,
            missing: self.missing.saturating_sub(earlier.missing),
            unknown_kind: self.unknown_kind - earlier.unknown_kind,
            unknown_flags: self.unknown_flags - earlier.unknown_flags,
            malformed: self.malformed - earlier.malformed,
            events: self.events - earlier.events,
            repaired: self.repaired - earlier.repaired,
            states: self.states - earlier.states,
            stale: self.stale - earlier.stale,
            outside: self.outside - earlier.outside,
            markers: self.markers - earlier.markers,
            unknown_marker: self.unknown_marker - earlier.unknown_marker,
            dropped: self.dropped - earlier.dropped,
            resets: self.resets - earlier.resets,
            unknown_value: self.unknown_value - earlier.unknown_value,
        }
    }
}

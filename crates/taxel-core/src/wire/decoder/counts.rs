//! What a decoder of version 1 read, and what it dropped.

use serde::{Deserialize, Serialize};

/// What a decoder read, and all that it dropped, by cause.
///
/// The sums close at any time: `bytes = 5 words + skipped`, and
/// `words = changes + intensities + unpaired + markers + contradictory + outside`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Bytes read; up to four of a word that is not complete count when it is, or when it is given up.
    pub bytes: u64,
    /// Complete words, of whatever kind.
    pub words: u64,
    /// Bytes that belong to no complete word: those of short events, and those before the next first byte.
    pub skipped: u64,
    /// Events cut off by the next first byte, or by the end.
    pub short: u64,
    /// Changes on the array: rows of `Events`.
    pub changes: u64,
    /// Intensities that found their change.
    pub intensities: u64,
    /// Intensities that found none.
    pub unpaired: u64,
    /// Starts and stops.
    pub markers: u64,
    /// Words of a contradictory kind.
    pub contradictory: u64,
    /// Changes and intensities outside the array.
    pub outside: u64,
    /// Changes and markers that lie behind the latest time; kept.
    pub back: u64,
}

impl Counts {
    /// What was counted since an earlier time.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            bytes: self.bytes - earlier.bytes,
            words: self.words - earlier.words,
            skipped: self.skipped - earlier.skipped,
            short: self.short - earlier.short,
            changes: self.changes - earlier.changes,
            intensities: self.intensities - earlier.intensities,
            unpaired: self.unpaired - earlier.unpaired,
            markers: self.markers - earlier.markers,
            contradictory: self.contradictory - earlier.contradictory,
            outside: self.outside - earlier.outside,
            back: self.back - earlier.back,
        }
    }
}

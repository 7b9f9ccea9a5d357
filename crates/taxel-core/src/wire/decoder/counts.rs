//! Counts of what a decoder of version 1 read and dropped.

use serde::{Deserialize, Serialize};

/// Counts of what a decoder of version 1 read and, by cause, dropped.
///
/// These equations hold at any time: `bytes = 5 words + skipped`, and
/// `words = changes + intensities + unpaired + markers + contradictory + outside`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Bytes read; the bytes of an incomplete word count once it is completed or discarded.
    pub bytes: u64,
    /// Complete words of any kind.
    pub words: u64,
    /// Bytes that belong to no complete word: those of incomplete words, and those before the next first byte.
    pub skipped: u64,
    /// Words cut off by the next first byte, or by the end of the stream.
    pub short: u64,
    /// Changes on the array, which are the rows of `Events`.
    pub changes: u64,
    /// Intensities paired with a change.
    pub intensities: u64,
    /// Intensities without a change.
    pub unpaired: u64,
    /// Starts and stops.
    pub markers: u64,
    /// Words of a contradictory kind.
    pub contradictory: u64,
    /// Changes and intensities outside the array.
    pub outside: u64,
    /// Changes and markers before the latest time; they are decoded.
    pub back: u64,
}

impl Counts {
    /// The difference from an earlier state of these counts.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        crate::counts_since! {
            self, earlier;
            bytes, words, skipped, short, changes, intensities, unpaired, markers, contradictory, outside, back;
        }
    }
}

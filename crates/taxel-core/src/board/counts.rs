//! The counts of a board.

use serde::{Deserialize, Serialize};

/// Counts of what the board did and lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BoardCounts {
    /// Number of scanned frames.
    pub frames: u64,
    /// Taxels that changed by more than the noise floor.
    pub changes: u64,
    /// Number of words that entered the queue; an event of version 2 counts as two.
    pub words: u64,
    /// Number of datagrams that the sink accepted.
    pub datagrams: u64,
    /// Number of words that the sink accepted.
    pub sent: u64,
    /// Number of changes, each with its intensity, and markers that were dropped because the queue was full.
    pub dropped: u64,
    /// Number of conversions whose comparator had not returned.
    pub not_returned: u64,
}

//! What a board counts.

use serde::{Deserialize, Serialize};

/// What the board did and lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BoardCounts {
    /// Frames scanned.
    pub frames: u64,
    /// Taxels that changed by more than the noise floor.
    pub changes: u64,
    /// Words that entered the queue; an event of version 2 counts as two.
    pub words: u64,
    /// Datagrams that the sink took.
    pub datagrams: u64,
    /// Words that the sink took.
    pub sent: u64,
    /// Changes dropped with their intensities, and markers, because the queue was full.
    pub dropped: u64,
    /// Conversions whose comparator had not returned.
    pub not_returned: u64,
}

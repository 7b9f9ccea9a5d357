//! What came over a bridge from another computer, and what did not.

use serde::{Deserialize, Serialize};

use crate::host_clock::HostOffset;

/// What came over a bridge, and what was lost on the way.
///
/// Between the first and the last parcel of a session, datagrams that the other computer received = those that came +
/// [`Bridged::missing`] + [`Bridged::dropped`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Bridged {
    /// Parcels that came, empty ones, which only report that the bridge runs, included.
    pub parcels: u64,
    /// Datagrams that were sent over the bridge and never came.
    pub missing: u64,
    /// Datagrams that the other computer dropped, its queues being full.
    pub dropped: u64,
    /// Messages that the other computer's kernel dropped.
    pub dropped_by_kernel: u64,
    /// Parcels that came again; they were left out.
    pub repeated: u64,
    /// Parcels that could not be read.
    pub refused: u64,
    /// How often the bridge was begun anew while it was listened to.
    pub restarts: u64,
    /// How often nothing was received for a second or more.
    pub silences: u64,
    /// Whether something was received within the last second.
    pub heard: bool,
    /// Whether the bridge reported its end.
    pub ended: bool,
    /// The other computer's clock against this one's.
    pub clock: Option<HostOffset>,
}

impl Bridged {
    /// What came and was lost since an earlier time.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            parcels: self.parcels - earlier.parcels,
            missing: self.missing - earlier.missing,
            dropped: self.dropped - earlier.dropped,
            dropped_by_kernel: self.dropped_by_kernel - earlier.dropped_by_kernel,
            repeated: self.repeated - earlier.repeated,
            refused: self.refused - earlier.refused,
            restarts: self.restarts - earlier.restarts,
            silences: self.silences - earlier.silences,
            ..*self
        }
    }
}

//! Counts of what a bridge delivered from another computer, and of what it lost.

use serde::{Deserialize, Serialize};

use crate::host_clock::HostOffset;
use crate::kernel_drops::KernelDrops;

/// Counts of what a bridge delivered and lost.
///
/// Between the first and the last parcel of a session, datagrams that the other computer received = delivered ones +
/// [`Bridged::missing`] + [`Bridged::dropped`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Bridged {
    /// Delivered parcels, including empty ones, which report that the bridge runs.
    pub parcels: u64,
    /// Datagrams that were sent over the bridge and not delivered.
    pub missing: u64,
    /// Datagrams that the other computer dropped because its queues were full.
    pub dropped: u64,
    /// Messages that the other computer's kernel dropped.
    pub dropped_by_kernel: KernelDrops,
    /// Parcels that were delivered repeatedly, and ignored.
    pub repeated: u64,
    /// Parcels that could not be parsed.
    pub refused: u64,
    /// Number of restarts of the bridge during the subscription.
    pub restarts: u64,
    /// Number of times that nothing was received for a second or more.
    pub silences: u64,
    /// Whether something was received within the last second.
    pub received: bool,
    /// Whether the bridge reported its end.
    pub ended: bool,
    /// The other computer's clock against this one's.
    pub clock: Option<HostOffset>,
}

impl Bridged {
    /// The difference from earlier counts.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        taxel_core::counts_since! {
            self, earlier;
            parcels, missing, dropped, repeated, refused, restarts, silences;
            dropped_by_kernel: self.dropped_by_kernel.since(earlier.dropped_by_kernel),
            ..*self
        }
    }
}

//! Counts of a sender over both versions of the wire.

use serde::Serialize;

/// Counts of a sender that do not belong to the decoder of either version; in JSON they are named as in the live counters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SenderTotals {
    /// Bytes of version 1 that were refused because the sender uses version 2.
    #[serde(rename = "wire_refused")]
    pub refused: u64,
    /// Number of times that the sender changed its version.
    #[serde(rename = "wire_changes")]
    pub changes: u64,
    /// Number of times that the times of version 1 jumped ahead of the host's clock.
    #[serde(rename = "wire_jumps")]
    pub jumps: u64,
    /// The newest time before the first jump, us; times after it are doubtful.
    #[serde(skip)]
    pub doubtful_after: Option<i64>,
    /// Events of version 2 before the latest time, by 0.1 s or less: the network reorders datagrams.
    #[serde(rename = "wire_overtaken")]
    pub overtaken: u64,
    /// Events of version 2 before the latest time, by more than that.
    #[serde(rename = "wire_far_behind")]
    pub far_behind: u64,
    /// Number of times that times stepped back, in either version.
    #[serde(rename = "wire_steps_back")]
    pub steps_back: u64,
    /// Number of datagrams of version 1 that came again; their events are decoded again too.
    #[serde(rename = "wire_repeated")]
    pub repeated: u64,
    /// Number of datagrams without bytes, from a sender that uses version 1.
    #[serde(rename = "wire_empty")]
    pub empty: u64,
}

impl SenderTotals {
    /// The difference from an earlier state of these counts.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        crate::counts_since! {
            self, earlier;
            refused, changes, jumps, overtaken, far_behind, steps_back, repeated, empty;
            doubtful_after: self.doubtful_after
        }
    }
}

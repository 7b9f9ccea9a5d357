//! The number of messages that the kernel of a computer dropped, which not every system counts.

use serde::{Deserialize, Serialize};

/// How many messages the kernel dropped because its own queue was full; `None` where that is unknown, as the system does
/// not count them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct KernelDrops(pub Option<u64>);

/// Nothing was dropped: what has no socket has no queue in the kernel.
impl Default for KernelDrops {
    fn default() -> Self {
        Self(Some(0))
    }
}

impl KernelDrops {
    /// The number where the system does not count.
    pub const UNKNOWN: Self = Self(None);

    /// Whether the system counts.
    #[must_use]
    pub fn are_known(self) -> bool {
        self.0.is_some()
    }

    /// Number of messages that are known to be dropped.
    #[must_use]
    pub fn known(self) -> u64 {
        self.0.unwrap_or(0)
    }

    /// The difference from an earlier number.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self(self.0.zip(earlier.0).map(|(now, before)| now.saturating_sub(before)))
    }
}

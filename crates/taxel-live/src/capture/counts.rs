//! What a receiver counts.

use serde::Serialize;

/// What arrived and what was lost up to now; see [`crate::capture`] for the sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Counts {
    /// Receive calls that gave something.
    pub messages: u64,
    /// Datagrams in them.
    pub datagrams: u64,
    /// Payload bytes in them.
    pub bytes: u64,
    /// Messages that the kernel threw away because its own queue was full.
    pub dropped_by_kernel: u64,
    /// Datagrams that were dropped because they were not read in time.
    pub dropped_by_queue: u64,
    /// Payload bytes in those.
    pub bytes_dropped_by_queue: u64,
    /// Datagrams that wait to be read.
    pub waiting: u64,
    /// What the kernel's own queue may hold, bytes, as it counts them (its overhead included).
    pub kernel_buffer_bytes: u64,
    /// Whether trains of datagrams come in one call.
    pub gro: bool,
}

impl Counts {
    /// Adds what receive calls gave, and how many messages the kernel has dropped so far; gives the first datagram's number.
    pub(super) fn add(&mut self, datagrams: usize, bytes: usize, messages: u64, dropped_by_kernel: u64) -> u64 {
        let first = self.datagrams;
        self.messages += messages;
        self.datagrams += datagrams as u64;
        self.bytes += bytes as u64;
        self.dropped_by_kernel = dropped_by_kernel;
        first
    }
}

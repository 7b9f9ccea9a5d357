//! The counts of a receiver.

use serde::Serialize;

use crate::kernel_drops::KernelDrops;

/// Counts of what arrived and what was lost so far; see [`crate::capture`] for the equations between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct CaptureCounts {
    /// Number of messages: receive calls that returned data.
    pub messages: u64,
    /// Number of datagrams in the messages.
    pub datagrams: u64,
    /// Number of payload bytes in the messages.
    pub bytes: u64,
    /// Number of messages that the kernel dropped because its own queue was full.
    pub dropped_by_kernel: KernelDrops,
    /// Datagrams that were dropped because they were not read in time.
    pub dropped_by_queue: u64,
    /// Number of payload bytes in those datagrams.
    pub bytes_dropped_by_queue: u64,
    /// Number of times that the sender was again the one before the last, as two senders at one port are in turn; looked at
    /// in the first messages of each batch.
    pub changes_between_senders: u64,
    /// Number of times that the sender had an address that was not one of the last two: the board's own changed, or another board
    /// went on.
    pub changes_of_address: u64,
    /// Datagrams that wait to be read.
    pub waiting: u64,
    /// Size of the kernel's own queue, bytes, as the kernel counts them (including its overhead).
    pub kernel_buffer_bytes: u64,
    /// Whether one receive call can return several datagrams (`UDP_GRO`).
    pub gro: bool,
    /// Whether a datagram's arrival is when it was read from the socket, as the system does not state when it arrived:
    /// latencies are unknown then.
    pub stamped_when_read: bool,
}

/// What a socket counts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Totals {
    pub(super) dropped_by_kernel: KernelDrops,
    pub(super) changes_between_senders: u64,
    pub(super) changes_of_address: u64,
}

impl CaptureCounts {
    /// Adds the results of receive calls, and the socket's totals; returns the first datagram's number.
    pub(super) fn add(&mut self, datagrams: usize, bytes: usize, messages: u64, totals: Totals) -> u64 {
        let first = self.datagrams;
        self.messages += messages;
        self.datagrams += datagrams as u64;
        self.bytes += bytes as u64;
        self.dropped_by_kernel = totals.dropped_by_kernel;
        self.changes_between_senders = totals.changes_between_senders;
        self.changes_of_address = totals.changes_of_address;
        first
    }
}

//! The queue between the receiving thread and the caller that reads datagrams.

use std::io;
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use super::counts::{CaptureCounts, Totals};
use crate::locked::lock;
use crate::recording::now_ns;

/// One datagram of a [`Batch`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Datagram {
    /// The kernel's time stamp of its arrival, ns of the host's clock since 1970.
    pub arrived_ns: i64,
    /// Number of datagrams that arrived before it; those that this queue dropped leave a gap.
    pub number: u64,
    start: usize,
    end: usize,
}

/// Datagrams in order of arrival, in memory that is reused.
#[derive(Debug, Default)]
pub struct Batch {
    pub(super) bytes: Vec<u8>,
    datagrams: Vec<Datagram>,
}

impl Batch {
    /// An empty batch.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of datagrams.
    #[must_use]
    pub fn len(&self) -> usize {
        self.datagrams.len()
    }

    /// Whether there are no datagrams.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.datagrams.is_empty()
    }

    /// Each datagram with its payload.
    pub fn iter(&self) -> impl Iterator<Item = (&Datagram, &[u8])> {
        self.datagrams.iter().map(|d| (d, &self.bytes[d.start..d.end]))
    }

    /// Number of bytes that can still be received into the batch.
    pub(super) fn room(&self) -> usize {
        self.bytes.capacity() - self.bytes.len()
    }

    /// Adds a message, the bytes from `start` on, that arrived at `arrived_ns`; it consists of datagrams of `segment`
    /// bytes, the last of which may be shorter.
    pub(super) fn note_message(&mut self, start: usize, segment: usize, arrived_ns: i64) {
        let stop = self.bytes.len();
        let mut from = start;
        loop {
            let end = if segment == 0 { stop } else { stop.min(from + segment) };
            self.datagrams.push(Datagram { arrived_ns, number: 0, start: from, end });
            if end == stop {
                return;
            }
            from = end;
        }
    }

    /// Adds a datagram of this number that arrived at `arrived_ns`.
    pub(super) fn push(&mut self, arrived_ns: i64, number: u64, bytes: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.datagrams.push(Datagram { arrived_ns, number, start, end: self.bytes.len() });
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.datagrams.clear();
    }

    /// Numbers the batch's datagrams.
    fn number_from(&mut self, first: u64) {
        for (number, datagram) in (first..).zip(&mut self.datagrams) {
            datagram.number = number;
        }
    }

    /// Clears the batch and reserves this many bytes.
    pub(super) fn begin(&mut self, bytes: usize) {
        self.clear();
        self.bytes.reserve(bytes);
    }
}

/// Two batches alternate: one is filled while the other is read. While the reader is behind, datagrams are copied into one batch, so
/// that small ones are packed tightly and the limit in bytes is also a limit in time.
#[derive(Debug)]
pub(super) struct BatchQueue {
    state: Mutex<QueueState>,
    came: Condvar,
    /// The time when the end was requested, ns of the host's clock since 1970.
    stop: OnceLock<i64>,
    limit: usize,
}

#[derive(Debug)]
struct QueueState {
    waiting: Batch,
    counts: CaptureCounts,
    /// Promise of a feed: every datagram that arrived before this time is in the queue or was read, ns.
    until_ns: Option<i64>,
    closed: bool,
    failed: Option<io::Error>,
}

impl BatchQueue {
    pub(super) fn new(limit: usize, counts: CaptureCounts) -> Self {
        let state = QueueState { waiting: Batch::new(), counts, until_ns: None, closed: false, failed: None };
        Self { state: Mutex::new(state), came: Condvar::new(), stop: OnceLock::new(), limit }
    }

    /// Moves received datagrams into the waiting batch; those that do not fit are dropped and counted.
    pub(super) fn put(&self, received: &mut Batch, messages: u64, totals: Totals) {
        let mut state = self.state();
        let QueueState { waiting, counts, .. } = &mut *state;
        let first = counts.add(received.datagrams.len(), received.bytes.len(), messages, totals);
        if waiting.is_empty() && received.bytes.len() <= self.limit {
            received.number_from(first);
            std::mem::swap(waiting, received);
        } else {
            for (number, (datagram, bytes)) in (first..).zip(received.iter()) {
                if waiting.bytes.len() + bytes.len() <= self.limit {
                    waiting.push(datagram.arrived_ns, number, bytes);
                } else {
                    counts.dropped_by_queue += 1;
                    counts.bytes_dropped_by_queue += bytes.len() as u64;
                }
            }
        }
        let some = !waiting.is_empty();
        drop(state);
        received.clear();
        if some {
            self.came.notify_one();
        }
    }

    /// Counts and numbers datagrams that the caller received directly.
    pub(super) fn count(&self, received: &mut Batch, messages: u64, totals: Totals) {
        let (datagrams, bytes) = (received.datagrams.len(), received.bytes.len());
        let first = self.state().counts.add(datagrams, bytes, messages, totals);
        received.number_from(first);
    }

    pub(super) fn pop(&self, batch: &mut Batch, timeout: Duration) -> io::Result<bool> {
        batch.clear();
        let state = self.state();
        let nothing = |s: &mut QueueState| s.waiting.is_empty() && !s.closed;
        let (mut state, _) =
            self.came.wait_timeout_while(state, timeout, nothing).unwrap_or_else(PoisonError::into_inner);
        std::mem::swap(&mut state.waiting, batch);
        if batch.is_empty()
            && let Some(error) = state.failed.take()
        {
            return Err(error);
        }
        Ok(!batch.is_empty())
    }

    /// Records a feed's promise that no datagram that arrived before this time will be added.
    pub(super) fn promise(&self, until_ns: i64) {
        let mut state = self.state();
        state.until_ns = state.until_ns.max(Some(until_ns));
    }

    /// The promised time, if the queue is empty.
    pub(super) fn silent_until(&self) -> Option<i64> {
        let state = self.state();
        state.until_ns.filter(|_| state.waiting.is_empty())
    }

    /// Whether half of the room is taken.
    pub(super) fn is_half_full(&self) -> bool {
        self.state().waiting.bytes.len() > self.limit / 2
    }

    pub(super) fn counts(&self) -> CaptureCounts {
        let state = self.state();
        CaptureCounts { waiting: state.waiting.len() as u64, ..state.counts }
    }

    pub(super) fn close(&self, failed: Option<io::Error>) {
        let mut state = self.state();
        state.closed = true;
        state.failed = failed.or(state.failed.take());
        drop(state);
        self.came.notify_all();
    }

    pub(super) fn is_done(&self) -> bool {
        let state = self.state();
        state.closed && state.waiting.is_empty()
    }

    pub(super) fn stop(&self) {
        self.stop.get_or_init(now_ns);
    }

    /// The time when the end was requested, ns of the host's clock since 1970; `None` if it was not.
    pub(super) fn stopped_ns(&self) -> Option<i64> {
        self.stop.get().copied()
    }

    /// Locks the state. No holder of the lock can panic half-way through a change, so a poisoned lock still guards a
    /// valid state.
    fn state(&self) -> MutexGuard<'_, QueueState> {
        lock(&self.state)
    }
}

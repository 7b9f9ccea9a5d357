//! Messages that a program makes, in place of datagrams from a socket.

use std::io;
use std::sync::Arc;

use super::counts::Totals;
use super::queue::{Batch, BatchQueue};

/// Passes messages to the queue of a [`Receiver`](super::Receiver), in order of arrival.
#[derive(Debug)]
pub struct MessageFeed {
    queue: Arc<BatchQueue>,
    batch: Batch,
}

impl MessageFeed {
    pub(super) fn new(queue: Arc<BatchQueue>) -> Self {
        Self { queue, batch: Batch::new() }
    }

    /// Adds a message that arrived at `arrived_ns` (ns since 1970); [`MessageFeed::send`] passes it on.
    pub fn push(&mut self, arrived_ns: i64, bytes: &[u8]) {
        self.batch.push(arrived_ns, 0, bytes);
    }

    /// Queues the messages that were added, and promises that all that arrived before `until_ns` are among them.
    pub fn send(&mut self, until_ns: i64) {
        let messages = self.batch.len() as u64;
        self.queue.put(&mut self.batch, messages, Totals::default());
        self.queue.promise(until_ns);
    }

    /// Whether so much waits that the rest should wait in the system; not once the end was requested.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.queue.is_half_full() && !self.is_over()
    }

    /// Ends the input, with an error if there was one.
    pub fn close(&self, failed: Option<io::Error>) {
        self.queue.close(failed);
    }

    /// Whether the end was requested: no message is read any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.queue.stopped_ns().is_some()
    }
}

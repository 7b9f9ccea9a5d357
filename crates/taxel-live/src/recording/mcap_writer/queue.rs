//! Messages that wait to be written.

use std::time::Instant;

use crate::recording::LATE;

/// Messages in the order in which they were added.
#[derive(Default)]
pub(super) struct MessageQueue {
    pub(super) messages: Vec<QueuedMessage>,
    pub(super) bytes: Vec<u8>,
    /// Time when the first of them was added.
    pub(super) since: Option<Instant>,
}

/// A message whose content is the next `bytes` bytes of the queue.
pub(super) struct QueuedMessage {
    pub(super) channel: u16,
    pub(super) number: u32,
    pub(super) at_ns: u64,
    pub(super) bytes: usize,
}

impl MessageQueue {
    pub(super) fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Whether the first message has waited for [`LATE`].
    pub(super) fn is_late(&self) -> bool {
        self.since.is_some_and(|since| since.elapsed() >= LATE)
    }

    pub(super) fn clear(&mut self) {
        self.messages.clear();
        self.bytes.clear();
        self.since = None;
    }
}

//! The connected clients: how many there are, and what is sent to all of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::sync::{broadcast, watch};

use crate::protocol::messages::Message;

/// Messages that wait for one client at most.
pub(crate) const MOST_WAITING: usize = 256;

/// A message to all clients.
#[derive(Debug, Clone)]
pub(crate) enum Broadcast {
    /// The same text for everybody.
    Text(Arc<str>),
    /// Counters, to which each session adds those of its client.
    Counters(Box<Message>),
    /// The labels of a recording have changed: for the clients that show it.
    Labels(String),
    /// A recording of which the beginning was shown is read as a whole.
    Whole(String),
    /// The contents of `hello` have changed.
    Hello,
}

/// Counts the connected clients and sends messages to all of them.
pub(crate) struct Clients {
    messages: broadcast::Sender<Broadcast>,
    /// Counts up when a new frame can be shown.
    frames: watch::Sender<u64>,
    count: Arc<AtomicUsize>,
}

/// The place of a connected client; dropping it frees the place.
pub(crate) struct ClientSlot(Arc<AtomicUsize>);

impl Drop for ClientSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Clients {
    pub(crate) fn new() -> Self {
        Self {
            messages: broadcast::channel(MOST_WAITING).0,
            frames: watch::channel(0).0,
            count: Arc::new(AtomicUsize::new(0)),
        }
    }

    /// Counts another client, unless `most` are connected.
    pub(crate) fn admit(&self, most: usize) -> Option<ClientSlot> {
        let before = self.count.fetch_add(1, Ordering::Relaxed);
        let slot = ClientSlot(Arc::clone(&self.count));
        (before < most).then_some(slot)
    }

    pub(crate) fn count(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    pub(crate) fn send(&self, message: Broadcast) {
        // Without a client the channel reports an error, which loses nothing.
        let _ = self.messages.send(message);
    }

    pub(crate) fn send_message(&self, message: &Message) {
        self.send(Broadcast::Text(message.text().into()));
    }

    /// Announces to all sessions that a new frame can be shown.
    pub(crate) fn new_frame(&self) {
        self.frames.send_modify(|n| *n += 1);
    }

    pub(crate) fn subscribe(&self) -> (broadcast::Receiver<Broadcast>, watch::Receiver<u64>) {
        (self.messages.subscribe(), self.frames.subscribe())
    }
}

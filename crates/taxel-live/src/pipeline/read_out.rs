//! The fourth stage: passes events to the readout, in this thread or through a queue to another one.

use taxel_core::Events;
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;

use super::reader::Reader;
use super::readout_queue::{Quiet, Taken};
use super::shared::Shared;

pub(super) struct ReadOutStage {
    /// Whether there is a readout at all.
    is_on: bool,
    /// The readout, while it runs in this thread.
    reader: Option<Reader>,
    /// A readout that is about to move to its own thread.
    separated: Option<Box<Reader>>,
    /// An empty list, used while this thread has no reader.
    nothing: Vec<Detection>,
    /// The time up to which no more events will follow by the promises of version 2 that the readout has received, us.
    announced: Option<i64>,
}

impl ReadOutStage {
    pub(super) fn new(reader: Option<Reader>) -> Self {
        Self { is_on: reader.is_some(), reader, separated: None, nothing: vec![], announced: None }
    }

    pub(super) fn is_on(&self) -> bool {
        self.is_on
    }

    /// Publishes its state before the first events.
    pub(super) fn begin(&self, shared: &Shared) {
        if let Some(reader) = &self.reader {
            reader.begin(shared);
        }
    }

    /// Moves the readout to another thread.
    pub(super) fn separate(&mut self) {
        if let Some(reader) = self.reader.take() {
            self.separated = Some(Box::new(reader));
        }
    }

    /// The reader for that thread, once.
    pub(super) fn take_separated(&mut self) -> Option<Box<Reader>> {
        self.separated.take()
    }

    /// Detections that no thread has output yet.
    pub(super) fn found(&mut self) -> &mut Vec<Detection> {
        self.reader.as_mut().map_or(&mut self.nothing, |reader| &mut reader.found)
    }

    pub(super) fn announced(&self) -> Option<i64> {
        self.announced
    }

    /// Handles a reset of the board: its earlier promises are void.
    pub(super) fn reset(&mut self) {
        self.announced = None;
    }

    /// Processes events, with the time before which the board has promised no more; `events` may be empty after it.
    pub(super) fn push(&mut self, shared: &Shared, events: &mut Events, promised: Option<i64>) {
        if !self.is_on || (promised.is_none() && events.is_empty() && events.markers.is_empty()) {
            return;
        }
        match &mut self.reader {
            Some(reader) => {
                reader.take(shared, events, Taken { quiet: promised.map(Quiet::Promised), last: false });
            }
            None => {
                let dropped = shared.readout_queue.put(events, promised);
                shared.published().counters.events_dropped = dropped;
            }
        }
        self.announced = self.announced.max(promised);
    }

    /// Processes a silence: no events before a time.
    pub(super) fn quiet(&mut self, shared: &Shared, quiet: Quiet) {
        match &mut self.reader {
            Some(reader) => reader.wait(shared, Taken { quiet: Some(quiet), last: false }),
            None => shared.readout_queue.quiet(quiet),
        }
    }

    pub(super) fn zero(&mut self, shared: &Shared, zeroings: &[Zeroing]) {
        match &mut self.reader {
            Some(reader) => reader.zero(zeroings),
            None if self.is_on => shared.readout_queue.zero(zeroings),
            None => {}
        }
    }

    /// Ends the input.
    pub(super) fn close(&mut self, shared: &Shared, quiet: Option<Quiet>) {
        match &mut self.reader {
            Some(reader) => reader.wait(shared, Taken { quiet, last: true }),
            None => shared.readout_queue.close(quiet),
        }
    }
}

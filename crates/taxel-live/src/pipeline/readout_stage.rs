//! The fourth stage: passes events to the readout, in this thread or through a queue to another one.

use taxel_core::Events;
use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;

use super::frame_block::FrameBlock;
use super::readout_queue::{BatchEnd, QuietUntil};
use super::running_readout::RunningReadout;
use super::shared::PipelineShared;

pub(super) struct ReadoutStage {
    /// Whether there is a readout at all.
    is_on: bool,
    /// The readout, while it runs in this thread.
    readout: Option<RunningReadout>,
    /// A readout that is about to move to its own thread.
    separated: Option<Box<RunningReadout>>,
    /// Without a readout nothing is found.
    nothing: Vec<Detection>,
    /// The time up to which no more events will follow by the promises of version 2 that the readout has received, us.
    announced: Option<i64>,
}

impl ReadoutStage {
    pub(super) fn new(readout: Option<RunningReadout>) -> Self {
        Self { is_on: readout.is_some(), readout, separated: None, nothing: vec![], announced: None }
    }

    pub(super) fn is_on(&self) -> bool {
        self.is_on
    }

    /// Publishes its state before the first events.
    pub(super) fn begin(&self, shared: &PipelineShared) {
        if let Some(readout) = &self.readout {
            readout.begin(shared);
        }
    }

    /// Moves the readout to another thread.
    pub(super) fn move_to_thread(&mut self) {
        if let Some(readout) = self.readout.take() {
            self.separated = Some(Box::new(readout));
        }
    }

    /// The readout for that thread, once.
    pub(super) fn take_separated(&mut self) -> Option<Box<RunningReadout>> {
        self.separated.take()
    }

    /// Detections that do not wait for output yet.
    pub(super) fn pending_detections(&mut self) -> &mut Vec<Detection> {
        self.readout.as_mut().map_or(&mut self.nothing, |readout| &mut readout.found)
    }

    pub(super) fn announced_until(&self) -> Option<i64> {
        self.announced
    }

    /// Handles a reset of the board: its earlier promises are void.
    pub(super) fn reset(&mut self) {
        self.announced = None;
    }

    /// Processes events, with the time before which the board has promised no more; `events` may be empty after it.
    pub(super) fn push(&mut self, shared: &PipelineShared, events: &mut Events, promised: Option<i64>) {
        if !self.is_on || (promised.is_none() && events.is_empty() && events.markers.is_empty()) {
            return;
        }
        match &mut self.readout {
            Some(readout) => {
                readout.push(shared, events, BatchEnd { quiet: promised.map(QuietUntil::ByBoard), last: false });
            }
            None => {
                let dropped = shared.readout_queue.push(events, promised);
                shared.published().counters.readout.events_dropped = dropped;
            }
        }
        self.announced = self.announced.max(promised);
    }

    /// Processes frames.
    pub(super) fn push_frames(&mut self, shared: &PipelineShared, frames: &mut FrameBlock) {
        match &mut self.readout {
            _ if !self.is_on || frames.is_empty() => {}
            Some(readout) => readout.push_frames(shared, frames),
            None => {
                let dropped = shared.readout_queue.push_frames(frames);
                shared.published().counters.readout.events_dropped = dropped;
            }
        }
    }

    /// Processes a silence: no events before a time.
    pub(super) fn process_silence(&mut self, shared: &PipelineShared, quiet: QuietUntil) {
        match &mut self.readout {
            Some(readout) => readout.advance(shared, BatchEnd { quiet: Some(quiet), last: false }),
            None => shared.readout_queue.set_quiet(quiet),
        }
    }

    pub(super) fn zero(&mut self, shared: &PipelineShared, zeroings: &[Zeroing]) {
        match &mut self.readout {
            Some(readout) => readout.zero(zeroings),
            None if self.is_on => shared.readout_queue.zero(zeroings),
            None => {}
        }
    }

    /// Ends the input.
    pub(super) fn close(&mut self, shared: &PipelineShared, quiet: Option<QuietUntil>) {
        match &mut self.readout {
            Some(readout) => readout.advance(shared, BatchEnd { quiet, last: true }),
            None => shared.readout_queue.close(quiet),
        }
    }
}

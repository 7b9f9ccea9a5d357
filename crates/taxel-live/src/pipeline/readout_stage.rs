//! The fourth stage: passes what arrived to the readout, in this thread or through a queue to another one.

use taxel_core::detect::Detection;
use taxel_core::{Array, Events};

use super::frame_block::FrameBlock;
use super::readout_queue::{QuietUntil, ReadoutInput};
use super::running_readout::RunningReadout;
use super::shared::PipelineShared;

pub(super) struct ReadoutStage {
    /// Whether there is a readout at all.
    pub(super) is_on: bool,
    /// The readout, while it runs in this thread.
    readout: Option<RunningReadout>,
    /// A readout that is about to move to its own thread.
    pub(super) separated: Option<Box<RunningReadout>>,
    /// What is about to be processed: empty between two calls, in memory that is reused.
    pub(super) input: ReadoutInput,
    /// Without a readout nothing is found.
    nothing: Vec<Detection>,
    /// The time up to which no more events will follow by the promises of version 2 that the readout has received, us.
    pub(super) announced: Option<i64>,
}

impl ReadoutStage {
    pub(super) fn new(readout: Option<RunningReadout>, array: &Array) -> Self {
        let (is_on, input) = (readout.is_some(), ReadoutInput::new(array));
        Self { is_on, readout, separated: None, input, nothing: vec![], announced: None }
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

    /// Detections that do not wait for output yet.
    pub(super) fn pending_detections(&mut self) -> &mut Vec<Detection> {
        self.readout.as_mut().map_or(&mut self.nothing, |readout| &mut readout.found)
    }

    /// Passes events on, with the time before which the board has promised no more; those in `events` are then others.
    pub(super) fn push(&mut self, shared: &PipelineShared, events: &mut Events, promised: Option<i64>) {
        if self.is_on {
            std::mem::swap(&mut self.input.events, events);
            self.input.quiet = promised.map(QuietUntil::ByBoard);
            self.pass_on(shared);
            self.announced = self.announced.max(promised);
        }
    }

    /// Passes frames on; those in `frames` are then others.
    pub(super) fn push_frames(&mut self, shared: &PipelineShared, frames: &mut FrameBlock) {
        std::mem::swap(&mut self.input.frames, frames);
        self.pass_on(shared);
    }

    /// Ends the input.
    pub(super) fn close(&mut self, shared: &PipelineShared, quiet: Option<QuietUntil>) {
        (self.input.quiet, self.input.last) = (quiet, true);
        self.pass_on(shared);
    }

    pub(super) fn pass_on(&mut self, shared: &PipelineShared) {
        match &mut self.readout {
            _ if !self.is_on || self.input.is_empty() => {}
            Some(readout) => readout.process(shared, &self.input),
            None => {
                let dropped = shared.readout_queue.push(&mut self.input);
                if dropped > 0 {
                    shared.published().counters.readout.events_dropped += dropped as u64;
                }
            }
        }
        self.input.clear();
    }
}

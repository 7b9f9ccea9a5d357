//! Copies for viewers, and the published frame: none of them can slow the pipeline.

use std::sync::Arc;
use std::time::Instant;

use crossbeam_channel as channel;
use taxel_core::Events;
use taxel_core::held::Held;

use super::shared::PipelineShared;
use super::viewer_queue::{ViewerEvents, ViewerQueue, viewer_queue};
use crate::recording::LOW_RATE_EVERY;

pub(super) struct Observers {
    shared: Arc<PipelineShared>,
    viewers: Vec<ViewerQueue>,
    published_frame: Instant,
}

impl Observers {
    pub(super) fn new(shared: Arc<PipelineShared>) -> Self {
        Self { shared, viewers: vec![], published_frame: Instant::now() }
    }

    /// Adds a viewer of the events, if it is still connected.
    pub(super) fn add_viewer(&mut self, answer: &channel::Sender<ViewerEvents>, held: &Held) {
        let counters = &self.shared.published().counters;
        let (queue, events) =
            viewer_queue(&self.shared.options.array, held, counters.board.board_us, counters.decoding.events);
        if answer.send(events).is_ok() {
            self.viewers.push(queue);
        }
    }

    /// Copies events, whose values are already applied to `held`.
    pub(super) fn events(&mut self, events: &Events, held: &Held) {
        self.viewers.iter_mut().for_each(|queue| queue.push(events, held));
    }

    /// Handles a reset of the board, after which the taxels' values are unknown.
    pub(super) fn reset(&mut self, held: &Held) {
        self.viewers.iter_mut().for_each(|queue| queue.reset(held));
    }

    /// Sends viewers what is due.
    pub(super) fn tick(&mut self, held: &Held) {
        self.viewers.retain_mut(|queue| queue.tick(held));
    }

    /// Publishes the low-rate frame if it is due; returns whether it was.
    pub(super) fn frame(&mut self, held: &Held) -> bool {
        if self.published_frame.elapsed() < LOW_RATE_EVERY {
            return false;
        }
        self.published_frame = Instant::now();
        self.shared.published().frame.iter_mut().zip(held.frame()).for_each(|(shown, value)| *shown = value);
        true
    }
}

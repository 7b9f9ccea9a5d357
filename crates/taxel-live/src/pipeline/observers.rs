//! Copies for viewers and other computers, and the published frame: none of them can slow the pipeline.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::Events;
use taxel_core::held::Held;

use super::copies::{Copier, GATHER, copier};
use super::shared::PipelineShared;
use super::viewer_queue::{ViewerEvents, ViewerQueue, viewer_queue};
use crate::capture::Batch;
use crate::recording::LOW_RATE_EVERY;

pub(super) struct Observers {
    shared: Arc<PipelineShared>,
    viewers: Vec<ViewerQueue>,
    copiers: Vec<Copier>,
    /// Number of datagrams that were received before the next one.
    received: u64,
    published_frame: Instant,
}

impl Observers {
    pub(super) fn new(shared: Arc<PipelineShared>) -> Self {
        Self { shared, viewers: vec![], copiers: vec![], received: 0, published_frame: Instant::now() }
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

    /// Adds another computer that receives the datagrams.
    pub(super) fn add_copier(&mut self, answer: &channel::Sender<channel::Receiver<Vec<u8>>>) {
        let (copier, parcels) = copier(self.received);
        if answer.send(parcels).is_ok() {
            self.copiers.push(copier);
        }
    }

    /// Longest time that the pipeline may wait for datagrams, so that parcels are sent in time.
    pub(super) fn longest_wait(&self, wait: Duration) -> Duration {
        if self.copiers.is_empty() { wait } else { wait.min(GATHER) }
    }

    /// Copies events, whose values are already applied to `held`.
    pub(super) fn events(&mut self, events: &Events, held: &Held) {
        self.viewers.iter_mut().for_each(|queue| queue.push(events, held));
    }

    /// Handles a reset of the board, after which the taxels' values are unknown.
    pub(super) fn reset(&mut self, held: &Held) {
        self.viewers.iter_mut().for_each(|queue| queue.reset(held));
    }

    /// Copies a batch for other computers, and sends what is due.
    pub(super) fn datagrams(&mut self, batch: &Batch, silent_until: Option<i64>) {
        if let Some((last, _)) = batch.iter().last() {
            self.received = last.number + 1;
        }
        if self.copiers.is_empty() {
            return;
        }
        let dropped = self.shared.receiver.counts().dropped_by_kernel;
        self.copiers.retain_mut(|copier| {
            copier.push(batch, dropped);
            copier.tick(silent_until, dropped)
        });
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

    /// Sends the last data that wait.
    pub(super) fn finish(&mut self, held: &Held) {
        self.tick(held);
        let dropped = self.shared.receiver.counts().dropped_by_kernel;
        self.copiers.iter_mut().for_each(|copier| copier.finish(dropped));
    }
}

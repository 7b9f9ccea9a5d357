//! Copies for viewers and other computers, and the published picture: none of them can slow the pipeline.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::Events;

use super::copies::{Copier, GATHER, copier};
use super::shared::Shared;
use super::tap::{Outlet, Tap, UNKNOWN, tap};
use crate::capture::Batch;

/// How often a new picture is published.
const PICTURE_EVERY: Duration = Duration::from_millis(100);

pub(super) struct Observers {
    shared: Arc<Shared>,
    taps: Vec<Tap>,
    copiers: Vec<Copier>,
    /// How many datagrams were received before the next one.
    received: u64,
    pictured: Instant,
}

impl Observers {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        Self { shared, taps: vec![], copiers: vec![], received: 0, pictured: Instant::now() }
    }

    /// Adds a viewer of the events, where it still waits for that.
    pub(super) fn add_tap(&mut self, give: &channel::Sender<Outlet>, held: &[u16]) {
        let counters = &self.shared.published().counters;
        let (tap, outlet) = tap(&self.shared.options.array, held.to_vec(), counters.board_us, counters.events);
        if give.send(outlet).is_ok() {
            self.taps.push(tap);
        }
    }

    /// Adds another computer that gets the datagrams.
    pub(super) fn add_copier(&mut self, give: &channel::Sender<channel::Receiver<Vec<u8>>>) {
        let (copier, parcels) = copier(self.received);
        if give.send(parcels).is_ok() {
            self.copiers.push(copier);
        }
    }

    /// How long datagrams may be waited for at most, so that parcels leave in time.
    pub(super) fn longest_wait(&self, wait: Duration) -> Duration {
        if self.copiers.is_empty() { wait } else { wait.min(GATHER) }
    }

    pub(super) fn events(&mut self, events: &Events) {
        self.taps.iter_mut().for_each(|tap| tap.take(events));
    }

    /// The board was reset.
    pub(super) fn reset(&mut self) {
        self.taps.iter_mut().for_each(Tap::forget);
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
            copier.take(batch, dropped);
            copier.tick(silent_until, dropped)
        });
    }

    /// Sends viewers what is due.
    pub(super) fn tick(&mut self) {
        self.taps.retain_mut(Tap::tick);
    }

    /// Publishes the picture where it is time; returns whether it was.
    pub(super) fn picture(&mut self, held: &[u16]) -> bool {
        if self.pictured.elapsed() < PICTURE_EVERY {
            return false;
        }
        self.pictured = Instant::now();
        let mut published = self.shared.published();
        // In a picture 0 is also a taxel without any event so far.
        for (shown, &held) in published.picture.iter_mut().zip(held) {
            *shown = if held == UNKNOWN { 0 } else { held };
        }
        true
    }

    /// Sends the last of what waits.
    pub(super) fn finish(&mut self) {
        self.tick();
        let dropped = self.shared.receiver.counts().dropped_by_kernel;
        self.copiers.iter_mut().for_each(|copier| copier.finish(dropped));
    }
}

//! Hands detections to their sinks, to the recording and to whoever waits for them: one after the other, by any thread that is
//! free to.

use std::collections::VecDeque;
use std::sync::Mutex;

use crossbeam_channel::Sender;
use taxel_core::detect::Detection;

use super::said::{Said, Sink};
use super::shared::Shared;
use crate::locked::lock;
use crate::recording::now_ns;
use crate::{Error, Result};

/// How many detections wait while a sink is slow; more are lost, and counted.
const WAITING: usize = 1 << 14;

/// Hands detections on in their order, one at a time: a thread that finds another one doing so leaves them to it.
pub(super) struct DetectionOutput(Mutex<State>);

struct State {
    waiting: VecDeque<Detection>,
    /// `None` while a thread uses them.
    receivers: Option<Receivers>,
}

/// Where detections go.
struct Receivers {
    sinks: Vec<Box<dyn Sink>>,
    /// Of [`Live::next`](super::Live::next).
    queue: Sender<Said>,
    /// A sink has failed, which ends the pipeline: nothing more is handed on.
    failed: bool,
}

impl DetectionOutput {
    pub(super) fn new(sinks: Vec<Box<dyn Sink>>, queue: Sender<Said>) -> Self {
        let receivers = Some(Receivers { sinks, queue, failed: false });
        Self(Mutex::new(State { waiting: VecDeque::new(), receivers }))
    }

    /// Takes detections; returns whether no thread is handing any on.
    pub(super) fn add(&self, shared: &Shared, found: &mut Vec<Detection>) -> bool {
        let mut state = lock(&self.0);
        let room = WAITING.saturating_sub(state.waiting.len()).min(found.len());
        let lost = found.len() - room;
        state.waiting.extend(found.drain(..).take(room));
        if lost > 0 {
            let counters = &mut shared.published().counters;
            counters.detections += lost as u64;
            counters.detections_dropped += lost as u64;
        }
        state.receivers.is_some()
    }

    /// Hands on what waits, and what comes meanwhile, unless another thread does.
    pub(super) fn run(&self, shared: &Shared) {
        let mut state = lock(&self.0);
        let Some(mut receivers) = state.receivers.take() else { return };
        while let Some(detection) = state.waiting.pop_front() {
            drop(state);
            if !receivers.failed
                && let Err(error) = receivers.take(shared, detection)
            {
                receivers.failed = true;
                shared.fail(error);
            }
            state = lock(&self.0);
        }
        state.receivers = Some(receivers);
    }
}

impl Receivers {
    /// To the sinks first, then into the recording and to those that wait for it.
    fn take(&mut self, shared: &Shared, detection: Detection) -> Result<()> {
        let said_ns = now_ns();
        let offset = shared.published().counters.offset;
        let said = Said { said: offset.map_or(detection.known, |o| o.board_us(said_ns)), detection, said_ns };
        self.sinks.iter_mut().try_for_each(|sink| sink.take(&said)).map_err(Error::Sink)?;
        if let Some(recorder) = &*lock(&shared.recorder) {
            // An error that ends only the recording is found, and kept, by the decoding thread too.
            recorder.detection(&said).or_else(|error| if recorder.since().is_some() { Ok(()) } else { Err(error) })?;
        }
        shared.picture_around([said.detection.t, said.detection.known]);
        lock(&shared.subscribers).retain(|subscriber| {
            !matches!(subscriber.try_send(said.clone()), Err(crossbeam_channel::TrySendError::Disconnected(_)))
        });
        let late_ns = (said.said - said.detection.known) * 1000;
        let dropped = self.queue.try_send(said).is_err();
        let mut published = shared.published();
        published.counters.detections += 1;
        published.counters.detections_dropped += u64::from(dropped);
        published.said_latency.note(late_ns);
        Ok(())
    }
}

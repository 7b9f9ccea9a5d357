//! Detections that wait to be said, one after the other, by whichever thread is free to.

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

/// Says detections in their order, one at a time: who finds that another thread speaks leaves them to it.
pub(super) struct Saying(Mutex<SayingState>);

struct SayingState {
    waiting: VecDeque<Detection>,
    /// None while a thread speaks.
    voice: Option<Voice>,
}

struct Voice {
    sinks: Vec<Box<dyn Sink>>,
    say: Sender<Said>,
    /// A sink has failed, which ends the way: nothing more is said.
    failed: bool,
}

impl Saying {
    pub(super) fn new(sinks: Vec<Box<dyn Sink>>, say: Sender<Said>) -> Self {
        let voice = Some(Voice { sinks, say, failed: false });
        Self(Mutex::new(SayingState { waiting: VecDeque::new(), voice }))
    }

    /// Takes detections that are to be said, and says whether nobody speaks.
    pub(super) fn add(&self, shared: &Shared, found: &mut Vec<Detection>) -> bool {
        let mut state = lock(&self.0);
        let room = WAITING.saturating_sub(state.waiting.len()).min(found.len());
        let lost = found.len() - room;
        state.waiting.extend(found.drain(..).take(room));
        if lost > 0 {
            let counters = &mut shared.shown().counters;
            counters.detections += lost as u64;
            counters.detections_dropped += lost as u64;
        }
        state.voice.is_some()
    }

    /// Says what waits, and what comes meanwhile, unless another thread does.
    pub(super) fn speak(&self, shared: &Shared) {
        let mut state = lock(&self.0);
        let Some(mut voice) = state.voice.take() else { return };
        while let Some(detection) = state.waiting.pop_front() {
            drop(state);
            if !voice.failed
                && let Err(error) = voice.say(shared, detection)
            {
                voice.failed = true;
                shared.fail(error);
            }
            state = lock(&self.0);
        }
        state.voice = Some(voice);
    }
}

impl Voice {
    /// To the sinks first, then into the recording and to who asks.
    fn say(&mut self, shared: &Shared, detection: Detection) -> Result<()> {
        let said_ns = now_ns();
        let offset = shared.shown().counters.offset;
        let said = Said { said: offset.map_or(detection.known, |o| o.board_us(said_ns)), detection, said_ns };
        self.sinks.iter_mut().try_for_each(|sink| sink.take(&said)).map_err(Error::Sink)?;
        if let Some(recorder) = &*lock(&shared.recorder) {
            // Where only a guest's recording is broken, the decoding thread will find that too.
            recorder.detection(&said).or_else(|error| if recorder.since().is_some() { Ok(()) } else { Err(error) })?;
        }
        shared.happened([said.detection.t, said.detection.known]);
        lock(&shared.listeners).retain(|listener| {
            !matches!(listener.try_send(said.clone()), Err(crossbeam_channel::TrySendError::Disconnected(_)))
        });
        let late_ns = (said.said - said.detection.known) * 1000;
        let dropped = self.say.try_send(said).is_err();
        let mut shown = shared.shown();
        shown.counters.detections += 1;
        shown.counters.detections_dropped += u64::from(dropped);
        shown.said_latency.note(late_ns);
        Ok(())
    }
}

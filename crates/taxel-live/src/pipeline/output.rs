//! Hands detections to their sinks, to the recording and to waiting callers: one after the other, by any thread that is
//! free to.

use std::collections::VecDeque;
use std::sync::Mutex;

use crossbeam_channel::Sender;
use taxel_core::detect::Detection;

use super::shared::PipelineShared;
use super::sink::{OutputDetection, Sink};
use crate::locked::lock;
use crate::recording::now_ns;
use crate::{Error, Result};

/// Capacity of the queue of detections while a sink is slow; more are lost, and counted.
const WAITING: usize = 1 << 14;

/// Outputs detections in order, one at a time; a thread that finds another one outputting leaves its detections to that
/// thread.
pub(super) struct DetectionOutput(Mutex<State>);

struct State {
    waiting: VecDeque<Detection>,
    /// `None` while a thread uses them.
    targets: Option<DetectionSinks>,
}

/// The receivers of detections.
struct DetectionSinks {
    sinks: Vec<Box<dyn Sink>>,
    /// The queue of [`Live::next`](super::Live::next).
    queue: Sender<OutputDetection>,
    /// Whether a sink has failed, which ends the pipeline: nothing more is output.
    failed: bool,
}

impl DetectionOutput {
    pub(super) fn new(sinks: Vec<Box<dyn Sink>>, queue: Sender<OutputDetection>) -> Self {
        let targets = Some(DetectionSinks { sinks, queue, failed: false });
        Self(Mutex::new(State { waiting: VecDeque::new(), targets }))
    }

    /// Adds detections; returns whether no thread is outputting at present.
    pub(super) fn add(&self, shared: &PipelineShared, found: &mut Vec<Detection>) -> bool {
        let mut state = lock(&self.0);
        let room = WAITING.saturating_sub(state.waiting.len()).min(found.len());
        let lost = found.len() - room;
        state.waiting.extend(found.drain(..).take(room));
        if lost > 0 {
            let counters = &mut shared.published().counters;
            counters.readout.detections += lost as u64;
            counters.readout.detections_dropped += lost as u64;
        }
        state.targets.is_some()
    }

    /// Outputs the waiting detections, and those that are added meanwhile, unless another thread is outputting.
    pub(super) fn run(&self, shared: &PipelineShared) {
        let mut state = lock(&self.0);
        let Some(mut targets) = state.targets.take() else { return };
        while let Some(detection) = state.waiting.pop_front() {
            drop(state);
            if !targets.failed
                && let Err(error) = targets.output(shared, detection)
            {
                targets.failed = true;
                shared.fail(error);
            }
            state = lock(&self.0);
        }
        state.targets = Some(targets);
    }
}

impl DetectionSinks {
    /// Passes a detection to the sinks first, then to the recording and the receivers.
    fn output(&mut self, shared: &PipelineShared, detection: Detection) -> Result<()> {
        let reported_ns = now_ns();
        let offset = shared.published().counters.board.offset;
        let output = OutputDetection {
            reported_us: offset.map_or(detection.known, |o| o.board_us(reported_ns)),
            detection,
            reported_ns,
        };
        self.sinks.iter_mut().try_for_each(|sink| sink.output(&output)).map_err(Error::Sink)?;
        if let Some(recording) = &*lock(&shared.recording.running) {
            // An error that ends only the recording is found, and reported, by the decoding thread too.
            recording
                .detection(output.reported_ns, &output.detection)
                .or_else(|error| if recording.since().is_some() { Ok(()) } else { Err(error) })?;
        }
        lock(&shared.subscribers).retain(|subscriber| {
            !matches!(subscriber.try_send(output.clone()), Err(crossbeam_channel::TrySendError::Disconnected(_)))
        });
        let late_ns = (output.reported_us - output.detection.known) * 1000;
        let dropped = self.queue.try_send(output).is_err();
        let mut published = shared.published();
        published.counters.readout.detections += 1;
        published.counters.readout.detections_dropped += u64::from(dropped);
        published.report_latency.note(late_ns);
        Ok(())
    }
}

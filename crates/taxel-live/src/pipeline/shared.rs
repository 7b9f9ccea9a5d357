//! State that the threads of a pipeline share: what they publish, and what is requested of them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::Marker;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::rest::ValueSteps;
use taxel_core::wire::Registers;

use super::counters::Counters;
use super::frame_input::FrameInput;
use super::options::LiveOptions;
use super::readout_queue::ReadoutQueue;
use super::running_recording::{EndedRecording, RunningRecording};
use super::sending::Sent;
use super::sink::OutputDetection;
use super::viewer_queue::ViewerEvents;
use crate::capture::Receiver;
use crate::latency::{Latencies, Quantiles};
use crate::locked::lock;
use crate::recording::{Header, now_ns};
use crate::{Error, Result};

/// Interval at which a wait for a reply checks whether the decoding thread has ended.
const ANSWER_EVERY: Duration = Duration::from_millis(50);

/// The values that the threads publish: counts, the low-rate frame, the tare.
#[derive(Debug, Default)]
pub(super) struct PublishedState {
    pub(super) counters: Counters,
    pub(super) decode_latency: Latencies,
    pub(super) report_latency: Latencies,
    pub(super) markers: Vec<Marker>,
    pub(super) frame: Vec<u16>,
    /// The steps of those values and the time of the first frame, us, and the values of the same frame, if the source sends
    /// frames.
    pub(super) steps: Option<(ValueSteps, i64)>,
    pub(super) values: Vec<f32>,
    pub(super) tare: Option<Tare>,
    /// The readout's rest of each taxel, by taxel index; empty if its encoder uses no tare, or has none yet.
    pub(super) rest: Vec<Option<f64>>,
    /// The latest zeroing of each taxel, by its index.
    pub(super) zeroed: BTreeMap<usize, Zeroing>,
    /// Number of zeroings.
    pub(super) zeroings: u64,
    pub(super) failed: Option<Error>,
}

/// The recording that runs, where one does.
#[derive(Default)]
pub(super) struct RecordingSlot {
    pub(super) running: Mutex<Option<RunningRecording>>,
    /// Whether it runs and was begun while the pipeline ran.
    pub(super) runs: AtomicBool,
    /// The error that ended one early which was begun while the pipeline ran.
    pub(super) broken: Mutex<Option<Error>>,
}

/// State shared by all threads.
pub(super) struct PipelineShared {
    pub(super) options: LiveOptions,
    /// The frames of numbers that it receives; it receives a board if there are none.
    pub(super) frames: Option<Arc<FrameInput>>,
    pub(super) begun: Instant,
    pub(super) receiver: Receiver,
    pub(super) readout_queue: ReadoutQueue,
    pub(super) published: Mutex<PublishedState>,
    pub(super) recording: RecordingSlot,
    /// Requests to the decoding thread, which handles them between two batches.
    pub(super) requests: Mutex<Vec<Request>>,
    pub(super) requested: AtomicBool,
    /// Further queues that get each detection; a slow one misses some.
    pub(super) subscribers: Mutex<Vec<channel::Sender<OutputDetection>>>,
    /// The counts of each destination of detections.
    pub(super) sending: Vec<Arc<Mutex<Sent>>>,
    /// The current registers.
    pub(super) registers: Mutex<Registers>,
    pub(super) ended: AtomicBool,
}

/// What the decoding thread does between two batches; an error ends the pipeline.
pub(super) type Request = Box<dyn FnOnce(&mut dyn Decoding) -> Result<()> + Send>;

/// What the decoding thread can be asked for: its stages share this state, which so cannot name them.
pub(super) trait Decoding {
    /// Notes a write of the board's registers.
    fn note_registers(&mut self, registers: &Registers) -> Result<()>;

    /// Notes that the board was set to this version of the wire.
    fn expect_version(&mut self, version: u8) -> Result<()>;

    /// Adds a viewer of the events.
    fn add_viewer(&mut self) -> ViewerEvents;

    /// Ends the running recording, and records into this one, if there is one, from the next datagram on.
    fn switch_recording(&mut self, next: Option<RunningRecording>) -> Result<EndedRecording>;

    /// Makes what these taxels rest at now their rest: where one cannot be zeroed none is.
    fn zero(&mut self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>>;
}

impl PipelineShared {
    pub(super) fn published(&self) -> MutexGuard<'_, PublishedState> {
        lock(&self.published)
    }

    /// Has the decoding thread do something, within 20 ms, but not after its end.
    pub(super) fn request(&self, request: impl FnOnce(&mut dyn Decoding) -> Result<()> + Send + 'static) {
        lock(&self.requests).push(Box::new(request));
        self.requested.store(true, Ordering::Release);
    }

    /// Has the decoding thread do something, and returns what that gives; an error of it ends nothing.
    ///
    /// # Errors
    ///
    /// That of `work`; `Core(Problem)` if the decoding thread has ended.
    pub(super) fn ask<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut dyn Decoding) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (answer, answered) = channel::bounded(1);
        self.request(move |stages| {
            // A caller that no longer waits was told that all has ended.
            let _ = answer.send(work(stages));
            Ok(())
        });
        loop {
            match answered.recv_timeout(ANSWER_EVERY) {
                Ok(answer) => return answer,
                Err(_) if self.has_ended() => return Err(taxel_core::problem!("live: has ended").into()),
                Err(_) => {}
            }
        }
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    pub(super) fn counters(&self) -> Counters {
        let (published, capture) = (self.published(), self.receiver.counts());
        let decoding =
            if capture.stamped_when_read { Quantiles::default() } else { published.decode_latency.quantiles() };
        Counters {
            capture,
            lines: self.frames.as_ref().map(|frames| frames.counts()),
            decode_latency: decoding,
            report_latency: published.report_latency.quantiles(),
            sent: self.sending.iter().map(|counts| lock(counts).clone()).collect(),
            seconds: self.begun.elapsed().as_secs_f64(),
            ..published.counters.clone()
        }
    }

    /// The header of a recording of this source alone.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if a name or a property is not valid.
    pub(super) fn header(&self) -> Result<Header> {
        let options = LiveOptions { registers: *lock(&self.registers), ..self.options.clone() };
        Ok(options.header(self.receiver.origin())?)
    }

    /// Writes a note, with the current time or without one.
    pub(super) fn note(&self, text: &str, timed: bool) -> Result<()> {
        let board_us = self.published().counters.board.board_us.filter(|_| timed);
        match &*lock(&self.recording.running) {
            Some(recording) => recording.note(now_ns(), board_us, text),
            None => Err(taxel_core::problem!("a note is saved only in a recording: record to a .mcap file").into()),
        }
    }

    /// Records lines that were not read, as they came; an error of the file, which the next frame meets too, is its.
    pub(super) fn record_unread(&self, lines: &[(i64, String)]) {
        if let (false, Some(recording)) = (lines.is_empty(), &*lock(&self.recording.running)) {
            let _ = lines.iter().try_for_each(|(at_ns, text)| recording.unread_line(*at_ns, text));
        }
    }

    /// Ends the pipeline because of an error, which [`Live::next`](super::Live::next) and
    /// [`Live::stop`](super::Live::stop) then return.
    pub(super) fn fail(&self, error: Error) {
        self.published().failed.get_or_insert(error);
        self.receiver.stop();
    }
}

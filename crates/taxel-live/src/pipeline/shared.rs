//! What the threads of a pipeline share, what they publish, and what is requested of them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::Marker;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;

use super::counters::Counters;
use super::options::LiveOptions;
use super::readout_queue::ReadoutQueue;
use super::recorder::{Host, Recorder};
use super::sending::Line;
use super::sink::OutputDetection;
use super::viewer_queue::ViewerEvents;
use crate::capture::Receiver;
use crate::latency::Latencies;
use crate::locked::lock;
use crate::recording::Track;
use crate::{Error, Result};

/// How often a wait for an answer checks whether the decoding thread has ended.
const ANSWER_EVERY: Duration = Duration::from_millis(50);

/// What the threads publish: counts, the picture, the tare.
#[derive(Debug, Default)]
pub(super) struct Published {
    pub(super) counters: Counters,
    pub(super) decode_latency: Latencies,
    pub(super) output_latency: Latencies,
    pub(super) markers: Vec<Marker>,
    pub(super) picture: Vec<u16>,
    pub(super) tare: Option<Tare>,
    /// The rest of each taxel that the readout reads with, by taxel index; empty where it needs none, or has none yet.
    pub(super) rest: Vec<Option<f64>>,
    /// The latest zeroing of each taxel, by its index.
    pub(super) zeroed: BTreeMap<usize, Zeroing>,
    /// How often taxels were zeroed.
    pub(super) zeroings: u64,
    pub(super) failed: Option<Error>,
}

/// The recording that runs, where one does.
#[derive(Default)]
pub(super) struct RecordingSlot {
    pub(super) recorder: Mutex<Option<Recorder>>,
    /// Whether it runs and was begun while the pipeline ran.
    pub(super) runs: AtomicBool,
    /// The error that ended one early which was begun while the pipeline ran.
    pub(super) broken: Mutex<Option<Error>>,
    /// Times of detections, markers and notes, us, around which it gets pictures, since it last did.
    pub(super) picture_times: Mutex<Vec<i64>>,
}

/// What all threads share.
pub(super) struct Shared {
    pub(super) options: LiveOptions,
    pub(super) begun: Instant,
    pub(super) receiver: Receiver,
    pub(super) readout_queue: ReadoutQueue,
    pub(super) published: Mutex<Published>,
    pub(super) recording: RecordingSlot,
    /// Requests to the decoding thread, which it answers between two batches.
    pub(super) requests: Mutex<Vec<Request>>,
    pub(super) requested: AtomicBool,
    /// Further queues that get each detection; a slow one misses some.
    pub(super) subscribers: Mutex<Vec<channel::Sender<OutputDetection>>>,
    /// Where detections go.
    pub(super) sending: Vec<Arc<Line>>,
    /// The registers as they are now.
    pub(super) registers: Mutex<Registers>,
    /// The version of the wire that the board was newly set to; 0 where it was not.
    pub(super) expected: AtomicU8,
    pub(super) ended: AtomicBool,
}

/// The recording that ran, where one did, and the counters of its last datagram.
pub(super) type Ended = (Option<Recorder>, Counters);

/// What the decoding thread does between two batches.
pub(super) enum Request {
    /// End the recording that runs, and record into this one, where there is one, from the next datagram on.
    Record(Option<Box<Recorder>>, channel::Sender<Result<Ended>>),
    /// Give a viewer the events.
    View(channel::Sender<ViewerEvents>),
    /// Give datagrams for another computer.
    Copy(channel::Sender<channel::Receiver<Vec<u8>>>),
    /// The registers were written.
    Registers(Registers),
    /// Zero these taxels, and return the zeroings.
    Zero(Vec<(u16, u16)>, channel::Sender<Result<Vec<Zeroing>>>),
}

impl Shared {
    pub(super) fn published(&self) -> MutexGuard<'_, Published> {
        lock(&self.published)
    }

    /// Requests something of the decoding thread, which answers within 20 ms, and never after its end.
    pub(super) fn request(&self, request: Request) {
        lock(&self.requests).push(request);
        self.requested.store(true, Ordering::Release);
    }

    /// The recording gets the pictures around these times, us.
    pub(super) fn picture_around(&self, times: impl IntoIterator<Item = i64>) {
        lock(&self.recording.picture_times).extend(times);
    }

    /// Everything that arrived was processed.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Release);
    }

    /// Waits for the answer to a request.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the decoding thread has ended.
    pub(super) fn wait<T>(&self, answer: &channel::Receiver<T>) -> Result<T> {
        loop {
            match answer.recv_timeout(ANSWER_EVERY) {
                Ok(answer) => return Ok(answer),
                Err(_) if self.has_ended() => return Err(taxel_core::problem!("live: has ended").into()),
                Err(_) => {}
            }
        }
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    pub(super) fn counters(&self) -> Counters {
        let published = self.published();
        Counters {
            capture: self.receiver.counts(),
            bridged: self.receiver.bridged(),
            decode_latency: published.decode_latency.quantiles(),
            output_latency: published.output_latency.quantiles(),
            sent: self.sending.iter().map(|line| line.counts()).collect(),
            seconds: self.begun.elapsed().as_secs_f64(),
            ..published.counters.clone()
        }
    }

    /// Writes a note, with the current time or without one.
    pub(super) fn note(&self, text: &str, timed: bool) -> Result<()> {
        let board_us = self.published().counters.board_us.filter(|_| timed);
        match &*lock(&self.recording.recorder) {
            Some(recorder) => {
                self.picture_around(board_us);
                recorder.note(board_us, text)
            }
            None => Err(taxel_core::problem!("a note is kept in a recording: record to a .mcap file").into()),
        }
    }

    /// Ends everything because of an error, which [`Live::next`](super::Live::next) and [`Live::stop`](super::Live::stop) then give.
    pub(super) fn fail(&self, error: Error) {
        self.published().failed.get_or_insert(error);
        self.receiver.stop();
    }
}

impl Host for Shared {
    fn part(&self, name: &str) -> Result<Track> {
        match &*lock(&self.recording.recorder) {
            Some(recorder) => recorder.track_of(name),
            None => Err(taxel_core::problem!("source {name}: nothing is recorded").into()),
        }
    }

    fn fail(&self, error: Error) {
        Self::fail(self, error);
    }
}

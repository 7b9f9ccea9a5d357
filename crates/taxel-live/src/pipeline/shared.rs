//! What the threads of a pipeline share, and what they show to those who look on.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Instant;

use crossbeam_channel as channel;
use taxel_core::Marker;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::wire::Registers;

use super::counters::Counters;
use super::handover::Handover;
use super::options::LiveOptions;
use super::recorder::{Host, Recorder};
use super::said::Said;
use super::sending::Line;
use super::tap::Outlet;
use crate::capture::Receiver;
use crate::latency::Latencies;
use crate::locked::lock;
use crate::recording::Track;
use crate::{Error, Result};

/// What the threads tell those who look on.
#[derive(Debug, Default)]
pub(super) struct Shown {
    pub(super) counters: Counters,
    pub(super) decode_latency: Latencies,
    pub(super) said_latency: Latencies,
    pub(super) markers: Vec<Marker>,
    pub(super) picture: Vec<u16>,
    pub(super) tare: Option<Tare>,
    /// What the readout takes each taxel to read at rest, by taxel index; empty where it reads no tare, or has none yet.
    pub(super) rest: Vec<Option<f64>>,
    /// What was zeroed last at each taxel, by its index.
    pub(super) zeroed: BTreeMap<usize, Zeroing>,
    /// How often something was.
    pub(super) zeroings: u64,
    pub(super) failed: Option<Error>,
}

/// What all threads share.
pub(super) struct Shared {
    pub(super) options: LiveOptions,
    pub(super) begun: Instant,
    pub(super) receiver: Receiver,
    pub(super) handover: Handover,
    pub(super) shown: Mutex<Shown>,
    pub(super) recorder: Mutex<Option<Recorder>>,
    /// What ended a recording that was begun while listening, early.
    pub(super) broken: Mutex<Option<Error>>,
    /// What the decoding thread is asked for between two batches.
    pub(super) wishes: Mutex<Vec<Wish>>,
    pub(super) wished: AtomicBool,
    /// Times of detections, markers and notes, us, since the recording's pictures were looked at last.
    pub(super) happened: Mutex<Vec<i64>>,
    /// Whether a recording was begun while listening, and has not ended.
    pub(super) records: AtomicBool,
    /// Those who hear detections beside [`Live::next`](super::Live::next); who is too slow misses some.
    pub(super) listeners: Mutex<Vec<channel::Sender<Said>>>,
    /// Where detections go.
    pub(super) sending: Vec<Arc<Line>>,
    /// What the registers hold now, which may not be what they held at the beginning.
    pub(super) registers: Mutex<Registers>,
    /// The version of the wire that the board was told to speak, since this was looked at last; 0: nothing was said.
    pub(super) expected: AtomicU8,
    pub(super) ended: AtomicBool,
}

/// The recording that ran, where one did, and the counters of its last datagram.
pub(super) type Ended = (Option<Recorder>, Counters);

/// What the decoding thread does between two batches.
pub(super) enum Wish {
    /// End the recording that runs, and record into this one, where there is one, from the next datagram on.
    Record(Option<Box<Recorder>>, channel::Sender<Result<Ended>>),
    /// Let somebody look on.
    Look(channel::Sender<Outlet>),
    /// Give copies for other computers.
    Copy(channel::Sender<channel::Receiver<Vec<u8>>>),
    /// The registers were written.
    Registers(Registers),
    /// Zero these taxels, and say what that was.
    Zero(Vec<(u16, u16)>, channel::Sender<Result<Vec<Zeroing>>>),
}

impl Shared {
    pub(super) fn shown(&self) -> MutexGuard<'_, Shown> {
        lock(&self.shown)
    }

    /// Asks the decoding thread for something; it hears it within 20 ms, and never where it has ended.
    pub(super) fn wish(&self, wish: Wish) {
        lock(&self.wishes).push(wish);
        self.wished.store(true, Ordering::Release);
    }

    /// Something is worth a picture: the recording gets those around these times, us.
    pub(super) fn happened(&self, times: impl IntoIterator<Item = i64>) {
        lock(&self.happened).extend(times);
    }

    /// Everything was worked through.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Release);
    }

    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    pub(super) fn counters(&self) -> Counters {
        let shown = self.shown();
        Counters {
            capture: self.receiver.counts(),
            bridged: self.receiver.bridged(),
            decode_latency: shown.decode_latency.quantiles(),
            said_latency: shown.said_latency.quantiles(),
            sent: self.sending.iter().map(|line| line.counts()).collect(),
            seconds: self.begun.elapsed().as_secs_f64(),
            ..shown.counters.clone()
        }
    }

    /// Writes something down, with the time of now or without one.
    pub(super) fn note(&self, text: &str, timed: bool) -> Result<()> {
        let board_us = self.shown().counters.board_us.filter(|_| timed);
        match &*lock(&self.recorder) {
            Some(recorder) => {
                self.happened(board_us);
                recorder.note(board_us, text)
            }
            None => Err(taxel_core::problem!("a note is kept in a recording: record to a .mcap file").into()),
        }
    }

    /// Ends everything because of an error, which [`Live::next`](super::Live::next) and [`Live::stop`](super::Live::stop) then give.
    pub(super) fn fail(&self, error: Error) {
        self.shown().failed.get_or_insert(error);
        self.receiver.stop();
    }
}

impl Host for Shared {
    fn part(&self, name: &str) -> Result<Track> {
        match &*lock(&self.recorder) {
            Some(recorder) => recorder.writer(name),
            None => Err(taxel_core::problem!("source {name}: nothing is recorded").into()),
        }
    }

    fn fail(&self, error: Error) {
        Self::fail(self, error);
    }
}

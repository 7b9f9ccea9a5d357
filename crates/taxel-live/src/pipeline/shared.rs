//! What the threads of a pipeline share, and what they show to those who look on.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};

use taxel_core::Marker;
use taxel_core::encode::Tare;

use super::counters::Counters;
use super::handover::Handover;
use super::recorder::Recorder;
use crate::Error;
use crate::capture::Receiver;
use crate::latency::Latencies;

/// What the threads tell those who look on.
#[derive(Debug, Default)]
pub(super) struct Shown {
    pub(super) counters: Counters,
    pub(super) decode_latency: Latencies,
    pub(super) said_latency: Latencies,
    pub(super) markers: Vec<Marker>,
    pub(super) picture: Vec<u16>,
    pub(super) tare: Option<Tare>,
    pub(super) failed: Option<Error>,
}

/// What all threads share.
pub(super) struct Shared {
    pub(super) receiver: Receiver,
    pub(super) handover: Handover,
    pub(super) shown: Mutex<Shown>,
    pub(super) recorder: Option<Recorder>,
    pub(super) ended: AtomicBool,
}

impl Shared {
    pub(super) fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends everything because of an error, which [`Live::next`](super::Live::next) and [`Live::stop`](super::Live::stop) then give.
    pub(super) fn fail(&self, error: Error) {
        self.shown().failed.get_or_insert(error);
        self.receiver.stop();
    }
}

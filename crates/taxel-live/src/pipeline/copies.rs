//! Copies for other computers: datagrams as they arrived, the low-rate frame, detections.
//!
//! The decoding thread gathers datagrams into parcels and queues them if there is room; it never waits. Parcels that do
//! not fit are counted in those that follow.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use serde_json::json;

use super::shared::PipelineShared;
use super::sink::OutputDetection;
use crate::capture::{Batch, ParcelPacker};
use crate::kernel_drops::KernelDrops;
use crate::recording::{LOW_RATE_EVERY, now_ns};

/// Longest time for which a parcel gathers datagrams.
pub(super) const GATHER: Duration = Duration::from_millis(5);
/// Interval without datagrams after which an empty parcel states the time before which nothing arrived.
const STILL_HERE: Duration = Duration::from_millis(10);

/// Capacity of the queue of parcels: 64 MiB.
const WAITING: usize = 1 << 8;

/// A copy for other computers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Copied {
    /// Datagrams.
    Parcel(Vec<u8>),
    /// The taxels' values, as JSON.
    Frame(Vec<u8>),
    /// A detection: a line of JSON.
    Detection(Vec<u8>),
}

/// The receiving end of the copies.
pub struct Copies {
    shared: Arc<PipelineShared>,
    parcels: channel::Receiver<Vec<u8>>,
    detections: channel::Receiver<OutputDetection>,
    sent_frame: Instant,
    decoded: u64,
}

impl Copies {
    pub(super) fn new(
        shared: Arc<PipelineShared>,
        parcels: channel::Receiver<Vec<u8>>,
        detections: channel::Receiver<OutputDetection>,
    ) -> Self {
        Self { shared, parcels, detections, sent_frame: Instant::now(), decoded: 0 }
    }

    /// The next copy; `None` after `timeout` without one.
    pub fn next(&mut self, timeout: Duration) -> Option<Copied> {
        if let Some(frame) = self.frame() {
            return Some(frame);
        }
        channel::select! {
            recv(self.parcels) -> parcel => parcel.ok().map(Copied::Parcel),
            recv(self.detections) -> output => output.ok().and_then(detection),
            default(timeout) => None,
        }
    }

    /// Whether the pipeline has ended, and every copy was read.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.has_ended() && self.parcels.is_empty() && self.detections.is_empty()
    }

    /// A frame, if it is due and events have arrived since the last one.
    fn frame(&mut self) -> Option<Copied> {
        if self.sent_frame.elapsed() < LOW_RATE_EVERY {
            return None;
        }
        self.sent_frame = Instant::now();
        let published = self.shared.published();
        if published.counters.decoding.decoded == self.decoded {
            return None;
        }
        self.decoded = published.counters.decoding.decoded;
        let array = &self.shared.options.array;
        let frame = json!({
            "t_us": published.counters.board.board_us,
            "rows": array.rows,
            "columns": array.columns,
            "ticks": published.frame,
        });
        Some(Copied::Frame(frame.to_string().into_bytes()))
    }
}

fn detection(output: OutputDetection) -> Option<Copied> {
    output.line().ok().map(Copied::Detection)
}

/// The decoding thread's end of the copies.
pub(super) struct Copier {
    parcels: channel::Sender<Vec<u8>>,
    packer: ParcelPacker,
    /// When the current parcel was begun, or the last one was closed.
    since: Instant,
}

/// A copier that starts after this number of received datagrams, and the receiver of its parcels.
pub(super) fn copier(received: u64) -> (Copier, channel::Receiver<Vec<u8>>) {
    let (give, parcels) = channel::bounded(WAITING);
    (Copier { parcels: give, packer: ParcelPacker::after(received), since: Instant::now() }, parcels)
}

impl Copier {
    /// Adds what arrived.
    pub(super) fn push(&mut self, batch: &Batch, dropped_by_kernel: KernelDrops) {
        for (datagram, bytes) in batch.iter() {
            if self.packer.waiting() == 0 {
                self.since = Instant::now();
            }
            let full = self.packer.push(datagram.number, datagram.arrived_ns, bytes, dropped_by_kernel);
            if let Some(full) = full {
                self.give(full);
                self.since = Instant::now();
            }
        }
    }

    /// Closes a parcel that is due, or states that nothing arrived before `silent_until`; returns false if there is no
    /// receiver any more.
    pub(super) fn tick(&mut self, silent_until: Option<i64>, dropped_by_kernel: KernelDrops) -> bool {
        let since = self.since.elapsed();
        let due =
            if self.packer.waiting() > 0 { since >= GATHER } else { since >= STILL_HERE && silent_until.is_some() };
        if !due {
            return true;
        }
        self.since = Instant::now();
        let parcel = self.packer.close(silent_until.unwrap_or(i64::MIN), dropped_by_kernel, false);
        self.give(parcel)
    }

    /// Sends the last parcel, with the datagrams that still wait.
    pub(super) fn finish(&mut self, dropped_by_kernel: KernelDrops) {
        let parcel = self.packer.close(now_ns(), dropped_by_kernel, true);
        // Waits for room, because only this parcel contains the last counts of losses; without a receiver it is dropped
        // at once.
        let _ = self.parcels.send_timeout(parcel, STILL_HERE * 10);
    }

    fn give(&mut self, parcel: Vec<u8>) -> bool {
        match self.parcels.try_send(parcel) {
            Ok(()) => true,
            Err(channel::TrySendError::Full(parcel)) => {
                self.packer.count_dropped(&parcel);
                true
            }
            Err(channel::TrySendError::Disconnected(_)) => false,
        }
    }
}

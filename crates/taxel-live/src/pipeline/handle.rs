//! What other parts may do with a pipeline while it runs: get its events, record, announce what was written to the board.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use crossbeam_channel as channel;
use taxel_core::encode::Zeroing;
use taxel_core::wire::Registers;

use super::copies::Copies;
use super::counters::{Counters, Summary};
use super::options::{LiveOptions, Record};
use super::recordings::Recordings;
use super::shared::{Request, Shared};
use super::sink::OutputDetection;
use super::viewer_queue::ViewerEvents;
use crate::Result;
use crate::capture::Origin;
use crate::locked::lock;

/// Detections that wait for another computer at most.
const COPIED_WAITING: usize = 1 << 12;

/// What others may do with a [`Live`](super::Live) while it runs, and after.
#[derive(Clone)]
pub struct Handle {
    pub(super) shared: Arc<Shared>,
    pub(super) recordings: Arc<Recordings>,
}

impl Handle {
    /// How the [`Live`](super::Live) was begun.
    #[must_use]
    pub fn options(&self) -> &LiveOptions {
        &self.shared.options
    }

    /// The address that it receives on; unspecified, with port 0, where a bridge feeds it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.receiver.address()
    }

    /// Where datagrams come from.
    #[must_use]
    pub fn place(&self) -> &Origin {
        self.shared.receiver.place()
    }

    /// As [`Live::counters`](super::Live::counters).
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.shared.counters()
    }

    /// As [`Live::is_over`](super::Live::is_over).
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire)
    }

    /// The board's registers, as far as they are known.
    #[must_use]
    pub fn registers(&self) -> Registers {
        *lock(&self.shared.registers)
    }

    /// Announces what was written to the board's registers: it is recorded, and the version of the wire is expected.
    pub fn wrote(&self, registers: Registers) {
        *lock(&self.shared.registers) = registers;
        self.shared.request(Request::Registers(registers));
    }

    /// Returns copies of the events from the next batch on, for a viewer.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the pipeline has ended.
    pub fn events(&self) -> Result<ViewerEvents> {
        let (answer, events) = channel::bounded(1);
        self.shared.request(Request::View(answer));
        self.shared.wait(&events)
    }

    /// Copies what arrives, for other computers, from the next batch on.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the pipeline has ended.
    pub fn copy(&self) -> Result<Copies> {
        let (answer, parcels) = channel::bounded(1);
        let detections = self.detections(COPIED_WAITING);
        self.shared.request(Request::Copy(answer));
        Ok(Copies::new(Arc::clone(&self.shared), self.shared.wait(&parcels)?, detections))
    }

    /// Returns a queue of the detections from now on; at most `waiting` wait, and a slow receiver misses some.
    #[must_use]
    pub fn detections(&self, waiting: usize) -> channel::Receiver<OutputDetection> {
        let (sender, receiver) = channel::bounded(waiting);
        lock(&self.shared.subscribers).push(sender);
        receiver
    }

    /// Records what arrives from now on, of all sources, beginning with the registers and the held values. A recording that
    /// runs ends with what arrived before: each datagram, and each line, belongs to one of the two.
    ///
    /// # Errors
    ///
    /// `File` where the file exists or cannot be created: then the one that runs goes on. What ended that one early, or `File`
    /// where its end cannot be written. `Core(Problem)` where all is over.
    pub fn record(&self, record: &Record) -> Result<Option<Summary>> {
        self.recordings.record(record)
    }

    /// Ends the recording that [`Handle::record`] began: what it contains, and the file, where anything arrived.
    ///
    /// # Errors
    ///
    /// What ended it early, or `File` where its end cannot be written; `Core(Problem)` where there is none.
    pub fn end_recording(&self) -> Result<Summary> {
        self.recordings.end()
    }

    /// Whether a recording that [`Handle::record`] began runs, and has not been ended by an error.
    #[must_use]
    pub fn records(&self) -> bool {
        self.recordings.run()
    }

    /// Whether anything is recorded, also from the beginning on.
    #[must_use]
    pub fn is_recording(&self) -> bool {
        lock(&self.shared.recording.recorder).is_some()
    }

    /// As [`Live::note`](super::Live::note).
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn note(&self, text: &str) -> Result<()> {
        self.shared.note(text, true)
    }

    /// Writes a note that holds for the whole recording, such as the name of a trial: a note without a time, which is no event.
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn entitle(&self, text: &str) -> Result<()> {
        self.shared.note(text, false)
    }

    /// Makes the values that these taxels (column, row) hold their rest from now on, in the readout and in the recording's
    /// pictures; the recording states when that was, and the rests before and after. Only done on request.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where a taxel does not exist or has had no event so far, a tare is being measured, or a `.lsa` is recorded, which
    /// cannot hold it: then none is zeroed. `File` where the disk is full.
    pub fn zero(&self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let (answer, zeroed) = channel::bounded(1);
        self.shared.request(Request::Zero(taxels.to_vec(), answer));
        self.shared.wait(&zeroed).and_then(std::convert::identity)
    }

    /// The latest zeroing of each taxel that was zeroed, by taxel index; and how often taxels were.
    #[must_use]
    pub fn zeroed(&self) -> (Vec<Zeroing>, u64) {
        let published = self.shared.published();
        (published.zeroed.values().copied().collect(), published.zeroings)
    }

    /// How often taxels were zeroed.
    #[must_use]
    pub fn zeroings(&self) -> u64 {
        self.shared.published().zeroings
    }
}

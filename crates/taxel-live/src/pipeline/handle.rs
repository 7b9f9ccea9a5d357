//! Operations on a running pipeline: receiving its events, recording, announcing what was written to the board.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use crossbeam_channel as channel;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::rest::ValueSteps;
use taxel_core::wire::Registers;

use super::counters::{Counters, LiveSummary};
use super::options::{LiveOptions, Record};
use super::recording_switch::RecordingSwitch;
use super::shared::{PipelineRequest, PipelineShared};
use super::sink::OutputDetection;
use super::viewer_queue::ViewerEvents;
use crate::Result;
use crate::capture::Origin;
use crate::locked::lock;

/// A handle to a [`Live`](super::Live), for other threads, valid while it runs and after.
#[derive(Clone)]
pub struct Handle {
    pub(super) shared: Arc<PipelineShared>,
    pub(super) recording_switch: Arc<RecordingSwitch>,
}

impl Handle {
    /// The options of the [`Live`](super::Live).
    #[must_use]
    pub fn options(&self) -> &LiveOptions {
        &self.shared.options
    }

    /// The names of its sources: first the one that is read out, then those that are only recorded.
    #[must_use]
    pub fn source_names(&self) -> Vec<String> {
        let others = self.shared.sources.iter().map(|source| &source.name);
        std::iter::once(&self.shared.options.name).chain(others).cloned().collect()
    }

    /// The address on which it receives; unspecified, with port 0, for frames.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.receiver.address()
    }

    /// The source of datagrams.
    #[must_use]
    pub fn origin(&self) -> &Origin {
        self.shared.receiver.origin()
    }

    /// As [`Live::counters`](super::Live::counters).
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.shared.counters()
    }

    /// Unit and steps of the frames of numbers that are received, in which viewers get their values, and the time of the
    /// first one, us; `None` of a board, and before the first frame.
    #[must_use]
    pub fn frame_values(&self) -> Option<(String, ValueSteps, i64)> {
        let frames = self.shared.frames.as_ref()?;
        let (steps, begin_us) = self.shared.published().steps?;
        Some((frames.layout.unit.clone(), steps, begin_us))
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

    /// Announces a write of the board's registers: it is recorded, and its version of the wire is expected.
    pub fn announce_registers(&self, registers: Registers) {
        *lock(&self.shared.registers) = registers;
        self.shared.request(PipelineRequest::Registers(registers));
    }

    /// Returns copies of the events from the next batch on, for a viewer.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the pipeline has ended.
    pub fn events(&self) -> Result<ViewerEvents> {
        let (answer, events) = channel::bounded(1);
        self.shared.request(PipelineRequest::View(answer));
        self.shared.wait(&events)
    }

    /// Returns a queue of the detections from now on with capacity `waiting`; a slow receiver misses some.
    #[must_use]
    pub fn detections(&self, waiting: usize) -> channel::Receiver<OutputDetection> {
        let (sender, receiver) = channel::bounded(waiting);
        lock(&self.shared.subscribers).push(sender);
        receiver
    }

    /// Starts a recording of all sources, which begins with the registers and the taxels' values. A recording that runs
    /// ends with what arrived before: each datagram, and each line, belongs to one of the two.
    ///
    /// # Errors
    ///
    /// `File` if the file exists or cannot be created: then the one that runs goes on. What ended that one early, or `File`
    /// if its end cannot be written. `Core(Problem)` if all is over.
    pub fn record(&self, record: &Record) -> Result<Option<LiveSummary>> {
        self.recording_switch.record(record)
    }

    /// Ends the recording that [`Handle::record`] started; returns its summary, with the file if anything arrived.
    ///
    /// # Errors
    ///
    /// What ended it early, or `File` if its end cannot be written; `Core(Problem)` if there is none.
    pub fn end_recording(&self) -> Result<LiveSummary> {
        self.recording_switch.end()
    }

    /// Whether a recording that [`Handle::record`] started is running, and was not ended by an error.
    #[must_use]
    pub fn records(&self) -> bool {
        self.recording_switch.run()
    }

    /// Whether any recording is running, including one from the pipeline's beginning.
    #[must_use]
    pub fn is_recording(&self) -> bool {
        lock(&self.shared.recording.running).is_some()
    }

    /// As [`Live::note`](super::Live::note).
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn note(&self, text: &str) -> Result<()> {
        self.shared.note(text, true)
    }

    /// Writes a note about the whole recording, such as the name of a trial: a note without a time, which is not an
    /// event.
    ///
    /// # Errors
    ///
    /// As [`Live::note`](super::Live::note).
    pub fn entitle(&self, text: &str) -> Result<()> {
        self.shared.note(text, false)
    }

    /// Makes the values that these taxels (column, row) hold (of a source of frames: their medians over the last second) their
    /// rest from now on, in the readout and in the recording's previews; the recording states when that was, and the rests before and after. Only done on request.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where a taxel does not exist or has had no event so far, or a tare is being measured: then
    /// none is zeroed. `File` where the disk is full.
    pub fn zero(&self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let (answer, zeroed) = channel::bounded(1);
        self.shared.request(PipelineRequest::Zero(taxels.to_vec(), answer));
        self.shared.wait(&zeroed).and_then(std::convert::identity)
    }

    /// The latest zeroing of each zeroed taxel, by taxel index; and the number of zeroings.
    #[must_use]
    pub fn latest_zeroings(&self) -> (Vec<Zeroing>, u64) {
        let published = self.shared.published();
        (published.zeroed.values().copied().collect(), published.zeroings)
    }

    /// The rest that the readout reads with, by taxel index; empty without a readout that has one.
    #[must_use]
    pub fn rest(&self) -> Vec<Option<f64>> {
        self.shared.published().rest.clone()
    }

    /// The tare that was measured; `None` before the measurement ends, and where none is measured.
    #[must_use]
    pub fn measured_tare(&self) -> Option<Tare> {
        self.shared.published().tare.clone()
    }

    /// Number of zeroings.
    #[must_use]
    pub fn zeroings(&self) -> u64 {
        self.shared.published().zeroings
    }
}

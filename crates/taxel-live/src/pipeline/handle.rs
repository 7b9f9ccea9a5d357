//! Operations on a running pipeline: what it counts and holds, its lines of numbers, its recordings, what was written to the board.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use crossbeam_channel as channel;
use taxel_core::encode::{Tare, Zeroing};
use taxel_core::rest::ValueSteps;
use taxel_core::wire::Registers;
use taxel_core::{Marker, problem};

use super::counters::{Counters, LiveSummary};
use super::frame_input::{FrameInput, ReadLines};
use super::options::{LiveOptions, Record};
use super::running_recording::{EndedRecording, RunningRecording, losses};
use super::shared::PipelineShared;
use super::sink::OutputDetection;
use super::source::FrameLayout;
use super::viewer_queue::ViewerEvents;
use crate::capture::{FIREWALL, Origin};
use crate::locked::lock;
use crate::recording::{RecordingCounts, Verdict};
use crate::{Error, Result};

/// A handle to a [`Live`](super::Live), for other threads, valid while it runs and after.
#[derive(Clone)]
pub struct Handle {
    pub(super) shared: Arc<PipelineShared>,
    /// The other sources of its recordings, by name, each with a pipeline of its own.
    pub(super) pipelines: Arc<[(String, Arc<PipelineShared>)]>,
    /// Locked while one recording replaces another.
    replacing: Arc<Mutex<()>>,
}

impl Handle {
    pub(super) fn new(shared: Arc<PipelineShared>, pipelines: Arc<[(String, Arc<PipelineShared>)]>) -> Self {
        Self { shared, pipelines, replacing: Arc::default() }
    }

    /// The address on which the pipeline receives, with the actual port if 0 was requested; unspecified, with port 0,
    /// for frames.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.shared.receiver.address()
    }

    /// Where datagrams come from.
    #[must_use]
    pub fn origin(&self) -> &Origin {
        self.shared.receiver.origin()
    }

    /// Whether the pipeline has ended, by [`Live::end`](super::Live::end) or by an error, and everything was processed.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.has_ended()
    }

    /// Counts of what arrived, how it was processed and what was lost, so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let sources = self.pipelines.iter().map(|(name, shared)| (name.clone(), shared.counters()));
        Counters { sources: sources.collect(), ..self.shared.counters() }
    }

    /// What these counts say was lost of each source, or that nothing arrived.
    #[must_use]
    pub fn verdict(&self, counters: &Counters) -> Verdict {
        verdict(&self.shared, counters, &losses(counters, None))
    }

    /// The address on which another board of the recording is received; `None` if there is no such source.
    #[must_use]
    pub fn source_address(&self, name: &str) -> Option<SocketAddr> {
        self.of_source(name).map(|source| source.address())
    }

    /// A handle to another source of its recordings; `None` if there is no such source.
    #[must_use]
    pub fn of_source(&self, name: &str) -> Option<Self> {
        let (_, shared) = self.pipelines.iter().find(|(known, _)| known == name)?;
        Some(Self::new(Arc::clone(shared), Arc::default()))
    }

    /// Passes lines of a source of numbers on, as a reader or a program has them.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no such source, it has other columns, or has ended; `File` if the disk is full.
    pub fn lines(&self, name: &str, read: &ReadLines) -> Result<()> {
        let Some((shared, frames)) = self.frames_of(name) else {
            return Err(problem!("source {name:?}: no source of numbers has this name").into());
        };
        shared.record_unread(&read.unread);
        frames.push(name, read)
    }

    /// Ends a source of frames, of which no more lines can come.
    pub fn end_lines(&self, name: &str) {
        if let Some((_, frames)) = self.frames_of(name) {
            frames.end();
        }
    }

    /// The pipeline of the source of frames of this name.
    fn frames_of(&self, name: &str) -> Option<(&PipelineShared, &FrameInput)> {
        let main = (&self.shared.options.name, &self.shared);
        let mut all = std::iter::once(main).chain(self.pipelines.iter().map(|(name, shared)| (name, shared)));
        let (_, shared) = all.find(|(known, shared)| *known == name && shared.frames.is_some())?;
        Some((shared, shared.frames.as_ref()?))
    }

    /// The layout of the frames of numbers that it receives; `None` of a board.
    #[must_use]
    pub fn layout(&self) -> Option<&FrameLayout> {
        self.shared.options.layout()
    }

    /// The options, with the sensor and the name of the source.
    #[must_use]
    pub fn options(&self) -> &LiveOptions {
        &self.shared.options
    }

    /// The values of frames of numbers, by taxel index, updated ten times a second; empty before the first one.
    #[must_use]
    pub fn values(&self) -> Vec<f32> {
        self.shared.published().values.clone()
    }

    /// The taxels' values, ticks, by taxel index, updated ten times a second; 0 for a taxel without any event so far.
    #[must_use]
    pub fn frame(&self) -> Vec<u16> {
        self.shared.published().frame.clone()
    }

    /// The fresh tare, once it is complete.
    #[must_use]
    pub fn tare(&self) -> Option<Tare> {
        self.shared.published().tare.clone()
    }

    /// The start and stop markers since the last call.
    #[must_use]
    pub fn take_markers(&self) -> Vec<Marker> {
        std::mem::take(&mut self.shared.published().markers)
    }

    /// Writes a note into the recording, with the current time.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if nothing is recorded that can hold notes, `File` if the disk is full.
    pub fn note(&self, text: &str) -> Result<()> {
        self.shared.note(text, true)
    }

    /// Announces that the host set the board to this version of the wire (a write of REG0): datagrams of it are decoded at
    /// once, not after a second.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no such version.
    pub fn expect_version(&self, version: u8) -> Result<()> {
        if !(1..=2).contains(&version) {
            return Err(problem!("wire version {version}: must be 1 or 2").into());
        }
        self.shared.request(move |stages| stages.expect_version(version));
        Ok(())
    }

    /// Restarts the recording that runs, where no source has given anything; returns whether it did.
    #[must_use]
    pub fn record_again(&self) -> bool {
        // Read before the recording is locked: counting and recording must not wait for each other.
        let now = self.shared.counters();
        lock(&self.shared.recording.running).as_mut().is_some_and(|recording| recording.restart_if_empty(&now))
    }

    /// The names of its sources: first the one that is read out, then those that are only recorded.
    #[must_use]
    pub fn source_names(&self) -> Vec<String> {
        let others = self.shared.options.sources.iter().map(|source| &source.name);
        std::iter::once(&self.shared.options.name).chain(others).cloned().collect()
    }

    /// Unit and steps of the frames of numbers that are received, in which viewers get their values, and the time of the
    /// first one, us; `None` of a board, and before the first frame.
    #[must_use]
    pub fn frame_values(&self) -> Option<(String, ValueSteps, i64)> {
        let (steps, begin_us) = self.shared.published().steps?;
        Some((self.layout()?.unit.clone(), steps, begin_us))
    }

    /// The board's registers, as far as they are known.
    #[must_use]
    pub fn registers(&self) -> Registers {
        *lock(&self.shared.registers)
    }

    /// Announces a write of the board's registers: it is recorded, and its version of the wire is expected.
    pub fn announce_registers(&self, registers: Registers) {
        *lock(&self.shared.registers) = registers;
        self.shared.request(move |stages| stages.note_registers(&registers));
    }

    /// Returns copies of the events from the next batch on, for a viewer.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if the pipeline has ended.
    pub fn events(&self) -> Result<ViewerEvents> {
        self.shared.ask(|stages| Ok(stages.add_viewer()))
    }

    /// Returns a queue of the detections from now on with capacity `waiting`; a slow receiver misses some.
    #[must_use]
    pub fn detections(&self, waiting: usize) -> channel::Receiver<OutputDetection> {
        let (sender, receiver) = channel::bounded(waiting);
        lock(&self.shared.subscribers).push(sender);
        receiver
    }

    /// Starts a recording of all sources, which begins with the registers and the taxels' values. A recording that runs
    /// ends with what arrived before, and is returned: each datagram, and each line, belongs to one of the two.
    ///
    /// # Errors
    ///
    /// `File` if the file exists or cannot be created: then the one that runs goes on. What ended that one early, or `File`
    /// if its end cannot be written. `Core(Problem)` if all is over.
    pub fn record(&self, record: &Record) -> Result<Option<LiveSummary>> {
        if !self.shared.recording.runs.load(Ordering::Acquire) {
            // Returns an error that ended an earlier recording and that no call has returned yet.
            self.take_error()?;
        }
        let next = RunningRecording::create(record, self.shared.header()?, &self.shared.options.sources, true)?;
        self.replace(Some(next))
    }

    /// Ends the recording that [`Handle::record`] started; returns its summary, with the file if anything arrived.
    ///
    /// # Errors
    ///
    /// What ended it early, or `File` if its end cannot be written; `Core(Problem)` if there is none.
    pub fn end_recording(&self) -> Result<LiveSummary> {
        self.replace(None)?.ok_or_else(|| problem!("nothing is recorded").into())
    }

    /// Whether a recording that [`Handle::record`] started is running, and was not ended by an error.
    #[must_use]
    pub fn records(&self) -> bool {
        let is_sound = |shared: &PipelineShared| lock(&shared.recording.broken).is_none();
        self.shared.recording.runs.load(Ordering::Acquire) && self.pipelines.iter().all(|(_, shared)| is_sound(shared))
    }

    /// The error that ended a recording early, of this source or another one.
    fn take_error(&self) -> Result<()> {
        let all = self.pipelines.iter().map(|(_, shared)| shared).chain([&self.shared]);
        let errors: Vec<Error> = all.filter_map(|shared| lock(&shared.recording.broken).take()).collect();
        errors.into_iter().next().map_or(Ok(()), Err)
    }

    /// Ends the running recording and starts the next one, if there is one; returns how the first ended.
    fn replace(&self, next: Option<RunningRecording>) -> Result<Option<LiveSummary>> {
        let replacing = lock(&self.replacing);
        let mut sources = BTreeMap::new();
        let mut ended = vec![];
        for (name, board) in self.pipelines.iter() {
            let header = board.header()?;
            let track = next.as_ref().map(|next| next.track_of(name)).transpose()?;
            let part = track.map(|track| RunningRecording::part(track, &header, true));
            let (recording, counts) = replace_of(board, part)?;
            let counters = recording
                .as_ref()
                .and_then(RunningRecording::since)
                .map_or_else(Counters::default, |s| counts.since(s));
            sources.insert(name.clone(), counters);
            ended.push((recording, counts));
        }
        let (recording, counters) = replace_of(&self.shared, next)?;
        // The parts must end before the whole recording.
        for (part, counts) in ended {
            part.map_or(Ok(None), |part| part.finish(&counts))?;
        }
        drop(replacing);
        self.take_error()?;
        let Some(recording) = recording else { return Ok(None) };
        let came =
            Counters { sources, ..recording.since().map_or_else(Counters::default, |since| counters.since(since)) };
        let lost = recording.losses(&counters);
        let path = recording.finish(&counters)?;
        let verdict = verdict(&self.shared, &came, &lost);
        let tare = self.shared.published().tare.clone();
        Ok(Some(LiveSummary { counters: came, verdict, path, tare }))
    }

    /// Whether any recording is running, including one from the pipeline's beginning.
    #[must_use]
    pub fn is_recording(&self) -> bool {
        lock(&self.shared.recording.running).is_some()
    }

    /// Writes a note about the whole recording, such as the name of a trial: a note without a time, which is not an
    /// event.
    ///
    /// # Errors
    ///
    /// As [`Handle::note`].
    pub fn entitle(&self, text: &str) -> Result<()> {
        self.shared.note(text, false)
    }

    /// Makes the values that these taxels (column, row) hold (of a source of frames: their medians over the last second) their
    /// rest from now on, in the readout; the recording states when that was, and the rests before and after. Only done on
    /// request.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where a taxel does not exist or has had no event so far, or a tare is being measured: then
    /// none is zeroed. `File` where the disk is full.
    pub fn zero(&self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let taxels = taxels.to_vec();
        self.shared.ask(move |stages| stages.zero(&taxels))
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
}

/// Makes the decoding thread of one board record into `next`, or not at all; returns the recording that ran.
fn replace_of(shared: &PipelineShared, next: Option<RunningRecording>) -> Result<EndedRecording> {
    // Set before the request, so that the recording runs for callers that ask after this call.
    shared.recording.runs.fetch_or(next.is_some(), Ordering::AcqRel);
    let ended = shared.ask(|stages| stages.switch_recording(next));
    if ended.is_err() {
        shared.recording.runs.store(lock(&shared.recording.running).is_some(), Ordering::Release);
    }
    ended
}

/// What was lost of each source, or that nothing arrived.
fn verdict(shared: &PipelineShared, counters: &Counters, lost: &RecordingCounts) -> Verdict {
    let of_source = |counters: &Counters, lost: &RecordingCounts| match &counters.lines {
        None => lost.verdict().doubtful(counters.decoding.totals.doubtful_after),
        Some(_) => Verdict::of_lines(lost),
    };
    let verdict = if counters.nothing_came() {
        Verdict::nothing_arrived(nothing_arrived(shared.receiver.origin(), counters.seconds))
    } else {
        of_source(counters, lost)
    };
    let others = counters.sources.iter().map(|(name, counts)| (name.clone(), of_source(counts, &losses(counts, None))));
    Verdict::combine(std::iter::once((shared.options.name.clone(), verdict)).chain(others).collect())
}

/// What a user should check if nothing arrived.
fn nothing_arrived(origin: &Origin, seconds: f64) -> String {
    let ask = match origin {
        Origin::Udp(address) => {
            format!("does the board send to this machine, and to port {}?{FIREWALL}", address.port())
        }
        Origin::Frames(_) => "is the sensor connected, and does it send lines of numbers?".to_owned(),
    };
    format!("nothing arrived at {origin} in {seconds:.1} s: {ask}")
}

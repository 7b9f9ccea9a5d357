//! Converts datagrams, or frames of numbers, to detections, as they arrive.
//!
//! The stages are *receive*, *decode*, *record* and *read out* (`stages`). One thread runs them all, and passes them to
//! another thread before it calls a sink (`threads`). While a recording runs, which a disk may delay, there are
//! separate threads for receiving ([`crate::capture`]), for decoding with recording, and for reading out; reading out
//! also has its own thread if it is slower than the events arrive. The queues between the threads are bounded, and what
//! does not fit is counted where it was lost. Viewers receive copies ([`Live::counters`], [`Live::frame`]) and cannot
//! slow the pipeline.

mod counters;
mod decode_stage;
mod frame_block;
mod frame_input;
mod frame_stage;
mod frame_times;
mod handle;
mod observers;
mod options;
mod output;
mod readout_queue;
mod readout_stage;
mod receive_stage;
mod recent_frames;
mod record_stage;
mod recording_switch;
mod running_readout;
mod running_recording;
mod sending;
mod shared;
mod sink;
mod source;
mod sources;
mod speculative_readout;
mod stages;
mod tare_measurement;
mod threads;
mod viewer_queue;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::detect::Detector;
use taxel_core::encode::Tare;
use taxel_core::wire;
use taxel_core::{Marker, Stop, problem};

use crate::capture::Origin;
use crate::locked::lock;
use crate::recording::SourceWriter;
use crate::{Error, Result};
pub use counters::{
    Arrival, ArrivalState, BoardState, Counters, DecodingCounts, LiveSummary, ReadoutCounts, SourceCounts,
};
pub use frame_input::{LineCounts, ReadLines};
pub use handle::Handle;
pub use options::{LiveOptions, Record, StatedTare};
use output::DetectionOutput;
use readout_queue::ReadoutQueue;
use recording_switch::RecordingSwitch;
pub use running_readout::ReadoutSetup;
use running_readout::RunningReadout;
use running_recording::RunningRecording;
use sending::Sending;
pub use sending::{Destination, Sent};
use shared::{PipelineShared, PublishedState, RecordingSlot, frame_time, header_of};
pub use sink::{LineSink, OutputDetection, Sink};
pub use source::{BoardSource, FrameLayout, FrameSource, NamedSource, SourceKind};
use sources::{NumberStream, Others, PipelineInput};
use stages::Stages;
use threads::Threads;
pub use viewer_queue::{Piece, TaxelChange, ViewerEvents};

/// Interval at which a waiting call checks whether it must stop.
const CHECK_EVERY: Duration = Duration::from_millis(50);

/// Capacity of the queue of [`Live::next`], detections; more are lost for it, and counted, but still reach the sinks.
const OUTPUT_WAITING: usize = 1 << 14;

/// A running pipeline from datagrams to detections, from [`Live::start`] until [`Live::stop`].
pub struct Live {
    shared: Arc<PipelineShared>,
    detections: channel::Receiver<OutputDetection>,
    threads: Vec<JoinHandle<()>>,
    others: Mutex<Others<Live>>,
    recording_switch: Arc<RecordingSwitch>,
}

impl Live {
    /// Opens the source that the options state (and the file), and starts: frames of numbers, or a board.
    ///
    /// # Errors
    ///
    /// As [`Live::start`]; those of [`ReadoutSetup::new`]; of a readout that cannot be read, or is of another unit.
    pub fn open(options: LiveOptions, sinks: Vec<Box<dyn Sink>>) -> Result<Self> {
        let readout = options.readout.as_deref().map(Detector::from_json).transpose()?;
        let input = match &options.input {
            Some(frames) => {
                frames.layout.check()?;
                PipelineInput::Frames(frames.place.clone(), Box::new(frames.layout.clone()))
            }
            None => PipelineInput::Board(options.address()?),
        };
        if let Some(readout) = &readout {
            match input.layout() {
                None => readout.check_unit("ticks")?,
                Some(layout) => readout.check_unit(&layout.unit).map_err(|error| {
                    let unit = readout.unit().unwrap_or_default();
                    problem!("{error}; if the values are in {unit}, add unit={unit} in --source")
                })?,
            }
        }
        let frames = frame_time(&options, input.layout());
        let readout = ReadoutSetup::new(readout, &options, frames)?;
        Self::start_from(input, options, readout, sinks)
    }

    /// Opens the socket (and the file), and starts to receive a board.
    ///
    /// # Errors
    ///
    /// `Socket` if the port is in use, `File` if the file exists or cannot be created, or a destination cannot be
    /// opened, `Core(Problem)` if an option is not valid.
    pub fn start(
        address: SocketAddr,
        options: LiveOptions,
        readout: ReadoutSetup,
        sinks: Vec<Box<dyn Sink>>,
    ) -> Result<Self> {
        Self::start_from(PipelineInput::Board(address), options, readout, sinks)
    }

    fn start_from(
        input: PipelineInput,
        mut options: LiveOptions,
        readout: ReadoutSetup,
        sinks: Vec<Box<dyn Sink>>,
    ) -> Result<Self> {
        if options.record_later && options.record.is_some() {
            return Err(problem!("record and record_later are both given: give only one of them").into());
        }
        if let (None, false, Some(source)) = (&options.record, options.record_later, options.sources.first()) {
            let name = &source.name;
            return Err(problem!(
                "source {name}: taxel can only record this source; give record, the file of the recording"
            )
            .into());
        }
        let sources = std::mem::take(&mut options.sources);
        Self::begin(input, options, sources, readout, sinks, None)
    }

    /// Starts the pipeline; `part` writes it into the recording of another one.
    fn begin(
        input: PipelineInput,
        options: LiveOptions,
        sources: Vec<NamedSource>,
        readout: ReadoutSetup,
        sinks: Vec<Box<dyn Sink>>,
        part: Option<SourceWriter>,
    ) -> Result<Self> {
        for (name, frames) in [("guard_frames", options.guard_frames), ("gap_frames", options.gap_frames)] {
            if !(frames.is_finite() && frames >= 0.0) {
                return Err(problem!(name; " is {frames}: must be 0 or more and finite").into());
            }
        }
        if options.readout_events == 0 {
            return Err(problem!("readout_events"; " is 0: must be 1 or more").into());
        }
        if input.layout().is_none() {
            wire::v2::checked_stride(&options.array)?;
            options.registers.check(&options.array)?;
        }
        match &readout {
            ReadoutSetup::Taring(stretch_us, _) if *stretch_us <= 0 => {
                return Err(problem!("tare"; " of {stretch_us} us: must be above 0").into());
            }
            ReadoutSetup::Taring(_, readout) => readout.check()?,
            ReadoutSetup::None | ReadoutSetup::Reading(_) => {}
        }
        let record = options.recording()?;
        let sending = options.send.iter().map(|to| Sending::open(&to.parse()?)).collect::<Result<Vec<_>>>()?;
        // The socket is opened before the file, so that a port that is in use leaves no empty file.
        let (receiver, frames) = input.open(options.capture())?;
        let header = header_of(&options, receiver.origin(), frames.as_ref().map(|frames| &frames.layout))?;
        let recording = match (part, &record) {
            (Some(part), _) => Some(RunningRecording::part(part, &header, false)),
            (None, Some(record)) => Some(RunningRecording::create(record, header, &sources, false)?),
            (None, None) => None,
        };
        let published = PublishedState { frame: vec![0; options.array.len()], ..PublishedState::default() };
        let shared = Arc::new(PipelineShared {
            receiver,
            readout_queue: ReadoutQueue::new(&options.array, options.readout_events),
            published: Mutex::new(published),
            recording: RecordingSlot { running: Mutex::new(recording), ..RecordingSlot::default() },
            requests: Mutex::default(),
            requested: AtomicBool::new(false),
            subscribers: Mutex::default(),
            sending: sending.iter().map(Sending::line).collect(),
            registers: Mutex::new(options.registers),
            options: options.clone(),
            frames,
            sources,
            begun: Instant::now(),
            expected: AtomicU8::new(0),
            ended: AtomicBool::new(false),
        });
        let (queue, detections) = channel::bounded(OUTPUT_WAITING);
        let reads_out = !matches!(readout, ReadoutSetup::None);
        let begin = |input: PipelineInput, options: LiveOptions, part: Option<SourceWriter>| {
            Self::begin(input, options, vec![], ReadoutSetup::None, vec![], part)
        };
        let others = Others::start(&shared, begin).inspect_err(|_| {
            // Nothing arrived: the file is removed.
            let recording = lock(&shared.recording.running).take();
            drop(recording.map(|recording| recording.finish(&Counters::default())));
        })?;
        let pipelines = others.pipelines.iter().map(|(name, live)| (name.clone(), Arc::clone(&live.shared)));
        let recording_switch = RecordingSwitch::new(Arc::clone(&shared), pipelines.collect(), others.numbers.clone());
        let others = Mutex::new(others);
        let mut live = Self {
            shared: Arc::clone(&shared),
            detections,
            threads: vec![],
            others,
            recording_switch: Arc::new(recording_switch),
        };
        // The destinations come first: a device that detections drive must not wait for a callback.
        let sending = sending.into_iter().map(|sending| Box::new(sending) as Box<dyn Sink>);
        let output = DetectionOutput::new(sending.chain(sinks).collect(), queue);
        let readout = reads_out.then(|| RunningReadout::new(readout, &options.array, shared.frame_time()));
        let stages = Stages::new(&shared, readout);
        let names: &[&str] = if reads_out { &["taxel-decode", "taxel-readout"] } else { &["taxel-decode"] };
        let threads = Arc::new(Threads::new(stages, output, names.len()));
        for name in names {
            let (threads, shared) = (Arc::clone(&threads), Arc::clone(&shared));
            live.spawn(name, move || threads.run(&shared))?;
        }
        Ok(live)
    }

    fn spawn(&mut self, name: &str, job: impl FnOnce() + Send + 'static) -> Result<()> {
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(job);
        self.threads.push(thread.map_err(Error::socket("thread"))?);
        Ok(())
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

    /// A handle with the operations that other threads may use while the pipeline runs.
    #[must_use]
    pub fn handle(&self) -> Handle {
        Handle { shared: Arc::clone(&self.shared), recording_switch: Arc::clone(&self.recording_switch) }
    }

    /// The next detection; `None` after `timeout` without one, or at once if the pipeline has ended.
    ///
    /// # Errors
    ///
    /// The error that ended the pipeline early: the disk is full, the socket failed, the encoder cannot use what arrives.
    pub fn next(&self, timeout: Duration) -> Result<Option<OutputDetection>> {
        match self.detections.recv_timeout(timeout) {
            Ok(output) => Ok(Some(output)),
            Err(channel::RecvTimeoutError::Timeout) => self.check().map(|()| None),
            Err(channel::RecvTimeoutError::Disconnected) => {
                self.check()?;
                // Without a readout there are no detections: waits for the timeout, but not beyond the end.
                if !self.is_over() {
                    std::thread::sleep(timeout);
                }
                Ok(None)
            }
        }
    }

    /// As [`Live::next`], but returns `None` as soon as `stop` requests it.
    ///
    /// # Errors
    ///
    /// As [`Live::next`].
    pub fn wait(&self, timeout: Duration, stop: Stop<'_>) -> Result<Option<OutputDetection>> {
        let until = Instant::now().checked_add(timeout);
        loop {
            let left = until.map_or(CHECK_EVERY, |t| t.saturating_duration_since(Instant::now()));
            // Read before `next`: if an error has ended the pipeline, `next` then returns it.
            let over = self.is_over();
            let output = self.next(left.min(CHECK_EVERY))?;
            if output.is_some() || over || left.is_zero() || stop.asked() {
                return Ok(output);
            }
        }
    }

    fn check(&self) -> Result<()> {
        self.shared.published().failed.take().map_or(Ok(()), Err)
    }

    /// Whether the pipeline has ended, by [`Live::end`] or by an error, and everything was processed.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.shared.ended.load(Ordering::Acquire)
    }

    /// Counts of what arrived, how it was processed and what was lost, so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        let others = lock(&self.others);
        let counted = |(name, live): &(String, Live)| (name.clone(), SourceCounts::Pipeline(Box::new(live.counters())));
        let numbers = others.numbers.iter().map(|(name, numbers)| (name.clone(), numbers.counts()));
        Counters { sources: others.pipelines.iter().map(counted).chain(numbers).collect(), ..self.shared.counters() }
    }

    /// The address on which another board of the recording is received; `None` if there is no such source.
    #[must_use]
    pub fn source_address(&self, name: &str) -> Option<SocketAddr> {
        lock(&self.others).pipelines.iter().find(|(known, _)| known == name).map(|(_, live)| live.address())
    }

    /// Passes lines of a source of numbers on, as a reader or a program has them.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if there is no such source, it has other columns, or has ended; `File` if the disk is full.
    pub fn lines(&self, name: &str, read: &ReadLines) -> Result<()> {
        if let Some(numbers) = self.numbers_of(name) {
            return numbers.push(read);
        }
        match self.frames_of(name).as_ref().map(|shared| (shared, &shared.frames)) {
            Some((shared, Some(frames))) => {
                shared.record_unread(&read.unread);
                frames.push(name, read)
            }
            _ => Err(problem!("source {name:?}: no source of numbers has this name").into()),
        }
    }

    /// Ends a source of frames, of which no more lines can come.
    pub fn end_lines(&self, name: &str) {
        if let Some(frames) = self.frames_of(name).as_ref().and_then(|shared| shared.frames.as_ref()) {
            frames.end();
        }
    }

    fn numbers_of(&self, name: &str) -> Option<Arc<NumberStream>> {
        lock(&self.others).numbers.iter().find(|(known, _)| known == name).map(|(_, n)| Arc::clone(n))
    }

    /// The pipeline of the source of this name.
    fn frames_of(&self, name: &str) -> Option<Arc<PipelineShared>> {
        if self.shared.options.name == name && self.shared.frames.is_some() {
            return Some(Arc::clone(&self.shared));
        }
        lock(&self.others).pipelines.iter().find(|(known, _)| known == name).map(|(_, live)| Arc::clone(&live.shared))
    }

    /// The layout of the frames of numbers that it receives; `None` of a board.
    #[must_use]
    pub fn layout(&self) -> Option<&FrameLayout> {
        self.shared.frames.as_ref().map(|frames| &frames.layout)
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
        self.shared.expected.store(version, Ordering::Release);
        Ok(())
    }

    /// Starts a recording of all sources, which begins with the registers and the taxels' values. A recording that runs
    /// ends with what arrived before, and is returned: each datagram, and each line, belongs to one of them.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if recordings were not to begin later ([`LiveOptions::record_later`]), `File` if the file exists or
    /// cannot be created: then the one that runs goes on. What ended that one early, or `File` if its end cannot be written.
    pub fn record(&self, record: &Record) -> Result<Option<LiveSummary>> {
        if !self.shared.options.record_later {
            return Err(problem!("record: give record_later at the start to begin recordings later").into());
        }
        self.handle().record(record)
    }

    /// Restarts the recording that runs, where no source has given anything; returns whether it did.
    #[must_use]
    pub fn record_again(&self) -> bool {
        // Read before the recording is locked: counting and recording must not wait for each other.
        let now = self.shared.counters();
        lock(&self.shared.recording.running).as_mut().is_some_and(|recording| recording.restart_if_empty(&now))
    }

    /// As [`Handle::end_recording`].
    ///
    /// # Errors
    ///
    /// As [`Handle::end_recording`].
    pub fn end_recording(&self) -> Result<LiveSummary> {
        self.handle().end_recording()
    }

    /// As [`Handle::records`].
    #[must_use]
    pub fn records(&self) -> bool {
        self.handle().records()
    }

    /// Requests the end: all threads end once they have processed what arrived; [`Live::stop`] waits for them.
    pub fn end(&self) {
        self.shared.receiver.stop();
    }

    /// Ends the pipeline: processes what arrived, closes the file, and returns what was lost.
    ///
    /// # Errors
    ///
    /// The error that ended the pipeline early, or `File` if the end of the recording cannot be written.
    pub fn stop(mut self) -> Result<LiveSummary> {
        let others = lock(&self.others).stop(|board| Ok(board.stop()?.counters));
        let joined = self.join();
        let (sources, ended) = others.map_or_else(|error| (BTreeMap::new(), Err(error)), |counts| (counts, Ok(())));
        let counters = Counters { sources, ..self.shared.counters() };
        let recording = lock(&self.shared.recording.running).take();
        let path = recording.map_or(Ok(None), |recording| recording.finish(&counters))?;
        let lost = running_recording::losses(&counters, None);
        let verdict = recording_switch::verdict(
            &self.shared.options.name,
            self.origin(),
            &counters,
            counters.nothing_came(),
            &lost,
        );
        joined?;
        self.check()?;
        ended?;
        Ok(LiveSummary { counters, verdict, path, tare: self.tare() })
    }

    fn join(&mut self) -> Result<()> {
        self.end();
        for thread in self.threads.drain(..) {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
        Ok(())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.end();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

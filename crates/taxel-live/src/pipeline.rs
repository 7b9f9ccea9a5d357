//! Converts datagrams, or frames of numbers, to detections, as they arrive.
//!
//! The stages are *receive*, *decode*, *record* and *read out* (`stages`). One thread runs them all, and passes them to
//! another thread before it calls a sink (`threads`). While a recording runs, which a disk may delay, there are
//! separate threads for receiving ([`crate::capture`]), for decoding with recording, and for reading out; reading out
//! also has its own thread if it is slower than the events arrive. Viewers receive copies ([`Handle::counters`],
//! [`Handle::frame`]) and cannot slow the pipeline.
//!
//! The queues between the threads are bounded. They differ in what a full one costs, so that none can stand for another:
//!
//! | queue | from, to | bound | when it is full |
//! |---|---|---|---|
//! | `capture/queue` | receiving, or a source of frames, to decoding | bytes | datagrams are dropped and counted; a source waits |
//! | `readout_queue` | decoding to a readout in its own thread | events | events are dropped and counted; silences and zeroings never |
//! | `output` | who found a detection to who outputs one now | detections | the newest is lost and counted |
//! | [`Live::next`], [`Handle::detections`] | output to a caller | detections | this caller alone misses the newest |
//! | `sending` | output to a destination's thread | lines | the newest is lost and counted; late ones too |
//! | `viewer_queue` | decoding to a viewer | changes | this viewer misses changes, and gets the held values instead |
//! | `recording/mcap_writer/write_queue` | all threads to the disk | bytes | who records waits, and nothing is lost |

mod counters;
mod decode_stage;
mod flows;
mod frame_block;
mod frame_input;
mod frame_stage;
mod frame_times;
mod handle;
mod options;
mod output;
mod readout_queue;
mod readout_stage;
mod recent_frames;
mod record_stage;
mod running_readout;
mod running_recording;
mod sending;
mod shared;
mod sink;
mod source;
mod source_stage;
mod speculative_readout;
mod stages;
mod tare_measurement;
mod threads;
mod viewer_queue;
mod zeroing;

use std::ops::Deref;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel as channel;
use taxel_core::wire;
use taxel_core::wire::Registers;
use taxel_core::{Stop, problem};

use crate::capture::{Receiver, ReceiverOptions};
use crate::locked::lock;
use crate::recording::SourceWriter;
use crate::{Error, Result, address, host_clock};
pub use counters::{Arrival, ArrivalState, BoardState, Counters, DecodingCounts, LiveSummary, ReadoutCounts};
use frame_input::FrameInput;
pub use frame_input::{LineCounts, ReadLines};
pub use handle::Handle;
pub use options::{LiveOptions, Record, StatedTare};
use output::DetectionOutput;
use readout_queue::ReadoutQueue;
use running_readout::RunningReadout;
use running_recording::RunningRecording;
use sending::Sending;
pub use sending::Sent;
use shared::{PipelineShared, PublishedState, RecordingSlot};
pub use sink::{LineSink, OutputDetection, Sink};
pub use source::{BoardSource, FrameLayout, FrameSource, NamedSource, SourceKind};
use stages::Stages;
use threads::Threads;
pub use viewer_queue::{Piece, TaxelChange, ViewerEvents};

/// Interval at which a waiting call checks whether it must stop.
const CHECK_EVERY: Duration = Duration::from_millis(50);

/// Capacity of the queue of [`Live::next`], detections; more are lost for it, and counted, but still reach the sinks.
const OUTPUT_WAITING: usize = 1 << 14;

/// A running pipeline from datagrams to detections, from [`Live::open`] until [`Live::stop`].
pub struct Live {
    handle: Handle,
    detections: channel::Receiver<OutputDetection>,
    threads: Vec<JoinHandle<()>>,
    /// Other boards and sources of frames, by name, each with its own pipeline.
    others: Vec<(String, Live)>,
}

impl Deref for Live {
    type Target = Handle;

    fn deref(&self) -> &Handle {
        &self.handle
    }
}

impl Live {
    /// Opens the source that the options state (and the file), and starts: frames of numbers, or a board.
    ///
    /// # Errors
    ///
    /// `Socket` if the port is in use, `File` if the file exists or cannot be created, or a destination cannot be
    /// opened, `Core(Problem)` if an option is not valid; of a readout that cannot be read, or is of another unit.
    pub fn open(options: LiveOptions, sinks: Vec<Box<dyn Sink>>) -> Result<Self> {
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
        host_clock::set();
        Self::begin(options, sinks, None)
    }

    /// Starts the pipeline; `part` writes it into the recording of another one.
    fn begin(options: LiveOptions, sinks: Vec<Box<dyn Sink>>, part: Option<SourceWriter>) -> Result<Self> {
        if let Some(frames) = options.guard_frames.filter(|frames| !(frames.is_finite() && *frames >= 0.0)) {
            return Err(problem!("guard_frames"; " is {frames}: must be 0 or more and finite").into());
        }
        match options.layout() {
            Some(layout) => layout.check()?,
            None => {
                wire::v2::checked_stride(&options.array)?;
                options.registers.check(&options.array)?;
            }
        }
        let readout = RunningReadout::open(&options)?;
        let record = options.recording()?;
        let sending = options.send.iter().map(|to| Sending::open(to)).collect::<Result<Vec<_>>>()?;
        // The socket is opened before the file, so that a port that is in use leaves no empty file.
        let (receiver, frames) = match &options.input {
            None => (Receiver::bind(options.address()?, ReceiverOptions::default())?, None),
            Some(source) => {
                let (frames, receiver) = FrameInput::new(&source.place, &source.layout);
                (receiver, Some(frames))
            }
        };
        let header = options.header(receiver.origin())?;
        let recording = match (part, &record) {
            (Some(part), _) => Some(RunningRecording::part(part, &header, false)),
            (None, Some(record)) => Some(RunningRecording::create(record, header, &options.sources, false)?),
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
            sending: sending.iter().map(Sending::counts).collect(),
            registers: Mutex::new(options.registers),
            options,
            frames,
            begun: Instant::now(),
            ended: AtomicBool::new(false),
        });
        let (queue, detections) = channel::bounded(OUTPUT_WAITING);
        let others = Self::begin_others(&shared).inspect_err(|_| {
            // Nothing arrived: the file is removed.
            let recording = lock(&shared.recording.running).take();
            drop(recording.map(|recording| recording.finish(&Counters::default())));
        })?;
        let pipelines = others.iter().map(|(name, live)| (name.clone(), Arc::clone(&live.shared))).collect();
        let handle = Handle::new(Arc::clone(&shared), pipelines);
        let mut live = Self { handle, detections, threads: vec![], others };
        // The destinations come first: a device that detections drive must not wait for a callback.
        let sending = sending.into_iter().map(|sending| Box::new(sending) as Box<dyn Sink>);
        let output = DetectionOutput::new(sending.chain(sinks).collect(), queue);
        let names: &[&str] = if readout.is_some() { &["taxel-decode", "taxel-readout"] } else { &["taxel-decode"] };
        let stages = Stages::new(&shared, readout);
        let threads = Arc::new(Threads::new(stages, output, shared));
        for name in names {
            let threads = Arc::clone(&threads);
            live.spawn(name, move || threads.run())?;
        }
        Ok(live)
    }

    /// Starts the other sources of a recording.
    fn begin_others(shared: &PipelineShared) -> Result<Vec<(String, Self)>> {
        let mut pipelines = vec![];
        for NamedSource { name, place, kind } in &shared.options.sources {
            let part =
                lock(&shared.recording.running).as_ref().map(|recording| recording.track_of(name)).transpose()?;
            let (array, board, input) = match kind {
                SourceKind::Board(board) => (&board.array, Some(board), None),
                SourceKind::Frames(layout) => {
                    let input = FrameSource { text: String::new(), place: place.clone(), layout: (**layout).clone() };
                    (&layout.array, None, Some(input))
                }
            };
            let address = board.map(|board| address::of_text(&board.address)).transpose()?;
            let options = LiveOptions {
                name: name.clone(),
                array: array.clone(),
                registers: board.map_or_else(Registers::default, |board| board.registers),
                host: address.map(|address| address.ip().to_string()),
                port: address.map(|address| address.port()),
                input,
                differences: false,
                readout: None,
                tare: None,
                record: None,
                sources: vec![],
                send: vec![],
                ..shared.options.clone()
            };
            pipelines.push((name.clone(), Self::begin(options, vec![], part)?));
        }
        Ok(pipelines)
    }

    /// A handle with the operations that other threads may use while the pipeline runs.
    #[must_use]
    pub fn handle(&self) -> Handle {
        self.handle.clone()
    }

    fn spawn(&mut self, name: &str, job: impl FnOnce() + Send + 'static) -> Result<()> {
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(job);
        self.threads.push(thread.map_err(Error::socket("thread"))?);
        Ok(())
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
        let mut ended = Ok(());
        for (_, other) in std::mem::take(&mut self.others) {
            ended = ended.and(other.stop().map(drop));
        }
        if let Err(panic) = self.join() {
            std::panic::resume_unwind(panic);
        }
        let counters = self.counters();
        let recording = lock(&self.shared.recording.running).take();
        let path = recording.map_or(Ok(None), |recording| recording.finish(&counters))?;
        let verdict = self.verdict(&counters);
        self.check()?;
        ended?;
        Ok(LiveSummary { counters, verdict, path, tare: self.tare() })
    }

    fn join(&mut self) -> std::thread::Result<()> {
        self.end();
        let mut joined = Ok(());
        for thread in self.threads.drain(..) {
            joined = joined.and(thread.join());
        }
        joined
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.join();
    }
}

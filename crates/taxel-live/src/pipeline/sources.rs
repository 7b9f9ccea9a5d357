//! The running sources of a recording besides the board.
//!
//! Each source has its own clock, in addition to the host's arrival times, its own counts and its own thread. Data that
//! the thread does not read in time are buffered or dropped by the system.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;
use std::time::Instant;

use taxel_core::{Array, problem};

use super::counters::{Counters, SourceCounts};
use super::frame_input::{FrameInput, LineCounts};
use super::options::LiveOptions;
use super::record_stage::COUNTS_EVERY;
use super::running_recording::{Host, RecordingPart};
use super::shared::PipelineShared;
use super::source::{NamedSource, Opened, OpenedLines, SourceKind};
use crate::capture::{Receiver, ReceiverOptions};
use crate::frame_lines::FrameLayout;
use crate::line_input::LineReader;
use crate::line_place::LinePlace;
use crate::locked::lock;
use crate::recording::{self, Found, SourceWriter, StreamColumns, StreamFaults, cells, now_ns};
use crate::text_lines::{LeftOut, TextLine};
use crate::{Error, Result};

/// A running stream of numbers.
pub(super) struct NumberStream {
    part: RecordingPart,
    /// Whether lines are recorded from the first one on; otherwise only while a recording runs.
    always: bool,
    track: Mutex<NumbersTrack>,
    stream: StreamColumns,
    trouble: Mutex<Option<String>>,
    ends: AtomicBool,
}

/// The part of a recording into which lines are written, if any.
struct NumbersTrack {
    track: Option<SourceWriter>,
    /// Number of all lines, and of those before this part.
    lines: u64,
    before: u64,
    /// What is wrong with the lines of this part, and of all.
    faults: StreamFaults,
    all: StreamFaults,
    /// When the counts were last written.
    counted: Option<Instant>,
}

impl NumberStream {
    pub(super) fn new(part: RecordingPart, stream: StreamColumns, always: bool) -> Self {
        let faults = StreamFaults::new(&stream);
        let track = NumbersTrack { track: None, lines: 0, before: 0, all: faults.clone(), faults, counted: None };
        Self { part, always, track: Mutex::new(track), stream, trouble: Mutex::default(), ends: AtomicBool::new(false) }
    }

    /// Records a line of numbers.
    pub(super) fn sample(&self, arrived_ns: i64, values: &[f64]) -> Result<()> {
        if !self.stream.fits(values) {
            let columns = self.stream.columns.join(", ");
            let (name, n) = (&self.part.name, values.len());
            return Err(problem!("source {name}: {n} values; must be one per column: {columns}").into());
        }
        let faults = |faults: &mut StreamFaults| faults.line(&self.stream, values, arrived_ns);
        self.record(faults, |track, number| track.sample(arrived_ns, number, values))
    }

    /// Counts a line with its faults, and records it if a recording runs. Each line belongs to one recording.
    fn record(
        &self,
        count: impl Fn(&mut StreamFaults),
        write: impl FnOnce(&SourceWriter, u64) -> Result<()>,
    ) -> Result<()> {
        let mut current = lock(&self.track);
        if self.always && current.track.is_none() {
            current.track = Some(self.part.open()?);
        }
        let number = current.lines;
        current.lines += 1;
        count(&mut current.faults);
        count(&mut current.all);
        current.track.as_ref().map_or(Ok(()), |track| write(track, number))
    }

    /// Records a line of text.
    fn line(&self, arrived_ns: i64, line: &TextLine) -> Result<()> {
        let text = &*line.text;
        match self.stream.parse(text) {
            Some(values) if !line.cut => self.sample(arrived_ns, &values),
            // A repeated line of column names contains no numbers.
            None if !line.cut
                && (cells(text).eq(self.stream.columns.iter().map(String::as_str)) || text.trim().is_empty()) =>
            {
                Ok(())
            }
            _ => self.record(StreamFaults::strange, |track, number| track.strange_line(arrived_ns, number, text)),
        }
    }

    /// Counts bytes that arrived and are in no line; an unfinished recording states them too.
    fn count_left_out(&self, bytes: LeftOut) -> Result<()> {
        if bytes == LeftOut::default() {
            return Ok(());
        }
        let mut current = lock(&self.track);
        if self.always && current.track.is_none() {
            current.track = Some(self.part.open()?);
        }
        current.faults.count_left_out(bytes);
        current.all.count_left_out(bytes);
        if let Some(track) = &current.track {
            track.note_left_out();
        }
        if current.counted.is_some_and(|counted| counted.elapsed() < COUNTS_EVERY) {
            return Ok(());
        }
        current.counted = Some(Instant::now());
        let counts = losses_of_lines(current.lines - current.before, &current.faults.found());
        current.track.as_ref().map_or(Ok(()), |track| track.counts(now_ns(), &counts))
    }

    /// Records into this part of a recording from now on, or not at all; ends the previous part with its counts, and
    /// returns them.
    pub(super) fn record_into(&self, track: Option<SourceWriter>) -> SourceCounts {
        let mut current = lock(&self.track);
        let ended = std::mem::replace(&mut current.track, track);
        let faults = std::mem::replace(&mut current.faults, StreamFaults::new(&self.stream)).found();
        let lines = current.lines - current.before;
        current.before = current.lines;
        drop(current);
        if let Some(track) = ended {
            track.end(&self.part.name, losses_of_lines(lines, &faults));
        }
        self.counts_of(lines, faults)
    }

    pub(super) fn counts(&self) -> SourceCounts {
        let current = lock(&self.track);
        let (lines, faults) = (current.lines, current.all.found());
        drop(current);
        self.counts_of(lines, faults)
    }

    fn counts_of(&self, lines: u64, faults: Found) -> SourceCounts {
        SourceCounts::Numbers(Box::new(LineCounts::new(lines, faults, lock(&self.trouble).clone())))
    }

    /// Records no more lines: ends its part of the recording with its counts.
    pub(super) fn end(&self) {
        self.ends.store(true, Ordering::Release);
        self.record_into(None);
    }

    /// Reads lines until the end, in a separate thread; a failed line is opened again.
    pub(super) fn read(self: &Arc<Self>, opened: OpenedLines) -> Result<JoinHandle<()>> {
        let (numbers, OpenedLines { mut reader, begun, .. }) = (Arc::clone(self), opened);
        let thread = std::thread::Builder::new().name("taxel-lines".to_owned());
        let job = move || {
            let begun = begun.iter().try_for_each(|(line, at_ns)| numbers.line(*at_ns, line));
            if let Err(error) = begun.and_then(|()| numbers.read_lines(&mut reader))
                && !numbers.ends.load(Ordering::Acquire)
                && let Some(host) = numbers.part.host.upgrade()
            {
                host.fail(error);
            }
        };
        thread.spawn(job).map_err(Error::socket("thread"))
    }

    /// Reads lines until the end.
    fn read_lines(&self, reader: &mut LineReader) -> Result<()> {
        let mut failed = false;
        while !self.ends.load(Ordering::Acquire) {
            let ended = match reader.fill() {
                Ok(ended) => ended,
                Err(error) => {
                    *lock(&self.trouble) = Some(reader.broken(error).to_string());
                    failed = true;
                    reader.reopen();
                    continue;
                }
            };
            while let Some((line, at_ns)) = reader.next_whole(ended, |line| self.stream.parse(&line.text).is_some()) {
                self.line(at_ns, &line)?;
                if std::mem::take(&mut failed) {
                    *lock(&self.trouble) = None;
                }
            }
            if ended {
                break;
            }
            self.count_left_out(reader.lines.take_left_out())?;
        }
        reader.lines.discard();
        self.count_left_out(reader.lines.take_left_out())
    }
}

/// The losses of a stream of numbers, as recordings state them.
pub(super) fn losses_of_lines(lines: u64, faults: &Found) -> recording::RecordingCounts {
    let decoder = faults.counts;
    recording::RecordingCounts { received: lines, recorded: lines, decoder, ..recording::RecordingCounts::default() }
}

/// What a pipeline receives.
pub(super) enum PipelineInput {
    /// A board that sends to this address.
    Board(SocketAddr),
    /// Frames of numbers, and the lines to read them from.
    Frames(Option<LinePlace>, Box<FrameLayout>, Option<Box<OpenedLines>>),
}

impl PipelineInput {
    /// Frames of a place that may be open already, or of a program.
    pub(super) fn frames(place: &Option<LinePlace>, layout: &FrameLayout, opened: &Opened) -> Result<Self> {
        let lines = place.as_ref().map(|place| opened.take_or_open(place)).transpose()?;
        Ok(Self::Frames(place.clone(), Box::new(layout.clone()), lines.map(Box::new)))
    }

    /// The layout of its frames, if it has any.
    pub(super) fn layout(&self) -> Option<&FrameLayout> {
        match self {
            Self::Frames(_, layout, _) => Some(layout),
            Self::Board(_) => None,
        }
    }

    /// Opens the input: the receiver, and frames with the lines to read.
    pub(super) fn open(self, options: ReceiverOptions) -> Result<OpenInput> {
        Ok(match self {
            Self::Board(address) => (Receiver::bind(address, options)?, None, None),
            Self::Frames(place, layout, lines) => {
                let (frames, receiver) = FrameInput::new(place, *layout, options);
                (receiver, Some(frames), lines.map(|lines| *lines))
            }
        })
    }
}

/// A receiver, and frames of numbers with the lines to read them from.
pub(super) type OpenInput = (Receiver, Option<Arc<FrameInput>>, Option<OpenedLines>);

/// The running other sources of a pipeline.
pub(super) struct Others<Pipeline> {
    /// Other boards and sources of frames, each with its own pipeline.
    pub(super) pipelines: Vec<(String, Pipeline)>,
    pub(super) numbers: Vec<(String, Arc<NumberStream>)>,
    pub(super) threads: Vec<JoinHandle<()>>,
}

impl<Pipeline> Others<Pipeline> {
    /// Starts the other sources of a pipeline; `begin` starts the pipeline of one.
    pub(super) fn start(
        shared: &Arc<PipelineShared>,
        begin: impl Fn(PipelineInput, LiveOptions, RecordingPart) -> Result<Pipeline>,
    ) -> Result<Self> {
        let (mut others, options) = (Self { pipelines: vec![], numbers: vec![], threads: vec![] }, &shared.options);
        for NamedSource { name, kind } in &shared.sources {
            let host: Weak<dyn Host> = Arc::<PipelineShared>::downgrade(shared);
            let part = RecordingPart { host, name: name.clone() };
            let of_pipeline = |array: &Array| LiveOptions {
                record: options.record.clone(),
                compression: options.compression.clone(),
                overwrite: options.overwrite,
                kernel_buffer_bytes: options.kernel_buffer_bytes,
                queue_bytes: options.queue_bytes,
                gro: options.gro,
                ..LiveOptions::new(array.clone())
            };
            let (input, stream, opened) = match kind {
                SourceKind::Board(address, array, registers) => {
                    let of_board = LiveOptions { registers: *registers, ..of_pipeline(array) };
                    let board = begin(PipelineInput::Board(*address), of_board, part)?;
                    others.pipelines.push((name.clone(), board));
                    continue;
                }
                SourceKind::Frames(place, layout, opened) => {
                    let (input, of_frames) =
                        (PipelineInput::frames(place, layout, opened)?, of_pipeline(&layout.array));
                    others.pipelines.push((name.clone(), begin(input, of_frames, part)?));
                    continue;
                }
                SourceKind::Numbers(input, stream, opened) => (input, stream, opened),
            };
            let numbers = Arc::new(NumberStream::new(part, stream.clone(), options.record.is_some()));
            if let Some(input) = input {
                others.threads.push(numbers.read(opened.take_or_open(input)?)?);
            }
            others.numbers.push((name.clone(), numbers));
        }
        Ok(others)
    }

    /// Ends the threads that read numbers.
    fn end_lines(&mut self) {
        self.numbers.iter().for_each(|(_, numbers)| numbers.ends.store(true, Ordering::Release));
        for thread in self.threads.drain(..) {
            if let Err(panic) = thread.join() {
                std::panic::resume_unwind(panic);
            }
        }
    }

    /// Ends all sources, and returns their counts.
    pub(super) fn stop(
        &mut self,
        end: impl Fn(Pipeline) -> Result<Counters>,
    ) -> Result<BTreeMap<String, SourceCounts>> {
        self.end_lines();
        let mut counts = BTreeMap::new();
        for (name, numbers) in &self.numbers {
            numbers.end();
            counts.insert(name.clone(), numbers.counts());
        }
        let mut ended = Ok(());
        for (name, pipeline) in self.pipelines.drain(..) {
            match end(pipeline) {
                Ok(counters) => drop(counts.insert(name, SourceCounts::Pipeline(Box::new(counters)))),
                Err(error) => ended = ended.and(Err(error)),
            }
        }
        ended.map(|()| counts)
    }
}

impl<Pipeline> Drop for Others<Pipeline> {
    fn drop(&mut self) {
        self.end_lines();
    }
}

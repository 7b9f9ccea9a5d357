//! Runs the stages in sequence, in the thread that owns them: receive, decode, record, read out.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::held::{Held, UNKNOWN};
use taxel_core::problem;
use taxel_core::wire::Registers;

use super::decode_stage::DecodeStage;
use super::frame_stage::FrameStage;
use super::readout_queue::QuietUntil;
use super::readout_stage::ReadoutStage;
use super::record_stage::RecordStage;
use super::running_readout::RunningReadout;
use super::running_recording::{EndedRecording, RunningRecording};
use super::shared::{Decoding, PipelineShared};
use super::viewer_queue::{ViewerEvents, ViewerQueue, viewer_queue};
use crate::Result;
use crate::capture::Batch;
use crate::locked::lock;
use crate::recording::{BoardChange, BoardChangeKind, LOW_RATE_EVERY, now_ns};

/// Longest wait for datagrams.
const IDLE: Duration = Duration::from_millis(20);

/// Time for which datagrams are gathered during a recording without a readout: this costs half the CPU.
const GATHER: Duration = Duration::from_millis(1);

/// Number of events after which they are passed on, even in the middle of a large batch.
const FLUSH_AFTER: usize = 1 << 14;

/// Why [`Stages::run`] returned.
pub(super) enum StagesOutcome {
    /// Detections wait for output ([`Stages::pending_detections`]).
    Output,
    /// The readout must move to its own thread.
    MoveReadout(Box<RunningReadout>),
    /// No more data will arrive.
    Finished,
}

/// The second stage, by what the source sends.
enum SourceStage {
    Board(Box<DecodeStage>),
    Frames(Box<FrameStage>),
}

impl SourceStage {
    fn held(&self) -> &Held {
        match self {
            Self::Board(decode) => decode.held(),
            Self::Frames(frames) => frames.held(),
        }
    }

    /// Number of datagrams or frames.
    fn count(&self) -> u64 {
        match self {
            Self::Board(decode) => decode.datagram_count(),
            Self::Frames(frames) => frames.count(),
        }
    }

    /// How long to wait for data before the readout's time is advanced, if it depends on silence.
    fn tick(&self) -> Option<Duration> {
        match self {
            Self::Board(decode) => decode.tick(),
            Self::Frames(frames) => Some(frames.tick()),
        }
    }

    fn quiet_until(&self, until_ns: Option<i64>) -> Option<QuietUntil> {
        match self {
            Self::Board(decode) => decode.quiet_until(until_ns),
            Self::Frames(frames) => frames.quiet_until(until_ns),
        }
    }

    /// The rest of a taxel that nothing touches now: the held value of a board, the median of a noisy source's last second.
    fn rest_now(&self, taxel: usize) -> Option<f64> {
        match self {
            Self::Board(decode) => Some(decode.held().values()[taxel]).filter(|&held| held != UNKNOWN).map(f64::from),
            Self::Frames(frames) => frames.rest_now(taxel),
        }
    }
}

pub(super) struct Stages {
    shared: Arc<PipelineShared>,
    /// The memory of the last batch.
    batch: Batch,
    source: SourceStage,
    record: RecordStage,
    readout: ReadoutStage,
    viewers: Vec<ViewerQueue>,
    published_frame: Instant,
    begun: bool,
}

impl Stages {
    pub(super) fn new(shared: &Arc<PipelineShared>, readout: Option<RunningReadout>) -> Self {
        let options = &shared.options;
        let source = match options.layout() {
            None => SourceStage::Board(Box::new(DecodeStage::new(options))),
            Some(layout) => SourceStage::Frames(Box::new(FrameStage::new(layout, options.guard_frames))),
        };
        Self {
            shared: Arc::clone(shared),
            batch: Batch::new(),
            source,
            record: RecordStage::new(Arc::clone(shared)),
            readout: ReadoutStage::new(readout, &options.array),
            viewers: vec![],
            published_frame: Instant::now(),
            begun: false,
        }
    }

    /// Detections that do not wait for output yet.
    pub(super) fn pending_detections(&mut self) -> &mut Vec<Detection> {
        self.readout.pending_detections()
    }

    /// Runs until the caller has something to do; an error ends the pipeline.
    pub(super) fn run(&mut self) -> StagesOutcome {
        self.run_steps().unwrap_or_else(|error| {
            self.shared.fail(error);
            self.readout.close(&self.shared, None);
            StagesOutcome::Finished
        })
    }

    fn run_steps(&mut self) -> Result<StagesOutcome> {
        if !self.begun {
            self.begun = true;
            self.readout.begin(&self.shared);
            if self.record.runs() {
                self.move_to_threads()?;
            }
        }
        loop {
            if let Some(readout) = self.readout.take_separated() {
                return Ok(StagesOutcome::MoveReadout(readout));
            }
            if !self.pending_detections().is_empty() {
                return Ok(StagesOutcome::Output);
            }
            if self.shared.receiver.is_done() {
                self.finish()?;
                return Ok(StagesOutcome::Finished);
            }
            self.step()?;
        }
    }

    /// Moves receiving and reading out to separate threads, because a disk may delay this one.
    fn move_to_threads(&mut self) -> Result<()> {
        self.shared.receiver.receive_in_thread(if self.readout.is_on() { Duration::ZERO } else { GATHER })?;
        self.readout.move_to_thread();
        Ok(())
    }

    fn step(&mut self) -> Result<()> {
        let tick = if self.readout.is_on() { self.source.tick() } else { None };
        let mut batch = std::mem::take(&mut self.batch);
        if self.shared.receiver.receive(&mut batch, tick.map_or(IDLE, |tick| tick.min(IDLE)))? {
            self.process(&batch)?;
            self.record.with(|recording| recording.batch(&batch))?;
        } else {
            let until = self.shared.receiver.silent_until();
            if let (true, Some(quiet)) = (self.readout.is_on(), self.source.quiet_until(until)) {
                self.readout.process_silence(&self.shared, quiet);
            }
        }
        self.batch = batch;
        self.viewers.retain_mut(|queue| queue.tick(self.source.held()));
        self.record.previews(self.source.count(), self.source.held(), false)?;
        if self.published_frame.elapsed() >= LOW_RATE_EVERY {
            self.published_frame = Instant::now();
            self.publish_frame();
            self.record.progress()?;
        }
        if self.shared.requested.swap(false, Ordering::Acquire) {
            self.answer()?;
        }
        Ok(())
    }

    fn publish_frame(&self) {
        let mut published = self.shared.published();
        published.frame.iter_mut().zip(self.source.held().frame()).for_each(|(shown, value)| *shown = value);
        if let SourceStage::Frames(frames) = &self.source {
            frames.last().clone_into(&mut published.values);
        }
    }

    fn process(&mut self, batch: &Batch) -> Result<()> {
        let Self { shared, source, record, readout, viewers, .. } = self;
        match source {
            SourceStage::Board(decode) => EventFlow { shared, decode, record, readout, viewers }.decode(batch),
            SourceStage::Frames(stage) => {
                if stage.push(batch) {
                    viewers.iter_mut().for_each(|queue| queue.reset(stage.held()));
                }
                {
                    let (now, mut published) = (now_ns(), shared.published());
                    batch.iter().for_each(|(message, _)| published.decode_latency.note(now - message.arrived_ns));
                    stage.publish(&mut published.counters);
                    published.steps = stage.steps();
                }
                let (frames, changes, held) = stage.parts();
                viewers.iter_mut().for_each(|queue| queue.push(changes, held));
                readout.push_frames(shared, frames);
                stage.clear();
                Ok(())
            }
        }
    }

    /// Ends the input: passes on what waits in each stage.
    fn finish(&mut self) -> Result<()> {
        let Self { shared, source, record, readout, viewers, .. } = self;
        let quiet = match source {
            SourceStage::Board(decode) => {
                decode.finish();
                EventFlow { shared, decode, record, readout, viewers }.flush()?;
                decode.quiet_until(shared.receiver.silent_until())
            }
            SourceStage::Frames(_) => Some(QuietUntil::Ended),
        };
        self.record.previews(self.source.count(), self.source.held(), true)?;
        self.viewers.retain_mut(|queue| queue.tick(self.source.held()));
        self.readout.close(&self.shared, quiet.filter(|_| self.readout.is_on()));
        self.answer()
    }

    /// Handles the requests since the last batch.
    fn answer(&mut self) -> Result<()> {
        let requests = std::mem::take(&mut *lock(&self.shared.requests));
        requests.into_iter().try_for_each(|request| request(self))
    }
}

impl Decoding for Stages {
    fn note_registers(&mut self, registers: &Registers) -> Result<()> {
        if let SourceStage::Board(decode) = &mut self.source {
            decode.set_frame_us(registers.frame_us());
        }
        self.expect_version(registers.wire_version)?;
        self.record.with(|recording| recording.registers(now_ns(), registers))
    }

    fn add_viewer(&mut self) -> ViewerEvents {
        let counters = &self.shared.published().counters;
        let (latest, events) = (counters.board.board_us, counters.decoding.events);
        let (queue, events) = viewer_queue(&self.shared.options.array, self.source.held(), latest, events);
        self.viewers.push(queue);
        events
    }

    fn switch_recording(&mut self, next: Option<RunningRecording>) -> Result<EndedRecording> {
        self.record.previews(self.source.count(), self.source.held(), true)?;
        if next.is_some() {
            self.move_to_threads()?;
        }
        let begins = next.is_some();
        let ended = self.record.switch(next, self.source.held())?;
        if let (true, SourceStage::Board(decode)) = (begins, &mut self.source) {
            decode.begin_recording();
        }
        Ok(ended)
    }

    fn expect_version(&mut self, version: u8) -> Result<()> {
        if let SourceStage::Board(decode) = &mut self.source
            && decode.expect(version)
        {
            let (change, t_us) = (BoardChangeKind::Wire { version, asked: true }, decode.latest());
            self.record.with(|recording| recording.board_change(&BoardChange { at_ns: now_ns(), t_us, change }))?;
        }
        Ok(())
    }

    fn zero(&mut self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let array = &self.shared.options.array;
        let published = self.shared.published();
        if published.counters.readout.taring {
            return Err(problem!("a tare is being measured: zero taxels after it").into());
        }
        let now = published.counters.board.offset.map(|offset| offset.board_us(now_ns()));
        let Some(t) = published.counters.board.board_us.max(self.readout.announced_until()).max(now) else {
            return Err(problem!("nothing has arrived yet, so no taxel can be zeroed").into());
        };
        let mut zeroings = vec![];
        for &(x, y) in taxels {
            let mut zeroing = Zeroing { t, x, y, rest: 0.0, before: None };
            zeroing.check(array)?;
            let taxel = array.index(x, y);
            let Some(rest) = self.source.rest_now(taxel) else {
                return Err(problem!(
                    "taxel at row {y}, column {x}: its value is unknown, because it has sent no event so far"
                )
                .into());
            };
            zeroing.rest = rest;
            let tared = published.rest.get(taxel).copied().flatten();
            zeroing.before = published.zeroed.get(&taxel).map(|earlier| earlier.rest).or(tared);
            zeroings.push(zeroing);
        }
        drop(published);
        // Recorded first, so that every zeroing is in the recording.
        self.record.zeroings(&zeroings)?;
        let mut published = self.shared.published();
        published.zeroed.extend(zeroings.iter().map(|zeroing| (array.index(zeroing.x, zeroing.y), *zeroing)));
        published.zeroings += 1;
        drop(published);
        self.readout.zero(&self.shared, &zeroings);
        Ok(zeroings)
    }
}

/// The decoded events of a board, on their way to the other stages.
struct EventFlow<'a> {
    shared: &'a PipelineShared,
    decode: &'a mut DecodeStage,
    record: &'a mut RecordStage,
    readout: &'a mut ReadoutStage,
    viewers: &'a mut Vec<ViewerQueue>,
}

impl EventFlow<'_> {
    fn decode(mut self, batch: &Batch) -> Result<()> {
        for (datagram, bytes) in batch.iter() {
            let mut decoded = self.decode.push(datagram, bytes);
            if decoded.info.reset {
                let later = self.decode.split_at_reset(&mut decoded);
                self.flush()?;
                self.decode.reset(&later);
                self.viewers.iter_mut().for_each(|queue| queue.reset(self.decode.held()));
                if decoded.info.version == 2 {
                    self.readout.reset();
                }
            }
            let now = now_ns();
            self.decode.note(&decoded, self.readout.announced_until());
            self.record.record_board_change(&decoded.info, decoded.arrived_ns)?;
            if self.record.awaits_origin()
                && let Some(origin_us) = self.decode.origin(&decoded)
            {
                self.record.set_origin(origin_us)?;
            }
            self.shared.published().decode_latency.note(now - decoded.arrived_ns);
            if self.decode.events().len() >= FLUSH_AFTER {
                // A batch has this many events only if reading out is slower than they arrive.
                self.readout.move_to_thread();
                self.flush()?;
            }
        }
        self.flush()
    }

    /// Passes the decoded events to the other stages.
    fn flush(&mut self) -> Result<()> {
        self.decode.update_held();
        self.viewers.iter_mut().for_each(|queue| queue.push(self.decode.events(), self.decode.held()));
        self.record.markers(&self.decode.events().markers)?;
        {
            let mut published = self.shared.published();
            published.markers.extend_from_slice(&self.decode.events().markers);
            self.decode.publish(&mut published.counters);
        }
        let promised = self.decode.take_promise();
        self.readout.push(self.shared, self.decode.events_mut(), promised);
        self.decode.clear();
        Ok(())
    }
}

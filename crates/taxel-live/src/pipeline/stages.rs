//! Runs the stages in sequence, in the thread that owns them: receive, decode, record, read out.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use taxel_core::detect::Detection;
use taxel_core::encode::Zeroing;
use taxel_core::wire::Registers;

use super::decode_stage::DecodeStage;
use super::flows::{EventFlow, FrameFlow};
use super::frame_stage::FrameStage;
use super::readout_queue::QuietUntil;
use super::readout_stage::ReadoutStage;
use super::record_stage::RecordStage;
use super::running_readout::RunningReadout;
use super::running_recording::{EndedRecording, RunningRecording};
use super::shared::{Decoding, PipelineShared};
use super::source_stage::SourceStage;
use super::viewer_queue::{ViewerEvents, ViewerQueue, viewer_queue};
use crate::Result;
use crate::capture::Batch;
use crate::locked::lock;
use crate::recording::{BoardChange, BoardChangeKind, LOW_RATE_EVERY, now_ns};

/// Longest wait for datagrams.
const IDLE: Duration = Duration::from_millis(20);

/// Time for which datagrams are gathered during a recording without a readout: this costs half the CPU.
const GATHER: Duration = Duration::from_millis(1);

/// Why [`Stages::run`] returned.
pub(super) enum StagesOutcome {
    /// Detections wait for output ([`Stages::pending_detections`]).
    Output,
    /// The readout must move to its own thread.
    MoveReadout(Box<RunningReadout>),
    /// No more data will arrive.
    Finished,
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
            if let Some(readout) = self.readout.separated.take() {
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
        self.shared.receiver.receive_in_thread(if self.readout.is_on { Duration::ZERO } else { GATHER })?;
        self.readout.move_to_thread();
        Ok(())
    }

    fn step(&mut self) -> Result<()> {
        let tick = if self.readout.is_on { self.source.tick() } else { None };
        let mut batch = std::mem::take(&mut self.batch);
        if self.shared.receiver.receive(&mut batch, tick.map_or(IDLE, |tick| tick.min(IDLE)))? {
            self.process(&batch)?;
            self.record.with(|recording| recording.batch(&batch))?;
        } else {
            let until = self.shared.receiver.silent_until();
            if let (true, Some(quiet)) = (self.readout.is_on, self.source.quiet_until(until)) {
                self.readout.input.quiet = Some(quiet);
                self.readout.pass_on(&self.shared);
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
            frames.last.clone_into(&mut published.values);
        }
    }

    fn process(&mut self, batch: &Batch) -> Result<()> {
        let Self { shared, source, record, readout, viewers, .. } = self;
        match source {
            SourceStage::Board(decode) => EventFlow { shared, decode, record, readout, viewers }.decode(batch),
            SourceStage::Frames(stage) => {
                FrameFlow { shared, stage, readout, viewers }.read(batch);
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
        self.readout.close(&self.shared, quiet.filter(|_| self.readout.is_on));
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
            decode.frame_us = registers.frame_us();
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
            decode.decoder.begin_recording();
        }
        Ok(ended)
    }

    fn expect_version(&mut self, version: u8) -> Result<()> {
        if let SourceStage::Board(decode) = &mut self.source
            && decode.expect(version)
        {
            let (change, t_us) = (BoardChangeKind::Wire { version, asked: true }, decode.latest);
            self.record.with(|recording| recording.board_change(&BoardChange { at_ns: now_ns(), t_us, change }))?;
        }
        Ok(())
    }

    fn zero(&mut self, taxels: &[(u16, u16)]) -> Result<Vec<Zeroing>> {
        let (announced, rest_now) = (self.readout.announced, |taxel| self.source.rest_now(taxel));
        let zeroings = self.shared.published().zeroings_of(&self.shared.options.array, taxels, announced, rest_now)?;
        // Recorded first, so that every zeroing is in the recording.
        self.record.zeroings(&zeroings)?;
        self.shared.published().add_zeroings(&self.shared.options.array, &zeroings);
        self.readout.input.zeroings.extend_from_slice(&zeroings);
        self.readout.pass_on(&self.shared);
        Ok(zeroings)
    }
}

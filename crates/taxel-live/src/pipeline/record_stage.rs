//! The third stage: writes datagrams as they arrived, changes of the board, markers, previews and counts to the running
//! recording, if there is one.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use taxel_core::encode::Zeroing;
use taxel_core::held::Held;
use taxel_core::wire::{DatagramInfo, Registers, SenderDecoder};
use taxel_core::{Events, Marker};

use super::counters::Counters;
use super::decode_stage::fresh_decoder;
use super::preview_buffer::PreviewBuffer;
use super::running_recording::RunningRecording;
use super::shared::{EndedRecording, PipelineShared};
use crate::Result;
use crate::capture::Batch;
use crate::locked::lock;
use crate::recording::{BoardChange, BoardChangeKind, now_ns};

/// Interval at which the counts are written to an unfinished recording.
pub(super) const COUNTS_EVERY: Duration = Duration::from_secs(1);

pub(super) struct RecordStage {
    shared: Arc<PipelineShared>,
    /// Decodes from a recording's first datagram on, as a reader of the file will, until the offset between the
    /// recording's clock and the pipeline's is known.
    origin: Option<Box<SenderDecoder>>,
    preview_buffer: PreviewBuffer,
    /// Number of decoded datagrams when the last preview was considered.
    considered: u64,
    /// Whether the recording has the fresh tare.
    tared: bool,
    /// When the counts were last written.
    counted: Instant,
}

impl RecordStage {
    pub(super) fn new(shared: Arc<PipelineShared>) -> Self {
        Self {
            shared,
            origin: None,
            preview_buffer: PreviewBuffer::new(),
            considered: 0,
            tared: false,
            counted: Instant::now(),
        }
    }

    pub(super) fn runs(&self) -> bool {
        lock(&self.shared.recording.running).is_some()
    }

    /// Calls `work` with the running recording. An error ends the pipeline if the recording was requested at its start,
    /// and only the recording if it began later.
    fn with(&self, work: impl FnOnce(&mut RunningRecording) -> Result<()>) -> Result<()> {
        let mut slot = lock(&self.shared.recording.running);
        let Some(recording) = &mut *slot else { return Ok(()) };
        match work(recording) {
            Err(error) if recording.since().is_some() => {
                *slot = None;
                lock(&self.shared.recording.broken).get_or_insert(error);
                self.shared.recording.runs.store(false, Ordering::Release);
                Ok(())
            }
            outcome => outcome,
        }
    }

    pub(super) fn datagrams(&self, batch: &Batch) -> Result<()> {
        self.with(|recording| recording.datagrams(batch))
    }

    /// Records a change of the board that a datagram showed: a reset, or another version of the wire.
    pub(super) fn record_board_change(&self, info: &DatagramInfo, at_ns: i64) -> Result<()> {
        if info.version == 1 && !info.changed {
            return Ok(());
        }
        let wire = info.changed.then_some(BoardChangeKind::Wire { version: info.version, asked: false });
        self.with(|recording| {
            recording.check_version(info.version)?;
            for change in wire.into_iter().chain(info.reset.then_some(BoardChangeKind::Reset)) {
                recording.board_change(&BoardChange { at_ns, t_us: info.now, change })?;
            }
            Ok(())
        })
    }

    /// Records that the board was set to another version of the wire; `t_us` is its latest time.
    pub(super) fn asked_for_version(&self, version: u8, t_us: Option<i64>) -> Result<()> {
        let change = BoardChangeKind::Wire { version, asked: true };
        self.with(|recording| recording.board_change(&BoardChange { at_ns: now_ns(), t_us, change }))
    }

    pub(super) fn registers(&self, registers: &Registers) -> Result<()> {
        self.with(|recording| recording.registers(registers))
    }

    pub(super) fn markers(&self, markers: &[Marker]) -> Result<()> {
        if markers.is_empty() {
            return Ok(());
        }
        self.with(|recording| markers.iter().try_for_each(|marker| recording.marker(*marker)))?;
        self.shared.preview_around(markers.iter().map(|marker| marker.t));
        Ok(())
    }

    /// Decodes a datagram by the recording's own clock, which begins with its first stamp. Once an event or a marker
    /// has arrived, the offset to the pipeline's clock is known. `stamps` are the first of each as the pipeline decoded
    /// them.
    pub(super) fn find_origin(&mut self, bytes: &[u8], at_ns: i64, stamps: (Option<i64>, Option<i64>)) -> Result<()> {
        let Some(origin) = &mut self.origin else { return Ok(()) };
        let mut events = Events::empty(self.shared.options.array.clone());
        origin.push(bytes, Some(at_ns / 1000), &mut events);
        let by_event = stamps.0.zip(events.t.first()).map(|(stamp, decoded)| stamp - decoded);
        let by_marker = stamps.1.zip(events.markers.first()).map(|(stamp, marker)| stamp - marker.t);
        let Some(origin_us) = by_event.or(by_marker) else { return Ok(()) };
        self.origin = None;
        let mut timed = true;
        self.with(|recording| {
            timed = recording.is_timed();
            recording.set_origin(origin_us)
        })?;
        if timed { Ok(()) } else { self.earlier_zeroings() }
    }

    /// Ends the running recording, and starts the next one, if there is one, with the taxels' values. What was decoded
    /// so far belongs to the former, what arrives from now on to the latter.
    pub(super) fn switch(&mut self, next: Option<Box<RunningRecording>>, held: &Held) -> Result<EndedRecording> {
        let now = self.shared.counters();
        let ended = lock(&self.shared.recording.running).take();
        self.origin = None;
        let begins = next.is_some();
        if let Some(mut next) = next {
            if let Err(error) = next.begin(&now, held.values()) {
                *lock(&self.shared.recording.running) = ended;
                return Err(error);
            }
            let is_board = self.shared.frames.is_none();
            self.origin = is_board.then(|| Box::new(fresh_decoder(&self.shared.options)));
            self.tared = false;
            let timed = next.is_timed();
            *lock(&self.shared.recording.running) = Some(*next);
            if timed {
                self.earlier_zeroings()?;
            }
        }
        self.shared.recording.runs.store(begins, Ordering::Release);
        Ok((ended, now))
    }

    /// Records earlier zeroings, which remain valid in a new recording.
    fn earlier_zeroings(&self) -> Result<()> {
        let zeroed: Vec<Zeroing> = self.shared.published().zeroed.values().copied().collect();
        self.with(|recording| zeroed.iter().try_for_each(|zeroing| recording.zeroing(zeroing)))
    }

    /// Records zeroings; on an error the caller zeroes nothing.
    pub(super) fn zeroings(&self, zeroings: &[Zeroing]) -> Result<()> {
        match &*lock(&self.shared.recording.running) {
            Some(recording) => zeroings.iter().try_for_each(|zeroing| recording.zeroing(zeroing)),
            None => Ok(()),
        }
    }

    /// Buffers a preview if one is due, and records the selected ones; with `last` also the final one.
    pub(super) fn previews(&mut self, decoded: u64, held: &Held, last: bool) -> Result<()> {
        let now = Instant::now();
        // Frames are shown by any viewer.
        if self.shared.frames.is_some() || !(last || self.preview_buffer.is_due(now)) {
            return Ok(());
        }
        let times = std::mem::take(&mut *lock(&self.shared.recording.preview_times));
        if !self.runs() {
            self.preview_buffer.clear();
            return Ok(());
        }
        let new = decoded != self.considered;
        self.considered = decoded;
        if let (true, Some(t_us)) = (new, self.shared.published().counters.board.board_us) {
            self.preview_buffer.push(now, now_ns(), t_us, held.frame());
        }
        times.into_iter().for_each(|t| self.preview_buffer.around(t));
        let columns = self.shared.options.array.columns;
        let mut preview_buffer = std::mem::replace(&mut self.preview_buffer, PreviewBuffer::new());
        let outcome = self.with(|recording| {
            preview_buffer
                .take_wanted()
                .try_for_each(|preview| recording.preview(preview.at_ns, preview.t_us, columns, &preview.held))
        });
        self.preview_buffer = preview_buffer;
        outcome
    }

    /// Runs ten times a second: writes the tare once it is complete and, once a second, the counts.
    pub(super) fn progress(&mut self) -> Result<()> {
        if !self.runs() {
            return Ok(());
        }
        let (counters, tare) = {
            let published = self.shared.published();
            let tare = if self.tared { None } else { published.tare.clone() };
            (published.counters.clone(), tare)
        };
        self.tared |= tare.is_some();
        let due = self.counted.elapsed() >= COUNTS_EVERY;
        if due {
            self.counted = Instant::now();
        }
        let capture = self.shared.receiver.counts();
        let lines = self.shared.frames.as_ref().map(|frames| frames.counts());
        self.with(|recording| {
            if let Some(tare) = tare {
                recording.tare(&tare)?;
            }
            recording.flush()?;
            if due { recording.counts(&Counters { capture, lines, ..counters }) } else { Ok(()) }
        })
    }
}

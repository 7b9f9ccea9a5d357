//! The third stage: writes datagrams as they arrived, changes of the board, markers, previews and counts to the running
//! recording, if there is one.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use taxel_core::Marker;
use taxel_core::encode::Zeroing;
use taxel_core::held::Held;
use taxel_core::wire::DatagramInfo;

use super::counters::Counters;
use super::running_recording::{EndedRecording, RunningRecording};
use super::shared::PipelineShared;
use crate::Result;
use crate::locked::lock;
use crate::recording::{BoardChange, BoardChangeKind, LOW_RATE_EVERY, now_ns};

/// Interval at which the counts are written to an unfinished recording.
pub(super) const COUNTS_EVERY: Duration = Duration::from_secs(1);

pub(super) struct RecordStage {
    shared: Arc<PipelineShared>,
    /// Whether it is not known yet where the recording begins on the board's clock.
    pub(super) awaits_origin: bool,
    /// When the last preview was recorded, and the number of decoded datagrams then.
    previewed: Instant,
    considered: u64,
    /// When the counts were last written.
    counted: Instant,
}

impl RecordStage {
    pub(super) fn new(shared: Arc<PipelineShared>) -> Self {
        Self { shared, awaits_origin: false, previewed: Instant::now(), considered: 0, counted: Instant::now() }
    }

    pub(super) fn runs(&self) -> bool {
        lock(&self.shared.recording.running).is_some()
    }

    /// Calls `work` with the running recording. An error ends the pipeline if the recording was requested at its start,
    /// and only the recording if it began later.
    pub(super) fn with(&self, work: impl FnOnce(&mut RunningRecording) -> Result<()>) -> Result<()> {
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

    /// Records a change of the board that a datagram showed: a reset, or another version of the wire.
    pub(super) fn record_board_change(&self, info: &DatagramInfo, at_ns: i64) -> Result<()> {
        if info.version == 1 && !info.changed {
            return Ok(());
        }
        let wire = info.changed.then_some(BoardChangeKind::Wire { version: info.version, asked: false });
        self.with(|recording| {
            for change in wire.into_iter().chain(info.reset.then_some(BoardChangeKind::Reset)) {
                recording.board_change(&BoardChange { at_ns, t_us: info.now, change })?;
            }
            Ok(())
        })
    }

    pub(super) fn markers(&self, markers: &[Marker]) -> Result<()> {
        if markers.is_empty() {
            return Ok(());
        }
        self.with(|recording| markers.iter().try_for_each(|marker| recording.marker(now_ns(), *marker)))
    }

    /// Records where the recording begins on the board's clock, us.
    pub(super) fn set_origin(&mut self, origin_us: i64) -> Result<()> {
        self.awaits_origin = false;
        self.with(|recording| recording.set_origin(origin_us))
    }

    /// Ends the running recording, and starts the next one, if there is one, with the taxels' values. What was decoded
    /// so far belongs to the former, what arrives from now on to the latter.
    pub(super) fn switch(&mut self, next: Option<RunningRecording>, held: &Held) -> Result<EndedRecording> {
        let now = self.shared.counters();
        let ended = lock(&self.shared.recording.running).take();
        let begins = next.is_some();
        if let Some(mut next) = next {
            if let Err(error) = next.begin(&now, held.values()) {
                *lock(&self.shared.recording.running) = ended;
                return Err(error);
            }
            *lock(&self.shared.recording.running) = Some(next);
            // Earlier zeroings remain valid.
            let zeroed: Vec<Zeroing> = self.shared.published().zeroed.values().copied().collect();
            self.with(|recording| zeroed.iter().try_for_each(|zeroing| recording.zeroing(now_ns(), zeroing)))?;
        }
        self.awaits_origin = begins && self.shared.frames.is_none();
        self.shared.recording.runs.store(begins, Ordering::Release);
        Ok((ended, now))
    }

    /// Records zeroings; on an error the caller zeroes nothing.
    pub(super) fn zeroings(&self, zeroings: &[Zeroing]) -> Result<()> {
        match &*lock(&self.shared.recording.running) {
            Some(recording) => zeroings.iter().try_for_each(|zeroing| recording.zeroing(now_ns(), zeroing)),
            None => Ok(()),
        }
    }

    /// Records a preview if one is due; with `last` also the final one. Frames are shown by any viewer.
    pub(super) fn previews(&mut self, decoded: u64, held: &Held, last: bool) -> Result<()> {
        let is_due = last || self.previewed.elapsed() >= LOW_RATE_EVERY;
        if self.shared.frames.is_some() || !is_due || decoded == self.considered || !self.runs() {
            return Ok(());
        }
        (self.previewed, self.considered) = (Instant::now(), decoded);
        let Some(t_us) = self.shared.published().counters.board.board_us else { return Ok(()) };
        let values: Vec<u16> = held.frame().collect();
        self.with(|recording| recording.preview(now_ns(), t_us, &values))
    }

    /// Writes the counts if they are due, and notices within a second that the file can no longer be written.
    pub(super) fn progress(&mut self) -> Result<()> {
        self.with(|recording| recording.check())?;
        if self.counted.elapsed() < COUNTS_EVERY || !self.runs() {
            return Ok(());
        }
        self.counted = Instant::now();
        let counters = self.shared.published().counters.clone();
        let capture = self.shared.receiver.counts();
        let lines = self.shared.frames.as_ref().map(|frames| frames.counts());
        self.with(|recording| recording.write_losses(&Counters { capture, lines, ..counters }))
    }
}

//! What the second stage gives, on its way to the recording, the readout and the viewers.

use super::decode_stage::DecodeStage;
use super::frame_stage::FrameStage;
use super::readout_stage::ReadoutStage;
use super::record_stage::RecordStage;
use super::shared::PipelineShared;
use super::viewer_queue::ViewerQueue;
use crate::Result;
use crate::capture::Batch;
use crate::recording::now_ns;

/// Number of events after which they are passed on, even in the middle of a large batch.
const FLUSH_AFTER: usize = 1 << 14;

/// The decoded events of a board, on their way to the other stages.
pub(super) struct EventFlow<'a> {
    pub(super) shared: &'a PipelineShared,
    pub(super) decode: &'a mut DecodeStage,
    pub(super) record: &'a mut RecordStage,
    pub(super) readout: &'a mut ReadoutStage,
    pub(super) viewers: &'a mut Vec<ViewerQueue>,
}

impl EventFlow<'_> {
    pub(super) fn decode(mut self, batch: &Batch) -> Result<()> {
        for (datagram, bytes) in batch.iter() {
            let mut decoded = self.decode.push(datagram, bytes);
            if decoded.info.reset {
                let later = self.decode.split_at_reset(&mut decoded);
                self.flush()?;
                self.decode.reset(&later);
                self.viewers.iter_mut().for_each(|queue| queue.reset(&self.decode.held));
                if decoded.info.version == 2 {
                    self.readout.announced = None;
                }
            }
            let now = now_ns();
            self.decode.note(&decoded, self.readout.announced);
            self.record.record_board_change(&decoded.info, decoded.arrived_ns)?;
            if self.record.awaits_origin
                && let Some(origin_us) = self.decode.origin(&decoded)
            {
                self.record.set_origin(origin_us)?;
            }
            self.shared.published().decode_latency.note(now - decoded.arrived_ns);
            if self.decode.events.len() >= FLUSH_AFTER {
                // A batch has this many events only if reading out is slower than they arrive.
                self.readout.move_to_thread();
                self.flush()?;
            }
        }
        self.flush()
    }

    /// Passes the decoded events to the other stages.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.decode.update_held();
        self.viewers.iter_mut().for_each(|queue| queue.push(&self.decode.events, &self.decode.held));
        self.record.markers(&self.decode.events.markers)?;
        {
            let mut published = self.shared.published();
            published.markers.extend_from_slice(&self.decode.events.markers);
            self.decode.publish(&mut published.counters);
        }
        let promised = self.decode.take_promise();
        self.readout.push(self.shared, &mut self.decode.events, promised);
        self.decode.clear();
        Ok(())
    }
}

/// The frames of a source, on their way to the other stages; a recording takes them as they arrived.
pub(super) struct FrameFlow<'a> {
    pub(super) shared: &'a PipelineShared,
    pub(super) stage: &'a mut FrameStage,
    pub(super) readout: &'a mut ReadoutStage,
    pub(super) viewers: &'a mut Vec<ViewerQueue>,
}

impl FrameFlow<'_> {
    pub(super) fn read(self, batch: &Batch) {
        if self.stage.push(batch) {
            self.viewers.iter_mut().for_each(|queue| queue.reset(&self.stage.held));
        }
        {
            let (now, mut published) = (now_ns(), self.shared.published());
            batch.iter().for_each(|(message, _)| published.decode_latency.note(now - message.arrived_ns));
            self.stage.publish(&mut published.counters);
            published.steps = self.stage.steps();
        }
        let (frames, changes, held) = self.stage.parts();
        self.viewers.iter_mut().for_each(|queue| queue.push(changes, held));
        self.readout.push_frames(self.shared, frames);
        self.stage.clear();
    }
}

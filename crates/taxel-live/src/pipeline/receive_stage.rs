//! The first stage: receives datagrams in batches, from the socket directly or from a thread that reads the socket.

use std::sync::Arc;
use std::time::Duration;

use super::shared::PipelineShared;
use crate::Result;
use crate::capture::Batch;

/// Time for which datagrams are gathered during a recording without a readout: this costs half the CPU.
const GATHER: Duration = Duration::from_millis(1);

pub(super) struct ReceiveStage {
    shared: Arc<PipelineShared>,
    /// The buffer of the last batch.
    batch: Batch,
}

impl ReceiveStage {
    pub(super) fn new(shared: Arc<PipelineShared>) -> Self {
        Self { shared, batch: Batch::new() }
    }

    /// Moves receiving to a separate thread; without a readout it may gather datagrams.
    pub(super) fn move_to_thread(&self, reads_out: bool) -> Result<()> {
        self.shared.receiver.receive_in_thread(if reads_out { Duration::ZERO } else { GATHER })
    }

    /// Waits for datagrams at most `wait`; returns false and an empty batch if none arrived.
    pub(super) fn next(&mut self, wait: Duration) -> Result<(Batch, bool)> {
        let mut batch = std::mem::take(&mut self.batch);
        let came = self.shared.receiver.receive(&mut batch, wait)?;
        Ok((batch, came))
    }

    /// Returns a batch that was processed, for its memory.
    pub(super) fn reuse(&mut self, batch: Batch) {
        self.batch = batch;
    }

    /// If no datagram waits: the time before which everything that arrived was received, ns since 1970.
    pub(super) fn silent_until(&self) -> Option<i64> {
        self.shared.receiver.silent_until()
    }

    /// Whether no more data will arrive.
    pub(super) fn is_done(&self) -> bool {
        self.shared.receiver.is_done()
    }
}

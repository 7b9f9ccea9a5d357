//! The first stage: datagrams in batches, from the socket itself or from a thread that reads the socket.

use std::sync::Arc;
use std::time::Duration;

use super::shared::Shared;
use crate::Result;
use crate::capture::Batch;

/// While it records and nothing is read out, what arrives within so long is received together: it costs half the CPU.
const TOGETHER: Duration = Duration::from_millis(1);

pub(super) struct ReceiveStage {
    shared: Arc<Shared>,
    /// The memory of the last batch.
    batch: Batch,
}

impl ReceiveStage {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        Self { shared, batch: Batch::new() }
    }

    /// From now on a thread of its own receives; without a readout it may gather what arrives.
    pub(super) fn separate(&self, reads_out: bool) -> Result<()> {
        self.shared.receiver.apart(if reads_out { Duration::ZERO } else { TOGETHER })
    }

    /// Waits for datagrams no longer than `wait`; false, and an empty batch, where none came.
    pub(super) fn next(&mut self, wait: Duration) -> Result<(Batch, bool)> {
        let mut batch = std::mem::take(&mut self.batch);
        let came = self.shared.receiver.receive(&mut batch, wait)?;
        Ok((batch, came))
    }

    /// Returns a batch that was processed, for its memory.
    pub(super) fn reuse(&mut self, batch: Batch) {
        self.batch = batch;
    }

    /// While nothing waits: all that arrived before this time was received, ns since 1970.
    pub(super) fn silent_until(&self) -> Option<i64> {
        self.shared.receiver.silent_until()
    }

    /// Whether no more data will arrive.
    pub(super) fn is_done(&self) -> bool {
        self.shared.receiver.is_done()
    }
}

//! Number of events over time.

use taxel_live::pipeline::TaxelChange;

use crate::columns::COLUMN_US;

/// Maximum number of bins; beyond it pairs of bins are merged.
const BINS: usize = 1000;

/// Number of events in bins whose width doubles as time goes on.
#[derive(Debug, Default)]
pub(super) struct EventRate {
    first: Option<i64>,
    step: i64,
    bins: Vec<u64>,
}

impl EventRate {
    /// Adds events.
    pub(super) fn add(&mut self, changes: &[TaxelChange]) {
        let together = changes.chunk_by(|change, next| change.t == next.t);
        together.for_each(|together| self.add_at(together[0].t, together.len() as u64));
    }

    fn add_at(&mut self, t: i64, count: u64) {
        let first = *self.first.get_or_insert(t);
        self.step = self.step.max(COLUMN_US);
        loop {
            let bin = (t.saturating_sub(first).max(0) / self.step).unsigned_abs() as usize;
            if bin < BINS {
                if bin >= self.bins.len() {
                    self.bins.resize(bin + 1, 0);
                }
                self.bins[bin] += count;
                return;
            }
            self.bins = self.bins.chunks(2).map(|two| two.iter().sum()).collect();
            self.step = self.step.saturating_mul(2);
        }
    }

    /// Start of the first bin and width of a bin, both us, and the counts.
    pub(super) fn bins(&self) -> (i64, i64, Vec<u64>) {
        (self.first.unwrap_or(0), self.step.max(COLUMN_US), self.bins.clone())
    }
}

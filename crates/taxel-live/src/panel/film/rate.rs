//! Events over time.

use crate::panel::lens::COLUMN_US;

/// Bins at most, before two become one.
const BINS: usize = 1000;

/// Events over time in bins that grow with it.
#[derive(Debug, Default)]
pub(super) struct Rate {
    first: Option<i64>,
    step: i64,
    bins: Vec<u64>,
}

impl Rate {
    /// So many more at a time.
    pub(super) fn take(&mut self, t: i64, count: u64) {
        let first = *self.first.get_or_insert(t);
        self.step = self.step.max(COLUMN_US);
        loop {
            #[allow(clippy::cast_possible_truncation)]
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

    /// First time, step, both us, and counts.
    pub(super) fn said(self) -> (i64, i64, Vec<u64>) {
        (self.first.unwrap_or(0), self.step.max(COLUMN_US), self.bins)
    }
}

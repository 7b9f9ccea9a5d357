//! Means of quantities over windows of the recent past.
//!
//! Reading: a mean is that of the samples in the window, each with equal weight. Where none is in the window, it is the
//! latest sample before it, and at the beginning the first sample, as if that had held before.

/// Number of quantities that are added at once.
const LANES: usize = 4;

/// A window of the past: its ages from (included) and to (excluded), us, and the number of the first quantities whose
/// means are wanted.
#[derive(Debug, Clone, Copy)]
pub(super) struct PastWindow {
    pub(super) from: i64,
    pub(super) to: i64,
    pub(super) quantities: usize,
}

/// The samples that windows of the past need.
#[derive(Clone)]
pub(super) struct RecentSamples {
    windows: Vec<PastWindow>,
    /// Groups of quantities in a sample.
    groups: usize,
    /// Times of the samples, us; those before index `first` are no longer needed.
    times: Vec<i64>,
    samples: Vec<[f64; LANES]>,
    first: usize,
}

impl RecentSamples {
    pub(super) fn new(quantities: usize, windows: &[PastWindow]) -> Self {
        let groups = quantities.div_ceil(LANES);
        Self { windows: windows.to_vec(), groups, times: vec![], samples: vec![], first: 0 }
    }

    /// Adds a sample at `t` us; then appends the means of each window to the quantities.
    pub(super) fn take(&mut self, t: i64, quantities: &mut Vec<f64>) {
        self.times.push(t);
        for group in quantities.chunks(LANES) {
            self.samples.push(std::array::from_fn(|lane| group.get(lane).copied().unwrap_or(0.0)));
        }
        for k in 0..self.windows.len() {
            let PastWindow { from, to, quantities: count } = self.windows[k];
            let (begin, end) = self.within(t, from, to);
            let rows = &self.samples[begin * self.groups..end * self.groups];
            let per = ((end - begin) as f64).recip();
            for group in 0..count.div_ceil(LANES) {
                let mut sums = [0.0; LANES];
                for row in rows.iter().skip(group).step_by(self.groups) {
                    for (sum, value) in sums.iter_mut().zip(row) {
                        *sum += value;
                    }
                }
                quantities.extend(sums.iter().take(count - group * LANES).map(|sum| sum * per));
            }
        }
        self.forget(t);
    }

    /// The samples of ages from `from` to `to` at `t`, or the one that stands for them; first and past the last.
    fn within(&self, t: i64, from: i64, to: i64) -> (usize, usize) {
        let age = |&time: &i64| t.saturating_sub(time);
        let live = &self.times[self.first..];
        let end = self.first + live.partition_point(|time| age(time) >= from);
        let begin = self.first + live.partition_point(|time| age(time) >= to);
        match end {
            _ if begin < end => (begin, end),
            _ if end > self.first => (end - 1, end),
            _ => (self.first, self.first + 1),
        }
    }

    /// Drops samples that no window needs, but for the latest of them.
    fn forget(&mut self, t: i64) {
        let oldest = self.windows.iter().map(|window| window.to).max().unwrap_or(0);
        let old = self.times[self.first..].partition_point(|&time| t.saturating_sub(time) >= oldest);
        self.first += old.saturating_sub(1);
        if self.first > self.times.len() / 2 {
            self.times.drain(..self.first);
            self.samples.drain(..self.first * self.groups);
            self.first = 0;
        }
    }
}

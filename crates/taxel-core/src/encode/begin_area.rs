//! The taxels by which a touch began, as long as they stay loaded.

use super::driver::Sample;
use super::loaded::Loaded;
use crate::spikes::us;

/// How many of the loaded taxels have been so since a touch began, or since less than a level after it, added up over
/// several levels.
#[derive(Clone)]
pub(super) struct BeginArea {
    loaded: Loaded,
    /// The levels, us.
    levels: Vec<f64>,
    /// When the touch began, us, while there is one.
    began: Option<i64>,
    /// Of each taxel how many levels it counts for.
    counts: Vec<usize>,
}

impl BeginArea {
    /// Starts with no taxel loaded, and with levels in ms.
    pub(super) fn new(levels: &[f64], loaded: Loaded, taxels: usize) -> Self {
        Self { loaded, levels: levels.iter().copied().map(us).collect(), began: None, counts: vec![0; taxels] }
    }

    /// The loaded taxels, which receive values and rests.
    pub(super) fn loaded(&mut self) -> &mut Loaded {
        &mut self.loaded
    }

    /// Reads the values of all taxels.
    pub(super) fn take(&mut self, now: Sample<'_>) -> usize {
        self.loaded.take_frame(now);
        if self.loaded.area() == 0 {
            self.began = None;
            self.counts.fill(0);
            return 0;
        }
        let age = (now.t - *self.began.get_or_insert(now.t)) as f64;
        let begun_now = self.levels.iter().filter(|&&level| age < level).count();
        for (taxel, count) in self.counts.iter_mut().enumerate() {
            *count = if self.loaded.counts(taxel) { begun_now.max(*count) } else { 0 };
        }
        self.counts.iter().sum()
    }
}

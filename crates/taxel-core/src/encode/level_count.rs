//! How many levels the taxels of a sensor are above: a count with memory.

use super::driver::{Rule, Sample};
use super::level_crossing::{LevelCrossing, LevelCrossings};
use crate::Result;
use crate::rest::Rest;

/// A taxel is above a level until it is below this part of it.
const RELEASE: f64 = 0.7;

/// The taxels of an array at the levels of a count.
#[derive(Clone)]
pub(super) struct LevelCount {
    crossings: LevelCrossings,
    begun: bool,
}

impl LevelCount {
    /// Starts with levels above the rest of each taxel, in the sensor's unit; one without a rest is above none.
    pub(super) fn above_rest(levels: &[f64], rest: &Rest<f64>) -> Result<Self> {
        let levels = LevelCrossing { release_share: Some(RELEASE), ..LevelCrossing::at(levels.to_vec()) };
        let mut count = Self { crossings: LevelCrossings::new(&levels, rest.values().len())?, begun: false };
        for (taxel, &rest) in rest.values().iter().enumerate() {
            count.set_rest(taxel, rest);
        }
        Ok(count)
    }

    /// Reads the values of all taxels; returns how many levels they are above.
    pub(super) fn take(&mut self, now: Sample<'_>) -> usize {
        let mut crossed = vec![];
        if std::mem::replace(&mut self.begun, true) {
            self.crossings.sample(now, &mut crossed);
        } else {
            self.crossings.begin(now, &mut crossed);
        }
        self.crossings.above()
    }

    /// Sets the rest of a taxel from now on.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.crossings.place(taxel, rest, 1.0);
    }
}

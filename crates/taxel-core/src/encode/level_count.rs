//! How many levels the taxels of a sensor are above: a count with memory.

use super::driver::{Rule, Sample};
use super::level_crossing::{LevelCrossing, LevelCrossings};
use super::running_range::RunningRange;
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
        let mut count = Self::new(levels, None, rest.values().len())?;
        for (taxel, &rest) in rest.values().iter().enumerate() {
            count.set_rest(taxel, rest);
        }
        Ok(count)
    }

    /// Starts with levels that are parts of each taxel's running range.
    pub(super) fn of_range(levels: &[f64], taxels: usize) -> Result<Self> {
        Self::new(levels, Some(RunningRange::default()), taxels)
    }

    fn new(levels: &[f64], running_range: Option<RunningRange>, taxels: usize) -> Result<Self> {
        let levels =
            LevelCrossing { release_share: Some(RELEASE), running_range, ..LevelCrossing::at(levels.to_vec()) };
        Ok(Self { crossings: LevelCrossings::new(&levels, taxels)?, begun: false })
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

    /// Sets the rest of a taxel from now on, where levels are above it.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        if !self.crossings.is_of_range() {
            self.crossings.place(taxel, rest, 1.0);
        }
    }
}

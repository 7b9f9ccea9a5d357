//! Peak: the largest deviation of a taxel in units of its own noise, with what several loaded taxels add. It does not
//! depend on position, nor on neighbours, so it serves a single taxel and channels too.

use serde::{Deserialize, Serialize};

use super::encoding::Encoding;
use super::features::{self, Emit, Feature};
use super::levels::Levels;
use super::loaded::require_tare;
use super::peak_load::PeakLoad;
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Array, Result, SpikeKind, problem};

parameters! {
    /// Peak: rises and falls of the largest deviation from the rest through levels, in units of each taxel's own noise.
    ///
    /// With u a value less its rest, divided by the taxel's standard deviation in the tare (at least `least_noise`), the
    /// peak is the largest u, and where several are 4 or more, the root of the sum of their squares; at least 0. A taxel
    /// without a rest in the tare is left out; one that is 0 from the first value on has no value yet and counts as at rest.
    ///
    /// Trains, unsigned: rises to each level, then falls below `release` times each. They are computed once a stamp,
    /// after its last event.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Peak {
        /// The smallest noise of a taxel, in the sensor's unit. Default 0.3, the deviation within a tick.
        pub least_noise: f64 = 0.3, "", Range::within(1e-9, 1e9);
        /// Levels of the peak, in units of noise, ascending; default 5, 6, 8, 12, 20.
        pub levels: Vec<f64> = vec![5.0, 6.0, 8.0, 12.0, 20.0], "", Range::ABOVE_0;
        /// The part of a level below which it is left, from 0.01 to 1; default 0.7. Below 1, noise near a level does
        /// not cross it again and again.
        pub release: f64 = 0.7, "", Range::within(0.01, 1.0);
        /// The taxels' rest and noise. It is valid for one board on one day: a saved readout has none and receives one
        /// when it is used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

impl Encoding for Peak {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.levels.is_empty() {
            return Err(problem!("levels"; " is empty: must contain one level or more"));
        }
        if let Some(k) = self.levels.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(problem!("levels"; "[{}]: must be above the level before", k + 1));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let tare = require_tare("peak", self.tare.as_ref())?;
        let peak = Feature::Peak(PeakLoad::new(array, tare, self.least_noise)?);
        let emit = Emit::Crossings(Levels::of_each(1, &self.levels, self.release));
        Ok(features::stream(vec![peak], None, tare.rest_of(array)?, emit, array, self.trains_of(array)))
    }

    fn trains(&self, _array: &Array) -> usize {
        2 * self.levels.len()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

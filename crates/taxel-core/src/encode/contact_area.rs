//! The number of loaded taxels, as crossings of 2, 4, 8, 16 and 32. It does not depend on position, so what is learnt
//! at one position holds at others.

use serde::{Deserialize, Serialize};

use super::encoding::Encoding;
use super::features::{self, Emit, Feature};
use super::levels::Levels;
use super::loaded::{Loaded, require_tare};
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Array, Result, SpikeKind, problem};

parameters! {
    /// Contact area: rises and falls of the number of loaded taxels through levels.
    ///
    /// A taxel is loaded while its value exceeds its rest by more than the board's noise floor and half a tick; it
    /// counts only if one of its 8 neighbours is loaded too, which rejects noise. A taxel without any event, in the
    /// tare or since, is unloaded. The area is computed once per stamp, after its last event; spikes have the stamp's
    /// time. Trains, unsigned: rises through each level, then falls below each.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct ContactArea {
        /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
        pub noise_floor: f64 = 3.0, "", Range::FROM_0;
        /// Numbers of taxels, ascending; default 2, 4, 8, 16, 32.
        pub levels: Vec<u32> = vec![2, 4, 8, 16, 32];
        /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
        /// used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

impl Encoding for ContactArea {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.levels.is_empty() {
            return Err(problem!("levels"; " is empty: must contain one number of taxels or more"));
        }
        if self.levels[0] == 0 || self.levels.windows(2).any(|w| w[1] <= w[0]) {
            return Err(problem!("levels"; " are {:?}: must ascend from 1 or more", self.levels));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        array.check_neighbours("contact area")?;
        let rest = require_tare("contact area", self.tare.as_ref())?.rest_of(array)?;
        let loaded = Loaded::new("contact area", array, self.tare.as_ref(), self.noise_floor)?;
        let levels: Vec<f64> = self.levels.iter().map(|&level| f64::from(level)).collect();
        let emit = Emit::Crossings(Levels::of_each(1, &levels, 1.0));
        Ok(features::stream(vec![Feature::Area(loaded)], None, rest, emit, array, self.trains_of(array)))
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

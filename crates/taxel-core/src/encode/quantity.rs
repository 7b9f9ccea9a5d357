//! How strongly a sensor is loaded, as one number: the quantities of plain rules.

use serde::{Deserialize, Serialize};

use super::blocks::Block;
use super::by_stamp::{ByStamp, Measure};
use super::level_count::LevelCount;
use super::loaded::{Loaded, require_tare};
use super::local_load::{LargestOfFrame, LargestSums, LocalLoad};
use super::peak::PeakLoad;
use super::stream::Stream;
use super::tare::Tare;
use crate::rest::step_of;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

/// The time constant of the running mean above or below which a load changes, ms.
const CHANGE_MS: f64 = 50.0;

/// A measure of the load on a sensor, which does not depend on position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The number of loaded taxels, as of [`ContactArea`](super::ContactArea); of channels each counts alone.
    Area,
    /// The sum of their values above rest, in the sensor's unit, as of [`Moments`](super::Moments).
    Total,
    /// The largest sum over 3 x 3 taxels above a tracked rest, in units of its noise, as of
    /// [`LocalLoad`](super::LocalLoad).
    LocalLoad,
    /// The largest sum over 3 x 3 taxels above their running mean of 50 ms, in units of its noise: loads that begin beside
    /// one that stays, and of a rest that is no longer so.
    LocalRise,
    /// The same below the running mean.
    LocalFall,
    /// The largest value of a taxel above a tracked rest, in units of its noise, with what several loaded taxels add, as
    /// of [`Peak`](super::Peak).
    Peak,
    /// How many taxels are above a level, added up over several levels above rest, in the sensor's unit. A taxel is above a
    /// level until it is below seven tenths of it.
    Count,
    /// The same of levels in parts of each taxel's running range, as of [`RunningRange`](super::RunningRange), without
    /// a rest; 0 until its first window is full. Each stamp of events is a sample.
    RangeCount,
    /// How long a touch lasts, ms: the quantity of rules that decide when it ends, which is no load.
    Duration,
}

impl Quantity {
    /// Whether it is a sum over taxels beside each other, which channels have none of.
    #[must_use]
    pub fn is_local(self) -> bool {
        matches!(self, Self::LocalLoad | Self::LocalRise | Self::LocalFall)
    }

    /// Whether it counts levels, which must then be given.
    #[must_use]
    pub fn has_levels(self) -> bool {
        matches!(self, Self::Count | Self::RangeCount)
    }

    /// Starts a stream in which each quantity is a train: a spike for every change, with the new value, in single
    /// precision. All are 0 at first. The `levels` are those of a count.
    ///
    /// # Errors
    ///
    /// `Problem` for local loads of channels, of which no taxel is known to have neighbours; without a tare, except for a
    /// count by running range alone, or with one of another array; for local loads and the peak, with one without the
    /// taxels' noise; for levels that are not above 0 or do not ascend; for the duration.
    pub fn stream(
        several: &[Self],
        levels: &[f64],
        array: &Array,
        tare: Option<&Tare>,
        noise_floor: f64,
    ) -> Result<Box<dyn Stream>> {
        for quantity in several {
            match quantity {
                Self::Duration => {
                    return Err(
                        problem!("quantity"; " duration: does not change during a touch; choose another quantity"),
                    );
                }
                Self::LocalLoad | Self::LocalRise | Self::LocalFall => {
                    array.check_neighbours("a plain rule by local load")?;
                }
                Self::Area | Self::Total | Self::Peak | Self::Count | Self::RangeCount => {}
            }
        }
        let by_loaded = several.iter().any(|quantity| matches!(quantity, Self::Area | Self::Total));
        let loaded = if several == [Self::RangeCount] {
            Loaded::without_rest(array)
        } else {
            Loaded::new("plain rule", array, tare, if by_loaded { noise_floor } else { f64::INFINITY })?
        };
        let mut local = LocalLoad { noise_floor, tare: tare.cloned(), ..LocalLoad::default() };
        local.least_noise *= step_of(noise_floor);
        // The least noise of a taxel belongs to the floor: .3 is of a board's 3 ticks, and of values in whole steps.
        let least = if noise_floor > 0.0 { noise_floor / 10.0 } else { local.least_noise };
        if several.iter().any(|quantity| matches!(quantity, Self::LocalRise | Self::LocalFall)) {
            local.local_ms = vec![CHANGE_MS];
        }
        let local = several.iter().any(|quantity| quantity.is_local()).then(|| local.largest(array)).transpose()?;
        let peak = several.contains(&Self::Peak).then(|| PeakLoad::new(array, tare, least)).transpose()?;
        let count = several.contains(&Self::Count).then(|| {
            let rest = require_tare("plain rule", tare)?.rest_of(array)?;
            LevelCount::above_rest(levels, &rest)
        });
        let range_count = several.contains(&Self::RangeCount).then(|| LevelCount::of_range(levels, array.len()));
        let loads = QuantityMeasure {
            quantities: several.to_vec(),
            values: vec![0.0; several.len()],
            local,
            peak,
            count: count.transpose()?,
            range_count: range_count.transpose()?,
        };
        Ok(Box::new(ByStamp::new(loads, loaded, array)))
    }
}

/// Quantities, with their values at the end of the last stamp.
#[derive(Clone)]
struct QuantityMeasure {
    quantities: Vec<Quantity>,
    values: Vec<f32>,
    /// Computes local loads, if one is among the quantities.
    local: Option<LargestSums>,
    /// Computes the peak, if it is among the quantities.
    peak: Option<PeakLoad>,
    /// Counts levels above rest, if that is among the quantities.
    count: Option<LevelCount>,
    /// Counts levels of running ranges, likewise.
    range_count: Option<LevelCount>,
}

impl Measure for QuantityMeasure {
    fn trains(&self) -> usize {
        self.quantities.len()
    }

    fn drifts(&self) -> bool {
        self.local.is_some() || self.peak.is_some()
    }

    fn set_rest(&mut self, taxel: usize, rest: f64) {
        if let Some(local) = &mut self.local {
            local.set_rest(taxel, rest);
        }
        if let Some(peak) = &mut self.peak {
            peak.set_rest(taxel, rest);
        }
        if let Some(count) = &mut self.count {
            count.set_rest(taxel, rest);
        }
    }

    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        let local = self.local.as_mut().map_or(LargestOfFrame::default(), |sums| sums.take(t, held.as_flattened()));
        let peak = self.peak.as_mut().map_or(0.0, |peak| peak.take(t, held.as_flattened()));
        let count = self.count.as_mut().map_or(0, |count| count.take(t, held));
        let range_count = self.range_count.as_mut().map_or(0, |count| count.take(t, held));
        for (train, (quantity, last)) in (0..).zip(self.quantities.iter().zip(&mut self.values)) {
            // In single precision, which holds every number of taxels and of their levels exactly.
            let value = match quantity {
                Quantity::Area => loaded.area() as f32,
                Quantity::Total => loaded.sums(held).total as f32,
                Quantity::LocalLoad => local.above_rest as f32,
                Quantity::LocalRise => local.of_mean[0] as f32,
                Quantity::LocalFall => local.of_mean[1] as f32,
                Quantity::Peak => peak as f32,
                Quantity::Count => count as f32,
                Quantity::RangeCount => range_count as f32,
                Quantity::Duration => 0.0,
            };
            if value != *last {
                *last = value;
                out.push(Spike { t: ms(t), train, value });
            }
        }
    }
}

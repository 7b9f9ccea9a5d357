//! How strongly a sensor is loaded, as one number: the quantities of plain rules.

use serde::{Deserialize, Serialize};

use super::begin_area::BeginArea;
use super::driver::Trains;
use super::encoding::Encoding;
use super::features::{self, Emit, Feature};
use super::level_count::LevelCount;
use super::loaded::{Loaded, require_tare};
use super::local_load::LocalLoad;
use super::peak_load::PeakLoad;
use super::stream::Stream;
use super::tare::Tare;
use crate::rest::{Rest, Value, step_of};
use crate::{Array, Result, SpikeKind, problem};

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
    /// How many of the loaded taxels have been so since a touch began, or since less than a level after it, ms, added up
    /// over several levels: none once a touch has left the place where it began, as that of a foot whose heel lifts.
    BeginArea,
    /// How long a touch lasts, ms: the quantity of rules that decide when it ends, which is no load.
    Duration,
}

impl Quantity {
    /// Whether it is a sum over taxels beside each other, which channels have none of.
    #[must_use]
    pub fn is_local(self) -> bool {
        matches!(self, Self::LocalLoad | Self::LocalRise | Self::LocalFall)
    }

    /// Whether it counts by levels, which must then be given.
    #[must_use]
    pub fn has_levels(self) -> bool {
        matches!(self, Self::Count | Self::RangeCount | Self::BeginArea)
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
                Self::Area | Self::Total | Self::Peak | Self::Count | Self::RangeCount | Self::BeginArea => {}
            }
        }
        let reads = |wanted: &[Self]| several.iter().any(|quantity| wanted.contains(quantity));
        let rest = if several == [Self::RangeCount] {
            Rest::measured(vec![f64::NO_REST; array.len()])
        } else {
            require_tare("plain rule", tare)?.rest_of(array)?
        };
        // Each feature, with the quantities that its first values are.
        let mut features: Vec<(Feature, &[Self])> = vec![];
        if reads(&[Self::Area]) {
            let loaded = Loaded::new("plain rule", array, tare, noise_floor)?;
            features.push((Feature::Area(loaded), &[Self::Area]));
        }
        if reads(&[Self::Total]) {
            let loaded = Loaded::new("plain rule", array, tare, noise_floor)?;
            features.push((Feature::Total(loaded), &[Self::Total]));
        }
        if several.iter().any(|quantity| quantity.is_local()) {
            let changes = reads(&[Self::LocalRise, Self::LocalFall]);
            let mut local = LocalLoad { noise_floor, tare: tare.cloned(), ..LocalLoad::default() };
            local.least_noise *= step_of(noise_floor);
            local.local_ms.extend(changes.then_some(CHANGE_MS));
            let values = &[Self::LocalLoad, Self::LocalRise, Self::LocalFall][..if changes { 3 } else { 1 }];
            local.check()?;
            features.push((Feature::Local(local.sums(array)?), values));
        }
        if reads(&[Self::Peak]) {
            // The least noise of a taxel belongs to the floor: .3 is of a board's 3 ticks, and of values in whole steps.
            let least = if noise_floor > 0.0 { noise_floor / 10.0 } else { LocalLoad::default().least_noise };
            let peak = PeakLoad::new(array, require_tare("plain rule", tare)?, least)?;
            features.push((Feature::Peak(peak), &[Self::Peak]));
        }
        if reads(&[Self::Count]) {
            features.push((Feature::Count(LevelCount::above_rest(levels, &rest)?), &[Self::Count]));
        }
        if reads(&[Self::RangeCount]) {
            features.push((Feature::Count(LevelCount::of_range(levels, array.len())?), &[Self::RangeCount]));
        }
        if reads(&[Self::BeginArea]) {
            let begin = BeginArea::new(levels, Loaded::new("plain rule", array, tare, noise_floor)?, array.len());
            features.push((Feature::Begin(begin), &[Self::BeginArea]));
        }
        let values: Vec<Self> = features.iter().flat_map(|(_, quantities)| quantities.iter().copied()).collect();
        let which = several.iter().filter_map(|quantity| values.iter().position(|value| value == quantity)).collect();
        let emit = Emit::Changes { which, last: vec![0.0; several.len()] };
        let features = features.into_iter().map(|(feature, _)| feature).collect();
        let trains = Trains { number: several.len(), kind: SpikeKind::Unsigned, latency_ms: 0.0 };
        Ok(features::stream(features, rest, emit, array, trains))
    }
}

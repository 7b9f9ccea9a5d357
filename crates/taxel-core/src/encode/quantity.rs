//! How strongly a sensor is loaded, as one number: the quantities of plain rules.

use serde::{Deserialize, Serialize};

use super::begin_area::BeginArea;
use super::driver::Trains;
use super::encoding::Encoding;
use super::features::{self, Emit, Feature};
use super::level_count::LevelCount;
use super::load_sum::LoadSum;
use super::loaded::{Loaded, require_tare};
use super::local_load::LocalLoad;
use super::moved::Moved;
use super::range_load::RangeLoad;
use super::shear::Shear;
use super::stream::Stream;
use super::tare::Tare;
use super::touched::Touched;
use crate::rest::{Rest, Value, step_of};
use crate::{Array, Result, SpikeKind, problem};

/// The time constant of the running mean above or below which a load changes, ms.
const CHANGE_MS: f64 = 50.0;

/// A measure of the load on a sensor, which does not depend on position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The sum of what the taxels read above rest, in the sensor's unit; a taxel is loaded, alone, above the noise floor and
    /// six times its own noise.
    Load,
    /// The load without its largest taxel, which may be a bad one.
    LoadWithoutLargest,
    /// The sum of what the channels read in parts of their running ranges, as of [`RunningRange`](super::RunningRange),
    /// without a rest; not known until its first window is full. Each stamp of events is a sample.
    RangeLoad,
    /// How many taxels are above a level, added up over several levels above rest, in the sensor's unit. A taxel is above a
    /// level until it is below seven tenths of it.
    Count,
    /// The number of loaded taxels, as of [`ContactArea`](super::ContactArea); of channels each counts alone.
    Area,
    /// How many of the loaded taxels have been so since a touch began, or since less than a level after it, ms, added up
    /// over several levels: none once a touch has left the place where it began, as that of a foot whose heel lifts.
    BeginArea,
    /// The smaller of what the taxels gain and what they lose, in sum, against their running means of 100 ms: what slides or
    /// turns under a load that stays.
    Moved,
    /// How much the sum of all taxels is above its running mean of 100 ms.
    Rise,
    /// The same below the running mean.
    Fall,
    /// By how much the shear, the sum as a vector of channels whose names end in _x and _y above rest, differs from its running
    /// mean of 100 ms while it is longer than that; smoothed over 20 ms.
    ShearRise,
    /// The same while it is shorter.
    ShearFall,
    /// The largest sum over 3 x 3 taxels above a tracked rest, in units of its noise, as of [`LocalLoad`](super::LocalLoad):
    /// loads in noise, and above a rest that drifts.
    LocalLoad,
    /// The largest sum over 3 x 3 taxels above their running mean of 50 ms, in units of its noise: loads that begin beside
    /// one that stays, and of a rest that is no longer so.
    LocalRise,
    /// The same below the running mean.
    LocalFall,
    /// How long a touch lasts, ms: the quantity of rules that decide when it ends, which is no load.
    Duration,
}

/// The numbers by which quantities are measured.
#[derive(Debug, Clone, Copy)]
pub struct Measure<'a> {
    /// The levels of a count, or of the begin area; none of others.
    pub levels: &'a [f64],
    /// In the sensor's unit.
    pub noise_floor: f64,
    /// Quantities are 0 unless the sensor has been touched for so long, ms.
    pub touched_ms: Option<f64>,
}

impl Quantity {
    /// Whether it is a sum over taxels beside each other, which channels have none of.
    fn is_local(self) -> bool {
        matches!(self, Self::LocalLoad | Self::LocalRise | Self::LocalFall)
    }

    /// Whether it counts by levels, which must then be given.
    #[must_use]
    pub fn has_levels(self) -> bool {
        matches!(self, Self::Count | Self::BeginArea)
    }

    /// Starts a stream in which each quantity is a train: a spike for every change, with the new value, in single
    /// precision. The first frame shows the first values; of events all are 0 at first.
    ///
    /// # Errors
    ///
    /// `Problem` for local loads, rises and falls of channels, of which no taxel is known to have neighbours; without a tare, except
    /// for the load by running range alone, or with one of another array; for levels that are not above 0 or do not ascend;
    /// for the duration.
    pub fn stream(
        several: &[Self],
        measure: Measure<'_>,
        array: &Array,
        tare: Option<&Tare>,
    ) -> Result<Box<dyn Stream>> {
        let Measure { levels, noise_floor, touched_ms } = measure;
        if several.contains(&Self::Duration) {
            return Err(problem!("quantity"; " duration: does not change during a touch; choose another quantity"));
        }
        if several.iter().any(|quantity| quantity.is_local()) {
            array.check_neighbours("a plain rule by local load")?;
        }
        let needs_none = several == [Self::RangeLoad] && touched_ms.is_none();
        let tare = if needs_none { None } else { Some(require_tare("plain rule", tare)?) };
        let rest = match tare {
            None => Rest::measured(vec![f64::NO_REST; array.len()]),
            Some(tare) => tare.rest_of(array)?,
        };
        let loaded = || Loaded::new("plain rule", array, tare, noise_floor);
        // Each feature, with the quantities that its values are.
        let kinds: [&[Self]; 8] = [
            &[Self::Load, Self::LoadWithoutLargest],
            &[Self::RangeLoad],
            &[Self::Count],
            &[Self::Area],
            &[Self::BeginArea],
            &[Self::Moved, Self::Rise, Self::Fall],
            &[Self::ShearRise, Self::ShearFall],
            &[Self::LocalLoad, Self::LocalRise, Self::LocalFall],
        ];
        let (mut features, mut values) = (vec![], vec![]);
        for kind in kinds.into_iter().filter(|kind| several.iter().any(|quantity| kind.contains(quantity))) {
            values.extend_from_slice(kind);
            features.push(match kind[0] {
                Self::Load => Feature::Load(LoadSum::new(array, require_tare("plain rule", tare)?, noise_floor)?),
                Self::RangeLoad => Feature::Range(RangeLoad::new(array.len())?),
                Self::Count => Feature::Count(LevelCount::above_rest(levels, &rest)?),
                Self::Area => Feature::Area(loaded()?),
                Self::BeginArea => Feature::Begin(BeginArea::new(levels, loaded()?, array.len())),
                Self::Moved => Feature::Moved(Moved::new(array, require_tare("plain rule", tare)?)?),
                Self::ShearRise => Feature::Shear(Shear::new(array, require_tare("plain rule", tare)?)?),
                _ => {
                    let mut local = LocalLoad { noise_floor, tare: tare.cloned(), ..LocalLoad::default() };
                    local.least_noise *= step_of(noise_floor);
                    local.local_ms = vec![CHANGE_MS];
                    local.check()?;
                    Feature::Local(local.sums(array)?)
                }
            });
        }
        let which = several.iter().filter_map(|quantity| values.iter().position(|value| value == quantity)).collect();
        let emit = Emit::Changes { which, last: vec![f32::NAN; several.len()] };
        let trains = Trains { number: several.len(), kind: SpikeKind::Unsigned, latency_ms: 0.0 };
        let touched = match touched_ms {
            None => None,
            Some(settling_ms) => Some(Touched::new(settling_ms, loaded()?)),
        };
        Ok(features::stream(features, touched, rest, emit, array, trains))
    }
}

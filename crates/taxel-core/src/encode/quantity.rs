//! How strongly a sensor is loaded, as one number: the quantities of plain rules.

use serde::{Deserialize, Serialize};

use super::blocks::Block;
use super::by_stamp::{ByStamp, Measure};
use super::loaded::Loaded;
use super::local_load::{LargestSum, LocalLoad};
use super::peak::PeakLoad;
use super::stream::Stream;
use super::tare::Tare;
use crate::rest::step_of;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

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
    /// The largest value of a taxel above a tracked rest, in units of its noise, with what several loaded taxels add, as
    /// of [`Peak`](super::Peak).
    Peak,
    /// How long a touch lasts, ms: the quantity of rules that decide when it ends, which is no load.
    Duration,
}

impl Quantity {
    /// Starts a stream in which each quantity is a train: a spike for every change, with the new value, in single
    /// precision. All are 0 at first.
    ///
    /// # Errors
    ///
    /// `Problem` for the local load of channels, of which no taxel is known to have neighbours; without a tare, or with one
    /// of another array; for the local load and the peak, with one without the taxels' noise; for the duration.
    pub fn stream(several: &[Self], array: &Array, tare: Option<&Tare>, noise_floor: f64) -> Result<Box<dyn Stream>> {
        for quantity in several {
            match quantity {
                Self::Duration => {
                    return Err(
                        problem!("quantity"; " duration: does not change during a touch; choose another quantity"),
                    );
                }
                Self::LocalLoad => array.check_neighbours("a plain rule by local load")?,
                Self::Area | Self::Total | Self::Peak => {}
            }
        }
        let by_loaded = several.iter().any(|quantity| matches!(quantity, Self::Area | Self::Total));
        let loaded = Loaded::new("plain rule", array, tare, if by_loaded { noise_floor } else { f64::INFINITY })?;
        let mut local = LocalLoad { noise_floor, tare: tare.cloned(), ..LocalLoad::default() };
        local.least_noise *= step_of(noise_floor);
        // The least noise of a taxel belongs to the floor: .3 is of a board's 3 ticks, and of values in whole steps.
        let least = if noise_floor > 0.0 { noise_floor / 10.0 } else { local.least_noise };
        let local = several.contains(&Self::LocalLoad).then(|| local.largest(array)).transpose()?;
        let peak = several.contains(&Self::Peak).then(|| PeakLoad::new(array, tare, least)).transpose()?;
        let loads = QuantityMeasure { quantities: several.to_vec(), values: vec![0.0; several.len()], local, peak };
        Ok(Box::new(ByStamp::new(loads, loaded, array)))
    }
}

/// Quantities, with their values at the end of the last stamp.
#[derive(Clone)]
struct QuantityMeasure {
    quantities: Vec<Quantity>,
    values: Vec<f32>,
    /// Computes the local load, if it is among the quantities.
    local: Option<LargestSum>,
    /// Computes the peak, if it is among the quantities.
    peak: Option<PeakLoad>,
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
    }

    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        let local = self.local.as_mut().map_or(0.0, |sums| sums.take(t, held.as_flattened()));
        let peak = self.peak.as_mut().map_or(0.0, |peak| peak.take(t, held.as_flattened()));
        for (train, (quantity, last)) in (0..).zip(self.quantities.iter().zip(&mut self.values)) {
            // In single precision, which holds every number of taxels exactly.
            let value = match quantity {
                Quantity::Area => loaded.area() as f32,
                Quantity::Total => loaded.sums(held).total as f32,
                Quantity::LocalLoad => local as f32,
                Quantity::Peak => peak as f32,
                Quantity::Duration => 0.0,
            };
            if value != *last {
                *last = value;
                out.push(Spike { t: ms(t), train, value });
            }
        }
    }
}

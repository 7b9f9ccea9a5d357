//! How strongly a sensor is loaded, as one number: the quantities of plain rules.

use serde::{Deserialize, Serialize};

use super::blocks::Block;
use super::by_stamp::{ByStamp, Measure};
use super::loaded::Loaded;
use super::stream::Stream;
use super::tare::Tare;
use crate::spikes::ms;
use crate::{Array, Result, Spike};

/// A measure of the load on a sensor, which does not depend on position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The number of loaded taxels, as of [`ContactArea`](super::ContactArea).
    Area,
    /// The sum of their values above rest, in the sensor's unit, as of [`Moments`](super::Moments).
    Total,
}

impl Quantity {
    /// Starts a stream in which each quantity is a train: a spike for every change, with the new value, in single
    /// precision. All are 0 at first.
    ///
    /// # Errors
    ///
    /// `Problem` without a tare, or with one of another array.
    pub fn stream(several: &[Self], array: &Array, tare: Option<&Tare>, noise_floor: f64) -> Result<Box<dyn Stream>> {
        let loads = Loads { quantities: several.to_vec(), values: vec![0.0; several.len()] };
        Ok(Box::new(ByStamp::new(loads, Loaded::new("plain rule", array, tare, noise_floor)?, array)))
    }

    /// The value in single precision, which holds every number of taxels exactly.
    fn of(self, loaded: &Loaded, held: &[Block]) -> f32 {
        match self {
            Self::Area => loaded.area() as f32,
            Self::Total => loaded.sums(held).total as f32,
        }
    }
}

/// Quantities, with their values at the end of the last stamp.
#[derive(Clone)]
struct Loads {
    quantities: Vec<Quantity>,
    values: Vec<f32>,
}

impl Measure for Loads {
    fn trains(&self) -> usize {
        self.quantities.len()
    }

    fn emit(&mut self, t: i64, loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        for (train, (quantity, last)) in (0..).zip(self.quantities.iter().zip(&mut self.values)) {
            let value = quantity.of(loaded, held);
            if value != *last {
                *last = value;
                out.push(Spike { t: ms(t), train, value });
            }
        }
    }
}

//! What changes within a load: how much some taxels gain and others lose, against their running means.

use super::driver::Sample;
use super::tare::Tare;
use crate::rest::{Baseline, Value, Waiting};
use crate::{Array, Result};

/// The time constant of the running means, us: chosen on slips of a gripper at 32 to 83 Hz.
pub(super) const MEAN_US: f64 = 100_000.0;

/// Computes the changes from the values of all taxels.
#[derive(Clone)]
pub(super) struct Moved {
    means: Baseline,
    rest: Vec<f64>,
    values: Vec<f32>,
    waiting: Waiting,
}

impl Moved {
    /// Starts from a tare; taxels whose rest is not known are left out.
    pub(super) fn new(array: &Array, tare: &Tare) -> Result<Self> {
        let rest = tare.rest_of(array)?.values().to_vec();
        let (means, values) = (Baseline::running(rest.len(), MEAN_US), vec![0.0; rest.len()]);
        Ok(Self { means, rest, values, waiting: Waiting::default() })
    }

    /// Reads the values of all taxels; returns what moved (the smaller of all rises and all falls), the rise and the
    /// fall of their sum.
    pub(super) fn take(&mut self, now: Sample<'_>) -> [f64; 3] {
        self.values.copy_from_slice(&now.held.as_flattened()[..self.rest.len()]);
        self.waiting.fill(&mut self.values, &self.rest);
        let (mut rises, mut falls) = (0.0, 0.0);
        for (&change, &rest) in self.means.take(now.t, &self.values).iter().zip(&self.rest) {
            let change = if rest == f64::NO_REST { 0.0 } else { f64::from(change) };
            rises += change.max(0.0);
            falls += (-change).max(0.0);
        }
        [rises.min(falls), (rises - falls).max(0.0), (falls - rises).max(0.0)]
    }

    /// Sets the rest of a taxel.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.rest[taxel] = rest;
    }
}

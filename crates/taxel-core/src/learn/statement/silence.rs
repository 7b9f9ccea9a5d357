//! Silence in either kind of time: at grid points or at every instant.

use super::continuous::SilentTimes;
use super::grid::SilentRows;
use super::peak::{SilencePeak, largest};
use super::rows::Statement;
use crate::neuron::Time;
use crate::{Result, Stop};

/// All silence of a problem, prepared for evaluation.
#[derive(Debug, Clone)]
pub(crate) enum Silence {
    /// At the points of the grid.
    Grid(Box<SilentRows>),
    /// At every instant.
    Continuous(SilentTimes),
}

impl Silence {
    pub(crate) fn new(statement: &Statement, stop: Stop<'_>) -> Result<Self> {
        Ok(match statement.neuron.time {
            Time::Grid => Self::Grid(Box::new(SilentRows::new(statement, stop)?)),
            Time::Continuous => Self::Continuous(SilentTimes::new(statement)),
        })
    }

    /// The worst instant of each interval in which the potential plus `share` of the margin exceeds the threshold by
    /// more than `tolerance`. On the grid the whole margin counts, as its rows are isolated points.
    pub(crate) fn broken(&self, weights: &[f64], share: f64, tolerance: f64) -> Vec<SilencePeak> {
        match self {
            Self::Grid(rows) => rows.broken(weights, tolerance),
            Self::Continuous(times) => times.broken(weights, share, tolerance),
        }
    }

    /// The worst violation of silence with this share of the margin, mV; negative if silence holds.
    pub(crate) fn worst(&self, weights: &[f64], share: f64) -> f64 {
        largest(self.broken(weights, share, f64::NEG_INFINITY).iter().map(|peak| peak.excess))
    }
}

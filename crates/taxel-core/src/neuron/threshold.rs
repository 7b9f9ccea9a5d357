//! The threshold after a spike, and output spikes.

use super::model::{FirstThreshold, Neuron, left_of_rise};
use super::rounding_ms;

/// A spike of the neuron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputSpike {
    /// The time at which the potential crossed the threshold (on a grid: the first point at or above it), ms.
    pub t: f64,
    /// The slope of the potential at the crossing, mV/ms; on a grid its mean slope over the step that ends there. 0 or
    /// less where the refractory time, or a falling threshold, held the spike back until then.
    pub slope: f64,
}

/// The largest slope that is allowed for when a time is rounded, in thresholds per ms.
const STEEPEST: f64 = 1e4;

/// The threshold, and the last spike since which it recovers.
#[derive(Debug, Clone)]
pub(super) struct Threshold {
    /// `theta_0` times the factor, mV.
    pub(super) base: f64,
    /// A potential this far below the threshold still counts as reaching it, mV.
    pub(super) touch: f64,
    plus: f64,
    pub(super) tau_rec: f64,
    refractory: f64,
    rearm: Option<f64>,
    /// The share of the threshold below which the potential must fall before the next spike.
    unarmed: Option<f64>,
    /// The last spike, or spike number 0 of the printed first threshold.
    since: Option<f64>,
    /// The last real spike.
    pub(super) fired: Option<f64>,
}

impl Threshold {
    pub(super) fn new(neuron: &Neuron, factor: f64, start: f64) -> Self {
        Self {
            base: neuron.theta_0 * factor,
            touch: neuron.touch(),
            plus: neuron.theta_plus * factor,
            tau_rec: neuron.tau_rec(),
            refractory: neuron.refractory,
            rearm: neuron.rearm,
            unarmed: None,
            since: (neuron.first_threshold == FirstThreshold::Printed).then_some(start),
            fired: None,
        }
    }

    pub(super) fn fire(&mut self, t: f64) {
        self.since = Some(t);
        self.fired = Some(t);
        self.unarmed = self.rearm;
    }

    /// Whether the neuron cannot fire until its potential has fallen.
    pub(super) fn is_unarmed(&self) -> bool {
        self.unarmed.is_some()
    }

    /// The remaining rise at `t`, mV.
    pub(super) fn rise(&self, t: f64) -> f64 {
        self.since.map_or(0.0, |since| left_of_rise(self.plus, t - since - self.refractory, self.tau_rec, t))
    }

    /// Whether the neuron cannot fire at `t`: `0 < t - spike <= refractory` (6.6).
    pub(super) fn is_refractory(&self, t: f64) -> bool {
        self.fired.is_some_and(|spike| spike < t && t <= spike + self.refractory + rounding_ms(t))
    }

    /// Whether the neuron may fire at grid time `t` and its potential has reached the threshold. The time may be off by
    /// `rounding_ms`, which moves the potential by its slope times that, and the threshold likewise.
    ///
    /// A neuron that is unarmed does not fire; its potential here decides whether it may fire at the next point.
    ///
    /// Reading: in the refractory time, too, the sum of the inputs decides, not the 0 of 6.7, and is compared with the
    /// share of `theta_0`. A potential that just reaches the share is not below it.
    pub(super) fn compare(&mut self, t: f64, potential: f64, slope: f64, rounding_ms: f64) -> bool {
        if let Some(share) = self.unarmed {
            if potential < share * (self.base + self.rise(t) - self.touch) {
                self.unarmed = None;
            }
            return false;
        }
        let slope = slope.abs().min(STEEPEST * self.base) + self.plus / self.tau_rec;
        let potential = potential + self.touch + slope * rounding_ms;
        potential >= self.base && !self.is_refractory(t) && potential >= self.base + self.rise(t)
    }

    /// A potential further below the threshold than this, mV, has not reached it, whatever its slope.
    pub(super) fn slack(&self, rounding_ms: f64) -> f64 {
        self.touch + (STEEPEST * self.base + self.plus / self.tau_rec) * rounding_ms
    }

    /// The time at which the rise begins and the refractory time ends.
    pub(super) fn edge(&self) -> Option<f64> {
        self.since.map(|since| since + self.refractory)
    }
}

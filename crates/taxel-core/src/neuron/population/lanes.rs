//! The states of a block of neurons, side by side.

use crate::neuron::model::{AT_EDGE, AfterSpike};

/// Neurons in a block: with 1000 inputs 256 KiB of weights.
pub(super) const LANES: usize = 32;

/// By how much the bound may be off by rounding: relative for a decayed rise, and absolute, mV in proportion to `theta_0`.
pub(super) const FADED: f64 = 1.0 - 1e-9;
pub(super) const SLACK: f64 = 1e-11;

/// Intervals or points between two checks of a block for Ctrl-C.
pub(super) const LOOK: usize = 1 << 16;

/// A number that weights come in.
pub trait Weight: Copy + Default + Into<f64> {}
impl Weight for f32 {}
impl Weight for f64 {}

/// The states of a block's neurons.
pub(super) struct Lanes {
    pub(super) a: [f64; LANES],
    pub(super) b: [f64; LANES],
    /// What is left of the threshold's rise, mV; infinite in the refractory time.
    pub(super) rise: [f64; LANES],
    /// The time at which the refractory time ends and the rise begins, ms; infinite where neither is to come.
    pub(super) edge: [f64; LANES],
    /// Inputs after the first and up to the second time are lost, ms.
    pub(super) deaf_from: [f64; LANES],
    pub(super) deaf_until: [f64; LANES],
}

impl Lanes {
    /// Neurons at rest; `edge` is that of the printed first threshold.
    pub(super) fn new(edge: Option<f64>) -> Self {
        Self {
            a: [0.0; LANES],
            b: [0.0; LANES],
            rise: [0.0; LANES],
            edge: [edge.unwrap_or(f64::INFINITY); LANES],
            deaf_from: [f64::NEG_INFINITY; LANES],
            deaf_until: [f64::NEG_INFINITY; LANES],
        }
    }

    /// A spike at `t`: the neuron falls silent until `edge`, and deaf too where inputs are lost.
    pub(super) fn fire(&mut self, lane: usize, t: f64, edge: f64, after_spike: AfterSpike) {
        self.rise[lane] = f64::INFINITY;
        self.edge[lane] = edge;
        if after_spike != AfterSpike::Keep {
            self.deaf_until[lane] = edge + AT_EDGE;
        }
        if after_spike == AfterSpike::Ignore {
            self.deaf_from[lane] = t + AT_EDGE;
        }
    }

    /// 1 for a neuron at which an input at `t` counts, 0 where it is lost.
    #[inline(always)]
    pub(super) fn hears(&self, t: f64) -> [f64; LANES] {
        let mut hears = [1.0; LANES];
        for (l, hears) in hears.iter_mut().enumerate() {
            let lost = (self.deaf_from[l] < t) & (t <= self.deaf_until[l]);
            *hears = if lost { 0.0 } else { 1.0 };
        }
        hears
    }
}

//! The states of a block of neurons, side by side.

use crate::Spike;
use crate::neuron::model::{AT_EDGE, AfterSpike, Neuron};

/// The number of neurons in a block: with 1000 inputs their weights take 256 KiB.
pub(super) const LANES: usize = 32;

/// Allowances for rounding in the bound: a factor for the decayed rise, and mV (in proportion to `theta_0`) for the
/// rest.
pub(super) const FADED: f64 = 1.0 - 1e-9;
const SLACK: f64 = 1e-11;

/// The allowance for rounding in the bound, mV: potentials grow with the inputs' values, and their rounding errors too.
pub(super) fn slack(neuron: &Neuron, inputs: &[Spike]) -> f64 {
    SLACK * neuron.unit() * inputs.iter().fold(1.0_f64, |most, input| most.max(f64::from(input.value).abs()))
}

/// The number of intervals or points between two checks for Ctrl-C.
pub(super) const LOOK: usize = 1 << 16;

/// The floating-point types of weights.
pub trait Weight: Copy + Default + Into<f64> {}
impl Weight for f32 {}
impl Weight for f64 {}

/// The states of a block's neurons.
pub(super) struct NeuronLanes {
    pub(super) a: [f64; LANES],
    pub(super) b: [f64; LANES],
    /// The remaining threshold rise, mV; infinite in the refractory time.
    pub(super) rise: [f64; LANES],
    /// The time at which the refractory time ends and the rise begins to decay, ms; infinite if neither is ahead.
    pub(super) edge: [f64; LANES],
    /// Inputs after `ignored_from` and up to `ignored_until` have no effect, ms.
    pub(super) ignored_from: [f64; LANES],
    pub(super) ignored_until: [f64; LANES],
}

impl NeuronLanes {
    /// Neurons at rest; `edge` is the start of the printed first rise, if any.
    pub(super) fn new(edge: Option<f64>) -> Self {
        Self {
            a: [0.0; LANES],
            b: [0.0; LANES],
            rise: [0.0; LANES],
            edge: [edge.unwrap_or(f64::INFINITY); LANES],
            ignored_from: [f64::NEG_INFINITY; LANES],
            ignored_until: [f64::NEG_INFINITY; LANES],
        }
    }

    /// Records a spike at `t`: the neuron cannot fire until `edge`, and loses inputs as `after_spike` requires.
    pub(super) fn fire(&mut self, lane: usize, t: f64, edge: f64, after_spike: AfterSpike) {
        self.rise[lane] = f64::INFINITY;
        self.edge[lane] = edge;
        if after_spike != AfterSpike::Keep {
            self.ignored_until[lane] = edge + AT_EDGE;
        }
        if after_spike == AfterSpike::Ignore {
            self.ignored_from[lane] = t + AT_EDGE;
        }
    }

    /// The gain of an input at `t` for each neuron: 1 if the input has an effect, 0 if it is lost.
    #[inline(always)]
    pub(super) fn receives(&self, t: f64) -> [f64; LANES] {
        let mut receives = [1.0; LANES];
        for (l, receives) in receives.iter_mut().enumerate() {
            let lost = (self.ignored_from[l] < t) & (t <= self.ignored_until[l]);
            *receives = if lost { 0.0 } else { 1.0 };
        }
        receives
    }
}

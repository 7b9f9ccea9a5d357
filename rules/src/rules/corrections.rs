//! What a rule sees of a presentation, and what it answers.

use super::stepped::{AfterSpike, Laid, SteppedNeuron};
use taxel_core::SpikeTrains;

/// One correction of all weights: `amount (constant + sum over inputs of factor(t - t_ij))`, by the rule's own factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correction {
    /// When, ms.
    pub t: f64,
    /// By how much; above 0 it raises weights.
    pub amount: f64,
    /// Only inputs after this count, ms.
    pub after: f64,
    /// The number of its target, where it is at one: the factors there are the same each epoch.
    pub target: Option<usize>,
}

/// One pattern, presented to one neuron.
pub(super) struct Presented<'a> {
    pub neuron: &'a SteppedNeuron,
    pub laid: &'a Laid,
    pub trains: &'a SpikeTrains,
    pub targets: &'a [f64],
}

impl Presented<'_> {
    /// The time up to which inputs have no effect at `t`, ms, where the neuron fired at `spikes` (ms, ascending).
    pub(super) fn lost_up_to(&self, spikes: &[f64], t: f64) -> f64 {
        let earlier = spikes.iter().copied().take_while(|&spike| spike < t);
        earlier.last().filter(|_| self.neuron.after_spike == AfterSpike::Reset).unwrap_or(f64::NEG_INFINITY)
    }
}

impl Correction {
    /// A correction that all earlier inputs share in.
    pub(super) fn new(t: f64, amount: f64) -> Self {
        Self { t, amount, after: f64::NEG_INFINITY, target: None }
    }

    /// The same at target `k`.
    pub(super) fn at_target(k: usize, t: f64, amount: f64) -> Self {
        Self { target: Some(k), ..Self::new(t, amount) }
    }
}

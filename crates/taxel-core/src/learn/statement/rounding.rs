//! The rounding error of a potential, and the targets at which it decides whether the neuron fires.

use super::rows::Statement;
use crate::Spike;
use crate::neuron::Kernel;

/// An input at most this far behind a target, ms, acts before the potential has risen by more than its rounding error.
const BEHIND: f64 = 1e-8;
/// The roundings of a term, of its weight among them; the number of terms and the term's age add to them.
const OF_A_TERM: f64 = 12.0;
/// The roundings of a double exponential's factor, for each unit of it.
const OF_SCALE: f64 = 4.0;
/// The roundings of the threshold's rise.
const OF_RISE: f64 = 8.0;

impl Statement {
    /// Whether an inhibitory input at a target or shortly behind it ends the rise by which the potential would pass the
    /// threshold.
    pub(crate) fn is_turned_down(&self, (pattern, target): (usize, usize), weights: &[f64]) -> bool {
        let example = &self.examples[pattern];
        let t = example.targets[target];
        let behind = &example.inputs[example.before(t).len()..];
        let inhibits = |input: &Spike| weights[input.train as usize] * f64::from(input.value) < 0.0;
        behind.iter().take_while(|input| input.t <= t + BEHIND).any(inhibits)
    }

    /// The largest rounding error of the potential less the threshold at `t`, computed from its row, given spikes at the
    /// targets before; mV.
    pub(crate) fn rounding_at(&self, pattern: usize, t: f64, weights: &[f64]) -> f64 {
        let example = &self.examples[pattern];
        let fired = &example.targets[..example.targets.partition_point(|&target| target < t)];
        let scale = if self.shape.kernel == Kernel::DoubleExponential { self.shape.scale } else { 0.0 };
        // The sum of all terms without signs, the same by their own roundings, and the number of terms.
        let (mut size, mut rounded, mut terms) = (0.0, 0.0, self.trains as f64);
        self.for_inputs(
            example,
            t,
            fired,
            |state| state.b,
            |&Spike { t: s, train, value }, kernel| {
                let term = (weights[train as usize] * f64::from(value) * kernel).abs();
                size += term;
                rounded += term * (OF_A_TERM + OF_SCALE * scale + 2.0 * (t - s) / self.shape.tau);
                terms += 1.0;
            },
        );
        let of_rise = OF_RISE + self.neuron.refractory / self.neuron.tau_rec();
        let threshold = self.neuron.theta_0 + self.neuron.theta_plus * of_rise;
        f64::EPSILON * (rounded + 0.5 * terms * size + threshold)
    }
}

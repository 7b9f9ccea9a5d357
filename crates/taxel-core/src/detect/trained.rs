//! A trained neuron, and the range of its inputs in training.

use serde::{Deserialize, Serialize};

use crate::neuron::Neuron;
use crate::{Result, problem};

/// A neuron with the weights it was trained to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedNeuron {
    /// The neuron's parameters.
    pub neuron: Neuron,
    /// The delay after the event at which the neuron was trained to fire, in addition to the encoder's latency, ms.
    pub delay_ms: f64,
    /// The parts of a composite encoder that it receives, in any order; none stands for all trains of the encoder.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<String>,
    /// One weight per train of the encoder, or of those of its inputs in the encoder's order, mV; for signed spikes all
    /// ON trains first, then all OFF trains.
    pub weights: Vec<f64>,
}

/// The range of each input of a neuron in its training data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seen {
    /// The least value of each input's graded spikes, and at most 0; left out if all are 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<Vec<f64>>,
    /// The largest value of each input's graded spikes, and at least 0; of other spikes, the largest number within the
    /// neuron's memory.
    pub most: Vec<f64>,
}

impl Seen {
    /// Checks that there is one range for each of `inputs`, which contains 0.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the input.
    pub fn check(&self, inputs: usize) -> Result<()> {
        for (name, values, sign) in [("most", Some(&self.most), 1.0), ("least", self.least.as_ref(), -1.0)] {
            let Some(values) = values else { continue };
            if values.len() != inputs {
                return Err(problem!(
                    "seen: {name} has {} entries for {inputs} weights: must be one per weight",
                    values.len()
                ));
            }
            if let Some(n) = values.iter().position(|value| !(value * sign >= 0.0 && value.is_finite())) {
                return Err(problem!(
                    "seen: {name}[{n}] is {}: must be finite, and the range must contain 0",
                    values[n]
                ));
            }
        }
        Ok(())
    }

    /// The range of an input.
    pub(super) fn range(&self, input: usize) -> (f64, f64) {
        (self.least.as_ref().map_or(0.0, |least| least[input]), self.most[input])
    }
}

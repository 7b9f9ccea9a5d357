//! A trained neuron.

use serde::{Deserialize, Serialize};

use crate::neuron::Neuron;

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

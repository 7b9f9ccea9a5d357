//! A neuron and what it learnt.

use serde::{Deserialize, Serialize};

use crate::neuron::Neuron;

/// A neuron with the weights it was trained to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainedNeuron {
    /// Its parameters.
    pub neuron: Neuron,
    /// How much later than the event it was trained to fire, the encoder's latency apart, ms.
    #[serde(default)]
    pub delay_ms: f64,
    /// One a train of the encoder, mV; where its spikes are signed first all ON trains, then all OFF.
    pub weights: Vec<f64>,
}

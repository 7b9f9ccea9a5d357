//! Learners of spike times that take all examples at once.

use serde_json::{Map, Value};

use taxel_core::{Result, SpikeTrains, Stop};

/// What was learnt.
#[derive(Debug, Clone, PartialEq)]
pub struct Learnt {
    /// One an input of the output neuron.
    pub weights: Vec<f64>,
    /// Further results by name, with all that output spikes depend on.
    pub results: Map<String, Value>,
}

/// The interface of a learner that is fitted to all examples at once.
pub(super) trait BatchRule {
    /// Checks every parameter.
    fn check(&self) -> Result<()>;

    /// Learns from patterns of the same trains with one list of targets (ms, ascending) a pattern; checks `stop` often.
    fn fit(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Learnt>;

    /// Output spikes in a pattern, ms.
    fn run(&self, learnt: &Learnt, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>>;
}

//! A neuron of a readout in a stream: its label, its state, and its crossings so far.

use crate::detect::TrainedNeuron;
use crate::neuron::{Neuron, NeuronStream, OutputSpike, Time};
use crate::{Result, Spike};

/// A neuron with its label.
#[derive(Clone)]
pub(super) struct NamedNeuron {
    pub label: String,
    neuron: Neuron,
    weights: Vec<f64>,
    threshold: f64,
    /// The delay of its crossings after the event: the encoder's latency plus the trained delay, ms.
    pub offset_ms: f64,
    /// Started at the first spike, so that a grid has the same points wherever the input begins.
    pub stream: Option<NeuronStream>,
    pub crossings: Vec<OutputSpike>,
    /// The time of the latest input that may rest on a repaired taxel, ms.
    pub repaired: Option<f64>,
}

impl NamedNeuron {
    /// A trained neuron before its first spike.
    pub fn new(label: String, one: TrainedNeuron, threshold: f64, latency_ms: f64) -> Self {
        Self {
            label,
            offset_ms: latency_ms + one.delay_ms,
            neuron: one.neuron,
            weights: one.weights,
            threshold,
            stream: None,
            crossings: vec![],
            repaired: None,
        }
    }

    /// Passes a spike, whose train is the number of an input, to the neuron.
    ///
    /// # Errors
    ///
    /// Those of [`NeuronStream::push`].
    pub fn push(&mut self, spike: Spike) -> Result<()> {
        let stream = match &mut self.stream {
            Some(stream) => stream,
            None => {
                let start = match self.neuron.time {
                    Time::Continuous => spike.t,
                    Time::Grid => (spike.t / self.neuron.step_ms).floor() * self.neuron.step_ms,
                };
                self.stream.insert(self.neuron.stream(&self.weights, self.threshold, start.min(spike.t))?)
            }
        };
        stream.push(spike, &mut self.crossings)
    }

    /// Moves the crossings so far to `out`, each with the neuron's number and whether it may rest on repaired taxels.
    pub fn drain_crossings(&mut self, k: usize, out: &mut Vec<(OutputSpike, usize, bool)>) {
        let repaired = self.repaired;
        let rests = |t: f64| repaired.is_some_and(|at| at <= t && t - at <= self.neuron.memory_ms());
        out.extend(self.crossings.drain(..).map(|crossing| (crossing, k, rests(crossing.t))));
    }
}

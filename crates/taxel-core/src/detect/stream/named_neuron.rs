//! A neuron of a readout in a stream: its label, its state, and its crossings so far.

use crate::detect::TrainedNeuron;
use crate::neuron::{Neuron, NeuronStream, OutputSpike, Time};
use crate::{Result, Spike};

/// Which of the encoder's trains a neuron receives.
#[derive(Clone)]
pub(in crate::detect) struct Inputs {
    /// The number of the input that each train is, for all delays; `None`: each train is the input of its own number.
    of_trains: Option<Vec<Option<u32>>>,
}

impl Inputs {
    /// Those of the trains marked `received`, or all, each at so many delays.
    pub fn new(received: Option<Vec<bool>>, delays: usize) -> Self {
        let number = |received: Vec<bool>| {
            let trains = received.len() * delays;
            let inputs = received.into_iter().cycle().take(trains).scan(0, |next, received| {
                let input = received.then_some(*next);
                *next += u32::from(received);
                Some(input)
            });
            inputs.collect()
        };
        Self { of_trains: received.map(number) }
    }

    fn of(&self, train: u32) -> Option<u32> {
        match &self.of_trains {
            Some(inputs) => inputs[train as usize],
            None => Some(train),
        }
    }
}

/// A neuron with its label.
#[derive(Clone)]
pub(in crate::detect) struct NamedNeuron {
    pub label: String,
    inputs: Inputs,
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
    pub fn new(label: &str, one: &TrainedNeuron, threshold: f64, latency_ms: f64, inputs: Inputs) -> Self {
        Self {
            label: label.to_owned(),
            inputs,
            offset_ms: latency_ms + one.delay_ms,
            neuron: one.neuron.clone(),
            weights: one.weights.clone(),
            threshold,
            stream: None,
            crossings: vec![],
            repaired: None,
        }
    }

    /// Passes a spike of an encoder's train to the neuron; returns whether it is one of its inputs.
    ///
    /// # Errors
    ///
    /// Those of [`NeuronStream::push`].
    pub fn push(&mut self, spike: Spike) -> Result<bool> {
        let Some(input) = self.inputs.of(spike.train) else { return Ok(false) };
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
        stream.push(Spike { train: input, ..spike }, &mut self.crossings)?;
        Ok(true)
    }

    /// Moves the crossings so far to `out`, each with the neuron's number and whether it may rest on repaired taxels.
    pub fn drain_crossings(&mut self, k: usize, out: &mut Vec<(OutputSpike, usize, bool)>) {
        let repaired = self.repaired;
        let rests = |t: f64| repaired.is_some_and(|at| at <= t && t - at <= self.neuron.memory_ms());
        out.extend(self.crossings.drain(..).map(|crossing| (crossing, k, rests(crossing.t))));
    }
}

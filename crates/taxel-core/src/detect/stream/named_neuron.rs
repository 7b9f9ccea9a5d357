//! A neuron of a readout in a stream: its label, its state, and its crossings so far.

use crate::detect::TrainedNeuron;
use crate::neuron::{Neuron, NeuronStream, OutputSpike, Time};
use crate::spikes::us;
use crate::{Result, Spike};

/// Which of the encoder's trains a neuron receives.
#[derive(Clone)]
pub(in crate::detect) struct ReceivedTrains {
    /// The number of the input that each train is, for all delays; `None`: each train is the input of its own number.
    of_trains: Option<Vec<Option<u32>>>,
}

impl ReceivedTrains {
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

    fn input(&self, train: u32) -> Option<u32> {
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
    inputs: ReceivedTrains,
    neuron: Neuron,
    weights: Vec<f64>,
    threshold: f64,
    /// The delay of its crossings after the event: the encoder's latency plus the trained delay, ms.
    pub offset_ms: f64,
    /// Started at the first spike, so that a grid has the same points wherever the input begins.
    pub stream: Option<NeuronStream>,
    crossings: Vec<OutputSpike>,
    /// The time of the latest input that may rest on a repaired taxel, ms.
    repaired: Option<f64>,
}

/// A crossing of a neuron, and what it rests on.
pub(in crate::detect) struct NeuronCrossing {
    pub spike: OutputSpike,
    /// The neuron's number.
    pub neuron: usize,
    /// Whether it may rest on repaired taxels.
    pub repaired: bool,
}

impl NamedNeuron {
    /// A trained neuron before its first spike.
    pub fn new(label: &str, cell: &TrainedNeuron, threshold: f64, latency_ms: f64, inputs: ReceivedTrains) -> Self {
        Self {
            label: label.to_owned(),
            inputs,
            offset_ms: latency_ms + cell.delay_ms,
            neuron: cell.neuron.clone(),
            weights: cell.weights.clone(),
            threshold,
            stream: None,
            crossings: vec![],
            repaired: None,
        }
    }

    /// The time of the event of a crossing, us: without the delay.
    pub fn event_us(&self, crossing: &OutputSpike) -> i64 {
        us(crossing.t - self.offset_ms).round() as i64
    }

    /// Passes a spike of an encoder's train to the neuron, the number of which is `k`, if it is one of its inputs; adds
    /// to `out` the crossings so far, if later ones rest on something else.
    ///
    /// # Errors
    ///
    /// Those of [`NeuronStream::push`].
    pub fn push(&mut self, spike: Spike, repaired: bool, k: usize, out: &mut Vec<NeuronCrossing>) -> Result<()> {
        let Some(input) = self.inputs.input(spike.train) else { return Ok(()) };
        let spike = Spike { train: input, ..spike };
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
        stream.push(spike, &mut self.crossings)?;
        if repaired {
            // Crossings up to here cannot rest on this spike.
            self.drain_crossings(k, out);
            self.repaired = Some(spike.t);
        }
        Ok(())
    }

    /// Advances to `until_ms`, before which every spike is known; adds the crossings to `out`.
    pub fn advance(&mut self, until_ms: f64, k: usize, out: &mut Vec<NeuronCrossing>) {
        if let Some(stream) = &mut self.stream {
            stream.advance(until_ms, &mut self.crossings);
        }
        self.drain_crossings(k, out);
    }

    /// Moves the crossings so far to `out`.
    fn drain_crossings(&mut self, k: usize, out: &mut Vec<NeuronCrossing>) {
        let rests = |since: Option<f64>, t: f64| since.is_some_and(|at| at <= t && t - at <= self.neuron.memory_ms());
        out.extend(self.crossings.drain(..).map(|spike| NeuronCrossing {
            repaired: rests(self.repaired, spike.t),
            spike,
            neuron: k,
        }));
    }
}

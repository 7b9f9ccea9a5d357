//! A neuron of a readout in a stream: its label, its state, and its crossings so far.

use crate::detect::{Detection, FrameClock, TrainedNeuron};
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
    offset_ms: f64,
    /// Started at the first spike, so that a grid has the same points wherever the input begins.
    pub stream: Option<NeuronStream>,
    crossings: Vec<OutputSpike>,
    /// The time of the latest input that may rest on a repaired taxel, ms.
    repaired: Option<f64>,
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

    /// Passes a spike of an encoder's train to the neuron, if it is one of its inputs; reports the crossings so far, if later
    /// ones rest on something else.
    ///
    /// # Errors
    ///
    /// Those of [`NeuronStream::push`].
    pub fn push(
        &mut self,
        spike: Spike,
        repaired: bool,
        clock: &FrameClock,
        out: &mut Vec<(f64, Detection)>,
    ) -> Result<()> {
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
            self.report(clock, out);
            self.repaired = Some(spike.t);
        }
        Ok(())
    }

    /// Advances to `until_ms`, before which every spike is known; reports the crossings.
    pub fn advance(&mut self, until_ms: f64, clock: &FrameClock, out: &mut Vec<(f64, Detection)>) {
        if let Some(stream) = &mut self.stream {
            stream.advance(until_ms, &mut self.crossings);
        }
        self.report(clock, out);
    }

    /// Appends the crossings so far as detections to `out`, each behind the time of its crossing, ms.
    fn report(&mut self, clock: &FrameClock, out: &mut Vec<(f64, Detection)>) {
        for OutputSpike { t, slope } in self.crossings.drain(..) {
            let repaired = self.repaired.is_some_and(|at| at <= t && t - at <= self.neuron.memory_ms());
            let event = us(t - self.offset_ms).round() as i64;
            out.push((t, Detection { label: self.label.clone(), t: event, known: clock.end_of(t), slope, repaired }));
        }
    }
}

//! A neuron on a stream: input spikes in, output spikes out, the same wherever the stream is cut.

use super::continuous::ContinuousStream;
use super::grid::GridStream;
use super::model::{Neuron, Time};
use super::threshold::OutputSpike;
use crate::allowed::{above_0, one_weight_a_train};
use crate::{Result, Spike, problem};

/// A neuron that runs while its inputs arrive.
///
/// The output depends on the inputs alone, not on the calls of [`NeuronStream::advance`]: a crossing is computed from
/// the state after the last input, never from that at the last call.
#[derive(Debug, Clone)]
pub struct NeuronStream {
    weights: Vec<f64>,
    now: f64,
    clock: TimeStream,
}

#[derive(Debug, Clone)]
enum TimeStream {
    Continuous(ContinuousStream),
    Grid(GridStream),
}

impl NeuronStream {
    pub(super) fn new(neuron: &Neuron, weights: &[f64], threshold: f64, start: f64) -> Result<Self> {
        neuron.check()?;
        one_weight_a_train(weights, weights.len())?;
        above_0("threshold", threshold, "")?;
        if !start.is_finite() {
            return Err(problem!("start"; " is {start} ms: must be finite"));
        }
        let clock = match neuron.time {
            Time::Continuous => TimeStream::Continuous(ContinuousStream::new(neuron, threshold, start)),
            Time::Grid => TimeStream::Grid(GridStream::new(neuron, threshold, start)),
        };
        Ok(Self { weights: weights.to_vec(), now: start, clock })
    }

    /// Adds the next input spike, whose value multiplies the weight of its train (1 of an unsigned spike), and appends
    /// the output spikes up to it to `out`.
    ///
    /// # Errors
    ///
    /// `Problem` if the spike is earlier than a previous one, or its train has no weight.
    pub fn push(&mut self, Spike { t, train, value }: Spike, out: &mut Vec<OutputSpike>) -> Result<()> {
        if t.is_nan() || t < self.now {
            return Err(problem!("input spike at {t} ms: is too late; the neuron is already at {} ms", self.now));
        }
        let Some(&weight) = self.weights.get(train as usize) else {
            return Err(problem!(
                "input spike at {t} ms: train {train} does not exist; there are {} trains",
                self.weights.len()
            ));
        };
        self.now = t;
        let value = f64::from(value);
        match &mut self.clock {
            TimeStream::Continuous(stream) => stream.push(t, weight, value, out),
            TimeStream::Grid(stream) => stream.push(t, weight, value, out),
        }
        Ok(())
    }

    /// Advances to `t` ms, promising that no later input is before `t`. An earlier time changes nothing.
    pub fn advance(&mut self, t: f64, out: &mut Vec<OutputSpike>) {
        if t >= self.now {
            self.now = t;
            match &mut self.clock {
                TimeStream::Continuous(stream) => stream.settle(t, out),
                TimeStream::Grid(stream) => stream.settle(t, out),
            }
        }
    }

    /// The present potential by 6.7 (0 in the refractory time), mV.
    #[must_use]
    pub fn potential(&self) -> f64 {
        let (refractory, value) = match &self.clock {
            TimeStream::Continuous(s) => (&s.threshold, s.potential(self.now)),
            TimeStream::Grid(s) => (&s.threshold, s.potential(self.now)),
        };
        if refractory.is_refractory(self.now) { 0.0 } else { value }
    }
}

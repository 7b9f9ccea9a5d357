//! A neuron on whole trains: its output spikes, and its potential for given output spikes.

use super::kernel::KernelSum;
use super::model::{AfterSpike, Neuron, Time};
use super::points::{MOST_STEPPED, check_points};
use super::streaming::NeuronStream;
use super::threshold::OutputSpike;
use crate::allowed::one_weight_a_train;
use crate::{Result, SpikeKind, SpikeTrains, Stop, problem};

impl Neuron {
    /// Starts the neuron at `start` ms with its threshold multiplied by `threshold`.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter, a weight or the factor is not valid.
    pub fn stream(&self, weights: &[f64], threshold: f64, start: f64) -> Result<NeuronStream> {
        NeuronStream::new(self, weights, threshold, start)
    }

    /// The output spikes to whole trains, from their start to their stop.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter, a weight, the factor or the trains are not valid; `Interrupted` if the caller stops
    /// the run.
    pub fn run(
        &self,
        weights: &[f64],
        trains: &SpikeTrains,
        threshold: f64,
        stop: Stop<'_>,
    ) -> Result<Vec<OutputSpike>> {
        self.check_inputs(weights, trains)?;
        if self.time == Time::Grid {
            check_points(self.points(trains.start, trains.stop), MOST_STEPPED, self.step_ms)?;
        }
        let mut stream = self.stream(weights, threshold, trains.start)?;
        let mut out = Vec::new();
        for (k, spike) in trains.by_time(stop)?.iter().enumerate() {
            if k % 4096 == 0 {
                stop.check()?;
            }
            stream.push(*spike, &mut out)?;
        }
        stream.advance(trains.stop, &mut out);
        Ok(out)
    }

    /// The potential at `times` (ms, ascending), given that the neuron fired at `spikes` (ms, ascending); mV.
    ///
    /// Without spikes this is the linear sum 6.4. With spikes it is 6.7: 0 in the refractory time, then the sum over
    /// the inputs that `after_spike` keeps. At the time of a spike it is the potential before the spike.
    ///
    /// # Errors
    ///
    /// `Problem` if parameters, weights or trains are not valid or times do not ascend; `Interrupted` if the caller
    /// stops the computation.
    pub fn potential(
        &self,
        weights: &[f64],
        trains: &SpikeTrains,
        times: &[f64],
        spikes: &[f64],
        stop: Stop<'_>,
    ) -> Result<Vec<f64>> {
        self.check()?;
        self.check_inputs(weights, trains)?;
        for (name, list) in [("times", times), ("spikes", spikes)] {
            if let Some(k) = list.iter().position(|t| !t.is_finite()) {
                return Err(problem!(name; "[{k}] is {}: must be finite", list[k]));
            }
            if let Some(k) = list.windows(2).position(|w| w[1] < w[0]) {
                return Err(problem!(
                    name; "[{}] is {} ms and comes after {} ms: times must ascend",
                    k + 1,
                    list[k + 1],
                    list[k]
                ));
            }
        }
        potential(self, weights, trains, times, spikes, stop)
    }

    fn check_inputs(&self, weights: &[f64], trains: &SpikeTrains) -> Result<()> {
        trains.check()?;
        if trains.kind == SpikeKind::Signed {
            return Err(problem!("trains"; ": spikes are signed; split them into ON and OFF trains (split_by_sign)"));
        }
        one_weight_a_train(weights, trains.len())
    }
}

/// The potential at ascending `times` of a neuron that fired at ascending `spikes`.
fn potential(
    neuron: &Neuron,
    weights: &[f64],
    trains: &SpikeTrains,
    times: &[f64],
    spikes: &[f64],
    stop: Stop<'_>,
) -> Result<Vec<f64>> {
    let (inputs, shape) = (trains.by_time(stop)?, neuron.shape());
    let (mut state, mut at) = (KernelSum::default(), trains.start);
    let age = |from: f64, to: f64| neuron.ages(trains.start, to)(from);
    let (mut next_input, mut next_spike, mut last, mut done) = (0, 0, None, 0_usize);
    let mut out = Vec::with_capacity(times.len());
    for &t in times {
        // A spike takes effect just after its own time, an input from its own time on; at equal times the spike comes
        // after the input, which still contributes 0.
        loop {
            let spike = spikes.get(next_spike).copied().filter(|&s| s < t);
            let input = inputs.get(next_input).filter(|i| i.t < t && spike.is_none_or(|s| i.t <= s));
            done += 1;
            if done % 4096 == 0 {
                stop.check()?;
            }
            if let Some(input) = input {
                next_input += 1;
                if !neuron.loses(input.t, last) {
                    state = shape.after(state, age(at, input.t));
                    at = input.t;
                    shape.add(&mut state, weights[input.train as usize], f64::from(input.value), 0.0);
                }
            } else if let Some(spike) = spike {
                next_spike += 1;
                last = Some(spike);
                if neuron.after_spike == AfterSpike::Reset {
                    state = KernelSum::default();
                }
            } else {
                break;
            }
        }
        let refractory = last.is_some_and(|s| t <= s + neuron.refractory);
        out.push(if refractory { 0.0 } else { shape.after(state, age(at, t).max(0.0)).b });
    }
    Ok(out)
}

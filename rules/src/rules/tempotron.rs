//! The Tempotron (Gütig and Sompolinsky 2006, Nature Neuroscience 9:420): to fire or not to fire, at whatever time.

use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::crossing;
use super::epoch_learner::{Ended, Trained};
use crate::checks::{check_ungraded, check_untargeted};
use taxel_core::allowed::{Range, one_weight_a_train};
use taxel_core::neuron::{Kernel, KernelSum, Shape, Step};
use taxel_core::parameters::parameters;
use taxel_core::{Result, SpikeTrains, Stop, problem};

parameters! {
    /// Parameters of the Tempotron.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Tempotron {
        /// Membrane time constant, ms.
        pub tau: f64 = 15.0, "ms", Range::ABOVE_0;
        /// Synaptic time constant, ms; `tau / 4` where left out.
        pub tau_s: Option<f64> = None, "ms", Range::ABOVE_0, or tau_s;
        /// Threshold, in peaks of one input of weight 1.
        pub theta_0: f64 = 1.0, "", Range::ABOVE_0;
        /// Learning rate; `3e-3 T / (tau N V0)` where left out, T being the patterns' mean length.
        pub eta: Option<f64> = None, "", Range::ABOVE_0;
        /// Momentum: the share of the last change that is added to the next one.
        pub momentum: f64 = 0.99, "", Range::FROM_0.below(1.0);
        /// Spread of the first weights, drawn normally around 0.
        pub initial_sd: f64 = 1e-3, "", Range::FROM_0;
        /// Epochs at most.
        pub epochs: usize = 2000;
        /// The seed of the first weights and of the order of patterns.
        pub seed: u64 = 0;
        /// The time after which the caller requests the best so far, s; this crate reads no clock.
        pub max_seconds: Option<f64> = None, "s", Range::ABOVE_0;
    }
}

/// How far a pattern drives the neuron; times in ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The largest potential; inputs at or after an output spike are shunted.
    pub v_max: f64,
    /// When it is reached.
    pub t_max: f64,
    /// When the neuron fires, where it does.
    pub t_spike: Option<f64>,
}

/// A pattern's inputs by time, each with the effect of the time up to it.
struct Inputs {
    start: f64,
    stop: f64,
    times: Vec<f64>,
    trains: Vec<usize>,
    steps: Vec<Step>,
}

/// A peak, and up to which input it was made.
struct Reached {
    peak: Peak,
    inputs: usize,
}

impl Tempotron {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.tau_s() >= self.tau {
            return Err(problem!("tau_s"; " is {} ms: must be below tau, {} ms", self.tau_s(), self.tau));
        }
        Ok(())
    }

    fn tau_s(&self) -> f64 {
        self.tau_s.unwrap_or(0.25 * self.tau)
    }

    fn shape(&self) -> Shape {
        Shape::new(Kernel::DoubleExponential, self.tau, self.tau_s())
    }

    fn lay_out(&self, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Inputs> {
        check_ungraded(pattern, "tempotron")?;
        let shape = self.shape();
        let spikes = pattern.by_time(stop)?;
        let mut last = pattern.start;
        let steps = spikes
            .iter()
            .map(|spike| {
                let step = shape.step(spike.t - last);
                last = spike.t;
                step
            })
            .collect();
        Ok(Inputs {
            start: pattern.start,
            stop: pattern.stop,
            times: spikes.iter().map(|s| s.t).collect(),
            trains: spikes.iter().map(|s| s.train as usize).collect(),
            steps,
        })
    }

    /// The highest point of the potential, exactly: between inputs it has one maximum at most, and its time is known.
    fn reach(&self, shape: &Shape, weights: &[f64], events: &Inputs) -> Reached {
        let mut state = KernelSum::default();
        let mut best = Peak { v_max: 0.0, t_max: events.start, t_spike: None };
        for k in 0..=events.times.len() {
            let t = if k == 0 { events.start } else { events.times[k - 1] };
            let last = k == events.times.len();
            let end = if last { events.stop } else { events.times[k] };
            let next = if last { shape.after(state, end - t) } else { events.steps[k].apply(state) };
            if shape.slope(state) > 0.0 {
                let summit = summit(shape, state);
                // Where the next input comes before the maximum, the search goes on from there, unless the neuron has fired.
                let (at, v) = if t + summit < end { (t + summit, shape.after(state, summit).b) } else { (end, next.b) };
                if v > best.v_max {
                    (best.v_max, best.t_max) = (v, at);
                }
                if v >= self.theta_0 {
                    best.t_spike = Some(t + crossing(at - t, |since| shape.after(state, since).b >= self.theta_0));
                    // Later inputs are shunted, so the potential rises on to its maximum.
                    best.t_max = (t + summit).min(events.stop);
                    best.v_max = shape.after(state, best.t_max - t).b;
                    return Reached { peak: best, inputs: k };
                }
            }
            if !last {
                state = next;
                state.a += weights[events.trains[k]];
            }
        }
        Reached { peak: best, inputs: events.times.len() }
    }

    /// The highest point that weights reach on a pattern, and when they fire.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense.
    pub fn peak(&self, weights: &[f64], pattern: &SpikeTrains) -> Result<Peak> {
        self.check()?;
        check_untargeted(pattern)?;
        one_weight_a_train(weights, pattern.len())?;
        Ok(self.reach(&self.shape(), weights, &self.lay_out(pattern, Stop::never())?).peak)
    }

    /// The change of weights by one presentation, over the learning rate: 0 where the neuron is right; else the
    /// potential that each input makes at the peak, added where a spike is missed, taken off where one is false.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense.
    pub fn change(&self, weights: &[f64], pattern: &SpikeTrains, label: bool) -> Result<Vec<f64>> {
        self.check()?;
        check_untargeted(pattern)?;
        one_weight_a_train(weights, pattern.len())?;
        let (shape, events) = (self.shape(), self.lay_out(pattern, Stop::never())?);
        let mut change = vec![0.0; weights.len()];
        let reached = self.reach(&shape, weights, &events);
        if reached.peak.t_spike.is_some() != label {
            self.correct(&shape, &events, &reached, label, &mut change);
        }
        Ok(change)
    }

    fn correct(&self, shape: &Shape, events: &Inputs, reached: &Reached, label: bool, change: &mut [f64]) {
        let sign = if label { 1.0 } else { -1.0 };
        let mut t_max = reached.peak.t_max;
        if reached.peak.v_max <= 0.0 {
            // Never above rest: the peak of the last input (the paper's supplement).
            let kernel_peak = summit(shape, KernelSum { a: 1.0, b: 0.0 });
            t_max = events.times.last().map_or(t_max, |last| last + kernel_peak);
        }
        for (&t, &n) in events.times.iter().zip(&events.trains).take(reached.inputs) {
            if t >= t_max {
                break;
            }
            change[n] += sign * shape.value(t_max - t);
        }
    }

    /// Trains to fire on the patterns whose label is true, and on no other, until an epoch has no error.
    ///
    /// Weights change after each pattern that is wrong; the order is drawn anew each epoch. `report` is given how many
    /// epochs are done and the share of patterns right as they were presented.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, patterns, labels or first weights that make no sense.
    pub fn fit(
        &self,
        patterns: &[SpikeTrains],
        labels: &[bool],
        start: Option<&[f64]>,
        report: &mut dyn FnMut(usize, f64),
        stop: Stop<'_>,
    ) -> Result<Trained> {
        self.check()?;
        check_labelled(patterns, labels)?;
        let trains = patterns[0].len();
        let shape = self.shape();
        let mut random = StdRng::seed_from_u64(self.seed);
        let mut weights: Vec<f64> = match start {
            Some(start) => {
                one_weight_a_train(start, trains)?;
                start.to_vec()
            }
            None => (0..trains).map(|_| self.initial_sd * random.sample::<f64, _>(StandardNormal)).collect(),
        };
        let length = patterns.iter().map(|p| p.stop - p.start).sum::<f64>() / patterns.len() as f64;
        let eta = self.eta.unwrap_or(3e-3 * length / (self.tau * trains as f64 * shape.scale));
        let events = patterns.iter().map(|p| self.lay_out(p, stop)).collect::<Result<Vec<Inputs>>>()?;
        let mut order: Vec<usize> = (0..patterns.len()).collect();
        let (mut change, mut before) = (vec![0.0; trains], vec![0.0; trains]);
        let mut trained = Trained { weights: weights.clone(), right: Vec::new(), best_epoch: 0, ended: Ended::Epochs };
        for epoch in 1..=self.epochs {
            let mut errors = 0;
            order.shuffle(&mut random);
            for &p in &order {
                if stop.asked() {
                    trained.ended = Ended::Stopped;
                    return Ok(trained);
                }
                let reached = self.reach(&shape, &weights, &events[p]);
                if reached.peak.t_spike.is_some() == labels[p] {
                    continue;
                }
                errors += 1;
                change.fill(0.0);
                self.correct(&shape, &events[p], &reached, labels[p], &mut change);
                for n in 0..trains {
                    before[n] = eta * change[n] + self.momentum * before[n];
                    weights[n] += before[n];
                }
            }
            if weights.iter().any(|w| !w.is_finite()) {
                return Err(problem!("eta"; " is {eta}: the weights grew without limit; give a smaller eta"));
            }
            let share = 1.0 - errors as f64 / patterns.len() as f64;
            if trained.right.iter().all(|&r| r <= share) {
                trained.weights.copy_from_slice(&weights);
                trained.best_epoch = epoch;
            }
            trained.right.push(share);
            report(epoch, share);
            if errors == 0 {
                trained.ended = Ended::Right;
                break;
            }
        }
        Ok(trained)
    }
}

/// How long after a state that rises its maximum comes, ms; infinite where it has none.
fn summit(shape: &Shape, state: KernelSum) -> f64 {
    // v = P e^{-s/tau} + (b - P) e^{-s/tau_s}: its slope is 0 where the two decays are in this proportion.
    let slow = shape.scale * state.a;
    let ratio = (slow - state.b) * shape.tau / (slow * shape.tau_s);
    if slow > 0.0 { ratio.ln() / shape.rate } else { f64::INFINITY }
}

fn check_labelled(patterns: &[SpikeTrains], labels: &[bool]) -> Result<()> {
    if patterns.is_empty() {
        return Err(problem!("patterns"; " is empty: must contain one pattern or more"));
    }
    if patterns.len() != labels.len() {
        return Err(problem!("labels"; ": {} for {} patterns; must be one per pattern", labels.len(), patterns.len()));
    }
    for (p, pattern) in patterns.iter().enumerate() {
        taxel_core::learn::check_pattern(p, pattern)?;
        if labels[p] && pattern.times.is_empty() {
            return Err(problem!("pattern {p}: has no spike, so the neuron cannot fire"));
        }
        taxel_core::learn::check_trains(p, pattern, patterns[0].len())?;
    }
    Ok(())
}

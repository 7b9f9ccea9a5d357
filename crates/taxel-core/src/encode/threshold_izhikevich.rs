//! A threshold and two phasic Izhikevich neurons: one receives the thresholded signal, the other its inverse (thesis
//! 3.4.3, 6.5.1).

use serde::{Deserialize, Serialize};

use super::channel_levels::{ChannelLevels, check_levels};
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::periods::micros;
use super::stream::Stream;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, Result, Spike};

/// A threshold and a pair of Izhikevich neurons: +1 about 16 or 20 ms after a taxel reaches a level, -1 after it falls
/// below.
///
/// `v' = 0.04 v^2 + 5 v + 140 - u + I`, `u' = a (b v - u)`; at 30 mV `v` is set to `c` and `u` raised by `d`
/// (Izhikevich 2003). Forward Euler in f64, both equations from the old state, in steps of 0.1 ms: the step is part of
/// the definition, because the latency depends on it. Steps count from the first sample; a spike has the time of its
/// step's end. The ON neuron's input is on while value >= level (f32), the OFF neuron's otherwise; samples are held.
/// Chatter within some 10 ms is suppressed, and a gap in the signal delays the next spike: both are properties of the
/// phasic model. Trains: `taxel * levels + level`, signed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThresholdIzhikevich {
    /// Levels in the sensor's unit, ascending.
    pub levels: Vec<f64>,
    /// One of the two published parameter sets; default that of 6.5.1.
    #[serde(default)]
    pub published: PublishedSet,
    /// The initial state of the neurons; default settled.
    #[serde(default)]
    pub begin: Begin,
    /// Sampling period of events, ms; default 0.1, the step.
    #[serde(default = "super::periods::stamp_period")]
    pub period_ms: f64,
}

/// The published parameter sets; both have b = 0.25, c = -65 mV, d = 6.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum PublishedSet {
    /// Thesis 3.4.3: a = 0.02, I = 0.5; latency 20.2 ms.
    #[serde(rename = "3.4.3")]
    Curvature,
    /// Thesis 6.5.1: a = 0.005, I = 0.6; latency 15.8 ms.
    #[default]
    #[serde(rename = "6.5.1")]
    Gait,
}

impl PublishedSet {
    /// Latency from the input's step to the spike of a settled neuron, ms.
    #[must_use]
    pub fn latency_ms(self) -> f64 {
        match self {
            PublishedSet::Curvature => 20.2,
            PublishedSet::Gait => 15.8,
        }
    }
}

/// The initial state of Izhikevich neurons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Begin {
    /// The state after a constant input equal to the first sample: silent until a value changes.
    #[default]
    Settled,
    /// The resting state without input: each channel fires once at the start, the ON neuron if it is above the level,
    /// otherwise the OFF neuron.
    Rest,
}

impl ThresholdIzhikevich {
    ranges! {
        period_ms: "ms", Range::WHOLE_US;
    }

    /// The parameters with their defaults and ranges.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self::at(vec![]), &["levels"], Self::RANGES)
    }

    /// An encoder with the neurons of 6.5.1 and these levels.
    #[must_use]
    pub fn at(levels: Vec<f64>) -> Self {
        let (published, begin) = (PublishedSet::default(), Begin::default());
        Self { levels, published, begin, period_ms: super::periods::stamp_period() }
    }
}

impl Encoding for ThresholdIzhikevich {
    fn check(&self) -> Result<()> {
        check_levels(&self.levels)?;
        self.check_ranges()
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let channels = Channels::new(array);
        let pairs = Pairs::new(self, channels.len());
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Box::new(Driver::new(pairs, channels, self.trains_of(array), clock)))
    }

    fn trains(&self, array: &Array) -> usize {
        Channels::new(array).len() * self.levels.len()
    }

    fn latency_ms(&self) -> f64 {
        self.published.latency_ms()
    }
}

/// Duration of a step, us.
const STEP: i64 = 100;
const B: f64 = 0.25;
const C: f64 = -65.0;
const D: f64 = 6.0;
const PEAK: f64 = 30.0;

/// One of the two models with its parameters.
#[derive(Clone, Copy)]
struct Model {
    a: f64,
    gain: f64,
    /// Duration of a step, ms.
    dt: f64,
}

impl Model {
    fn published(set: PublishedSet) -> Self {
        let (a, gain) = match set {
            PublishedSet::Curvature => (0.02, 0.5),
            PublishedSet::Gait => (0.005, 0.6),
        };
        Self { a, gain, dt: 0.1 }
    }

    /// v and u at rest without input: the lower root of 0.04 v^2 + (5 - b) v + 140.
    fn rest() -> (f64, f64) {
        let linear = 5.0 - B;
        let v = (-linear - (linear * linear - 4.0 * 0.04 * 140.0).sqrt()) / (2.0 * 0.04);
        (v, B * v)
    }

    #[inline(always)]
    fn step(self, v: f64, u: f64, input: f64) -> (f64, f64) {
        (v + self.dt * (0.04 * v * v + 5.0 * v + 140.0 - u + input), u + self.dt * self.a * (B * v - u))
    }

    /// The fixed point for this input, or the state after 10^6 steps.
    fn steady_state(self, input: f64) -> (f64, f64) {
        let (mut v, mut u) = Self::rest();
        for _ in 0..1_000_000 {
            let (next_v, next_u) = self.step(v, u, input);
            if (next_v, next_u) == (v, u) {
                break;
            }
            (v, u) = if next_v >= PEAK { (C, next_u + D) } else { (next_v, next_u) };
        }
        (v, u)
    }
}

/// Number of neurons that are stepped together.
const LANES: usize = 8;

#[derive(Clone)]
struct IzhikevichNeurons {
    v: [f64; LANES],
    u: [f64; LANES],
    input: [f64; LANES],
    /// Whether a step with this input leaves the state unchanged; such steps are skipped.
    still: bool,
}

impl IzhikevichNeurons {
    /// Computes `steps` steps; calls `fired` with the step and lane of each spike.
    #[inline(always)]
    fn run(&mut self, model: Model, steps: i64, mut fired: impl FnMut(i64, usize)) {
        if self.still || steps <= 0 {
            return;
        }
        for step in 0..steps - 1 {
            self.step(model, step, &mut fired);
        }
        let before = (self.v, self.u);
        self.step(model, steps - 1, &mut fired);
        self.still = before == (self.v, self.u);
    }

    #[inline(always)]
    fn step(&mut self, model: Model, step: i64, fired: &mut impl FnMut(i64, usize)) {
        let mut any = 0_u64;
        for lane in 0..LANES {
            let (v, u) = model.step(self.v[lane], self.u[lane], self.input[lane]);
            (self.v[lane], self.u[lane]) = (v, u);
            any |= u64::from(v >= PEAK);
        }
        if any != 0 {
            for lane in 0..LANES {
                if self.v[lane] >= PEAK {
                    self.v[lane] = C;
                    self.u[lane] += D;
                    fired(step, lane);
                }
            }
        }
    }

    fn set(&mut self, lane: usize, input: f64) {
        if self.input[lane] != input {
            self.input[lane] = input;
            self.still = false;
        }
    }
}

#[derive(Clone)]
struct Pairs {
    model: Model,
    begin: Begin,
    /// The levels, whose crossings switch the inputs.
    levels: ChannelLevels,
    rises: Vec<IzhikevichNeurons>,
    falls: Vec<IzhikevichNeurons>,
    /// The start of the next step, us.
    next: i64,
    /// Spikes of steps that began before the current time and end after it.
    ahead: Vec<Spike>,
}

impl Pairs {
    fn new(parameters: &ThresholdIzhikevich, channels: usize) -> Self {
        let (v, u) = Model::rest();
        let neurons = IzhikevichNeurons { v: [v; LANES], u: [u; LANES], input: [0.0; LANES], still: false };
        let groups = (channels * parameters.levels.len()).div_ceil(LANES);
        let levels: Vec<(f64, f64)> = parameters.levels.iter().map(|&level| (level, level)).collect();
        Self {
            model: Model::published(parameters.published),
            begin: parameters.begin,
            levels: ChannelLevels::new(channels, &levels, 0, 0, None),
            rises: vec![neurons.clone(); groups],
            falls: vec![neurons; groups],
            next: 0,
            ahead: vec![],
        }
    }

    /// Switches the inputs of a pair.
    fn switch(&mut self, train: usize, above: bool) {
        let (group, lane, gain) = (train / LANES, train % LANES, self.model.gain);
        self.rises[group].set(lane, if above { gain } else { 0.0 });
        self.falls[group].set(lane, if above { 0.0 } else { gain });
    }

    /// Computes all steps that begin before `t`.
    #[inline(always)]
    fn step_until(&mut self, t: i64) {
        let steps = (t - self.next + STEP - 1).div_euclid(STEP);
        if steps <= 0 {
            return;
        }
        let first_end = self.next + STEP;
        let ahead = &mut self.ahead;
        for (neurons, value) in [(&mut self.rises, 1.0), (&mut self.falls, -1.0)] {
            for (group, eight) in neurons.iter_mut().enumerate() {
                eight.run(self.model, steps, |step, lane| {
                    let train = (group * LANES + lane) as u32;
                    ahead.push(Spike { t: ms(first_end + step * STEP), train, value });
                });
            }
        }
        self.next += steps * STEP;
    }

    /// Emits the spikes that are due before `t` (with `at_too` also at `t`).
    fn flush(&mut self, t: i64, at_too: bool, out: &mut Vec<Spike>) {
        let end = ms(t);
        out.extend(self.ahead.extract_if(.., |spike| spike.t < end || (at_too && spike.t == end)));
    }
}

impl Rule for Pairs {
    fn begin(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        self.next = now.t;
        self.levels.settle(now.t, now.held, out);
        // Padding lanes after the last train receive no input and stay at rest.
        for train in 0..self.levels.levels.len() {
            self.switch(train, self.levels.levels.is_above(train));
        }
        if self.begin == Begin::Settled {
            let (above, below) = (self.model.steady_state(self.model.gain), self.model.steady_state(0.0));
            for neurons in self.rises.iter_mut().chain(&mut self.falls) {
                for lane in 0..LANES {
                    (neurons.v[lane], neurons.u[lane]) = if neurons.input[lane] > 0.0 { above } else { below };
                }
            }
        }
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        let mut crossed = vec![];
        self.levels.take(now, false, &mut crossed);
        for Spike { train, value, .. } in crossed {
            self.switch(train as usize, value > 0.0);
        }
        self.flush(now.t, true, out);
    }

    #[inline(always)]
    fn pass(&mut self, t: i64, out: &mut Vec<Spike>) {
        self.step_until(t);
        self.flush(t, false, out);
    }

    fn idle(&self) -> bool {
        self.ahead.is_empty() && self.rises.iter().chain(&self.falls).all(|n| n.still)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time from the onset of an input to the resting neuron's first spike, ms.
    fn latency(set: PublishedSet, gain: Option<f64>, dt: f64) -> Option<f64> {
        let published = Model::published(set);
        let model = Model { dt, gain: gain.unwrap_or(published.gain), ..published };
        let (v, u) = Model::rest();
        let mut neurons = IzhikevichNeurons { v: [v; LANES], u: [u; LANES], input: [model.gain; LANES], still: false };
        let mut spikes = vec![];
        neurons.run(model, (500.0 / dt) as i64, |step, lane| spikes.push((step, lane)));
        assert!(spikes.len() <= LANES || gain.is_some(), "a phasic neuron fires once");
        spikes.first().map(|&(step, _)| (step + 1) as f64 * dt)
    }

    #[test]
    fn latencies_are_the_known_ones_at_every_step() {
        for (set, known) in [
            (PublishedSet::Curvature, [(1.0, 23.0), (0.2, 20.6), (0.1, 20.2), (0.05, 20.05), (0.01, 19.92)]),
            (PublishedSet::Gait, [(1.0, 18.0), (0.2, 16.2), (0.1, 15.8), (0.05, 15.7), (0.01, 15.53)]),
        ] {
            for (dt, wanted) in known {
                let got = latency(set, None, dt).unwrap();
                assert!((got - wanted).abs() < 1e-9, "{set:?} at {dt} ms: {got} against {wanted}");
            }
            let stated = latency(set, None, 0.1).unwrap();
            assert!((stated - set.latency_ms()).abs() < 1e-9);
        }
    }

    #[test]
    fn weak_inputs_come_late_or_never() {
        assert_eq!(latency(PublishedSet::Curvature, Some(0.3), 0.1), None);
        assert!(latency(PublishedSet::Curvature, Some(0.4), 0.1).unwrap() > 23.0);
    }

    #[test]
    fn settled_neurons_are_fixed_points_so_that_leaving_steps_out_is_exact() {
        for set in [PublishedSet::Curvature, PublishedSet::Gait] {
            let model = Model::published(set);
            for input in [0.0, model.gain] {
                let (v, u) = model.steady_state(input);
                assert_eq!(model.step(v, u, input), (v, u), "{set:?}, input {input}");
            }
        }
    }

    #[test]
    fn groups_that_are_left_out_while_still_spike_as_single_steps_do() {
        let model = Model::published(PublishedSet::Gait);
        let (v, u) = model.steady_state(0.0);
        let mut grouped = IzhikevichNeurons { v: [v; LANES], u: [u; LANES], input: [0.0; LANES], still: false };
        let mut plain: Vec<(f64, f64)> = vec![(v, u); LANES];
        let (mut got, mut wanted) = (vec![], vec![]);
        for (begin, lane, input) in [(0, 0, 0.0), (400, 3, 0.6), (900, 5, 0.6), (1000, 3, 0.0), (90_000, 0, 0.6)] {
            grouped.set(lane, input);
            let steps = if begin < 90_000 { 500 } else { 1000 };
            grouped.run(model, steps, |step, lane| got.push((begin + step, lane)));
            for step in 0..steps {
                for (lane, (v, u)) in plain.iter_mut().enumerate() {
                    (*v, *u) = model.step(*v, *u, grouped.input[lane]);
                    if *v >= PEAK {
                        (*v, *u) = (C, *u + D);
                        wanted.push((begin + step, lane));
                    }
                }
            }
            assert_eq!(grouped.v.to_vec(), plain.iter().map(|s| s.0).collect::<Vec<_>>());
        }
        assert_eq!(got, wanted);
        assert_eq!(got.len(), 3);
    }
}

//! The rows of the stated problem (6.9, 6.10), identified by pattern and time, and computed on demand.
//!
//! A *row* has the coefficients of one linear function of the weights (the potential at a time, or its slope) and the
//! value that this function must equal or not exceed. After a spike some inputs are lost (`after_spike`); because the
//! spikes of a learning problem are its targets, everything stays linear. The rows are not stored as a table (7.7 GB at
//! 4000 inputs): each is computed from the inputs before its time.
//!
//! In continuous time silence keeps a *tapered margin* below the threshold: `height` mV, decreasing to 0 before a
//! target, at which the potential must reach the threshold. After the target the neuron is unconstrained until the end
//! of its refractory time, from which silence is required at once. On the grid silence is the printed set of points
//! (6.9b), with one margin.

use std::f64::consts::E;

use serde::{Deserialize, Serialize};

use crate::neuron::{AT_EDGE, AfterSpike, FirstThreshold, Grid, Kernel, KernelSum, Neuron, Shape, Time, rounding_ms};
use crate::{Result, Spike, SpikeTrains, Stop, problem};

/// This close before a target, ms, the target's row and its slope row replace rows of silence, whose multipliers would
/// be so large that a proof loses its digits. A neuron that crosses its threshold there fires at the target; the share
/// of `AT_EDGE` is small because an early spike shifts the next ones, through the threshold's rise, by many times more.
const AT_TARGET: f64 = 0.1 * AT_EDGE;
/// A grid's point this close before a target, ms, is the target's own.
const AT_TARGETS_POINT: f64 = 0.99 * AT_EDGE;

/// The identity of a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Row {
    /// The potential at a target equals the threshold (6.9a).
    Target {
        /// The number of the pattern.
        pattern: usize,
        /// The number of the target within the pattern.
        target: usize,
    },
    /// The potential at a time stays below the threshold minus the margin (6.9b).
    Silence {
        /// The number of the pattern.
        pattern: usize,
        /// The time, ms.
        t: f64,
    },
    /// The potential reaches a target from below: its slope exceeds the threshold's slope by that of the margin.
    Slope {
        /// The number of the pattern.
        pattern: usize,
        /// The number of the target within the pattern.
        target: usize,
    },
}

impl Row {
    /// The row as a key: its kind, its pattern, and its target or the bits of its time.
    pub(crate) fn key(self) -> (u8, usize, u64) {
        match self {
            Self::Target { pattern, target } => (0, pattern, target as u64),
            Self::Silence { pattern, t } => (1, pattern, t.to_bits()),
            Self::Slope { pattern, target } => (2, pattern, target as u64),
        }
    }
}

/// A computed row: `coefficients.w = limit` at a target, `<= limit` otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedRow {
    /// One per train: those of the potential at targets and in silence, those of its negated slope in a slope row.
    pub coefficients: Vec<f64>,
    /// The limit, mV; mV/ms in a slope row.
    pub limit: f64,
}

/// The distance that silence keeps below the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Margin {
    /// The distance away from targets, mV.
    pub height: f64,
    /// The slope with which the margin falls to 0 at a target, by which the potential must rise more steeply than the
    /// threshold there, mV/ms; 0 on the grid, where the margin is constant.
    pub slope: f64,
}

impl Margin {
    /// The margin multiplied by `factor`.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { height: factor * self.height, slope: factor * self.slope }
    }
}

/// The end of the silence before a target: far from time 0, neighbouring times are farther apart than `AT_TARGET`.
pub(crate) fn until(target: f64, time: Time) -> f64 {
    let before = match time {
        Time::Continuous => AT_TARGET,
        Time::Grid => AT_TARGETS_POINT,
    };
    (target - before).min(target.next_down())
}

/// The taper of the margin, in the kernel's own family, so that potential and margin together are one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taper {
    shape: Shape,
    /// The state at the target, where the margin is 0 and falls with `slope`.
    end: KernelSum,
    /// The time before the target at which the margin reaches `height`, ms.
    pub(crate) length: f64,
}

impl Taper {
    fn new(shape: Shape, margin: Margin) -> Self {
        if margin.slope == 0.0 {
            return Self { shape, end: KernelSum::default(), length: 0.0 };
        }
        let end = KernelSum { a: -margin.slope / shape.slope(KernelSum { a: 1.0, b: 0.0 }), b: 0.0 };
        // The taper's curve is above its tangent, so it reaches the height within height/slope.
        let (mut low, mut high) = (0.0, margin.height / margin.slope);
        loop {
            let middle = f64::midpoint(low, high);
            if middle <= low || middle >= high {
                break;
            }
            if shape.after(end, -middle).b < margin.height {
                low = middle;
            } else {
                high = middle;
            }
        }
        Self { shape, end, length: high }
    }

    /// The state `x` ms before the target; its potential is the margin at that time.
    pub(crate) fn before(&self, x: f64) -> KernelSum {
        self.shape.after(self.end, -x)
    }
}

/// One pattern with its targets.
#[derive(Debug, Clone)]
pub(crate) struct Example {
    pub(crate) start: f64,
    /// The end of the time in which silence is required, ms.
    pub(crate) end: f64,
    pub(crate) targets: Vec<f64>,
    /// The windows in which silence is required, ms, ascending, ends included; `None`: everywhere.
    pub(crate) silence: Option<Vec<[f64; 2]>>,
    /// The inputs, in order of time.
    pub(crate) inputs: Vec<Spike>,
    /// The age of an input, ms, from which on it is smaller than the rounding of the others.
    pub(crate) forgotten: f64,
    /// The most roundings of a row's coefficient: of a kernel, on a grid of an age, and one for each input of a train.
    pub(crate) roundings: f64,
}

/// The end of silence in pattern `p`, ms: the horizon, or the later of the pattern's stop and its last target + `tau`.
///
/// # Errors
///
/// `Problem` if a target, or the pattern's start, is after the horizon.
fn end_of(neuron: &Neuron, horizon: Option<f64>, p: usize, pattern: &SpikeTrains, targets: &[f64]) -> Result<f64> {
    let last = targets.last();
    let Some(end) = horizon else { return Ok(last.map_or(pattern.stop, |last| pattern.stop.max(last + neuron.tau))) };
    if let Some(last) = last.filter(|last| **last > end) {
        return Err(problem!("pattern {p}: the last target is at {last} ms; must not be after the horizon, {end} ms"));
    }
    if end < pattern.start {
        return Err(problem!(
            "pattern {p}: starts at {} ms; must not start after the horizon, {end} ms",
            pattern.start
        ));
    }
    Ok(end)
}

impl Example {
    /// The inputs before `t`, in order of time.
    pub(super) fn before(&self, t: f64) -> &[Spike] {
        &self.inputs[..self.inputs.partition_point(|i| i.t < t)]
    }

    /// Whether `t` is in a window of silence.
    pub(crate) fn in_window(&self, t: f64) -> bool {
        let Some(windows) = &self.silence else { return true };
        let k = windows.partition_point(|window| window[1] + rounding_ms(t) < t);
        windows.get(k).is_some_and(|window| window[0] - rounding_ms(t) <= t)
    }

    /// The last target before `t`.
    pub(crate) fn last_target_before(&self, t: f64) -> Option<f64> {
        last_before(&self.targets, t)
    }

    /// The first target at or after `t`.
    pub(crate) fn next(&self, t: f64) -> Option<f64> {
        self.targets.get(self.targets.partition_point(|&target| target < t)).copied()
    }
}

/// The last target before `t`.
fn last_before(targets: &[f64], t: f64) -> Option<f64> {
    targets.partition_point(|&target| target < t).checked_sub(1).map(|k| targets[k])
}

/// Whether an input at `s` has no effect at `t`, given that the neuron fired at these targets.
pub(crate) fn is_lost(neuron: &Neuron, targets: &[f64], s: f64, t: f64) -> bool {
    match neuron.after_spike {
        AfterSpike::Keep => false,
        AfterSpike::Ignore => neuron.loses(s, last_before(targets, s)),
        AfterSpike::Reset => neuron.loses(s, last_before(targets, t)),
    }
}

/// The stated problem, from which any row can be computed.
#[derive(Debug, Clone)]
pub struct Statement {
    pub(crate) neuron: Neuron,
    pub(crate) shape: Shape,
    pub(crate) margin: Margin,
    /// The internal unit of potentials, mV.
    pub(crate) unit: f64,
    pub(crate) taper: Taper,
    pub(crate) trains: usize,
    pub(crate) examples: Vec<Example>,
}

impl Statement {
    /// A statement without patterns, for `trains` trains; `unit` is the internal unit of potentials, mV.
    pub(crate) fn new(neuron: &Neuron, margin: Margin, unit: f64, trains: usize) -> Self {
        let shape = neuron.shape();
        let (neuron, taper) = (neuron.clone(), Taper::new(shape, margin));
        Self { neuron, shape, margin, unit, taper, trains, examples: vec![] }
    }

    /// Adds a pattern, number `p` to the caller, who has checked it, and the windows of its silence, if any; its silence
    /// ends at the horizon, ms, if there is one. On an error nothing changes.
    pub(crate) fn push(
        &mut self,
        (p, pattern): (usize, &SpikeTrains),
        targets: &[f64],
        silence: Option<&[[f64; 2]]>,
        horizon: Option<f64>,
        stop: Stop<'_>,
    ) -> Result<()> {
        let end = end_of(&self.neuron, horizon, p, pattern, targets)?;
        let inputs = pattern.by_time(stop)?;
        let (fast, scale) = self.fast_and_scale();
        let ages = if self.neuron.time == Time::Grid { E * (end - pattern.start) / fast } else { 0.0 };
        let most = (0..pattern.len()).map(|n| pattern.train(n).len()).max().unwrap_or(0);
        self.examples.push(Example {
            start: pattern.start,
            end,
            targets: targets.to_vec(),
            silence: silence.map(<[_]>::to_vec),
            forgotten: self.shape.negligible_age() + self.shape.tau * spread(&inputs).ln(),
            roundings: 16.0 + scale + ages + most as f64,
            inputs,
        });
        Ok(())
    }

    /// Removes the first pattern; the others are renumbered from 0.
    pub(crate) fn drop_first(&mut self) {
        self.examples.remove(0);
    }

    /// Removes the last pattern.
    pub(crate) fn drop_last(&mut self) {
        self.examples.pop();
    }

    /// This statement with another margin.
    pub(crate) fn with_margin(&self, margin: Margin) -> Self {
        Self { margin, taper: Taper::new(self.shape, margin), ..self.clone() }
    }

    /// The part of a row's limit that the margin takes, mV (mV/ms in a slope row).
    #[must_use]
    pub fn margin_of(&self, row: Row) -> f64 {
        match row {
            Row::Target { .. } => 0.0,
            Row::Slope { .. } => self.margin.slope,
            Row::Silence { pattern, t } => self.examples.get(pattern).map_or(0.0, |example| self.margin_at(example, t)),
        }
    }

    /// All targets, as (pattern, target).
    pub fn targets(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.examples.iter().enumerate().flat_map(|(p, example)| (0..example.targets.len()).map(move |k| (p, k)))
    }

    /// The time of a row, ms.
    #[must_use]
    pub fn time(&self, row: Row) -> f64 {
        match row {
            Row::Silence { t, .. } => t,
            Row::Target { pattern, target } | Row::Slope { pattern, target } => self.examples[pattern].targets[target],
        }
    }

    /// Computes a row.
    ///
    /// # Errors
    ///
    /// `Problem` if the problem has no such row.
    pub fn state(&self, row: Row) -> Result<StatedRow> {
        let mut coefficients = vec![0.0; self.trains];
        let limit = self.state_into(row, &mut coefficients)?;
        Ok(StatedRow { coefficients, limit })
    }

    /// Computes a row's `coefficients`, one per train, and returns its limit.
    pub(crate) fn state_into(&self, row: Row, coefficients: &mut [f64]) -> Result<f64> {
        self.state_with(row, |state, _| state.b, |state| -self.shape.slope(state), |value| value, coefficients)
    }

    /// The sizes of the terms that rounding of a row's coefficients depends on, without the signs of the inputs' values,
    /// because those of one train may cancel. In continuous time an age is exact to one rounding of itself, on a grid to
    /// some of the whole span.
    pub(crate) fn sizes_into(&self, row: Row, sizes: &mut [f64]) -> Result<()> {
        let ((fast, scale), shape) = (self.fast_and_scale(), self.shape);
        let potential = |state: KernelSum, age: f64| match self.neuron.time {
            Time::Continuous => state.b * (1.0 + age / fast),
            Time::Grid if state.b > 0.0 => shape.largest(),
            Time::Grid => 0.0,
        };
        let slope = |state: KernelSum| scale * state.a * (1.0 / shape.tau + 1.0 / fast) + state.b / fast;
        self.state_with(row, potential, slope, f32::abs, sizes).map(drop)
    }

    /// The shorter time constant of the kernel, ms, and its factor.
    fn fast_and_scale(&self) -> (f64, f64) {
        let Shape { kernel, tau, tau_s, scale, .. } = self.shape;
        if kernel == Kernel::DoubleExponential { (tau_s, scale) } else { (tau, 1.0) }
    }

    fn state_with(
        &self,
        row: Row,
        potential: impl Fn(KernelSum, f64) -> f64,
        slope: impl Fn(KernelSum) -> f64,
        value: impl Fn(f32) -> f32,
        coefficients: &mut [f64],
    ) -> Result<f64> {
        match row {
            Row::Target { pattern, target } => {
                let (example, t) = self.target(pattern, target)?;
                self.sum(example, t, &example.targets[..target], potential, value, coefficients);
                Ok(self.threshold(example, t))
            }
            Row::Slope { pattern, target } => {
                if self.neuron.time == Time::Grid {
                    return Err(problem!(
                        "pattern {pattern}, target {target}: a row of kind slope needs time \"continuous\""
                    ));
                }
                let (example, t) = self.target(pattern, target)?;
                self.sum(example, t, &example.targets[..target], |state, _| slope(state), value, coefficients);
                let falls = (self.threshold(example, t) - self.neuron.theta_0) / self.neuron.tau_rec();
                Ok(falls - self.margin.slope)
            }
            Row::Silence { pattern, t } => {
                let example = self.example(pattern)?;
                self.check_silent(pattern, t)?;
                let fired = example.targets.partition_point(|&target| target < t);
                self.sum(example, t, &example.targets[..fired], potential, value, coefficients);
                Ok(self.threshold(example, t) - self.margin_at(example, t))
            }
        }
    }

    /// The row of B(w) (6.10): the coefficients `delta_t` ms after a target, and the threshold at the target, mV.
    ///
    /// Inputs after the target count: B evaluates the potential as if the neuron had not fired there.
    ///
    /// # Errors
    ///
    /// `Problem` if the problem has no such target.
    pub fn behind(&self, pattern: usize, target: usize, delta_t: f64) -> Result<StatedRow> {
        let mut coefficients = vec![0.0; self.trains];
        let limit = self.behind_into(pattern, target, delta_t, &mut coefficients)?;
        Ok(StatedRow { coefficients, limit })
    }

    /// Computes the row of B in `coefficients`, one per train, and returns the threshold.
    pub(crate) fn behind_into(
        &self,
        pattern: usize,
        target: usize,
        delta_t: f64,
        coefficients: &mut [f64],
    ) -> Result<f64> {
        let (example, t) = self.target(pattern, target)?;
        let t_behind = t + delta_t;
        let earlier = &example.targets[..target];
        self.sum(example, t_behind, earlier, |state, _| state.b, |value| value, coefficients);
        Ok(self.threshold(example, t))
    }

    fn example(&self, pattern: usize) -> Result<&Example> {
        let count = self.examples.len();
        self.examples.get(pattern).ok_or_else(|| problem!("pattern {pattern}: there are only {count} patterns"))
    }

    fn target(&self, pattern: usize, target: usize) -> Result<(&Example, f64)> {
        let example = self.example(pattern)?;
        let count = example.targets.len();
        match example.targets.get(target) {
            Some(&t) => Ok((example, t)),
            None => Err(problem!("pattern {pattern}, target {target}: the pattern has only {count} targets")),
        }
    }

    /// Returns an error unless silence is required at this time.
    fn check_silent(&self, pattern: usize, t: f64) -> Result<()> {
        let example = self.example(pattern)?;
        let Example { start, end, .. } = example;
        let last = if self.neuron.time == Time::Grid { end + rounding_ms(*end) } else { *end };
        if !(*start <= t && t <= last) {
            return Err(problem!("pattern {pattern}: {t} ms is outside the training's time, {start} to {end} ms"));
        }
        if self.neuron.time == Time::Grid && !self.is_point(example, t) {
            return Err(problem!(
                "pattern {pattern}: {t} ms is not on the grid, whose points are {start} ms + k x {} ms",
                self.neuron.step_ms
            ));
        }
        if !self.is_silent(example, t) {
            return Err(problem!(
                "pattern {pattern}: {t} ms is at a target, in its refractory time or outside the windows of silence, so \
                 silence is not required there"
            ));
        }
        Ok(())
    }

    /// Whether two patterns have the same inputs and the same targets before `t`.
    pub(crate) fn is_same_before(&self, t: f64, pattern: usize, second: usize) -> bool {
        let [a, b] = [pattern, second].map(|p| &self.examples[p]);
        let fired = |example: &'_ Example| example.targets.partition_point(|&target| target < t);
        let raised = self.neuron.first_threshold == FirstThreshold::Base || a.start == b.start;
        raised && a.before(t) == b.before(t) && a.targets[..fired(a)] == b.targets[..fired(b)]
    }

    /// Whether silence is required at this time.
    pub(crate) fn is_asked(&self, pattern: usize, t: f64) -> bool {
        self.check_silent(pattern, t).is_ok()
    }

    /// Whether `t` is a point of the grid.
    pub(crate) fn is_point(&self, example: &Example, t: f64) -> bool {
        Grid::new(example.start, self.neuron.step_ms).locate(t).is_point()
    }

    /// Whether `t` is in a window of silence, and neither a target nor in the refractory time after one.
    pub(crate) fn is_silent(&self, example: &Example, t: f64) -> bool {
        example.in_window(t) && self.is_silent_between(example.last_target_before(t), t, example.next(t))
    }

    /// Like `is_silent` whatever the windows, given the last target before `t` and the first one at or after `t`.
    pub(crate) fn is_silent_between(&self, fired: Option<f64>, t: f64, next: Option<f64>) -> bool {
        let free = fired.is_some_and(|target| match self.neuron.time {
            Time::Grid => t <= target + self.neuron.refractory + rounding_ms(t),
            Time::Continuous => t < target + self.neuron.refractory,
        });
        !free && next.is_none_or(|target| t <= until(target, self.neuron.time))
    }

    /// The threshold at `t`, given that the neuron fired at the targets before, mV.
    pub(crate) fn threshold(&self, example: &Example, t: f64) -> f64 {
        self.neuron.theta_0 + self.rise(example, example.last_target_before(t), t)
    }

    /// The remaining threshold rise at `t`, given that the neuron last fired at `fired`, mV.
    pub(crate) fn rise(&self, example: &Example, fired: Option<f64>, t: f64) -> f64 {
        let printed = (self.neuron.first_threshold == FirstThreshold::Printed).then_some(example.start);
        self.neuron.rise(fired.or(printed), t)
    }

    /// The margin at `t`, mV.
    pub(crate) fn margin_at(&self, example: &Example, t: f64) -> f64 {
        match example.next(t) {
            Some(target) if target - t <= self.taper.length => self.taper.before(target - t).b,
            _ => self.margin.height,
        }
    }

    /// Sums `part` of the kernels' states and ages at `t` by train over the inputs before `t`, given spikes at the `earlier`
    /// targets only.
    fn sum(
        &self,
        example: &Example,
        t: f64,
        earlier: &[f64],
        part: impl Fn(KernelSum, f64) -> f64,
        value: impl Fn(f32) -> f32,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        let inputs = example.before(t);
        let age = self.neuron.ages(example.start, t);
        let from = inputs.partition_point(|i| i.t < t - example.forgotten);
        let (mut at, mut state) = (f64::NAN, 0.0);
        for input in &inputs[from..] {
            // With times in whole ms, many inputs share a time: the exponential is computed once per time.
            if input.t != at {
                at = input.t;
                state = if is_lost(&self.neuron, earlier, at, t) {
                    0.0
                } else {
                    part(self.shape.after(self.shape.input(), age(at)), age(at))
                };
            }
            out[input.train as usize] += f64::from(value(input.value)) * state;
        }
    }
}

/// How many times the largest value of the inputs is the smallest, both without sign; 1 of unsigned inputs.
fn spread(inputs: &[Spike]) -> f64 {
    let ends = inputs.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), input| {
        let size = f64::from(input.value).abs();
        (least.min(size), most.max(size))
    });
    if ends.1 > 0.0 { ends.1 / ends.0 } else { 1.0 }
}

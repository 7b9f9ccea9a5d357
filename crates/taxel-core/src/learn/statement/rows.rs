//! The rows of the stated problem (6.9, 6.10), named by pattern and time, written out on demand.
//!
//! A *row* holds the coefficients of the weights in one linear function of them (the potential at a time, or its slope), and
//! what it must equal or not exceed. After a spike some inputs are lost (`after_spike`); as the spikes of a learning problem
//! are its targets, everything stays linear. No table of all rows exists (7.7 GB at 4000 inputs): a row is summed up from the
//! inputs before it.
//!
//! In continuous time silence keeps a *tapered margin* below the threshold: `height` mV, and from some time before a target on
//! less and less, as the potential has to come up to the threshold there; behind it the neuron is free until the end of its
//! refractory time, where silence begins at once. On the grid it is the printed set of points (6.9b), with one margin for all.

use serde::{Deserialize, Serialize};

use crate::neuron::{AT_EDGE, AfterSpike, FirstThreshold, Grid, KernelSum, Neuron, Shape, Time, rounding_ms};
use crate::{Result, SpikeTrains, Stop, problem};

/// From so near a target on the target's row and its slope row stand for silence, ms: rows of silence nearer than that are
/// parallel to the target's to rounding. A neuron that crosses its threshold there fires at the target.
const AT_TARGET: f64 = 0.99 * AT_EDGE;

/// The name of a row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Row {
    /// The potential at a target equals the threshold (6.9a).
    Target {
        /// Which pattern.
        pattern: usize,
        /// Which of its targets.
        target: usize,
    },
    /// The potential at a time stays below the threshold, less the margin (6.9b).
    Silence {
        /// Which pattern.
        pattern: usize,
        /// When, ms.
        t: f64,
    },
    /// The potential comes up to a target from below: its slope exceeds the threshold's by that of the margin.
    Slope {
        /// Which pattern.
        pattern: usize,
        /// Which of its targets.
        target: usize,
    },
}

/// A row written out: `coefficients.w = limit` at a target, `<= limit` else.
#[derive(Debug, Clone, PartialEq)]
pub struct Stated {
    /// One a train: at a target and in silence those of the potential, in a slope row those of its slope, negated.
    pub coefficients: Vec<f64>,
    /// mV; mV/ms in a slope row.
    pub limit: f64,
}

/// How far below the threshold silence stays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Margin {
    /// Away from targets, mV.
    pub height: f64,
    /// How steeply it falls to 0 at a target, hence how much more steeply than the threshold the potential rises there, mV/ms;
    /// 0 on the grid, where nothing tapers.
    pub slope: f64,
}

impl Margin {
    /// This margin, times a factor.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { height: factor * self.height, slope: factor * self.slope }
    }
}

/// The end of the silence before a target: far from time 0 neighbouring times are farther apart than `AT_TARGET`.
pub(crate) fn until(target: f64) -> f64 {
    (target - AT_TARGET).min(target.next_down())
}

/// The taper: in the kernel's own family, so that potential and margin together are one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taper {
    shape: Shape,
    /// The state at the target, which is 0 there and falls with `slope`.
    end: KernelSum,
    /// Where it reaches `height`, ms before the target.
    pub(crate) length: f64,
}

impl Taper {
    fn new(shape: Shape, margin: Margin) -> Self {
        if margin.slope == 0.0 {
            return Self { shape, end: KernelSum::default(), length: 0.0 };
        }
        let end = KernelSum { a: -margin.slope / shape.slope(KernelSum { a: 1.0, b: 0.0 }), b: 0.0 };
        // The family lies above its tangent, so its height is reached within height/slope.
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

    /// The state `x` ms before the target; its potential is the margin there.
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
    /// Time (ms) and train, by time.
    pub(crate) inputs: Vec<(f64, u32)>,
}

/// Where silence ends in pattern `p`, ms: at the horizon, or at the later of its stop and its last target + `tau`.
///
/// # Errors
///
/// `Problem` where a target, or the pattern's start, lies behind the horizon.
pub(crate) fn end_of(
    neuron: &Neuron,
    horizon: Option<f64>,
    p: usize,
    pattern: &SpikeTrains,
    targets: &[f64],
) -> Result<f64> {
    let last = targets.last();
    let Some(end) = horizon else { return Ok(last.map_or(pattern.stop, |last| pattern.stop.max(last + neuron.tau))) };
    if let Some(last) = last.filter(|last| **last > end) {
        return Err(problem!("pattern {p}: last target at {last} ms, the horizon is {end} ms"));
    }
    if end < pattern.start {
        return Err(problem!("pattern {p}: starts at {} ms, the horizon is {end} ms", pattern.start));
    }
    Ok(end)
}

impl Example {
    /// The inputs before `t`, by time.
    fn before(&self, t: f64) -> &[(f64, u32)] {
        &self.inputs[..self.inputs.partition_point(|i| i.0 < t)]
    }

    /// The last target before `t`.
    pub(crate) fn fired(&self, t: f64) -> Option<f64> {
        last_before(&self.targets, t)
    }

    /// The first target at `t` or later.
    pub(crate) fn next(&self, t: f64) -> Option<f64> {
        self.targets.get(self.targets.partition_point(|&target| target < t)).copied()
    }
}

/// The last target before `t`.
fn last_before(targets: &[f64], t: f64) -> Option<f64> {
    targets.partition_point(|&target| target < t).checked_sub(1).map(|k| targets[k])
}

/// Whether an input at `s` no longer counts at `t`, the neuron having fired at these targets.
pub(crate) fn lost(neuron: &Neuron, targets: &[f64], s: f64, t: f64) -> bool {
    match neuron.after_spike {
        AfterSpike::Keep => false,
        AfterSpike::Ignore => neuron.loses(s, last_before(targets, s)),
        AfterSpike::Reset => neuron.loses(s, last_before(targets, t)),
    }
}

/// The problem, ready to state any row.
#[derive(Debug, Clone)]
pub struct Statement {
    pub(crate) neuron: Neuron,
    pub(crate) shape: Shape,
    pub(crate) margin: Margin,
    /// What a potential of 1 in here is, mV.
    pub(crate) unit: f64,
    pub(crate) taper: Taper,
    pub(crate) trains: usize,
    pub(crate) examples: Vec<Example>,
}

impl Statement {
    /// Of no pattern yet, for so many trains; what a potential of 1 in here is, is `unit` mV.
    pub(crate) fn new(neuron: &Neuron, margin: Margin, unit: f64, trains: usize) -> Self {
        let shape = neuron.shape();
        let (neuron, taper) = (neuron.clone(), Taper::new(shape, margin));
        Self { neuron, shape, margin, unit, taper, trains, examples: vec![] }
    }

    /// Adds one more pattern, which has been checked, and where silence ends in it, ms; where the caller stops it, all is as before.
    pub(crate) fn push(&mut self, pattern: &SpikeTrains, targets: &[f64], end: f64, stop: Stop<'_>) -> Result<()> {
        let spikes = pattern.by_time(stop)?;
        self.examples.push(Example {
            start: pattern.start,
            end,
            targets: targets.to_vec(),
            inputs: spikes.iter().map(|s| (s.t, s.train)).collect(),
        });
        Ok(())
    }

    /// Removes the first pattern; the others are numbered anew from 0.
    pub(crate) fn drop_first(&mut self) {
        self.examples.remove(0);
    }

    /// Removes the last pattern.
    pub(crate) fn drop_last(&mut self) {
        self.examples.pop();
    }

    /// The same with another margin.
    pub(crate) fn with_margin(&self, margin: Margin) -> Self {
        Self { margin, taper: Taper::new(self.shape, margin), ..self.clone() }
    }

    /// What the margin takes off a row's limit, mV (mV/ms in a slope row).
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

    /// When a row's time is, ms.
    #[must_use]
    pub fn time(&self, row: Row) -> f64 {
        match row {
            Row::Silence { t, .. } => t,
            Row::Target { pattern, target } | Row::Slope { pattern, target } => self.examples[pattern].targets[target],
        }
    }

    /// Writes a row out.
    ///
    /// # Errors
    ///
    /// `Problem` where the problem has no such row.
    pub fn state(&self, row: Row) -> Result<Stated> {
        let mut coefficients = vec![0.0; self.trains];
        let limit = self.state_into(row, &mut coefficients)?;
        Ok(Stated { coefficients, limit })
    }

    /// Writes a row out into `coefficients`, one a train; gives its limit.
    pub(crate) fn state_into(&self, row: Row, coefficients: &mut [f64]) -> Result<f64> {
        match row {
            Row::Target { pattern, target } => {
                let (example, t) = self.target(pattern, target)?;
                self.sum(example, t, &example.targets[..target], |state| state.b, coefficients);
                Ok(self.threshold(example, t))
            }
            Row::Slope { pattern, target } => {
                if self.neuron.time == Time::Grid {
                    return Err(problem!(
                        "pattern {pattern}, target {target}: a slope is asked for in continuous time only"
                    ));
                }
                let (example, t) = self.target(pattern, target)?;
                let slope = |state| -self.shape.slope(state);
                self.sum(example, t, &example.targets[..target], slope, coefficients);
                let falls = (self.threshold(example, t) - self.neuron.theta_0) / self.neuron.tau_rec();
                Ok(falls - self.margin.slope)
            }
            Row::Silence { pattern, t } => {
                let example = self.example(pattern)?;
                self.check_silent(pattern, t)?;
                let fired = example.targets.partition_point(|&target| target < t);
                self.sum(example, t, &example.targets[..fired], |state| state.b, coefficients);
                Ok(self.threshold(example, t) - self.margin_at(example, t))
            }
        }
    }

    /// The row of B(w) (6.10): the coefficients `delta_t` ms after a target, and the threshold at the target, mV.
    ///
    /// Inputs after the target count: B takes the potential as it would be, had the neuron not fired there.
    ///
    /// # Errors
    ///
    /// `Problem` where the problem has no such target.
    pub fn behind(&self, pattern: usize, target: usize, delta_t: f64) -> Result<Stated> {
        let mut coefficients = vec![0.0; self.trains];
        let limit = self.behind_into(pattern, target, delta_t, &mut coefficients)?;
        Ok(Stated { coefficients, limit })
    }

    /// Writes that out into `coefficients`, one a train; gives the threshold.
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
        self.sum(example, t_behind, earlier, |state| state.b, coefficients);
        Ok(self.threshold(example, t))
    }

    fn example(&self, pattern: usize) -> Result<&Example> {
        let there = self.examples.len();
        self.examples.get(pattern).ok_or_else(|| problem!("pattern {pattern}: there are {there}"))
    }

    fn target(&self, pattern: usize, target: usize) -> Result<(&Example, f64)> {
        let example = self.example(pattern)?;
        let there = example.targets.len();
        match example.targets.get(target) {
            Some(&t) => Ok((example, t)),
            None => Err(problem!("pattern {pattern}, target {target}: the pattern has {there} targets")),
        }
    }

    /// Checks that silence is required at this time.
    fn check_silent(&self, pattern: usize, t: f64) -> Result<()> {
        let example = self.example(pattern)?;
        let Example { start, end, .. } = example;
        let last = if self.neuron.time == Time::Grid { end + rounding_ms(*end) } else { *end };
        if !(*start <= t && t <= last) {
            return Err(problem!("pattern {pattern}: {t} ms lies outside of what is asked for, {start} to {end} ms"));
        }
        if self.neuron.time == Time::Grid && !self.is_point(example, t) {
            return Err(problem!(
                "pattern {pattern}: {t} ms is no point of the grid, {start} + k {} ms",
                self.neuron.step_ms
            ));
        }
        if !self.is_silent(example, t) {
            return Err(problem!(
                "pattern {pattern}: {t} ms lies at a target or in its refractory time, nothing is asked there"
            ));
        }
        Ok(())
    }

    /// Whether two patterns hold the same up to `t`: inputs, and targets that the neuron fires at.
    pub(crate) fn is_same_before(&self, t: f64, pattern: usize, other: usize) -> bool {
        let [a, b] = [pattern, other].map(|p| &self.examples[p]);
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
        Grid::new(example.start, self.neuron.step_ms).place(t).is_point()
    }

    /// Whether `t` lies neither at a target nor in the refractory time behind it.
    pub(crate) fn is_silent(&self, example: &Example, t: f64) -> bool {
        self.is_silent_between(example.fired(t), t, example.next(t))
    }

    /// The same of a time between the last target before it and the first one not before it.
    pub(crate) fn is_silent_between(&self, fired: Option<f64>, t: f64, next: Option<f64>) -> bool {
        let free = fired.is_some_and(|target| match self.neuron.time {
            Time::Grid => t <= target + self.neuron.refractory + rounding_ms(t),
            Time::Continuous => t < target + self.neuron.refractory,
        });
        !free && next.is_none_or(|target| t <= until(target))
    }

    /// The threshold at `t`, the neuron having fired at the targets before, mV.
    pub(crate) fn threshold(&self, example: &Example, t: f64) -> f64 {
        self.neuron.theta_0 + self.rise(example, example.fired(t), t)
    }

    /// What is left at `t` of the threshold's rise, the neuron having last fired at `fired`, mV.
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

    /// Adds up, by train, what `part` gives at `t` of the inputs before, the neuron having fired at `earlier` targets only.
    fn sum(&self, example: &Example, t: f64, earlier: &[f64], part: impl Fn(KernelSum) -> f64, out: &mut [f64]) {
        out.fill(0.0);
        let inputs = example.before(t);
        let age = self.neuron.ages(example.start, t);
        let from = inputs.partition_point(|i| i.0 < t - self.shape.forgotten());
        let (mut at, mut one) = (f64::NAN, 0.0);
        for &(s, train) in &inputs[from..] {
            // Many inputs share a time where times are whole ms: an exponential a time, not an input.
            if s != at {
                at = s;
                one = if lost(&self.neuron, earlier, s, t) {
                    0.0
                } else {
                    part(self.shape.after(self.shape.input(), age(s)))
                };
            }
            out[train as usize] += one;
        }
    }
}

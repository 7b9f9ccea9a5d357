//! SKIM, the synaptic kernel inverse method (Tapson et al. 2013, Frontiers in Neuroscience 7:153): least squares from
//! filtered inputs to a pulse at each target.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::allowed::{above_0, at_least_0, one_weight_a_train};
use crate::neuron::{Kernel, Neuron, Shape, State};
use crate::vectors::dot;
use crate::{Result, SpikeTrains, Stop, problem};

/// Rows that are laid out at once: few enough for the cache, many enough to be worth a reflection each.
const BLOCK: usize = 512;

/// A wide layer of dendritic branches between inputs and output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Branches {
    /// How many.
    pub count: usize,
    /// Their fixed weights are drawn evenly from minus this to this.
    pub spread: f64,
    /// Their fixed delays are drawn evenly from 0 to this, ms.
    pub delay_ms: f64,
    /// Whether `tanh` compresses what comes out of their kernels.
    pub tanh: bool,
}

/// Parameters of SKIM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skim {
    /// What an input does.
    pub kernel: Kernel,
    /// Its time constant, ms.
    pub tau: f64,
    /// Its second one, ms, where it has one; `tau / 4` where left out.
    pub tau_s: Option<f64>,
    /// Time between rows, ms.
    pub step_ms: f64,
    /// The layer between; without one every train is a branch of its own, its kernel not compressed.
    pub branches: Option<Branches>,
    /// How long the wanted output is 1 from a target on, ms.
    pub pulse_ms: f64,
    /// Added to the sum of squares, times the squares of the weights.
    pub ridge: f64,
    /// Of weights and delays of the layer.
    pub seed: u64,
}

/// A least-squares problem, brought to triangular form: of all rows `A w ~ y` it keeps `R w ~ z`, with the same solutions.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `R`, row after row, and `z`, the last column, with what no weights reach in the last row.
    entries: Vec<f64>,
    columns: usize,
    /// How many rows there were.
    pub rows: usize,
}

impl Normal {
    fn new(columns: usize) -> Self {
        Self { entries: vec![0.0; (columns + 1) * (columns + 1)], columns, rows: 0 }
    }

    /// `R`, upper triangular, row after row.
    #[must_use]
    pub fn r(&self) -> Vec<f64> {
        let m = self.columns;
        (0..m).flat_map(|j| self.entries[j * (m + 1)..j * (m + 1) + m].iter().copied()).collect()
    }

    /// `z`.
    #[must_use]
    pub fn z(&self) -> Vec<f64> {
        let m = self.columns;
        (0..m).map(|j| self.entries[j * (m + 1) + m]).collect()
    }

    /// The sum of squares that no weights can lessen.
    #[must_use]
    pub fn rest(&self) -> f64 {
        self.entries.last().map_or(0.0, |last| last * last)
    }

    /// Takes in rows, columns first, the wanted output as the last column; Householder's reflections of each column.
    ///
    /// Squares of the entries are never formed, so half of the digits that normal equations lose are kept.
    fn take(&mut self, block: &mut [Vec<f64>]) {
        let width = self.columns + 1;
        self.rows += block[0].len();
        for j in 0..width {
            let (head, rest) = block.split_at_mut(j + 1);
            let column = &head[j];
            let below = dot(column, column);
            if below == 0.0 {
                continue;
            }
            let top = self.entries[j * width + j];
            let length = (top * top + below).sqrt();
            let reflected = if top > 0.0 { -length } else { length };
            let first = top - reflected;
            let scale = 2.0 / (first * first + below);
            self.entries[j * width + j] = reflected;
            for (k, other) in rest.iter_mut().enumerate() {
                let above = &mut self.entries[j * width + j + 1 + k];
                let share = scale * (first * *above + dot(column, other));
                *above -= share * first;
                for (o, c) in other.iter_mut().zip(column) {
                    *o -= share * c;
                }
            }
        }
    }
}

/// One branch on its way through a pattern: what comes in, and its kernel's state.
struct Branch {
    /// ms and weight, by time.
    inputs: Vec<(f64, f64)>,
    next: usize,
    state: State,
}

impl Skim {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        above_0("tau", self.tau, "ms")?;
        above_0("tau_s", self.tau_s(), "ms")?;
        if self.kernel == Kernel::DoubleExponential && self.tau_s() >= self.tau {
            return Err(problem!("tau_s is {} ms: must lie below tau, {} ms", self.tau_s(), self.tau));
        }
        above_0("step_ms", self.step_ms, "ms")?;
        above_0("pulse_ms", self.pulse_ms, "ms")?;
        at_least_0("ridge", self.ridge, "")?;
        if let Some(branches) = &self.branches {
            if !(1..=100_000).contains(&branches.count) {
                return Err(problem!("branches is {}: must lie between 1 and 100000", branches.count));
            }
            above_0("spread", branches.spread, "")?;
            at_least_0("delay_ms", branches.delay_ms, "ms")?;
        }
        Ok(())
    }

    fn tau_s(&self) -> f64 {
        self.tau_s.unwrap_or(0.25 * self.tau)
    }

    /// How many output weights there are, for so many trains.
    #[must_use]
    pub fn columns(&self, trains: usize) -> usize {
        self.branches.as_ref().map_or(trains, |b| b.count)
    }

    /// The branches of a pattern, each with its own inputs; weights and delays come from the seed alone.
    fn branches(&self, pattern: &SpikeTrains) -> Vec<Branch> {
        let branch = |inputs| Branch { inputs, next: 0, state: State::default() };
        let Some(layer) = &self.branches else {
            return (0..pattern.len()).map(|n| branch(pattern.train(n).iter().map(|&t| (t, 1.0)).collect())).collect();
        };
        let mut random = StdRng::seed_from_u64(self.seed);
        let spikes = pattern.by_time();
        (0..layer.count)
            .map(|_| {
                let weights: Vec<f64> =
                    (0..pattern.len()).map(|_| layer.spread * (2.0 * random.random::<f64>() - 1.0)).collect();
                let delay = layer.delay_ms * random.random::<f64>();
                branch(spikes.iter().map(|s| (s.t + delay, weights[s.train as usize])).collect())
            })
            .collect()
    }

    /// Walks a pattern block by block of rows: what each branch puts out, columns first, from row `first` on.
    fn walk(
        &self,
        pattern: &SpikeTrains,
        stop: Stop<'_>,
        mut tell: impl FnMut(usize, &mut Vec<Vec<f64>>),
    ) -> Result<()> {
        let shape = Shape::new(self.kernel, self.tau, self.tau_s());
        let step = shape.step(self.step_ms);
        let compress = self.branches.as_ref().is_some_and(|b| b.tanh);
        let mut branches = self.branches(pattern);
        let rows = ((pattern.stop - pattern.start) / self.step_ms + 1e-9).floor() as usize + 1;
        let mut block: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK); branches.len()];
        for first in (0..rows).step_by(BLOCK) {
            stop.check()?;
            let last = (first + BLOCK).min(rows);
            for (branch, column) in branches.iter_mut().zip(&mut block) {
                column.clear();
                for row in first..last {
                    let t = pattern.start + row as f64 * self.step_ms;
                    if row > 0 {
                        branch.state = step.apply(branch.state);
                    }
                    while let Some(&(at, weight)) = branch.inputs.get(branch.next).filter(|i| i.0 <= t + 1e-9) {
                        shape.add(&mut branch.state, weight, (t - at).max(0.0));
                        branch.next += 1;
                    }
                    column.push(if compress { branch.state.b.tanh() } else { branch.state.b });
                }
            }
            block.truncate(branches.len());
            tell(first, &mut block);
        }
        Ok(())
    }

    /// The least-squares problem of these examples, in triangular form; memory does not grow with the patterns' length.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, patterns or targets that make no sense; `Interrupted` where the caller stops it.
    pub fn reduce(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Normal> {
        self.check()?;
        crate::learn::check_examples(&Neuron { refractory: 0.0, ..Neuron::default() }, patterns, targets)?;
        let columns = self.columns(patterns[0].len());
        let mut normal = Normal::new(columns);
        for (pattern, targets) in patterns.iter().zip(targets) {
            let mut wanted = Vec::with_capacity(BLOCK);
            self.walk(pattern, stop, |first, block| {
                wanted.clear();
                wanted.extend((first..first + block[0].len()).map(|row| {
                    let t = pattern.start + row as f64 * self.step_ms;
                    let come = targets.partition_point(|&at| at <= t + 1e-9);
                    let on = come > 0 && t < targets[come - 1] + self.pulse_ms - 1e-9;
                    if on { 1.0 } else { 0.0 }
                }));
                block.push(std::mem::take(&mut wanted));
                normal.take(block);
                wanted = block.pop().unwrap_or_default();
            })?;
        }
        if self.ridge > 0.0 {
            let rows = normal.rows;
            let root = self.ridge.sqrt();
            let mut block: Vec<Vec<f64>> =
                (0..=columns).map(|j| (0..columns).map(|k| if j == k { root } else { 0.0 }).collect()).collect();
            normal.take(&mut block);
            normal.rows = rows;
        }
        Ok(normal)
    }

    /// The rows of one pattern as they stand in the problem, row after row: for tests and for looking at.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or a pattern that make no sense; `Interrupted` where the caller stops it.
    pub fn rows(&self, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        crate::learn::check_heard(pattern)?;
        let mut out = Vec::new();
        self.walk(pattern, stop, |_, block| {
            for row in 0..block[0].len() {
                out.extend(block.iter().map(|column| column[row]));
            }
        })?;
        Ok(out)
    }

    /// The output at each row's time.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense; `Interrupted` where the caller stops it.
    pub fn output(&self, weights: &[f64], pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        crate::learn::check_heard(pattern)?;
        one_weight_a_train(weights, self.columns(pattern.len()))?;
        let mut out = Vec::new();
        self.walk(pattern, stop, |_, block| {
            let first = out.len();
            out.resize(first + block[0].len(), 0.0);
            for (column, w) in block.iter().zip(weights) {
                for (o, c) in out[first..].iter_mut().zip(column) {
                    *o += w * c;
                }
            }
        })?;
        Ok(out)
    }
}

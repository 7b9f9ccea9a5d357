//! SKIM, the synaptic kernel inverse method (Tapson et al. 2013, Frontiers in Neuroscience 7:153): least squares from
//! filtered inputs to a pulse at each target.

use faer::{Mat, MatRef};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::batch::{BatchRule, Learnt};
use crate::checks::{check_ungraded, check_untargeted};
use taxel_core::allowed::{Range, one_weight_a_train};
use taxel_core::metrics::matching::match_spikes;
use taxel_core::neuron::{Grid, Kernel, KernelSum, MOST_LAID_OUT, Shape, check_points};
use taxel_core::parameters::parameters;
use taxel_core::vectors::dot;
use taxel_core::{Result, SpikeTrains, Stop, problem};

/// Rows of a block: few enough for the cache, many enough to amortise a reflection.
const BLOCK: usize = 512;

/// The nonlinearity of a branch, after its kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Nonlinearity {
    /// tanh.
    #[default]
    Tanh,
    /// None.
    None,
}

/// A wide layer of dendritic branches between inputs and output.
struct Layer {
    count: usize,
    spread: f64,
    delay_ms: f64,
}

parameters! {
    /// Parameters of SKIM.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Skim {
        /// The kernel of a branch, which filters its inputs.
        pub kernel: Kernel = Kernel::Alpha;
        /// Its time constant, ms; that of Table 6.1.
        pub tau: f64 = 15.0, "ms", Range::ABOVE_0;
        /// Its second one, ms, where it has one; `tau / 4` where left out.
        pub tau_s: Option<f64> = None, "ms", Range::ABOVE_0, or tau_s;
        /// Time between rows, ms; 1 as the thesis samples.
        pub step_ms: f64 = 1.0, "ms", Range::ABOVE_0;
        /// How long the wanted output is 1 from a target on, ms; ten steps of 1 ms.
        pub pulse_ms: f64 = 10.0, "ms", Range::ABOVE_0;
        /// Added to the sum of squares, times the squares of the weights.
        pub ridge: f64 = 0.0, "", Range::FROM_0;
        /// How many branches the layer between has; without one every train is a branch of its own, its kernel not
        /// compressed.
        pub branches: Option<usize> = None, "", Range::within(1.0, 100_000.0);
        /// The layer's fixed weights are drawn evenly from minus this to this; none was published.
        pub spread: Option<f64> = None, "", Range::ABOVE_0;
        /// Its fixed delays are drawn evenly from 0 to this, ms; none was published.
        pub delay_ms: Option<f64> = None, "ms", Range::FROM_0;
        /// The nonlinearity after its kernels.
        pub nonlinearity: Nonlinearity = Nonlinearity::Tanh;
        /// The thresholds to choose from; those of 6.5.4.
        pub thresholds: Vec<f64> = vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], "", Range::FINITE;
        /// How far from a target an output spike may lie, ms; 50 as in 6.5.2.
        pub within_ms: f64 = 50.0, "ms", Range::ABOVE_0;
        /// The seed of weights and delays of the layer.
        pub seed: u64 = 0;
    }
}

/// A least-squares problem, brought to triangular form: of all rows `A w ~ y` it keeps `R w ~ z`, with the same solutions.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `R`, row after row, and `z`, the last column, with the residual in the last row.
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

    /// The least sum of squares over all weights.
    #[must_use]
    pub fn rest(&self) -> f64 {
        self.entries.last().map_or(0.0, |last| last * last)
    }

    /// The shortest weights of the least sum of squares, and that sum.
    ///
    /// By singular values, as `numpy.linalg.lstsq` with `rcond=None`: those below rounding times the largest count as
    /// 0.
    fn solve(&self) -> Result<(Vec<f64>, f64)> {
        let (m, r, z) = (self.columns, self.r(), self.z());
        let r = MatRef::from_row_major_slice(&r, m, m);
        let z = Mat::from_fn(m, 1, |j, _| z[j]);
        let svd =
            r.thin_svd().map_err(|_| problem!("the singular values of these patterns' rows cannot be computed"))?;
        let values = svd.S().column_vector();
        let least = f64::EPSILON * m as f64 * values.iter().copied().fold(0.0, f64::max);
        let mut along = svd.U().transpose() * &z;
        for (k, &value) in values.iter().enumerate() {
            along[(k, 0)] = if value > least { along[(k, 0)] / value } else { 0.0 };
        }
        let weights = svd.V() * &along;
        let off = r * &weights - &z;
        let rest = self.rest() + (0..m).map(|j| off[(j, 0)] * off[(j, 0)]).sum::<f64>();
        Ok(((0..m).map(|j| weights[(j, 0)]).collect(), rest))
    }

    /// Adds rows, columns first, the wanted output as the last column, by Householder reflections of each column.
    ///
    /// Squares of the entries are never formed, so that no digits are lost as by normal equations.
    fn add_rows(&mut self, block: &mut [Vec<f64>]) {
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
            for (k, later) in rest.iter_mut().enumerate() {
                let above = &mut self.entries[j * width + j + 1 + k];
                let share = scale * (first * *above + dot(column, later));
                *above -= share * first;
                for (o, c) in later.iter_mut().zip(column) {
                    *o -= share * c;
                }
            }
        }
    }
}

/// One branch while a pattern is run: its inputs, and its kernel's state.
struct Branch {
    /// ms and weight, by time.
    inputs: Vec<(f64, f64)>,
    next: usize,
    state: KernelSum,
}

impl Skim {
    fn layer(&self) -> Option<Layer> {
        let (Some(count), Some(spread), Some(delay_ms)) = (self.branches, self.spread, self.delay_ms) else {
            return None;
        };
        Some(Layer { count, spread, delay_ms })
    }

    fn tau_s(&self) -> f64 {
        self.tau_s.unwrap_or(0.25 * self.tau)
    }

    /// How many output weights there are, for so many trains.
    #[must_use]
    pub fn columns(&self, trains: usize) -> usize {
        self.branches.unwrap_or(trains)
    }

    /// The branches of a pattern, each with its own inputs; weights and delays come from the seed alone.
    fn branches(&self, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<Branch>> {
        check_ungraded(pattern, "skim")?;
        let branch = |inputs| Branch { inputs, next: 0, state: KernelSum::default() };
        let Some(layer) = self.layer() else {
            return Ok((0..pattern.len())
                .map(|n| branch(pattern.train(n).iter().map(|&t| (t, 1.0)).collect()))
                .collect());
        };
        let mut random = StdRng::seed_from_u64(self.seed);
        let spikes = pattern.by_time(stop)?;
        Ok((0..layer.count)
            .map(|_| {
                let weights: Vec<f64> =
                    (0..pattern.len()).map(|_| layer.spread * (2.0 * random.random::<f64>() - 1.0)).collect();
                let delay = layer.delay_ms * random.random::<f64>();
                branch(spikes.iter().map(|s| (s.t + delay, weights[s.train as usize])).collect())
            })
            .collect())
    }

    /// Calls `each` with the rows of a pattern, block by block: the output of each branch, columns first, from row
    /// `first` on.
    fn walk(
        &self,
        pattern: &SpikeTrains,
        stop: Stop<'_>,
        mut each: impl FnMut(usize, &mut Vec<Vec<f64>>),
    ) -> Result<()> {
        let shape = Shape::new(self.kernel, self.tau, self.tau_s());
        let step = shape.step(self.step_ms);
        let compress = self.branches.is_some() && self.nonlinearity == Nonlinearity::Tanh;
        let mut branches = self.branches(pattern, stop)?;
        let grid = Grid::new(pattern.start, self.step_ms);
        let points = grid.points_until(pattern.stop);
        check_points(points, MOST_LAID_OUT, self.step_ms)?;
        let rows = points as usize;
        let mut block: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK); branches.len()];
        for first in (0..rows).step_by(BLOCK) {
            stop.check()?;
            let last = (first + BLOCK).min(rows);
            for (branch, column) in branches.iter_mut().zip(&mut block) {
                column.clear();
                for row in first..last {
                    let point = row as f64;
                    if row > 0 {
                        branch.state = step.apply(branch.state);
                    }
                    while let Some(&(at, weight)) = branch.inputs.get(branch.next).filter(|i| grid.has_come(i.0, point))
                    {
                        shape.add(&mut branch.state, weight, 1.0, (grid.time(point) - at).max(0.0));
                        branch.next += 1;
                    }
                    column.push(if compress { branch.state.b.tanh() } else { branch.state.b });
                }
            }
            block.truncate(branches.len());
            each(first, &mut block);
        }
        Ok(())
    }

    /// The least-squares problem of these examples, in triangular form; memory does not grow with the patterns' length.
    fn reduce(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Normal> {
        let columns = self.columns(patterns[0].len());
        let mut normal = Normal::new(columns);
        for (pattern, targets) in patterns.iter().zip(targets) {
            let mut wanted = Vec::with_capacity(BLOCK);
            let grid = Grid::new(pattern.start, self.step_ms);
            self.walk(pattern, stop, |first, block| {
                wanted.clear();
                wanted.extend((first..first + block[0].len()).map(|row| {
                    let point = row as f64;
                    let come = targets.partition_point(|&at| grid.has_come(at, point));
                    let pulses = come > 0 && !grid.has_come(targets[come - 1] + self.pulse_ms, point);
                    if pulses { 1.0 } else { 0.0 }
                }));
                block.push(std::mem::take(&mut wanted));
                normal.add_rows(block);
                wanted = block.pop().unwrap_or_default();
            })?;
        }
        if self.ridge > 0.0 {
            let rows = normal.rows;
            let root = self.ridge.sqrt();
            let mut block: Vec<Vec<f64>> =
                (0..=columns).map(|j| (0..columns).map(|k| if j == k { root } else { 0.0 }).collect()).collect();
            normal.add_rows(&mut block);
            normal.rows = rows;
        }
        Ok(normal)
    }

    /// The rows of one pattern as they stand in the problem, row after row.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters or a pattern that make no sense; `Interrupted` where the caller stops it.
    pub fn rows(&self, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        check_untargeted(pattern)?;
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
        check_untargeted(pattern)?;
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

/// The times at which the output reaches a threshold from below, ms.
fn crossings(output: &[f64], threshold: f64, grid: Grid) -> Vec<f64> {
    let rises = |&row: &usize| output[row] >= threshold && (row == 0 || output[row - 1] < threshold);
    (0..output.len()).filter(rises).map(|row| grid.time(row as f64)).collect()
}

impl BatchRule for Skim {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.kernel == Kernel::DoubleExponential && self.tau_s() >= self.tau {
            return Err(problem!("tau_s"; " is {} ms: must be below tau, {} ms", self.tau_s(), self.tau));
        }
        if self.thresholds.is_empty() {
            return Err(problem!("thresholds"; ": must contain at least one"));
        }
        for (name, value) in [("spread", self.spread), ("delay_ms", self.delay_ms)] {
            if self.branches.is_some() && value.is_none() {
                return Err(problem!(name; ": none was published for a layer of branches; give one"));
            }
        }
        Ok(())
    }

    /// Weights, and of the thresholds the one with the fewest missed and false; the lowest of several.
    fn fit(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Learnt> {
        let normal = self.reduce(patterns, targets, stop)?;
        let (weights, residual) = normal.solve()?;
        let mut counts = vec![(0, 0, 0); self.thresholds.len()];
        for (p, (pattern, targets)) in patterns.iter().zip(targets).enumerate() {
            let output = self.output(&weights, pattern, stop)?;
            let (name, wanted) = (format!("output of pattern {p}"), format!("targets[{p}]"));
            for (&threshold, (found, missed, too_many)) in self.thresholds.iter().zip(&mut counts) {
                let fired = crossings(&output, threshold, Grid::new(pattern.start, self.step_ms));
                let pairs = match_spikes((&name, &fired), (&wanted, targets), self.within_ms, stop)?.len();
                *found += pairs;
                *missed += targets.len() - pairs;
                *too_many += fired.len() - pairs;
            }
        }
        let scored = || self.thresholds.iter().zip(&counts);
        let best = scored().min_by(|a, b| (a.1.1 + a.1.2).cmp(&(b.1.1 + b.1.2)).then(a.0.total_cmp(b.0)));
        let scores: Vec<Value> = scored().map(|(t, (f, m, x))| json!([t, f, m, x])).collect();
        let results = json!({
            "threshold": best.map(|(threshold, _)| threshold),
            "scores": scores,
            "residual": residual,
            "rows": normal.rows,
        });
        Ok(Learnt { weights, results: results.as_object().cloned().unwrap_or_default() })
    }

    fn run(&self, learnt: &Learnt, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        let Some(threshold) = learnt.results.get("threshold").and_then(Value::as_f64) else {
            return Err(problem!("threshold"; " is missing"));
        };
        let output = self.output(&learnt.weights, pattern, stop)?;
        Ok(crossings(&output, threshold, Grid::new(pattern.start, self.step_ms)))
    }
}

//! The problem of 6.11 at one margin: its rows, its objective, and the violations of rows by given weights.

use std::sync::Arc;

use super::cone_r::GapMultipliers;
use crate::learn::statement::{
    Margin, Objective, Parts, Row, Silence, SilencePeak, StatedRow, Statement, Targets, exceeds, largest,
};
use crate::neuron::{AT_EDGE, Grid, Time};
use crate::vectors::dot;
use crate::{Result, Stop};

/// The largest violation of a target row that counts as satisfied, mV.
pub(super) const MET: f64 = 1e-12;
/// Silence counts as violated above this, mV, and above this share of the sum of absolute weights, which covers
/// rounding.
const BROKEN: f64 = 1e-13;
const BROKEN_SHARE: f64 = 2e-16;
/// The share of the margin that weights must keep to count as a solution.
const KEPT_SHARE: f64 = 0.5;
/// The largest difference between a spike and its target, in units of the last place of the time.
const ROUNDINGS: f64 = 4.0;
/// The number of rounds after which a fit ends without a verdict.
pub(super) const MOST_ROUNDS: usize = 1000;

/// A stated problem in which the rows of targets and silence are hard constraints.
#[derive(Debug, Clone)]
pub(super) struct Exact {
    pub(super) statement: Statement,
    pub(super) targets: Arc<Targets>,
    pub(super) silence: Silence,
    pub(super) objective: Objective,
    /// The relative gap at which the objective counts as minimal.
    pub(super) tolerance: f64,
}

/// The best weights so far, with a lower bound on their objective.
pub(super) struct BestWeights {
    pub(super) weights: Vec<f64>,
    /// A lower bound on the objective of any weights, and the multipliers that prove it.
    pub(super) least: f64,
    pub(super) proof: GapMultipliers,
    pub(super) held: Vec<(Row, f64)>,
    pub(super) rounds: usize,
}

impl Exact {
    /// Computes the target rows and the silence of a statement, and normalises the objective.
    pub(super) fn new(
        statement: Statement,
        delta_t: f64,
        objective: impl FnOnce(&Targets) -> Objective,
        tolerance: f64,
        stop: Stop<'_>,
    ) -> Result<Self> {
        let targets = Targets::new(&statement, delta_t, stop)?;
        let objective = objective(&targets);
        let silence = Silence::new(&statement, stop)?;
        Ok(Self { statement, targets: Arc::new(targets), silence, objective, tolerance })
    }

    /// The same problem with another margin.
    pub(super) fn with_margin(&self, margin: Margin, stop: Stop<'_>) -> Result<Self> {
        let statement = self.statement.with_margin(margin);
        let silence = Silence::new(&statement, stop)?;
        let (targets, objective) = (Arc::clone(&self.targets), self.objective.clone());
        Ok(Self { statement, targets, silence, objective, tolerance: self.tolerance })
    }

    /// The terms of 6.11 at these weights.
    pub(super) fn parts(&self, weights: &[f64]) -> Parts {
        self.objective.exact_parts(&self.targets, weights)
    }

    /// The violation of each target row, mV.
    fn misses(&self, weights: &[f64]) -> impl Iterator<Item = f64> {
        self.targets.iter().map(|row| (dot(row.at, weights) - row.threshold).abs())
    }

    /// The largest violation of a target row, mV.
    pub(super) fn worst_target(&self, weights: &[f64]) -> f64 {
        largest(self.misses(weights).chain([0.0]))
    }

    /// The worst violation of silence with the share of the margin that a solution must keep, mV; negative if silence
    /// holds.
    pub(super) fn worst(&self, weights: &[f64]) -> f64 {
        self.silence.worst(weights, KEPT_SHARE)
    }

    /// The violation of silence that rounding alone can explain, mV.
    pub(super) fn rounding(&self, weights: &[f64]) -> f64 {
        let least = if self.is_grid() { MET } else { BROKEN };
        least.max(BROKEN_SHARE * weights.iter().map(|w| w.abs()).sum::<f64>())
    }

    /// The first condition that these weights violate, with its pattern and time: silence with half its margin; the
    /// target rows on the grid; the spikes of the neuron itself, run on the patterns.
    ///
    /// On the grid the neuron is not run if the margin is 0, because it fires at a silent row that holds with equality,
    /// nor if a target is not a grid point.
    pub(super) fn find_unmet(&self, weights: &[f64]) -> Result<Option<String>> {
        let unit = self.statement.unit;
        let worst = self.silence.broken(weights, KEPT_SHARE, self.rounding(weights)).into_iter();
        if let Some(SilencePeak { pattern, t, excess }) = worst.max_by(|a, b| a.excess.total_cmp(&b.excess)) {
            let excess = excess * unit;
            return Ok(Some(format!(
                "pattern {pattern}: at {t} ms, the potential is {excess:.1e} mV too high for silence"
            )));
        }
        let worst =
            self.misses(weights).enumerate().filter(|(_, miss)| exceeds(*miss, MET)).max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, miss)) = worst.filter(|_| self.is_grid()) {
            let ((pattern, target), t, miss) = (self.targets.names[k], self.targets.times[k], miss * unit);
            return Ok(Some(format!(
                "pattern {pattern}: at target {target} ({t} ms), the potential differs from the threshold by {miss:.1e} mV"
            )));
        }
        if self.can_fire_at_targets() { self.misfire(weights) } else { Ok(None) }
    }

    /// Whether the neuron itself can fire at every target and nowhere else.
    fn can_fire_at_targets(&self) -> bool {
        let Statement { neuron, margin, examples, .. } = &self.statement;
        let all_at_points = || {
            examples.iter().all(|example| {
                let grid = Grid::new(example.start, neuron.step_ms);
                example.targets.iter().all(|&target| grid.is_at_point(target))
            })
        };
        !self.is_grid() || margin.height > 0.0 && all_at_points()
    }

    /// The first target at which the neuron, run on the patterns, does not fire, or its first spike elsewhere.
    fn misfire(&self, weights: &[f64]) -> Result<Option<String>> {
        for (p, example) in self.statement.examples.iter().enumerate() {
            let (mut fired, mut stream) = (vec![], self.statement.neuron.stream(weights, 1.0, example.start)?);
            for &input in example.inputs.iter().take_while(|input| input.t <= example.end) {
                stream.push(input, &mut fired)?;
            }
            // A target at the end of silence itself may be reached just after it.
            let near = |target: f64| AT_EDGE + ROUNDINGS * (target.next_up() - target);
            let last = example.targets.last().map_or(example.end, |&target| target + near(target));
            stream.advance(last.max(example.end), &mut fired);
            let wanted = example.targets.iter().map(Some).chain(std::iter::repeat(None));
            let fired = fired.iter().map(|spike| Some(spike.t)).chain(std::iter::repeat(None));
            let most = example.targets.len() + 1;
            for (target, spike) in wanted.zip(fired).take(most) {
                let reason = match (target, spike) {
                    (Some(&target), Some(t)) if (t - target).abs() <= near(target) => continue,
                    (None, None) => continue,
                    (Some(target), Some(t)) => format!("fires at {t:.7} ms, not at the target, {target:.7} ms"),
                    (Some(target), None) => format!("does not fire at the target, {target:.7} ms"),
                    (None, Some(t)) => format!("also fires at {t:.7} ms, which is not a target"),
                };
                return Ok(Some(format!("pattern {p}: the neuron {reason}")));
            }
        }
        Ok(None)
    }

    pub(super) fn is_grid(&self) -> bool {
        self.statement.neuron.time == Time::Grid
    }

    /// The largest share of the margin that holds, 0 if silence is violated; on the grid the least threshold -
    /// potential.
    pub(super) fn kept_margin(&self, weights: &[f64]) -> Margin {
        let margin = self.statement.margin;
        if self.is_grid() {
            return Margin { height: margin.height - self.silence.worst(weights, 1.0), slope: 0.0 };
        }
        // At the worst instants, potential + share * margin = threshold gives the next share; the shares only decrease.
        let mut share = 1.0;
        loop {
            let broken = self.silence.broken(weights, share, self.rounding(weights));
            let less = broken.iter().map(|peak| peak.excess / self.statement.margin_of(peak.row()));
            let next = share - largest(less.chain([0.0]));
            // The weights of a fit that was stopped may keep no margin at all.
            if next.is_nan() || next <= 0.0 {
                return margin.times(0.0);
            }
            if next >= share {
                return margin.times(share);
            }
            share = next;
        }
    }
}

/// The slope rows, which the sweep over silence does not evaluate.
#[derive(Debug)]
pub(super) struct Slopes(pub(super) Vec<(Row, StatedRow)>);

impl Slopes {
    pub(super) fn new(statement: &Statement) -> Result<Self> {
        if statement.neuron.time == Time::Grid {
            return Ok(Self(vec![]));
        }
        let rows = statement.targets().map(|(pattern, target)| Row::Slope { pattern, target });
        Ok(Self(rows.map(|row| Ok((row, statement.state(row)?))).collect::<Result<_>>()?))
    }

    /// The slope rows that are violated even when their limit is relaxed by `left_out`.
    pub(super) fn broken(&self, weights: &[f64], left_out: f64) -> Vec<usize> {
        let kept = |row: &StatedRow| dot(&row.coefficients, weights) <= row.limit + left_out;
        (0..self.0.len()).filter(|&k| !kept(&self.0[k].1)).collect()
    }
}

//! The relaxed problem (6.12 to 6.14), in which violations of rows are penalised: its value at given weights, and a
//! lower bound on its least value.

use std::sync::Arc;

use super::grid::SilentRows;
use super::objective::{NOTHING, Norm, Objective, Parts, relative_gap};
use super::rows::Statement;
use super::targets::Targets;
use crate::vectors::{add, dot};
use crate::{Result, Stop};

/// The rows of a set of examples on the grid, for 6.14.
///
/// Rows are numbered: grid points first, then targets.
#[derive(Debug, Clone)]
pub(crate) struct Relaxed {
    pub(crate) theta_0: f64,
    /// A potential this far below the threshold still counts as reaching it, mV.
    pub(crate) touch: f64,
    pub(crate) trains: usize,
    pub(crate) targets: Arc<Targets>,
    pub(crate) silent: SilentRows,
    /// `B'B` of the rows after the targets, by columns.
    pub(crate) gram: Arc<Vec<f64>>,
}

impl Relaxed {
    /// Computes the rows of a statement; B evaluates the potential `delta_t` ms after the targets.
    pub(crate) fn new(statement: &Statement, delta_t: f64, stop: Stop<'_>) -> Result<Self> {
        let (neuron, trains) = (&statement.neuron, statement.trains);
        let mut rows = Self {
            theta_0: neuron.theta_0,
            touch: neuron.touch(),
            trains,
            targets: Arc::new(Targets::new(statement, delta_t, stop)?),
            silent: SilentRows::new(statement, stop)?,
            gram: Arc::new(vec![0.0; trains * trains]),
        };
        for k in 0..rows.targets.len() {
            stop.check()?;
            rows.lift(k, 1.0);
        }
        Ok(rows)
    }

    /// Adds the row after target `k` to B's matrix, or subtracts it if `sign` is -1.
    fn lift(&mut self, k: usize, sign: f64) {
        let row = self.targets.row(k).behind;
        for (column, &v) in Arc::make_mut(&mut self.gram).chunks_exact_mut(self.trains).zip(row) {
            add(column, sign * v, row);
        }
    }

    /// Adds the rows of the statement's last pattern; if the caller stops it, nothing changes.
    pub(crate) fn push(&mut self, statement: &Statement, delta_t: f64, stop: Stop<'_>) -> Result<()> {
        let (pattern, before) = (statement.examples.len() - 1, self.targets.len());
        let mut targets = Targets::clone(&self.targets);
        targets.push(statement, pattern, delta_t, stop)?;
        self.silent.push(statement, pattern, stop)?;
        self.targets = Arc::new(targets);
        for k in before..self.targets.len() {
            self.lift(k, 1.0);
        }
        Ok(())
    }

    /// Removes the rows of the first pattern.
    pub(crate) fn drop_first(&mut self) {
        for k in 0..self.targets.count_of_first() {
            self.lift(k, -1.0);
        }
        Arc::make_mut(&mut self.targets).drop_first();
        self.silent.drop_first();
    }

    /// A copy with the given silent rows only, as coefficients; for solving, since its value leaves out the other rows.
    pub(crate) fn with_silent_rows(&self, rows: &[usize]) -> Self {
        Self {
            targets: Arc::clone(&self.targets),
            silent: self.silent.with_rows(rows),
            gram: Arc::clone(&self.gram),
            ..*self
        }
    }

    /// The typical size of weights that reach the threshold at the targets, mV.
    pub(crate) fn typical_weight(&self) -> f64 {
        let (thresholds, lengths) = self
            .targets
            .iter()
            .fold((0.0, 0.0), |sum, row| (sum.0 + row.threshold, sum.1 + dot(row.at, row.at).sqrt()));
        if lengths > 0.0 { thresholds / lengths } else { f64::INFINITY }
    }

    /// D at these weights, without its factor, if the values of all inputs were positive: its largest value, unless
    /// inputs of both signs are present; then D cannot exceed it.
    pub(crate) fn most_broken_silence(&self, weights: &[f64]) -> f64 {
        let mut potential = Vec::new();
        self.silent.unsigned_rows().potential(weights, &mut potential);
        potential.iter().zip(&self.silent.limit).map(|(u, limit)| (u - limit).max(0.0)).sum()
    }
}

/// Weights, and their potentials relative to the limits.
#[derive(Debug, Clone)]
pub(crate) struct RelaxedPoint {
    pub(crate) weights: Vec<f64>,
    /// Potential minus limit at the silent rows, then potential minus threshold at the targets, mV.
    pub(crate) excess: Vec<f64>,
    /// Potential minus `kappa` thresholds after the targets, mV.
    pub(crate) behind: Vec<f64>,
    pub(crate) parts: Parts,
}

impl Relaxed {
    /// The weights with their potentials and the terms of 6.14.
    pub(crate) fn point(&self, objective: &Objective, weights: Vec<f64>) -> RelaxedPoint {
        let mut excess = Vec::with_capacity(self.silent.len() + self.targets.len());
        self.silent.potential(&weights, &mut excess);
        excess.iter_mut().zip(&self.silent.limit).for_each(|(u, limit)| *u -= limit);
        excess.extend(self.targets.iter().map(|row| dot(row.at, &weights) - row.threshold));
        let behind = objective.missing_lift(&self.targets, &weights);
        let (silent, targets) = excess.split_at(self.silent.len());
        let (l1, l2) = objective.norms(&weights);
        let counted: Vec<f64> = behind.iter().map(|&x| objective.counts_in_b(x)).collect();
        let parts = Parts {
            l1,
            l2,
            B: objective.b * dot(&counted, &counted),
            C: objective.c * targets.iter().map(|&x| objective.c_at_distance(x)).sum::<f64>(),
            D: objective.d * silent.iter().map(|x| x.max(0.0)).sum::<f64>(),
        };
        RelaxedPoint { weights, excess, behind, parts }
    }

    /// The proof of a lower bound on 6.14 by these tangents, given that its least value is at most `most`.
    pub(crate) fn proof(&self, objective: &Objective, at: &Tangents<'_>, most: f64) -> RelaxedProof {
        let squares = at.behind.iter().map(|&x| 2.0 * objective.b * objective.counts_in_b(x));
        RelaxedProof {
            bound: self.bound(objective, at, most),
            multipliers: at.multipliers.to_vec(),
            behind: squares.collect(),
            pull: match objective.norm {
                Norm::Square => at.weights.iter().map(|w| 2.0 * objective.l2 * w).collect(),
                Norm::Norm => at.pull.to_vec(),
            },
        }
    }

    /// The proof that 6.14 is at least 0.
    pub(crate) fn no_proof(&self) -> RelaxedProof {
        RelaxedProof {
            bound: 0.0,
            multipliers: vec![0.0; self.silent.len() + self.targets.len()],
            behind: vec![0.0; self.targets.len()],
            pull: vec![0.0; self.trains],
        }
    }

    /// A lower bound on 6.14 over all weights within the bounds, given that its least value is at most `most`.
    ///
    /// Every term is replaced by a tangent below it at some weights (which need not be within the bounds): silence by
    /// multipliers between 0 and D's weight, targets by multipliers between C's slopes, the norm by a `pull` no
    /// longer than its factor, a square by its slope. The remaining function, linear plus l1 over the box, is minimised
    /// synapse by synapse. The bound therefore holds for any multipliers, however they were found.
    fn bound(&self, objective: &Objective, at: &Tangents<'_>, most: f64) -> f64 {
        let reach = objective.reach(most);
        let silent = self.silent.len();
        let mut gradient = vec![0.0; self.trains];
        self.silent.add_sum(&at.multipliers[..silent], &mut gradient);
        let mut bound = 0.0;
        for ((target, multiplier), behind) in self.targets.iter().zip(&at.multipliers[silent..]).zip(at.behind) {
            let behind = objective.counts_in_b(*behind);
            add(&mut gradient, *multiplier, target.at);
            add(&mut gradient, 2.0 * objective.b * behind, target.behind);
            bound += objective.b * behind * behind;
        }
        match objective.norm {
            Norm::Square => {
                add(&mut gradient, 2.0 * objective.l2, at.weights);
                bound += objective.l2 * dot(at.weights, at.weights);
            }
            Norm::Norm => {
                add(&mut gradient, 1.0, at.pull);
                bound += dot(at.pull, at.weights);
            }
        }
        for (&multiplier, &x) in at.multipliers.iter().zip(at.excess) {
            if multiplier != 0.0 {
                bound += multiplier * x;
            }
        }
        for (n, (&g, &w)) in gradient.iter().zip(at.weights).enumerate() {
            let cost = |v: f64| g * (v - w) + objective.l1 * v.abs();
            let (lower, upper) = (objective.bounds.lower[n].max(-reach), objective.bounds.upper[n].min(reach));
            let ends = cost(lower).min(cost(upper));
            bound += if lower < 0.0 && upper > 0.0 { ends.min(cost(0.0)) } else { ends };
        }
        bound
    }
}

impl RelaxedPoint {
    /// The relative gap to a lower bound; 0 if the objective is 0.
    pub(crate) fn gap(&self, bound: f64) -> f64 {
        match self.parts.sum() {
            least if least <= NOTHING => 0.0,
            least => relative_gap(least, bound),
        }
    }
}

/// The data of the tangents below 6.14: weights, their rows' excess, one multiplier per row, and the pull of the norm.
pub(crate) struct Tangents<'a> {
    pub(crate) weights: &'a [f64],
    pub(crate) excess: &'a [f64],
    pub(crate) behind: &'a [f64],
    pub(crate) multipliers: &'a [f64],
    pub(crate) pull: &'a [f64],
}

/// A lower bound on 6.14, and the slopes of the tangents that prove it.
#[derive(Debug, Clone)]
pub(crate) struct RelaxedProof {
    pub(crate) bound: f64,
    /// One per row, of C and D.
    pub(crate) multipliers: Vec<f64>,
    /// One per target, of B.
    pub(crate) behind: Vec<f64>,
    /// One per synapse, of the l2 term.
    pub(crate) pull: Vec<f64>,
}

impl RelaxedProof {
    /// Takes another proof if that proves more.
    pub(crate) fn improve(&mut self, other: Self) {
        if other.bound > self.bound {
            *self = other;
        }
    }

    /// The same proof for 6.14 with every term divided by `scale`, and potentials in units of `unit`.
    pub(crate) fn divide(&mut self, scale: f64, unit: f64) {
        self.bound /= scale;
        let slopes = self.multipliers.iter_mut().chain(&mut self.behind).chain(&mut self.pull);
        slopes.for_each(|slope| *slope /= scale * unit);
    }
}

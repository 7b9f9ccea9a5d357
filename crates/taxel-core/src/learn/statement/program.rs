//! Objectives with kinks over rows of silence and of targets: 6.14, which penalises violations, and 6.11, in which every
//! row is hard. Their value at given weights, and a lower bound on their least value.

use super::grid::SilentRows;
use super::objective::{FormB, NOTHING, Norm, Objective, Parts, relative_gap};
use super::targets::Targets;
use crate::vectors::{add, dot};

/// The rows of silence: those of all grid points, or a few as coefficients.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Rows<'a> {
    /// Swept, never stored.
    Grid(&'a SilentRows),
    /// One after the other.
    Written(&'a [f64]),
}

impl Rows<'_> {
    /// Computes the potential at every row, mV; `out` has one entry per row.
    pub(crate) fn potential(&self, weights: &[f64], out: &mut [f64]) {
        match self {
            Self::Grid(rows) => rows.potential(weights, out),
            Self::Written(rows) => {
                let rows = out.iter_mut().zip(rows.chunks_exact(weights.len()));
                rows.for_each(|(out, row)| *out = dot(row, weights));
            }
        }
    }

    /// Adds the sum of all rows, each times its factor, to `sum` (one entry per train); the adjoint of `potential`.
    pub(crate) fn add_sum(&self, factors: &[f64], sum: &mut [f64]) {
        match self {
            Self::Grid(rows) => rows.add_sum(factors, sum),
            Self::Written(rows) => {
                let rows = factors.iter().zip(rows.chunks_exact(sum.len()));
                rows.filter(|(factor, _)| **factor != 0.0).for_each(|(&factor, row)| add(sum, factor, row));
            }
        }
    }

    /// The coefficients of the given rows (ascending), row after row, of `trains` entries each.
    pub(crate) fn coefficients(&self, rows: &[usize], trains: usize) -> Vec<f64> {
        match self {
            Self::Grid(all) => all.coefficients(rows),
            Self::Written(all) => rows.iter().flat_map(|row| &all[row * trains..(row + 1) * trains]).copied().collect(),
        }
    }
}

/// An objective over rows, which are numbered: silence first, then targets, then, if B is a sum, those after the targets.
///
/// Beside its limit a row of silence, `x` mV above it, costs a slope times `x`, and likewise the others. A row with
/// infinite slopes is hard: no weights that violate it count.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Program<'a> {
    pub(crate) silent: Rows<'a>,
    /// The limit of the potential at the rows of silence, mV; infinite where no silence is required.
    pub(crate) limit: &'a [f64],
    pub(crate) targets: &'a Targets,
    /// `B'B` of the rows after the targets, by columns.
    pub(crate) gram: &'a [f64],
    pub(crate) objective: &'a Objective,
    /// The slopes below and above the limits of silence, those of targets, and those of the rows after them.
    pub(crate) slopes: [[f64; 2]; 3],
    pub(crate) theta_0: f64,
}

/// Weights, and their potentials relative to the limits.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) weights: Vec<f64>,
    /// Potential minus limit at the silent rows, then potential minus threshold at the targets, then, if B is a sum,
    /// potential minus `kappa` thresholds after them, mV.
    pub(crate) excess: Vec<f64>,
    /// Potential minus `kappa` thresholds after the targets, mV, if B is a sum of squares.
    pub(crate) behind: Vec<f64>,
    pub(crate) parts: Parts,
}

/// A lower bound on an objective, and the slopes of the tangents that prove it.
#[derive(Debug, Clone)]
pub(crate) struct Proof {
    pub(crate) bound: f64,
    /// One per row.
    pub(crate) multipliers: Vec<f64>,
    /// One per target, of B.
    pub(crate) behind: Vec<f64>,
    /// One per synapse, of the l2 term.
    pub(crate) pull: Vec<f64>,
}

impl Program<'_> {
    pub(crate) fn trains(&self) -> usize {
        self.objective.bounds.lower.len()
    }

    /// The number of rows after targets: none if B is a sum of squares.
    pub(crate) fn sums(&self) -> usize {
        if self.objective.choice.form_b == FormB::Sum { self.targets.len() } else { 0 }
    }

    /// The number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.limit.len() + self.targets.len() + self.sums()
    }

    /// The kind of a row: 0 for silence, 1 for a target, 2 for a row after one.
    pub(crate) fn kind(&self, row: usize) -> usize {
        let silent = self.limit.len();
        usize::from(row >= silent) + usize::from(row >= silent + self.targets.len())
    }

    /// The least multiplier of a row as a share of its range.
    pub(crate) fn least_share(&self, row: usize) -> f64 {
        let [low, high] = self.slopes[self.kind(row)];
        if low < high { low / (high - low) } else { 0.0 }
    }

    /// The rows of the targets and those after them: coefficients, and the potential that they ask for, mV.
    pub(crate) fn stored(&self) -> impl Iterator<Item = (&[f64], f64)> {
        let kappa = self.objective.choice.kappa;
        let after = self.targets.iter().take(self.sums()).map(move |row| (row.behind, kappa * row.threshold));
        self.targets.iter().map(|row| (row.at, row.threshold)).chain(after)
    }

    /// The coefficients of one of these rows.
    pub(crate) fn stored_row(&self, k: usize) -> &[f64] {
        let targets = self.targets;
        if k < targets.len() { targets.row(k).at } else { targets.row(k - targets.len()).behind }
    }

    /// Whether weights that violate a row do not count.
    pub(crate) fn is_hard(&self) -> bool {
        self.slopes[0][1].is_infinite()
    }

    /// The weights of 0, or as near to 0 as the bounds allow.
    pub(crate) fn nearest_to_zero(&self) -> Vec<f64> {
        let bounds = &self.objective.bounds;
        bounds.lower.iter().zip(&bounds.upper).map(|(&low, &high)| 0.0_f64.clamp(low, high)).collect()
    }

    /// The typical size of weights that reach the threshold at the targets, mV.
    pub(crate) fn typical_weight(&self) -> f64 {
        let (thresholds, lengths) = self
            .targets
            .iter()
            .fold((0.0, 0.0), |sum, row| (sum.0 + row.threshold, sum.1 + dot(row.at, row.at).sqrt()));
        if lengths > 0.0 { thresholds / lengths } else { f64::INFINITY }
    }

    /// Adds the sum of all rows, each times its multiplier, to `sum`, one entry per train.
    pub(crate) fn add_rows(&self, multipliers: &[f64], sum: &mut [f64]) {
        let (silent, stored) = multipliers.split_at(self.limit.len());
        if self.slopes[0] != [0.0; 2] {
            self.silent.add_sum(silent, sum);
        }
        for ((row, _), &multiplier) in self.stored().zip(stored) {
            add(sum, multiplier, row);
        }
    }

    /// Adds the gradient of squares in B to `sum`, given the potentials after the targets minus `kappa` thresholds.
    pub(crate) fn add_slope_of_b(&self, behind: &[f64], sum: &mut [f64]) {
        if self.objective.b > 0.0 {
            for (target, &behind) in self.targets.iter().zip(behind) {
                add(sum, 2.0 * self.objective.b * self.objective.counts_in_b(behind), target.behind);
            }
        }
    }

    /// The weights with their potentials and the terms of the objective; hard rows have none.
    pub(crate) fn point(&self, weights: Vec<f64>) -> Point {
        let (objective, count) = (self.objective, self.limit.len());
        let mut excess = vec![0.0; count];
        self.silent.potential(&weights, &mut excess);
        excess.iter_mut().zip(self.limit).for_each(|(u, limit)| *u -= limit);
        excess.extend(self.stored().map(|(row, wanted)| dot(row, &weights) - wanted));
        let behind = if self.sums() == 0 { objective.missing_lift(self.targets, &weights) } else { vec![] };
        let (silent, stored) = excess.split_at(count);
        let (targets, after) = stored.split_at(self.targets.len());
        let (l1, l2) = objective.norms(&weights);
        let parts = Parts {
            l1,
            l2,
            B: objective.b_at(if self.sums() == 0 { &behind } else { after }),
            C: objective.c * targets.iter().map(|&x| objective.c_at_distance(x)).sum::<f64>(),
            D: objective.d * silent.iter().map(|x| x.max(0.0)).sum::<f64>(),
        };
        Point { weights, excess, behind, parts }
    }

    /// The proof of a lower bound by the tangents below the objective at these weights, with one multiplier per row and the
    /// pull of the norm, given that the least value of the objective is at most `most`.
    pub(crate) fn proof(&self, at: &Point, multipliers: &[f64], pull: &[f64], most: f64) -> Proof {
        let objective = self.objective;
        let squares = at.behind.iter().map(|&x| 2.0 * objective.b * objective.counts_in_b(x));
        let after = multipliers[self.limit.len() + self.targets.len()..].iter().copied();
        Proof {
            bound: self.bound(at, multipliers, pull, most),
            multipliers: multipliers.to_vec(),
            behind: squares.chain(after).collect(),
            pull: match objective.choice.norm {
                Norm::Square => at.weights.iter().map(|w| 2.0 * objective.l2 * w).collect(),
                Norm::Norm => pull.to_vec(),
            },
        }
    }

    /// The proof that the objective is at least 0.
    pub(crate) fn no_proof(&self) -> Proof {
        Proof {
            bound: 0.0,
            multipliers: vec![0.0; self.rows()],
            behind: vec![0.0; self.targets.len()],
            pull: vec![0.0; self.trains()],
        }
    }

    /// A lower bound on the objective over all weights within the bounds, given that its least value is at most `most`.
    ///
    /// Every term is replaced by a tangent below it at some weights (which need not be within the bounds): rows by
    /// multipliers between their slopes, the norm by a `pull` no longer than its factor, a square by its slope. The
    /// remaining function, linear plus l1 over the box, is minimised synapse by synapse. The bound therefore holds for
    /// any multipliers, however they were found.
    fn bound(&self, at: &Point, multipliers: &[f64], pull: &[f64], most: f64) -> f64 {
        let objective = self.objective;
        let reach = objective.reach(most);
        let mut gradient = vec![0.0; self.trains()];
        self.add_rows(multipliers, &mut gradient);
        self.add_slope_of_b(&at.behind, &mut gradient);
        let mut bound: f64 = at.behind.iter().map(|&x| objective.b * objective.counts_in_b(x).powi(2)).sum();
        match objective.choice.norm {
            Norm::Square => {
                add(&mut gradient, 2.0 * objective.l2, &at.weights);
                bound += objective.l2 * dot(&at.weights, &at.weights);
            }
            Norm::Norm => {
                add(&mut gradient, 1.0, pull);
                bound += dot(pull, &at.weights);
            }
        }
        for (&multiplier, &x) in multipliers.iter().zip(&at.excess) {
            if multiplier != 0.0 {
                bound += multiplier * x;
            }
        }
        for (n, (&g, &w)) in gradient.iter().zip(&at.weights).enumerate() {
            let cost = |v: f64| g * (v - w) + objective.l1 * v.abs();
            let (lower, upper) = (objective.bounds.lower[n].max(-reach), objective.bounds.upper[n].min(reach));
            let ends = cost(lower).min(cost(upper));
            bound += if lower < 0.0 && upper > 0.0 { ends.min(cost(0.0)) } else { ends };
        }
        bound
    }
}

impl Point {
    /// The relative gap to a lower bound; 0 if the objective is 0.
    pub(crate) fn gap(&self, bound: f64) -> f64 {
        match self.parts.sum() {
            least if least <= NOTHING => 0.0,
            least => relative_gap(least, bound),
        }
    }
}

impl Proof {
    /// Takes another proof if that proves more.
    pub(crate) fn improve(&mut self, other: Self) {
        if other.bound > self.bound {
            *self = other;
        }
    }

    /// The same proof for an objective with every term divided by `scale`, and potentials in units of `unit`.
    pub(crate) fn divide(&mut self, scale: f64, unit: f64) {
        self.bound /= scale;
        let slopes = self.multipliers.iter_mut().chain(&mut self.behind).chain(&mut self.pull);
        slopes.for_each(|slope| *slope /= scale * unit);
    }
}

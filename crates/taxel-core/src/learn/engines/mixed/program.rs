//! The program in its own units: terms, rows, bounds, and their values at any weights and multipliers.

use super::dense::{add_sum, times};
use crate::learn::engines::{ConeProgram, HardRows, Hinges};
use crate::learn::statement::{Bounds, Norm, relative_gap};
use crate::vectors::dot;
use crate::{Result, Stop};

/// The tolerance of rows and bounds, for rows of length 1.
pub(super) const MET: f64 = 2e-14;

/// The terms of the objective, weighted and normalised.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Terms<'a> {
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) norm: Norm,
    /// The factor of B, its rows (stored one after the other), and the values they should reach.
    pub(crate) lift: f64,
    pub(crate) behind: &'a [f64],
    pub(crate) wanted: &'a [f64],
}

/// Weights and multipliers; `pull` represents the gradient of `l2 |w|_2` and is no longer than `l2`.
#[derive(Debug, Clone, Default)]
pub(crate) struct PrimalDualPoint {
    pub(crate) weights: Vec<f64>,
    pub(crate) equality: Vec<f64>,
    pub(crate) inequality: Vec<f64>,
    pub(crate) pull: Vec<f64>,
}

/// Whether a weight is free, 0, or at a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WeightState {
    Free,
    Zero,
    Lower,
    Upper,
}

/// The final state of an interior-point run.
pub(super) struct Iterate {
    pub(super) point: PrimalDualPoint,
    /// The rows and bounds that appear to bind.
    pub(super) guess: Guess,
}

/// A guess of the binding rows and bounds.
#[derive(Debug, Clone)]
pub(super) struct Guess {
    pub(super) states: Vec<WeightState>,
    pub(super) binding: Vec<bool>,
}

/// The problem in units in which weights, rows and costs are about 1. All scales are powers of 2, so scaling rounds
/// nothing.
pub(super) struct Program {
    pub(super) l1: f64,
    pub(super) l2: f64,
    pub(super) norm: Norm,
    pub(super) lift: f64,
    pub(super) behind: Vec<f64>,
    pub(super) wanted: Vec<f64>,
    pub(super) equal: Vec<f64>,
    pub(super) equal_to: Vec<f64>,
    pub(super) below: Vec<f64>,
    pub(super) limit: Vec<f64>,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// The scales by which weights, the objective and each inequality row were divided.
    pub(super) weight: f64,
    pub(super) cost: f64,
    pub(super) of_below: Vec<f64>,
    /// Those of the equality rows.
    of_equal: Vec<f64>,
}

/// The multipliers that prove a bound, in the caller's units: of the rows, of B, and the slope of the l2 term's tangent.
#[derive(Debug, Clone)]
pub(crate) struct MixedProof {
    pub(crate) equality: Vec<f64>,
    pub(crate) inequality: Vec<f64>,
    pub(crate) behind: Vec<f64>,
    pub(crate) pull: Vec<f64>,
}

/// Retains the entries that `keep` marks, and all entries beyond its end.
pub(super) fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    values.retain(|_| keep.next().copied().unwrap_or(true));
}

/// The power of 2 nearest to a positive number; 1 for any other number.
pub(super) fn power_of_2(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { x.log2().round().clamp(-1000.0, 1000.0).exp2() } else { 1.0 }
}

impl Program {
    pub(super) fn new(terms: &Terms<'_>, rows: &HardRows<'_>, bounds: &Bounds, size: f64) -> Self {
        let Bounds { lower, upper } = bounds;
        let n = lower.len();
        let weight = power_of_2(size);
        let scaled = |rows: &[f64], limits: &[f64]| {
            let (mut rows, mut limits) = (rows.to_vec(), limits.to_vec());
            let mut scales = Vec::with_capacity(limits.len());
            for (row, limit) in rows.chunks_exact_mut(n.max(1)).zip(&mut limits) {
                let scale = power_of_2(dot(row, row).sqrt() * weight);
                row.iter_mut().for_each(|v| *v *= weight / scale);
                *limit /= scale;
                scales.push(scale);
            }
            (rows, limits, scales)
        };
        let (equal, equal_to, of_equal) = scaled(rows.equal, rows.equal_to);
        let (below, limit, of_below) = scaled(rows.below, rows.limit);
        let behind: Vec<f64> = terms.behind.iter().map(|v| v * weight).collect();
        let square = terms.norm == Norm::Square;
        let l2 = terms.l2 * if square { weight * weight } else { weight };
        let mut pulled = vec![0.0; n];
        if terms.lift > 0.0 {
            add_sum(&behind, terms.wanted, &mut pulled);
        }
        let lifted = 2.0 * terms.lift * pulled.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let cost = power_of_2(terms.l1 * weight + if square { 2.0 * l2 } else { l2 / (n as f64).sqrt() } + lifted);
        Self {
            l1: terms.l1 * weight / cost,
            l2: l2 / cost,
            norm: terms.norm,
            lift: terms.lift / cost,
            behind,
            wanted: terms.wanted.to_vec(),
            equal,
            equal_to,
            below,
            limit,
            lower: lower.iter().map(|w| w / weight).collect(),
            upper: upper.iter().map(|w| w / weight).collect(),
            weight,
            cost,
            of_below,
            of_equal,
        }
    }

    pub(super) fn width(&self) -> usize {
        self.lower.len()
    }

    pub(super) fn hard(&self) -> HardRows<'_> {
        HardRows { equal: &self.equal, equal_to: &self.equal_to, below: &self.below, limit: &self.limit }
    }

    pub(super) fn shortfalls(&self, w: &[f64]) -> Vec<f64> {
        if self.lift > 0.0 {
            times(&self.behind, w).iter().zip(&self.wanted).map(|(u, m)| u - m).collect()
        } else {
            vec![]
        }
    }

    pub(super) fn objective(&self, w: &[f64]) -> f64 {
        let square = dot(w, w);
        let missed = self.shortfalls(w);
        self.l1 * w.iter().map(|w| w.abs()).sum::<f64>()
            + self.l2 * if self.norm == Norm::Square { square } else { square.sqrt() }
            + self.lift * dot(&missed, &missed)
    }

    /// The gradient of the smooth terms: B, and a squared l2 term.
    pub(super) fn slope(&self, w: &[f64]) -> Vec<f64> {
        let mut slope = vec![0.0; w.len()];
        if self.lift > 0.0 {
            let mut missed = self.shortfalls(w);
            missed.iter_mut().for_each(|m| *m *= 2.0 * self.lift);
            add_sum(&self.behind, &missed, &mut slope);
        }
        if self.norm == Norm::Square {
            slope.iter_mut().zip(w).for_each(|(s, w)| *s += 2.0 * self.l2 * w);
        }
        slope
    }

    /// The amount by which the tangent of the smooth terms at `w` is below 0 at weights of 0.
    pub(super) fn tangent(&self, w: &[f64]) -> f64 {
        let missed = self.shortfalls(w);
        let lift: f64 = missed.iter().zip(&self.wanted).map(|(x, m)| x * (2.0 * m + x)).sum();
        let square = if self.norm == Norm::Square { self.l2 * dot(w, w) } else { 0.0 };
        self.lift * lift + square
    }

    /// The least value of `slope v + l1 |v|` between the bounds of weight `j`.
    pub(super) fn least_cost(&self, j: usize, slope: f64) -> f64 {
        let cost = |v: f64| slope * v + self.l1 * v.abs();
        let (lower, upper) = (self.lower[j], self.upper[j]);
        let ends = cost(lower).min(cost(upper));
        if lower < 0.0 && upper > 0.0 { ends.min(0.0) } else { ends }
    }

    /// The gradient of `l2 |w|_2`.
    pub(super) fn pull(&self, w: &[f64]) -> Vec<f64> {
        let length = dot(w, w).sqrt();
        if self.norm == Norm::Norm && self.l2 > 0.0 && length > 0.0 {
            w.iter().map(|w| self.l2 * w / length).collect()
        } else {
            vec![0.0; w.len()]
        }
    }

    /// The largest violation of a row or bound.
    pub(super) fn missing(&self, w: &[f64]) -> f64 {
        let equal = times(&self.equal, w);
        let equal = equal.iter().zip(&self.equal_to).map(|(u, e)| (u - e).abs());
        let below = times(&self.below, w);
        let below = below.iter().zip(&self.limit).map(|(u, limit)| u - limit);
        let bounds = w.iter().zip(self.lower.iter().zip(&self.upper)).map(|(w, (l, u))| (l - w).max(w - u));
        equal.chain(below).chain(bounds).fold(0.0, f64::max)
    }

    pub(super) fn meets_rows(&self, w: &[f64]) -> bool {
        w.iter().all(|w| w.is_finite()) && self.missing(w) <= MET * (self.width() as f64).sqrt().max(10.0)
    }

    pub(super) fn is_lift_alone(&self) -> bool {
        self.l1 == 0.0 && self.l2 == 0.0 && self.lift > 0.0
    }

    pub(super) fn at_zero(&self) -> f64 {
        self.lift * dot(&self.wanted, &self.wanted)
    }

    /// Solves the same program with Clarabel, as far as Clarabel gets.
    pub(super) fn clarabel(&self, stop: Stop<'_>) -> Result<PrimalDualPoint> {
        let n = self.width();
        let mut gram = vec![0.0; n * n];
        let mut linear = vec![0.0; n];
        if self.lift > 0.0 {
            for row in self.behind.chunks_exact(n) {
                for (column, v) in gram.chunks_exact_mut(n).zip(row) {
                    column.iter_mut().zip(row).for_each(|(g, r)| *g += v * r);
                }
            }
            let factors: Vec<f64> = self.wanted.iter().map(|m| -2.0 * self.lift * m).collect();
            add_sum(&self.behind, &factors, &mut linear);
        }
        let program = ConeProgram {
            kinks: vec![],
            linear: &linear,
            l1: self.l1,
            l2: self.l2,
            norm: self.norm,
            quadratic: self.lift,
            behind: &self.behind,
            gram: &gram,
            bounds: self.lower.iter().zip(&self.upper).map(|(l, u)| [*l, *u]).collect(),
            hinges: &Hinges::default(),
            hard: self.hard(),
        };
        let answer = program.solve(1.0, 1e-11, stop)?;
        Ok(PrimalDualPoint {
            weights: answer.weights,
            equality: answer.equality,
            inequality: answer.inequality,
            pull: answer.pull,
        })
    }

    /// The rows and bounds that appear to bind at the weights and multipliers of any solver.
    pub(super) fn guess(&self, point: &PrimalDualPoint) -> Guess {
        const NEAR: f64 = 1e-7;
        let state = |(w, (l, u)): (&f64, (&f64, &f64))| match *w {
            w if w - l <= NEAR => WeightState::Lower,
            w if u - w <= NEAR => WeightState::Upper,
            w if self.l1 > 0.0 && w.abs() <= NEAR => WeightState::Zero,
            _ => WeightState::Free,
        };
        let below = times(&self.below, &point.weights);
        let rows = below.iter().zip(&self.limit).zip(&point.inequality);
        Guess {
            states: point.weights.iter().zip(self.lower.iter().zip(&self.upper)).map(state).collect(),
            binding: rows.map(|((u, limit), z)| limit - u < *z).collect(),
        }
    }

    /// The relative distance between the objective and the bound that these multipliers prove.
    pub(super) fn gap(&self, point: &PrimalDualPoint) -> f64 {
        relative_gap(self.objective(&point.weights), self.bound(point))
    }

    /// The multipliers of a point that prove its bound, in the caller's units.
    pub(super) fn proof(&self, point: &PrimalDualPoint) -> MixedProof {
        let PrimalDualPoint { weights, equality, inequality, pull } = point;
        let lifted = |missed: f64| 2.0 * self.lift * missed * self.cost;
        let pulled = |(pull, w): (&f64, &f64)| match self.norm {
            Norm::Norm => pull * self.cost / self.weight,
            Norm::Square => 2.0 * self.l2 * w * self.cost / self.weight,
        };
        MixedProof {
            equality: equality.iter().zip(&self.of_equal).map(|(y, scale)| y * self.cost / scale).collect(),
            inequality: inequality
                .iter()
                .zip(&self.of_below)
                .map(|(z, scale)| z.max(0.0) * self.cost / scale)
                .collect(),
            behind: self.shortfalls(weights).into_iter().map(lifted).collect(),
            pull: pull.iter().zip(weights).map(pulled).collect(),
        }
    }

    /// A lower bound on the objective, valid for any multipliers (those of inequalities at least 0) and any point.
    ///
    /// Every term is replaced by a tangent below it: the norm by a `pull` no longer than its factor, a square by its
    /// slope at the weights, rows by their multipliers. The remaining function, linear plus l1 over the box, is
    /// minimised synapse by synapse. The largest rounding error of all these sums is subtracted.
    pub(super) fn bound(&self, point: &PrimalDualPoint) -> f64 {
        let n = self.width();
        let w = &point.weights;
        let mut slope = vec![0.0; n];
        let mut sizes = vec![0.0; n];
        let mut terms = 4.0;
        let mut value = 0.0;
        let mut size = 0.0;
        let mut add = |rows: &[f64], factors: &[f64], values: &[f64]| {
            add_sum(rows, factors, &mut slope);
            for (row, factor) in rows.chunks_exact(n.max(1)).zip(factors) {
                if *factor != 0.0 {
                    terms += 1.0;
                    sizes.iter_mut().zip(row).for_each(|(s, r)| *s += (factor * r).abs());
                }
            }
            for (f, v) in factors.iter().zip(values) {
                value -= f * v;
                size += (f * v).abs();
            }
        };
        let inequality: Vec<f64> = point.inequality.iter().map(|z| z.max(0.0)).collect();
        add(&self.equal, &point.equality, &self.equal_to);
        add(&self.below, &inequality, &self.limit);
        if self.lift > 0.0 {
            // x^2 >= 2 m x - m^2 for any m; here x = behind.w - wanted.
            let missed = self.shortfalls(w);
            let factors: Vec<f64> = missed.iter().map(|m| 2.0 * self.lift * m).collect();
            let values: Vec<f64> = missed.iter().zip(&self.wanted).map(|(m, wanted)| wanted + 0.5 * m).collect();
            add(&self.behind, &factors, &values);
        }
        if self.norm == Norm::Square {
            for (k, w) in w.iter().enumerate() {
                slope[k] += 2.0 * self.l2 * w;
                sizes[k] += (2.0 * self.l2 * w).abs();
            }
            value -= self.l2 * dot(w, w);
            size += self.l2 * dot(w, w);
        } else if self.l2 > 0.0 {
            let length = dot(&point.pull, &point.pull).sqrt();
            let shrink = (self.l2 / length.max(f64::MIN_POSITIVE)).min(1.0) * (1.0 - n as f64 * f64::EPSILON);
            for (k, p) in point.pull.iter().enumerate() {
                slope[k] += shrink * p;
                sizes[k] += p.abs();
            }
        }
        let mut rounding = 0.0;
        for k in 0..n {
            let least = self.least_cost(k, slope[k]);
            let most = self.lower[k].abs().max(self.upper[k].abs());
            value += least;
            size += least.abs();
            rounding += sizes[k] * most;
        }
        // Half an epsilon for each addition and product, whatever their order.
        value - 0.5 * f64::EPSILON * (terms * rounding + (terms + n as f64) * size)
    }
}

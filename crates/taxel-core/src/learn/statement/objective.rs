//! What the objective is made of: 6.14, of which 6.11 is the case without C and D.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::targets::{TargetRow, Targets};
use crate::vectors::dot;

/// An objective that is known to this share of what it is of no weights at all is known; one below that share of it is 0.
pub(crate) const NOTHING: f64 = 1e-10;

/// What B(w) is divided by.
///
/// Reading: 6.14 prints `B_max`, under which kappa is nearly powerless; divided by the number of targets it does what 6.4.5
/// and figure 6.9 say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Divisor {
    /// Its largest value over the bounds, as printed.
    #[default]
    #[serde(rename = "B_max")]
    Largest,
    /// How many targets there are.
    #[serde(rename = "targets")]
    Targets,
}

/// Whether the l2 term is the norm, as printed, or its square.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Norm {
    /// `|w|_2 / |w_max|_2` (6.14, and the code of Appendix 2).
    #[default]
    Norm,
    /// `|w|_2^2 / |w_max|_2^2`.
    Square,
}

/// The five terms of 6.14, weighted and normalised: their sum is the objective.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(non_snake_case)]
pub struct Parts {
    /// Sum of absolute weights.
    pub l1: f64,
    /// Length of the weights, or its square.
    pub l2: f64,
    /// Missed lift behind the targets (6.10).
    pub B: f64,
    /// Missed targets (6.12).
    pub C: f64,
    /// Broken silence (6.13).
    pub D: f64,
}

impl Parts {
    pub(crate) fn sum(&self) -> f64 {
        self.l1 + self.l2 + self.B + self.C + self.D
    }
}

/// Everything that turns potentials into 6.14: what each term counts by, over its largest value, and the bounds.
#[derive(Debug, Clone)]
pub(crate) struct Objective {
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
    /// What the potential shall reach behind a target, in thresholds.
    pub(crate) kappa: f64,
    pub(crate) norm: Norm,
    pub(crate) bounds: Bounds,
}

/// What a caller chooses of the objective.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Choice {
    /// `lambda_1` to `lambda_5`; where all are 0 any weights will do.
    pub(crate) lambdas: [f64; 5],
    pub(crate) kappa: f64,
    pub(crate) norm: Norm,
    pub(crate) divisor: Divisor,
}

impl Objective {
    /// Normalises the terms; `d_max` gives what D comes to at the largest weights, `unit` is what a potential of 1 is, mV.
    ///
    /// `silent` are the largest weights of trains without a spike, which no row has a coefficient for: their weights are 0, and
    /// the normalisers of l1 and l2 count them as they count every train.
    ///
    /// Reading: 6.3.2 takes each term's largest value over the bounds, which lie at -ub and ub; where they do not, over
    /// -max(|lb|, |ub|) to max(|lb|, |ub|), synapse by synapse.
    pub(crate) fn new(
        choice: Choice,
        bounds: Bounds,
        silent: &[f64],
        targets: &Targets,
        unit: f64,
        d_max: impl FnOnce(&[f64]) -> f64,
    ) -> Self {
        let Choice { lambdas, kappa, norm, divisor } = choice;
        let sum: f64 = lambdas.iter().sum();
        let [l1, l2, b, c, d] = lambdas.map(|l| if sum > 0.0 { l / sum } else { 0.0 });
        let most: Vec<f64> = bounds.lower.iter().zip(&bounds.upper).map(|(l, u)| l.abs().max(u.abs())).collect();
        let over = |share: f64, most: f64| if most > 0.0 { share / most } else { 0.0 };
        let lifted = |row: TargetRow<'_>| (dot(row.behind, &most) + kappa * row.threshold).powi(2);
        let missed = |row: TargetRow<'_>| dot(row.at, &most) + row.threshold;
        let square = dot(&most, &most) + dot(silent, silent);
        Self {
            l1: over(l1, most.iter().chain(silent).sum()),
            l2: match norm {
                Norm::Norm => over(l2, square.sqrt()),
                Norm::Square => over(l2, square),
            },
            b: match divisor {
                Divisor::Largest => over(b, targets.iter().map(lifted).sum()),
                // A sum of squares over a number: the one term that is no ratio of potentials.
                Divisor::Targets => over(b, targets.len() as f64) * unit.powi(2),
            },
            c: if c > 0.0 { over(c, targets.iter().map(missed).sum()) } else { 0.0 },
            d: if d > 0.0 { over(d, d_max(&most)) } else { 0.0 },
            kappa,
            norm,
            bounds,
        }
    }

    /// The terms of the weights alone: l1, and l2.
    pub(crate) fn norms(&self, weights: &[f64]) -> (f64, f64) {
        (self.l1 * weights.iter().map(|w| w.abs()).sum::<f64>(), self.of_square(dot(weights, weights)))
    }

    /// The l2 term of weights whose squares sum to this.
    pub(crate) fn of_square(&self, square: f64) -> f64 {
        self.l2 * if self.norm == Norm::Norm { square.sqrt() } else { square }
    }

    /// How far the potential misses `kappa` thresholds behind each target, mV.
    pub(crate) fn unlifted(&self, targets: &Targets, weights: &[f64]) -> Vec<f64> {
        targets.iter().map(|row| dot(row.behind, weights) - self.kappa * row.threshold).collect()
    }

    /// 6.11 at these weights, by its terms.
    pub(crate) fn exact_parts(&self, targets: &Targets, weights: &[f64]) -> Parts {
        let (l1, l2) = self.norms(weights);
        let missed = if self.b > 0.0 { self.unlifted(targets, weights) } else { vec![] };
        Parts { l1, l2, B: self.b * dot(&missed, &missed), ..Parts::default() }
    }

    /// The same, every term times `scale`.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        let (l1, l2, b, c, d) = (self.l1 * scale, self.l2 * scale, self.b * scale, self.c * scale, self.d * scale);
        Self { l1, l2, b, c, d, ..self.clone() }
    }

    /// No weights whose objective is `most` or less hold one larger than this: l1 and l2 alone would come to more.
    pub(crate) fn reach(&self, most: f64) -> f64 {
        let reach = match self.norm {
            Norm::Norm => most / (self.l1 + self.l2),
            Norm::Square => (most / self.l1).min((most / self.l2).sqrt()),
        };
        // Widened against rounding; without l1 and l2 there is no limit.
        if reach.is_nan() { f64::INFINITY } else { reach * (1.0 + 1e-9) }
    }

    /// The same within bounds as narrow as that: the least lies within them too.
    pub(crate) fn within_reach(&self, most: f64) -> Self {
        let (reach, Bounds { lower, upper }) = (self.reach(most), &self.bounds);
        let lower = lower.iter().map(|l| l.max(-reach)).collect();
        let upper = upper.iter().map(|u| u.min(reach)).collect();
        Self { bounds: Bounds { lower, upper }, ..self.clone() }
    }
}

/// The share of an objective that a bound below its least value leaves open; all where either is no number.
pub(crate) fn relative_gap(objective: f64, bound: f64) -> f64 {
    let gap = if objective <= bound { 0.0 } else { (objective - bound) / objective };
    if gap.is_nan() { f64::INFINITY } else { gap }
}

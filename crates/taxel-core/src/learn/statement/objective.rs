//! The terms of the objective 6.14; 6.11 is the case without C and D.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::targets::{TargetRow, Targets};
use crate::vectors::dot;

/// The relative accuracy of an objective, as a share of its value at weights of 0; values below that share count as 0.
pub(crate) const NOTHING: f64 = 1e-10;

macro_rules! divisors {
    ($($(#[$about:meta])* $name:ident $printed:literal;)*) => {$(
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
        pub enum $name {
            /// Its largest value over the bounds, as printed.
            #[default]
            #[serde(rename = $printed)]
            Largest,
            /// The number of targets (for D, 1 if there is none).
            #[serde(rename = "targets")]
            Targets,
        }
    )*};
}

divisors! {
    /// The normaliser of B(w).
    ///
    /// Reading: 6.14 prints `B_max`, with which kappa has almost no effect; with the number of targets it has the effect
    /// described in 6.4.5 and figure 6.9.
    Divisor "B_max";
    /// The normaliser of C(w).
    DivisorC "C_max";
    /// The normaliser of D(w).
    ///
    /// Reading: with `D_max` a silent row weighs the less the more rows there are, so that the weight of a target
    /// relative to one row depends on the length of the recording; with the number of targets it does not.
    DivisorD "D_max";
}

/// The potentials that count as a miss, in B and in C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sides {
    /// Those above and those below what is required, as printed.
    #[default]
    Both,
    /// Only those below.
    Below,
}

impl Sides {
    /// The slopes below and above a kink whose distances cost `factor` each.
    pub(crate) fn slopes(self, factor: f64) -> [f64; 2] {
        [-factor, if self == Self::Both { factor } else { 0.0 }]
    }
}

/// How distances add up in B.
///
/// Reading: 6.10 prints squares, whose pull vanishes near `kappa` thresholds; under the sum of the distances a large
/// factor ensures them, as 6.6.2 says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FormB {
    /// The sum of their squares, as printed.
    #[default]
    Square,
    /// Their sum.
    Sum,
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
    /// The sum of absolute weights.
    pub l1: f64,
    /// The length of the weights, or its square.
    pub l2: f64,
    /// The squared distances of the potential after the targets to `kappa` thresholds (6.10), or the distances.
    pub B: f64,
    /// The distances of the potential to the threshold at the targets (6.12).
    pub C: f64,
    /// The violations of silence (6.13).
    pub D: f64,
}

impl Parts {
    pub(crate) fn sum(&self) -> f64 {
        self.l1 + self.l2 + self.B + self.C + self.D
    }
}

/// The normalised factors of the terms of 6.14, and the bounds.
#[derive(Debug, Clone)]
pub(crate) struct Objective {
    pub(crate) l1: f64,
    pub(crate) l2: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
    pub(crate) d: f64,
    pub(crate) choice: Choice,
    pub(crate) bounds: Bounds,
}

/// The caller's choices for the objective.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Choice {
    /// `lambda_1` to `lambda_5`; if all are 0, any feasible weights are optimal.
    pub(crate) lambdas: [f64; 5],
    /// The potential that B aims at after a target, in thresholds.
    pub(crate) kappa: f64,
    pub(crate) norm: Norm,
    pub(crate) form_b: FormB,
    /// The divisors of B, C and D.
    pub(crate) divisors: (Divisor, DivisorC, DivisorD),
    pub(crate) sides_b: Sides,
    pub(crate) sides_c: Sides,
}

impl Objective {
    /// Normalises the terms; `d_max` computes D at the largest weights, `unit` is the internal unit of potentials, mV.
    ///
    /// `silent` are the largest absolute weights of trains without a spike. No row has a coefficient for them, so their
    /// weights are 0, but the normalisers of l1 and l2 include them like every train.
    ///
    /// Reading: 6.3.2 takes each term's largest value over bounds at -ub and ub; for other bounds, the largest value is
    /// taken over -max(|lb|, |ub|) to max(|lb|, |ub|), synapse by synapse. Graded inputs can make a coefficient negative:
    /// B and C are then the sums of each row's own largest value, and D is taken with all values made positive.
    pub(crate) fn new(
        choice: Choice,
        bounds: Bounds,
        silent: &[f64],
        targets: &Targets,
        unit: f64,
        d_max: impl FnOnce(&[f64]) -> f64,
    ) -> Self {
        let Choice { lambdas, kappa, norm, form_b, divisors: (of_b, of_c, of_d), .. } = choice;
        let power = if form_b == FormB::Square { 2 } else { 1 };
        let sum: f64 = lambdas.iter().sum();
        let [l1, l2, b, c, d] = lambdas.map(|l| if sum > 0.0 { l / sum } else { 0.0 });
        let most: Vec<f64> = bounds.lower.iter().zip(&bounds.upper).map(|(l, u)| l.abs().max(u.abs())).collect();
        let over = |share: f64, most: f64| if most > 0.0 { share / most } else { 0.0 };
        let reach = |row: &[f64]| dot(&row.iter().map(|a| a.abs()).collect::<Vec<f64>>(), &most);
        let lifted = |row: TargetRow<'_>| (reach(row.behind) + kappa * row.threshold).powi(power);
        let missed = |row: TargetRow<'_>| reach(row.at) + row.threshold;
        let square = dot(&most, &most) + dot(silent, silent);
        // The number of targets has no unit, so these terms scale with the unit of potentials, or with its square.
        let count = targets.len() as f64;
        Self {
            l1: over(l1, most.iter().chain(silent).sum()),
            l2: match norm {
                Norm::Norm => over(l2, square.sqrt()),
                Norm::Square => over(l2, square),
            },
            b: match of_b {
                Divisor::Largest => over(b, targets.iter().map(lifted).sum()),
                Divisor::Targets => over(b, count) * unit.powi(power),
            },
            c: match of_c {
                DivisorC::Largest if c > 0.0 => over(c, targets.iter().map(missed).sum()),
                DivisorC::Largest => 0.0,
                DivisorC::Targets => over(c, count) * unit,
            },
            d: match of_d {
                DivisorD::Largest if d > 0.0 => over(d, d_max(&most)),
                DivisorD::Largest => 0.0,
                DivisorD::Targets => over(d, count.max(1.0)) * unit,
            },
            choice,
            bounds,
        }
    }

    /// The terms l1 and l2 at these weights.
    pub(crate) fn norms(&self, weights: &[f64]) -> (f64, f64) {
        (self.l1 * weights.iter().map(|w| w.abs()).sum::<f64>(), self.l2_term(dot(weights, weights)))
    }

    /// The l2 term, given the sum of squared weights.
    pub(crate) fn l2_term(&self, square: f64) -> f64 {
        self.l2 * if self.choice.norm == Norm::Norm { square.sqrt() } else { square }
    }

    /// The distance of the potential after each target to `kappa` thresholds, mV.
    pub(crate) fn missing_lift(&self, targets: &Targets, weights: &[f64]) -> Vec<f64> {
        targets.iter().map(|row| dot(row.behind, weights) - self.choice.kappa * row.threshold).collect()
    }

    /// B at these distances of the potentials to `kappa` thresholds, mV.
    pub(crate) fn b_at(&self, distances: &[f64]) -> f64 {
        let counted: Vec<f64> = distances.iter().map(|&x| self.counts_in_b(x)).collect();
        self.b
            * match self.choice.form_b {
                FormB::Square => dot(&counted, &counted),
                FormB::Sum => counted.iter().map(|x| x.abs()).sum(),
            }
    }

    /// The difference of objectives that counts as none beside B where every potential is 0.
    pub(crate) fn nothing_of_b(&self, targets: &Targets) -> f64 {
        NOTHING
            * self.b_at(&targets.thresholds.iter().map(|threshold| -self.choice.kappa * threshold).collect::<Vec<_>>())
    }

    /// The distance that counts in B, given that of the potential to `kappa` thresholds, mV.
    pub(crate) fn counts_in_b(&self, distance: f64) -> f64 {
        if self.choice.sides_b == Sides::Both { distance } else { distance.min(0.0) }
    }

    /// C at one target without its factor, given the distance of the potential to the threshold, mV.
    pub(crate) fn c_at_distance(&self, distance: f64) -> f64 {
        if self.choice.sides_c == Sides::Both { distance.abs() } else { (-distance).max(0.0) }
    }

    /// The terms of 6.11 at these weights.
    pub(crate) fn exact_parts(&self, targets: &Targets, weights: &[f64]) -> Parts {
        let (l1, l2) = self.norms(weights);
        let missed = if self.b > 0.0 { self.missing_lift(targets, weights) } else { vec![] };
        Parts { l1, l2, B: self.b_at(&missed), ..Parts::default() }
    }

    /// This objective with every term multiplied by `scale`.
    pub(crate) fn scaled(&self, scale: f64) -> Self {
        let (l1, l2, b, c, d) = (self.l1 * scale, self.l2 * scale, self.b * scale, self.c * scale, self.d * scale);
        Self { l1, l2, b, c, d, ..self.clone() }
    }

    /// An upper bound on each weight if the objective is at most `most`: l1 and l2 alone would exceed it otherwise.
    pub(crate) fn reach(&self, most: f64) -> f64 {
        let reach = match self.choice.norm {
            Norm::Norm => most / (self.l1 + self.l2),
            Norm::Square => (most / self.l1).min((most / self.l2).sqrt()),
        };
        // Widened against rounding; without l1 and l2 there is no bound.
        if reach.is_nan() { f64::INFINITY } else { reach * (1.0 + 1e-9) }
    }

    /// This objective with bounds no wider than `reach(most)`, which exclude no optimum.
    pub(crate) fn within_reach(&self, most: f64) -> Self {
        let (reach, Bounds { lower, upper }) = (self.reach(most), &self.bounds);
        let lower = lower.iter().map(|l| l.max(-reach)).collect();
        let upper = upper.iter().map(|u| u.min(reach)).collect();
        Self { bounds: Bounds { lower, upper }, ..self.clone() }
    }
}

/// The relative difference between an objective and a lower bound; infinite if either is NaN.
pub(crate) fn relative_gap(objective: f64, bound: f64) -> f64 {
    let gap = if objective <= bound { 0.0 } else { (objective - bound) / objective };
    if gap.is_nan() { f64::INFINITY } else { gap }
}

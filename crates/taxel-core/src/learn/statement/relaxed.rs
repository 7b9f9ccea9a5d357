//! 6.14 at given weights, and a bound from below on the least it can be.

use crate::learn::cone::cone_r::{Norm, Objective, Parts, Problem};
use crate::vectors::{add, dot};

/// Weights, and where they bring the potential.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) weights: Vec<f64>,
    /// Potential less limit on the silent rows, then potential less threshold at the targets, mV.
    pub(crate) excess: Vec<f64>,
    /// Potential less `kappa` thresholds behind the targets, mV.
    pub(crate) behind: Vec<f64>,
    pub(crate) parts: Parts,
}

impl Problem {
    /// 6.14 at these weights.
    pub(crate) fn point(&self, objective: &Objective, weights: Vec<f64>) -> Point {
        let mut excess = Vec::with_capacity(self.silent.len() + self.targets.len());
        self.silent.potential(&weights, &mut excess);
        excess.iter_mut().zip(&self.silent.limit).for_each(|(u, limit)| *u -= limit);
        excess.extend(self.targets.iter().map(|row| dot(&row.at, &weights) - row.threshold));
        let behind: Vec<f64> =
            self.targets.iter().map(|r| dot(&r.behind, &weights) - objective.kappa * r.threshold).collect();
        let (silent, targets) = excess.split_at(self.silent.len());
        let square: f64 = weights.iter().map(|w| w * w).sum();
        let parts = Parts {
            l1: objective.l1 * weights.iter().map(|w| w.abs()).sum::<f64>(),
            l2: objective.l2 * if objective.norm == Norm::Norm { square.sqrt() } else { square },
            B: objective.b * behind.iter().map(|x| x * x).sum::<f64>(),
            C: objective.c * targets.iter().map(|x| x.abs()).sum::<f64>(),
            D: objective.d * silent.iter().map(|x| x.max(0.0)).sum::<f64>(),
        };
        Point { weights, excess, behind, parts }
    }

    /// A value that 6.14 cannot fall below, whatever the weights within the bounds, given that it can be `most` or less.
    ///
    /// Every term is replaced by a tangent below it, taken at some weights (which need not lie within the bounds): silence by
    /// multipliers between 0 and D's weight, targets by multipliers between minus and plus C's, the norm by a `pull` no
    /// longer than its factor, a square by its slope. What is left is linear and l1 over the box, and has its least value
    /// synapse by synapse. So the bound holds whoever found the multipliers, and however.
    pub(crate) fn bound(&self, objective: &Objective, at: &Tangents<'_>, most: f64) -> f64 {
        let reach = objective.reach(most);
        let silent = self.silent.len();
        let mut gradient = vec![0.0; self.trains];
        self.silent.add_sum(&at.multipliers[..silent], &mut gradient);
        let mut bound = 0.0;
        for ((target, multiplier), behind) in self.targets.iter().zip(&at.multipliers[silent..]).zip(at.behind) {
            add(&mut gradient, *multiplier, &target.at);
            add(&mut gradient, 2.0 * objective.b * behind, &target.behind);
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
            let (lower, upper) = (objective.lower[n].max(-reach), objective.upper[n].min(reach));
            let ends = cost(lower).min(cost(upper));
            bound += if lower < 0.0 && upper > 0.0 { ends.min(cost(0.0)) } else { ends };
        }
        bound
    }
}

/// Where 6.14 is touched from below: weights, what they do to the rows, a multiplier a row, and the pull of the norm.
pub(crate) struct Tangents<'a> {
    pub(crate) weights: &'a [f64],
    pub(crate) excess: &'a [f64],
    pub(crate) behind: &'a [f64],
    pub(crate) multipliers: &'a [f64],
    pub(crate) pull: &'a [f64],
}

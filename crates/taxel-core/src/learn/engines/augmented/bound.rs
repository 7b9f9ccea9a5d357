//! Lower bounds on 6.14.

use super::Lagrangian;
use crate::learn::statement::{Norm, RelaxedPoint, RelaxedProof, Tangents};
use crate::vectors::{add, dot};

impl Lagrangian<'_> {
    /// The lower bound that the present multipliers prove.
    pub(super) fn proof(&mut self) -> RelaxedProof {
        self.multipliers();
        let at = Tangents {
            weights: &self.weights,
            excess: &self.excess,
            behind: &self.behind,
            multipliers: &self.factors,
            pull: &self.pull(),
        };
        self.problem.proof(self.objective, &at, self.most)
    }

    /// The lower bound at weights of 0, with the subgradient of the norm nearest to the sum of all other slopes
    /// there.
    pub(super) fn proof_at_zero(&self, zero: &RelaxedPoint) -> RelaxedProof {
        let (problem, o) = (self.problem, self.objective);
        let silent = problem.silent.len();
        let slope = |(k, &x): (usize, &f64)| match k < silent {
            true => {
                if x > 0.0 {
                    o.d
                } else {
                    0.0
                }
            }
            false if x > 0.0 => o.kink_of_c().0 - o.c,
            false => o.c * x.signum(),
        };
        let multipliers: Vec<f64> = zero.excess.iter().enumerate().map(slope).collect();
        let mut pull = vec![0.0; self.weights.len()];
        if o.norm == Norm::Norm && o.l2 > 0.0 && zero.weights.iter().all(|&w| w == 0.0) {
            problem.silent.add_sum(&multipliers[..silent], &mut pull);
            for ((target, &multiplier), &behind) in problem.targets.iter().zip(&multipliers[silent..]).zip(&zero.behind)
            {
                add(&mut pull, multiplier, target.at);
                add(&mut pull, 2.0 * o.b * o.counts_in_b(behind), target.behind);
            }
            for (n, p) in pull.iter_mut().enumerate() {
                let soft = if *p > o.l1 {
                    *p - o.l1
                } else if *p < -o.l1 {
                    *p + o.l1
                } else {
                    0.0
                };
                let free = if soft > 0.0 { o.bounds.lower[n] < 0.0 } else { o.bounds.upper[n] > 0.0 };
                *p = if free { -soft } else { 0.0 };
            }
            let length = dot(&pull, &pull).sqrt();
            if length > o.l2 {
                pull.iter_mut().for_each(|p| *p *= o.l2 / length);
            }
        }
        let at = Tangents {
            weights: &zero.weights,
            excess: &zero.excess,
            behind: &zero.behind,
            multipliers: &multipliers,
            pull: &pull,
        };
        problem.proof(o, &at, zero.parts.sum())
    }
}

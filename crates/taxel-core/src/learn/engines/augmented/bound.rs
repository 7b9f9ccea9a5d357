//! Lower bounds on the objective.

use super::Lagrangian;
use crate::learn::statement::{Norm, Point, Proof};
use crate::vectors::dot;

impl Lagrangian<'_> {
    /// The lower bound that the present multipliers prove.
    pub(super) fn proof(&mut self) -> Proof {
        self.slopes();
        self.program.proof(&self.at, &self.factors, &self.pull(), self.most)
    }

    /// The lower bound on 6.14 at weights of 0, with the subgradient of the norm nearest to the sum of all other slopes
    /// there.
    pub(super) fn proof_at_zero(&self, zero: &Point) -> Proof {
        let (program, o) = (self.program, self.program.objective);
        let slope = |(k, &x): (usize, &f64)| {
            let [low, high] = program.slopes[program.kind(k)];
            if x > 0.0 {
                high
            } else if x < 0.0 {
                low
            } else {
                0.0
            }
        };
        let multipliers: Vec<f64> = zero.excess.iter().enumerate().map(slope).collect();
        let mut pull = vec![0.0; self.at.weights.len()];
        if o.choice.norm == Norm::Norm && o.l2 > 0.0 && zero.weights.iter().all(|&w| w == 0.0) {
            program.add_rows(&multipliers, &mut pull);
            program.add_slope_of_b(&zero.behind, &mut pull);
            for (n, p) in pull.iter_mut().enumerate() {
                let soft = (*p - o.l1).max(0.0) + (*p + o.l1).min(0.0);
                let free = if soft > 0.0 { o.bounds.lower[n] < 0.0 } else { o.bounds.upper[n] > 0.0 };
                *p = if free { -soft } else { 0.0 };
            }
            let length = dot(&pull, &pull).sqrt();
            if length > o.l2 {
                pull.iter_mut().for_each(|p| *p *= o.l2 / length);
            }
        }
        program.proof(zero, &multipliers, &pull, zero.parts.sum())
    }
}

//! An objective of B alone: proximal steps, each solved exactly by the dual active set.
//!
//! B has curvature in only as many directions as there are targets, so its minimum is a whole face of weights, on which
//! neither an interior point nor a polish can identify what binds. `lift |B w - m|^2 + rho/2 |w - c|^2` has a unique
//! minimum. With `u = w - c` and `y = sqrt(2 lift/rho) (B w - m)` it is the least `|u|^2 + |y|^2`, a problem for the
//! dual active set. The centre c then moves to that minimum; as c converges, the multipliers become those of B alone
//! (Rockafellar 1976, SIAM J. Control 14:877).

use super::best::BestPoint;
use super::program::{PrimalDualPoint, Program, power_of_2};
use crate::learn::engines::{DualActiveSet, SolveOutcome};
use crate::vectors::dot;
use crate::{Result, Stop};

const MOST_STEPS: usize = 30;
/// The curvature of the first steps relative to that of B, the factor by which it falls after a small gain, and its
/// least value.
const CURVATURE: f64 = 1e-8;
const SMALLER: f64 = 0.01;
const LEAST_CURVATURE: f64 = 1e-16;

impl BestPoint<'_> {
    /// Proximal steps from these weights until the gap is at most `tolerance`, or the weights no longer change.
    pub(super) fn proximal(&mut self, from: &[f64], tolerance: f64, stop: Stop<'_>) -> Result<()> {
        let (mut centre, mut curvature) = (from.to_vec(), CURVATURE);
        for _ in 0..MOST_STEPS {
            let before = self.gap();
            let Some(point) = self.program.step(&centre, curvature, stop)? else { return Ok(()) };
            centre.clone_from(&point.weights);
            self.offer(point, None);
            if self.gap() <= tolerance {
                return Ok(());
            }
            if self.gap() > 0.1 * before {
                if curvature <= LEAST_CURVATURE {
                    return Ok(());
                }
                curvature *= SMALLER;
            }
        }
        Ok(())
    }
}

impl Program {
    /// The minimum of B with this relative curvature around a centre; `None` on a stop, or if rounding prevents a
    /// solution.
    fn step(&self, centre: &[f64], curvature: f64, stop: Stop<'_>) -> Result<Option<PrimalDualPoint>> {
        let (n, targets) = (self.width(), self.wanted.len());
        let steepest = self.behind.chunks_exact(n).map(|row| dot(row, row)).fold(0.0, f64::max);
        // In units of the rows: rho = 2 lift scale^2.
        let scale = power_of_2((curvature * steepest).sqrt());
        let rho = 2.0 * self.lift * scale * scale;
        let room = |bounds: &[f64], beyond: f64| -> Vec<f64> {
            let near = bounds.iter().zip(centre).map(|(bound, w)| bound - w);
            near.chain(std::iter::repeat_n(beyond, targets)).collect()
        };
        let mut engine = DualActiveSet::new(&room(&self.lower, f64::NEG_INFINITY), &room(&self.upper, f64::INFINITY))?;
        let mut row = vec![0.0; n + targets];
        let mut state = |coefficients: &[f64], limit: f64, behind: Option<usize>| {
            row[n..].fill(0.0);
            row[..n].copy_from_slice(coefficients);
            if let Some(k) = behind {
                row[n + k] = -scale;
            }
            (row.clone(), limit - dot(coefficients, centre))
        };
        for (coefficients, &value) in self.equal.chunks_exact(n).zip(&self.equal_to) {
            let (row, left) = state(coefficients, value, None);
            engine.equality(&row, left)?;
        }
        for (k, (coefficients, &wanted)) in self.behind.chunks_exact(n).zip(&self.wanted).enumerate() {
            let (row, left) = state(coefficients, wanted, Some(k));
            engine.equality(&row, left)?;
        }
        for (coefficients, &limit) in self.below.chunks_exact(n).zip(&self.limit) {
            let (row, left) = state(coefficients, limit, None);
            engine.inequality(&row, left)?;
        }
        if engine.solve(stop)? != SolveOutcome::Optimal {
            return Ok(None);
        }
        let moved = centre.iter().zip(engine.weights()).map(|(w, step)| w + step);
        let weights = moved.zip(self.lower.iter().zip(&self.upper)).map(|(w, (l, u))| w.clamp(*l, *u)).collect();
        let multipliers = engine.multipliers();
        let mut inequality = vec![0.0; self.limit.len()];
        for (id, z) in multipliers.inequalities {
            inequality[id.index()] = rho * z;
        }
        let equality = multipliers.equalities[..self.equal_to.len()].iter().map(|y| rho * y).collect();
        Ok(Some(PrimalDualPoint { weights, equality, inequality, pull: vec![0.0; n] }))
    }
}

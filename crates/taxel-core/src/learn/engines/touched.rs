//! The last step of CONE-R: moves the weights exactly onto the targets that the optimum reaches, and off touched silent
//! rows.

use super::minimise::Minimum;
use super::nearest::{HardRows, nearest};
use crate::learn::statement::{Objective, Relaxed, relative_gap};
use crate::{Result, Stop};

/// A row counts as met by the optimum if its multiplier is this far inside its range (of 1) and its violation is at
/// most `NEARLY_MET` of `theta_0`.
const WITHIN: f64 = 1e-6;
const NEARLY_MET: f64 = 1e-3;
/// Silent rows that the optimum touches are moved this share of `theta_0` below their limit.
const BELOW: f64 = 1e-9;
/// The share of the tolerance that this step may use; the rest is left for a later fit that starts here.
const SPARED: f64 = 0.3;
/// If the optimum touches more rows per synapse than this, they are left as they are.
const MOST_TOUCHED: usize = 4;

impl Relaxed {
    /// Removes violations within the solver's rounding error, because a neuron fires where its potential touches the
    /// threshold.
    ///
    /// At the optimum a target whose multiplier is inside its range is reached exactly, and a silent row likewise; here
    /// such a silent row is moved just below its limit. The step is undone if the objective would leave the tolerance;
    /// returns whether the weights moved.
    pub(crate) fn move_to_limits(
        &self,
        objective: &Objective,
        tolerance: f64,
        Minimum { fit: found, shares, .. }: &mut Minimum,
        stop: Stop<'_>,
    ) -> Result<bool> {
        let (silent, theta) = (self.silent.len(), self.theta_0);
        let program = self.program(objective);
        if found.gap > tolerance || shares.len() != program.rows() {
            return Ok(false);
        }
        let excess = program.point(found.weights.clone()).excess;
        let within = |row: usize| {
            let share = shares[row] - program.least_share(row);
            excess[row].abs() <= NEARLY_MET * theta && share > WITHIN && share < 1.0 - WITHIN
        };
        let targets: Vec<usize> = (0..program.rows() - silent).filter(|k| within(silent + k)).collect();
        let touched = |row: &usize| within(*row) || (-BELOW..WITHIN).contains(&(excess[*row] / theta));
        let rows: Vec<usize> = (0..silent).filter(touched).collect();
        let met = targets.iter().all(|k| excess[silent + k].abs() <= 0.1 * self.touch);
        let off = rows.iter().all(|row| excess[*row] <= -0.5 * BELOW * theta);
        if met && off || targets.len() + rows.len() > MOST_TOUCHED * self.trains {
            return Ok(false);
        }
        let equal: Vec<f64> = targets.iter().flat_map(|k| program.stored_row(*k).iter().copied()).collect();
        let wanted: Vec<f64> = program.stored().map(|(_, wanted)| wanted).collect();
        let equal_to: Vec<f64> = targets.iter().map(|k| wanted[*k]).collect();
        let below = self.silent.coefficients(&rows);
        let limit: Vec<f64> = rows.iter().map(|row| self.silent.limit[*row] - BELOW * theta).collect();
        let all = HardRows { equal: &equal, equal_to: &equal_to, below: &below, limit: &limit };
        let least = found.objective * (1.0 - found.gap);
        let targets_alone = HardRows { below: &[], limit: &[], ..all };
        for rows in [all, targets_alone].into_iter().take(if met { 1 } else { 2 }) {
            let Some(weights) = nearest(&found.weights, &rows, &objective.bounds.lower, &objective.bounds.upper, stop)?
            else {
                continue;
            };
            let point = program.point(weights);
            let sum = point.parts.sum();
            let gap = relative_gap(sum, least);
            if gap <= SPARED * tolerance {
                (found.weights, found.parts, found.objective, found.gap) = (point.weights, point.parts, sum, gap);
                return Ok(true);
            }
        }
        Ok(false)
    }
}

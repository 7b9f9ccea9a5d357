//! The final projection: the nearest weights that satisfy hard rows to rounding.

use super::dual_active_set::{DualActiveSet, SolveOutcome};
use crate::vectors::dot;
use crate::{Result, Stop};

/// Rows that must be satisfied, stored one after the other: `equal.w = equal_to`, `below.w <= limit`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HardRows<'a> {
    pub(crate) equal: &'a [f64],
    pub(crate) equal_to: &'a [f64],
    pub(crate) below: &'a [f64],
    pub(crate) limit: &'a [f64],
}

/// The weights within the bounds that satisfy all rows and are nearest to `weights`; `None` if there are none, or on a
/// stop.
pub(crate) fn nearest(
    weights: &[f64],
    rows: &HardRows<'_>,
    lower: &[f64],
    upper: &[f64],
    stop: Stop<'_>,
) -> Result<Option<Vec<f64>>> {
    // Finds the shortest step that removes the violation of each row; a short step is rounded little. The step is in
    // units of the largest violation, which is far above the tolerance. Weights without room take no part.
    let width = weights.len().max(1);
    let free: Vec<usize> = (0..weights.len()).filter(|&n| lower[n] < upper[n]).collect();
    if free.is_empty() {
        return Ok(None);
    }
    let left = |rows: &[f64], limits: &[f64]| -> Vec<f64> {
        rows.chunks_exact(width).zip(limits).map(|(row, limit)| limit - dot(row, weights)).collect()
    };
    let (equal, below) = (left(rows.equal, rows.equal_to), left(rows.below, rows.limit));
    let most = equal.iter().map(|l| l.abs()).chain(below.iter().map(|l| -l)).fold(f64::MIN_POSITIVE, f64::max);
    let unit = most.log2().ceil().exp2();
    let of_free = |values: &[f64]| -> Vec<f64> { free.iter().map(|&n| values[n]).collect() };
    let room = |bounds: &[f64]| -> Vec<f64> { free.iter().map(|&n| (bounds[n] - weights[n]) / unit).collect() };
    let mut engine = DualActiveSet::new(&room(lower), &room(upper))?;
    for (row, left) in rows.equal.chunks_exact(width).zip(equal) {
        engine.equality(&of_free(row), left / unit)?;
    }
    for (row, left) in rows.below.chunks_exact(width).zip(below) {
        engine.inequality(&of_free(row), left / unit)?;
    }
    if engine.solve(stop)? != SolveOutcome::Optimal {
        return Ok(None);
    }
    let mut moved = weights.to_vec();
    for (&n, step) in free.iter().zip(engine.weights()) {
        moved[n] = (weights[n] + unit * step).clamp(lower[n], upper[n]);
    }
    Ok(Some(moved))
}

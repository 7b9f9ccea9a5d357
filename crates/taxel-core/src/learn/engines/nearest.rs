//! The final projection: the nearest weights that satisfy hard rows to rounding.

use super::cone_program::HardRows;
use super::dual_active_set::{DualActiveSet, SolveOutcome};
use crate::vectors::dot;
use crate::{Result, Stop};

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
    // units of the largest violation, which is far above the tolerance.
    let width = weights.len().max(1);
    let left = |rows: &[f64], limits: &[f64]| -> Vec<f64> {
        rows.chunks_exact(width).zip(limits).map(|(row, limit)| limit - dot(row, weights)).collect()
    };
    let (equal, below) = (left(rows.equal, rows.equal_to), left(rows.below, rows.limit));
    let most = equal.iter().map(|l| l.abs()).chain(below.iter().map(|l| -l)).fold(f64::MIN_POSITIVE, f64::max);
    let unit = most.log2().ceil().exp2();
    let room = |bounds: &[f64]| -> Vec<f64> { bounds.iter().zip(weights).map(|(b, w)| (b - w) / unit).collect() };
    let mut engine = DualActiveSet::new(&room(lower), &room(upper))?;
    for (row, left) in rows.equal.chunks_exact(width).zip(equal) {
        engine.equality(row, left / unit)?;
    }
    for (row, left) in rows.below.chunks_exact(width).zip(below) {
        engine.inequality(row, left / unit)?;
    }
    if engine.solve(stop)? != SolveOutcome::Optimal {
        return Ok(None);
    }
    let moved = weights.iter().zip(engine.weights()).map(|(w, step)| w + unit * step);
    Ok(Some(moved.zip(lower.iter().zip(upper)).map(|(w, (l, u))| w.clamp(*l, *u)).collect()))
}

//! The mixed objective over a working set: l1, l2 (norm or square) and B, with targets and silence as hard rows.
//!
//! Minimise `l1 |w|_1 + l2 |w|_2 (or |w|_2^2) + lift sum_k (behind_k.w - wanted_k)^2` over `equal.w = equal_to`,
//! `below.w <= limit` and `lower <= w <= upper`. An interior-point method approaches the optimum, a polish on the
//! binding rows and bounds ends exactly, and a bound that is valid for any multipliers limits the distance to the least
//! objective.

mod best;
mod dense;
mod interior;
mod polish;
mod program;
mod proximal;
#[cfg(test)]
mod tests;

use super::cone_program::HardRows;
use crate::learn::fit::Engine;
use crate::learn::statement::Bounds;
use crate::{Error, Result, Stop};
use best::{BestPoint, MixedMinimum, ResumeState};
use interior::Interior;
pub(crate) use program::MixedProof;
use program::Program;
pub(crate) use program::Terms;

/// At looser tolerances the interior point is returned as it is: the caller then needs violated rows, not exact
/// weights.
const LOOSE: f64 = 1e-5;
/// Gaps at which a polish is attempted.
const TRIES: [f64; 3] = [1e-6, 1e-9, 1e-12];

/// Minimises the objective over these rows and bounds.
///
/// `size` is the largest weight of some feasible weights, since bounds may be far wider than the scale of the weights.
/// With a `tolerance` above 1e-5 the weights are those of an interior point near the optimum: they satisfy rows about
/// as well as that, and the rows they violate are worth adding. Below it, rows are satisfied to rounding, and the gap
/// is `tolerance` if the bound proves it.
///
/// # Errors
///
/// `Problem` if Clarabel, the last resort, refuses the problem.
pub(crate) fn minimise(
    terms: &Terms<'_>,
    rows: &HardRows<'_>,
    bounds: &Bounds,
    size: f64,
    start: Option<&ResumeState>,
    tolerance: f64,
    stop: Stop<'_>,
) -> Result<MixedMinimum> {
    let program = Program::new(terms, rows, bounds, size);
    let interior = Interior::new(&program);
    let mut best = BestPoint::new(&program);
    if let Some(ResumeState { state, exact: Some((point, guess)) }) = start
        && tolerance <= LOOSE
    {
        // After a few new rows, a few exchanges are often enough.
        best.exchange(point, guess, tolerance, stop);
        if best.gap() <= tolerance || stop.asked() {
            return Ok(best.minimum(Engine::Native, stop.asked(), state.clone()));
        }
    }
    let mut state = start.map_or_else(|| interior.start(), |s| interior.resume(&s.state));
    if tolerance > LOOSE {
        let near = interior.solve(&mut state, tolerance, stop);
        best.offer(near.point, None);
        return Ok(best.minimum(Engine::Native, stop.asked(), state));
    }
    for aim in TRIES {
        let near = interior.solve(&mut state, aim, stop);
        best.improve(&near.point, near.guess, tolerance, stop)?;
        if best.gap() > tolerance && program.is_lift_alone() {
            best.proximal(&near.point.weights, tolerance, stop)?;
        }
        if best.gap() <= tolerance || stop.asked() {
            return Ok(best.minimum(Engine::Native, stop.asked(), state));
        }
    }
    match program.clarabel(stop) {
        Ok(point) => {
            let guess = program.guess(&point);
            best.improve(&point, guess, tolerance, stop)?;
        }
        Err(Error::Interrupted) => {}
        Err(error) => return Err(error),
    }
    Ok(best.minimum(Engine::ConeSolver, stop.asked(), state))
}

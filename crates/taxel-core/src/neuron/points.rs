//! How many points a grid in time has, and how many are too many.

use crate::{Result, problem};

/// So many points are laid out at most (some GB), and so many stepped through (some ten seconds).
pub(crate) const MOST_LAID_OUT: f64 = 2e7;
pub(super) const MOST_STEPPED: f64 = 1e9;

/// How many points of a grid of `step_ms` lie from `start` to `end`, ms.
pub(crate) fn points_between(start: f64, end: f64, step_ms: f64) -> f64 {
    (((end - start) / step_ms + 1e-9).floor() + 1.0).max(0.0)
}

/// Refuses more points than can be had, before memory is asked for.
pub(crate) fn check_points(points: f64, most: f64, step_ms: f64) -> Result<()> {
    if points <= most {
        return Ok(());
    }
    Err(problem!(
        "step_ms is {step_ms} ms: makes {points:.1e} grid points, at most {most:.0e} can be had; take a larger step, or fewer or \
         shorter patterns (times are in ms)"
    ))
}

//! Solvers that minimise over given rows, whatever these rows mean.

mod augmented;
mod dual_active_set;
mod minimise;
mod nearest;
mod touched;

pub(crate) use augmented::{ACCURACY, Between, FINEST, Reached, WarmStart};
pub use dual_active_set::{DualActiveSet, Multipliers, Ray, RowId, SolveOutcome};
pub(crate) use nearest::{HardRows, nearest};

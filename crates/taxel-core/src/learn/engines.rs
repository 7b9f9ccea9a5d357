//! Solvers that minimise over given rows, whatever these rows mean.

mod augmented;
mod cone_program;
mod dual_active_set;
mod minimise;
pub(crate) mod mixed;
mod nearest;
mod rounds;
mod touched;

pub(crate) use augmented::WarmStart;
pub(crate) use cone_program::{ConeProgram, HardRows, Hinges};
pub use dual_active_set::{DualActiveSet, Multipliers, Ray, RowId, SolveOutcome};
pub(crate) use nearest::nearest;

//! Learning weights from examples: patterns of input spikes, and the target times at which the neuron must fire.
//!
//! `statement` turns the thesis' equations 6.9 to 6.14 into rows and an objective; `engines` are the solvers, which
//! know rows only; `cone` has the learners CONE-X and CONE-R, `online` the sliding window.

mod cone;
mod engines;
mod fit;
mod online;
mod statement;

pub use cone::{ConeR, ConeRFit, ConeRProblem, ConeX, ConeXFit, ConeXProblem, GapMultipliers, Shares};
pub use engines::{DualActiveSet, Multipliers, Ray, RowId, SolveOutcome};
pub use fit::{Fit, Left, Round, Status};
pub use online::OnlineConeR;
pub use statement::{
    Bounds, Certificate, Divisor, DivisorC, DivisorD, FormB, Margin, Norm, OneOrEach, Parts, Row, Sides, StatedRow,
};
pub use statement::{check_examples, check_pattern, check_some_target, check_trains};

//! Learns weights from examples: patterns of input spikes, and the times at which the neuron must fire.
//!
//! `statement` defines the conditions of the thesis' equations 6.9 to 6.14 on the weights; `engines` solve the
//! minimisation over given rows; `cone` contains the learners CONE-X and CONE-R, `online` the learner with a sliding
//! window; `rivals` the rules of other authors.

mod cone;
mod engines;
mod fit;
mod online;
pub mod rivals;
mod statement;
mod stdp;

pub use cone::{ConeR, ConeRFit, ConeRProblem, ConeX, ConeXFit, ConeXProblem, Horizon, Shares};
pub use engines::{DualActiveSet, Multipliers, Ray, RowId, Verdict};
pub use fit::{Engine, Fit, Left, Round, Status};
pub use online::OnlineConeR;
pub use statement::{Bound, Bounds, Certificate, Divisor, Margin, Norm, Parts, Row, Stated};
pub use stdp::{Stdp, StdpNeuron};

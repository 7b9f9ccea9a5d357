//! Weights from examples: patterns of input spikes, and the times at which the neuron shall fire.
//!
//! `statement` says once what the thesis' equations 6.9 to 6.14 ask of the weights; `engines` minimise over rows that they are
//! handed; `cone` holds the learners CONE-X and CONE-R, `online` the window that slides; `rivals` the rules of others.

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

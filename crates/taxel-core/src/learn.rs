//! Weights from examples: patterns of input spikes, and the times at which the neuron shall fire.
//!
//! `statement` says once what the thesis' equations 6.9 to 6.14 ask of the weights; `engines` minimise over rows that they are
//! handed; `cone` holds the learners CONE-X and CONE-R, `online` the window that slides; `rivals` the rules of others.

pub mod cone;
mod engines;
mod online;
pub mod rivals;
pub mod statement;

pub use cone::{ConeR, ConeX};
pub use engines::{DualActiveSet, Multipliers, Ray, RowId, Verdict};
pub use online::OnlineConeR;
pub use statement::Bound;

//! The thesis' learners: CONE-X, which meets every row or proves that none do, and CONE-R, which misses as little as it can.

mod cone_r;
mod cone_x;
mod exact;
mod mix;
mod shortest;

pub use cone_r::{ConeR, ConeRFit, ConeRProblem, Shares};
pub use cone_x::{ConeX, ConeXFit, ConeXProblem, Horizon};

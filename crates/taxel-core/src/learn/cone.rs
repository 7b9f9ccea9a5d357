//! The thesis' learners: CONE-X, which satisfies every row or proves that no weights do, and CONE-R, which minimises
//! violations.

mod cone_r;
mod cone_x;
mod exact;
mod mix;
mod shortest;

pub use cone_r::{ConeR, ConeRFit, ConeRProblem, GapMultipliers, Shares};
pub use cone_x::{ConeX, ConeXFit, ConeXProblem};

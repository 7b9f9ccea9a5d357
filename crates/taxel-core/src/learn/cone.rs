//! The thesis' learners: CONE-X, which meets every row or proves that none do, and CONE-R, which misses as little as it can.

pub mod cone_r;
pub mod cone_x;

pub use cone_r::ConeR;
pub use cone_x::ConeX;

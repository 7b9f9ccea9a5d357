//! Learning as data arrives.

mod online_cone_r;

pub use online_cone_r::OnlineConeR;

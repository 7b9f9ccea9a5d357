//! The load on a sensor: its sum, its area and its centre, which follow each change of a taxel.

mod centre;
mod sums;
mod weights;

pub(crate) use centre::Coordinates;
pub(crate) use sums::Load;
pub(crate) use weights::Weights;

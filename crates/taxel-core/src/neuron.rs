//! The SRM0 neuron (thesis 6.3.1): output spikes from input spikes.
//!
//! [`Neuron`] holds the parameters, [`NeuronStream`] runs it spike by spike, in continuous time or on a grid;
//! [`Neuron::run`] is the same stream fed with whole trains, so live and recorded inputs give the same spikes.

mod continuous;
mod crossing;
mod grid;
mod kernel;
mod model;
mod points;
mod running;
mod streaming;
mod threshold;

pub(crate) use crossing::peak;
pub use kernel::{Kernel, KernelSum, Shape, Step};
pub(crate) use model::AT_EDGE;
pub use model::{AfterSpike, FirstThreshold, Neuron, Time};
pub use points::{Grid, GridTime, MOST_LAID_OUT, check_points, points_between};
pub use streaming::NeuronStream;
pub use threshold::OutputSpike;

/// The rounding error allowed for a sum of times: an absolute one, ms, and one in units of the last place, which is the
/// larger from about 20 minutes on.
const ROUNDING_MS: f64 = 1e-9;
const ROUNDINGS: f64 = 4.0;

/// The distance up to which two sums of times near `t` count as equal, ms.
pub(crate) fn rounding_ms(t: f64) -> f64 {
    (ROUNDINGS * f64::EPSILON * t.abs()).max(ROUNDING_MS)
}

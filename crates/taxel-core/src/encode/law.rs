//! The interface of every encoder in the registry.

use super::channels::Channels;
use super::stream::Stream;
use super::tare::Tare;
use crate::parameters::Described;
use crate::{Array, Result};

/// An encoder's parameters, checks, stream and trains.
pub(super) trait Law {
    /// Its parameters, with their defaults and ranges.
    fn described() -> Described
    where
        Self: Sized;

    /// Checks every parameter.
    fn check(&self) -> Result<()>;

    /// Begins a stream from an array; the parameters are checked.
    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>>;

    /// The number of spike trains that it makes of an array.
    fn trains(&self, array: &Array) -> usize {
        Channels::new(array).len()
    }

    /// Whether its spikes carry a signed value.
    fn signed(&self) -> bool {
        true
    }

    /// How much later than the touch itself a spike comes, ms: what its own rule costs.
    fn latency_ms(&self) -> f64 {
        0.0
    }

    /// Takes the taxels' rest; most read none.
    fn set_tare(&mut self, _tare: &Tare) {}
}

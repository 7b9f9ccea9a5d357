//! What every encoder of the registry says of itself.

use super::sampled::Channels;
use super::stream::Stream;
use super::tare::Tare;
use crate::parameters::Described;
use crate::{Array, Result};

/// What an encoder's file says of it.
pub(super) trait Law {
    /// Its parameters, with their defaults and ranges.
    fn described() -> Described
    where
        Self: Sized;

    /// Checks every parameter.
    fn check(&self) -> Result<()>;

    /// Begins to encode what an array feels; the parameters are checked.
    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>>;

    /// On how many trains it speaks for an array.
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

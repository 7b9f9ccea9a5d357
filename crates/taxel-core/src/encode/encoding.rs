//! The interface of every encoder in the registry.

use super::channels::Channels;
use super::driver::Trains;
use super::stream::Stream;
use super::tare::Tare;
use crate::{Array, Result, SpikeKind};

/// An encoder's checks, stream and number of trains.
pub(super) trait Encoding {
    /// Checks every parameter.
    fn check(&self) -> Result<()>;

    /// Starts a stream for an array; the parameters must have been checked.
    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>>;

    /// The number of spike trains for an array.
    fn trains(&self, array: &Array) -> usize {
        Channels::new(array).len()
    }

    /// The meaning of its spikes' values.
    fn kind(&self) -> SpikeKind {
        SpikeKind::Signed
    }

    /// The latency that the encoder's own algorithm adds between a touch and its spike, ms.
    fn latency_ms(&self) -> f64 {
        0.0
    }

    /// The trains of its stream.
    fn trains_of(&self, array: &Array) -> Trains {
        Trains { number: self.trains(array), kind: self.kind(), latency_ms: self.latency_ms() }
    }

    /// Sets the taxels' rest; most encoders use none.
    fn set_tare(&mut self, _tare: &Tare) {}
}

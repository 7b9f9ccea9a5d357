//! Spikes to detections, and their score.

mod frame_clock;
mod readout;
mod score;
mod stream;
mod trained;

pub use frame_clock::{FrameClock, FrameTime};
pub use readout::Readout;
pub use score::{Spread, Tally, WIDEST_WINDOW_US, score};
pub use stream::ReadoutStream;
pub use trained::TrainedNeuron;

use serde::{Deserialize, Serialize};

/// A detection of a readout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// The label of the neuron that fired.
    pub label: String,
    /// Time of the event, us of the board's clock: the crossing minus the encoder's latency and the trained delay.
    pub t: i64,
    /// Earliest time at which the event could be known, us of the board's clock: the end of the frame in which the
    /// potential crosses.
    pub known: i64,
    /// Slope of the potential at its threshold, mV/ms: a measure of confidence.
    pub slope: f64,
    /// Whether the detection may depend on values that states of version 2 repaired: then the event may have happened
    /// before `t`.
    pub repaired: bool,
}

/// A reference event that took place, against which detections are scored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// Kind of the event.
    pub label: String,
    /// Time of the event, us of the board's clock.
    pub t: i64,
}

//! Detections from spikes, and their scores.

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
    /// The time of the event by the board's clock, us: the crossing minus the encoder's latency and the trained delay.
    pub t: i64,
    /// The earliest time by the board's clock at which the host can know, us: the end of the frame of the crossing.
    pub known: i64,
    /// The slope of potential minus threshold at the crossing, mV/ms: a measure of confidence.
    pub slope: f64,
    /// Whether the detection may rest on values that states of version 2 repaired: the event may then have happened
    /// before `t`.
    pub repaired: bool,
}

/// An event that took place, according to a reference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// The label of the event.
    pub label: String,
    /// The time of the event by the board's clock, us.
    pub t: i64,
}

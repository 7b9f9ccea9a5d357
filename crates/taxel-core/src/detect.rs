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
    /// When the event was, us of the board's clock: the crossing less the encoder's latency and the trained delay.
    pub t: i64,
    /// When it could first be known, us of the board's clock: the end of the frame in which the potential crosses.
    pub known: i64,
    /// How steeply the potential rose above its threshold, mV/ms: a measure of how sure.
    pub slope: f64,
    /// Whether it may rest on values that states of version 2 repaired: then the event may have happened before `t`.
    pub repaired: bool,
}

/// An event that took place, by a reference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// What happened.
    pub label: String,
    /// When, us of the board's clock.
    pub t: i64,
}

//! Detections from spikes, and their scores.

mod detector;
mod file;
mod frame_clock;
mod load_curve;
mod plain_rule;
mod readout;
mod running_rule;
mod score;
mod stream;
mod trained;
mod training_data;

pub use detector::Detector;
pub use frame_clock::{FrameClock, FrameTime};
pub use load_curve::LoadCurve;
pub use plain_rule::PlainRule;
pub use readout::Readout;
pub use running_rule::{Decision, EdgeNumbers};
pub use score::{Spread, Tally, WIDEST_WINDOW_US, score};
pub use stream::ReadoutStream;
pub use trained::TrainedNeuron;
pub use training_data::TrainingData;

use serde::{Deserialize, Serialize};

/// A detection of a readout or a plain rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// The label of the neuron that fired, or of what the rule found.
    pub label: String,
    /// The time of the event by the board's clock, us: the crossing minus the encoder's latency and the trained delay;
    /// of a rule, the begin or end of the load.
    pub t: i64,
    /// The earliest time by the board's clock at which the host can know, us: the end of the frame of the crossing, or
    /// of the last frame on which the rule rests.
    pub known: i64,
    /// The slope of the potential as it comes to the threshold, mV/ms ([`OutputSpike`](crate::neuron::OutputSpike)); not
    /// a number for a rule.
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

//! The second stage, of whatever the source sends.

use std::time::Duration;

use taxel_core::held::{Held, UNKNOWN};

use super::decode_stage::DecodeStage;
use super::frame_stage::FrameStage;
use super::readout_queue::QuietUntil;

/// The second stage, by what the source sends.
pub(super) enum SourceStage {
    Board(Box<DecodeStage>),
    Frames(Box<FrameStage>),
}

impl SourceStage {
    pub(super) fn held(&self) -> &Held {
        match self {
            Self::Board(decode) => &decode.held,
            Self::Frames(frames) => &frames.held,
        }
    }

    /// Number of datagrams or frames.
    pub(super) fn count(&self) -> u64 {
        match self {
            Self::Board(decode) => decode.decoded,
            Self::Frames(frames) => frames.count,
        }
    }

    /// How long to wait for data before the readout's time is advanced, if it depends on silence.
    pub(super) fn tick(&self) -> Option<Duration> {
        match self {
            Self::Board(decode) => decode.tick(),
            Self::Frames(frames) => Some(frames.tick()),
        }
    }

    pub(super) fn quiet_until(&self, until_ns: Option<i64>) -> Option<QuietUntil> {
        match self {
            Self::Board(decode) => decode.quiet_until(until_ns),
            Self::Frames(frames) => frames.quiet_until(until_ns),
        }
    }

    /// The rest of a taxel that nothing touches now: the held value of a board, the median of a noisy source's last second.
    pub(super) fn rest_now(&self, taxel: usize) -> Option<f64> {
        match self {
            Self::Board(decode) => Some(decode.held.values()[taxel]).filter(|&held| held != UNKNOWN).map(f64::from),
            Self::Frames(frames) => frames.recent.middle(taxel),
        }
    }
}

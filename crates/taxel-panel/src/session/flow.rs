//! Flow control: a frame is sent only against a credit of the client, and not more often than once in [`FRAME_TIME`].

use std::time::{Duration, Instant};

use crate::protocol::limits::MOST_CREDITS;

/// Minimum time from frame to frame.
pub(super) const FRAME_TIME: Duration = Duration::from_micros(16_000);

/// Counter messages per second; each states how many frames were sent since the one before.
const COUNTERS_PER_S: f64 = 4.0;

/// Decides by a client's credits and the frame rate when the next frame is sent.
pub(super) struct FlowControl {
    credits: u32,
    /// Number of the next frame.
    number: u32,
    /// Frames since the last counters.
    frames: u32,
    last: Instant,
}

impl FlowControl {
    pub(super) fn new() -> Self {
        Self { credits: 0, number: 0, frames: 0, last: Instant::now() }
    }

    pub(super) fn grant(&mut self, credits: u32) {
        self.credits = (self.credits + credits).min(MOST_CREDITS);
    }

    pub(super) fn has_credit(&self) -> bool {
        self.credits > 0
    }

    /// Whether a frame may be sent now. A little less than [`FRAME_TIME`] is enough, so that timers need not be exact.
    pub(super) fn is_due(&self) -> bool {
        self.credits > 0 && self.last.elapsed() >= FRAME_TIME.mul_f64(0.9)
    }

    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Counts a frame that is about to be sent.
    pub(super) fn count_frame(&mut self) {
        (self.credits, self.number, self.frames) = (self.credits - 1, self.number.wrapping_add(1), self.frames + 1);
        self.last = Instant::now();
    }

    /// Frames per second since the last call, which is made with every message of counters.
    pub(super) fn frames_per_s(&mut self) -> f64 {
        f64::from(std::mem::take(&mut self.frames)) * COUNTERS_PER_S
    }
}

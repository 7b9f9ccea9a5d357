//! Flow control: a picture is sent only against a credit of the client, and not more often than once a frame.

use std::time::{Duration, Instant};

use crate::limits::MOST_CREDITS;

/// Minimum time from picture to picture.
pub(super) const FRAME: Duration = Duration::from_micros(16_000);

/// Counter messages per second; each states how many pictures were sent since the one before.
const COUNTERS_PER_S: f64 = 4.0;

/// See the module.
pub(super) struct FlowControl {
    credits: u32,
    /// Number of the next picture.
    number: u32,
    /// Pictures since the last counters.
    pictures: u32,
    last: Instant,
}

impl FlowControl {
    pub(super) fn new() -> Self {
        Self { credits: 0, number: 0, pictures: 0, last: Instant::now() }
    }

    pub(super) fn grant(&mut self, credits: u32) {
        self.credits = (self.credits + credits).min(MOST_CREDITS);
    }

    pub(super) fn has_credit(&self) -> bool {
        self.credits > 0
    }

    /// Whether a picture may be sent now. A little less than a frame is enough, so that timers need not be exact.
    pub(super) fn is_due(&self) -> bool {
        self.credits > 0 && self.last.elapsed() >= FRAME.mul_f64(0.9)
    }

    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Counts a picture that is about to be sent.
    pub(super) fn count_picture(&mut self) {
        (self.credits, self.number, self.pictures) = (self.credits - 1, self.number.wrapping_add(1), self.pictures + 1);
        self.last = Instant::now();
    }

    /// Pictures per second since the last call, which is made with every message of counters.
    pub(super) fn pictures_per_s(&mut self) -> f64 {
        f64::from(std::mem::take(&mut self.pictures)) * COUNTERS_PER_S
    }
}

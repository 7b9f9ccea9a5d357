//! Playback: whether a view moves, how fast, and where it is now.

use std::time::Instant;

/// The speed and the present time of a recording that is played.
pub(super) struct Playback {
    /// Board time over real time.
    pub(super) speed: f64,
    /// When and at which board time (us) playing began; `None` while paused.
    begun: Option<(Instant, i64)>,
}

impl Playback {
    pub(super) fn paused() -> Self {
        Self { speed: 1.0, begun: None }
    }

    pub(super) fn is_playing(&self) -> bool {
        self.begun.is_some()
    }

    pub(super) fn start(&mut self, speed: f64, t: i64) {
        (self.speed, self.begun) = (speed, Some((Instant::now(), t)));
    }

    pub(super) fn pause(&mut self) {
        self.begun = None;
    }

    /// Board time of now, us, while it is playing.
    pub(super) fn now(&self) -> Option<i64> {
        let passed = |since: Instant| (since.elapsed().as_secs_f64() * self.speed * 1e6) as i64;
        self.begun.map(|(since, from)| from.saturating_add(passed(since)))
    }
}

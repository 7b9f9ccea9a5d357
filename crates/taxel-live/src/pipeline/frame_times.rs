//! The times of frames of numbers as they arrive, and what is wrong with them.

use super::source::FrameLayout;
use crate::recording::{Cause, Found, StreamFaults};

/// Without any frame for so long a source is silent, ns; one of slow frames after so many of them.
const SILENT_NS: i64 = 1_000_000_000;
const SILENT_FRAMES: f64 = 3.0;

/// Turns stamps and arrivals into times that ascend, and counts silences.
#[derive(Debug)]
pub(super) struct FrameTimes {
    pub(super) faults: StreamFaults,
    waited: bool,
    frame_us: Option<f64>,
    /// Time of the last frame, us.
    last: Option<i64>,
    /// When the last frame arrived, ns since 1970.
    arrived_ns: Option<i64>,
    silences: Silences,
    /// When the last line was read that can come, ns since 1970.
    ended_ns: Option<i64>,
}

/// Silences between frames that arrive.
#[derive(Debug, Clone, Copy, Default)]
struct Silences {
    count: u64,
    ns: u64,
}

impl FrameTimes {
    pub(super) fn new(layout: &FrameLayout) -> Self {
        Self {
            faults: StreamFaults::new(layout.stamp_us, layout.waited),
            waited: layout.waited,
            frame_us: layout.frame_us,
            last: None,
            arrived_ns: None,
            silences: Silences::default(),
            ended_ns: None,
        }
    }

    /// The time, us, of a frame with this stamp or none that arrived at `arrived_ns` (ns since 1970); none if the stamp is no time.
    pub(super) fn time(&mut self, stamp: Option<f64>, arrived_ns: i64) -> Option<i64> {
        let t = self.faults.time(stamp, arrived_ns)?;
        // Lines that came in one packet have one arrival time.
        let t = self.last.map_or(t, |last| t.max(last + 1));
        self.last = Some(t);
        self.silences = self.silences_until(arrived_ns);
        self.arrived_ns = Some(arrived_ns);
        Some(t)
    }

    /// Ends at this time, ns since 1970: no line can come, so that what follows is no silence.
    pub(super) fn end(&mut self, at_ns: i64) {
        self.ended_ns.get_or_insert(at_ns);
    }

    /// The silences so far, with that which lasts until `now_ns` since 1970.
    fn silences_until(&self, now_ns: i64) -> Silences {
        let Some(frame_us) = self.frame_us.filter(|_| !self.waited) else { return self.silences };
        let now_ns = self.ended_ns.unwrap_or(now_ns);
        let Silences { count, ns } = self.silences;
        #[allow(clippy::cast_possible_truncation)]
        let least = SILENT_NS.max((SILENT_FRAMES * 1000.0 * frame_us) as i64);
        match self.arrived_ns.map(|arrived_ns| now_ns - arrived_ns) {
            Some(silent) if silent > least => Silences { count: count + 1, ns: ns + silent.unsigned_abs() },
            _ => self.silences,
        }
    }

    /// What is wrong with the lines until `now_ns` since 1970, as a verdict states it.
    pub(super) fn found(&self, now_ns: i64) -> Found {
        let Silences { count, ns } = self.silences_until(now_ns);
        let mut found = self.faults.found.clone();
        found.counts.extend([(Cause::Silences, count), (Cause::SilentMs, ns / 1_000_000)]);
        found
    }
}

#[cfg(test)]
mod tests {
    use taxel_core::Array;

    use super::*;

    #[test]
    fn what_follows_the_end_is_no_silence_and_times_ascend() {
        let mut times = FrameTimes::new(&FrameLayout {
            array: Array::unmeasured(1, 2, "row"),
            unit: "counts".to_owned(),
            unit_is_stated: false,
            names: vec![],
            turned: None,
            frame_us: Some(10_000.0),
            stamp_us: 1.0,
            waited: false,
        });
        let silent_ms = |times: &FrameTimes, now_ns| times.found(now_ns).counts[Cause::SilentMs];
        assert_eq!([0, 0, 3_000_000_000].map(|at_ns| times.time(None, at_ns)), [Some(0), Some(1), Some(3_000_000)]);
        assert_eq!(silent_ms(&times, 8_000_000_000), 8_000);
        times.end(3_500_000_000);
        assert_eq!(silent_ms(&times, 600_000_000_000), 3_000);
    }
}

//! Selects the previews of a recording: ten a second, and those around detections, markers and notes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::recording::LOW_RATE_EVERY;

/// Interval at which previews are buffered until it is known whether they are recorded: the largest rate in a
/// recording.
const BUFFERED_EVERY: Duration = Duration::from_millis(10);

/// Number of buffered previews: half a second. For an event longer ago there is no preview before it.
const BUFFERED: usize = 50;

/// The previews of the last half second, 10 ms apart, until it is known whether they are recorded.
#[derive(Debug)]
pub(super) struct PreviewBuffer {
    previews: VecDeque<BufferedPreview>,
    /// Times of events, us, after which no preview was stored yet.
    awaited: Vec<i64>,
    pushed: Option<Instant>,
    wanted: Option<Instant>,
}

/// The taxels' values at a time.
#[derive(Debug)]
pub(super) struct BufferedPreview {
    /// Time when it was added, ns since 1970.
    pub(super) at_ns: i64,
    /// The board's time of the last event in the preview, us.
    pub(super) t_us: i64,
    /// Ticks by taxel index; 0 of a taxel without any event so far.
    pub(super) held: Vec<u16>,
    state: PreviewState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PreviewState {
    Undecided,
    Wanted,
    Recorded,
}

impl BufferedPreview {
    fn want(&mut self) {
        if self.state == PreviewState::Undecided {
            self.state = PreviewState::Wanted;
        }
    }
}

impl PreviewBuffer {
    pub(super) fn new() -> Self {
        Self { previews: VecDeque::new(), awaited: vec![], pushed: None, wanted: None }
    }

    /// Whether the next preview is due.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.pushed.is_none_or(|pushed| now.saturating_duration_since(pushed) >= BUFFERED_EVERY)
    }

    /// Discards all previews, because nothing is recorded.
    pub(super) fn clear(&mut self) {
        self.previews.clear();
        self.awaited.clear();
    }

    /// Adds a preview of the taxels' values.
    pub(super) fn push(&mut self, now: Instant, at_ns: i64, t_us: i64, held: impl Iterator<Item = u16>) {
        let mut memory =
            if self.previews.len() >= BUFFERED { self.previews.pop_front().map(|old| old.held) } else { None };
        let values = memory.get_or_insert_default();
        values.clear();
        values.extend(held);
        let mut preview =
            BufferedPreview { at_ns, t_us, held: memory.unwrap_or_default(), state: PreviewState::Undecided };
        let asked = self.awaited.len();
        self.awaited.retain(|&t| t > t_us);
        let tenth = self.wanted.is_none_or(|wanted| now.saturating_duration_since(wanted) >= LOW_RATE_EVERY);
        if tenth || self.awaited.len() < asked {
            preview.want();
        }
        if tenth {
            self.wanted = Some(now);
        }
        self.pushed = Some(now);
        self.previews.push_back(preview);
    }

    /// Selects for an event at `t` us the last preview before it and the first one at or after it.
    pub(super) fn around(&mut self, t: i64) {
        if let Some(before) = self.previews.iter_mut().rev().find(|preview| preview.t_us < t) {
            before.want();
        }
        match self.previews.iter_mut().find(|preview| preview.t_us >= t) {
            Some(after) => after.want(),
            None if self.awaited.len() < BUFFERED => self.awaited.push(t),
            None => {}
        }
    }

    /// The selected previews, in order of time, each once.
    pub(super) fn take_wanted(&mut self) -> impl Iterator<Item = &BufferedPreview> {
        self.previews.iter_mut().filter(|preview| preview.state == PreviewState::Wanted).map(|preview| {
            preview.state = PreviewState::Recorded;
            &*preview
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pushes a preview each 10 ms in `from..to` (hundredths of a second) and gives the board's times of those that are recorded.
    fn recorded(preview_buffer: &mut PreviewBuffer, begun: Instant, times: std::ops::Range<i64>) -> Vec<i64> {
        let mut recorded_now = vec![];
        for k in times {
            let now = begun + BUFFERED_EVERY * u32::try_from(k).unwrap();
            assert!(preview_buffer.is_due(now));
            preview_buffer.push(now, k, 10_000 * k, std::iter::once(k as u16));
            assert!(!preview_buffer.is_due(now + BUFFERED_EVERY / 2));
            recorded_now.extend(preview_buffer.take_wanted().map(|preview| {
                assert_eq!((preview.at_ns * 10_000, i64::from(preview.held[0]) * 10_000), (preview.t_us, preview.t_us));
                preview.t_us
            }));
        }
        recorded_now
    }

    #[test]
    fn a_recording_gets_ten_previews_a_second_and_those_around_events_once() {
        let (mut preview_buffer, begun) = (PreviewBuffer::new(), Instant::now());
        assert_eq!(recorded(&mut preview_buffer, begun, 0..37), [0, 100_000, 200_000, 300_000]);
        // Times between two previews, at a preview, and after the last preview.
        preview_buffer.around(123_456);
        preview_buffer.around(150_000);
        preview_buffer.around(365_000);
        let recorded_now: Vec<i64> = preview_buffer.take_wanted().map(|preview| preview.t_us).collect();
        assert_eq!(recorded_now, [120_000, 130_000, 140_000, 150_000, 360_000]);
        preview_buffer.around(123_456);
        assert_eq!(preview_buffer.take_wanted().count(), 0, "each once");
        assert_eq!(recorded(&mut preview_buffer, begun, 37..45), [370_000, 400_000]);
    }

    #[test]
    fn events_of_long_ago_and_many_of_them_cost_no_more_than_a_hundred_previews_a_second() {
        let (mut preview_buffer, begun) = (PreviewBuffer::new(), Instant::now());
        let mut recorded_now = recorded(&mut preview_buffer, begun, 0..100).len();
        assert_eq!(recorded_now, 10);
        for t in 0..1_200_000 {
            preview_buffer.around(t);
        }
        recorded_now = preview_buffer.take_wanted().count() + recorded(&mut preview_buffer, begun, 100..200).len();
        assert!(recorded_now <= BUFFERED + 100, "{recorded_now}");
        assert!(preview_buffer.previews.len() <= BUFFERED && preview_buffer.awaited.len() <= BUFFERED);
        preview_buffer.clear();
        assert_eq!(preview_buffer.take_wanted().count(), 0);
    }
}

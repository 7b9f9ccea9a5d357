//! Which pictures a recording gets: ten a second, and those around events.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How often a recording gets a picture where something comes.
const PICTURE_EVERY: Duration = Duration::from_millis(100);

/// How often a picture is stored until it is decided: a recording never gets more.
const KEPT_EVERY: Duration = Duration::from_millis(10);

/// How many are stored: half a second. An event of longer ago gets no picture before it.
const KEPT: usize = 50;

/// The pictures of the last half second, a hundredth of a second apart, until it is known whether the recording gets them.
#[derive(Debug)]
pub(super) struct Stills {
    kept: VecDeque<Still>,
    /// Times of events, us, after which no picture was stored yet.
    awaited: Vec<i64>,
    taken: Option<Instant>,
    wanted: Option<Instant>,
}

/// What the taxels held at a time.
#[derive(Debug)]
pub(super) struct Still {
    /// When it was taken, ns since 1970.
    pub(super) at_ns: i64,
    /// The board's time of the last event in it, us.
    pub(super) t_us: i64,
    /// Ticks by taxel index; 0 of a taxel without any event so far.
    pub(super) held: Vec<u16>,
    state: StillState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StillState {
    Unasked,
    Wanted,
    Given,
}

impl Still {
    fn want(&mut self) {
        if self.state == StillState::Unasked {
            self.state = StillState::Wanted;
        }
    }
}

impl Stills {
    pub(super) fn new() -> Self {
        Self { kept: VecDeque::new(), awaited: vec![], taken: None, wanted: None }
    }

    /// Whether the next may be taken.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.taken.is_none_or(|taken| now.saturating_duration_since(taken) >= KEPT_EVERY)
    }

    /// Nothing is recorded: discards all.
    pub(super) fn clear(&mut self) {
        self.kept.clear();
        self.awaited.clear();
    }

    /// Stores the values that the taxels hold.
    pub(super) fn take(&mut self, now: Instant, at_ns: i64, t_us: i64, held: impl Iterator<Item = u16>) {
        let mut memory = if self.kept.len() >= KEPT { self.kept.pop_front().map(|old| old.held) } else { None };
        let values = memory.get_or_insert_default();
        values.clear();
        values.extend(held);
        let mut still = Still { at_ns, t_us, held: memory.unwrap_or_default(), state: StillState::Unasked };
        let asked = self.awaited.len();
        self.awaited.retain(|&t| t > t_us);
        let tenth = self.wanted.is_none_or(|wanted| now.saturating_duration_since(wanted) >= PICTURE_EVERY);
        if tenth || self.awaited.len() < asked {
            still.want();
        }
        if tenth {
            self.wanted = Some(now);
        }
        self.taken = Some(now);
        self.kept.push_back(still);
    }

    /// For an event at `t` us the recording gets the last picture before it and the first from it on.
    pub(super) fn around(&mut self, t: i64) {
        if let Some(before) = self.kept.iter_mut().rev().find(|still| still.t_us < t) {
            before.want();
        }
        match self.kept.iter_mut().find(|still| still.t_us >= t) {
            Some(after) => after.want(),
            None if self.awaited.len() < KEPT => self.awaited.push(t),
            None => {}
        }
    }

    /// Those that the recording is to get, in order of time, once each.
    pub(super) fn give(&mut self) -> impl Iterator<Item = &Still> {
        self.kept.iter_mut().filter(|still| still.state == StillState::Wanted).map(|still| {
            still.state = StillState::Given;
            &*still
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes a still each 10 ms in `from..to` (hundredths of a second) and gives the board's times of those that are recorded.
    fn recorded(stills: &mut Stills, begun: Instant, times: std::ops::Range<i64>) -> Vec<i64> {
        let mut given = vec![];
        for k in times {
            let now = begun + KEPT_EVERY * u32::try_from(k).unwrap();
            assert!(stills.is_due(now));
            stills.take(now, k, 10_000 * k, std::iter::once(k as u16));
            assert!(!stills.is_due(now + KEPT_EVERY / 2));
            given.extend(stills.give().map(|still| {
                assert_eq!((still.at_ns * 10_000, i64::from(still.held[0]) * 10_000), (still.t_us, still.t_us));
                still.t_us
            }));
        }
        given
    }

    #[test]
    fn a_recording_gets_ten_pictures_a_second_and_those_around_events_once() {
        let (mut stills, begun) = (Stills::new(), Instant::now());
        assert_eq!(recorded(&mut stills, begun, 0..37), [0, 100_000, 200_000, 300_000]);
        // Within two pictures, at one of them, and one that comes later.
        stills.around(123_456);
        stills.around(150_000);
        stills.around(365_000);
        let given: Vec<i64> = stills.give().map(|still| still.t_us).collect();
        assert_eq!(given, [120_000, 130_000, 140_000, 150_000, 360_000]);
        stills.around(123_456);
        assert_eq!(stills.give().count(), 0, "each once");
        assert_eq!(recorded(&mut stills, begun, 37..45), [370_000, 400_000]);
    }

    #[test]
    fn events_of_long_ago_and_many_of_them_cost_no_more_than_a_hundred_pictures_a_second() {
        let (mut stills, begun) = (Stills::new(), Instant::now());
        let mut given = recorded(&mut stills, begun, 0..100).len();
        assert_eq!(given, 10);
        for t in 0..1_200_000 {
            stills.around(t);
        }
        given = stills.give().count() + recorded(&mut stills, begun, 100..200).len();
        assert!(given <= KEPT + 100, "{given}");
        assert!(stills.kept.len() <= KEPT && stills.awaited.len() <= KEPT);
        stills.clear();
        assert_eq!(stills.give().count(), 0);
    }
}

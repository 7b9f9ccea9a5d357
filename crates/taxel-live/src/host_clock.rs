//! Estimates another computer's clock relative to this one's, offset and drift, from round trips.
//!
//! A request is sent here at t1 and reaches the other computer at t2; its reply is sent there at t3 and arrives here at
//! t4. Neither direction takes negative time, so the other clock is ahead by at most t2 - t1 and at least t3 - t4: an
//! interval as wide as the round trip. For each second the exchange with the narrowest interval is stored (the filter
//! of NTP, RFC 5905, section 10). The drift is the median slope between the intervals' midpoints, and the offset is the
//! midpoint of the intersection of the newest intervals, corrected for that drift. Its error is half the difference
//! between the shortest delays in the two directions, which no exchange can reveal; apart from the drift's error it is
//! at most [`HostOffset::within_ns`].

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Duration of a stretch, for which the exchange with the narrowest interval is stored, ns.
const STRETCH_NS: i64 = 1_000_000_000;
/// Number of stored stretches, from which the drift is estimated.
const STRETCHES: usize = 64;
/// Number of the newest stretches, from which the offset is estimated.
const NEWEST: usize = 16;
/// Number of stretches from which on both are estimated; before, the newest stretch alone defines the offset.
const BELIEVED: usize = 4;
/// Largest plausible drift: a quartz is accurate to 100 ppm, so two differ by up to 200.
const MOST_DRIFT: f64 = 200e-6;
/// An exchange contradicts the estimate if its interval is farther away than this, ns.
const ASTRAY_NS: i64 = 5_000_000;
/// Number of consecutive contradicting exchanges after which a clock must have been set.
const ASTRAY: u32 = 4;
/// Longest accepted round trip, ns.
const LONGEST_NS: i64 = 2_000_000_000;

/// The relation of another computer's clock to this one's: a line.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HostOffset {
    /// This computer's time of a point on the line, ns since 1970.
    pub here_ns: i64,
    /// Time by which the other clock was ahead at that point, ns.
    pub ahead_ns: i64,
    /// Drift of the other clock relative to this one, parts per million.
    pub drift_ppm: f64,
    /// Half the width of the interval in which the offset must be, by the shortest round trips, ns.
    pub within_ns: i64,
}

impl HostOffset {
    /// Converts a time of the other computer to this one's, both ns since 1970.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    pub fn here_ns(&self, there_ns: i64) -> i64 {
        let since = there_ns.saturating_sub(self.ahead_ns).saturating_sub(self.here_ns);
        // Corrects the time difference by the drift only, so that a float's precision does not limit the result.
        let drift = self.drift_ppm * 1e-6;
        self.here_ns.saturating_add(since).saturating_sub((since as f64 * (drift / (1.0 + drift))) as i64)
    }
}

/// The four times of a round trip, ns since 1970, each by the clock of the computer where it was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RoundTrip {
    /// t1: the request was sent here.
    pub asked: i64,
    /// t2: the request arrived at the other computer.
    pub came: i64,
    /// t3: the reply was sent there.
    pub answered: i64,
    /// t4: the reply arrived here.
    pub back: i64,
}

/// The offsets that a round trip allows.
#[derive(Debug, Clone, Copy)]
struct Allowed {
    here_ns: i64,
    least: i64,
    most: i64,
}

impl Allowed {
    fn width(&self) -> i64 {
        self.most - self.least
    }

    fn middle(&self) -> i64 {
        self.least + self.width() / 2
    }
}

/// Estimates a [`HostOffset`] from round trips.
#[derive(Debug, Clone, Default)]
pub struct HostClock {
    /// The narrowest exchange of each completed stretch.
    finished: VecDeque<Allowed>,
    /// The narrowest exchange of the current stretch.
    narrowest: Option<Allowed>,
    astray: u32,
    offset: Option<HostOffset>,
}

impl HostClock {
    /// Adds a round trip; one with contradictory times, or one that took too long, is ignored.
    pub fn note(&mut self, trip: RoundTrip) {
        let (Some(most), Some(least)) = (trip.came.checked_sub(trip.asked), trip.answered.checked_sub(trip.back))
        else {
            return;
        };
        let Some(here_ns) = trip.back.checked_sub(trip.asked).map(|passed| trip.asked + passed / 2) else { return };
        let allowed = Allowed { here_ns, least, most };
        if !(0..=LONGEST_NS).contains(&most.saturating_sub(least)) {
            return;
        }
        if self.contradicts(&allowed) {
            self.astray += 1;
            if self.astray < ASTRAY {
                return;
            }
            *self = Self::default();
        }
        self.astray = 0;
        match self.narrowest {
            Some(before) if allowed.here_ns.div_euclid(STRETCH_NS) == before.here_ns.div_euclid(STRETCH_NS) => {
                if allowed.width() < before.width() {
                    self.narrowest = Some(allowed);
                }
            }
            before => {
                if self.finished.len() == STRETCHES {
                    self.finished.pop_front();
                }
                self.finished.extend(before);
                self.narrowest = Some(allowed);
            }
        }
        self.fit();
    }

    /// The estimate, after the first exchange.
    #[must_use]
    pub fn offset(&self) -> Option<HostOffset> {
        self.offset
    }

    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn contradicts(&self, allowed: &Allowed) -> bool {
        let Some(offset) = self.offset else { return false };
        let since = allowed.here_ns - offset.here_ns;
        let expected = offset.ahead_ns + (since as f64 * offset.drift_ppm * 1e-6) as i64;
        let slack = ASTRAY_NS + (since.abs() as f64 * MOST_DRIFT) as i64;
        expected < allowed.least - slack || expected > allowed.most + slack
    }

    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn fit(&mut self) {
        let Some(last) = self.narrowest else { return };
        let narrow: Vec<Allowed> = self.finished.iter().copied().chain([last]).collect();
        let (mut drift, mut counts) = (0.0, 1);
        if narrow.len() >= BELIEVED {
            let mut slopes: Vec<f64> = narrow
                .iter()
                .enumerate()
                .flat_map(|(k, a)| narrow.iter().skip(k + 1).map(move |b| (a, b)))
                .filter(|(a, b)| b.here_ns > a.here_ns)
                .map(|(a, b)| (b.middle() - a.middle()) as f64 / (b.here_ns - a.here_ns) as f64)
                .collect();
            if !slopes.is_empty() {
                let middle = slopes.len() / 2;
                drift = slopes.select_nth_unstable_by(middle, f64::total_cmp).1.clamp(-MOST_DRIFT, MOST_DRIFT);
                counts = NEWEST;
            }
        }
        let newest = narrow.iter().rev().take(counts);
        let moved = |bound: i64, at: i64| bound - ((at - last.here_ns) as f64 * drift) as i64;
        let least = newest.clone().map(|a| moved(a.least, a.here_ns)).max().unwrap_or(last.least);
        let most = newest.map(|a| moved(a.most, a.here_ns)).min().unwrap_or(last.most);
        self.offset = Some(HostOffset {
            here_ns: last.here_ns,
            ahead_ns: least + (most - least) / 2,
            drift_ppm: drift * 1e6,
            within_ns: (most - least).abs() / 2,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: i64 = 1_700_000_000_000_000_000;

    /// A random number generator, uniform between 0 and 1.
    struct Chance(u64);

    impl Chance {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 40) as f64 / (1 << 24) as f64
        }
    }

    struct Other {
        ahead_ns: i64,
        drift: f64,
    }

    impl Other {
        fn there(&self, here: i64) -> i64 {
            here + self.ahead_ns + ((here - HERE) as f64 * self.drift) as i64
        }

        /// Exchanges four times a second for `seconds`; each direction takes 100 us and sometimes up to 20 ms more.
        fn exchanged(&self, clock: &mut HostClock, from: i64, seconds: i64, chance: &mut Chance) -> i64 {
            for k in 0..seconds * 4 {
                let mut way = || 100_000 + (chance.next().powi(8) * 20e6) as i64;
                let asked = HERE + from * 1_000_000_000 + k * 250_000_000;
                let reached = asked + way();
                let left = reached + 30_000;
                let back = left + way();
                clock.note(RoundTrip { asked, came: self.there(reached), answered: self.there(left), back });
            }
            HERE + (from + seconds) * 1_000_000_000
        }
    }

    #[test]
    fn offset_and_drift_come_out_whatever_the_delays() {
        for (ahead_ns, drift) in [(0, 0.0), (3_700_000_000, 50e-6), (-86_400_000_000_000, -120e-6)] {
            let (mut clock, other) = (HostClock::default(), Other { ahead_ns, drift });
            let now = other.exchanged(&mut clock, 0, 30, &mut Chance(7));
            let offset = clock.offset().expect("something came");
            assert!((offset.drift_ppm - drift * 1e6).abs() < 1.0, "{offset:?}");
            assert!((offset.here_ns(other.there(now)) - now).abs() < 20_000, "{offset:?}");
            assert!(offset.within_ns < 200_000, "{offset:?}");
        }
    }

    #[test]
    fn the_first_round_trip_is_believed_within_its_half() {
        let mut clock = HostClock::default();
        assert_eq!(clock.offset(), None);
        // 2 ms there, 1 ms back, with the other clock 10 s ahead.
        let came = HERE + 10_002_000_000;
        clock.note(RoundTrip { asked: HERE, came, answered: came, back: HERE + 3_000_000 });
        let offset = clock.offset().expect("one came");
        assert_eq!((offset.ahead_ns, offset.within_ns), (10_000_500_000, 1_500_000));
    }

    #[test]
    fn a_clock_that_was_set_is_followed_and_one_late_answer_is_not() {
        let (mut clock, mut chance) = (HostClock::default(), Chance(3));
        let other = Other { ahead_ns: 1_000_000_000, drift: 0.0 };
        other.exchanged(&mut clock, 0, 10, &mut chance);
        let before = clock.offset().expect("some came").ahead_ns;
        let set = Other { ahead_ns: -5_000_000_000, drift: 0.0 };
        let mut after_one = clock.clone();
        set.exchanged(&mut after_one, 10, 0, &mut chance);
        assert_eq!(after_one.offset().expect("some came").ahead_ns, before);
        set.exchanged(&mut clock, 10, 2, &mut chance);
        assert!((clock.offset().expect("some came").ahead_ns + 5_000_000_000).abs() < 100_000);
    }

    #[test]
    fn times_that_cannot_be_true_are_left_out() {
        let mut clock = HostClock::default();
        for trip in [
            RoundTrip { asked: i64::MIN, came: i64::MAX, answered: 0, back: 0 },
            RoundTrip { asked: 0, came: i64::MAX, answered: i64::MIN, back: 1 },
            RoundTrip { asked: 10, came: 0, answered: 100, back: 20 },
            RoundTrip { asked: 0, came: 0, answered: 0, back: 3_000_000_000 },
        ] {
            clock.note(trip);
        }
        assert_eq!(clock.offset(), None);
    }
}

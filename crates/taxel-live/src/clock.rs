//! The board's clock as the host sees it: offset and drift, from arrival times alone.
//!
//! A datagram comes late by whatever the way costs, never early. So the lower envelope of *arrival less board time* is
//! the offset between the clocks (plus the shortest way, which cannot be told from it), and its slope is the drift.

use std::collections::VecDeque;

use serde::Serialize;

/// The envelope is kept as its lowest point in each stretch of this length, us of the board's clock ...
const STRETCH_US: i64 = 1_000_000;
/// ... for so many stretches ...
const STRETCHES: usize = 64;
/// ... and its slope is believed from so many on.
const BELIEVED: usize = 4;
/// A whole stretch that lies this far from what was expected is another clock: a board that was reset, a host whose
/// clock was set; ns.
const ANOTHER_CLOCK: i64 = 100_000_000;

/// What the host's clock shows when the board's shows a time: a line.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Offset {
    /// A time of the board, us ...
    pub board_us: i64,
    /// ... and what the host's clock showed then, ns since 1970.
    pub host_ns: i64,
    /// How much faster the host's clock runs, parts per million.
    pub drift_ppm: f64,
}

impl Offset {
    /// The host's time at a time of the board, ns since 1970.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    pub fn host_ns(&self, board_us: i64) -> i64 {
        let since = board_us - self.board_us;
        self.host_ns + since * 1000 + (since as f64 * self.drift_ppm * 1e-3) as i64
    }

    /// The board's time at a time of the host, us.
    #[must_use]
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    pub fn board_us(&self, host_ns: i64) -> i64 {
        let since = (host_ns - self.host_ns) as f64 * 1e-3;
        self.board_us + (since / (1.0 + self.drift_ppm * 1e-6)) as i64
    }
}

/// Estimates the [`Offset`] as datagrams come.
#[derive(Debug, Clone, Default)]
pub struct BoardClock {
    /// The lowest point of each finished stretch: board time us, arrival less board time ns.
    lows: VecDeque<(i64, i64)>,
    /// The lowest point of the stretch that runs.
    low: Option<(i64, i64)>,
    offset: Option<Offset>,
}

impl BoardClock {
    /// The line through many datagrams: their board times, us, and when they arrived, ns.
    #[must_use]
    pub fn offset_of(board_us: &[i64], arrived_ns: &[i64]) -> Option<Offset> {
        let mut clock = Self::default();
        for (&board, &arrived) in board_us.iter().zip(arrived_ns) {
            clock.note(board, arrived);
        }
        clock.offset()
    }

    /// Notes that something which could leave the board at `board_us` at the earliest arrived at `arrived_ns`.
    pub fn note(&mut self, board_us: i64, arrived_ns: i64) {
        let point = (board_us, arrived_ns - board_us * 1000);
        match self.low {
            Some(low) if board_us.div_euclid(STRETCH_US) == low.0.div_euclid(STRETCH_US) => {
                if point.1 < low.1 {
                    self.low = Some(point);
                }
            }
            Some(low) if board_us > low.0 => {
                self.finish_stretch(low);
                self.low = Some(point);
            }
            // A step back over the edge of a stretch.
            Some(_) => {}
            None => self.low = Some(point),
        }
        match &mut self.offset {
            None => self.offset = Some(Offset { board_us, host_ns: arrived_ns, drift_ppm: 0.0 }),
            Some(offset) => offset.host_ns += (arrived_ns - offset.host_ns(board_us)).min(0),
        }
    }

    /// The estimate, once something came.
    #[must_use]
    pub fn offset(&self) -> Option<Offset> {
        self.offset
    }

    fn finish_stretch(&mut self, low: (i64, i64)) {
        let arrived = low.1 + low.0 * 1000;
        if self.offset.is_some_and(|o| (arrived - o.host_ns(low.0)).abs() > ANOTHER_CLOCK) {
            self.lows.clear();
        }
        if self.lows.len() == STRETCHES {
            self.lows.pop_front();
        }
        self.lows.push_back(low);
        self.fit();
    }

    /// The line below all points whose slope is the median slope between them (Theil and Sen): a stretch in which
    /// everything came late moves neither.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn fit(&mut self) {
        let Some(&(origin, _)) = self.lows.back() else { return };
        let mut slope = 0.0;
        if self.lows.len() >= BELIEVED {
            let mut slopes: Vec<f64> = self
                .lows
                .iter()
                .enumerate()
                .flat_map(|(k, a)| self.lows.iter().skip(k + 1).map(move |b| (b.1 - a.1) as f64 / (b.0 - a.0) as f64))
                .collect();
            let middle = slopes.len() / 2;
            slope = *slopes.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        // Without a slope the oldest points would lie wrong by the drift: then only the newest counts.
        let believed = if self.lows.len() >= BELIEVED { self.lows.len() } else { 1 };
        let lowest = self.lows.iter().rev().take(believed);
        let lowest = lowest.map(|&(t, y)| y as f64 - slope * (t - origin) as f64).min_by(f64::total_cmp);
        let Some(lowest) = lowest else { return };
        // The slope is in ns a us: a thousandth.
        self.offset = Some(Offset { board_us: origin, host_ns: origin * 1000 + lowest as i64, drift_ppm: slope * 1e3 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arrivals each 5 ms, of a host clock that starts at `start_ns` and drifts, delayed at random by up to 2 ms.
    fn heard(seconds: i64, start_ns: i64, drift_ppm: f64) -> BoardClock {
        let mut clock = BoardClock::default();
        let mut random = 1_u64;
        for k in 0..seconds * 200 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let u = (random >> 40) as f64 / (1 << 24) as f64;
            let board_us = k * 5000;
            let true_ns = start_ns + board_us * 1000 + (board_us as f64 * drift_ppm * 1e-3) as i64;
            clock.note(board_us, true_ns + (u * u * 2e6) as i64);
        }
        clock
    }

    #[test]
    fn offset_and_drift_come_out_whatever_the_delays() {
        for drift_ppm in [0.0, 50.0, -120.0] {
            let offset = heard(60, 1_700_000_000_000_000_000, drift_ppm).offset().expect("something came");
            assert!((offset.drift_ppm - drift_ppm).abs() < 1.0, "{offset:?}");
            let board_us = 60_500_000;
            let truth = 1_700_000_000_000_000_000 + board_us * 1000 + (board_us as f64 * drift_ppm * 1e-3) as i64;
            assert!((offset.host_ns(board_us) - truth).abs() < 20_000, "{offset:?}");
            assert!((offset.board_us(offset.host_ns(board_us)) - board_us).abs() <= 1);
        }
    }

    #[test]
    fn the_first_datagram_gives_an_offset_and_an_earlier_one_a_better() {
        let mut clock = BoardClock::default();
        assert_eq!(clock.offset(), None);
        clock.note(1000, 5_000_000);
        assert_eq!(clock.offset().expect("one came").host_ns(1000), 5_000_000);
        clock.note(2000, 5_500_000);
        assert_eq!(clock.offset().expect("two came").host_ns(1000), 4_500_000);
        clock.note(3000, 9_000_000);
        assert_eq!(clock.offset().expect("three came").host_ns(1000), 4_500_000);
    }

    #[test]
    fn a_host_clock_that_was_set_is_followed_within_two_stretches() {
        let mut clock = heard(20, 1_000_000_000_000, 0.0);
        for k in 4000..4800 {
            clock.note(k * 5000, 7_000_000_000_000 + k * 5_000_000);
        }
        let offset = clock.offset().expect("something came");
        assert_eq!(offset.host_ns(30_000_000), 7_000_000_000_000 + 30_000_000_000);
    }
}

//! The relation of a board's clock to the host's, offset and drift, from arrival times alone.
//!
//! Each datagram arrives with the delay of its transmission. So the points *arrival time minus board time* are above a
//! line: the offset between the clocks plus the shortest delay, which cannot be separated from it. Of each quarter of a
//! second the earliest point is kept. The line is the edge of the lower convex hull of the last 64 s above their mean
//! time: of all lines below the points the closest to them.

mod offset;
mod pace;

use std::collections::VecDeque;

use taxel_core::wire::{DatagramInfo, WORD_BYTES};

pub use offset::Offset;
use pace::{ArrivalDelays, ArrivalPoint, LONG_US, STRETCHES};
pub use pace::{Pace, doubt};

/// Duration of a stretch, of which the earliest point is kept, us of the board's clock.
const STRETCH_US: i64 = 250_000;

/// Distance from the line, ns, beyond which points belong to another clock: the board was reset, or the host's clock
/// was set. After a pause the limit is larger, by the uncertainty of the drift.
const ANOTHER_CLOCK: f64 = 100e6;
/// Number of consecutive stretches that must be beyond that distance.
const ANOTHER: usize = 4;

/// Largest drift of a quartz, ppm; limits the slope over a short time, in which late arrivals resemble a drift.
const QUARTZ: f64 = 200.0;
/// Largest drift of any clock, ppm: a ceramic resonator has 5000.
const ANY: f64 = 20_000.0;

/// The largest datagram of a board of version 1, bytes: 280 events. A shorter one ends a frame.
const FULL: usize = 280 * WORD_BYTES;

/// The earliest time at which the board could send a datagram, us, for comparison with its arrival. `last` is the time
/// of its last event, `bytes` its length.
#[must_use]
pub fn leaves(info: &DatagramInfo, last: Option<i64>, bytes: usize, frame_us: i64) -> Option<i64> {
    match info.version {
        2 => info.until,
        // The events of a frame are sent at its end, but a full datagram is sent as soon as it is full.
        _ => last.filter(|_| bytes < FULL).map(|t| t + frame_us),
    }
}

/// Estimates the [`Offset`] from datagrams as they arrive.
#[derive(Debug, Clone, Default)]
pub struct BoardClock {
    /// The earliest point of each completed stretch, the oldest first.
    earliest: VecDeque<ArrivalPoint>,
    /// That of the current stretch.
    running: Option<ArrivalPoint>,
    /// Number of consecutive stretches that are far from the line.
    far: usize,
    offset: Option<Offset>,
    arrivals: ArrivalDelays,
}

impl BoardClock {
    /// Lines fitted to many datagrams, one for each 32 s, each with the board's time from which on it is valid, us.
    #[must_use]
    pub fn offsets_of(board_us: &[i64], arrived_ns: &[i64]) -> Vec<(i64, Offset)> {
        let (mut clock, mut lines) = (Self::default(), vec![]);
        let mut since = 0;
        for (&board, &arrived) in board_us.iter().zip(arrived_ns) {
            if clock.note(board, arrived) {
                since += 1;
                if since == STRETCHES / 2 {
                    since = 0;
                    lines.extend(clock.offset().map(|offset| (clock.middle(), offset)));
                }
            }
        }
        if since > 0 || lines.is_empty() {
            clock.end_stretch();
            lines.extend(clock.offset().map(|offset| (clock.middle(), offset)));
        }
        lines
    }

    /// Adds a datagram that the board could send at `board_us` at the earliest and that arrived at `arrived_ns`;
    /// returns whether a stretch ended.
    pub fn note(&mut self, board_us: i64, arrived_ns: i64) -> bool {
        let point = (board_us, arrived_ns - board_us * 1000);
        if let Some(offset) = self.offset {
            self.arrivals.note(board_us, arrived_ns, arrived_ns - offset.host_ns(board_us));
        }
        let mut ended = false;
        if let Some(earliest) = self.running {
            let (now, then) = (board_us.div_euclid(STRETCH_US), earliest.0.div_euclid(STRETCH_US));
            if now < then {
                // Ignores a late datagram of a stretch that has ended.
                return false;
            }
            if now > then {
                self.end_stretch();
                ended = true;
            }
        }
        self.running = Some(self.running.filter(|earliest| earliest.1 <= point.1).unwrap_or(point));
        match &mut self.offset {
            None => self.offset = Some(Offset { board_us, host_ns: arrived_ns, drift_ppm: 0.0 }),
            // Before the first line the offset is that of the earliest datagram.
            Some(offset) if self.earliest.is_empty() => {
                let early = (arrived_ns - offset.host_ns(board_us)).min(0);
                // A point this early can only mean that the host's clock was set, which several stretches must confirm.
                #[allow(clippy::cast_precision_loss)]
                if early as f64 > -ANOTHER_CLOCK {
                    offset.host_ns += early;
                }
            }
            Some(_) => {}
        }
        ended
    }

    /// The estimate, after the first datagram.
    #[must_use]
    pub fn offset(&self) -> Option<Offset> {
        self.offset
    }

    /// The drift and the delays so far, and whether they can be; after the first datagram.
    #[must_use]
    pub fn pace(&self) -> Option<Pace> {
        self.offset.map(|line| self.arrivals.pace(line))
    }

    fn end_stretch(&mut self) {
        let Some(low) = self.running.take() else { return };
        if self.arrivals.had_waited(low) {
            // What waited until it was read says nothing of the clock.
            let offset = Some(Offset { board_us: low.0, host_ns: low.1 + low.0 * 1000, drift_ppm: 0.0 });
            *self = Self { offset, arrivals: self.arrivals.caught_up(), ..Self::default() };
        }
        self.arrivals.end_stretch(low);
        if let (Some(offset), Some(last)) = (self.offset, self.earliest.back()) {
            #[allow(clippy::cast_precision_loss)]
            let (off, paused) = ((low.1 + low.0 * 1000 - offset.host_ns(low.0)) as f64, (low.0 - last.0) as f64);
            let is_far = off.abs() > ANOTHER_CLOCK + paused * QUARTZ * 1e-3;
            self.far = if is_far { self.far + 1 } else { 0 };
        }
        self.earliest.push_back(low);
        if self.far == ANOTHER {
            self.earliest.drain(..self.earliest.len() - ANOTHER);
            self.far = 0;
        } else if self.far > 0 {
            // The stretch may only be delayed: the line is kept until more stretches confirm another clock.
            return;
        }
        if self.earliest.len() > STRETCHES {
            self.earliest.pop_front();
        }
        self.fit();
    }

    /// The mean time of the points, us.
    fn middle(&self) -> i64 {
        let Some(origin) = self.earliest.front().map(|first| first.0) else { return 0 };
        let sum: i64 = self.earliest.iter().map(|point| point.0 - origin).sum();
        origin + sum / i64::try_from(self.earliest.len()).unwrap_or(1)
    }

    /// Fits the line; its slope is limited to that of a plausible clock.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn fit(&mut self) {
        let (Some(first), Some(last)) = (self.earliest.front(), self.earliest.back()) else { return };
        let most = if last.0 - first.0 >= LONG_US { ANY } else { QUARTZ } * 1e-3;
        let (middle, zero) = (self.middle(), *last);
        let relative = |&(t, late): &ArrivalPoint| ((t - middle) as f64, (late - zero.1) as f64);
        let points: Vec<(f64, f64)> = self.earliest.iter().map(relative).collect();
        let slope = hull_slope(&points).unwrap_or(0.0).clamp(-most, most);
        let lowest = points.iter().map(|&(t, late)| late - slope * t).fold(f64::INFINITY, f64::min);
        // The slope is in ns per us, that is, in thousandths.
        let height = lowest + slope * (zero.0 - middle) as f64;
        let host_ns = zero.0 * 1000 + zero.1 + height as i64;
        self.offset = Some(Offset { board_us: zero.0, host_ns, drift_ppm: slope * 1e3 });
    }
}

/// The slope of the edge of the lower convex hull above time 0; `None` if all points are at one time, or on one side of it.
fn hull_slope(points: &[(f64, f64)]) -> Option<f64> {
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
    let mut hull: Vec<(f64, f64)> = vec![];
    for &point in points {
        while let [.., before, last] = hull[..]
            && slope(before, last) >= slope(before, point)
        {
            hull.pop();
        }
        hull.push(point);
    }
    hull.windows(2).find(|edge| edge[0].0 <= 0.0 && edge[1].0 > 0.0).map(|edge| slope(edge[0], edge[1]))
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// A simulated link: a datagram each `every_us` to a host clock that starts at `start_ns` and drifts, with random
    /// delays of 5 us, more for some, and 5 ms for a fraction `spikes` of them.
    struct SimulatedLink {
        start_ns: i64,
        drift_ppm: f64,
        every_us: i64,
        spikes: f64,
        random: StdRng,
    }

    impl SimulatedLink {
        fn new(seed: u64, drift_ppm: f64, every_us: i64) -> Self {
            let random = StdRng::seed_from_u64(seed);
            Self { start_ns: 1_700_000_000_000_000_000, drift_ppm, every_us, spikes: 0.01, random }
        }

        fn truth(&self, board_us: i64) -> i64 {
            self.start_ns + board_us * 1000 + (board_us as f64 * self.drift_ppm * 1e-3) as i64
        }

        fn send(&mut self, clock: &mut BoardClock, from_us: i64, to_us: i64) {
            let mut board_us = from_us;
            while board_us < to_us {
                // Jitter of a busy machine, exponential with a mean of 60 us, plus the delay of the link itself.
                let mut late_ns = 5_000.0 - 60_000.0 * self.random.random_range(1e-9..1.0_f64).ln();
                if self.random.random_bool(self.spikes) {
                    late_ns += 5e6;
                }
                clock.note(board_us, self.truth(board_us) + late_ns as i64);
                board_us += self.every_us;
            }
        }

        /// How far the line is from the truth at a time, less the shortest link, us.
        fn off(&self, clock: &BoardClock, board_us: i64) -> f64 {
            let offset = clock.offset().expect("something came");
            (offset.host_ns(board_us) - self.truth(board_us) - 5_000) as f64 * 1e-3
        }
    }

    #[test]
    fn a_thousand_datagrams_a_second_give_the_offset_within_10_us_after_1_s_and_5_us_after_10_s() {
        for (seed, drift_ppm) in [50.0, -30.0, 0.0, 199.0, -199.0].into_iter().enumerate() {
            let mut link = SimulatedLink::new(seed as u64, drift_ppm, 1000);
            let mut clock = BoardClock::default();
            link.send(&mut clock, 0, 1_010_000);
            assert!(link.off(&clock, 1_000_000).abs() < 10.0, "{drift_ppm}: {} us", link.off(&clock, 1_000_000));
            link.send(&mut clock, 1_010_000, 10_010_000);
            assert!(link.off(&clock, 10_000_000).abs() < 5.0, "{drift_ppm}: {} us", link.off(&clock, 10_000_000));
        }
    }

    #[test]
    fn offset_and_drift_come_out_whatever_the_rate_and_the_seed() {
        let mut random = StdRng::seed_from_u64(7);
        for seed in 0..40 {
            let drift_ppm = random.random_range(-200.0..200.0);
            let every_us = [192, 500, 1000, 5000][seed as usize % 4];
            let mut link = SimulatedLink::new(seed, drift_ppm, every_us);
            link.start_ns = random.random_range(0..2_000_000_000_000_000_000);
            let begin = random.random_range(-1_000_000_000_000..1_000_000_000_000);
            let mut clock = BoardClock::default();
            link.send(&mut clock, begin, begin + 60_000_000);
            let offset = clock.offset().expect("something came");
            assert!((offset.drift_ppm - drift_ppm).abs() < 1.0, "{drift_ppm}, each {every_us} us: {offset:?}");
            assert!(link.off(&clock, begin + 60_000_000).abs() < 20.0, "{drift_ppm}, each {every_us} us");
            assert!((offset.board_us(offset.host_ns(begin)) - begin).abs() <= 1);
        }
    }

    /// Difference between the estimates for two sources that send 2000 datagrams a second, after 1 s and after 10 s,
    /// us; `late_us` is the random delay of a datagram at a time.
    fn apart(seed: u64, late_us: impl Fn(i64, &mut StdRng) -> f64) -> [f64; 2] {
        let mut random = StdRng::seed_from_u64(seed);
        let mut off = [[0.0; 2]; 2];
        for (off, drift_ppm) in off.iter_mut().zip([-50.0, 30.0]) {
            let (link, mut clock) = (SimulatedLink::new(seed, drift_ppm, 500), BoardClock::default());
            for board_us in (500..10_010_000).step_by(500) {
                let mut late = late_us(board_us, &mut random);
                if random.random_bool(0.01) {
                    late += 5000.0;
                }
                clock.note(board_us, link.truth(board_us) + (late * 1e3) as i64);
                match board_us {
                    1_009_500 => off[0] = link.off(&clock, 1_000_000),
                    10_009_500 => off[1] = link.off(&clock, 10_000_000),
                    _ => {}
                }
            }
        }
        [0, 1].map(|k| (off[0][k] - off[1][k]).abs())
    }

    /// An exponentially distributed delay with this mean, us.
    fn tail(random: &mut StdRng, mean: f64) -> f64 {
        -mean * random.random_range(1e-9..1.0_f64).ln()
    }

    #[test]
    fn what_comes_sooner_than_is_usual_moves_the_line_by_less_than_20_us() {
        // Recorded arrivals of a sleeping sender had this distribution: 15 us and more, but one in a thousand earlier,
        // down to 0.
        for seed in 0..30 {
            let [after_1_s, after_10_s] = apart(seed, |_, random| {
                let early = if random.random_bool(0.001) { random.random_range(0.0..1.0) } else { 1.0 };
                early * (15.0 + tail(random, 8.0))
            });
            // The difference of two lines.
            assert!(after_1_s < 30.0, "{seed}: {after_1_s} us after 1 s");
            assert!(after_10_s < 20.0, "seed {seed}: after 10 s the clock is off by {after_10_s} us");
        }
    }

    #[test]
    fn stretches_in_which_everything_was_late_do_not_move_the_line() {
        // A sender that is suspended for a third of the time, 50 ms at once; its datagrams are then late by
        // milliseconds.
        for seed in 0..30 {
            let [after_1_s, after_10_s] = apart(seed, |board_us, random| {
                let waits = board_us / 50_000 % 3 == 1;
                3.0 + tail(random, 8.0) + if waits { 300.0 + tail(random, 3000.0) } else { 0.0 }
            });
            assert!(after_1_s < 10.0, "{seed}: {after_1_s} us after 1 s");
            assert!(after_10_s < 5.0, "seed {seed}: after 10 s the clock is off by {after_10_s} us");
        }
    }

    #[test]
    fn datagrams_that_leave_together_are_one_point() {
        let (mut each, mut batch) = (BoardClock::default(), BoardClock::default());
        for k in 0..4000_i64 {
            let arrived = k * 1_000_000 + (k * 7919 % 97) * 1000;
            each.note(k * 1000, arrived);
            for behind in [40_000, 0, 20_000, 60_000] {
                batch.note(k * 1000, arrived + behind);
            }
        }
        assert_eq!(each.offset(), batch.offset());
    }

    #[test]
    fn a_few_datagrams_a_second_with_late_ones_among_them_do_not_look_like_a_drift() {
        for seed in 0..20 {
            let mut link = SimulatedLink::new(seed, 10.0, 200_000);
            link.spikes = 0.3;
            let mut clock = BoardClock::default();
            for second in 0..60 {
                link.send(&mut clock, second * 1_000_000, (second + 1) * 1_000_000);
                let most = if second < 10 { 1500.0 } else { 300.0 };
                assert!(link.off(&clock, second * 1_000_000).abs() < most, "{second} s: {clock:?}");
            }
        }
    }

    #[test]
    fn exact_datagrams_have_no_drift_however_few_they_are() {
        for count in 1..40 {
            let board_us: Vec<i64> = (0..count).map(|k| 1000 * k).collect();
            let arrived_ns: Vec<i64> = board_us.iter().map(|t| 5_000_000 + 1000 * t).collect();
            for (_, line) in BoardClock::offsets_of(&board_us, &arrived_ns) {
                assert!(line.drift_ppm.abs() < 1e-6, "{count}: {line:?}");
            }
        }
    }

    #[test]
    fn after_a_pause_of_an_hour_the_line_still_holds_and_is_better_than_before() {
        for (seed, drift_ppm) in [200.0, -200.0, 35.0].into_iter().enumerate() {
            let mut link = SimulatedLink::new(seed as u64, drift_ppm, 1000);
            let mut clock = BoardClock::default();
            link.send(&mut clock, 0, 20_000_000);
            link.send(&mut clock, 3_620_000_000, 3_622_000_000);
            assert!(link.off(&clock, 3_622_000_000).abs() < 10.0, "{drift_ppm}: {}", link.off(&clock, 3_622_000_000));
            let found = clock.offset().expect("something came").drift_ppm;
            assert!((found - drift_ppm).abs() < 0.1, "{drift_ppm}: {found}");
        }
    }

    #[test]
    fn a_clock_that_is_no_quartz_is_believed_after_ten_seconds() {
        let mut link = SimulatedLink::new(3, 5000.0, 1000);
        let mut clock = BoardClock::default();
        link.send(&mut clock, 0, 12_000_000);
        assert!((clock.offset().expect("something came").drift_ppm - 5000.0).abs() < 5.0);
        assert!(link.off(&clock, 12_000_000).abs() < 20.0);
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
    fn a_host_clock_that_was_set_is_followed_within_two_seconds() {
        let mut clock = BoardClock::default();
        for (from, to, start) in [(0, 4000, 1_000_000_000_000), (4000, 4400, 7_000_000_000_000), (4400, 4800, 0)] {
            for k in from..to {
                clock.note(k * 5000, start + k * 5_000_000);
            }
            let offset = clock.offset().expect("something came");
            assert!((offset.host_ns(to * 5000) - start - to * 5_000_000).abs() < 1000, "{offset:?}");
        }
    }

    #[test]
    fn lines_follow_a_quartz_that_warms_up() {
        // The drift changes by 2 ppm within ten minutes: a single line would be wrong by 150 us.
        let (mut board, mut arrived) = (vec![], vec![]);
        let mut random = StdRng::seed_from_u64(1);
        let truth = |t: f64| 1e18 + t * 1e3 + t * t * 1e-3 * (2.0 / 600e6) / 2.0;
        for k in 0..600_000_i64 {
            board.push(k * 1000);
            arrived.push((truth(k as f64 * 1e3) - 60_000.0 * random.random_range(1e-9..1.0_f64).ln()) as i64);
        }
        for (at, line) in BoardClock::offsets_of(&board, &arrived) {
            let off = (line.host_ns(at) as f64 - truth(at as f64)).abs();
            assert!(off < 10_000.0, "at {at}: {off} ns");
        }
    }

    #[test]
    fn a_sender_that_does_not_keep_pace_with_its_clock_is_doubted_and_a_poor_clock_is_not() {
        for (drift_ppm, doubted) in [(-9_900.0, false), (9_900.0, false), (10_100.0, true), (-318_601.0, true)] {
            let mut link = SimulatedLink::new(11, drift_ppm, 1000);
            let mut clock = BoardClock::default();
            link.send(&mut clock, 0, 20_000_000);
            let pace = clock.pace().expect("something came");
            assert!((pace.drift_ppm - drift_ppm).abs() < 0.01 * drift_ppm.abs(), "{drift_ppm}: {pace:?}");
            assert_eq!(pace.doubt.is_some(), doubted, "{pace:?}");
            let text = format!("a drift of {drift_ppm:+.0}").chars().take(14).collect::<String>();
            assert!(pace.doubt.is_none_or(|why| why.starts_with(&text)), "{text}");
        }
    }

    #[test]
    fn delays_beyond_the_shortest_are_told_and_those_of_seconds_doubted() {
        let (start, mut clock) = (1_000_000_000_000, BoardClock::default());
        assert_eq!(clock.pace(), None);
        // One in ten is late by 20 ms, and of 30 s the last two are sent together 1.5 s later.
        for k in 0..30_000_i64 {
            let late = if k >= 28_000 { 1_500_000_000 } else { 20_000_000 * i64::from(k % 10 == 9) };
            clock.note(k * 1000, start + k * 1_000_000 + late);
            if k == 27_999 {
                let pace = clock.pace().expect("something came");
                let (median, most) = (pace.delay.p50_us.expect("some"), pace.delay.p99_us.expect("some"));
                assert!(median < 1.0 && (20_000.0..20_700.0).contains(&most), "{pace:?}");
                assert_eq!(pace.doubt, None);
            }
        }
        let why = clock.pace().and_then(|pace| pace.doubt).expect("a doubt");
        assert!(why.contains("a delay of 1.5 s"), "{why}");
    }

    #[test]
    fn lines_that_waited_before_they_were_read_cause_no_doubt() {
        for waited_us in [100_000, 580_000, 714_000, 3_000_000] {
            let mut clock = BoardClock::default();
            for k in 0..2400_i64 {
                // What waited comes at once, within a few ms.
                let arrived_us = (k * 13_333).max(waited_us + k * 20);
                clock.note(k * 13_333, arrived_us * 1000);
                let pace = clock.pace().expect("something came");
                let late = k * 13_333 > waited_us + 500_000;
                assert!(!late || (pace.doubt.is_none() && pace.drift_ppm.abs() < 7000.0), "{waited_us}, {k}: {pace:?}");
            }
            let (pace, offset) = (clock.pace().expect("some"), clock.offset().expect("some"));
            assert!(pace.drift_ppm.abs() < 1.0 && pace.delay.p50_us.expect("some").abs() < 100.0, "{pace:?}");
            assert!((offset.host_ns(0) / 1000).abs() < 100, "{offset:?}");
        }
    }

    #[test]
    fn a_simulated_board_is_as_slow_as_its_simulation_and_not_doubted() {
        let mut clock = BoardClock::default();
        for k in 0..40_000_i64 {
            clock.note(k * 10_000, k * 400_000_000);
            if k == 3 || k == 1000 || k == 39_999 {
                let pace = clock.pace().expect("something came");
                assert!((pace.drift_ppm / 39e6 - 1.0).abs() < 0.01 && pace.doubt.is_none(), "{k}: {pace:?}");
            }
        }
    }

    #[test]
    fn memory_stays_bounded() {
        let mut clock = BoardClock::default();
        for k in 0..2_000_000_i64 {
            clock.note(k * 50, k * 50_000 - k * k / 1000);
        }
        assert!(clock.earliest.len() <= STRETCHES);
        assert_eq!(clock.arrivals.fastest_count(), STRETCHES);
    }
}

//! A board's clock as the host sees it: offset and drift, from arrival times alone.
//!
//! Something comes late by whatever the way costs. So the points *arrival less own time* lie above the line that is the offset
//! between the clocks (plus the shortest way, which cannot be told from it), and what came quickly lies near it.
//!
//! The very quickest are no measure: one in a thousand is stamped 10 to 20 us sooner than the others ever are, as a core was
//! just awake or a timer just fired, and a line below all points hangs on two of those. So one in a hundred may lie below. Of
//! all such lines it is the one that lies nearest to the points above it: the line of quantile regression, along which those
//! below are balanced about the mean time. Of fewer than a hundred points none lies below, and it is the edge of the lower
//! convex hull above the mean time.

mod offset;
mod points;
mod stretch;

use std::collections::VecDeque;

use taxel_core::wire::{Took, WORD_BYTES};

pub use offset::Offset;
use points::Points;
use stretch::{Point, Stretch};

/// The hull is kept in stretches of this length, us of the board's clock ...
const STRETCH_US: i64 = 250_000;
/// ... of which so many are looked at: 64 s, within which a quartz keeps its rate.
const STRETCHES: usize = 256;
/// Of stretches that are over longer than so many, only those are kept which a line can still pass near.
const NEW: usize = 8;

/// While a clock is new its line is drawn each stretch, later each so many: it hardly moves any more.
const DRAWN_EACH: usize = 4;

/// A second of points that lie this far from what was expected is another clock: a board that was reset, a host whose clock
/// was set; ns. A pause allows for more, as a drift was known no better than that.
const ANOTHER_CLOCK: f64 = 100e6;
/// How many stretches in a row must lie there.
const ANOTHER: usize = 4;

/// The drift of a quartz, ppm: what is believed at most of a short time, in which a late arrival looks like a drift.
const QUARTZ: f64 = 200.0;
/// That of a clock that is no quartz, ppm: a ceramic resonator has 5000.
const ANY: f64 = 20_000.0;
/// From so long on more than [`QUARTZ`] is believed, us.
const LONG_US: i64 = 10_000_000;

/// The largest datagram of a board of version 1, which closes a frame with a shorter one: 280 events.
const FULL: usize = 280 * WORD_BYTES;

/// When a datagram could leave the board at the earliest, us: what of its time can be compared with its arrival. `last` is
/// the time of its last event, `bytes` its length.
#[must_use]
pub fn leaves(took: &Took, last: Option<i64>, bytes: usize, frame_us: i64) -> Option<i64> {
    match took.version {
        2 => took.until,
        // What a frame saw leaves at its end, but for a full datagram, which leaves as soon as it is full.
        _ => last.filter(|_| bytes < FULL).map(|t| t + frame_us),
    }
}

/// Estimates the [`Offset`] as datagrams come.
#[derive(Debug, Clone, Default)]
pub struct BoardClock {
    /// Stretches that are over, the oldest first.
    stretches: VecDeque<Stretch>,
    /// The one that runs.
    running: Stretch,
    /// Stretches in a row that lie far from what was expected.
    far: usize,
    /// Stretches since the line was drawn.
    undrawn: usize,
    offset: Option<Offset>,
}

impl BoardClock {
    /// Lines through many datagrams, each from the board's time on that stands beside it, us: one for each 32 s.
    #[must_use]
    pub fn offsets_of(board_us: &[i64], arrived_ns: &[i64]) -> Vec<(i64, Offset)> {
        let (mut clock, mut lines) = (Self::default(), vec![]);
        let mut since = 0;
        for (&board, &arrived) in board_us.iter().zip(arrived_ns) {
            if clock.note(board, arrived) {
                since += 1;
                if since == STRETCHES / 2 {
                    since = 0;
                    clock.draw();
                    lines.extend(clock.offset().map(|offset| (clock.middle(), offset)));
                }
            }
        }
        if since > 0 || lines.is_empty() {
            lines.extend(clock.finish().map(|offset| (clock.middle(), offset)));
        }
        lines
    }

    /// Notes that something which could leave the board at `board_us` at the earliest arrived at `arrived_ns`; gives whether
    /// a stretch ended.
    pub fn note(&mut self, board_us: i64, arrived_ns: i64) -> bool {
        let point = (board_us, arrived_ns - board_us * 1000);
        let mut ended = false;
        if self.running.points > 0 {
            let (now, then) = (board_us.div_euclid(STRETCH_US), self.running.last.div_euclid(STRETCH_US));
            if now < then {
                // A step back over the edge of a stretch.
                return false;
            }
            if now > then {
                self.end_stretch();
                ended = true;
            }
        }
        self.running.push(point);
        match &mut self.offset {
            None => self.offset = Some(Offset { board_us, host_ns: arrived_ns, drift_ppm: 0.0 }),
            // Until there is a line nothing is known but the quickest.
            Some(offset) if self.stretches.is_empty() => {
                let early = (arrived_ns - offset.host_ns(board_us)).min(0);
                // So early only where the host's clock was set: then more must say so.
                #[allow(clippy::cast_precision_loss)]
                if early as f64 > -ANOTHER_CLOCK {
                    offset.host_ns += early;
                }
            }
            Some(_) => {}
        }
        ended
    }

    /// The estimate, once something came.
    #[must_use]
    pub fn offset(&self) -> Option<Offset> {
        self.offset
    }

    /// The estimate when nothing comes any more.
    fn finish(&mut self) -> Option<Offset> {
        if self.running.points > 0 {
            self.end_stretch();
        }
        self.draw();
        self.offset
    }

    fn end_stretch(&mut self) {
        let stretch = std::mem::take(&mut self.running);
        if let (Some(low), Some(offset), Some(last)) = (stretch.lowest(), self.offset, self.stretches.back()) {
            #[allow(clippy::cast_precision_loss)]
            let (off, paused) = ((low.1 + low.0 * 1000 - offset.host_ns(low.0)) as f64, (low.0 - last.first) as f64);
            let is_far = off.abs() > ANOTHER_CLOCK + paused * QUARTZ * 1e-3;
            self.far = if is_far { self.far + 1 } else { 0 };
        }
        self.stretches.push_back(stretch);
        if self.far == ANOTHER {
            self.stretches.drain(..self.stretches.len() - ANOTHER);
            self.far = 0;
        } else if self.far > 0 {
            // Not yet: it may be late only, or too early for us to believe.
            return;
        }
        while self.stretches.len() > STRETCHES {
            self.stretches.pop_front();
        }
        self.undrawn += 1;
        if self.stretches.len() < DRAWN_EACH * NEW || self.undrawn >= DRAWN_EACH {
            self.draw();
        }
        if let (Some(k), Some(line)) = (self.stretches.len().checked_sub(NEW + 1), self.offset) {
            self.stretches[k].thin(line);
        }
    }

    /// The mean time of the points looked at, us.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn middle(&self) -> i64 {
        let Some(origin) = self.stretches.front().map(|stretch| stretch.first) else { return 0 };
        let (sum, points) = self.stretches.iter().fold((0.0, 0), |(sum, points), s| {
            (sum + s.sum as f64 + s.points as f64 * (s.first - origin) as f64, points + s.points)
        });
        origin + (sum / points.max(1) as f64) as i64
    }

    /// Draws the line that one in a hundred points may lie below; where it is too steep, the steepest believed one.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn draw(&mut self) {
        self.undrawn = 0;
        let (Some(first), Some(last)) = (self.stretches.front(), self.stretches.back()) else { return };
        let (Some(zero), origin) = (last.lowest(), last.last) else { return };
        let most = if origin - first.first >= LONG_US { ANY } else { QUARTZ } * 1e-3;
        let middle = self.middle();
        let from_middle = |&(t, late): &Point| ((t - middle) as f64, (late - zero.1) as f64);
        let all = self.stretches.iter().flat_map(|stretch| stretch.quick.iter().map(from_middle)).collect();
        let points = Points { all, early: self.stretches.iter().map(Stretch::early).sum() };
        let slope = points.slope(self.offset.map_or(0.0, |offset| offset.drift_ppm * 1e-3), most);
        let height = points.under(slope).0 + slope * (origin - middle) as f64;
        // The slope is in ns a us: a thousandth.
        let host_ns = origin * 1000 + zero.1 + height as i64;
        self.offset = Some(Offset { board_us: origin, host_ns, drift_ppm: slope * 1e3 });
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::stretch::{PART_US, QUICK};
    use super::*;

    /// Arrivals each `every_us`, of a host clock that starts at `start_ns` and drifts, delayed at random: by 5 us, more of some,
    /// and by 5 ms of `spikes` of them.
    struct Way {
        start_ns: i64,
        drift_ppm: f64,
        every_us: i64,
        spikes: f64,
        random: StdRng,
    }

    impl Way {
        fn new(seed: u64, drift_ppm: f64, every_us: i64) -> Self {
            let random = StdRng::seed_from_u64(seed);
            Self { start_ns: 1_700_000_000_000_000_000, drift_ppm, every_us, spikes: 0.01, random }
        }

        fn truth(&self, board_us: i64) -> i64 {
            self.start_ns + board_us * 1000 + (board_us as f64 * self.drift_ppm * 1e-3) as i64
        }

        fn hear(&mut self, clock: &mut BoardClock, from_us: i64, to_us: i64) {
            let mut board_us = from_us;
            while board_us < to_us {
                // Jitter of a machine that has other work: exponential, 60 us in the mean, and the way itself.
                let mut late_ns = 5_000.0 - 60_000.0 * self.random.random_range(1e-9..1.0_f64).ln();
                if self.random.random_bool(self.spikes) {
                    late_ns += 5e6;
                }
                clock.note(board_us, self.truth(board_us) + late_ns as i64);
                board_us += self.every_us;
            }
        }

        /// How far the line is from the truth at a time, the shortest way taken off, us.
        fn off(&self, clock: &BoardClock, board_us: i64) -> f64 {
            let offset = clock.offset().expect("something came");
            (offset.host_ns(board_us) - self.truth(board_us) - 5_000) as f64 * 1e-3
        }
    }

    #[test]
    fn a_thousand_datagrams_a_second_give_the_offset_within_10_us_after_1_s_and_5_us_after_10_s() {
        for (seed, drift_ppm) in [50.0, -30.0, 0.0, 199.0, -199.0].into_iter().enumerate() {
            let mut way = Way::new(seed as u64, drift_ppm, 1000);
            let mut clock = BoardClock::default();
            way.hear(&mut clock, 0, 1_010_000);
            assert!(way.off(&clock, 1_000_000).abs() < 10.0, "{drift_ppm}: {} us", way.off(&clock, 1_000_000));
            way.hear(&mut clock, 1_010_000, 10_010_000);
            assert!(way.off(&clock, 10_000_000).abs() < 5.0, "{drift_ppm}: {} us", way.off(&clock, 10_000_000));
        }
    }

    #[test]
    fn offset_and_drift_come_out_whatever_the_rate_and_the_seed() {
        let mut random = StdRng::seed_from_u64(7);
        for seed in 0..40 {
            let drift_ppm = random.random_range(-200.0..200.0);
            let every_us = [192, 500, 1000, 5000][seed as usize % 4];
            let mut way = Way::new(seed, drift_ppm, every_us);
            way.start_ns = random.random_range(0..2_000_000_000_000_000_000);
            let begin = random.random_range(-1_000_000_000_000..1_000_000_000_000);
            let mut clock = BoardClock::default();
            way.hear(&mut clock, begin, begin + 60_000_000);
            let offset = clock.offset().expect("something came");
            assert!((offset.drift_ppm - drift_ppm).abs() < 1.0, "{drift_ppm}, each {every_us} us: {offset:?}");
            assert!(way.off(&clock, begin + 60_000_000).abs() < 20.0, "{drift_ppm}, each {every_us} us");
            assert!((offset.board_us(offset.host_ns(begin)) - begin).abs() <= 1);
        }
    }

    /// How far two sources come out apart that send 2000 datagrams a second, after 1 s and after 10 s, us; `late_us` is by how
    /// much a datagram comes late at a time, by chance.
    fn apart(seed: u64, late_us: impl Fn(i64, &mut StdRng) -> f64) -> [f64; 2] {
        let mut random = StdRng::seed_from_u64(seed);
        let mut off = [[0.0; 2]; 2];
        for (off, drift_ppm) in off.iter_mut().zip([-50.0, 30.0]) {
            let (way, mut clock) = (Way::new(seed, drift_ppm, 500), BoardClock::default());
            for board_us in (500..10_010_000).step_by(500) {
                let mut late = late_us(board_us, &mut random);
                if random.random_bool(0.01) {
                    late += 5000.0;
                }
                clock.note(board_us, way.truth(board_us) + (late * 1e3) as i64);
                match board_us {
                    1_009_500 => off[0] = way.off(&clock, 1_000_000),
                    10_009_500 => off[1] = way.off(&clock, 10_000_000),
                    _ => {}
                }
            }
        }
        [0, 1].map(|k| (off[0][k] - off[1][k]).abs())
    }

    /// In the mean `mean` us, without memory.
    fn tail(random: &mut StdRng, mean: f64) -> f64 {
        -mean * random.random_range(1e-9..1.0_f64).ln()
    }

    #[test]
    fn what_comes_sooner_than_is_usual_does_not_move_the_line() {
        // As a sleeping sender's arrivals were recorded: 15 us and more, but one in a thousand sooner, down to 0.
        for seed in 0..30 {
            let [after_1_s, after_10_s] = apart(seed, |_, random| {
                let early = if random.random_bool(0.001) { random.random_range(0.0..1.0) } else { 1.0 };
                early * (15.0 + tail(random, 8.0))
            });
            assert!(after_1_s < 10.0, "{seed}: {after_1_s} us after 1 s");
            assert!(after_10_s < 5.0, "{seed}: {after_10_s} us after 10 s");
        }
    }

    #[test]
    fn stretches_in_which_everything_was_late_do_not_move_the_line() {
        // A sender that does not run for a third of the time, 50 ms at once; what it sends then is late by milliseconds.
        for seed in 0..30 {
            let [after_1_s, after_10_s] = apart(seed, |board_us, random| {
                let waits = board_us / 50_000 % 3 == 1;
                3.0 + tail(random, 8.0) + if waits { 300.0 + tail(random, 3000.0) } else { 0.0 }
            });
            assert!(after_1_s < 10.0, "{seed}: {after_1_s} us after 1 s");
            assert!(after_10_s < 5.0, "{seed}: {after_10_s} us after 10 s");
        }
    }

    #[test]
    fn datagrams_that_leave_together_are_one_point() {
        let (mut one, mut many) = (BoardClock::default(), BoardClock::default());
        for k in 0..4000_i64 {
            let arrived = k * 1_000_000 + (k * 7919 % 97) * 1000;
            one.note(k * 1000, arrived);
            for behind in [40_000, 0, 20_000, 60_000] {
                many.note(k * 1000, arrived + behind);
            }
        }
        assert_eq!(one.offset(), many.offset());
    }

    #[test]
    fn a_few_datagrams_a_second_with_late_ones_among_them_do_not_look_like_a_drift() {
        for seed in 0..20 {
            let mut way = Way::new(seed, 10.0, 200_000);
            way.spikes = 0.3;
            let mut clock = BoardClock::default();
            for second in 0..60 {
                way.hear(&mut clock, second * 1_000_000, (second + 1) * 1_000_000);
                let most = if second < 10 { 1500.0 } else { 300.0 };
                assert!(way.off(&clock, second * 1_000_000).abs() < most, "{second} s: {clock:?}");
            }
        }
    }

    #[test]
    fn after_a_pause_of_an_hour_the_line_still_holds_and_is_better_than_before() {
        for (seed, drift_ppm) in [200.0, -200.0, 35.0].into_iter().enumerate() {
            let mut way = Way::new(seed as u64, drift_ppm, 1000);
            let mut clock = BoardClock::default();
            way.hear(&mut clock, 0, 20_000_000);
            way.hear(&mut clock, 3_620_000_000, 3_622_000_000);
            assert!(way.off(&clock, 3_622_000_000).abs() < 10.0, "{drift_ppm}: {}", way.off(&clock, 3_622_000_000));
            let found = clock.offset().expect("something came").drift_ppm;
            assert!((found - drift_ppm).abs() < 0.1, "{drift_ppm}: {found}");
        }
    }

    #[test]
    fn a_clock_that_is_no_quartz_is_believed_after_ten_seconds() {
        let mut way = Way::new(3, 5000.0, 1000);
        let mut clock = BoardClock::default();
        way.hear(&mut clock, 0, 12_000_000);
        assert!((clock.offset().expect("something came").drift_ppm - 5000.0).abs() < 5.0);
        assert!(way.off(&clock, 12_000_000).abs() < 20.0);
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
        // 2 ppm within ten minutes: one line would be 150 us off.
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
    fn what_is_kept_stays_bounded() {
        let mut clock = BoardClock::default();
        for k in 0..2_000_000_i64 {
            clock.note(k * 50, k * 50_000 - k * k / 1000);
        }
        let most = usize::try_from(STRETCH_US / PART_US).expect("some") * QUICK;
        assert!(clock.stretches.iter().chain([&clock.running]).all(|stretch| stretch.quick.len() <= most));
        assert!(clock.stretches.len() <= STRETCHES);
    }
}

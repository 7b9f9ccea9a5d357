//! The times of lines of numbers, with or without stamps of their own.

mod clock;

use super::causes::Cause;
use super::verdict::Found;
use clock::StreamClock;

/// Counts what could not be read of a stream, and what is wrong with its stamps: while it is recorded as in its file.
#[derive(Debug, Clone)]
pub struct StreamFaults {
    /// What was found so far, as a verdict states it.
    pub found: Found,
    clock: StreamClock,
}

impl StreamFaults {
    /// None so far, of lines with stamps in this unit, us, that may have `waited` in a file.
    #[must_use]
    pub fn new(unit_us: f64, waited: bool) -> Self {
        Self { found: Found::default(), clock: StreamClock::new(unit_us, waited) }
    }

    /// Counts the values of a line or a frame that are missing.
    pub fn missing(&mut self, values: impl IntoIterator<Item = f64>) {
        self.found.counts[Cause::Missing] += values.into_iter().filter(|value| value.is_nan()).count() as u64;
    }

    /// The time, us, of a line with this stamp or none that arrived at `at_ns`; none if the stamp is no time.
    pub fn time(&mut self, stamp: Option<f64>, at_ns: i64) -> Option<i64> {
        match stamp {
            None => Some(at_ns.div_euclid(1000)),
            Some(stamp) => self.clock.time(stamp, at_ns, &mut self.found),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng, rngs::StdRng};

    /// Of a clock that counts in so many us.
    fn clock(unit_us: f64) -> StreamFaults {
        StreamFaults::new(unit_us, false)
    }

    fn times(mut faults: StreamFaults, stamps: &[(f64, i64)]) -> (Vec<i64>, Counted) {
        let t = stamps.iter().filter_map(|&(stamp, at_ns)| faults.time(Some(stamp), at_ns)).collect();
        let Found { counts, doubtful_after_us, .. } = faults.found;
        let counted = Counted {
            anew: counts[Cause::ClockAnew],
            back: counts[Cause::StampsBack],
            jumps: counts[Cause::Jumps],
            drifts: counts[Cause::Drifts],
            after: doubtful_after_us,
        };
        assert_eq!(
            counts.iter().map(|(_, n)| n).sum::<u64>(),
            counted.anew + counted.back + counted.jumps + counted.drifts
        );
        (t, counted)
    }

    /// What a stream's clock was found to have done.
    #[derive(Debug, Default, PartialEq)]
    struct Counted {
        anew: u64,
        back: u64,
        jumps: u64,
        drifts: u64,
        after: Option<i64>,
    }

    #[test]
    fn a_counter_of_32_bits_goes_on_over_its_turns_and_over_a_pause_of_hours() {
        let turn = 1_i64 << 32;
        let mut stamps = vec![];
        let mut truth = vec![];
        // 10 ms apart around the turn, then a pause of three hours (two and a half turns), with arrivals late by up to 20 ms.
        for k in 0..100_i64 {
            let t = turn - 500_000 + k * 10_000 + if k >= 80 { 10_800_000_000 } else { 0 };
            truth.push(t);
            stamps.push(((t % turn) as f64, 1_700_000_000_000_000_000 + t * 1000 + (k * 7919 % 20_000) * 1000));
        }
        assert_eq!(times(clock(1.0), &stamps), (truth, Counted::default()));
    }

    #[test]
    fn a_clock_that_begins_anew_goes_on_by_arrival() {
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let stamps = [(60_000.0, at(0)), (60_010.0, at(10)), (5.0, at(2_010)), (15.0, at(2_020))];
        let (t, counted) = times(clock(1e3), &stamps);
        assert_eq!(t, [60_000_000, 60_010_000, 62_010_000, 62_020_000]);
        assert_eq!(counted, Counted { anew: 1, ..Counted::default() });
    }

    #[test]
    fn one_damaged_stamp_moves_no_other_and_is_no_restart() {
        let truth: Vec<i64> = (0..100).map(|k| 10_000_000 + k * 20_000).collect();
        for (index, wrong) in [(50, 18_000_000), (50, 1 << 31), (50, 3), (1, 90_000_000), (98, 0)] {
            let mut stamps: Vec<(f64, i64)> = truth.iter().map(|&t| (t as f64, t * 1000)).collect();
            stamps[index].0 = f64::from(wrong);
            let (t, counted) = times(clock(1.0), &stamps);
            let before = truth[index - 1];
            assert_eq!(counted, Counted { jumps: 1, after: Some(before), ..Counted::default() }, "{wrong} at {index}");
            assert_eq!(t, truth, "{wrong} at {index}");
        }
    }

    #[test]
    fn a_clock_that_stays_ahead_of_arrival_has_jumped_and_a_line_delayed_or_a_host_set_back_has_not() {
        let stamps = |ahead: f64, late_ns: i64, host_ns: i64| -> Vec<_> {
            let late = |k: i64| if (50..80).contains(&k) { late_ns - (k - 50) * 20_000_000 } else { 0 };
            let at = |k: i64| 1_700_000_000_000_000_000 + k * 20_000_000 + late(k) + if k < 50 { 0 } else { host_ns };
            (0..100).map(|k| (20.0 * k as f64 + if k < 50 { 0.0 } else { ahead }, at(k))).collect()
        };
        let jumped = Counted { jumps: 1, after: Some(980_000), ..Counted::default() };
        assert_eq!(times(clock(1e3), &stamps(1500.0, 0, 0)).1, jumped);
        assert_eq!(times(clock(1e3), &stamps(0.0, 0, 0)).1, Counted::default());
        assert_eq!(times(clock(1e3), &stamps(0.0, 600_000_000, 0)).1, Counted::default());
        assert_eq!(times(clock(1e3), &stamps(0.0, 0, -60_000_000_000)).1, Counted::default());
    }

    /// The lines of a source every `period_us` for `seconds`, whose clock runs at a rate, with the delays of their arrival.
    fn running(rate: f64, period_us: f64, seconds: f64, delay_us: impl Fn(f64) -> f64) -> Vec<(f64, i64)> {
        let lines = (0..(seconds * 1e6 / period_us) as u32).map(|k| f64::from(k) * period_us);
        lines.map(|t| ((t * rate).floor(), 1_700_000_000_000_000_000 + ((t + delay_us(t)) * 1e3) as i64)).collect()
    }

    #[test]
    fn a_clock_at_another_rate_is_told_once_and_a_drift_packets_and_what_has_waited_are_not() {
        for seed in 0..90 {
            let mut draw = StdRng::seed_from_u64(seed);
            let period_us: f64 = [1e4, 1e5, 7e5, 3e6][draw.random_range(0..4)];
            let (waited_us, packet_us) = (draw.random_range(0.0..2e7), draw.random_range(1e4..5e6));
            let jitter_us = draw.random_range(0.0..period_us.min(5e5));
            let delay = |t: f64| match seed % 3 {
                // What waits, and what comes in packets, are several lines.
                0 if period_us < 1e6 => (waited_us - t).max(0.0),
                1 if period_us < 1e6 => packet_us - t % packet_us,
                _ => (t * 0.618_034) % 1.0 * jitter_us,
            };
            let rate = 1.0 + draw.random_range(-1e-3..1e-3);
            let sound = running(rate, period_us, 200.0, delay);
            assert_eq!(times(clock(1.0), &sound).1, Counted::default(), "seed {seed}");
            let rate = [0.0, 1e-3, 0.5, 0.9, 0.97, 1.03, 1.1, 1.9][draw.random_range(0..8)];
            let (_, told) = times(clock(1.0), &running(rate, period_us, 600.0, delay));
            // A clock that is fast by a second from one line to the next jumps.
            let jumps = if period_us * rate > 1e6 { told.jumps } else { 0 };
            let drifts = if jumps > 0 { told.drifts } else { 1 };
            assert_eq!(
                told,
                Counted { drifts, jumps, after: told.after, ..Counted::default() },
                "seed {seed}, rate {rate}"
            );
            // In packets of 5 s a clock that is off by 3 % agrees with one arrival or other for 170 s.
            let latest = if seed % 3 == 1 { 170_000_000 } else { 60_000_000 };
            assert!(told.after.is_some_and(|after| after <= latest), "seed {seed}, rate {rate}: {told:?}");
        }
    }

    #[test]
    fn lines_that_waited_in_a_file_have_no_clock_to_compare_with_and_step_back_as_others_do() {
        for (rate, period_us) in [(1.0, 1e4), (300.0, 1e4), (0.1, 1e5), (1.0, 3e6)] {
            let mut stamps = running(rate, period_us, 200.0, |_| 0.0);
            let waited = StreamFaults::new(1.0, true);
            assert_eq!(times(waited.clone(), &stamps).1, Counted::default(), "rate {rate}");
            let (last, at_ns) = *stamps.last().unwrap();
            stamps.push((last - 1000.0, at_ns));
            assert_eq!(times(waited, &stamps).1.back, 1, "rate {rate}");
        }
    }

    #[test]
    fn a_clock_that_stands_still_is_doubtful_from_where_it_stopped() {
        let mut stamps = running(1.0, 1e4, 60.0, |_| 0.0);
        stamps.iter_mut().skip(3000).for_each(|(stamp, _)| *stamp = 30e6);
        let (_, told) = times(clock(1.0), &stamps);
        assert_eq!((told.drifts, told.anew + told.back + told.jumps), (1, 0));
        let after = told.after.unwrap();
        assert!((30_000_000 - 200_000..=30_000_000).contains(&after), "{after}");
    }

    #[test]
    fn seconds_with_a_fraction_have_no_turns_and_a_small_step_back_stays() {
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let (t, counted) =
            times(clock(1e6), &[(1.5, at(0)), (1.75, at(250)), (1.625, at(260)), (3601.5, at(3_600_000))]);
        assert_eq!(t, [1_500_000, 1_750_000, 1_625_000, 3_601_500_000]);
        // What came before the step back, after that time, cannot be told from what came after it.
        assert_eq!(counted, Counted { back: 1, after: Some(1_624_999), ..Counted::default() });
    }
}

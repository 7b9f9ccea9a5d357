//! Sources that are not boards: lines of numbers, for example from an IMU, with or without time stamps of their own.

mod clock;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use taxel_core::problem;

use super::causes::{Cause, Counts};
use super::limits;
use super::verdict::Found;
use clock::StreamClock;

/// The columns of a source's lines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StreamColumns {
    /// The names of all columns.
    pub columns: Vec<String>,
    /// The column of the source's own clock; without one, a line's time is its arrival time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Unit of that clock, us.
    #[serde(default = "default_unit")]
    pub unit_us: f64,
    /// Whether the lines waited in a file until they were read, so that their arrival is no clock to compare with.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub waited: bool,
}

fn default_unit() -> f64 {
    1.0
}

impl StreamColumns {
    /// The names of the columns of values, without the clock.
    pub fn values(&self) -> impl Iterator<Item = &String> {
        self.columns.iter().filter(|name| Some(*name) != self.time.as_ref())
    }

    /// Checks names and units.
    pub(super) fn check(&self, name: &str) -> taxel_core::Result<()> {
        let refused = |message: String| Err(problem!("source {name}: {message}"));
        if self.columns.len() > limits::COLUMNS {
            return refused(format!("{} columns; must be at most {}", self.columns.len(), limits::COLUMNS));
        }
        for (k, column) in self.columns.iter().enumerate() {
            if column.is_empty() || column.contains(',') {
                return refused(format!("column {column:?}: a name must not be empty, and must not contain a comma"));
            }
            if self.columns[..k].contains(column) {
                return refused(format!("column {column:?}: two columns have this name"));
            }
        }
        if let Some(time) = self.time.as_ref().filter(|time| !self.columns.contains(time)) {
            return refused(format!("time is {time:?}: must be one of the columns {}", self.columns.join(", ")));
        }
        if self.values().next().is_none() {
            return refused("contains no column of values".to_owned());
        }
        if !(self.unit_us.is_finite() && self.unit_us > 0.0) {
            return refused(format!("unit of {} us: must be above 0", self.unit_us));
        }
        Ok(())
    }

    /// Whether the number of values equals that of columns.
    #[must_use]
    pub fn fits(&self, values: &[f64]) -> bool {
        values.len() == self.columns.len()
    }

    /// A line in the form in which it is recorded.
    #[must_use]
    pub(super) fn message(&self, values: &[f64]) -> Value {
        let named: Map<String, Value> =
            self.columns.iter().zip(values).map(|(name, &value)| (name.clone(), Value::from(value))).collect();
        serde_json::json!({ "values": named })
    }
}

/// Whether a number is a value that frames hold, which have 32 bits, or NaN, a missing one; infinity is none.
pub(crate) fn is_held(value: f64) -> bool {
    value.is_nan() || value.abs() <= f64::from(f32::MAX)
}

/// The samples of a stream, as they arrived.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Arrival time of each sample, ns since 1970.
    pub arrived_ns: Vec<i64>,
    /// Arrival number of each sample.
    pub number: Vec<u64>,
    /// Time by the source's own clock, us, unwrapped over turns of a 32-bit counter and continued over restarts;
    /// without a clock the arrival time.
    pub t: Vec<i64>,
    /// The values without the clock column, line by line.
    pub values: Vec<f64>,
    /// What could not be read, and what is wrong with the stamps, as a verdict states it.
    pub found: Found,
}

/// Decodes a stream's messages.
#[derive(Debug)]
pub(super) struct Sampling<'a> {
    stream: &'a StreamColumns,
    samples: Samples,
    faults: StreamFaults,
}

impl<'a> Sampling<'a> {
    pub(super) fn new(stream: &'a StreamColumns) -> Self {
        Self { stream, samples: Samples::default(), faults: StreamFaults::new(stream) }
    }

    pub(super) fn push(&mut self, at_ns: i64, number: u64, data: &[u8]) {
        let Some((t, values)) = self.parse(at_ns, data) else {
            self.faults.found.counts[Cause::Strange] += 1;
            return;
        };
        self.samples.arrived_ns.push(at_ns);
        self.samples.number.push(number);
        self.samples.t.push(t);
        self.samples.values.extend(values);
    }

    /// Bytes of all samples so far.
    pub(super) fn size(&self) -> usize {
        8 * self.samples.values.len() + 24 * self.samples.t.len()
    }

    /// The time and the values of a message; a value that JSON cannot represent becomes NaN.
    fn parse(&mut self, at_ns: i64, data: &[u8]) -> Option<(i64, Vec<f64>)> {
        let message: Value = serde_json::from_slice(data).ok()?;
        let named = message.get("values")?.as_object()?;
        let values = self.stream.values().map(|name| Some(named.get(name)?.as_f64().unwrap_or(f64::NAN)));
        let values = values.collect::<Option<Vec<f64>>>().filter(|values| values.iter().copied().all(is_held))?;
        let stamp = match &self.stream.time {
            None => None,
            Some(time) => Some(named.get(time)?.as_f64()?),
        };
        let t = self.faults.time(stamp, at_ns)?;
        self.faults.missing(values.iter().copied());
        Some((t, values))
    }

    pub(super) fn finish(self) -> Samples {
        Samples { found: self.faults.found, ..self.samples }
    }
}

/// Counts what could not be read of a stream, and what is wrong with its stamps: while it is recorded as in its file.
#[derive(Debug, Clone)]
pub struct StreamFaults {
    /// What was found so far, as a verdict states it.
    pub found: Found,
    clock: StreamClock,
}

impl StreamFaults {
    /// None so far.
    #[must_use]
    pub fn new(stream: &StreamColumns) -> Self {
        Self::by_clock(stream.unit_us, stream.waited)
    }

    /// None so far, of lines with stamps in this unit, us, that may have `waited` in a file.
    #[must_use]
    pub fn by_clock(unit_us: f64, waited: bool) -> Self {
        Self { found: Found::default(), clock: StreamClock::new(unit_us, waited) }
    }

    /// Adds what a reader of lines counts.
    pub fn add(&mut self, counts: &Counts) {
        self.found.counts.extend(counts.iter());
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

    /// Counts a line of values, with the clock's stamp among them.
    pub fn line(&mut self, stream: &StreamColumns, values: &[f64], at_ns: i64) {
        let clock = stream.columns.iter().position(|name| Some(name) == stream.time.as_ref());
        match self.time(clock.map(|column| values[column]), at_ns) {
            Some(_) => self.missing(values.iter().copied()),
            None => self.found.counts[Cause::Strange] += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng, rngs::StdRng};

    fn stream(columns: &[&str]) -> StreamColumns {
        let units = [("t_us", 1.0), ("t_ms", 1e3), ("t_s", 1e6)];
        let found = units.into_iter().find(|(name, _)| columns.contains(name));
        StreamColumns {
            columns: columns.iter().map(ToString::to_string).collect(),
            time: found.map(|(name, _)| name.to_owned()),
            unit_us: found.map_or(1.0, |(_, unit_us)| unit_us),
            waited: false,
        }
    }

    fn times(stream: &StreamColumns, stamps: &[(f64, i64)]) -> (Vec<i64>, Counted) {
        let mut sampling = Sampling::new(stream);
        for (k, &(stamp, at_ns)) in stamps.iter().enumerate() {
            let message = stream.message(&[stamp, k as f64]).to_string();
            sampling.push(at_ns, k as u64, message.as_bytes());
        }
        let samples = sampling.finish();
        let Found { counts, doubtful_after_us, .. } = samples.found;
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
        (samples.t, counted)
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
        let stream = stream(&["t_us", "a"]);
        let turn = 1_i64 << 32;
        let mut stamps = vec![];
        let mut truth = vec![];
        // 10 ms apart around the turn, then a pause of three hours (two and a half turns), with arrivals late by up to 20 ms.
        for k in 0..100_i64 {
            let t = turn - 500_000 + k * 10_000 + if k >= 80 { 10_800_000_000 } else { 0 };
            truth.push(t);
            stamps.push(((t % turn) as f64, 1_700_000_000_000_000_000 + t * 1000 + (k * 7919 % 20_000) * 1000));
        }
        assert_eq!(times(&stream, &stamps), (truth, Counted::default()));
    }

    #[test]
    fn a_clock_that_begins_anew_goes_on_by_arrival() {
        let stream = stream(&["t_ms", "a"]);
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let stamps = [(60_000.0, at(0)), (60_010.0, at(10)), (5.0, at(2_010)), (15.0, at(2_020))];
        let (t, counted) = times(&stream, &stamps);
        assert_eq!(t, [60_000_000, 60_010_000, 62_010_000, 62_020_000]);
        assert_eq!(counted, Counted { anew: 1, ..Counted::default() });
    }

    #[test]
    fn one_damaged_stamp_moves_no_other_and_is_no_restart() {
        let stream = stream(&["t_us", "a"]);
        let truth: Vec<i64> = (0..100).map(|k| 10_000_000 + k * 20_000).collect();
        for (index, wrong) in [(50, 18_000_000), (50, 1 << 31), (50, 3), (1, 90_000_000), (98, 0)] {
            let mut stamps: Vec<(f64, i64)> = truth.iter().map(|&t| (t as f64, t * 1000)).collect();
            stamps[index].0 = f64::from(wrong);
            let (mut t, counted) = times(&stream, &stamps);
            let before = truth[index - 1];
            assert_eq!(counted, Counted { jumps: 1, after: Some(before), ..Counted::default() }, "{wrong} at {index}");
            t[index] = truth[index];
            assert_eq!(t, truth, "{wrong} at {index}");
        }
    }

    #[test]
    fn a_clock_that_stays_ahead_of_arrival_has_jumped_and_a_line_delayed_or_a_host_set_back_has_not() {
        let stream = stream(&["t_ms", "a"]);
        let stamps = |ahead: f64, late_ns: i64, host_ns: i64| -> Vec<_> {
            let late = |k: i64| if (50..80).contains(&k) { late_ns - (k - 50) * 20_000_000 } else { 0 };
            let at = |k: i64| 1_700_000_000_000_000_000 + k * 20_000_000 + late(k) + if k < 50 { 0 } else { host_ns };
            (0..100).map(|k| (20.0 * k as f64 + if k < 50 { 0.0 } else { ahead }, at(k))).collect()
        };
        let jumped = Counted { jumps: 1, after: Some(980_000), ..Counted::default() };
        assert_eq!(times(&stream, &stamps(1500.0, 0, 0)).1, jumped);
        assert_eq!(times(&stream, &stamps(0.0, 0, 0)).1, Counted::default());
        assert_eq!(times(&stream, &stamps(0.0, 600_000_000, 0)).1, Counted::default());
        assert_eq!(times(&stream, &stamps(0.0, 0, -60_000_000_000)).1, Counted::default());
    }

    /// The lines of a source every `period_us` for `seconds`, whose clock runs at a rate, with the delays of their arrival.
    fn running(rate: f64, period_us: f64, seconds: f64, delay_us: impl Fn(f64) -> f64) -> Vec<(f64, i64)> {
        let lines = (0..(seconds * 1e6 / period_us) as u32).map(|k| f64::from(k) * period_us);
        lines.map(|t| ((t * rate).floor(), 1_700_000_000_000_000_000 + ((t + delay_us(t)) * 1e3) as i64)).collect()
    }

    #[test]
    fn a_clock_at_another_rate_is_told_once_and_a_drift_packets_and_what_has_waited_are_not() {
        let stream = stream(&["t_us", "a"]);
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
            assert_eq!(times(&stream, &sound).1, Counted::default(), "seed {seed}");
            let rate = [0.0, 1e-3, 0.5, 0.9, 0.97, 1.03, 1.1, 1.9][draw.random_range(0..8)];
            let (_, told) = times(&stream, &running(rate, period_us, 600.0, delay));
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
        let stream = StreamColumns { waited: true, ..stream(&["t_us", "a"]) };
        for (rate, period_us) in [(1.0, 1e4), (300.0, 1e4), (0.1, 1e5), (1.0, 3e6)] {
            let mut stamps = running(rate, period_us, 200.0, |_| 0.0);
            assert_eq!(times(&stream, &stamps).1, Counted::default(), "rate {rate}");
            let (last, at_ns) = *stamps.last().unwrap();
            stamps.push((last - 1000.0, at_ns));
            assert_eq!(times(&stream, &stamps).1.back, 1, "rate {rate}");
        }
    }

    #[test]
    fn a_clock_that_stands_still_is_doubtful_from_where_it_stopped() {
        let stream = stream(&["t_us", "a"]);
        let mut stamps = running(1.0, 1e4, 60.0, |_| 0.0);
        stamps.iter_mut().skip(3000).for_each(|(stamp, _)| *stamp = 30e6);
        let (_, told) = times(&stream, &stamps);
        assert_eq!((told.drifts, told.anew + told.back + told.jumps), (1, 0));
        let after = told.after.unwrap();
        assert!((30_000_000 - 200_000..=30_000_000).contains(&after), "{after}");
    }

    #[test]
    fn a_stamp_that_is_no_time_counts_as_a_line_that_could_not_be_read() {
        let stream = stream(&["t_us", "a"]);
        let mut sampling = Sampling::new(&stream);
        let mut live = StreamFaults::new(&stream);
        for (k, stamp) in [1.0, f64::NAN, 1e300, 4_503_599_627_370_497.0, -5e15, 2.0].into_iter().enumerate() {
            sampling.push(k as i64, k as u64, stream.message(&[stamp, 1.0]).to_string().as_bytes());
            live.line(&stream, &[stamp, 1.0], k as i64);
        }
        let samples = sampling.finish();
        assert_eq!((&samples.t[..], samples.found.counts[Cause::Strange]), (&[1, 2][..], 4));
        assert_eq!(live.found, samples.found);
    }

    #[test]
    fn a_missing_value_is_counted_live_and_in_the_file_and_is_no_damage() {
        let stream = stream(&["t_us", "a", "b"]);
        let (mut sampling, mut live) = (Sampling::new(&stream), StreamFaults::new(&stream));
        let nan = f64::NAN;
        let lines = [[1.0, nan, 2.0], [2.0, 3.0, 4.0], [3.0, nan, nan], [nan, nan, 1.0]];
        for (k, values) in lines.into_iter().enumerate() {
            sampling.push(k as i64 * 1000, k as u64, stream.message(&values).to_string().as_bytes());
            live.line(&stream, &values, k as i64 * 1000);
        }
        let samples = sampling.finish();
        assert_eq!(samples.values.iter().filter(|value| value.is_nan()).count(), 3);
        assert_eq!((samples.found.counts[Cause::Missing], samples.found.counts[Cause::Strange]), (3, 1));
        assert_eq!(live.found, samples.found);
    }

    #[test]
    fn a_value_of_a_file_that_no_frame_holds_makes_its_line_strange() {
        let stream = stream(&["a"]);
        let mut sampling = Sampling::new(&stream);
        for (k, data) in [r#"{"values":{"a":1e39}}"#, r#"{"values":{"a":-1e300}}"#].into_iter().enumerate() {
            sampling.push(k as i64, k as u64, data.as_bytes());
        }
        let samples = sampling.finish();
        assert_eq!((samples.values.len(), samples.found.counts[Cause::Strange]), (0, 2));
    }

    #[test]
    fn seconds_with_a_fraction_have_no_turns_and_a_small_step_back_stays() {
        let stream = stream(&["t_s", "a"]);
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let (t, counted) = times(&stream, &[(1.5, at(0)), (1.75, at(250)), (1.625, at(260)), (3601.5, at(3_600_000))]);
        assert_eq!(t, [1_500_000, 1_750_000, 1_625_000, 3_601_500_000]);
        // What came before the step back, after that time, cannot be told from what came after it.
        assert_eq!(counted, Counted { back: 1, after: Some(1_624_999), ..Counted::default() });
    }

    #[test]
    fn nonsense_is_refused() {
        let good = stream(&["t_us", "ax"]);
        assert!(good.check("imu").is_ok());
        for bad in [
            stream(&[]),
            stream(&["t_us"]),
            stream(&["a", "a"]),
            stream(&["a", ""]),
            StreamColumns { time: Some("b".to_owned()), ..good.clone() },
            StreamColumns { unit_us: 0.0, ..good.clone() },
            StreamColumns { unit_us: f64::NAN, ..good.clone() },
        ] {
            assert!(bad.check("imu").is_err(), "{bad:?}");
        }
    }
}

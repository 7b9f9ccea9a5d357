//! Sources that are not boards: lines of numbers, for example from an IMU, with or without time stamps of their own.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use taxel_core::problem;

use super::limits;

/// Range of a counter: whole numbers are assumed to have 32 bits.
const TURN: f64 = 4_294_967_296.0;

/// A clock that steps back by more than this has restarted, us.
const STEP_BACK_US: f64 = 1e6;

/// The columns of a source's lines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stream {
    /// The names of all columns.
    pub columns: Vec<String>,
    /// The column of the source's own clock; without one a line's time is its arrival time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Unit of that clock, us.
    #[serde(default = "one")]
    pub unit_us: f64,
}

fn one() -> f64 {
    1.0
}

impl Stream {
    /// Defines the columns by name. A name `t`, `time`, `stamp` or `timestamp` with the ending `_ns`, `_us`, `_ms` or
    /// `_s` is the clock.
    #[must_use]
    pub fn of_columns(columns: Vec<String>) -> Self {
        let unit = |name: &str| {
            let (what, unit) = name.rsplit_once('_')?;
            let unit_us = [("ns", 1e-3), ("us", 1.0), ("ms", 1e3), ("s", 1e6)].into_iter().find(|(u, _)| *u == unit)?.1;
            ["t", "time", "stamp", "timestamp"].contains(&what).then_some(unit_us)
        };
        let time = columns.iter().find_map(|name| Some((name.clone(), unit(name)?)));
        let (time, unit_us) = time.map_or((None, 1.0), |(name, unit_us)| (Some(name), unit_us));
        Self { columns, time, unit_us }
    }

    /// The names of the columns of values, without the clock.
    pub fn values(&self) -> impl Iterator<Item = &String> {
        self.columns.iter().filter(|name| Some(*name) != self.time.as_ref())
    }

    /// Checks names and units.
    pub(super) fn check(&self, name: &str) -> taxel_core::Result<()> {
        let refused = |what: String| Err(problem!("source {name}: {what}"));
        if self.columns.len() > limits::COLUMNS {
            return refused(format!("{} columns; at most {}", self.columns.len(), limits::COLUMNS));
        }
        for (k, column) in self.columns.iter().enumerate() {
            if column.is_empty() || column.contains(',') {
                return refused(format!("column {column:?}: a name is not empty, and holds no comma"));
            }
            if self.columns[..k].contains(column) {
                return refused(format!("column {column:?}: there are two of that name"));
            }
        }
        if let Some(time) = self.time.as_ref().filter(|time| !self.columns.contains(time)) {
            return refused(format!("time is {time:?}: must be one of the columns {}", self.columns.join(", ")));
        }
        if self.values().next().is_none() {
            return refused("holds no column of values".to_owned());
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

    /// Parses a line of numbers separated by commas, semicolons, tabs or blanks; `None` if a field is not a number, or
    /// if the number of fields differs from that of columns.
    #[must_use]
    pub fn parse(&self, line: &str) -> Option<Vec<f64>> {
        let values = fields(line).map(|field| field.parse().ok()).collect::<Option<Vec<f64>>>()?;
        self.fits(&values).then_some(values)
    }

    /// A line in the form in which it is recorded.
    #[must_use]
    pub(super) fn message(&self, values: &[f64]) -> Value {
        let named: Map<String, Value> =
            self.columns.iter().zip(values).map(|(name, &value)| (name.clone(), Value::from(value))).collect();
        serde_json::json!({ "values": named })
    }
}

/// The fields of a line of text.
pub fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split([',', ';', '\t', ' ']).filter(|field| !field.is_empty())
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
    /// Number of lines that could not be parsed.
    pub bad: u64,
    /// Number of restarts of the clock.
    pub resets: u64,
}

/// Decodes a stream's messages.
#[derive(Debug)]
pub(super) struct Sampling<'a> {
    stream: &'a Stream,
    samples: Samples,
    /// Whether all stamps so far are whole numbers, so that they may be those of a counter.
    whole: bool,
    /// Added to stamps, us.
    added: f64,
    /// The last time, with this addition, us, and its arrival time, ns.
    last: Option<(f64, i64)>,
}

impl<'a> Sampling<'a> {
    pub(super) fn new(stream: &'a Stream) -> Self {
        Self { stream, samples: Samples::default(), whole: true, added: 0.0, last: None }
    }

    pub(super) fn push(&mut self, at_ns: i64, number: u64, data: &[u8]) {
        let Some((stamp, values)) = self.parse(data) else {
            self.samples.bad += 1;
            return;
        };
        let t = match stamp {
            None => at_ns.div_euclid(1000),
            Some(stamp) => self.unwrapped(stamp, at_ns),
        };
        self.samples.arrived_ns.push(at_ns);
        self.samples.number.push(number);
        self.samples.t.push(t);
        self.samples.values.extend(values);
    }

    /// The stamp and the values of a message; a value that JSON cannot represent becomes NaN.
    fn parse(&self, data: &[u8]) -> Option<(Option<f64>, Vec<f64>)> {
        let message: Value = serde_json::from_slice(data).ok()?;
        let named = message.get("values")?.as_object()?;
        let values = self.stream.values().map(|name| Some(named.get(name)?.as_f64().unwrap_or(f64::NAN)));
        let stamp = match &self.stream.time {
            None => None,
            Some(time) => Some(named.get(time)?.as_f64()?),
        };
        Some((stamp, values.collect::<Option<_>>()?))
    }

    /// Converts a stamp to a time, us.
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
    fn unwrapped(&mut self, stamp: f64, at_ns: i64) -> i64 {
        self.whole &= stamp.fract() == 0.0 && (0.0..TURN).contains(&stamp);
        let own = stamp * self.stream.unit_us;
        if let Some((last, last_ns)) = self.last {
            let passed = (at_ns - last_ns) as f64 * 1e-3;
            let lacks = passed - (own + self.added - last);
            let turn = TURN * self.stream.unit_us;
            let turns = (lacks / turn).round();
            // Arrival times determine the elapsed time within a second, or within a hundredth of a pause if that is
            // longer.
            let near = STEP_BACK_US.max(passed.abs() * 1e-2);
            if self.whole && turns >= 1.0 && (lacks - turns * turn).abs() <= near {
                self.added += turns * turn;
            } else if own + self.added < last - STEP_BACK_US && lacks > near {
                self.added += lacks;
                self.samples.resets += 1;
            }
        }
        let t = own + self.added;
        self.last = Some((t, at_ns));
        t.round() as i64
    }

    pub(super) fn finish(self) -> Samples {
        self.samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(columns: &[&str]) -> Stream {
        Stream::of_columns(columns.iter().map(ToString::to_string).collect())
    }

    fn times(stream: &Stream, stamps: &[(f64, i64)]) -> (Vec<i64>, u64) {
        let mut sampling = Sampling::new(stream);
        for (k, &(stamp, at_ns)) in stamps.iter().enumerate() {
            let message = stream.message(&[stamp, k as f64]).to_string();
            sampling.push(at_ns, k as u64, message.as_bytes());
        }
        let samples = sampling.finish();
        assert_eq!(samples.bad, 0);
        (samples.t, samples.resets)
    }

    #[test]
    fn the_clock_is_found_by_its_name() {
        for (name, unit_us) in [("t_us", 1.0), ("time_ms", 1e3), ("stamp_s", 1e6), ("timestamp_ns", 1e-3)] {
            let stream = stream(&["ax", name, "ay"]);
            assert_eq!((stream.time.as_deref(), stream.unit_us), (Some(name), unit_us));
            assert_eq!(stream.values().collect::<Vec<_>>(), ["ax", "ay"]);
        }
        assert_eq!(stream(&["ax", "speed_ms"]).time, None);
    }

    #[test]
    fn lines_are_read_with_any_separator_and_refused_where_they_are_no_numbers() {
        let stream = stream(&["t_us", "ax", "ay"]);
        for line in ["1,2.5,-3e2", "1; 2.5; -3e2", "1\t2.5\t-300", " 1 2.5  -300 "] {
            assert_eq!(stream.parse(line), Some(vec![1.0, 2.5, -300.0]), "{line:?}");
        }
        for line in ["", "1,2", "1,2,3,4", "1,2,x", "t_us,ax,ay"] {
            assert_eq!(stream.parse(line), None, "{line:?}");
        }
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
        assert_eq!(times(&stream, &stamps), (truth, 0));
    }

    #[test]
    fn a_clock_that_begins_anew_goes_on_by_arrival() {
        let stream = stream(&["t_ms", "a"]);
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let stamps = [(60_000.0, at(0)), (60_010.0, at(10)), (5.0, at(2_010)), (15.0, at(2_020))];
        let (t, resets) = times(&stream, &stamps);
        assert_eq!(t, [60_000_000, 60_010_000, 62_010_000, 62_020_000]);
        assert_eq!(resets, 1);
    }

    #[test]
    fn seconds_with_a_fraction_have_no_turns_and_a_small_step_back_stays() {
        let stream = stream(&["t_s", "a"]);
        let at = |ms: i64| 1_700_000_000_000_000_000 + ms * 1_000_000;
        let (t, resets) = times(&stream, &[(1.5, at(0)), (1.75, at(250)), (1.625, at(260)), (3601.5, at(3_600_000))]);
        assert_eq!(t, [1_500_000, 1_750_000, 1_625_000, 3_601_500_000]);
        assert_eq!(resets, 0);
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
            Stream { time: Some("b".to_owned()), ..good.clone() },
            Stream { unit_us: 0.0, ..good.clone() },
            Stream { unit_us: f64::NAN, ..good.clone() },
        ] {
            assert!(bad.check("imu").is_err(), "{bad:?}");
        }
    }
}

//! Trained neurons with names, and the encoder that they were trained behind.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::allowed::above_0;
use crate::detect::{Detection, FrameClock, FrameTime, ReadoutStream, TrainedNeuron};
use crate::encode::{Encoder, Tare, Zeroing};
use crate::neuron::{AfterSpike, Time};
use crate::spikes::us;
use crate::{Array, Error, EventsView, FramesView, Result, Stop, problem, reading};

/// What a readout's file says that it is.
const FORMAT: &str = "taxel readout";

/// The version of that file which is written, and the only one so far.
const VERSION: u64 = 1;

/// How long time moves on after the last event or picture of a recording, us: longer than what was heard can keep a
/// potential rising (the slowest neuron of Table 6.2 peaks after 190 ms).
const SILENCE_US: i64 = 1_000_000;

/// Trained neurons with names, the encoder that they were trained behind, and how they were trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Readout {
    /// With its parameters. A tare belongs to a board and a day: where the encoder needs one it can be given later.
    pub encoder: Encoder,
    /// The sensor; `None` where any will do whose number of trains fits.
    #[serde(default)]
    pub array: Option<Array>,
    /// Grid or continuous, as the neurons were trained; neurons of another time are refused.
    pub time: Time,
    /// What remained after a spike, as the neurons were trained; others are refused.
    pub after_spike: AfterSpike,
    /// A factor on every threshold after training: below 1 the neurons fire on less.
    ///
    /// Reading: the thesis has none. 6.3.2 objects that a threshold below the trained one is crossed earlier than
    /// intended; that price is paid for inputs a little weaker than the weakest trained one, which only just touches it.
    #[serde(default = "one")]
    pub run_threshold: f64,
    /// Each train of the encoder is heard once at each of these delays, ms, ascending: first all trains at the first
    /// delay, then all at the second (`SpikeTrains.delayed`). One delay of 0 where left out.
    #[serde(default = "at_once", skip_serializing_if = "is_at_once")]
    pub delays_ms: Vec<f64>,
    /// By label.
    pub neurons: BTreeMap<String, TrainedNeuron>,
}

fn one() -> f64 {
    1.0
}

fn at_once() -> Vec<f64> {
    vec![0.0]
}

fn is_at_once(delays_ms: &[f64]) -> bool {
    delays_ms == [0.0]
}

/// The longest delay that is taken, ms.
const LONGEST_DELAY_MS: f64 = 60_000.0;

impl Readout {
    /// Checks that parts make sense and belong together.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        self.encoder.check()?;
        above_0("run_threshold", self.run_threshold, "")?;
        self.check_delays()?;
        if self.neurons.is_empty() {
            return Err(problem!("readout without a neuron: needs one or more"));
        }
        for (label, one) in &self.neurons {
            if label.trim().is_empty() {
                return Err(problem!("a neuron without a name: must have a label"));
            }
            one.neuron.check().map_err(|e| at(label, e))?;
            if one.neuron.time != self.time {
                let (its, mine) = (word(&one.neuron.time), word(&self.time));
                return Err(problem!("{label}: trained for time {its}, this readout is for time {mine}"));
            }
            if one.neuron.after_spike != self.after_spike {
                let (its, mine) = (word(&one.neuron.after_spike), word(&self.after_spike));
                return Err(problem!("{label}: trained for after_spike {its}, this readout is for after_spike {mine}"));
            }
            if !(0.0..=LONGEST_DELAY_MS).contains(&one.delay_ms) {
                return Err(problem!(
                    "{label}: delay_ms is {}: must lie between 0 and {LONGEST_DELAY_MS}",
                    one.delay_ms
                ));
            }
            if let Some(n) = one.weights.iter().position(|w| !w.is_finite()) {
                return Err(problem!("{label}: weights[{n}] is {}: must be finite", one.weights[n]));
            }
            if let Some(array) = &self.array {
                self.check_weights(label, one, array)?;
            }
        }
        Ok(())
    }

    fn check_delays(&self) -> Result<()> {
        if self.delays_ms.is_empty() {
            return Err(problem!("delays_ms is empty: must hold one delay or more"));
        }
        for (k, &delay) in self.delays_ms.iter().enumerate() {
            if !(0.0..=LONGEST_DELAY_MS).contains(&delay) {
                return Err(problem!("delays_ms[{k}] is {delay}: must lie between 0 and {LONGEST_DELAY_MS}"));
            }
            if k > 0 && delay <= self.delays_ms[k - 1] {
                return Err(problem!("delays_ms[{k}] is {delay}, after {}: must ascend", self.delays_ms[k - 1]));
            }
        }
        Ok(())
    }

    fn check_weights(&self, label: &str, one: &TrainedNeuron, array: &Array) -> Result<()> {
        let copies = self.delays_ms.len();
        let inputs = self.encoder.trains(array) * if self.encoder.signed() { 2 } else { 1 } * copies;
        if one.weights.len() == inputs {
            return Ok(());
        }
        let (rows, columns, signed) = (array.rows, array.columns, self.encoder.signed());
        Err(problem!(
            "{label}: {} weights, the encoder speaks on {inputs} trains{}{} for {rows} x {columns} taxels: must be one each",
            one.weights.len(),
            if signed { ", ON and OFF," } else { "" },
            if copies > 1 { format!(" at {copies} delays") } else { String::new() }
        ))
    }

    /// Reads a readout from the text of its file and checks it.
    ///
    /// # Errors
    ///
    /// `Format` where the text is no readout, one of a version that is not known, or holds parts that make no sense.
    pub fn from_json(text: &str) -> Result<Self> {
        let format = |said: String| Error::Format(said);
        let mut value: Value = reading::from_text(text).map_err(|unfit| format(unfit.of("readout")))?;
        let Some(object) = value.as_object_mut() else {
            return Err(format("readout: not a JSON object".to_owned()));
        };
        match object.remove("format") {
            Some(Value::String(name)) if name == FORMAT => {}
            Some(other) => return Err(format(format!("readout: format is {other}, must be \"{FORMAT}\""))),
            None => return Err(format(format!("readout: does not say \"format\": \"{FORMAT}\", so it is none"))),
        }
        match object.remove("version") {
            Some(version) if version.as_u64() == Some(VERSION) => {}
            Some(version) => {
                return Err(format(format!("readout: version {version}, this taxel reads version {VERSION} only")));
            }
            None => return Err(format(format!("readout: says no version, must be {VERSION}"))),
        }
        // An encoder that is read as a part of another loses the names of its parameters.
        if let Some(encoder) = object.get("encoder") {
            Encoder::from_json(&encoder.to_string()).map_err(|e| format(format!("readout: {e}")))?;
        }
        let readout: Self = reading::from_value(value).map_err(|unfit| format(unfit.of("readout")))?;
        readout.check().map_err(|e| format(format!("readout: {e}")))?;
        Ok(readout)
    }

    /// The readout as the text of its file: every number comes back as it was.
    #[must_use]
    pub fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct File<'a> {
            format: &'a str,
            version: u64,
            #[serde(flatten)]
            readout: &'a Readout,
        }
        // Numbers were checked to be finite, and nothing else in here can fail to be written.
        serde_json::to_string_pretty(&File { format: FORMAT, version: VERSION, readout: self }).unwrap_or_default()
    }

    /// Starts to listen to an array with such frames.
    ///
    /// # Errors
    ///
    /// `Problem` where the array is not the one that the readout was trained on, a tare is needed and not there, or the
    /// period makes no sense.
    pub fn stream(&self, array: &Array, frames: impl Into<FrameTime>, tare: Option<&Tare>) -> Result<ReadoutStream> {
        self.check()?;
        if let Some(mine) = &self.array
            && (mine.rows, mine.columns, &mine.exists) != (array.rows, array.columns, &array.exists)
        {
            return Err(problem!(
                "array {} of {} x {} taxels: the readout was trained on {}, {} x {}{}",
                array.name,
                array.rows,
                array.columns,
                mine.name,
                mine.rows,
                mine.columns,
                if mine.exists == array.exists { "" } else { ", of which others exist" }
            ));
        }
        for (label, one) in &self.neurons {
            self.check_weights(label, one, array)?;
        }
        let encoder = tare.map_or_else(|| self.encoder.clone(), |tare| self.encoder.with_tare(tare));
        let neurons = self.neurons.iter().map(|(label, one)| (label.clone(), one.clone()));
        let (encoder, clock) = (encoder.stream(array)?, FrameClock::new(frames)?);
        let delays_ms = self.delays_ms.clone();
        Ok(ReadoutStream::new(encoder, array.clone(), clock, self.run_threshold, delays_ms, neurons))
    }

    /// How long is listened on after the end of a recording, us.
    fn silence_us(&self) -> i64 {
        SILENCE_US + us(self.delays_ms.last().copied().unwrap_or(0.0)).ceil() as i64
    }

    /// What is said of a whole recording of events in which a person zeroed some taxels, and of a second of silence after it.
    ///
    /// # Errors
    ///
    /// As [`Readout::stream`], [`ReadoutStream::zero`], [`ReadoutStream::push_events`] and [`EventsView::check_order`];
    /// `Interrupted` where asked to stop.
    pub fn run_events(
        &self,
        events: EventsView<'_>,
        frames: impl Into<FrameTime>,
        tare: Option<&Tare>,
        zeroings: &[Zeroing],
        stop: Stop<'_>,
    ) -> Result<Vec<Detection>> {
        let last = events.t.iter().copied().chain(events.markers.iter().map(|m| m.t)).max().unwrap_or(0);
        let mut stream = self.stream(events.array, frames, tare)?;
        zeroings.iter().try_for_each(|zeroing| stream.zero(zeroing))?;
        events.check_order()?;
        let mut found = stream.push_recording(events, stop)?;
        stream.advance(last.saturating_add(self.silence_us()), &mut found)?;
        Ok(found)
    }

    /// What is said of a whole recording of pictures, and of a second after them in which the last one stays. Frames last
    /// `frame_us`, or as long as pictures mostly lie apart.
    ///
    /// # Errors
    ///
    /// As [`Readout::stream`] and [`ReadoutStream::push_frames`]; `Interrupted` where asked to stop.
    pub fn run_frames(
        &self,
        frames: FramesView<'_>,
        frame_us: Option<f64>,
        tare: Option<&Tare>,
        stop: Stop<'_>,
    ) -> Result<Vec<Detection>> {
        let frame_us = match frame_us {
            Some(given) => given,
            None => usual_distance(frames.t)?,
        };
        let last = frames.t.last().copied().unwrap_or(0);
        let mut stream = self.stream(frames.array, frame_us, tare)?;
        let mut found = stream.push_frames(frames, stop)?;
        stream.advance(last.saturating_add(self.silence_us()), &mut found)?;
        Ok(found)
    }
}

/// The median distance of pictures, us.
fn usual_distance(t: &[i64]) -> Result<f64> {
    let mut apart: Vec<u64> = t.windows(2).map(|w| w[1].abs_diff(w[0])).collect();
    if apart.is_empty() {
        return Err(problem!("{} picture(s) do not say how long a frame lasts: give frame_us", t.len()));
    }
    let middle = apart.len() / 2;
    Ok(*apart.select_nth_unstable(middle).1 as f64)
}

fn at(label: &str, error: Error) -> Error {
    if let Error::Problem(text) = error { problem!("{label}: {text}") } else { error }
}

/// An option's word, as it stands in JSON.
fn word(option: &impl Serialize) -> String {
    serde_json::to_string(option).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::encode::ContactArea;
    use crate::neuron::Neuron;
    use crate::{Events, Intensities};

    fn readout() -> Readout {
        let neuron = Neuron { tau: 0.5, time: Time::Grid, step_ms: 0.192, ..Neuron::default() };
        let one = |delay_ms, first: f64| TrainedNeuron {
            neuron: neuron.clone(),
            delay_ms,
            weights: (0..10).map(|k| first / f64::from(k + 3)).collect(),
        };
        Readout {
            encoder: Encoder::ContactArea(ContactArea::default()),
            array: Some(Array::thesis()),
            time: Time::Grid,
            after_spike: AfterSpike::Keep,
            run_threshold: 0.9,
            delays_ms: vec![0.0],
            neurons: [("contact".to_owned(), one(0.2, 3.0)), ("lift".to_owned(), one(0.5, -0.1))].into(),
        }
    }

    #[test]
    fn a_file_gives_every_number_back() {
        let mut readout = readout();
        let weights = &mut readout.neurons.get_mut("lift").unwrap().weights;
        // Numbers that a careless reader of decimals gets wrong by the last bit.
        weights[..6].copy_from_slice(&[
            0.1 + 0.2,
            1.0 / 3.0,
            5e-324,
            -2.2250738585072014e-308,
            1.7976931348623157e308,
            1e23,
        ]);
        let again = Readout::from_json(&readout.to_json()).unwrap();
        assert_eq!(again, readout);
        for (a, b) in again.neurons["lift"].weights.iter().zip(&readout.neurons["lift"].weights) {
            assert_eq!(a.to_bits(), b.to_bits());
        }
        assert!(readout.to_json().starts_with("{\n  \"format\": \"taxel readout\",\n  \"version\": 1,"));
    }

    #[test]
    fn files_that_are_no_readout_are_refused_by_name() {
        let good = readout().to_json();
        let cases = [
            ("", "readout: not JSON"),
            ("[]", "readout: not a JSON object"),
            ("{}", "readout: does not say \"format\": \"taxel readout\", so it is none"),
            (&good.replace("taxel readout", "other"), "readout: format is \"other\", must be \"taxel readout\""),
            (&good.replace("\"version\": 1,", ""), "readout: says no version, must be 1"),
            (
                &good.replace("\"version\": 1,", "\"version\": 2,"),
                "readout: version 2, this taxel reads version 1 only",
            ),
            (&good.replace("\"run_threshold\"", "\"threshold\""), "readout: threshold is not known: there is"),
            (
                &good.replace("\"neurons\"", "\"neuron\""),
                "readout: neuron is not known (did you mean neurons?): there is",
            ),
            (&good.replace("contact_area", "contact_are"), "readout: encoder contact_are: must be one of"),
            (&good.replace("\"noise_floor\": 3.0", "\"noise_floor\": -3.0"), "readout: noise_floor is -3"),
            (&good.replace("\"run_threshold\": 0.9", "\"run_threshold\": 0"), "readout: run_threshold is 0"),
            (&good.replacen("\"time\": \"grid\"", "\"time\": \"continuous\"", 1), "trained for time \"grid\""),
            (&good.replacen("\"after_spike\": \"keep\"", "\"after_spike\": \"reset\"", 1), "trained for after_spike"),
            (&good.replacen("\"delay_ms\": 0.2", "\"delay_ms\": -0.2", 1), "contact: delay_ms is -0.2"),
            (&good.replacen("\"tau\": 0.5", "\"tau\": 0", 1), "contact: tau is 0"),
            (&good.replacen("1.0,", "", 1), "contact: 9 weights, the encoder speaks on 10 trains for 64 x 64"),
        ];
        for (text, said) in cases {
            let error = Readout::from_json(text).unwrap_err();
            assert!(matches!(error, Error::Format(_)), "{said}");
            assert!(error.to_string().contains(said), "{error}, not {said}");
            assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn a_readout_refuses_neurons_that_were_trained_otherwise() {
        let mut other = readout();
        other.neurons.get_mut("lift").unwrap().neuron.after_spike = AfterSpike::Reset;
        let said = other.check().unwrap_err().to_string();
        assert_eq!(said, "lift: trained for after_spike \"reset\", this readout is for after_spike \"keep\"");
        let mut other = readout();
        other.neurons.get_mut("lift").unwrap().neuron.time = Time::Continuous;
        assert!(other.check().unwrap_err().to_string().starts_with("lift: trained for time \"continuous\""));
        let mut other = readout();
        other.neurons.clear();
        assert!(other.check().is_err());
    }

    #[test]
    fn another_array_and_a_missing_tare_are_refused() {
        let array = Array::new(63, 64, 2.67, "other").unwrap();
        let said = readout().stream(&array, 192.0, None).err().unwrap().to_string();
        assert!(said.starts_with("array other of 63 x 64 taxels: the readout was trained on thesis"), "{said}");
        let said = readout().stream(&Array::thesis(), 192.0, None).err().unwrap().to_string();
        assert!(said.contains("tare"), "{said}");
        // Without an array of its own a readout listens to any whose trains are as many.
        let tare =
            Tare { array: array.clone(), rest: vec![Some(0.0); 63 * 64], start_us: 0, stop_us: 1, note: String::new() };
        assert!(Readout { array: None, ..readout() }.stream(&array, 192.0, Some(&tare)).is_ok());
    }

    /// Presses on 6 x 6 taxels, at stamps of the wire, some of which are full of them.
    fn presses(random: &mut StdRng, array: &Array) -> Events {
        let (mut t, mut events, mut intensity) = (0, Events::empty(array.clone()), Intensities::default());
        for _ in 0..600 {
            t += [0, 0, 100, 100, 700, 40_000][random.random_range(0..6)];
            events.t.push(t);
            events.x.push(random.random_range(0..6));
            events.y.push(random.random_range(0..6));
            events.p.push(true);
            intensity.ticks.push(random.random_range(130..170));
            intensity.present.push(random.random_range(0..10) > 0);
        }
        Events { intensity: Some(intensity), ..events }
    }

    /// The same events as if, after `z.t`, the taxel's values were lower by `rise`, and it said so then.
    fn lowered(mut events: Events, z: &Zeroing, rise: u16) -> Events {
        let at = events.t.partition_point(|&t| t <= z.t);
        let mut intensity = events.intensity.take().unwrap();
        let its = |k: &usize| (events.x[*k], events.y[*k]) == (z.x, z.y) && intensity.present[*k];
        let held = (0..at).rev().find(its).map(|k| intensity.ticks[k]);
        for k in (at..events.len()).filter(its).collect::<Vec<_>>() {
            intensity.ticks[k] -= rise;
        }
        if let Some(held) = held {
            events.t.insert(at, z.t);
            events.x.insert(at, z.x);
            events.y.insert(at, z.y);
            events.p.insert(at, false);
            intensity.ticks.insert(at, held - rise);
            intensity.present.insert(at, true);
        }
        Events { intensity: Some(intensity), ..events }
    }

    #[test]
    fn a_zeroed_taxel_reads_as_one_whose_values_fell_by_what_its_rest_rose() {
        let array = Array::new(6, 6, 2.0, "small").unwrap();
        let rest = vec![Some(130.0); 36];
        let tare = Tare { array: array.clone(), rest, start_us: -1, stop_us: 0, note: String::new() };
        let (mut count, mut heard) = (0, 0);
        for (seed, name) in (0..40).zip(["contact_area", "moments"].into_iter().cycle()) {
            let mut random = StdRng::seed_from_u64(seed);
            let encoder = Encoder::from_json(&format!(r#"{{"name": "{name}"}}"#)).unwrap();
            let weights = (0..encoder.trains(&array)).map(|_| random.random_range(-0.2..1.0)).collect();
            let neuron = Neuron { tau: 0.5, refractory: 0.5, theta_0: 0.3, ..Neuron::default() };
            let one = TrainedNeuron { neuron: neuron.clone(), delay_ms: 0.0, weights };
            let neurons = [("touch".to_owned(), one)].into();
            let readout = Readout {
                encoder,
                array: None,
                time: neuron.time,
                after_spike: neuron.after_spike,
                neurons,
                ..readout()
            };
            let events = presses(&mut random, &array);
            let (mut zeroings, mut low): (Vec<Zeroing>, _) = (vec![], events.clone());
            while zeroings.len() < 4 {
                let (x, y) = (random.random_range(0..6), random.random_range(0..6));
                if zeroings.iter().all(|z| (z.x, z.y) != (x, y)) {
                    let (t, rise) = (
                        events.t[random.random_range(0..500)] + random.random_range(0..2) * 50,
                        random.random_range(1..30),
                    );
                    let z = Zeroing { t, x, y, rest: 130.0 + f64::from(rise), before: Some(130.0) };
                    low = lowered(low, &z, rise);
                    zeroings.push(z);
                }
            }
            let run = |events: &Events, zeroings: &[Zeroing]| {
                readout.run_events(events.view(), 192.0, Some(&tare), zeroings, Stop::never()).unwrap()
            };
            let said = run(&events, &zeroings);
            assert_eq!(said, run(&low, &[]), "seed {seed}, {name}");
            (count, heard) = (count + said.len(), heard + usize::from(said != run(&events, &[])));

            // Live: in pieces, time moved on between them, each zeroing told before anything that is later than it.
            let mut live = readout.stream(&array, 192.0, Some(&tare)).unwrap();
            let (mut pieces, mut from) = (vec![], 0);
            while from < events.len() {
                let to = (from + random.random_range(1..40)).min(events.len());
                let next = events.t.get(to).copied().unwrap_or(i64::MAX);
                let (now, later): (Vec<_>, Vec<_>) = zeroings.iter().partition(|z| z.t < next);
                now.iter().for_each(|z| live.zero(z).unwrap());
                zeroings = later;
                live.push_events(events.view().piece(from..to), &mut pieces).unwrap();
                live.advance(random.random_range(events.t[to - 1]..=next.min(events.t[to - 1] + 5000)), &mut pieces)
                    .unwrap();
                from = to;
            }
            live.advance(events.t[599] + SILENCE_US, &mut pieces).unwrap();
            assert_eq!(pieces, said, "seed {seed}, {name}");
        }
        assert!(count > 400, "something must be said to compare: {count}");
        assert!(heard > 20, "a zeroing changes what is said: {heard} of 40");
    }

    #[test]
    fn only_a_taxel_that_exists_is_zeroed() {
        let array = Array { exists: Some(vec![true, true, true, false]), ..Array::new(2, 2, 1.0, "three").unwrap() };
        let z = Zeroing { t: 0, x: 0, y: 0, rest: 1.0, before: None };
        assert!(z.check(&array).is_ok());
        for (wrong, said) in [
            (Zeroing { x: 1, y: 1, ..z }, "taxel at row 1, column 1: none there in 2 x 2"),
            (Zeroing { x: 2, ..z }, "taxel at row 0, column 2: none there in 2 x 2"),
            (Zeroing { rest: f64::NAN, ..z }, "taxel at row 0, column 0: a rest of NaN"),
        ] {
            assert_eq!(wrong.check(&array).unwrap_err().to_string(), said);
        }
    }
}

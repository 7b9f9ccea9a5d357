//! A readout: trained neurons with labels, and the encoder with which they were trained.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::allowed::{above_0, is_weight, weight_error};
use crate::detect::stream::{DelayedNeurons, NamedNeuron, ReceivedTrains, Way};
use crate::detect::{self, FrameClock, FrameTime, PlainRule, ReadoutStream, TrainedNeuron, TrainingData};
use crate::encode::{Composite, Encoder, Tare};
use crate::neuron::{AfterSpike, Time};
use crate::rest::Following;
use crate::spikes::us;
use crate::{Array, Hint, Result, SpikeKind, problem};

mod file;
#[cfg(test)]
mod tests;

/// Trained neurons with labels, the encoder with which they were trained, and the conditions of their training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Readout {
    /// The encoder with its parameters. A tare belongs to a board and a day: an encoder that needs one gets it when a
    /// stream starts.
    pub encoder: Encoder,
    /// The sensor; `None` admits every array with the right number of trains.
    pub array: Option<Array>,
    /// Whether it was trained on grids of several sizes: those smaller than `array` are padded at their far edges.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub pads: bool,
    /// The unit of the values on which it was trained, "ticks" of a board's; `None` if it is not known. It is compared
    /// where values have a unit: those of a stream have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Grid or continuous time, as in training; neurons with another setting are refused.
    pub time: Time,
    /// The effect of a spike on earlier inputs, as in training; neurons with another setting are refused.
    pub after_spike: AfterSpike,
    /// A factor on every threshold after training: below 1 the neurons fire on weaker input.
    ///
    /// Reading: the thesis has no such factor. 6.3.2 objects that a threshold below the trained one is crossed earlier
    /// than intended; this is the price for detecting inputs slightly weaker than the weakest trained one, which only
    /// just reaches it.
    pub run_threshold: f64,
    /// The delays at which every train of the encoder enters the neurons, ms, ascending: first all trains at the first
    /// delay, then all at the second (`SpikeTrains.delayed`). By default a single delay of 0.
    #[serde(default = "no_delay", skip_serializing_if = "is_at_once")]
    pub delays_ms: Vec<f64>,
    /// The neurons by label.
    pub neurons: BTreeMap<String, TrainedNeuron>,
    /// The plain rule of each label that has one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rules: BTreeMap<String, PlainRule>,
    /// The labels that are detected by their rule, and not by their neuron; without a rule such a label is never detected.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub by_rule: BTreeSet<String>,
    /// How the rest of frames follows; `None`: it stays as it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<Following>,
    /// What the data of the training were like; `None` if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingData>,
}

fn no_delay() -> Vec<f64> {
    vec![0.0]
}

fn is_at_once(delays_ms: &[f64]) -> bool {
    delays_ms == [0.0]
}

/// The longest allowed delay, ms.
const LONGEST_DELAY_MS: f64 = 60_000.0;

impl Readout {
    /// Checks that each part is valid and that the parts fit together.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the part.
    pub fn check(&self) -> Result<()> {
        self.encoder.check()?;
        detect::file::check_unit(self.unit.as_deref())?;
        above_0("run_threshold", self.run_threshold, "")?;
        self.check_delays()?;
        self.training.as_ref().map_or(Ok(()), TrainingData::check)?;
        self.rest.as_ref().map_or(Ok(()), Following::check)?;
        if self.neurons.is_empty() {
            return Err(problem!("readout: has no neuron; must have one or more"));
        }
        for (label, cell) in &self.neurons {
            if label.trim().is_empty() {
                return Err(problem!("readout: a neuron has no label; must have one"));
            }
            cell.neuron.check().map_err(|error| error.in_part(label))?;
            self.encoder_of(cell).map_err(|error| error.in_part(label))?;
            if cell.neuron.time != self.time {
                let (trained, expected) = (word(&cell.neuron.time), word(&self.time));
                return Err(problem!(
                    "{label}: the neuron was trained for time {trained}, but this readout is for time {expected}"
                ));
            }
            if cell.neuron.after_spike != self.after_spike {
                let (trained, expected) = (word(&cell.neuron.after_spike), word(&self.after_spike));
                return Err(problem!(
                    "{label}: the neuron was trained for after_spike {trained}, but this readout is for after_spike \
                     {expected}"
                ));
            }
            if !(0.0..=LONGEST_DELAY_MS).contains(&cell.delay_ms) {
                return Err(problem!("{label}: delay_ms is {}: must be from 0 to {LONGEST_DELAY_MS}", cell.delay_ms));
            }
            if let Some(n) = cell.weights.iter().position(|&w| !is_weight(w)) {
                return Err(weight_error(n, cell.weights[n]).in_part(label));
            }
            if let Some(array) = &self.array {
                self.check_weights(label, cell, array)?;
            }
        }
        for (label, rule) in &self.rules {
            rule.check().map_err(|error| error.in_part(label))?;
            if !rule.labels.iter().flatten().any(|name| name == label) {
                return Err(problem!("{label}: its rule detects no {label}"));
            }
        }
        match self.rules.keys().chain(&self.by_rule).find(|&label| !self.neurons.contains_key(label)) {
            Some(label) => Err(problem!("rules: the readout has no neuron {label}")),
            None => Ok(()),
        }
    }

    fn check_delays(&self) -> Result<()> {
        if self.delays_ms.is_empty() {
            return Err(problem!("delays_ms"; " is empty: must contain one delay or more"));
        }
        for (k, &delay) in self.delays_ms.iter().enumerate() {
            if !(0.0..=LONGEST_DELAY_MS).contains(&delay) {
                return Err(problem!("delays_ms"; "[{k}] is {delay}: must be from 0 to {LONGEST_DELAY_MS}"));
            }
            if k > 0 && delay <= self.delays_ms[k - 1] {
                return Err(problem!("delays_ms"; "[{k}] is {delay}, after {}: must ascend", self.delays_ms[k - 1]));
            }
        }
        Ok(())
    }

    /// The encoder whose trains a neuron receives: the readout's own, or some of its parts.
    fn encoder_of(&self, cell: &TrainedNeuron) -> Result<Cow<'_, Encoder>> {
        match (&self.encoder, &*cell.inputs) {
            (encoder, []) => Ok(Cow::Borrowed(encoder)),
            (Encoder::Composite(encoder), names) => {
                let parts = encoder.parts_named(names)?.into_iter().map(|(name, part)| (name.to_owned(), part.clone()));
                Ok(Cow::Owned(Encoder::Composite(Composite { parts: parts.collect() })))
            }
            (_, names) => Err(problem!(
                "inputs"; " are {names:?}: must be left out, because only a composite encoder has inputs with names"
            )),
        }
    }

    fn check_weights(&self, label: &str, cell: &TrainedNeuron, array: &Array) -> Result<()> {
        let copies = self.delays_ms.len();
        let encoder = self.encoder_of(cell)?;
        let inputs = encoder.trains(array) * encoder.kind().inputs_per_train() * copies;
        if cell.weights.len() == inputs {
            return Ok(());
        }
        let (rows, columns, signed) = (array.rows, array.columns, encoder.kind() == SpikeKind::Signed);
        Err(problem!(
            "{label}: {} weights, but the encoder makes {inputs} trains{}{} of {rows} x {columns} taxels: must be one \
             per train",
            cell.weights.len(),
            if signed { ", ON and OFF," } else { "" },
            if copies > 1 { format!(" at {copies} delays") } else { String::new() }
        ))
    }

    /// Starts a stream for an array with frames of this duration. Where the readout was trained on grids of several sizes, a
    /// smaller one is padded at its far edges.
    ///
    /// # Errors
    ///
    /// `Problem` if the array is not the one that the readout was trained on, if a required tare is missing, or if the
    /// period is not valid.
    pub fn stream(&self, array: &Array, frames: impl Into<FrameTime>, tare: Option<&Tare>) -> Result<ReadoutStream> {
        self.check()?;
        if let Some(sensor) = self.array.as_ref().filter(|sensor| self.pads && sensor.holds(array)) {
            let tare = tare.map(|tare| if sensor.holds(&tare.array) { tare.padded_to(sensor) } else { tare.clone() });
            return Ok(self.stream(sensor, frames, tare.as_ref())?.padding(array.clone()));
        }
        if let Some(sensor) = &self.array
            && !sensor.fits(array)
        {
            let same_shape = (sensor.rows, sensor.columns) == (array.rows, array.columns);
            let difference = if same_shape { ", with other taxels missing" } else { "" };
            let error = problem!(
                "an array of {} x {} taxels: the readout was trained on {} x {}{difference}",
                array.rows,
                array.columns,
                sensor.rows,
                sensor.columns
            );
            let row = array.rows == 1 && array.len() == sensor.len();
            return Err(match row {
                true if sensor.rows == 1 => error.with_hint("array", Hint::Pitch),
                true => error.with_hint("array", Hint::LayOut),
                false => error,
            });
        }
        for (label, cell) in &self.neurons {
            self.check_weights(label, cell, array)?;
        }
        let encoder = tare.map_or_else(|| self.encoder.clone(), |tare| self.encoder.with_tare(tare));
        let neurons = self.neurons.iter().filter(|&(label, _)| !self.by_rule.contains(label));
        let neurons = neurons.map(|(label, cell)| {
            let received = match &self.encoder {
                Encoder::Composite(encoder) if !cell.inputs.is_empty() => Some(encoder.of_parts(&cell.inputs, array)?),
                _ => None,
            };
            let (encoder, inputs) = (self.encoder_of(cell)?, ReceivedTrains::new(received, self.delays_ms.len()));
            Ok(NamedNeuron::new(label, cell, self.run_threshold, encoder.latency_ms(), inputs))
        });
        let mut ways = vec![];
        if self.runs_neurons() {
            let neurons = DelayedNeurons::new(neurons.collect::<Result<_>>()?, self.delays_ms.clone());
            ways.push(Way::of_neurons(encoder.stream(array)?, neurons));
        }
        for rule in self.running_rules() {
            ways.push(rule.way(array, tare)?);
        }
        let rest = self.rest.zip(tare).map(|(following, tare)| tare.followed(array, following)).transpose()?;
        Ok(ReadoutStream::new(ways, array.clone(), FrameClock::new(frames)?, rest))
    }

    /// The rules that run, each with the one label that it detects here: one of two kinds may be detected by its neuron.
    fn running_rules(&self) -> impl Iterator<Item = PlainRule> {
        self.by_rule.iter().filter_map(|label| {
            let rule = self.rules.get(label)?;
            let labels = rule.labels.clone().map(|name| name.filter(|name| name == label));
            Some(PlainRule { labels, ..rule.clone() })
        })
    }

    /// Whether a label is detected by its neuron.
    fn runs_neurons(&self) -> bool {
        self.neurons.keys().any(|label| !self.by_rule.contains(label))
    }

    /// The time after the last input within which its last detection is complete, us.
    pub(super) fn reach_us(&self, period_us: f64) -> i64 {
        let of_neurons = us(self.delays_ms.last().copied().unwrap_or(0.0)).ceil() as i64;
        self.running_rules().map(|rule| rule.reach_us(period_us)).fold(of_neurons, i64::max)
    }
}

/// The name of an option in JSON.
fn word(option: &impl Serialize) -> String {
    serde_json::to_string(option).unwrap_or_default()
}

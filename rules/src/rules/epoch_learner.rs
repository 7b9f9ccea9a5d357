//! The rules that learn spike times by epochs, each with its neuron and its training.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::epochs::{Examples, Trained, Training};
use super::source::Source;
use super::stepped::SteppedNeuron;
use super::{AnyRule, SOURCES};
use crate::checks::{check_ungraded, check_untargeted};
use taxel_core::allowed::one_weight_a_train;
use taxel_core::neuron::Neuron;
use taxel_core::parameters::Described;
use taxel_core::{Result, SpikeTrains, Stop, problem};

/// A rule, the neuron that it trains, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochLearner {
    /// The rule.
    pub rule: AnyRule,
    /// The neuron.
    pub neuron: SteppedNeuron,
    /// How it is trained.
    pub training: Training,
}

/// Parameters of the neuron that each rule has, and of its training.
const NEURON: [&str; 5] = ["tau", "tau_s", "theta_0", "after_spike", "step_ms"];
const TRAINING: [&str; 8] = ["eta", "epochs", "updates", "initial", "within_ms", "until_right", "seed", "max_seconds"];

/// The defaults that all rules share.
fn shared() -> Value {
    json!({ "step_ms": 0.1, "within_ms": 1.0, "until_right": true, "seed": 0, "max_seconds": null })
}

impl Source {
    fn named(name: &str) -> Option<&'static Self> {
        SOURCES.iter().find(|source| source.name == name)
    }

    /// Names with what the source gives, and names that the caller must give.
    fn split(&self) -> (Map<String, Value>, Vec<&'static str>) {
        let mut parameters = Map::new();
        for defaults in [shared(), (self.defaults)()] {
            if let Value::Object(defaults) = defaults {
                parameters.extend(defaults);
            }
        }
        let names = NEURON.iter().chain(&TRAINING).chain(self.of_rule);
        let required = names.copied().filter(|name| !parameters.contains_key(*name)).collect();
        (parameters, required)
    }
}

impl EpochLearner {
    /// The parameters of a rule, by its name, with those of its neuron and its training, in one list.
    #[must_use]
    pub fn described(name: &str) -> Option<Described> {
        let source = Source::named(name)?;
        let (defaults, required) = source.split();
        let mut ranges = [SteppedNeuron::RANGES, Training::RANGES].concat();
        ranges.push(SteppedNeuron::TIME_CONSTANT);
        ranges.retain(|range| defaults.contains_key(range.name) || required.contains(&range.name));
        ranges.extend(source.ranges.iter().copied().flatten());
        Some(Described { defaults, required, ranges })
    }

    /// The names of all rules.
    pub fn names() -> impl Iterator<Item = &'static str> {
        SOURCES.iter().map(|source| source.name)
    }

    /// The parts of a rule, as this crate reads them from JSON, of all its parameters in one list.
    ///
    /// # Errors
    ///
    /// `Problem` for a name that is not known, or a parameter that is not known or missing.
    pub fn parts(name: &str, parameters: Map<String, Value>) -> Result<Value> {
        let Some(source) = Source::named(name) else {
            let known: Vec<&str> = Self::names().collect();
            return Err(problem!("rule {name}: must be one of {}", known.join(", ")));
        };
        let (mut all, required) = source.split();
        for key in parameters.keys() {
            if !all.contains_key(key) && !required.contains(&key.as_str()) {
                return Err(problem!(key.as_str(); " is not known: {name} has no such parameter"));
            }
        }
        all.extend(parameters);
        if let Some(missing) = required.iter().find(|name| !all.contains_key(**name)) {
            return Err(problem!(*missing; ": must be given, because the rule's publication does not state it"));
        }
        (source.arrange)(&mut all)?;
        let take = |all: &Map<String, Value>, names: &[&str]| -> Value {
            names.iter().filter_map(|name| all.get(*name).map(|value| ((*name).to_owned(), value.clone()))).collect()
        };
        let rule = all.remove("constants").unwrap_or_else(|| json!({ name: take(&all, source.of_rule) }));
        let current = all.remove("current").unwrap_or_else(|| json!({ "exponential": take(&all, &["tau_s"]) }));
        let mut neuron = take(&all, &["tau", "theta_0", "after_spike", "step_ms"]);
        neuron["refractory"] = all.remove("refractory").unwrap_or(json!(0.0));
        neuron["current"] = current;
        Ok(json!({ "rule": rule, "neuron": neuron, "training": take(&all, &TRAINING) }))
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.neuron.check()?;
        self.training.check()?;
        self.rule.check(&self.neuron)
    }

    /// Trains on patterns of the same trains, with one list of targets (ms, ascending) a pattern.
    ///
    /// Calls `report` with the number of epochs done and the share of patterns right. A stop that is asked for ends it
    /// with the best weights so far.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, patterns, targets or first weights that make no sense.
    pub fn fit(
        &self,
        patterns: &[SpikeTrains],
        targets: &[Vec<f64>],
        start: Option<&[f64]>,
        report: &mut dyn FnMut(usize, f64),
        stop: Stop<'_>,
    ) -> Result<Trained> {
        self.check()?;
        taxel_core::learn::check_examples(
            &Neuron { refractory: self.neuron.refractory, ..Neuron::default() },
            patterns,
            targets,
        )?;
        taxel_core::learn::check_some_target(targets)?;
        patterns.iter().try_for_each(|pattern| check_ungraded(pattern, self.rule.name()))?;
        self.rule.train(&self.neuron, &self.training, Examples { patterns, targets, start }, report, stop)
    }

    /// The change of weights by one presentation, over the learning rate, and the output spikes in it (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights, pattern or targets that make no sense.
    pub fn change(&self, weights: &[f64], pattern: &SpikeTrains, targets: &[f64]) -> Result<(Vec<f64>, Vec<f64>)> {
        self.check()?;
        if targets.is_empty() {
            pattern.check()?;
        } else {
            let neuron = Neuron { refractory: self.neuron.refractory, ..Neuron::default() };
            taxel_core::learn::check_examples(&neuron, std::slice::from_ref(pattern), &[targets.to_vec()])?;
        }
        check_ungraded(pattern, self.rule.name())?;
        one_weight_a_train(weights, pattern.len())?;
        self.rule.change(&self.neuron, weights, pattern, targets)
    }

    /// The output spikes of the rule's neuron with these weights, ms.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense; `Interrupted` where the caller stops it.
    pub fn run(&self, weights: &[f64], pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        check_ungraded(pattern, self.rule.name())?;
        self.neuron.run(weights, pattern, stop)
    }
}

impl SteppedNeuron {
    /// The output spikes that weights make of a pattern, ms.
    fn run(&self, weights: &[f64], pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.check()?;
        check_untargeted(pattern)?;
        one_weight_a_train(weights, pattern.len())?;
        let mut fired = Vec::new();
        self.fire(weights, &self.lay_out(pattern, stop)?, &mut fired);
        Ok(fired)
    }
}

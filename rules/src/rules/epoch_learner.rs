//! The rules that learn spike times by epochs, each with its neuron and its training.

use serde::{Deserialize, Serialize};

use super::rule::{Rule, change_of};
use super::stepped::{AfterSpike, Kernels, SteppedNeuron};
use crate::checks::{check_ungraded, check_untargeted};
use taxel_core::allowed::{Parameter, Range, one_weight_a_train, ranges};
use taxel_core::learn::{check_examples, check_some_target};
use taxel_core::neuron::Neuron;
use taxel_core::parameters::Described;
use taxel_core::{Result, SpikeTrains, Stop, problem};

/// The name of a rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Name {
    /// INST.
    Inst,
    /// FILT.
    Filt,
    /// Chronotron.
    Chronotron,
    /// ReSuMe.
    Resume,
    /// SPAN.
    Span,
    /// PSD.
    Psd,
    /// FP-learning.
    Fp,
    /// HTP.
    Htp,
}

/// Which rule of the Chronotron.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ChronotronRule {
    /// E-learning.
    E,
    /// I-learning.
    I,
}

/// When weights change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Updates {
    /// Once an epoch, by the sum over its patterns (Gardner and Grüning 2016).
    Batch,
    /// After each pattern, in an order drawn anew each epoch.
    Pattern,
}

/// How training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// Every pattern was right.
    Right,
    /// All epochs were used up.
    Epochs,
    /// The caller requested a stop.
    Stopped,
}

/// The result of training.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The weights with most patterns right, the latest such; mV.
    pub weights: Vec<f64>,
    /// The share of patterns right after 0, 1, 2 ... epochs.
    pub right: Vec<f64>,
    /// After how many epochs the weights were those.
    pub best_epoch: usize,
    /// How it ended.
    pub ended: Ended,
}

/// The patterns and targets to learn, and the first weights.
pub(super) struct Examples<'a> {
    pub patterns: &'a [SpikeTrains],
    pub targets: &'a [Vec<f64>],
    pub start: Option<&'a [f64]>,
}

/// A rule, the neuron that it trains, and how, in one list; a rule's class in Python has those that it needs, and what its
/// source gives for them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochLearner {
    /// Which rule.
    pub name: Name,
    /// Learning rate; `None` where the rule has a published one.
    pub eta: Option<f64>,
    /// First weights are drawn evenly between these two, mV; `None` where the rule has published ones.
    pub initial: Option<[f64; 2]>,
    /// Epochs at most.
    pub epochs: usize,
    /// When weights change.
    pub updates: Updates,
    /// A pattern is right where its output spikes are as many as its targets, each within this of its own, ms.
    pub within_ms: f64,
    /// Whether to end as soon as every pattern is right.
    pub until_right: bool,
    /// The seed of the first weights and of the order of patterns.
    pub seed: u64,
    /// The time after which the caller requests the best so far, s; this crate reads no clock.
    pub max_seconds: Option<f64>,
    /// Membrane time constant, ms.
    pub tau: f64,
    /// Synaptic time constant, ms; a quarter of `tau` for a Chronotron without one, and `None` for PSD, whose own current
    /// then drives the neuron.
    pub tau_s: Option<f64>,
    /// Threshold, mV.
    pub theta_0: f64,
    /// The effect of an output spike; by its rule for a Chronotron without one.
    pub after_spike: Option<AfterSpike>,
    /// How long the membrane stays at 0 after a spike, ms.
    #[serde(default)]
    pub refractory: f64,
    /// Step of the grid, from the pattern's start on, ms.
    pub step_ms: f64,
    /// Chronotron: which of its rules.
    #[serde(default)]
    pub rule: Option<ChronotronRule>,
    /// FILT: time constant of the filter, ms. E-learning: scale of the cost of a move, ms, `tau` where left out: pairs up to
    /// `2 tau_q` apart are moved.
    #[serde(default)]
    pub tau_q: Option<f64>,
    /// E-learning: weight of the moves, ms; `tau_q` where left out.
    #[serde(default)]
    pub gamma_r: Option<f64>,
    /// ReSuMe: the change that every synapse gets, with or without an input.
    #[serde(default)]
    pub a: f64,
    /// ReSuMe: height of the learning window.
    #[serde(default)]
    pub amplitude: Option<f64>,
    /// ReSuMe: its time constant, ms; the membrane's where left out.
    #[serde(default)]
    pub tau_w: Option<f64>,
    /// SPAN: time constant of the filter, ms.
    #[serde(default)]
    pub tau_a: Option<f64>,
    /// PSD: slow time constant of the current, ms.
    #[serde(default)]
    pub tau_1: Option<f64>,
    /// PSD: its fast one, ms.
    #[serde(default)]
    pub tau_2: Option<f64>,
    /// FP: how far from its target a spike may lie, ms. HTP: how long before a target the neuron may fire, ms.
    #[serde(default)]
    pub window_ms: Option<f64>,
}

/// The window of FP, which must not be empty.
const WINDOW: Parameter = Parameter { name: "window_ms", unit: "ms", range: Range::ABOVE_0 };

impl EpochLearner {
    /// The names of all rules, as [`Name`] has them.
    pub const NAMES: [&str; 8] = ["inst", "filt", "chronotron", "resume", "span", "psd", "fp", "htp"];

    ranges! {
        eta: "", Range::ABOVE_0;
        initial: "mV", Range::FINITE;
        within_ms: "ms", Range::ABOVE_0;
        max_seconds: "s", Range::ABOVE_0;
        tau: "ms", Range::ABOVE_0;
        tau_s: "ms", Range::ABOVE_0;
        theta_0: "mV", Range::ABOVE_0;
        refractory: "ms", Range::FROM_0;
        step_ms: "ms", Range::ABOVE_0;
        tau_q: "ms", Range::ABOVE_0;
        gamma_r: "ms", Range::ABOVE_0;
        a: "", Range::FINITE;
        amplitude: "", Range::ABOVE_0;
        tau_w: "ms", Range::ABOVE_0;
        tau_a: "ms", Range::ABOVE_0;
        tau_1: "ms", Range::ABOVE_0;
        tau_2: "ms", Range::ABOVE_0;
        window_ms: "ms", Range::FROM_0;
    }

    /// The ranges of all parameters of all rules; the defaults of each are its class's.
    #[must_use]
    pub fn described(name: &str) -> Described {
        let mut ranges = Self::RANGES.to_vec();
        if name == "fp" {
            ranges.retain(|range| range.name != WINDOW.name);
            ranges.push(WINDOW);
        }
        Described { defaults: serde_json::Map::new(), required: vec![], ranges }
    }

    /// The same with what is left out filled in.
    #[must_use]
    pub fn filled(mut self) -> Self {
        if self.name == Name::Chronotron {
            let of_rule =
                if self.rule == Some(ChronotronRule::I) { AfterSpike::Membrane } else { AfterSpike::Subtract };
            self.after_spike = self.after_spike.or(Some(of_rule));
            self.tau_s = self.tau_s.or(Some(self.tau / 4.0));
            self.tau_q = self.tau_q.or(Some(self.tau));
            self.gamma_r = self.gamma_r.or(self.tau_q);
        }
        self
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.parts().map(drop)
    }

    /// The rule and its neuron, checked.
    fn parts(&self) -> Result<(Rule, SteppedNeuron)> {
        self.check_ranges()?;
        if let Some([low, high]) = self.initial
            && low > high
        {
            return Err(problem!("initial"; " is {low} to {high} mV: must be two finite weights, the smaller first"));
        }
        let kernels = match (self.name, self.tau_s) {
            (Name::Psd, None) => self.own_kernels()?,
            (_, tau_s) => Kernels::of_exponential(self.tau, given("tau_s", tau_s)?),
        };
        let neuron = SteppedNeuron {
            kernels,
            theta_0: self.theta_0,
            after_spike: given("after_spike", self.after_spike)?,
            refractory: self.refractory,
            step_ms: self.step_ms,
        };
        neuron.check()?;
        Ok((self.rule(&neuron)?, neuron))
    }

    /// PSD's own.
    fn own_kernels(&self) -> Result<Kernels> {
        let (tau_1, tau_2) = (given("tau_1", self.tau_1)?, given("tau_2", self.tau_2)?);
        Ok(Kernels::of_double_exponential(self.tau, tau_1, tau_2))
    }

    fn rule(&self, neuron: &SteppedNeuron) -> Result<Rule> {
        let kernels = neuron.kernels;
        Ok(match self.name {
            Name::Inst => Rule::Inst(kernels),
            Name::Filt => Rule::Filt { kernels, tau_q: given("tau_q", self.tau_q)? },
            Name::Chronotron => match given("rule", self.rule)? {
                ChronotronRule::E => {
                    let (tau_q, gamma_r) = (given("tau_q", self.tau_q)?, given("gamma_r", self.gamma_r)?);
                    Rule::ELearning { kernels, tau_q, gamma_r }
                }
                ChronotronRule::I => Rule::ILearning(kernels),
            },
            Name::Resume => Rule::Resume {
                a: self.a,
                amplitude: given("amplitude", self.amplitude)?,
                tau_w: self.tau_w.unwrap_or(self.tau),
            },
            Name::Span => Rule::Span { tau_a: given("tau_a", self.tau_a)? },
            Name::Psd => {
                let own = self.own_kernels()?;
                own.check()?;
                Rule::Psd(own)
            }
            Name::Fp => {
                let window = given(WINDOW.name, self.window_ms)?;
                WINDOW.check(&window)?;
                neuron.check_linear("FP")?;
                Rule::Fp { kernels, window }
            }
            Name::Htp => {
                neuron.check_linear("HTP")?;
                Rule::Htp { kernels, window: given(WINDOW.name, self.window_ms)? }
            }
        })
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
        let (rule, neuron) = self.parts()?;
        check_examples(&self.plain_neuron(), patterns, targets)?;
        check_some_target(targets)?;
        patterns.iter().try_for_each(|pattern| check_ungraded(pattern, self.reader()))?;
        self.train(&rule, &neuron, Examples { patterns, targets, start }, report, stop)
    }

    /// The change of weights by one presentation, over the learning rate, and the output spikes in it (ms).
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights, pattern or targets that make no sense.
    pub fn change(&self, weights: &[f64], pattern: &SpikeTrains, targets: &[f64]) -> Result<(Vec<f64>, Vec<f64>)> {
        let (rule, neuron) = self.parts()?;
        if targets.is_empty() {
            pattern.check()?;
        } else {
            check_examples(&self.plain_neuron(), std::slice::from_ref(pattern), &[targets.to_vec()])?;
        }
        check_ungraded(pattern, self.reader())?;
        one_weight_a_train(weights, pattern.len())?;
        change_of(&rule, &neuron, weights, pattern, targets)
    }

    /// The output spikes of the rule's neuron with these weights, ms.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense; `Interrupted` where the caller stops it.
    pub fn run(&self, weights: &[f64], pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        let (_, neuron) = self.parts()?;
        check_ungraded(pattern, self.reader())?;
        check_untargeted(pattern)?;
        one_weight_a_train(weights, pattern.len())?;
        let mut fired = Vec::new();
        neuron.fire(weights, &neuron.lay_out(pattern, stop)?, &mut fired);
        Ok(fired)
    }

    /// The neuron that says which targets are too close to each other.
    fn plain_neuron(&self) -> Neuron {
        Neuron { refractory: self.refractory, ..Neuron::default() }
    }

    fn reader(&self) -> &'static str {
        Self::NAMES[self.name as usize]
    }
}

/// A parameter that must be given.
fn given<T>(name: &'static str, value: Option<T>) -> Result<T> {
    value.ok_or_else(|| problem!(name; " is None: must be given"))
}

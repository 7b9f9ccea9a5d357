//! The rules that learn spike times by epochs, under one roof: a neuron, a way of training, a rule.

use serde::{Deserialize, Serialize};

use super::chronotron::{ELearning, ILearning};
use super::epochs::{Examples, Trained, Training, change_of};
use super::filt::Filt;
use super::fp::Fp;
use super::htp::Htp;
use super::inst::Inst;
use super::psd::Psd;
use super::resume::Resume;
use super::span::Span;
use super::stepped::SteppedNeuron;
use crate::allowed::one_weight_a_train;
use crate::neuron::Neuron;
use crate::{Result, SpikeTrains, Stop};

/// Which rule, with its own constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// INST, Gardner and Grüning 2016.
    Inst(Inst),
    /// FILT, Gardner and Grüning 2016.
    Filt(Filt),
    /// E-learning, Florian 2012.
    ELearning(ELearning),
    /// I-learning, Florian 2012.
    ILearning(ILearning),
    /// ReSuMe, Ponulak and Kasiński 2010.
    Resume(Resume),
    /// SPAN, Mohemmed et al. 2012.
    Span(Span),
    /// PSD, Yu et al. 2013.
    Psd(Psd),
    /// FP-learning, Memmesheimer et al. 2014.
    Fp(Fp),
    /// HTP, Memmesheimer et al. 2014.
    Htp(Htp),
}

/// A rule, the neuron that it trains, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rival {
    /// The rule.
    pub law: Law,
    /// The neuron.
    pub neuron: SteppedNeuron,
    /// How it is trained.
    pub training: Training,
}

/// Does `$work` with the rule in `$law`, whichever it is.
macro_rules! with_rule {
    ($rival:expr, |$rule:pat_param| $work:expr) => {
        with_rule!(@ $rival, $rule, $work, Inst Filt ELearning ILearning Resume Span Psd Fp Htp)
    };
    (@ $rival:expr, $rule:pat_param, $work:expr, $($law:ident)*) => {
        match &$rival.law {
            $(Law::$law(law) => {
                let $rule = law.rule(&$rival.neuron)?;
                $work
            })*
        }
    };
}

impl Rival {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.neuron.check()?;
        self.training.check()?;
        with_rule!(self, |_| Ok(()))
    }

    /// Trains on patterns of the same trains, with one list of targets (ms, ascending) a pattern.
    ///
    /// `report` hears how many epochs are done and the share of patterns right. A stop that is asked for ends it with the
    /// best weights so far.
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
        crate::learn::check_examples(
            &Neuron { refractory: self.neuron.refractory, ..Neuron::default() },
            patterns,
            targets,
        )?;
        let Self { neuron, training, .. } = self;
        with_rule!(self, |rule| training.train(&rule, neuron, Examples { patterns, targets, start }, report, stop))
    }

    /// What one presentation of a pattern changes, over the learning rate, and the output spikes in it (ms).
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
            crate::learn::check_examples(&neuron, std::slice::from_ref(pattern), &[targets.to_vec()])?;
        }
        one_weight_a_train(weights, pattern.len())?;
        with_rule!(self, |rule| Ok(change_of(&rule, &self.neuron, weights, pattern, targets)))
    }
}

impl SteppedNeuron {
    /// The output spikes that weights make of a pattern, ms.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, weights or a pattern that make no sense.
    pub fn run(&self, weights: &[f64], pattern: &SpikeTrains) -> Result<Vec<f64>> {
        self.check()?;
        crate::learn::check_heard(pattern)?;
        one_weight_a_train(weights, pattern.len())?;
        let mut fired = Vec::new();
        self.fire(weights, &self.lay_out(pattern), &mut fired);
        Ok(fired)
    }
}

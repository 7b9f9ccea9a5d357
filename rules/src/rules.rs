//! The rules that others published, for comparison: each with its own neuron, as its paper has it.

mod batch;
mod epoch_learner;
mod epochs;
mod source;
mod stdp;
mod stepped;
mod tempotron;

pub use batch::Learnt;
pub use epoch_learner::EpochLearner;
pub use epochs::{Ended, Trained, Training};
pub use stdp::{Stdp, StdpNeuron};
pub use stepped::SteppedNeuron;
pub use tempotron::Tempotron;

use serde::{Deserialize, Serialize};

use batch::BatchRule;
use epochs::{Examples, change_of};
use source::Source;
use taxel_core::neuron::Neuron;
use taxel_core::parameters::Described;
use taxel_core::{Result, SpikeTrains, Stop, problem, reading};

/// The registry of learners of spike times that take all examples at once: a line each, its file
/// `rules/NAME.rs`, which is also its name, and its kind.
macro_rules! batches {
    ($($module:ident: $Kind:ident;)*) => {
        $(mod $module;)*
        $(pub use $module::$Kind;)*

        /// Any learner of spike times that takes all examples at once, with its parameters.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(untagged)]
        pub enum Batch {
            $(#[doc = concat!("[`", stringify!($Kind), "`].")] $Kind($Kind),)*
        }

        impl Batch {
            /// The names of all of them.
            pub const NAMES: &[&str] = &[$(stringify!($module)),*];

            fn rule(&self) -> &dyn BatchRule {
                match self { $(Self::$Kind(rule) => rule,)* }
            }

            /// The parameters of one, by its name, with their defaults and ranges.
            #[must_use]
            pub fn described(name: &str) -> Option<Described> {
                $(if name == stringify!($module) {
                    return Some($Kind::described());
                })*
                None
            }

            /// Reads one, by its name, from the JSON of its parameters, and checks them.
            ///
            /// # Errors
            ///
            /// `Problem`, naming the parameter.
            pub fn from_json(name: &str, json: &str) -> Result<Self> {
                let read = |unfit: reading::Unfit| unfit.problem(name);
                $(if name == stringify!($module) {
                    let rule = reading::from_text::<$Kind>(json).map_err(read)?;
                    BatchRule::check(&rule)?;
                    return Ok(Self::$Kind(rule));
                })*
                Err(problem!("learner {name}: must be one of {}", Self::NAMES.join(", ")))
            }
        }
    };
}

// Rustfmt finds no modules in a macro: the Makefile names their files to it.
batches! {
    skim: Skim;
}

impl Batch {
    /// Learns from patterns of the same trains with one list of targets (ms, ascending) a pattern.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, patterns or targets that make no sense; `Interrupted` where the caller stops it.
    pub fn fit(&self, patterns: &[SpikeTrains], targets: &[Vec<f64>], stop: Stop<'_>) -> Result<Learnt> {
        self.rule().check()?;
        taxel_core::learn::check_examples(&Neuron { refractory: 0.0, ..Neuron::default() }, patterns, targets)?;
        taxel_core::learn::check_some_target(targets)?;
        self.rule().fit(patterns, targets, stop)
    }

    /// Output spikes in a pattern, ms, after what was learnt.
    ///
    /// # Errors
    ///
    /// `Problem` for a pattern, or for what was learnt, that makes no sense; `Interrupted` where the caller stops it.
    pub fn run(&self, learnt: &Learnt, pattern: &SpikeTrains, stop: Stop<'_>) -> Result<Vec<f64>> {
        self.rule().check()?;
        self.rule().run(learnt, pattern, stop)
    }
}

/// The registry of rules by epochs: a line each, its file `rules/NAME.rs`, which is also its name in JSON, and
/// the kinds in it.
macro_rules! rules {
    ($($module:ident: $($Kind:ident),+;)*) => {
        $(mod $module;)*
        $(pub use $module::{$($Kind),+};)*

        /// The published defaults of all rules by epochs.
        const SOURCES: &[Source] = &[$($module::SOURCE),*];

        /// Any of the rules, with its own constants.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum AnyRule {
            $($(#[doc = concat!("[`", stringify!($Kind), "`].")] $Kind($Kind),)+)*
        }

        impl AnyRule {
            /// The name of the rule.
            fn name(&self) -> &'static str {
                match self { $($(Self::$Kind(_) => stringify!($module),)+)* }
            }

            fn check(&self, neuron: &SteppedNeuron) -> Result<()> {
                match self {
                    $($(Self::$Kind(constants) => constants.rule(neuron).map(drop),)+)*
                }
            }

            fn train(
                &self,
                neuron: &SteppedNeuron,
                training: &Training,
                examples: Examples<'_>,
                report: &mut dyn FnMut(usize, f64),
                stop: Stop<'_>,
            ) -> Result<Trained> {
                match self {
                    $($(Self::$Kind(constants) => {
                        training.train(&constants.rule(neuron)?, neuron, examples, report, stop)
                    })+)*
                }
            }

            fn change(
                &self,
                neuron: &SteppedNeuron,
                weights: &[f64],
                pattern: &SpikeTrains,
                targets: &[f64],
            ) -> Result<(Vec<f64>, Vec<f64>)> {
                match self {
                    $($(Self::$Kind(constants) => {
                        change_of(&constants.rule(neuron)?, neuron, weights, pattern, targets)
                    })+)*
                }
            }
        }
    };
}

// Rustfmt finds no modules in a macro: the Makefile names their files to it.
rules! {
    inst: Inst;
    filt: Filt;
    chronotron: ELearning, ILearning;
    resume: Resume;
    span: Span;
    psd: Psd;
    fp: Fp;
    htp: Htp;
}

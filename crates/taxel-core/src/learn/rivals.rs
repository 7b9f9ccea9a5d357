//! The rules that others published, for comparison: each with its own neuron, as its paper has it.

mod epochs;
mod rival;
mod skim;
mod source;
mod stepped;
mod tempotron;

pub use epochs::{Ended, Trained, Training, Updates};
pub use rival::Rival;
pub use skim::{Nonlinearity, Normal, Skim};
pub use stepped::{Current, Reset, SteppedNeuron};
pub use tempotron::{Peak, Tempotron};

use serde::{Deserialize, Serialize};

use crate::{Result, SpikeTrains, Stop};
use epochs::{Examples, change_of};
use source::Source;

/// The registry of rules by epochs: a line each, its file `learn/rivals/NAME.rs`, which is also its name in JSON, and the
/// laws in it.
macro_rules! rules {
    ($($module:ident: $($law:ident),+;)*) => {
        $(mod $module;)*
        $(pub use $module::{$($law),+};)*

        /// What the sources of all rules by epochs say.
        const SOURCES: &[Source] = &[$($module::SOURCE),*];

        /// Which rule, with its own constants.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Law {
            $($(#[doc = concat!("[`", stringify!($law), "`].")] $law($law),)+)*
        }

        impl Law {
            fn check(&self, neuron: &SteppedNeuron) -> Result<()> {
                match self {
                    $($(Self::$law(law) => law.rule(neuron).map(drop),)+)*
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
                    $($(Self::$law(law) => training.train(&law.rule(neuron)?, neuron, examples, report, stop),)+)*
                }
            }

            fn change(
                &self,
                neuron: &SteppedNeuron,
                weights: &[f64],
                pattern: &SpikeTrains,
                targets: &[f64],
            ) -> Result<(Vec<f64>, Vec<f64>)> {
                Ok(match self {
                    $($(Self::$law(law) => change_of(&law.rule(neuron)?, neuron, weights, pattern, targets),)+)*
                })
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

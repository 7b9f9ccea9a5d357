//! The rules that others published, for comparison: each with its own neuron, as its paper has it.

mod chronotron;
mod epochs;
mod filt;
mod fp;
mod htp;
mod inst;
mod psd;
mod resume;
mod rival;
mod skim;
mod span;
mod stepped;
mod tempotron;

pub use chronotron::{ELearning, ILearning};
pub use epochs::{Ended, Trained, Training, Updates};
pub use filt::Filt;
pub use fp::Fp;
pub use htp::Htp;
pub use inst::Inst;
pub use psd::Psd;
pub use resume::Resume;
pub use rival::{Law, Rival};
pub use skim::{Branches, Normal, Skim};
pub use span::Span;
pub use stepped::{Current, Reset, SteppedNeuron};
pub use tempotron::{Peak, Tempotron};

//! The rules that others published, for comparison: each with its own neuron, as its paper has it.

mod chronotron;
mod corrections;
mod epoch_learner;
mod epochs;
mod fp;
mod htp;
mod rule;
mod skim;
mod stdp;
mod stepped;
mod tempotron;

pub use epoch_learner::{Ended, EpochLearner, Trained};
pub use skim::Skim;
pub use stdp::{Stdp, StdpNeuron};
pub use tempotron::Tempotron;

/// How long until a potential that rises until `until` reaches its threshold, as `reaches` says, ms.
fn crossing(until: f64, reaches: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, until);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return high;
        }
        if reaches(middle) { high = middle } else { low = middle }
    }
}

//! FP-learning: finite precision (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::{Correction, Presented, Rule};
use super::source::Source;
use super::stepped::{AfterSpike, Kernels, SteppedNeuron};
use taxel_core::Result;
use taxel_core::allowed::{Range, ranges};

/// Only the *first* error of a trial changes weights, by the potential that each input makes there; the trial then ends.
///
/// An output spike farther than `window_ms` from its target, or a second one at it, lowers at its time; a target whose
/// window ends without a spike raises at the window's end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fp {
    /// How far from its target a spike may lie, ms.
    pub window_ms: f64,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "fp",
    of_rule: &["window_ms"],
    ranges: &[Fp::RANGES],
    defaults: || json!({ "after_spike": "reset" }),
    arrange: |_| Ok(()),
};

pub(super) struct FpRule {
    kernels: Kernels,
    window: f64,
    forgets: bool,
}

impl Fp {
    ranges! {
        window_ms: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<FpRule> {
        self.check_ranges()?;
        neuron.check_linear("FP")?;
        Ok(FpRule {
            kernels: neuron.kernels(),
            window: self.window_ms,
            forgets: neuron.after_spike == AfterSpike::Reset,
        })
    }
}

impl Rule for FpRule {
    fn factor(&self, since: f64) -> f64 {
        self.kernels.value(since)
    }

    fn correct(&self, presented: &Presented<'_>, _: &[f64], fired: &[f64], out: &mut Vec<Correction>) {
        let Some((t, amount)) = first_error(presented.targets, fired, self.window) else { return };
        let before = fired.iter().copied().take_while(|&f| f < t).last();
        let after = before.filter(|_| self.forgets).unwrap_or(f64::NEG_INFINITY);
        out.push(Correction { after, ..Correction::new(t, amount) });
    }
}

/// The time of the first error of a trial, and the sign of its correction.
fn first_error(targets: &[f64], fired: &[f64], window: f64) -> Option<(f64, f64)> {
    let mut k = 0;
    for &f in fired {
        match targets.get(k) {
            Some(&t) if f > t + window => return Some((t + window, 1.0)),
            Some(&t) if f >= t - window => k += 1,
            _ => return Some((f, -1.0)),
        }
    }
    targets.get(k).map(|&t| (t + window, 1.0))
}

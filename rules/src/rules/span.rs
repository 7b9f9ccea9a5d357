//! SPAN, the spike pattern association neuron (Mohemmed et al. 2012, Int J Neural Syst 22:1250012).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::Rule;
use super::source::Source;
use super::stepped::SteppedNeuron;
use taxel_core::Result;
use taxel_core::allowed::{Range, ranges};

/// Widrow-Hoff on inputs, targets and outputs that are all filtered by `(e / tau_a) s e^{-s/tau_a}`:
/// `eta` times the integral of `x_i (y_d - y_o)`, in closed form
/// `(e/2)^2 [sum over targets of (|s| + tau_a) e^{-|s|/tau_a} - the same over output spikes]`. Inputs after a spike count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// Time constant of the filter, ms.
    pub tau_a: f64,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "span",
    of_rule: &["tau_a"],
    ranges: &[Span::RANGES],
    defaults: || json!({ "after_spike": "membrane" }),
    arrange: |_| Ok(()),
};

pub(super) struct SpanRule(f64);

impl Span {
    ranges! {
        tau_a: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, _: &SteppedNeuron) -> Result<SpanRule> {
        self.check_ranges()?;
        Ok(SpanRule(self.tau_a))
    }
}

impl Rule for SpanRule {
    fn factor(&self, since: f64) -> f64 {
        let apart = since.abs();
        let half_e = std::f64::consts::E / 2.0;
        half_e * half_e * (apart + self.0) * (-apart / self.0).exp()
    }
}

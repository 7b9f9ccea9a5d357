//! ReSuMe, the remote supervised method (Ponulak and Kasiński 2010, Neural Computation 22:467).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::Rule;
use super::source::Source;
use super::stepped::SteppedNeuron;
use taxel_core::allowed::{Range, ranges};
use taxel_core::{Result, problem};

/// `eta [S_d - S_o] [a + sum over earlier inputs of amplitude e^{-s/tau_w}]` (equation 2.10, summed over whole spikes).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resume {
    /// The change that every synapse gets, with or without an input.
    pub a: f64,
    /// Height of the learning window.
    pub amplitude: f64,
    /// Its time constant, ms; the membrane's where left out.
    pub tau_w: Option<f64>,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "resume",
    of_rule: &["a", "amplitude", "tau_w"],
    ranges: &[Resume::RANGES],
    defaults: || json!({ "after_spike": "membrane", "a": 0.0, "amplitude": 1.0, "tau_w": null }),
    arrange: |_| Ok(()),
};

pub(super) struct ResumeRule {
    a: f64,
    amplitude: f64,
    tau_w: f64,
}

impl Resume {
    ranges! {
        a: "", Range::FINITE;
        amplitude: "", Range::ABOVE_0;
        tau_w: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<ResumeRule> {
        let tau_w = self.tau_w.unwrap_or(neuron.tau);
        self.check_ranges()?;
        if !self.a.is_finite() {
            return Err(problem!("a is {}: must be finite", self.a));
        }
        Ok(ResumeRule { a: self.a, amplitude: self.amplitude, tau_w })
    }
}

impl Rule for ResumeRule {
    fn factor(&self, since: f64) -> f64 {
        if since > 0.0 { self.amplitude * (-since / self.tau_w).exp() } else { 0.0 }
    }

    fn constant(&self) -> f64 {
        self.a
    }
}

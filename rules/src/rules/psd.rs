//! PSD, precise-spike-driven plasticity (Yu, Tang, Tan and Li 2013, PLoS ONE 8(11) e78318).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::Rule;
use super::source::Source;
use super::stepped::{SteppedNeuron, peak_factor};
use taxel_core::allowed::{Range, ranges};
use taxel_core::{Result, problem};

/// `eta [sum over targets of PSC - sum over output spikes of PSC]`, PSC being the *current*
/// `V0 (e^{-s/tau_1} - e^{-s/tau_2})`, peak 1, which the membrane filters once more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Psd {
    /// Slow time constant of the current, ms.
    pub tau_1: f64,
    /// Its fast one, ms.
    pub tau_2: f64,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "psd",
    of_rule: &["tau_1", "tau_2"],
    ranges: &[Psd::RANGES],
    defaults: || {
        json!({
            "tau": 10.0, "tau_s": null, "tau_1": 10.0, "tau_2": 2.5, "after_spike": "membrane", "refractory": 0.0
        })
    },
    // Without a synapse of its own the neuron is driven by the rule's current.
    arrange: |parameters| {
        if parameters["tau_s"].is_null() {
            let current = json!({ "tau_1": parameters["tau_1"], "tau_2": parameters["tau_2"] });
            parameters.insert("current".into(), json!({ "double_exponential": current }));
        }
        Ok(())
    },
};

pub(super) struct PsdRule {
    peak: f64,
    tau_1: f64,
    tau_2: f64,
}

impl Psd {
    ranges! {
        tau_1: "ms", Range::ABOVE_0;
        tau_2: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, _: &SteppedNeuron) -> Result<PsdRule> {
        let (tau_1, tau_2) = (self.tau_1, self.tau_2);
        self.check_ranges()?;
        if tau_2 >= tau_1 {
            return Err(problem!("tau_2"; " is {tau_2} ms: must be below tau_1, {tau_1} ms"));
        }
        Ok(PsdRule { peak: peak_factor(tau_1, tau_2), tau_1, tau_2 })
    }
}

impl Rule for PsdRule {
    fn factor(&self, since: f64) -> f64 {
        if since > 0.0 { self.peak * ((-since / self.tau_1).exp() - (-since / self.tau_2).exp()) } else { 0.0 }
    }
}

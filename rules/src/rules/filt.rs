//! FILT: filtered differences of spikes (Gardner and Grüning 2016, PLoS ONE 11(8) e0161335).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::Rule;
use super::inst::{published_eta, published_initial};
use super::source::Source;
use super::stepped::{Current, SteppedNeuron, peak_factor};
use taxel_core::allowed::{Range, ranges};
use taxel_core::{Result, problem};

/// INST with both spike trains filtered by `e^{-s/tau_q}`: an input counts by
/// `eps_0 (C_m e^{-s/tau} - C_s e^{-s/tau_s})`, with `C = tau / (tau + tau_q)`, before a spike, and by
/// `eps_0 (C_m - C_s) e^{s/tau_q}` after it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filt {
    /// Time constant of the filter, ms.
    pub tau_q: f64,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "filt",
    of_rule: &["tau_q"],
    ranges: &[Filt::RANGES],
    defaults: || {
        json!({
            "eta": null, "initial": null, "epochs": 500, "updates": "batch",
            "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0, "after_spike": "subtract", "tau_q": 10.0
        })
    },
    arrange: |_| Ok(()),
};

pub(super) struct FiltRule {
    eps_0: f64,
    tau: f64,
    tau_s: f64,
    tau_q: f64,
    c_m: f64,
    c_s: f64,
}

impl Filt {
    ranges! {
        tau_q: "ms", Range::ABOVE_0;
    }

    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<FiltRule> {
        self.check_ranges()?;
        let (tau, tau_q) = (neuron.tau, self.tau_q);
        let Current::Exponential { tau_s } = neuron.current else {
            return Err(problem!(
                "current is a double exponential: must be a single exponential, for which FILT was published"
            ));
        };
        let eps_0 = peak_factor(tau, tau_s);
        Ok(FiltRule { eps_0, tau, tau_s, tau_q, c_m: tau / (tau + tau_q), c_s: tau_s / (tau_s + tau_q) })
    }
}

impl Rule for FiltRule {
    fn factor(&self, since: f64) -> f64 {
        self.eps_0
            * if since > 0.0 {
                self.c_m * (-since / self.tau).exp() - self.c_s * (-since / self.tau_s).exp()
            } else {
                (self.c_m - self.c_s) * (since / self.tau_q).exp()
            }
    }

    fn eta(&self, trains: usize, targets: usize) -> Option<f64> {
        Some(published_eta(trains, targets))
    }

    fn initial(&self, trains: usize) -> Option<[f64; 2]> {
        Some(published_initial(trains))
    }
}

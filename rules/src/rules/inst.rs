//! INST: instantaneous differences of spikes (Gardner and Grüning 2016, PLoS ONE 11(8) e0161335).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::Rule;
use super::source::Source;
use super::stepped::{Kernels, SteppedNeuron};
use taxel_core::Result;

/// `eta [sum over targets of eps - sum over output spikes of eps]`, eps being the potential that an input makes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inst {}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "inst",
    of_rule: &[],
    ranges: &[],
    defaults: || {
        json!({
            "eta": null, "initial": null, "epochs": 500, "updates": "batch",
            "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0, "after_spike": "subtract"
        })
    },
    arrange: |_| Ok(()),
};

pub(super) struct InstRule(Kernels);

impl Inst {
    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<InstRule> {
        Ok(InstRule(neuron.kernels()))
    }
}

impl Rule for InstRule {
    fn factor(&self, since: f64) -> f64 {
        self.0.value(since)
    }

    fn eta(&self, trains: usize, targets: usize) -> Option<f64> {
        Some(published_eta(trains, targets))
    }

    fn initial(&self, trains: usize) -> Option<[f64; 2]> {
        Some(published_initial(trains))
    }
}

/// The rate of Gardner and Grüning, `600 / (N n_s p)`: `n_s p` is the number of all targets.
pub(super) fn published_eta(trains: usize, targets: usize) -> f64 {
    600.0 / (trains as f64 * targets as f64)
}

/// Their first weights, evenly between 0 and `200 / N`, mV.
pub(super) fn published_initial(trains: usize) -> [f64; 2] {
    [0.0, 200.0 / trains as f64]
}

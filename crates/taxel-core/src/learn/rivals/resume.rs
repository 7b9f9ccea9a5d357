//! ReSuMe, the remote supervised method (Ponulak and Kasiński 2010, Neural Computation 22:467).

use serde::{Deserialize, Serialize};

use super::epochs::Rule;
use super::stepped::SteppedNeuron;
use crate::allowed::above_0;
use crate::{Result, problem};

/// `eta [S_d - S_o] [a + sum over earlier inputs of amplitude e^{-s/tau_w}]` (equation 2.10, summed over whole spikes).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resume {
    /// What every synapse gets, input or not.
    pub a: f64,
    /// Height of the learning window.
    pub amplitude: f64,
    /// Its time constant, ms; the membrane's where left out.
    pub tau_w: Option<f64>,
}

pub(super) struct ResumeRule {
    a: f64,
    amplitude: f64,
    tau_w: f64,
}

impl Resume {
    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<ResumeRule> {
        let tau_w = self.tau_w.unwrap_or(neuron.tau);
        above_0("tau_w", tau_w, "ms")?;
        above_0("amplitude", self.amplitude, "")?;
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

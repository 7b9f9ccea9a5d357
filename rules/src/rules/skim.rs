//! The parameters of SKIM, the synaptic kernel inverse method (Tapson et al. 2013, Frontiers in Neuroscience 7:153), and
//! its rows' number; Python computes the rest.

use serde::{Deserialize, Serialize};

use crate::checks::{check_ungraded, check_untargeted};
use taxel_core::allowed::Range;
use taxel_core::learn::{check_examples, check_some_target};
use taxel_core::neuron::{Kernel, MOST_LAID_OUT, Neuron, check_points, points_between};
use taxel_core::parameters::parameters;
use taxel_core::{Result, SpikeTrains, problem};

/// The nonlinearity of a branch, after its kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Nonlinearity {
    /// tanh.
    #[default]
    Tanh,
    /// None.
    None,
}

parameters! {
    /// Parameters of SKIM.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Skim {
        /// The kernel of a branch, which filters its inputs.
        pub kernel: Kernel = Kernel::Alpha;
        /// Its time constant, ms; that of Table 6.1.
        pub tau: f64 = 15.0, "ms", Range::ABOVE_0;
        /// Its second one, ms, where it has one; `tau / 4` where left out.
        pub tau_s: Option<f64> = None, "ms", Range::ABOVE_0, or tau_s;
        /// Time between rows, ms; 1 as the thesis samples.
        pub step_ms: f64 = 1.0, "ms", Range::ABOVE_0;
        /// How long the wanted output is 1 from a target on, ms; ten steps of 1 ms.
        pub pulse_ms: f64 = 10.0, "ms", Range::ABOVE_0;
        /// Added to the sum of squares, times the squares of the weights.
        pub ridge: f64 = 0.0, "", Range::FROM_0;
        /// How many branches the layer between has; without one every train is a branch of its own, its kernel not
        /// compressed.
        pub branches: Option<usize> = None, "", Range::within(1.0, 100_000.0);
        /// The layer's fixed weights are drawn evenly from minus this to this; none was published.
        pub spread: Option<f64> = None, "", Range::ABOVE_0;
        /// Its fixed delays are drawn evenly from 0 to this, ms; none was published.
        pub delay_ms: Option<f64> = None, "ms", Range::FROM_0;
        /// The nonlinearity after its kernels.
        pub nonlinearity: Nonlinearity = Nonlinearity::Tanh;
        /// The thresholds to choose from; those of 6.5.4.
        pub thresholds: Vec<f64> = vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], "", Range::FINITE;
        /// How far from a target an output spike may lie, ms; 50 as in 6.5.2.
        pub within_ms: f64 = 50.0, "ms", Range::ABOVE_0;
        /// The seed of weights and delays of the layer.
        pub seed: u64 = 0;
    }
}

impl Skim {
    fn tau_s(&self) -> f64 {
        self.tau_s.unwrap_or(0.25 * self.tau)
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.kernel == Kernel::DoubleExponential && self.tau_s() >= self.tau {
            return Err(problem!("tau_s"; " is {} ms: must be below tau, {} ms", self.tau_s(), self.tau));
        }
        if self.thresholds.is_empty() {
            return Err(problem!("thresholds"; ": must contain at least one"));
        }
        for (name, value) in [("spread", self.spread), ("delay_ms", self.delay_ms)] {
            if self.branches.is_some() && value.is_none() {
                return Err(problem!(name; ": none was published for a layer of branches; give one"));
            }
        }
        Ok(())
    }

    /// Checks patterns, with the targets of each where they are to be learnt; returns how many rows each has.
    ///
    /// # Errors
    ///
    /// `Problem` for parameters, patterns or targets that make no sense.
    pub fn rows(&self, patterns: &[SpikeTrains], targets: Option<&[Vec<f64>]>) -> Result<Vec<usize>> {
        self.check()?;
        if let Some(targets) = targets {
            check_examples(&Neuron { refractory: 0.0, ..Neuron::default() }, patterns, targets)?;
            check_some_target(targets)?;
        }
        let rows = |pattern: &SpikeTrains| {
            check_untargeted(pattern)?;
            check_ungraded(pattern, "skim")?;
            let points = points_between(pattern.start, pattern.stop, self.step_ms);
            check_points(points, MOST_LAID_OUT, self.step_ms)?;
            Ok(points as usize)
        };
        patterns.iter().map(rows).collect()
    }
}

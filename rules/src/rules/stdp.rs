//! Spike-timing-dependent plasticity: a neuron that finds a repeating pattern in its inputs without labels.
//!
//! After Masquelier, Guyonneau and Thorpe (2008), PLoS ONE 3:e1377. The neuron's potential since its last spike is
//!
//! `p = T (k1 exp(-s/tau_m) - k2 (exp(-s/tau_m) - exp(-s/tau_s))) + sum w K (exp(-u/tau_m) - exp(-u/tau_s))`,
//!
//! where s is the time since that spike, u the time since each later input spike, and K scales the effect of an input
//! to a maximum of its weight. The neuron fires when p rises to T. Both parts are sums of the same two exponentials, so
//! the state is two numbers, and crossings are found between inputs as well as at them. A spike at time t increases the
//! weight of each input whose last spike was d before t by `a_plus exp(-d/tau_plus)`; the first input spike d after t
//! decreases it by `a_minus exp(-d/tau_minus)`; weights stay between 0 and 1. Each pair of neighbours counts once, as
//! in the authors' program (according to Hathway and Goodman 2018, ReScience 4(1):6, who found that other pairings do
//! not learn).

use serde::{Deserialize, Serialize};

use super::crossing;
use crate::checks::check_ungraded;
use taxel_core::allowed::{Range, one_weight_a_train};
use taxel_core::parameters::parameters;
use taxel_core::{Result, SpikeTrains, Stop, problem};

parameters! {
    /// Parameters of the rule and its neuron; the defaults are the published ones, for about 2000 inputs of 64
    /// spikes/s.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Stdp {
        /// The threshold T, in units of weights.
        pub threshold: f64 = 500.0, "", Range::ABOVE_0;
        /// The membrane time constant, ms.
        pub tau_m: f64 = 10.0, "ms", Range::ABOVE_0;
        /// The synaptic time constant, ms.
        pub tau_s: f64 = 2.5, "ms", Range::ABOVE_0;
        /// Amplitude of the spike itself (the factor k1), in thresholds.
        pub k1: f64 = 2.0, "", Range::FROM_0;
        /// Amplitude of the after-potential (the factor k2), in thresholds.
        pub k2: f64 = 4.0, "", Range::FROM_0;
        /// The largest increase of a weight by one pair of spikes.
        pub a_plus: f64 = 0.03125, "", Range::within(0.0, 1.0);
        /// The largest decrease of a weight by one pair of spikes.
        pub a_minus: f64 = 0.85 * 0.03125, "", Range::within(0.0, 1.0);
        /// Time constant of increases, ms.
        pub tau_plus: f64 = 16.8, "ms", Range::ABOVE_0;
        /// Time constant of decreases, ms.
        pub tau_minus: f64 = 33.7, "ms", Range::ABOVE_0;
        /// The initial value of all weights.
        pub initial: f64 = 0.475, "", Range::within(0.0, 1.0);
    }
}

impl Stdp {
    /// Checks the range of every parameter, and that `tau_s` is below `tau_m`.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.tau_s >= self.tau_m {
            return Err(problem!("tau_s"; " is {} ms: must be below tau_m, {} ms", self.tau_s, self.tau_m));
        }
        Ok(())
    }

    /// The factor K, which scales the effect of one input of weight 1 to a maximum of 1.
    fn scale(&self) -> f64 {
        let ratio = self.tau_m / self.tau_s;
        let peak = ratio.ln() / (ratio - 1.0);
        1.0 / ((-peak).exp() - (-peak * ratio).exp())
    }
}

/// The state of the neuron in a stream of spikes.
#[derive(Debug, Clone)]
pub struct StdpNeuron {
    parameters: Stdp,
    scale: f64,
    weights: Vec<f64>,
    /// The last spike of each input, ms.
    last: Vec<f64>,
    /// The neuron's last spike, ms.
    fired: f64,
    /// The time of the state in `slow` and `fast`, ms.
    now: f64,
    /// The parts of the potential that decay with `tau_m` and with `tau_s`; the potential is their sum.
    slow: f64,
    fast: f64,
    /// Whether the potential has been below the threshold since the last spike.
    armed: bool,
}

impl StdpNeuron {
    /// A neuron at rest with all weights at their initial value.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter is not valid.
    pub fn new(parameters: &Stdp, trains: usize) -> Result<Self> {
        parameters.check()?;
        Ok(Self {
            scale: parameters.scale(),
            weights: vec![parameters.initial; trains],
            last: vec![f64::NEG_INFINITY; trains],
            fired: f64::NEG_INFINITY,
            now: f64::NEG_INFINITY,
            slow: 0.0,
            fast: 0.0,
            armed: true,
            parameters: parameters.clone(),
        })
    }

    /// The weights, one per train.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Sets the weights and resets the neuron to rest.
    ///
    /// # Errors
    ///
    /// `Problem` if the weights are not one per train, from 0 to 1.
    pub fn set_weights(&mut self, weights: &[f64]) -> Result<()> {
        one_weight_a_train(weights, self.weights.len())?;
        if let Some(n) = weights.iter().position(|w| !(0.0..=1.0).contains(w)) {
            return Err(problem!("weights"; "[{n}] is {}: must be from 0 to 1", weights[n]));
        }
        self.weights.copy_from_slice(weights);
        self.rest();
        Ok(())
    }

    /// Resets the state of the neuron; the weights stay.
    pub fn rest(&mut self) {
        self.last.fill(f64::NEG_INFINITY);
        (self.fired, self.now) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        (self.slow, self.fast, self.armed) = (0.0, 0.0, true);
    }

    /// Runs the neuron on the next piece of the stream; returns its spikes, ms. Without `learn` the weights do not
    /// change.
    ///
    /// # Errors
    ///
    /// `Problem` for another number of trains or a piece that begins before the previous one's end (nothing changes
    /// then), `Interrupted` if the caller stops it (the weights learnt so far remain).
    pub fn push(&mut self, piece: &SpikeTrains, learn: bool, stop: Stop<'_>) -> Result<Vec<f64>> {
        if piece.len() != self.weights.len() {
            return Err(problem!(
                "the piece has {} trains: must have {}, like the pieces before",
                piece.len(),
                self.weights.len()
            ));
        }
        check_ungraded(piece, "stdp")?;
        if piece.start < self.now {
            return Err(problem!("the piece begins at {} ms: must begin at {} ms or later", piece.start, self.now));
        }
        let spikes = piece.by_time(stop)?;
        let mut out = vec![];
        for (k, spike) in spikes.iter().enumerate() {
            if k % 4096 == 0 {
                stop.check()?;
            }
            self.advance(spike.t, learn, &mut out);
            self.add_input(spike.t, spike.train as usize, learn);
        }
        self.advance(piece.stop, learn, &mut out);
        Ok(out)
    }

    /// Advances to `t`, firing whenever the potential rises to the threshold.
    fn advance(&mut self, t: f64, learn: bool, out: &mut Vec<f64>) {
        let Stdp { threshold, tau_m, tau_s, .. } = self.parameters;
        loop {
            let since = if self.now.is_finite() { t - self.now } else { 0.0 };
            let (slow, fast) = (self.slow * (-since / tau_m).exp(), self.fast * (-since / tau_s).exp());
            if self.armed
                && let Some(at) = self.crossing(since, slow, fast)
            {
                self.fire(self.now + at, learn);
                out.push(self.fired);
                continue;
            }
            (self.slow, self.fast, self.now) = (slow, fast, t);
            self.armed |= slow + fast < threshold;
            return;
        }
    }

    /// The time from `now` to the crossing of the threshold, if there is one within `since`; `slow` and `fast` are the
    /// parts at the end of `since`. The potential is below the threshold now and has at most one extremum.
    #[inline]
    fn crossing(&self, since: f64, slow: f64, fast: f64) -> Option<f64> {
        let Stdp { threshold, tau_m, tau_s, .. } = self.parameters;
        let falls = |slow: f64, fast: f64| slow / tau_m + fast / tau_s >= 0.0;
        let mut until = since;
        if slow + fast < threshold {
            // Between two values below the threshold the potential can reach it only if it first rises and then falls.
            if falls(self.slow, self.fast) || !falls(slow, fast) {
                return None;
            }
            until = (-(self.fast * tau_m) / (self.slow * tau_s)).ln() * tau_m * tau_s / (tau_m - tau_s);
            if self.at(until) < threshold {
                return None;
            }
        }
        Some(crossing(until, |since| self.at(since) >= threshold))
    }

    /// The potential `since` ms after `now`.
    fn at(&self, since: f64) -> f64 {
        self.slow * (-since / self.parameters.tau_m).exp() + self.fast * (-since / self.parameters.tau_s).exp()
    }

    fn fire(&mut self, t: f64, learn: bool) {
        let Stdp { threshold, k1, k2, a_plus, tau_plus, .. } = self.parameters;
        if learn {
            for (weight, &last) in self.weights.iter_mut().zip(&self.last) {
                if last > self.fired {
                    *weight = (*weight + a_plus * ((last - t) / tau_plus).exp()).min(1.0);
                }
            }
        }
        (self.fired, self.now) = (t, t);
        (self.slow, self.fast) = (threshold * (k1 - k2), threshold * k2);
        self.armed = k1 < 1.0;
    }

    #[inline]
    fn add_input(&mut self, t: f64, train: usize, learn: bool) {
        let Stdp { a_minus, tau_minus, .. } = self.parameters;
        let weight = &mut self.weights[train];
        self.slow += *weight * self.scale;
        self.fast -= *weight * self.scale;
        if learn && self.fired.is_finite() && self.last[train] < self.fired {
            *weight = (*weight - a_minus * ((self.fired - t) / tau_minus).exp()).max(0.0);
        }
        self.last[train] = t;
    }
}

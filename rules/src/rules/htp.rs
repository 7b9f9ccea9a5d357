//! HTP, high threshold projection (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::epochs::{Correction, Presented, Rule};
use super::source::Source;
use super::stepped::{AfterSpike, Kernels, SteppedNeuron};
use taxel_core::Result;
use taxel_core::allowed::{Range, ranges};

/// Output spikes are forced at the targets, so resets are known and each demand is linear in the weights: the potential
/// reaches the threshold at every target, and stays below it at every other grid point, but for the last `window_ms`
/// before a target. A perceptron corrects violated demands: it raises where a target is missed, lowers at the peak of every
/// stretch above the threshold.
///
/// With `after_spike` "reset" and no window these are the rows of CONE-X without bounds and threshold recovery.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Htp {
    /// How long before a target the neuron may fire, ms.
    pub window_ms: f64,
}

/// The defaults of its source.
pub(super) const SOURCE: Source = Source {
    name: "htp",
    of_rule: &["window_ms"],
    ranges: &[Htp::RANGES],
    defaults: || json!({ "after_spike": "reset" }),
    arrange: |_| Ok(()),
};

pub(super) struct HtpRule {
    kernels: Kernels,
    window: f64,
    theta_0: f64,
    forgets: bool,
    tau: f64,
}

impl Htp {
    ranges! {
        window_ms: "ms", Range::FROM_0;
    }

    pub(super) fn rule(&self, neuron: &SteppedNeuron) -> Result<HtpRule> {
        self.check_ranges()?;
        neuron.check_linear("HTP")?;
        Ok(HtpRule {
            kernels: neuron.kernels(),
            window: self.window_ms,
            theta_0: neuron.theta_0,
            forgets: neuron.after_spike == AfterSpike::Reset,
            tau: neuron.tau,
        })
    }
}

impl HtpRule {
    /// The potential at `t`, given output spikes at the targets before it.
    fn potential(&self, presented: &Presented<'_>, weights: &[f64], t: f64) -> f64 {
        let earlier = || presented.targets.iter().copied().take_while(|&e| e < t);
        let after = self.after(presented, t);
        let drive: f64 = weights
            .iter()
            .enumerate()
            .map(|(n, w)| {
                let inputs = presented.trains.train(n).iter().filter(|&&s| s > after && s < t);
                w * inputs.map(|s| self.kernels.value(t - s)).sum::<f64>()
            })
            .sum();
        if self.forgets {
            return drive;
        }
        drive - earlier().map(|e| self.theta_0 * (-(t - e) / self.tau).exp()).sum::<f64>()
    }

    /// The time up to which inputs have no effect at `t`.
    fn after(&self, presented: &Presented<'_>, t: f64) -> f64 {
        let last = presented.targets.iter().copied().take_while(|&e| e < t).last();
        last.filter(|_| self.forgets).unwrap_or(f64::NEG_INFINITY)
    }
}

impl Rule for HtpRule {
    fn factor(&self, since: f64) -> f64 {
        self.kernels.value(since)
    }

    fn correct(&self, presented: &Presented<'_>, weights: &[f64], _: &[f64], out: &mut Vec<Correction>) {
        const ROUNDING: f64 = 1e-12;
        for (k, &t) in presented.targets.iter().enumerate() {
            if self.potential(presented, weights, t) < self.theta_0 * (1.0 - ROUNDING) {
                out.push(Correction { after: self.after(presented, t), ..Correction::at_target(k, t, 1.0) });
            }
        }
        let mut next = 0;
        let mut peak: Option<(f64, f64)> = None;
        let lower = |peak: &mut Option<(f64, f64)>, out: &mut Vec<Correction>| {
            if let Some((t, _)) = peak.take() {
                out.push(Correction { after: self.after(presented, t), ..Correction::new(t, -1.0) });
            }
        };
        presented.neuron.run_forced(weights, presented.laid, presented.targets, |t, v| {
            while next < presented.targets.len() && presented.targets[next] < t {
                next += 1;
                lower(&mut peak, out);
            }
            let free = presented.targets.get(next).is_some_and(|&target| t >= target - self.window);
            if v < self.theta_0 || free {
                lower(&mut peak, out);
            } else if peak.is_none_or(|(_, highest)| v > highest) {
                peak = Some((t, v));
            }
        });
        lower(&mut peak, out);
    }
}

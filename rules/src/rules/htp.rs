//! HTP, high threshold projection (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use super::corrections::{Correction, Presented};
use super::stepped::Kernels;

/// Output spikes are forced at the targets, so resets are known and each demand is linear in the weights: the potential
/// reaches the threshold at every target, and stays below it at every other grid point, but for the last `window`
/// before a target. A perceptron corrects violated demands: it raises where a target is missed, lowers at the peak of every
/// stretch above the threshold.
///
/// With `after_spike` "reset" and no window these are the rows of CONE-X without bounds and threshold recovery.
pub(super) struct Htp {
    pub(super) kernels: Kernels,
    /// How long before a target the neuron may fire, ms.
    pub(super) window: f64,
    pub(super) theta_0: f64,
    pub(super) tau: f64,
    /// Whether an output spike discards all inputs before it.
    pub(super) forgets: bool,
}

impl Htp {
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

    pub(super) fn correct(&self, presented: &Presented<'_>, weights: &[f64], out: &mut Vec<Correction>) {
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

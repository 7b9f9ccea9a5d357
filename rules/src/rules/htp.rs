//! HTP, high threshold projection (Memmesheimer, Rubin, Ölveczky and Sompolinsky 2014, Neuron 82:925).

use super::corrections::{Correction, Presented};
use super::stepped::AfterSpike;

/// Output spikes are forced at the targets, so resets are known and each demand is linear in the weights: the potential
/// reaches the threshold at every target, and stays below it at every other grid point, but for the last `window` (ms)
/// before a target. A perceptron corrects violated demands: it raises where a target is missed, lowers at the peak of every
/// stretch above the threshold.
///
/// With `after_spike` "reset" and no window these are the rows of CONE-X without bounds and threshold recovery.
///
/// `drive` is the potential at a time, given weights and inputs after another time alone.
pub(super) fn correct(
    drive: impl Fn(f64, f64) -> f64,
    presented: &Presented<'_>,
    weights: &[f64],
    window: f64,
    out: &mut Vec<Correction>,
) {
    const ROUNDING: f64 = 1e-12;
    let (targets, theta_0) = (presented.targets, presented.neuron.theta_0);
    for (k, &t) in targets.iter().enumerate() {
        if potential(&drive, presented, t) < theta_0 * (1.0 - ROUNDING) {
            out.push(Correction { after: presented.lost_up_to(targets, t), ..Correction::at_target(k, t, 1.0) });
        }
    }
    let mut next = 0;
    let mut peak: Option<(f64, f64)> = None;
    let lower = |peak: &mut Option<(f64, f64)>, out: &mut Vec<Correction>| {
        if let Some((t, _)) = peak.take() {
            out.push(Correction { after: presented.lost_up_to(targets, t), ..Correction::new(t, -1.0) });
        }
    };
    presented.neuron.run_forced(weights, presented.laid, targets, |t, v| {
        while next < targets.len() && targets[next] < t {
            next += 1;
            lower(&mut peak, out);
        }
        let free = targets.get(next).is_some_and(|&target| t >= target - window);
        if v < theta_0 || free {
            lower(&mut peak, out);
        } else if peak.is_none_or(|(_, highest)| v > highest) {
            peak = Some((t, v));
        }
    });
    lower(&mut peak, out);
}

/// The potential at `t`, given output spikes at the targets before it.
fn potential(drive: impl Fn(f64, f64) -> f64, presented: &Presented<'_>, t: f64) -> f64 {
    let Presented { neuron, targets, .. } = presented;
    let drive = drive(t, presented.lost_up_to(targets, t));
    if neuron.after_spike == AfterSpike::Reset {
        return drive;
    }
    let earlier = targets.iter().take_while(|&&e| e < t);
    drive - earlier.map(|e| neuron.theta_0 * (-(t - e) / neuron.kernels.tau).exp()).sum::<f64>()
}

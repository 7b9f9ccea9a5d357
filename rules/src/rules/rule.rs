//! The rules that learn spike times by epochs, ready to compute.

use super::corrections::{Correction, Presented};
use super::stepped::{Kernels, SteppedNeuron};
use super::{chronotron, fp, htp};
use taxel_core::{Result, SpikeTrains, Stop};

/// A rule with its constants.
///
/// Most are in the form of Widrow and Hoff: `eta [sum over targets of factor - sum over output spikes of factor]`.
pub(super) enum Rule {
    /// INST, instantaneous differences of spikes (Gardner and Grüning 2016, PLoS ONE 11(8) e0161335): the factor is the
    /// potential that an input makes.
    Inst(Kernels),
    /// FILT (the same paper): both spike trains are filtered by `e^{-s/tau_q}`. An input counts by
    /// `eps_0 (c_m e^{-s/tau} - c_s e^{-s/tau_s})`, with `c = tau / (tau + tau_q)`, before a spike, and by
    /// `eps_0 (c_m - c_s) e^{s/tau_q}` after it.
    Filt { kernels: Kernels, tau_q: f64 },
    /// The Chronotron's E-learning (Florian 2012, PLoS ONE 7(8) e40233).
    ELearning { kernels: Kernels, tau_q: f64, gamma_r: f64 },
    /// Its I-learning: the factor is the synaptic current, with the sign of the weight.
    ILearning(Kernels),
    /// ReSuMe, the remote supervised method (Ponulak and Kasiński 2010, Neural Computation 22:467):
    /// `eta [S_d - S_o] [a + sum over earlier inputs of amplitude e^{-s/tau_w}]` (equation 2.10, summed over whole spikes).
    Resume { a: f64, amplitude: f64, tau_w: f64 },
    /// SPAN, the spike pattern association neuron (Mohemmed et al. 2012, Int J Neural Syst 22:1250012): Widrow-Hoff on
    /// inputs, targets and outputs that are all filtered by `(e / tau_a) s e^{-s/tau_a}`: `eta` times the integral of
    /// `x_i (y_d - y_o)`, in closed form `(e/2)^2 [sum over targets of (|s| + tau_a) e^{-|s|/tau_a} - the same over output
    /// spikes]`. Inputs after a spike count.
    Span { tau_a: f64 },
    /// PSD, precise-spike-driven plasticity (Yu, Tang, Tan and Li 2013, PLoS ONE 8(11) e78318): the factor is the *current*
    /// `V0 (e^{-s/tau_1} - e^{-s/tau_2})`, peak 1, which the membrane filters once more.
    Psd(Kernels),
    /// FP-learning; `window` is how far from its target a spike may lie, ms.
    Fp { kernels: Kernels, window: f64 },
    /// HTP; `window` is how long before a target the neuron may fire, ms.
    Htp { kernels: Kernels, window: f64 },
}

impl Rule {
    /// The contribution of an input `since` ms before the spike (below 0: after it).
    #[inline]
    pub(super) fn factor(&self, since: f64) -> f64 {
        match *self {
            Self::Inst(kernels)
            | Self::ELearning { kernels, .. }
            | Self::Fp { kernels, .. }
            | Self::Htp { kernels, .. } => kernels.value(since),
            Self::ILearning(kernels) | Self::Psd(kernels) => kernels.current(since),
            Self::Filt { kernels: Kernels { slow: tau, fast: tau_s, peak, .. }, tau_q } => {
                let (c_m, c_s) = (tau / (tau + tau_q), tau_s / (tau_s + tau_q));
                peak * if since > 0.0 {
                    c_m * (-since / tau).exp() - c_s * (-since / tau_s).exp()
                } else {
                    (c_m - c_s) * (since / tau_q).exp()
                }
            }
            Self::Resume { amplitude, tau_w, .. } if since > 0.0 => amplitude * (-since / tau_w).exp(),
            Self::Resume { .. } => 0.0,
            Self::Span { tau_a } => {
                let (apart, half_e) = (since.abs(), std::f64::consts::E / 2.0);
                half_e * half_e * (apart + tau_a) * (-apart / tau_a).exp()
            }
        }
    }

    /// The contribution of each synapse to a spike at `t`, by its inputs after `lost_up_to`.
    pub(super) fn factors<'a>(
        &'a self,
        trains: &'a SpikeTrains,
        t: f64,
        lost_up_to: f64,
    ) -> impl Iterator<Item = f64> + 'a {
        // What every synapse gets, with or without an input.
        let constant = if let Self::Resume { a, .. } = self { *a } else { 0.0 };
        (0..trains.len()).map(move |n| {
            let inputs = trains.train(n).iter().filter(|&&input| input > lost_up_to);
            constant + inputs.map(|input| self.factor(t - input)).sum::<f64>()
        })
    }

    /// Whether a synapse's change has the sign of its weight.
    pub(super) fn by_sign(&self) -> bool {
        matches!(self, Self::ILearning(_))
    }

    /// How weights shall change after a presentation in which these spikes were fired (ms, ascending).
    pub(super) fn correct(&self, presented: &Presented<'_>, weights: &[f64], fired: &[f64], out: &mut Vec<Correction>) {
        match self {
            Self::ELearning { tau_q, gamma_r, .. } => {
                chronotron::correct(presented.targets, fired, *tau_q, *gamma_r, out);
            }
            Self::Fp { window, .. } => fp::correct(presented, fired, *window, out),
            Self::Htp { window, .. } => {
                let drive = |t: f64, lost_up_to: f64| -> f64 {
                    weights
                        .iter()
                        .zip(self.factors(presented.trains, t, lost_up_to))
                        .map(|(w, factor)| w * factor)
                        .sum()
                };
                htp::correct(drive, presented, weights, *window, out);
            }
            _ => {
                out.extend(presented.targets.iter().enumerate().map(|(k, &t)| Correction::at_target(k, t, 1.0)));
                out.extend(fired.iter().map(|&t| Correction::new(t, -1.0)));
            }
        }
    }

    /// The learning rate of Gardner and Grüning, for `trains` synapses and `targets` targets in all.
    pub(super) fn published_eta(&self, trains: usize, targets: usize) -> Option<f64> {
        self.is_of_gardner().then(|| 600.0 / (trains as f64 * targets as f64))
    }

    /// Their range of first weights, mV.
    pub(super) fn published_initial(&self, trains: usize) -> Option<[f64; 2]> {
        self.is_of_gardner().then(|| [0.0, 200.0 / trains as f64])
    }

    fn is_of_gardner(&self) -> bool {
        matches!(self, Self::Inst(_) | Self::Filt { .. })
    }
}

/// The change of weights by one presentation, over the learning rate, and the output spikes in it.
pub(super) fn change_of(
    rule: &Rule,
    neuron: &SteppedNeuron,
    weights: &[f64],
    pattern: &SpikeTrains,
    targets: &[f64],
) -> Result<(Vec<f64>, Vec<f64>)> {
    let laid = neuron.lay_out(pattern, Stop::never())?;
    let presented = Presented { neuron, laid: &laid, trains: pattern, targets };
    let (mut fired, mut corrections, mut change) = (Vec::new(), Vec::new(), vec![0.0; weights.len()]);
    neuron.fire(weights, &laid, &mut fired);
    rule.correct(&presented, weights, &fired, &mut corrections);
    add_up(rule, &presented, weights, &corrections, &mut vec![None; targets.len()], &mut change);
    Ok((change, fired))
}

/// Sums corrections, synapse by synapse. Factors at targets are computed once.
pub(super) fn add_up(
    rule: &Rule,
    presented: &Presented<'_>,
    weights: &[f64],
    corrections: &[Correction],
    at_targets: &mut [Option<Vec<f64>>],
    change: &mut [f64],
) {
    for c in corrections {
        let mut here = None;
        let factors = c.target.map_or(&mut here, |k| &mut at_targets[k]);
        let factors = factors.get_or_insert_with(|| rule.factors(presented.trains, c.t, c.after).collect());
        for ((change, factor), weight) in change.iter_mut().zip(factors).zip(weights) {
            let value = c.amount * *factor;
            *change += if rule.by_sign() && *weight < 0.0 { -value } else { value };
        }
    }
}

//! SA-1: the slowly adapting afferent with small fields, whose rate follows the force while a taxel is pressed.

use super::slowly_adapting::slowly_adapting;

slowly_adapting! {
    /// The SA-1 afferent (Merkel): fires while pressed, fastest at the onset, with a rate that decreases during a hold.
    /// `u = lowpass((1 + onset) x - onset y - loss z)`, where x is the pressure as a fraction of `range`, and y and z
    /// are x filtered by low passes with `onset_ms` and `loss_ms`. A spike is emitted when `u` reaches `threshold + a`;
    /// it raises `a` by `jump`, and `a` decays. The rate therefore grows linearly with pressure (Vega-Bermudez and
    /// Johnson 1999, J. Neurophysiol. 81:2701); the threshold is that of Kobayashi, Tsubota and Shinomoto (2009, Front.
    /// Comput. Neurosci. 3:9). `onset_ms` is the slower constant of inactivation in the generator of Gerling et al.
    /// (2018, PLoS Comput. Biol. 14:e1006264, figure 2); `refractory_ms` is that of Kobayashi et al. We fitted the
    /// others: `loss` to a rate that falls by 38 % in the first 12 s of a hold (Burgess et al. 1983, J. Neurosci.
    /// 3:2652, 21 fibres); `onset`, `membrane_ms` and `recovery_ms` so that the amplitude for one spike per cycle is
    /// least near 5 Hz; `jump` to some 200 spikes/s when half of the range is newly pressed; `threshold` to exceed
    /// noise of 3 ticks in 150. Pressure below 0 counts as 0. One unsigned train per taxel, at most one spike per
    /// sample. The initial state is that of a constant input equal to the first sample.
    Sa1, threshold: 0.04, onset: 1.0, loss: 0.5
}

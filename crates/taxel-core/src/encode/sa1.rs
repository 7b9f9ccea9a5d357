//! SA-1: the slowly adapting afferent of small fields, whose rate follows the force as long as a taxel is pressed.

use super::slow::slowly_adapting;

slowly_adapting! {
    /// The SA-1 afferent (Merkel): fires while pressed, fastest when pressed anew, ever more slowly as it lasts.
    ///
    /// `u = lowpass((1 + onset) x - onset y - loss z)`, x the pressure as a share of `range`, y and z low passes of it of
    /// `onset_ms` and `loss_ms`; a spike where `u` reaches `threshold + a`, which it raises by `jump` and which decays: so a
    /// rate that grows in a straight line with pressure (Vega-Bermudez and Johnson 1999, J. Neurophysiol. 81:2701), from a
    /// threshold as Kobayashi, Tsubota and Shinomoto (2009, Front. Comput. Neurosci. 3:9) have it. `onset_ms` is the slower
    /// constant of inactivation in the generator of Gerling et al. (2018, PLoS Comput. Biol. 14:e1006264, figure 2);
    /// `refractory_ms` that of Kobayashi et al. The others are fitted by us: `loss` to a rate that falls by 38 %
    /// in the first 12 s of holding (Burgess et al. 1983, J. Neurosci. 3:2652, 21 fibres); `onset`, `membrane_ms` and
    /// `recovery_ms` to a threshold of one spike a cycle that is least near 5 Hz; `jump` to some 200 spikes/s where half
    /// of the range is newly pressed; `threshold` to what stands out of a noise of 3 ticks in 150. Pressure below 0
    /// counts as 0. One unsigned train a taxel, at most one spike a sample. Begins as if the first sample had always been.
    Sa1, threshold: 0.04, onset: 1.0, loss: 0.5
}

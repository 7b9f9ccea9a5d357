//! SA-2: the slowly adapting afferent of large fields, which fires steadily under a held load.

use super::slow::slowly_adapting;

slowly_adapting! {
    /// The SA-2 afferent (Ruffini): less sensitive than SA-1, steadier, and hardly faster when pressed anew.
    ///
    /// It feels the stretch of skin above all, and an array of pressure has none to give: what is here is its answer to
    /// load. Filter and threshold are SA-1's. It is four times less sensitive (Table 1 of Weiss et al. 2009,
    /// J. Neurophysiol. 101:1033); that it answers more steadily and with less of an onset than SA-1 (Johansson and Vallbo
    /// 1983, Trends Neurosci. 6:27) has no number there: `onset` and `loss` are half of SA-1's and less, our choice.
    /// One unsigned train a taxel.
    Sa2, threshold: 0.16, onset: 0.25, loss: 0.2
}

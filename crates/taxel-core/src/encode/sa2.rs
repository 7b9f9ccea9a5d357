//! SA-2: the slowly adapting afferent with large fields, which fires steadily under a constant load.

use super::slowly_adapting::slowly_adapting;

slowly_adapting! {
    /// The SA-2 afferent (Ruffini): less sensitive than SA-1, with a steadier rate and a small onset response.
    ///
    /// SA-2 responds mainly to stretch of the skin, which an array of pressure sensors does not measure: this model is
    /// its response to load. Filter and threshold are those of SA-1. It is four times less sensitive (Table 1 of Weiss
    /// et al. 2009, J. Neurophysiol. 101:1033). Johansson and Vallbo (1983, Trends Neurosci. 6:27) describe a steadier
    /// response with less of an onset than SA-1's, without numbers: `onset` and `loss` are half of SA-1's or less, our
    /// choice. One unsigned train per taxel.
    Sa2, threshold: 0.16, onset: 0.25, loss: 0.2
}

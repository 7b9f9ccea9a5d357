//! How far rounding may move a time.

/// Rounding of a time that is the sum of others, on the very edge of a refractory time, ms, and in neighbouring numbers: from
/// some 20 minutes on these lie farther apart.
const ROUNDING_MS: f64 = 1e-9;
const ROUNDINGS: f64 = 4.0;

/// How far apart two sums of times may lie at `t` and count as equal, ms.
pub(crate) fn rounding_ms(t: f64) -> f64 {
    (ROUNDINGS * f64::EPSILON * t.abs()).max(ROUNDING_MS)
}

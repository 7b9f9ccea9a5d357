//! The rounding of times.

/// Rounding of a time that is the sum of others, ms, and in distances of neighbouring numbers: from some 20 minutes on the
/// latter is larger.
const ROUNDING_MS: f64 = 1e-9;
const ROUNDINGS: f64 = 4.0;

/// The distance up to which two sums of times near `t` count as equal, ms.
pub(crate) fn rounding_ms(t: f64) -> f64 {
    (ROUNDINGS * f64::EPSILON * t.abs()).max(ROUNDING_MS)
}

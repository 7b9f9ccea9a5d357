//! The rounding error of times.

/// The rounding error allowed for a sum of times: an absolute one, ms, and one in units of the last place, which is the
/// larger from about 20 minutes on.
const ROUNDING_MS: f64 = 1e-9;
const ROUNDINGS: f64 = 4.0;

/// The distance up to which two sums of times near `t` count as equal, ms.
pub(crate) fn rounding_ms(t: f64) -> f64 {
    (ROUNDINGS * f64::EPSILON * t.abs()).max(ROUNDING_MS)
}

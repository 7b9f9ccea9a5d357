//! Length of a silence, by the host's clock.

/// A year, us: bounds a silence, so that no arrival time can overflow a board's 64-bit clock.
const LONGEST: i64 = 365 * 86_400 * 1_000_000;

/// Time between two arrivals, us; 0 if the host's clock stepped back.
pub(in crate::wire) fn silence(before: i64, now: i64) -> i64 {
    now.saturating_sub(before).clamp(0, LONGEST)
}

//! How long nothing came, by the host's clock.

/// A year, us: no time of arrival can carry a board's clock out of its 64 bits.
const LONGEST: i64 = 365 * 86_400 * 1_000_000;

/// From one arrival to the next, us; a host's clock that stepped back passed no time.
pub(in crate::wire) fn silence(before: i64, now: i64) -> i64 {
    now.saturating_sub(before).clamp(0, LONGEST)
}

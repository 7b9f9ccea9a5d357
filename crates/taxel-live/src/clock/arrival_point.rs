//! The earliest arrivals, of which a clock's line and its delays are made.

/// Board time in us, and arrival minus board time in ns.
pub(super) type ArrivalPoint = (i64, i64);

/// Number of stretches from which the line is fitted: 64 s, within which the rate of a quartz is constant.
pub(super) const STRETCHES: usize = 256;
/// Duration beyond which a slope larger than that of a quartz is accepted, us.
pub(super) const LONG_US: i64 = 10_000_000;

//! Converts times in ms, as encoders' parameters have them, to whole us.

use crate::Result;
use crate::allowed::{Parameter, Range};
use crate::spikes::us;

/// Converts a time in ms to us; it must be a whole number of us.
pub(super) fn micros(name: &'static str, ms: f64) -> Result<i64> {
    Parameter { name, unit: "ms", range: Range::WHOLE_US }.check(&ms)?;
    Ok(us(ms).round() as i64)
}

/// The step of the wire's stamps, ms (wire.md, section 1).
pub(super) fn stamp_period() -> f64 {
    0.1
}

//! The instants at which weights violate silence.

use super::rows::Row;

/// The worst instant of an interval in which silence is violated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SilencePeak {
    pub(crate) pattern: usize,
    /// The time, ms.
    pub(crate) t: f64,
    /// The potential plus the share of the margin, minus the threshold, mV.
    pub(crate) excess: f64,
}

impl SilencePeak {
    pub(crate) fn row(&self) -> Row {
        Row::Silence { pattern: self.pattern, t: self.t }
    }
}

/// Whether `x` is above the limit, or NaN.
pub(crate) fn exceeds(x: f64, limit: f64) -> bool {
    x > limit || x.is_nan()
}

/// The largest value; NaN if any value is NaN.
pub(crate) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, |most, x| if x <= most || most.is_nan() { most } else { x })
}

//! Where silence is broken.

use super::rows::Row;

/// The worst instant of a stretch in which silence is broken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    pub(crate) pattern: usize,
    /// ms.
    pub(crate) t: f64,
    /// Potential less threshold plus the share of the margin, mV.
    pub(crate) excess: f64,
}

impl Peak {
    pub(crate) fn row(&self) -> Row {
        Row::Silence { pattern: self.pattern, t: self.t }
    }
}

/// Whether `x` lies above, or is no number: that is never fine.
pub(crate) fn exceeds(x: f64, limit: f64) -> bool {
    x > limit || x.is_nan()
}

/// The largest value, or no number where one is none.
pub(crate) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, |most, x| if x <= most || most.is_nan() { most } else { x })
}

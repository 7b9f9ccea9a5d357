//! The load where no rest is known: the sum of what channels read in parts of their running ranges.

use super::blocks::blocks;
use super::driver::Sample;
use super::running_range::{RunningRange, SampleWindow};
use crate::Result;

/// Computes the load by running range from the values of all channels.
#[derive(Clone)]
pub(super) struct RangeLoad {
    window: SampleWindow,
    /// Low and high of each channel; none in the first window.
    ranges: Vec<(f64, f64)>,
    channels: usize,
}

impl RangeLoad {
    /// Starts with no range known.
    pub(super) fn new(channels: usize) -> Result<Self> {
        let window = SampleWindow::new(&RunningRange::default(), blocks(channels))?;
        Ok(Self { window, ranges: vec![], channels })
    }

    /// Reads the values of all channels; returns the load, NaN before the end of the first window.
    pub(super) fn take(&mut self, now: Sample<'_>) -> f64 {
        if let Some(first) = self.window.first_full(now.t) {
            self.ranges = first.ranges;
        }
        if let Some(ranges) = self.window.renew(now.t) {
            self.ranges = ranges;
        }
        self.window.take(now.t, now.held);
        if self.ranges.is_empty() {
            return f64::NAN;
        }
        let shares = self.ranges[..self.channels].iter().zip(now.held.as_flattened());
        let shares = shares.filter(|((low, high), _)| high > low);
        shares.map(|(&(low, high), &value)| ((f64::from(value) - low) / (high - low)).max(0.0)).sum()
    }
}

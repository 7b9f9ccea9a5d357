//! The running range of a channel: percentiles of a past window, updated periodically.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block};
use super::periods::micros;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::{Result, problem};

parameters! {
    /// Levels as fractions of a channel's running range, y = (x - low) / (high - low), which compensates drift and
    /// unknown gain.
    ///
    /// `low` and `high` are percentiles (linear between ranks) of the samples in the window that ends, exclusive, at
    /// the last update. Updates take place at the time of the first sample plus the window plus multiples of `renew_s`.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct RunningRange {
        /// The percentile that maps to 0, from 0; default 10.
        pub low: f64 = 10.0, "%", Range::within(0.0, 100.0);
        /// The percentile that maps to 1, to 100; default 95.
        pub high: f64 = 95.0, "%", Range::within(0.0, 100.0);
        /// Length of the window, s; default 10.
        pub window_s: f64 = 10.0, "s", Range::WHOLE_US_IN_S;
        /// Interval between updates of the percentiles, s; default 1.
        pub renew_s: f64 = 1.0, "s", Range::WHOLE_US_IN_S;
        /// How samples before the end of the first window are treated.
        pub first_window: FirstWindow = FirstWindow::default();
    }
}

/// How a running range treats the samples before the end of its first window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstWindow {
    /// Emits nothing; the encoder starts with the first sample after the window, without a crossing.
    #[default]
    Silent,
    /// Encodes the window by its own percentiles once it is complete: for recordings, because spikes are late by up to
    /// the window.
    Itself,
}

impl RunningRange {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what is valid.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.low >= self.high {
            let (low, high) = (self.low, self.high);
            return Err(problem!("running_range from {low} to {high}: must ascend within 0 to 100 percent"));
        }
        Ok(())
    }
}

/// The samples of the last window, and the time of the next update.
#[derive(Clone)]
pub(super) struct SampleWindow {
    low: f64,
    high: f64,
    length: i64,
    renew: i64,
    replay: bool,
    samples: VecDeque<(i64, Vec<Block>)>,
    /// When the percentiles are next computed; `None` before the first sample.
    next: Option<i64>,
    full: bool,
    blocks: usize,
}

/// The first window, once it is complete.
#[derive(Clone)]
pub(super) struct First {
    /// Low and high of each channel.
    pub(super) ranges: Vec<(f64, f64)>,
    /// The window's samples, if they are to be encoded by its own percentiles.
    pub(super) samples: Vec<(i64, Vec<Block>)>,
}

impl SampleWindow {
    pub(super) fn new(range: &RunningRange, blocks: usize) -> Result<Self> {
        Ok(Self {
            low: range.low,
            high: range.high,
            length: micros("running_range window_s", range.window_s * 1000.0)?,
            renew: micros("running_range renew_s", range.renew_s * 1000.0)?,
            replay: range.first_window == FirstWindow::Itself,
            samples: VecDeque::new(),
            next: None,
            full: false,
            blocks,
        })
    }

    pub(super) fn is_full(&self) -> bool {
        self.full
    }

    /// Adds a sample to the window, after it was encoded.
    pub(super) fn take(&mut self, t: i64, held: &[Block]) {
        self.next.get_or_insert(t + self.length);
        self.samples.push_back((t, held.to_vec()));
    }

    /// The first window, if the sample at `t` is the first after it.
    pub(super) fn first_full(&mut self, t: i64) -> Option<First> {
        let end = self.next.filter(|&end| !self.full && t >= end)?;
        self.full = true;
        let samples = if self.replay { self.samples.iter().cloned().collect() } else { vec![] };
        self.next = Some(end + self.renew);
        Some(First { ranges: self.percentiles(), samples })
    }

    /// The new low and high of each channel, if an update was due by `t` and its window is not empty.
    pub(super) fn renew(&mut self, t: i64) -> Option<Vec<(f64, f64)>> {
        let due = self.next.filter(|&due| self.full && t >= due)?;
        let latest = due + (t - due) / self.renew * self.renew;
        self.next = Some(latest + self.renew);
        while self.samples.front().is_some_and(|s| s.0 < latest - self.length) {
            self.samples.pop_front();
        }
        (!self.samples.is_empty()).then(|| self.percentiles())
    }

    fn percentiles(&self) -> Vec<(f64, f64)> {
        let mut values = Vec::with_capacity(self.samples.len());
        let mut ranges = Vec::with_capacity(self.blocks * BLOCK);
        for channel in 0..self.blocks * BLOCK {
            values.clear();
            values.extend(self.samples.iter().map(|s| s.1[channel / BLOCK][channel % BLOCK]));
            ranges.push((percentile(&mut values, self.low), percentile(&mut values, self.high)));
        }
        ranges
    }
}

/// The percentile of values, linear between ranks (Hyndman and Fan's 7th, NumPy's default).
fn percentile(values: &mut [f32], percent: f64) -> f64 {
    let rank = percent / 100.0 * (values.len() - 1) as f64;
    let (_, below, above) = values.select_nth_unstable_by(rank as usize, f32::total_cmp);
    let below = f64::from(*below);
    match above.iter().copied().min_by(f32::total_cmp) {
        Some(next) => below + (f64::from(next) - below) * rank.fract(),
        None => below,
    }
}

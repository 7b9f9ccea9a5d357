//! The same levels at each channel, with the interval of values that crosses none, so that most samples need one
//! comparison a channel.

use super::blocks::{BLOCK, Block, blocks};
use super::driver::Sample;
use super::levels::{Level, Levels};
use crate::{Result, Spike, problem};

/// Levels of each channel, `channel * levels + level`.
#[derive(Clone)]
pub(super) struct ChannelLevels {
    channels: usize,
    /// The number of levels of a channel.
    each: usize,
    pub(super) levels: Levels,
    /// For each channel the values `low <= value < high` that cross no level.
    low: Vec<Block>,
    high: Vec<Block>,
}

impl ChannelLevels {
    /// Levels of so many channels, with the minimum duration and the period of tonic spikes, us. Their numbers are those
    /// of signed trains; `tonic` is the level whose tonic spikes each channel has in a further train.
    pub(super) fn new(channels: usize, levels: &[(f64, f64)], hold: i64, interval: i64, tonic: Option<usize>) -> Self {
        let (each, blocks) = (levels.len(), blocks(channels));
        let level = |k: usize| {
            let (rise, fall) = levels[k % each];
            let tonic = tonic.filter(|&tonic| tonic == k % each).map(|_| channels * each + k / each);
            Level::new(f64::from(rise as f32), f64::from(fall as f32), [k, k], tonic)
        };
        Self {
            channels,
            each,
            levels: Levels::new((0..channels * each).map(level).collect(), hold, interval),
            low: vec![[f32::NEG_INFINITY; BLOCK]; blocks],
            high: vec![[f32::INFINITY; BLOCK]; blocks],
        }
    }

    /// The number of channels.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// Moves the levels of a channel, each with its release.
    pub(super) fn place(&mut self, channel: usize, levels: impl Iterator<Item = (f64, f64)>) {
        for (k, (rise, fall)) in levels.enumerate() {
            self.levels.place(channel * self.each + k, f64::from(rise as f32), f64::from(fall as f32));
        }
        self.set_bracket(channel);
    }

    /// Begins with the values of all channels.
    pub(super) fn settle(&mut self, t: i64, held: &[Block], out: &mut Vec<Spike>) {
        for channel in 0..self.channels {
            let value = f64::from(held[channel / BLOCK][channel % BLOCK]);
            self.levels.settle(t, channel * self.each..(channel + 1) * self.each, |_| value, out);
            self.set_bracket(channel);
        }
    }

    /// Reads the values of the blocks that changed, all of them if `everything` did.
    #[inline(always)]
    pub(super) fn take(&mut self, now: Sample<'_>, everything: bool, out: &mut Vec<Spike>) {
        self.levels.report_trials(now.t, true, out);
        for (block, values) in now.held.iter().enumerate() {
            if (everything || now.changed[block]) && self.has_left(block, values) {
                for channel in block * BLOCK..self.channels.min((block + 1) * BLOCK) {
                    let lane = channel % BLOCK;
                    if !(self.low[block][lane] <= values[lane] && values[lane] < self.high[block][lane]) {
                        let value = f64::from(values[lane]);
                        self.levels.take(now.t, channel * self.each..(channel + 1) * self.each, |_| value, out);
                        self.set_bracket(channel);
                    }
                }
            }
        }
        self.levels.pass(now.t, true, out);
    }

    fn set_bracket(&mut self, channel: usize) {
        let (low, high) = self.levels.bracket(channel * self.each..(channel + 1) * self.each);
        self.low[channel / BLOCK][channel % BLOCK] = low as f32;
        self.high[channel / BLOCK][channel % BLOCK] = high as f32;
    }

    /// Whether the value of any channel in a block is outside its bracket.
    #[inline(always)]
    fn has_left(&self, block: usize, values: &Block) -> bool {
        let (low, high) = (&self.low[block], &self.high[block]);
        let mut left = 0_u32;
        for lane in 0..BLOCK {
            left |= u32::from((values[lane] < low[lane]) | (values[lane] >= high[lane]));
        }
        left != 0
    }
}

/// Checks that levels ascend.
pub(super) fn check_levels(levels: &[f64]) -> Result<()> {
    if levels.is_empty() {
        return Err(problem!("levels"; " is empty: must contain one level or more"));
    }
    if let Some(level) = levels.iter().find(|l| !(l.is_finite() && l.abs() <= f64::from(f32::MAX))) {
        return Err(problem!("levels"; " contain {level}: must be finite"));
    }
    match levels.windows(2).find(|w| w[1] as f32 <= w[0] as f32) {
        Some(w) => Err(problem!("levels"; ": {} comes after {}; must ascend", w[1], w[0])),
        None => Ok(()),
    }
}

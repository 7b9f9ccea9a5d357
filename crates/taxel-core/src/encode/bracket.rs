//! Brackets: for each channel the interval of values that crosses no level, so that most samples need one comparison.

use super::blocks::{BLOCK, Block};
use crate::{Result, problem};

/// For each channel the values `low <= value < high` that cross no level.
#[derive(Clone)]
pub(super) struct Bracket {
    low: Vec<Block>,
    high: Vec<Block>,
}

impl Bracket {
    /// Brackets that contain every value.
    pub(super) fn new(blocks: usize) -> Self {
        Self { low: vec![[f32::NEG_INFINITY; BLOCK]; blocks], high: vec![[f32::INFINITY; BLOCK]; blocks] }
    }

    pub(super) fn set(&mut self, channel: usize, low: f32, high: f32) {
        self.low[channel / BLOCK][channel % BLOCK] = low;
        self.high[channel / BLOCK][channel % BLOCK] = high;
    }

    /// Whether the value of any channel in this block is outside its bracket.
    #[inline(always)]
    pub(super) fn has_left(&self, block: usize, values: &Block) -> bool {
        let (low, high) = (&self.low[block], &self.high[block]);
        let mut left = 0_u32;
        for lane in 0..BLOCK {
            left |= u32::from((values[lane] < low[lane]) | (values[lane] >= high[lane]));
        }
        left != 0
    }

    pub(super) fn holds(&self, channel: usize, value: f32) -> bool {
        let (block, lane) = (channel / BLOCK, channel % BLOCK);
        self.low[block][lane] <= value && value < self.high[block][lane]
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

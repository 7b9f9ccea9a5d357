//! Binary: whether a taxel's value has reached a level.

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block, NextFrame};
use super::encoding::Encoding;
use super::sampled::{Rule, Sampled};
use super::stream::Stream;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::spikes::ms;
use crate::{Array, Result, Spike};

parameters! {
    /// A spike of 1 when a taxel's value reaches the level, and of -1 when it falls below. One signed train a taxel.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Binary {
        /// The level, in the sensor's unit.
        pub level: f64 = 100.0, "", Range::ABOVE_0;
        /// How often values are sampled, ms.
        pub period_ms: f64 = super::periods::stamp_period(), "ms", Range::WHOLE_US;
    }
}

impl Encoding for Binary {
    fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let rule = Comparison { level: self.level as f32, reached: vec![] };
        Ok(Box::new(Sampled::new(self, rule, array, self.period_ms)?))
    }
}

#[derive(Clone)]
struct Comparison {
    level: f32,
    reached: Vec<[bool; BLOCK]>,
}

impl Rule for Comparison {
    fn begin(&mut self, _t: i64, held: &[Block], _out: &mut Vec<Spike>) {
        self.reached = held.iter().map(|block| block.map(|value| value >= self.level)).collect();
    }

    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], _next: &mut NextFrame, out: &mut Vec<Spike>) {
        for (block, (values, reached)) in held.iter().zip(&mut self.reached).enumerate().filter(|(b, _)| changed[*b]) {
            for (lane, (&value, reached)) in values.iter().zip(reached.iter_mut()).enumerate() {
                if (value >= self.level) != *reached {
                    *reached = !*reached;
                    let value = if *reached { 1.0 } else { -1.0 };
                    out.push(Spike { t: ms(t), train: (block * BLOCK + lane) as u32, value });
                }
            }
        }
    }

    fn idle(&self) -> bool {
        true
    }
}

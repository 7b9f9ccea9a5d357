//! Change events: the difference of a taxel's value from that of its last event, with 1 to 10 bits (equation 5.7).

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block};
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::periods::micros;
use super::stream::Stream;
use crate::allowed::Range;
pub use crate::board::Previous;
use crate::parameters::parameters;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

parameters! {
    /// Change events: U = value - previous value in units of the noise floor, saturating at +-(2^bits - 1).
    ///
    /// A spike's value is the quantised change. A value that a state of version 2 repaired replaces the previous value
    /// without a spike. The first sample becomes the first previous value without a spike. Computed in f32. One signed
    /// train per taxel.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct ChangeEvents {
        /// The smallest change that causes an event, in the sensor's unit, above 0; theta_0 of equation 5.7. Default 3
        /// ticks, the
        /// floor of the board's fast presets (wire.md, section 3).
        pub noise_floor: f64 = 3.0, "", Range::ABOVE_0;
        /// Bits of an event's value, 1 to 10 (figure 5.7). Default 1: rise or fall.
        pub bits: u32 = 1, "", Range::within(1.0, 10.0);
        /// The reference of a change. Default the value last sent.
        pub previous: Previous = Previous::default();
        /// How U / theta_0 is rounded to a whole number. Default truncation.
        pub rounding: Rounding = Rounding::default();
        /// Sampling period of events, ms; default 0.1, the step of the wire's stamps, which loses nothing.
        pub period_ms: f64 = super::periods::stamp_period(), "ms", Range::WHOLE_US;
    }
}

/// How U / theta_0 is rounded to a whole number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rounding {
    /// Towards zero, and an event only where |U| is above the noise floor (wire.md, section 3, rule 3).
    #[default]
    Truncate,
    /// Downwards, as 5.7 is printed: any fall, however small, is -1.
    Floor,
}

impl Encoding for ChangeEvents {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        // Changes are compared in f32.
        if !(self.noise_floor as f32).is_normal() {
            return Err(problem!(
                "noise_floor"; " is {}: must be above 0 and finite in single precision",
                self.noise_floor
            ));
        }
        Ok(())
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let changes = ChangeRule {
            floor: self.noise_floor as f32,
            most: ((1_u32 << self.bits) - 1) as f32,
            previous: self.previous,
            rounding: self.rounding,
            last: vec![],
        };
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Box::new(Driver::new(changes, Channels::new(array), self.trains_of(array), clock)))
    }
}

#[derive(Clone)]
struct ChangeRule {
    floor: f32,
    most: f32,
    previous: Previous,
    rounding: Rounding,
    last: Vec<Block>,
}

impl Rule for ChangeRule {
    fn begin(&mut self, now: Sample<'_>, _out: &mut Vec<Spike>) {
        self.last = now.held.to_vec();
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        let (floor, t) = (self.floor, ms(now.t));
        for (block, (new, last)) in now.held.iter().zip(&mut self.last).enumerate().filter(|(b, _)| now.changed[*b]) {
            let moved = |new: f32, last: f32| match self.rounding {
                Rounding::Truncate => (new - last).abs() > floor,
                Rounding::Floor => new - last >= floor || new < last,
            };
            if new.iter().zip(last.iter()).fold(false, |any, (&new, &last)| any | moved(new, last)) {
                for (lane, (&new, last)) in new.iter().zip(last.iter_mut()).enumerate() {
                    if moved(new, *last) {
                        let units = (new - *last) / floor;
                        let rounded = match self.rounding {
                            Rounding::Truncate => units.trunc(),
                            Rounding::Floor => units.floor(),
                        };
                        let value = rounded.clamp(-self.most, self.most);
                        out.push(Spike { t, train: (block * BLOCK + lane) as u32, value });
                        *last = new;
                    }
                }
            }
            if self.previous == Previous::LastSample {
                *last = *new;
            }
        }
    }

    const SPIKES_OF_REPAIRED: bool = false;

    #[inline(always)]
    fn read(&mut self, channel: usize, from: f32, to: f32, repaired: bool) {
        if repaired {
            self.last[channel / BLOCK][channel % BLOCK] += to - from;
        }
    }

    fn idle(&self) -> bool {
        true
    }
}

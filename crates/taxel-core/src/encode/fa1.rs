//! FA-1 encoder: pressure change to signed spikes (thesis 5.4.2, equations 5.1 to 5.5).
//!
//! Each taxel integrates the change of its compressed pressure and fires where that passes a threshold, which a spike
//! raises by `T A theta_0` and a quiet sample lowers by `B theta_0`. Order within a sample: the threshold moves by the
//! last sample's spike, the change is added, both are compared, a spike resets the integral. (The threshold's move is
//! reckoned at the end of a sample instead of at the start of the next: the same numbers, one array less.)
//!
//! Reading: as printed, equation 5.5 lets the threshold sink below `theta_0` for one sample, by less than `B theta_0`,
//! before its third case restores it. Kept, so that spikes equal the thesis'.

use serde::{Deserialize, Serialize};

use super::law::Law;
use super::power::power;
use super::sampled::{BLOCK, Block, Channels, Rule, Sampled};
use super::stream::Stream;
use crate::allowed::{Range, ranges};
use crate::parameters::Described;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

/// The FA-1 afferent exactly as equations 5.1 to 5.5, polarity kept.
///
/// Reckoned in f64; pressure below 0 counts as 0 before 5.1. A value that a state of version 2 repaired is no change of 5.3.
/// It begins as if the first sample had always been. One signed train a taxel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fa1 {
    /// Power of the compression 5.1, above 0; default 0.7 (Table 5.3).
    #[serde(default = "alpha")]
    pub alpha: f64,
    /// A, 1/ms: how much a spike raises the threshold; default 20 (Table 5.3).
    #[serde(default = "twenty")]
    pub a: f64,
    /// B: how fast the threshold decays; default 0.05 (Table 5.3).
    #[serde(default = "one_twentieth")]
    pub b: f64,
    /// What B is reckoned by; default the sample.
    #[serde(default)]
    pub decay: Decay,
    /// The baseline threshold itself, 0 or more, in compressed units; left out, it is made from `range`. Table 5.3
    /// prints 0: with it every change fires.
    #[serde(default)]
    pub theta_0: Option<f64>,
    /// The largest pressure, in the sensor's unit: theta_0 = range^alpha / 1024 (text to Table 5.3). Default 150 ticks,
    /// the ramp of the board's 5.2 kHz preset.
    #[serde(default)]
    pub range: Option<f64>,
    /// Bits an event, 1 to 10: by equation 5.7 a spike's value is U in units of theta_0, towards zero, from +-1 to
    /// +-(2^bits - 1). When it fires stays that of 5.4. Default 1: rise or fall.
    #[serde(default = "one_bit")]
    pub bits: u32,
    /// T, ms: the sampling period, of events and of frames; default 1, where "about 100 Hz" holds. Frames must come at
    /// this period, give or take half of it.
    #[serde(default = "one")]
    pub period_ms: f64,
}

/// What the threshold's decay B is reckoned by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decay {
    /// By the sample, B theta_0 each, as 5.5 is printed.
    #[default]
    Sample,
    /// By the ms, B T theta_0 a sample: then the sampling period does not change the decay.
    Ms,
}

fn alpha() -> f64 {
    0.7
}

fn twenty() -> f64 {
    20.0
}

fn one_twentieth() -> f64 {
    0.05
}

fn one_bit() -> u32 {
    1
}

fn one() -> f64 {
    1.0
}

/// Ticks of the ramp of the preset 5.2 kHz (wire.md, section 3).
const RAMP: f64 = 150.0;

impl Default for Fa1 {
    fn default() -> Self {
        Self {
            alpha: alpha(),
            a: twenty(),
            b: one_twentieth(),
            decay: Decay::default(),
            theta_0: None,
            range: None,
            bits: one_bit(),
            period_ms: one(),
        }
    }
}

impl Fa1 {
    ranges! {
        alpha: "", Range::ABOVE_0.at_most(4.0);
        a: "1/ms", Range::FROM_0;
        b: "", Range::FROM_0;
        theta_0: "", Range::FROM_0;
        range: "", Range::ABOVE_0;
        bits: "", Range::within(1.0, 10.0);
        period_ms: "ms", Range::WHOLE_US;
    }

    /// The baseline threshold, in compressed units.
    #[must_use]
    pub fn baseline(&self) -> f64 {
        self.theta_0.unwrap_or_else(|| self.range.unwrap_or(RAMP).powf(self.alpha) / 1024.0)
    }
}

impl Law for Fa1 {
    fn described() -> Described {
        Described::by(&Self::default(), &[], Self::RANGES)
    }

    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.range.is_some() && self.theta_0.is_some() {
            return Err(problem!("theta_0 and range: give one of them"));
        }
        Ok(())
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let afferents = Afferents::new(self, Channels::new(array).len());
        Ok(Box::new(Sampled::new(afferents, array, self.period_ms, 0.0)?.steady()))
    }
}

/// The state of the afferents of one block.
#[derive(Clone)]
struct Afferent {
    /// rho (5.1) where U was last reset: U, the sum of changes since then (5.3), is rho less this.
    base: [f64; BLOCK],
    /// theta (5.5) of the next sample.
    theta: [f64; BLOCK],
    /// Whether a sample without change would leave all this as it is.
    still: bool,
}

#[derive(Clone)]
pub(super) struct Afferents {
    alpha: f64,
    jump: f64,
    decay: f64,
    theta_0: f64,
    /// The largest value of a spike.
    most: f64,
    blocks: Vec<Afferent>,
    channels: usize,
    /// 5.1 of every tick.
    table: Box<[f64; TICKS]>,
}

/// How many different ticks a word of the wire can hold.
const TICKS: usize = 65_536;

impl Afferents {
    pub(super) fn new(parameters: &Fa1, channels: usize) -> Self {
        let (theta_0, t) = (parameters.baseline(), parameters.period_ms);
        let mut table = Box::new([0.0; TICKS]);
        for (k, rho) in table.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let ticks = std::array::from_fn(|lane| (k * BLOCK + lane) as f32);
            power(&ticks, parameters.alpha, rho);
        }
        Self {
            alpha: parameters.alpha,
            jump: t * parameters.a * theta_0,
            decay: match parameters.decay {
                Decay::Sample => parameters.b * theta_0,
                Decay::Ms => parameters.b * t * theta_0,
            },
            theta_0,
            most: f64::from((1_u32 << parameters.bits) - 1),
            blocks: vec![],
            channels,
            table,
        }
    }

    /// 5.1, from the table where all values are ticks.
    #[inline(always)]
    fn compress(alpha: f64, table: &[f64; TICKS], values: &Block, rho: &mut [f64; BLOCK]) {
        /// Added to a whole number below 2^23, it shows that number in the lowest bits.
        const SHIFT: f32 = 8_388_608.0; // 2^23
        let mut odd = 0;
        for &v in values {
            odd |= ((v + SHIFT) - SHIFT).to_bits() ^ v.to_bits();
            odd |= (v + SHIFT).to_bits() & !(SHIFT.to_bits() | (TICKS as u32 - 1));
        }
        if odd == 0 {
            for (rho, &v) in rho.iter_mut().zip(values) {
                *rho = table[(v + SHIFT).to_bits() as usize % TICKS];
            }
        } else {
            power(values, alpha, rho);
        }
    }
}

impl Afferent {
    /// One sample; fills `s` (5.4) and says whether any afferent fired. Where `GRADED`, `s` holds sizes (5.7).
    #[inline(always)]
    fn sample<const GRADED: bool>(
        &mut self,
        rho: &[f64; BLOCK],
        s: &mut [f64; BLOCK],
        jump: f64,
        decay: f64,
        theta_0: f64,
        most: f64,
    ) -> bool {
        let (mut fired, mut moved) = (0, 0);
        for (lane, &rho) in rho.iter().enumerate() {
            let (base, theta) = (self.base[lane], self.theta[lane]);
            let u = rho - base;
            let rise = if u > theta { 1.0 } else { 0.0 };
            let fall = if u < -theta { -1.0 } else { 0.0 };
            let said: f64 = rise + fall;
            let quiet = if theta > theta_0 { theta - decay } else { theta_0 };
            let next = if said == 0.0 { quiet } else { theta + jump };
            // A baseline of 0 makes every change as large as can be said.
            s[lane] = if GRADED && said != 0.0 { said * (u.abs() / theta_0).trunc().clamp(1.0, most) } else { said };
            self.base[lane] = if said == 0.0 { base } else { rho };
            self.theta[lane] = next;
            fired |= said.to_bits();
            moved |= (next.to_bits() ^ theta_0.to_bits()) | (theta.to_bits() ^ theta_0.to_bits());
        }
        self.still = fired | moved == 0;
        fired != 0
    }
}

impl Rule for Afferents {
    fn trains(&self) -> usize {
        self.channels
    }

    fn begin(&mut self, _t: i64, held: &[Block], _out: &mut Vec<Spike>) {
        let blank = Afferent { base: [0.0; BLOCK], theta: [self.theta_0; BLOCK], still: true };
        self.blocks = vec![blank; held.len()];
        for (afferent, values) in self.blocks.iter_mut().zip(held) {
            Self::compress(self.alpha, &self.table, values, &mut afferent.base);
        }
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], out: &mut Vec<Spike>) {
        let (jump, decay, theta_0, most) = (self.jump, self.decay, self.theta_0, self.most);
        let (mut rho, mut s) = ([0.0; BLOCK], [0.0; BLOCK]);
        for (block, afferent) in self.blocks.iter_mut().enumerate() {
            if afferent.still && !changed[block] {
                continue;
            }
            Self::compress(self.alpha, &self.table, &held[block], &mut rho);
            let fired = if most > 1.0 {
                afferent.sample::<true>(&rho, &mut s, jump, decay, theta_0, most)
            } else {
                afferent.sample::<false>(&rho, &mut s, jump, decay, theta_0, most)
            };
            if fired {
                for (part, eight) in s.as_chunks::<8>().0.iter().enumerate() {
                    if eight.iter().fold(0, |any, s| any | s.to_bits()) != 0 {
                        for (lane, &s) in eight.iter().enumerate().filter(|&(_, &s)| s != 0.0) {
                            let train = (block * BLOCK + part * 8 + lane) as u32;
                            out.push(Spike { t: ms(t), train, value: s as f32 });
                        }
                    }
                }
            }
        }
    }

    const HEARS_REPAIRED: bool = false;

    fn repair(&mut self, channel: usize, from: f32, to: f32) {
        let (mut values, mut rho) = ([0.0; BLOCK], [0.0; BLOCK]);
        (values[0], values[1]) = (from, to);
        Self::compress(self.alpha, &self.table, &values, &mut rho);
        let base = &mut self.blocks[channel / BLOCK].base[channel % BLOCK];
        // Exactly where nothing was summed up: with a threshold of 0 a rounding would fire.
        *base = if *base == rho[0] { rho[1] } else { *base + (rho[1] - rho[0]) };
    }

    fn idle(&self) -> bool {
        self.blocks.iter().all(|b| b.still)
    }
}

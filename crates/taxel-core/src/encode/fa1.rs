//! FA-1 encoder: changes of pressure to signed spikes (thesis 5.4.2, equations 5.1 to 5.5).
//!
//! Each taxel integrates the change of its compressed pressure and fires when the integral passes a threshold, which a
//! spike raises by `T A theta_0` and a quiet sample lowers by `B theta_0`. Order within a sample: the threshold is
//! updated for the last sample's spike, the change is added, both are compared, a spike resets the integral. (The
//! threshold is updated at the end of a sample instead of at the start of the next, which gives the same numbers with
//! one array less.)
//!
//! Few afferents fire at a sample, and computing a power is slow. Therefore each afferent has a bound, proportional to
//! its threshold: while its pressure differs by less from that at its last spike it cannot fire (`Fa1Afferents::reach`).
//! Equations 5.1 and 5.4 are computed only for afferents beyond their bound. The bound is conservative, so the spikes
//! equal to the bit those of computing every afferent.
//!
//! Reading: as printed, equation 5.5 lets the threshold fall below `theta_0` for one sample, by less than `B theta_0`,
//! before its third case restores it. This code reproduces that, so that its spikes equal those of the thesis.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block};
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample};
use super::encoding::Encoding;
use super::periods::micros;
use super::power::power;
use super::stream::Stream;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::spikes::ms;
use crate::{Array, Result, Spike, problem};

parameters! {
    /// The FA-1 afferent by equations 5.1 to 5.5, with polarity.
    ///
    /// Computed in f64; pressure below 0 counts as 0 before 5.1. A value that a state of version 2 repaired is no
    /// change in 5.3. The initial state is that of a constant input equal to the first sample. One signed train per
    /// taxel.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Fa1 {
        /// Power of the compression 5.1, above 0; default 0.7 (Table 5.3).
        pub alpha: f64 = 0.7, "", Range::ABOVE_0.at_most(4.0);
        /// A, 1/ms: how much a spike raises the threshold; default 20 (Table 5.3).
        pub a: f64 = 20.0, "1/ms", Range::FROM_0;
        /// B: how fast the threshold decays; default 0.05 (Table 5.3).
        pub b: f64 = 0.05, "", Range::FROM_0;
        /// The unit of time of B; default the sample.
        pub decay: Decay = Decay::default();
        /// The baseline threshold itself, 0 or more, in compressed units; by default it is computed from `range`. Table
        /// 5.3 prints 0, with which every change fires.
        pub theta_0: Option<f64> = None, "", Range::FROM_0;
        /// The largest pressure, in the sensor's unit: theta_0 = range^alpha / 1024 (text to Table 5.3). Default 150
        /// ticks, the ramp of the board's 5.2 kHz preset.
        pub range: Option<f64> = None, "", Range::ABOVE_0;
        /// Bits of a spike's value, 1 to 10: by equation 5.7 the value is U in units of theta_0, rounded towards zero,
        /// from +-1 to +-(2^bits - 1). Spike times remain those of 5.4. Default 1: rise or fall.
        pub bits: u32 = 1, "", Range::within(1.0, 10.0);
        /// T, ms: the sampling period of events and frames; default 1, for which the thesis states "about 100 Hz".
        /// Frames must arrive at this period, within half of it.
        pub period_ms: f64 = 1.0, "ms", Range::WHOLE_US;
    }
}

/// The unit of time of the threshold's decay B.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decay {
    /// The sample: the threshold decays by B theta_0 per sample, as 5.5 is printed.
    #[default]
    Sample,
    /// The ms: it decays by B T theta_0 per sample, so that the decay does not depend on the sampling period.
    Ms,
}

/// Length of the ramp of the preset 5.2 kHz, ticks (wire.md, section 3).
const RAMP: f64 = 150.0;

impl Fa1 {
    /// The baseline threshold, in compressed units.
    #[must_use]
    pub fn baseline(&self) -> f64 {
        self.theta_0.unwrap_or_else(|| libm::pow(self.range.unwrap_or(RAMP), self.alpha) / 1024.0)
    }
}

impl Encoding for Fa1 {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.range.is_some() && self.theta_0.is_some() {
            return Err(problem!("theta_0 and range are both given: give only one of them"));
        }
        Ok(())
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let clock = Clock::Period(micros("period_ms", self.period_ms)?);
        Ok(Box::new(Driver::new(Fa1Afferents::new(self), Channels::new(array), self.trains_of(array), clock).steady()))
    }
}

/// The state of the afferents of one block, aligned to cache lines so that no vector crosses a boundary.
#[derive(Clone)]
#[repr(align(64))]
struct Fa1Block {
    /// rho (5.1) when U was last reset: U, the sum of changes since then (5.3), is rho minus this value.
    base: [f64; BLOCK],
    /// theta (5.5) of the next sample.
    theta: [f64; BLOCK],
    /// The pressure whose rho is `base`; NaN if there is none.
    reference: Block,
    /// No pressure within `reach * theta` of `reference` fires.
    reach: Block,
    /// Whether a sample without change would leave this state unchanged.
    still: bool,
}

/// An afferent that may fire.
#[derive(Clone, Copy)]
struct Near {
    channel: u32,
    /// theta of this sample.
    theta: f64,
}

#[derive(Clone)]
pub(super) struct Fa1Afferents {
    alpha: f64,
    jump: f64,
    decay: f64,
    theta_0: f64,
    /// Lower bound of theta; 0 if there is none, or if it is beyond the range of f32.
    least: f64,
    /// The pressure whose rho is the lower bound of theta; 0 if alpha is above 1.
    lowest_pressure: f64,
    /// Reciprocal of the lower bound of theta.
    per_least: f64,
    /// The largest value of a spike.
    most: f64,
    blocks: Vec<Fa1Block>,
    /// Buffer for the afferents that may fire at a sample.
    near: Vec<Near>,
    /// Equation 5.1 for every tick up to the largest so far.
    table: Vec<[f64; BLOCK]>,
}

/// Range in which f32 is precise to seven digits, also for products of two values.
const SOUND: RangeInclusive<f64> = 1e-18..=1e18;

/// Number of different ticks that a word of the wire can hold.
const TICKS: usize = 65_536;

impl Fa1Afferents {
    pub(super) fn new(parameters: &Fa1) -> Self {
        let (theta_0, t) = (parameters.baseline(), parameters.period_ms);
        let decay = match parameters.decay {
            Decay::Sample => parameters.b * theta_0,
            Decay::Ms => parameters.b * t * theta_0,
        };
        let least = if SOUND.contains(&(theta_0 - decay)) { theta_0 - decay } else { 0.0 };
        Self {
            alpha: parameters.alpha,
            jump: t * parameters.a * theta_0,
            decay,
            theta_0,
            least,
            lowest_pressure: if parameters.alpha > 1.0 { 0.0 } else { libm::pow(least, 1.0 / parameters.alpha) },
            per_least: 1.0 / least,
            most: f64::from((1_u32 << parameters.bits) - 1),
            blocks: vec![],
            near: vec![],
            table: vec![],
        }
    }

    /// Equation 5.1, from the table if all values are whole ticks.
    #[inline(always)]
    fn compress(alpha: f64, table: &mut Vec<[f64; BLOCK]>, values: &Block, rho: &mut [f64; BLOCK]) {
        /// Added to a whole number below 2^23, it leaves that number in the sum's lowest bits.
        const SHIFT: f32 = 8_388_608.0; // 2^23
        let (mut odd, mut all) = (0, 0);
        for &v in values {
            all |= (v + SHIFT).to_bits();
            odd |= ((v + SHIFT) - SHIFT).to_bits() ^ v.to_bits();
            odd |= (v + SHIFT).to_bits() & !(SHIFT.to_bits() | (TICKS as u32 - 1));
        }
        if odd == 0 {
            let last = all as usize % TICKS;
            while table.len() <= last / BLOCK {
                let (from, mut rho) = (table.len() * BLOCK, [0.0; BLOCK]);
                power(&std::array::from_fn(|lane| (from + lane) as f32), alpha, &mut rho);
                table.push(rho);
            }
            let table = &table.as_flattened()[..=last];
            for (rho, &v) in rho.iter_mut().zip(values) {
                *rho = table[(v + SHIFT).to_bits() as usize & last];
            }
        } else {
            power(values, alpha, rho);
        }
    }

    /// How far a pressure may move from `reference`, whose rho is `base`, without a spike, in proportion to theta.
    ///
    /// Until the next spike theta is at most `most`. With `m = theta / base` the pressure may differ by a fraction `r`
    /// of `reference` if `(1 + r)^alpha <= 1 + m` and `(1 - r)^alpha >= 1 - m`. Both hold for `r = m / (alpha + |1 -
    /// alpha| m)`: for alpha below 1 by `(1 - m)^(1 / alpha - 1) <= 1 / (1 + (1 / alpha - 1) m)`, above 1 by
    /// Bernoulli's inequality. They hold for smaller r too, so the divisor may use the largest m. If alpha is at most 1
    /// and neither pressure exceeds `theta lowest_pressure / least <= theta^(1 / alpha)`, neither rho exceeds theta. A
    /// margin of 1e-4 covers rounding: different f32 values differ by at least 6e-8 of `reference`, so the bound is
    /// only useful if theta is at least 6e-8 alpha base, and 5.1 has an error below 1e-13 of base.
    fn reach(&self, reference: f32, base: f64, theta: f64) -> f32 {
        let (reference, most) = (f64::from(reference), theta.max(self.theta_0));
        let near = reference / (self.alpha * base + (1.0 - self.alpha).abs() * most);
        let low = (self.lowest_pressure - reference) * self.per_least;
        let reach = 0.9999 * near.max(low);
        let sound = [reach, reach * self.least, most].iter().all(|x| SOUND.contains(x));
        // With a reach of 0 every change is computed in full.
        if sound && self.alpha > 0.01 { reach as f32 } else { 0.0 }
    }

    /// Resets an afferent at a pressure whose rho is `base`.
    fn reset(&mut self, channel: usize, pressure: f32, base: f64, theta: f64) {
        let reference = pressure.max(0.0);
        let reach = self.reach(reference, base, theta);
        let (afferent, lane) = (&mut self.blocks[channel / BLOCK], channel % BLOCK);
        (afferent.base[lane], afferent.theta[lane]) = (base, theta);
        (afferent.reference[lane], afferent.reach[lane]) = (reference, reach);
    }

    /// Computes equations 5.1 to 5.5 for the afferents that may fire.
    #[inline(always)]
    fn reckon(&mut self, t: i64, held: &[Block], near: &[Near], out: &mut Vec<Spike>) {
        let (mut values, mut rho, mut base) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        for some in near.chunks(BLOCK) {
            for (k, near) in some.iter().enumerate() {
                let (block, lane) = (near.channel as usize / BLOCK, near.channel as usize % BLOCK);
                (values[k], base[k]) = (held[block][lane], self.blocks[block].base[lane]);
            }
            Self::compress(self.alpha, &mut self.table, &values, &mut rho);
            for (k, &Near { channel, theta }) in some.iter().enumerate() {
                let u = rho[k] - base[k];
                // If theta is negative, both comparisons hold for a small U, which fires in neither direction.
                if (u > theta) == (u < -theta) {
                    continue;
                }
                // With a baseline of 0 every change has the largest possible value.
                let size = if self.most > 1.0 { (u.abs() / self.theta_0).trunc().clamp(1.0, self.most) } else { 1.0 };
                let signed = if u > theta { size } else { -size };
                out.push(Spike { t: ms(t), train: channel, value: signed as f32 });
                self.reset(channel as usize, values[k], rho[k], theta + self.jump);
                self.blocks[channel as usize / BLOCK].still = false;
            }
        }
    }
}

impl Fa1Block {
    /// The afferents of a block that may fire, as a bit mask.
    #[inline(always)]
    fn near(&self, held: &Block) -> u64 {
        let theta = self.theta.map(|theta| theta as f32);
        let mut halves = [0_u32; 2];
        for (half, bits) in halves.iter_mut().enumerate() {
            for k in 0..32 {
                let lane = half * 32 + k;
                let pressure = if held[lane] > 0.0 { held[lane] } else { 0.0 };
                let within = (pressure - self.reference[lane]).abs() <= self.reach[lane] * theta[lane];
                *bits |= if within { 0 } else { 1 << k };
            }
        }
        u64::from(halves[1]) << 32 | u64::from(halves[0])
    }

    /// Lowers the thresholds as 5.5 does for a sample without spikes.
    #[inline(always)]
    fn lower_thresholds(&mut self, decay: f64, theta_0: f64) {
        let mut moved = 0;
        for theta in &mut self.theta {
            let next = if *theta > theta_0 { *theta - decay } else { theta_0 };
            moved |= next.to_bits() ^ theta.to_bits();
            *theta = next;
        }
        self.still = moved == 0;
    }
}

impl Rule for Fa1Afferents {
    fn begin(&mut self, Sample { held, .. }: Sample<'_>, _out: &mut Vec<Spike>) {
        let blank = Fa1Block {
            base: [0.0; BLOCK],
            theta: [0.0; BLOCK],
            reference: [0.0; BLOCK],
            reach: [0.0; BLOCK],
            still: true,
        };
        self.blocks = vec![blank; held.len()];
        for (block, values) in held.iter().enumerate() {
            let mut rho = [0.0; BLOCK];
            Self::compress(self.alpha, &mut self.table, values, &mut rho);
            for (lane, (&value, &rho)) in values.iter().zip(&rho).enumerate() {
                self.reset(block * BLOCK + lane, value, rho, self.theta_0);
            }
        }
    }

    #[inline(always)]
    fn sample(&mut self, Sample { t, held, changed, .. }: Sample<'_>, out: &mut Vec<Spike>) {
        let mut near = std::mem::take(&mut self.near);
        near.clear();
        for (block, afferent) in self.blocks.iter_mut().enumerate() {
            if afferent.still && !changed[block] {
                continue;
            }
            let mut left = afferent.near(&held[block]);
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                near.push(Near { channel: (block * BLOCK + lane) as u32, theta: afferent.theta[lane] });
            }
            afferent.lower_thresholds(self.decay, self.theta_0);
        }
        self.reckon(t, held, &near, out);
        self.near = near;
    }

    const SPIKES_OF_REPAIRED: bool = false;

    fn read(&mut self, channel: usize, from: f32, to: f32, repaired: bool) {
        if !repaired {
            return;
        }
        let (mut values, mut rho) = ([0.0; BLOCK], [0.0; BLOCK]);
        (values[0], values[1]) = (from, to);
        Self::compress(self.alpha, &mut self.table, &values, &mut rho);
        let (afferent, lane) = (&mut self.blocks[channel / BLOCK], channel % BLOCK);
        // U is exactly 0 if nothing was added: with a threshold of 0 a rounding error would fire.
        if afferent.base[lane] == rho[0] {
            let theta = afferent.theta[lane];
            self.reset(channel, to, rho[1], theta);
        } else {
            afferent.base[lane] += rho[1] - rho[0];
            afferent.reference[lane] = f32::NAN;
        }
    }

    fn idle(&self) -> bool {
        self.blocks.iter().all(|b| b.still)
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// Reference for the tests: equations 5.1 to 5.5 for every afferent at every sample.
    fn plainly(parameters: &Fa1, frames: &[Block]) -> Vec<Spike> {
        let afferents = Fa1Afferents::new(parameters);
        let Fa1Afferents { alpha, jump, decay, theta_0, .. } = afferents;
        let (mut base, mut rho, mut theta) = ([0.0; BLOCK], [0.0; BLOCK], [theta_0; BLOCK]);
        power(&frames[0], alpha, &mut base);
        let mut out = vec![];
        for (t, frame) in (1..).zip(&frames[1..]) {
            power(frame, alpha, &mut rho);
            for lane in 0..BLOCK {
                let u = rho[lane] - base[lane];
                let signed = f32::from(i8::from(u > theta[lane]) - i8::from(u < -theta[lane]));
                if signed == 0.0 {
                    theta[lane] = if theta[lane] > theta_0 { theta[lane] - decay } else { theta_0 };
                } else {
                    out.push(Spike { t: ms(t), train: lane as u32, value: signed });
                    (base[lane], theta[lane]) = (rho[lane], theta[lane] + jump);
                }
            }
        }
        out
    }

    #[test]
    fn afferents_that_are_not_reckoned_are_those_that_say_nothing() {
        let mut rng = StdRng::seed_from_u64(5);
        for round in 0..400 {
            // Magnitudes from the smallest that f32 represents to far beyond any sensor; noise from one last place to
            // the full range.
            let exponent = |rng: &mut StdRng, most: f64| 10_f64.powf(rng.random_range(-most..most));
            let most = if round % 4 == 0 { 36.0 } else { 4.0 };
            let (size, noise) = (exponent(&mut rng, most), 10_f64.powf(rng.random_range(-7.5..0.5)));
            let alpha = [0.7, 1.0, 1.4, 4.0, 0.2, 0.02, 0.005][round % 7];
            let parameters = Fa1 {
                alpha,
                a: [0.0, 0.2, 20.0, 1e3][rng.random_range(0..4)],
                b: [0.0, 0.05, 0.999, 1.0, 3.0][rng.random_range(0..5)],
                theta_0: Some(match rng.random_range(0..8) {
                    0 => 0.0,
                    1 => exponent(&mut rng, most),
                    _ => size.powf(alpha) * noise * exponent(&mut rng, 1.0),
                }),
                ..Fa1::default()
            };
            let offset = rng.random_range(-1.0..2.0);
            let mut held: [f64; BLOCK] = std::array::from_fn(|_| offset);
            let frames: Vec<Block> = (0..300)
                .map(|_| {
                    for held in &mut held {
                        if rng.random_bool(0.3) {
                            *held += noise * rng.random_range(-1.0..1.0);
                        }
                    }
                    held.map(|held| (held * size) as f32)
                })
                .collect();
            let mut afferents = Fa1Afferents::new(&parameters);
            let mut out = vec![];
            afferents.begin(Sample { t: 0, held: &frames[..1], changed: &[true], of_frame: true }, &mut out);
            for (t, held) in (1..).zip(frames[1..].chunks(1)) {
                let changed = held != &frames[t as usize - 1..t as usize];
                afferents.sample(Sample { t, held, changed: &[changed], of_frame: true }, &mut out);
            }
            assert!(out == plainly(&parameters, &frames), "round {round}: {parameters:?}");
        }
    }
}

//! The common part of the afferents of touch: a linear filter of pressure, and a threshold that each spike raises.
//!
//! A filter computes the potential `u` from the input. A spike is emitted when `u` reaches `threshold + a`; it raises
//! `a` by `jump` and prevents another for the refractory time; `a` decays. The potential is not reset (the neuron with
//! a moving threshold of Kobayashi, Tsubota and Shinomoto 2009, Front. Comput. Neurosci. 3:9, with one time constant).
//!
//! Between samples the pressure is taken as linear, for which each stage of a filter is exact. The time of a spike
//! within a sample is found by linear interpolation of `u` as well, and the threshold's rise decays from that time.
//! Therefore rates do not depend on the sampling period as long as it is short compared with the filter.

use super::blocks::{BLOCK, Block, blocks};
use super::channels::Channels;
use super::driver::{Clock, Driver, Rule, Sample, Trains};
use super::periods::micros;
use super::stream::Stream;
use super::tare::Tare;
use crate::rest::{Rest, Value};
use crate::spikes::ms;
use crate::{Array, Result, Spike};

/// One number per channel of a block.
pub(super) type Lanes = [f64; BLOCK];

/// A first-order low-pass filter over one sample, exact for an input that is linear between samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    keep: f64,
    before: f64,
    now: f64,
}

impl LowPass {
    pub(super) fn new(tau_ms: f64, period_ms: f64) -> Self {
        let keep = libm::exp(-period_ms / tau_ms);
        let mean = -libm::expm1(-period_ms / tau_ms) * tau_ms / period_ms;
        Self { keep, before: mean - keep, now: 1.0 - mean }
    }

    /// The next output, from the previous output and the inputs before and now.
    #[inline(always)]
    pub(super) fn step(self, last: f64, before: f64, now: f64) -> f64 {
        self.keep * last + self.before * before + self.now * now
    }
}

/// The state of a filter of the channels of one block.
pub(super) type FilterState = [Lanes; 5];

/// Filter from pressure, as a fraction of the range, to the potential that is compared with the threshold.
pub(super) trait Filter: Send + Clone + 'static {
    /// The state after a constant input `x`, and the potential in it.
    fn steady_state(&self, x: &Lanes) -> (FilterState, Lanes);

    /// Processes the next sample of a channel whose potential was `u`; returns the potential.
    fn step(&self, state: &mut FilterState, lane: usize, x: f64, u: f64) -> f64;

    /// Whether the afferent encodes values, and not only changes; if so, a value that a state repaired counts as any
    /// other.
    const SIGNALS_VALUES: bool = false;

    /// Shifts the state of one channel by a difference that existed before, so that it does not count as a change.
    fn shift(&self, _state: &mut FilterState, _lane: usize, _by: f64) {}
}

/// The firing rule of an afferent; potentials are fractions of the range, times are in ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Firing {
    /// The largest pressure, in the sensor's unit.
    pub(super) range: f64,
    pub(super) threshold: f64,
    pub(super) jump: f64,
    pub(super) recovery_ms: f64,
    pub(super) refractory_ms: f64,
    pub(super) period_ms: f64,
}

/// The firing rule of the parameters of an afferent.
macro_rules! firing {
    ($of:expr) => {
        receptor::Firing {
            range: $of.range,
            threshold: $of.threshold,
            jump: $of.jump,
            recovery_ms: $of.recovery_ms,
            refractory_ms: $of.refractory_ms,
            period_ms: $of.period_ms,
        }
    };
}
pub(super) use firing;

/// Below this fraction of the range a raised threshold counts as recovered.
const RECOVERED: f64 = 1e-12;

/// The afferents of one block, aligned to cache lines so that no vector crosses a boundary.
#[derive(Clone)]
#[repr(align(64))]
struct Afferents {
    state: FilterState,
    u: Lanes,
    /// The current rise of the threshold.
    raised: Lanes,
    /// The remaining refractory time, ms.
    wait: Lanes,
    /// Whether a sample without change would leave this state unchanged and emit no spike.
    still: bool,
}

impl Afferents {
    /// Whether the state is that of others.
    #[inline(always)]
    fn equals(&self, other: &Self) -> bool {
        let moved = |now: &[f64], before: &[f64]| {
            now.iter().zip(before).fold(0, |moved, (now, before)| moved | (now.to_bits() ^ before.to_bits()))
        };
        let rest = moved(&self.u, &other.u) | moved(&self.raised, &other.raised) | moved(&self.wait, &other.wait);
        moved(self.state.as_flattened(), other.state.as_flattened()) | rest == 0
    }
}

/// Afferents of one type, one per taxel.
#[derive(Clone)]
pub(super) struct Receptor<F> {
    filter: F,
    firing: Firing,
    /// The factor by which the rise of the threshold decays in one sample.
    keep: f64,
    /// Factor from the sensor's unit to fractions of the range.
    scale: f64,
    /// The rest of each channel, from which its pressure is measured; 0 if there is none.
    rest: Option<Rest<f64>>,
    blocks: Vec<Afferents>,
}

/// A stream of afferents; with a tare pressure is measured from the taxels' rest.
pub(super) fn stream<F: Filter>(
    filter: F,
    firing: Firing,
    tare: Option<&Tare>,
    array: &Array,
    trains: Trains,
) -> Result<Box<dyn Stream>> {
    let channels = Channels::new(array);
    let mut receptor = Receptor::new(filter, firing);
    if let Some(tare) = tare {
        let rest = tare.rest_of(array)?;
        let mut of_channel: Vec<f64> =
            (0..array.len()).filter(|&taxel| array.has(taxel)).map(|taxel| rest.values()[taxel]).collect();
        of_channel.resize(blocks(channels.len()) * BLOCK, f64::NO_REST);
        receptor.rest = Some(Rest::measured(of_channel));
    }
    let clock = Clock::Period(micros("period_ms", firing.period_ms)?);
    Ok(Box::new(Driver::new(receptor, channels, trains, clock).steady()))
}

impl<F: Filter> Receptor<F> {
    fn new(filter: F, firing: Firing) -> Self {
        let (keep, scale) = (libm::exp(-firing.period_ms / firing.recovery_ms), 1.0 / firing.range);
        Self { filter, firing, keep, scale, rest: None, blocks: vec![] }
    }

    /// Converts a channel's value to a fraction of the range; below its rest, or if that is not known, it is 0.
    #[inline(always)]
    fn share(&self, channel: usize, value: f32) -> f64 {
        let above = self.rest.as_ref().map_or(value, |rest| rest.above(channel, f64::from(value)) as f32);
        f64::from(above.max(0.0)) * self.scale
    }

    /// The fractions of a block's values.
    #[inline(always)]
    fn shares(&self, block: usize, values: &Block) -> Lanes {
        if self.rest.is_none() {
            return values.map(|value| f64::from(value.max(0.0)) * self.scale);
        }
        std::array::from_fn(|lane| self.share(block * BLOCK + lane, values[lane]))
    }

    /// Processes a block's next sample; calls `fired` with the lanes that fire.
    #[inline(always)]
    fn step(&mut self, block: usize, x: &Lanes, mut fired: impl FnMut(usize)) {
        let Firing { threshold, jump, recovery_ms, refractory_ms, period_ms, .. } = self.firing;
        let afferents = &mut self.blocks[block];
        let (mut below, mut waited) = ([0.0; BLOCK], [0.0; BLOCK]);
        let mut fires = [0_u32; 2];
        for (half, fires) in fires.iter_mut().enumerate() {
            for k in 0..BLOCK / 2 {
                let lane = half * BLOCK / 2 + k;
                let (last, before, wait) = (afferents.u[lane], afferents.raised[lane], afferents.wait[lane]);
                let u = self.filter.step(&mut afferents.state, lane, x[lane], last);
                let kept = before * self.keep;
                let raised = if kept < RECOVERED { 0.0 } else { kept };
                afferents.u[lane] = u;
                afferents.raised[lane] = raised;
                afferents.wait[lane] = if wait > period_ms { wait - period_ms } else { 0.0 };
                below[lane] = threshold + before - last;
                waited[lane] = wait;
                *fires |= if (u >= threshold + raised) & (wait < period_ms) { 1 << k } else { 0 };
            }
        }
        let mut left = u64::from(fires[1]) << 32 | u64::from(fires[0]);
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            // The time of the spike: where linear interpolation reaches the threshold, or the end of the refractory
            // time if that is later.
            let above = afferents.u[lane] - threshold - afferents.raised[lane];
            let crossed = if below[lane] > 0.0 { period_ms * below[lane] / (below[lane] + above) } else { 0.0 };
            let since = period_ms - crossed.max(waited[lane]);
            afferents.raised[lane] += jump * libm::exp(-since / recovery_ms);
            afferents.wait[lane] = (refractory_ms - since).max(0.0);
            fired(lane);
        }
    }
}

impl<F: Filter> Rule for Receptor<F> {
    /// Afferents above their threshold fire at the next sample.
    fn begin(&mut self, now: Sample<'_>, _out: &mut Vec<Spike>) {
        let begun = |(block, values): (usize, &Block)| {
            let (state, u) = self.filter.steady_state(&self.shares(block, values));
            let raised = u.map(|u| (u - self.firing.threshold).max(0.0));
            Afferents { state, u, raised, wait: [0.0; BLOCK], still: false }
        };
        self.blocks = now.held.iter().enumerate().map(begun).collect();
    }

    #[inline(always)]
    fn sample(&mut self, now: Sample<'_>, out: &mut Vec<Spike>) {
        for (block, values) in now.held.iter().enumerate() {
            let changed = now.changed[block];
            if !changed && self.blocks[block].still {
                continue;
            }
            let (x, spikes) = (self.shares(block, values), out.len());
            let before = (!changed).then(|| self.blocks[block].clone());
            self.step(block, &x, |lane| {
                out.push(Spike { t: ms(now.t), train: (block * BLOCK + lane) as u32, value: 1.0 });
            });
            let afferents = &mut self.blocks[block];
            afferents.still = out.len() == spikes && before.is_some_and(|before| afferents.equals(&before));
        }
    }

    const SPIKES_OF_REPAIRED: bool = F::SIGNALS_VALUES;

    #[inline(always)]
    fn read(&mut self, channel: usize, from: f32, to: f32, repaired: bool) {
        if repaired && !F::SIGNALS_VALUES {
            let by = self.share(channel, to) - self.share(channel, from);
            self.filter.shift(&mut self.blocks[channel / BLOCK].state, channel % BLOCK, by);
        }
    }

    fn set_rest(&mut self, channel: usize, rest: f64) {
        if let Some(rests) = &mut self.rest {
            rests.set(channel, rest);
        }
    }

    fn rest(&self, channel: usize) -> Option<f64> {
        self.rest.as_ref().map(|rest| rest.values()[channel]).filter(|rest| rest.is_finite())
    }

    fn idle(&self) -> bool {
        self.blocks.iter().all(|afferents| afferents.still)
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::encode::fa2::Fa2;
    use crate::encode::slowly_adapting::Slow;

    /// Reference for the tests: computes each channel alone, at every sample, whether it changed or not.
    fn plainly<F: Filter>(filter: &F, firing: Firing, frames: &[Vec<f64>]) -> Vec<Spike> {
        let Firing { threshold, jump, recovery_ms, refractory_ms, period_ms, .. } = firing;
        let mut out = vec![];
        for channel in 0..frames[0].len() {
            let (mut state, u) = filter.steady_state(&[frames[0][channel]; BLOCK]);
            let (mut u, mut wait) = (u[0], 0.0);
            let mut raised = f64::max(u - threshold, 0.0);
            for (t, frame) in (1..).zip(&frames[1..]) {
                let (below, waited) = (threshold + raised - u, wait);
                u = filter.step(&mut state, 0, frame[channel], u);
                raised *= libm::exp(-period_ms / recovery_ms);
                raised = if raised < RECOVERED { 0.0 } else { raised };
                wait = f64::max(wait - period_ms, 0.0);
                if u >= threshold + raised && waited < period_ms {
                    let above = u - threshold - raised;
                    let crossed = if below > 0.0 { period_ms * below / (below + above) } else { 0.0 };
                    let since = period_ms - crossed.max(waited);
                    raised += jump * libm::exp(-since / recovery_ms);
                    wait = f64::max(refractory_ms - since, 0.0);
                    out.push(Spike { t: ms(t), train: channel as u32, value: 1.0 });
                }
            }
        }
        out.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        out
    }

    /// Compares blocks, of which only those that move are computed, with channels computed one by one; returns the
    /// number of spikes, and the number of blocks that were skipped.
    fn holds<F: Filter>(filter: &F, firing: Firing, rng: &mut StdRng) -> [usize; 2] {
        let channels = rng.random_range(1..150);
        let (noise, changing) = (10_f64.powf(rng.random_range(-6.0..2.5)), rng.random_range(0.0..1.0));
        let mut held: Vec<f64> = (0..channels).map(|_| rng.random_range(-10.0..160.0)).collect();
        let (mut left, mut moving) = (0, true);
        let frames: Vec<Vec<Block>> = (0..800)
            .map(|_| {
                // Starts a new stretch, in which all, some or none of the channels move.
                if left == 0 {
                    (left, moving) = (rng.random_range(1..500), rng.random_bool(0.5));
                }
                left -= 1;
                for held in &mut held {
                    if moving && rng.random_bool(changing) {
                        *held = (*held + noise * rng.random_range(-1.0..1.0)).clamp(-10.0, 1e6);
                    }
                }
                let block = |values: &[f64]| std::array::from_fn(|lane| values.get(lane).map_or(0.0, |&v| v as f32));
                held.chunks(BLOCK).map(block).collect()
            })
            .collect();
        let mut rule = Receptor::new(filter.clone(), firing);
        let (mut out, mut left_out) = (vec![], 0);
        rule.begin(Sample { t: 0, held: &frames[0], changed: &[], of_frame: true }, &mut out);
        for (t, pair) in (1..).zip(frames.windows(2)) {
            let changed: Vec<bool> = pair[0].iter().zip(&pair[1]).map(|(a, b)| a != b).collect();
            left_out += (0..changed.len()).filter(|&block| !changed[block] && rule.blocks[block].still).count();
            rule.sample(Sample { t, held: &pair[1], changed: &changed, of_frame: true }, &mut out);
        }
        let shares = |frame: &Vec<Block>| -> Vec<f64> {
            frame.as_flattened()[..channels]
                .iter()
                .enumerate()
                .map(|(channel, &value)| rule.share(channel, value))
                .collect()
        };
        let wanted = plainly(filter, firing, &frames.iter().map(shares).collect::<Vec<_>>());
        assert!(out == wanted, "{firing:?}: {} spikes, by themselves {}", out.len(), wanted.len());
        [out.len(), left_out]
    }

    #[test]
    fn blocks_fire_as_each_channel_would_by_itself() {
        let mut rng = StdRng::seed_from_u64(7);
        let mut counts = [[0; 2]; 2];
        for round in 0..120 {
            let mut exponent = |least: f64, most: f64| 10_f64.powf(rng.random_range(least..most));
            let period_ms = exponent(-1.3, 0.0);
            let firing = Firing {
                range: 150.0,
                threshold: exponent(-4.0, 0.3),
                jump: exponent(-4.0, 0.5),
                recovery_ms: exponent(-1.0, 2.0),
                refractory_ms: if round % 3 == 0 { 0.0 } else { exponent(-1.5, 1.5) },
                period_ms,
            };
            let (onset_ms, loss_ms, membrane_ms) = (exponent(-1.5, 2.0), exponent(-1.5, 2.0), exponent(-1.5, 1.5));
            let [spikes, left_out] = if round % 2 == 0 {
                let [onset, loss] = [rng.random_range(0.0..3.0), rng.random_range(0.0..1.0)];
                holds(&Slow::new([onset, onset_ms], [loss, loss_ms], membrane_ms, period_ms), firing, &mut rng)
            } else {
                let fa2 = Fa2 { corner_ms: onset_ms, membrane_ms, period_ms, ..Fa2::default() };
                holds(&fa2.filter(), firing, &mut rng)
            };
            counts[round % 2][0] += spikes;
            counts[round % 2][1] += left_out;
        }
        assert!(counts.as_flattened().iter().all(|&n| n > 1000), "{counts:?}");
    }
}

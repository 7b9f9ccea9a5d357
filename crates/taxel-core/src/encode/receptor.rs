//! The common part of the afferents of touch: a linear filter of pressure, and a threshold that each spike raises.
//!
//! A filter computes the potential `u` from the input. A spike is emitted when `u` reaches `threshold + a`; it raises
//! `a` by `jump` and prevents another for the refractory time; `a` decays. The potential is not reset (the neuron with
//! a moving threshold of Kobayashi, Tsubota and Shinomoto 2009, Front. Comput. Neurosci. 3:9, with one time constant).
//!
//! Between samples the pressure is taken as linear, for which each stage of a filter is exact. The time of a spike
//! within a sample is found by linear interpolation of `u` as well, and the threshold's rise decays from that time.
//! Therefore rates do not depend on the sampling period as long as it is short compared with the filter.

use super::blocks::{BLOCK, Block, NextFrame, blocks};
use super::sampled::Rule;
use crate::Spike;
use crate::spikes::ms;

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

/// Filter from pressure, as a fraction of the range, to the potential that is compared with the threshold.
pub(super) trait Filter: Send + Clone + 'static {
    /// The state of the channels of one block.
    type State: Send + Clone + 'static;

    /// The state after a constant input `x`, and the potential in it.
    fn steady_state(&self, x: &Lanes) -> (Self::State, Lanes);

    /// Processes the next sample of a channel whose potential was `u`; returns the potential. With `SEE`, sets the bits
    /// of `moved` for the lanes whose state changed.
    fn step<const SEE: bool>(&self, state: &mut Self::State, lane: usize, x: f64, u: f64, moved: &mut u64) -> f64;

    /// Whether the afferent encodes values, and not only changes; if so, a value that a state repaired counts as any
    /// other.
    const SIGNALS_VALUES: bool = false;

    /// Shifts the state of one channel by a difference that existed before, so that it does not count as a change.
    fn shift(&self, _state: &mut Self::State, _lane: usize, _by: f64) {}
}

/// The firing rule of an afferent; potentials are fractions of the range, times are in ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Firing {
    pub(super) threshold: f64,
    pub(super) jump: f64,
    pub(super) recovery_ms: f64,
    pub(super) refractory_ms: f64,
    pub(super) period_ms: f64,
}

/// Below this fraction of the range a raised threshold counts as recovered.
const RECOVERED: f64 = 1e-12;

/// The afferents of one block, aligned to cache lines so that no vector crosses a boundary.
#[derive(Clone)]
#[repr(align(64))]
struct FilterBlock<S> {
    state: S,
    u: Lanes,
    /// The current rise of the threshold.
    raised: Lanes,
    /// The remaining refractory time, ms.
    wait: Lanes,
    /// Whether a sample without change would leave this state unchanged and emit no spike.
    still: bool,
}

/// The afferents of one type, in blocks.
#[derive(Clone)]
pub(super) struct FilterAfferents<F: Filter> {
    filter: F,
    firing: Firing,
    /// The factor by which the rise of the threshold decays in one sample.
    keep: f64,
    blocks: Vec<FilterBlock<F::State>>,
}

impl<F: Filter> FilterAfferents<F> {
    pub(super) fn new(filter: F, firing: Firing) -> Self {
        Self { filter, firing, keep: libm::exp(-firing.period_ms / firing.recovery_ms), blocks: vec![] }
    }

    /// Sets the state after constant input of these pressures; afferents above their threshold fire at the next sample.
    pub(super) fn begin<'a>(&mut self, x: impl Iterator<Item = &'a Lanes>) {
        let threshold = self.firing.threshold;
        self.blocks = x
            .map(|x| {
                let (state, u) = self.filter.steady_state(x);
                let raised = std::array::from_fn(|lane| (u[lane] - threshold).max(0.0));
                FilterBlock { state, u, raised, wait: [0.0; BLOCK], still: false }
            })
            .collect();
    }

    /// Whether a block's state stays unchanged while its pressures do.
    #[inline(always)]
    pub(super) fn is_still(&self, block: usize) -> bool {
        self.blocks[block].still
    }

    /// Shifts the state of a channel by a difference that existed before.
    fn shift(&mut self, channel: usize, by: f64) {
        if !F::SIGNALS_VALUES {
            self.filter.shift(&mut self.blocks[channel / BLOCK].state, channel % BLOCK, by);
        }
    }

    pub(super) fn all_still(&self) -> bool {
        self.blocks.iter().all(|b| b.still)
    }

    /// Processes a block's next sample, `x` for each lane; calls `fired` with the lanes that fire. With `SEE`,
    /// determines whether the block is still from here on; otherwise the block counts as moving, which is always
    /// correct but slower.
    #[inline(always)]
    pub(super) fn sample<const SEE: bool>(
        &mut self,
        block: usize,
        x: impl Fn(usize) -> f64,
        mut fired: impl FnMut(usize),
    ) {
        let Firing { threshold, jump, recovery_ms, refractory_ms, period_ms } = self.firing;
        let afferent = &mut self.blocks[block];
        let mut moved = u64::from(!SEE);
        let (mut below, mut waited) = ([0.0; BLOCK], [0.0; BLOCK]);
        let mut fires = [0_u32; 2];
        for (half, fires) in fires.iter_mut().enumerate() {
            for k in 0..BLOCK / 2 {
                let lane = half * BLOCK / 2 + k;
                let (last, before, wait) = (afferent.u[lane], afferent.raised[lane], afferent.wait[lane]);
                let u = self.filter.step::<SEE>(&mut afferent.state, lane, x(lane), last, &mut moved);
                let kept = before * self.keep;
                let raised = if kept < RECOVERED { 0.0 } else { kept };
                afferent.u[lane] = u;
                afferent.raised[lane] = raised;
                afferent.wait[lane] = if wait > period_ms { wait - period_ms } else { 0.0 };
                below[lane] = threshold + before - last;
                waited[lane] = wait;
                *fires |= if (u >= threshold + raised) & (wait < period_ms) { 1 << k } else { 0 };
                if SEE {
                    moved |= before.to_bits() | wait.to_bits() | (u.to_bits() ^ last.to_bits());
                }
            }
        }
        let mut left = u64::from(fires[1]) << 32 | u64::from(fires[0]);
        afferent.still = left | moved == 0;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            // The time of the spike: where linear interpolation reaches the threshold, or the end of the refractory
            // time if that is later.
            let above = afferent.u[lane] - threshold - afferent.raised[lane];
            let crossed = if below[lane] > 0.0 { period_ms * below[lane] / (below[lane] + above) } else { 0.0 };
            let since = period_ms - crossed.max(waited[lane]);
            afferent.raised[lane] += jump * libm::exp(-since / recovery_ms);
            afferent.wait[lane] = (refractory_ms - since).max(0.0);
            fired(lane);
        }
    }
}

/// Afferents of one type, one per taxel.
#[derive(Clone)]
pub(super) struct TaxelAfferents<F: Filter> {
    afferents: FilterAfferents<F>,
    /// Factor from the sensor's unit to fractions of the range.
    scale: f64,
    channels: usize,
}

impl<F: Filter> TaxelAfferents<F> {
    pub(super) fn new(filter: F, firing: Firing, range: f64, channels: usize) -> Self {
        Self { afferents: FilterAfferents::new(filter, firing), scale: 1.0 / range, channels }
    }
}

/// Converts a pressure to a fraction of the range; negative values count as 0.
#[inline(always)]
fn share(scale: f64, pressure: f32) -> f64 {
    f64::from(pressure.max(0.0)) * scale
}

impl<F: Filter> Rule for TaxelAfferents<F> {
    fn begin(&mut self, _t: i64, held: &[Block], _out: &mut Vec<Spike>) {
        debug_assert_eq!(held.len(), blocks(self.channels));
        let x: Vec<Lanes> = held.iter().map(|values| values.map(|value| share(self.scale, value))).collect();
        self.afferents.begin(x.iter());
    }

    const PREFETCHES: bool = true;

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], next: &mut NextFrame, out: &mut Vec<Spike>) {
        for (block, values) in held.iter().enumerate() {
            next.fetch();
            let x = |lane: usize| share(self.scale, values[lane]);
            let fired = |lane| out.push(Spike { t: ms(t), train: (block * BLOCK + lane) as u32, value: 1.0 });
            if changed[block] {
                self.afferents.sample::<false>(block, x, fired);
            } else if !self.afferents.is_still(block) {
                self.afferents.sample::<true>(block, x, fired);
            }
        }
    }

    const SPIKES_OF_REPAIRED: bool = F::SIGNALS_VALUES;

    fn repair(&mut self, channel: usize, from: f32, to: f32) {
        let by = share(self.scale, to) - share(self.scale, from);
        self.afferents.shift(channel, by);
    }

    fn idle(&self) -> bool {
        self.afferents.all_still()
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::encode::fa2::Fa2;
    use crate::encode::slow::Slow;

    /// Reference for the tests: computes each channel alone, at every sample, whether it changed or not.
    fn plainly<F: Filter>(filter: &F, firing: Firing, frames: &[Vec<f64>]) -> Vec<Spike> {
        let Firing { threshold, jump, recovery_ms, refractory_ms, period_ms } = firing;
        let mut out = vec![];
        for channel in 0..frames[0].len() {
            let (mut state, u) = filter.steady_state(&[frames[0][channel]; BLOCK]);
            let (mut u, mut wait) = (u[0], 0.0);
            let mut raised = f64::max(u - threshold, 0.0);
            for (t, frame) in (1..).zip(&frames[1..]) {
                let (below, waited) = (threshold + raised - u, wait);
                u = filter.step::<true>(&mut state, 0, frame[channel], u, &mut 0);
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
        let (channels, range) = (rng.random_range(1..150), 150.0);
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
        let mut rule = TaxelAfferents::new(filter.clone(), firing, range, channels);
        let (mut out, mut left_out) = (vec![], 0);
        rule.begin(0, &frames[0], &mut out);
        for (t, pair) in (1..).zip(frames.windows(2)) {
            let changed: Vec<bool> = pair[0].iter().zip(&pair[1]).map(|(a, b)| a != b).collect();
            left_out += (0..changed.len()).filter(|&block| !changed[block] && rule.afferents.is_still(block)).count();
            rule.sample(t, &pair[1], &changed, &mut NextFrame::unknown(), &mut out);
        }
        let shares = |frame: &Vec<Block>| -> Vec<f64> {
            frame.as_flattened()[..channels].iter().map(|&value| share(rule.scale, value)).collect()
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

//! What the afferents of touch share: a linear filter of pressure, and a threshold that each spike raises.
//!
//! A filter makes the potential `u` of what is felt; a spike comes where `u` reaches `threshold + a`, raises `a` by
//! `jump` and forbids another for the refractory time; `a` decays. Nothing is reset (the neuron with a moving threshold
//! of Kobayashi, Tsubota and Shinomoto 2009, Front. Comput. Neurosci. 3:9, with one time constant).
//!
//! Between samples pressure counts as a straight line, on which each stage of a filter is exact; where within a sample
//! the threshold was reached is found on a straight line as well, and what the spike leaves behind decays from there. So
//! rates do not depend on the sampling period as long as it is short beside the filter.

use super::sampled::{BLOCK, Block, Rule, blocks};
use crate::Spike;
use crate::spikes::ms;

/// One number a channel of a block.
pub(super) type Lanes = [f64; BLOCK];

/// A first-order low pass over one sample, exact for an input that is a straight line between samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    keep: f64,
    before: f64,
    now: f64,
}

impl LowPass {
    pub(super) fn new(tau_ms: f64, period_ms: f64) -> Self {
        let keep = (-period_ms / tau_ms).exp();
        let mean = -(-period_ms / tau_ms).exp_m1() * tau_ms / period_ms;
        Self { keep, before: mean - keep, now: 1.0 - mean }
    }

    /// The next output, of the last one and the inputs before and now.
    #[inline(always)]
    pub(super) fn step(self, last: f64, before: f64, now: f64) -> f64 {
        self.keep * last + self.before * before + self.now * now
    }
}

/// How an afferent turns pressure, in shares of the range, into the potential that its threshold is held against.
pub(super) trait Filter: Send + Clone + 'static {
    /// Of the channels of one block.
    type State: Send + Clone + 'static;

    /// The state in which `x` has always been, and the potential then.
    fn settled(&self, x: &Lanes) -> (Self::State, Lanes);

    /// Takes the next sample; `u` becomes the potential. Says whether anything moved.
    fn step(&self, state: &mut Self::State, x: &Lanes, u: &mut Lanes) -> bool;

    /// Whether it tells what is, and not only changes: then a value that a state repaired counts as any other.
    const TELLS_VALUES: bool = false;

    /// Moves what it holds of one channel by a difference that was there before, so that it is no change.
    fn shift(&self, _state: &mut Self::State, _lane: usize, _by: f64) {}
}

/// When an afferent fires; potentials in shares of the range, times in ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Firing {
    pub(super) threshold: f64,
    pub(super) jump: f64,
    pub(super) recovery_ms: f64,
    pub(super) refractory_ms: f64,
    pub(super) period_ms: f64,
}

/// Below this share of the range a raised threshold counts as recovered.
const RECOVERED: f64 = 1e-12;

/// The afferents of one block.
#[derive(Clone)]
struct Afferent<S> {
    state: S,
    u: Lanes,
    /// How much the threshold is raised.
    raised: Lanes,
    /// How long no spike may come yet, ms.
    wait: Lanes,
    /// Whether a sample without change would leave all this as it is, and fire nothing.
    still: bool,
}

/// The afferents of one type, a block at a time.
#[derive(Clone)]
pub(super) struct Afferents<F: Filter> {
    filter: F,
    firing: Firing,
    /// What the raised threshold keeps over one sample.
    keep: f64,
    blocks: Vec<Afferent<F::State>>,
}

impl<F: Filter> Afferents<F> {
    pub(super) fn new(filter: F, firing: Firing) -> Self {
        Self { filter, firing, keep: (-firing.period_ms / firing.recovery_ms).exp(), blocks: vec![] }
    }

    /// Begins as if these pressures had always been: whatever fires by them is about to.
    pub(super) fn begin<'a>(&mut self, x: impl Iterator<Item = &'a Lanes>) {
        let threshold = self.firing.threshold;
        self.blocks = x
            .map(|x| {
                let (state, u) = self.filter.settled(x);
                let raised = std::array::from_fn(|lane| (u[lane] - threshold).max(0.0));
                Afferent { state, u, raised, wait: [0.0; BLOCK], still: false }
            })
            .collect();
    }

    /// Whether a block would stay as it is where its pressures do.
    #[inline(always)]
    pub(super) fn is_still(&self, block: usize) -> bool {
        self.blocks[block].still
    }

    /// Moves what a channel holds by a difference that was there before.
    fn shift(&mut self, channel: usize, by: f64) {
        if !F::TELLS_VALUES {
            self.filter.shift(&mut self.blocks[channel / BLOCK].state, channel % BLOCK, by);
        }
    }

    pub(super) fn all_still(&self) -> bool {
        self.blocks.iter().all(|b| b.still)
    }

    /// Takes a block's next sample; tells `fired` the lanes that fire.
    #[inline(always)]
    pub(super) fn sample(&mut self, block: usize, x: &Lanes, mut fired: impl FnMut(usize)) {
        let Firing { threshold, jump, recovery_ms, refractory_ms, period_ms } = self.firing;
        let afferent = &mut self.blocks[block];
        let last = afferent.u;
        let moved = self.filter.step(&mut afferent.state, x, &mut afferent.u);
        let (mut any, mut busy) = (0_u64, 0_u64);
        let mut fires = [0_u64; BLOCK];
        let (mut below, mut waited) = ([0.0; BLOCK], [0.0; BLOCK]);
        for lane in 0..BLOCK {
            let (u, before, wait) = (afferent.u[lane], afferent.raised[lane], afferent.wait[lane]);
            let kept = before * self.keep;
            let raised = if kept < RECOVERED { 0.0 } else { kept };
            below[lane] = threshold + before - last[lane];
            waited[lane] = wait;
            let fire = u64::from(u >= threshold + raised) & u64::from(wait < period_ms);
            afferent.raised[lane] = raised;
            afferent.wait[lane] = if wait > period_ms { wait - period_ms } else { 0.0 };
            fires[lane] = fire;
            any |= fire;
            busy |= before.to_bits() | wait.to_bits();
        }
        if any != 0 {
            for lane in (0..BLOCK).filter(|&lane| fires[lane] != 0) {
                // Where on the straight line from below to above the threshold, or as soon as it may fire again.
                let above = afferent.u[lane] - threshold - afferent.raised[lane];
                let crossed = if below[lane] > 0.0 { period_ms * below[lane] / (below[lane] + above) } else { 0.0 };
                let since = period_ms - crossed.max(waited[lane]);
                afferent.raised[lane] += jump * (-since / recovery_ms).exp();
                afferent.wait[lane] = (refractory_ms - since).max(0.0);
                fired(lane);
            }
        }
        afferent.still = any | busy == 0 && !moved;
    }
}

/// Afferents of one type, one a taxel.
#[derive(Clone)]
pub(super) struct ByTaxel<F: Filter> {
    afferents: Afferents<F>,
    /// Shares of the range a unit of pressure.
    scale: f64,
    channels: usize,
}

impl<F: Filter> ByTaxel<F> {
    pub(super) fn new(filter: F, firing: Firing, range: f64, channels: usize) -> Self {
        Self { afferents: Afferents::new(filter, firing), scale: 1.0 / range, channels }
    }
}

/// Pressures in shares of the range; what lies below 0 counts as 0.
#[inline(always)]
fn shares(scale: f64, values: &Block) -> Lanes {
    std::array::from_fn(|lane| f64::from(values[lane].max(0.0)) * scale)
}

impl<F: Filter> Rule for ByTaxel<F> {
    fn trains(&self) -> usize {
        self.channels
    }

    fn signed(&self) -> bool {
        false
    }

    fn begin(&mut self, _t: i64, held: &[Block], _out: &mut Vec<Spike>) {
        debug_assert_eq!(held.len(), blocks(self.channels));
        let x: Vec<Lanes> = held.iter().map(|values| shares(self.scale, values)).collect();
        self.afferents.begin(x.iter());
    }

    #[inline(always)]
    fn sample(&mut self, t: i64, held: &[Block], changed: &[bool], out: &mut Vec<Spike>) {
        for (block, values) in held.iter().enumerate() {
            if changed[block] || !self.afferents.is_still(block) {
                let x = shares(self.scale, values);
                self.afferents.sample(block, &x, |lane| {
                    out.push(Spike { t: ms(t), train: (block * BLOCK + lane) as u32, value: 1.0 });
                });
            }
        }
    }

    const HEARS_REPAIRED: bool = F::TELLS_VALUES;

    fn repair(&mut self, channel: usize, from: f32, to: f32) {
        let by = f64::from(to.max(0.0)) * self.scale - f64::from(from.max(0.0)) * self.scale;
        self.afferents.shift(channel, by);
    }

    fn idle(&self) -> bool {
        self.afferents.all_still()
    }
}

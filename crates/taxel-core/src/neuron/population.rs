//! Many neurons on the same inputs at once.
//!
//! Neurons go in blocks: while all of time runs through a block, its weights stay in the cache. States of a block lie side
//! by side and move in step. What can happen at all is told from a bound that costs a few operations a neuron; only where
//! it says "perhaps" a neuron is looked at by itself, by the code of the single neuron, so both say the same.

mod continuous;
mod grid;

use super::{AT_EDGE, AfterSpike, Neuron, Time};
use crate::{Result, SpikeTrains, Stop, problem};

/// Neurons in a block: with 1000 inputs 256 KiB of weights.
const LANES: usize = 32;

/// By how much the bound may be off by rounding: relative for a decayed rise, and absolute, mV in proportion to `theta_0`.
const FADED: f64 = 1.0 - 1e-9;
const SLACK: f64 = 1e-11;

/// A number that weights come in.
pub trait Weight: Copy + Default + Into<f64> {}
impl Weight for f32 {}
impl Weight for f64 {}

/// The states of a block's neurons.
struct Lanes {
    a: [f64; LANES],
    b: [f64; LANES],
    /// What is left of the threshold's rise, mV; infinite in the refractory time.
    rise: [f64; LANES],
    /// When the refractory time ends and the rise sets in, ms; infinite where neither lies ahead.
    edge: [f64; LANES],
    /// Inputs after the first and up to the second time are lost, ms.
    deaf_from: [f64; LANES],
    deaf_until: [f64; LANES],
}

impl Lanes {
    /// Neurons at rest; `edge` is that of the printed first threshold.
    fn new(edge: Option<f64>) -> Self {
        Self {
            a: [0.0; LANES],
            b: [0.0; LANES],
            rise: [0.0; LANES],
            edge: [edge.unwrap_or(f64::INFINITY); LANES],
            deaf_from: [f64::NEG_INFINITY; LANES],
            deaf_until: [f64::NEG_INFINITY; LANES],
        }
    }

    /// A spike at `t`: the neuron falls silent until `edge`, and deaf too where inputs are lost.
    fn fire(&mut self, lane: usize, t: f64, edge: f64, after_spike: AfterSpike) {
        self.rise[lane] = f64::INFINITY;
        self.edge[lane] = edge;
        if after_spike != AfterSpike::Keep {
            self.deaf_until[lane] = edge + AT_EDGE;
        }
        if after_spike == AfterSpike::Ignore {
            self.deaf_from[lane] = t + AT_EDGE;
        }
    }

    /// 1 for a neuron that hears an input at `t`, 0 where it is lost.
    #[inline(always)]
    fn hears(&self, t: f64) -> [f64; LANES] {
        let mut hears = [1.0; LANES];
        for (l, hears) in hears.iter_mut().enumerate() {
            let lost = (self.deaf_from[l] < t) & (t <= self.deaf_until[l]);
            *hears = if lost { 0.0 } else { 1.0 };
        }
        hears
    }
}

/// What all neurons have in common.
enum Script {
    Continuous(continuous::Script),
    Grid(grid::Script),
}

impl Neuron {
    /// The output spikes of many neurons to the same trains, one train a neuron.
    ///
    /// Spikes are those of [`Neuron::run`] with each neuron's weights. `weights` holds neuron after neuron, one a train.
    /// Cost: a few operations an input spike and neuron.
    ///
    /// # Errors
    ///
    /// As [`Neuron::run`], naming neuron and train of a weight.
    pub fn run_many<W: Weight>(
        &self,
        weights: &[W],
        neurons: usize,
        trains: &SpikeTrains,
        threshold: f64,
        stop: Stop<'_>,
    ) -> Result<SpikeTrains> {
        self.check_inputs(&vec![0.0; trains.len()], trains)?;
        self.stream(&[], threshold, trains.start)?;
        if neurons.checked_mul(trains.len()) != Some(weights.len()) {
            let (given, inputs) = (weights.len(), trains.len());
            return Err(problem!("weights: {given} for {neurons} neurons of {inputs} trains, must be one each"));
        }
        if self.time == Time::Grid {
            self.check_rows(self.points(trains.start, trains.stop))?;
        }
        let script = match self.time {
            Time::Continuous => Script::Continuous(continuous::Script::new(self, trains, threshold)),
            Time::Grid => Script::Grid(grid::Script::new(self, trains, threshold)),
        };
        let mut out =
            SpikeTrains { times: vec![], offsets: vec![0], values: None, start: trains.start, stop: trains.stop };
        let mut block = vec![[W::default(); LANES]; trains.len()];
        let mut fired: [Vec<f64>; LANES] = std::array::from_fn(|_| vec![]);
        for first in (0..neurons).step_by(LANES) {
            stop.check()?;
            let count = LANES.min(neurons - first);
            gather(&weights[first * trains.len()..(first + count) * trains.len()], &mut block);
            if let Some((train, row)) =
                block.iter().enumerate().find(|(_, row)| !row.iter().all(|&w| w.into().is_finite()))
            {
                let lane = row.iter().position(|&w| !w.into().is_finite()).unwrap_or(0);
                let value: f64 = row[lane].into();
                return Err(problem!("weights[{}, {train}] is {value}: must be finite", first + lane));
            }
            match &script {
                Script::Continuous(script) => continuous::run(self, script, &block, &mut fired),
                Script::Grid(script) => grid::run(self, script, &block, &mut fired),
            }
            for spikes in &mut fired[..count] {
                out.times.append(spikes);
                out.offsets.push(out.times.len());
            }
        }
        Ok(out)
    }
}

/// Lays the weights of up to [`LANES`] neurons side by side, train by train; missing neurons weigh 0.
fn gather<W: Weight>(weights: &[W], block: &mut [[W; LANES]]) {
    /// So many trains at a time that reading and writing stay within few lines of the cache.
    const TILE: usize = 16;
    let trains = block.len();
    for row in weights.len() / trains.max(1)..LANES {
        for lanes in &mut *block {
            lanes[row] = W::default();
        }
    }
    for (k, tile) in block.chunks_mut(TILE).enumerate() {
        for (lane, row) in weights.chunks_exact(trains).enumerate() {
            for (lanes, &w) in tile.iter_mut().zip(&row[k * TILE..]) {
                lanes[lane] = w;
            }
        }
    }
}

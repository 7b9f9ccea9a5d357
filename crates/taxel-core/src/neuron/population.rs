//! Many neurons on the same inputs at once.
//!
//! Neurons are processed in blocks: the weights of a block stay in the cache while the whole recording runs through it,
//! and the states of its neurons are advanced together by vector instructions. A cheap upper bound of the potential
//! excludes most crossings; where it cannot, the code of the single neuron runs, so that both give the same spikes.

mod continuous;
mod grid;
mod lanes;

pub use lanes::Weight;

use lanes::LANES;

use super::model::{Neuron, Time};
use crate::allowed::{is_weight, weight_error};
use crate::{Result, SpikeKind, SpikeTrains, Stop, problem};

/// The input sequence, computed once for all neurons.
enum Script {
    Continuous(continuous::Script),
    Grid(grid::Script),
}

impl Neuron {
    /// The output spikes of many neurons to the same trains, one train per neuron.
    ///
    /// The spikes equal those of [`Neuron::run`] with each neuron's weights. `weights` lists the weights by neuron, one
    /// per train.
    /// Cost: a few operations per input spike and neuron.
    ///
    /// # Errors
    ///
    /// Those of [`Neuron::run`]; the message names neuron and train of a weight.
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
            let (count, inputs) = (weights.len(), trains.len());
            return Err(problem!(
                "weights"; ": {count} for {neurons} neurons of {inputs} trains; must be one per neuron and train"
            ));
        }
        if self.time == Time::Grid {
            self.check_rows(self.points(trains.start, trains.stop))?;
        }
        let script = match self.time {
            Time::Continuous => Script::Continuous(continuous::Script::new(self, trains, threshold, stop)?),
            Time::Grid => Script::Grid(grid::Script::new(self, trains, threshold, stop)?),
        };
        let mut out = SpikeTrains {
            kind: SpikeKind::Unsigned,
            times: vec![],
            offsets: vec![0],
            values: None,
            start: trains.start,
            stop: trains.stop,
        };
        let mut block = vec![[W::default(); LANES]; trains.len()];
        let mut fired: [Vec<f64>; LANES] = std::array::from_fn(|_| vec![]);
        for first in (0..neurons).step_by(LANES) {
            stop.check()?;
            let count = LANES.min(neurons - first);
            gather(&weights[first * trains.len()..(first + count) * trains.len()], &mut block);
            if let Some((train, row)) =
                block.iter().enumerate().find(|(_, row)| !row.iter().all(|&w| is_weight(w.into())))
            {
                let lane = row.iter().position(|&w| !is_weight(w.into())).unwrap_or(0);
                return Err(weight_error(&format!("weights[{}, {train}]", first + lane), row[lane].into()));
            }
            match &script {
                Script::Continuous(script) => continuous::run(self, script, &block, &mut fired, stop)?,
                Script::Grid(script) => grid::run(self, script, &block, &mut fired, stop)?,
            }
            for spikes in &mut fired[..count] {
                out.times.append(spikes);
                out.offsets.push(out.times.len());
            }
        }
        Ok(out)
    }
}

/// Copies the weights of up to [`LANES`] neurons side by side, train by train; missing neurons get weight 0.
fn gather<W: Weight>(weights: &[W], block: &mut [[W; LANES]]) {
    /// The number of trains copied at a time, small enough for reads and writes to stay in the cache.
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

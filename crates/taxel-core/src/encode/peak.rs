//! Peak: the largest deviation of a taxel in units of its own noise, with what several loaded taxels add. It does not
//! depend on position, nor on neighbours, so it serves a single taxel and channels too.

use serde::{Deserialize, Serialize};

use super::blocks::Block;
use super::by_stamp::{ByStamp, Measure};
use super::encoding::Encoding;
use super::loaded::{Loaded, require_tare};
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::rest::{Baseline, FAR_NOISE, Value};
use crate::spikes::ms;
use crate::vectors::{LANES, wide};
use crate::{Array, Result, Spike, SpikeKind, problem};

/// From so many units of noise on, what a taxel reads adds to what others read.
const ADDS_FROM: f32 = 4.0;

parameters! {
    /// Peak: rises and falls of the largest deviation from the rest through levels, in units of each taxel's own noise.
    ///
    /// With u a value less its rest, divided by the taxel's standard deviation in the tare (at least `least_noise`), the
    /// peak is the largest u, and where several are 4 or more, the root of the sum of their squares; at least 0. The rest
    /// begins at the tare and follows each taxel's value, as that of [`LocalLoad`](super::LocalLoad). A taxel without a
    /// rest in the tare is left out; one that is 0 from the first value on has no value yet and counts as at rest.
    ///
    /// Trains, unsigned: rises to each level, then falls below `release` times each. They are computed once a stamp,
    /// after its last event, and as the rest moves.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Peak {
        /// The smallest noise of a taxel, in the sensor's unit. Default 0.3, the deviation within a tick.
        pub least_noise: f64 = 0.3, "", Range::within(1e-9, 1e9);
        /// Levels of the peak, in units of noise, ascending; default 5, 6, 8, 12, 20.
        pub levels: Vec<f64> = vec![5.0, 6.0, 8.0, 12.0, 20.0], "", Range::ABOVE_0;
        /// The part of a level below which it is left, from 0.01 to 1; default 0.7. Below 1, noise near a level does
        /// not cross it again and again.
        pub release: f64 = 0.7, "", Range::within(0.01, 1.0);
        /// The taxels' rest and noise. It is valid for one board on one day: a saved readout has none and receives one
        /// when it is used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

impl Encoding for Peak {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.levels.is_empty() {
            return Err(problem!("levels"; " is empty: must contain one level or more"));
        }
        if let Some(k) = self.levels.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(problem!("levels"; "[{}]: must be above the level before", k + 1));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let loaded = Loaded::never("peak", array, self.tare.as_ref())?;
        let load = PeakLoad::new(array, self.tare.as_ref(), self.least_noise)?;
        let reached = vec![false; self.levels.len()];
        let crossings = PeakCrossings { load, levels: self.levels.clone(), release: self.release, reached };
        Ok(Box::new(ByStamp::new(crossings, loaded, array)))
    }

    fn trains(&self, _array: &Array) -> usize {
        2 * self.levels.len()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

wide! {
    /// The largest value in units of its noise, at least 0, and the sum of the squares of those that add.
    fn extent(above: &[f32], per_noise: &[f32]) -> (f32, f64) {
        let (mut largest, mut squares) = ([0.0_f32; LANES], [0.0_f64; LANES]);
        for (above, per_noise) in above.as_chunks::<LANES>().0.iter().zip(per_noise.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                let units = above[lane] * per_noise[lane];
                largest[lane] = if units > largest[lane] { units } else { largest[lane] };
                let adds = f64::from(if units >= ADDS_FROM { units } else { 0.0 });
                squares[lane] += adds * adds;
            }
        }
        (largest.into_iter().fold(0.0, f32::max), squares.into_iter().sum())
    }
}

/// Computes the peak of values above a tracked rest.
#[derive(Clone)]
pub(super) struct PeakLoad {
    baseline: Baseline,
    /// 1 over each taxel's noise; 0 of those left out.
    per_noise: Vec<f32>,
    least: f64,
    values: Vec<f32>,
    /// Taxels that have been 0 since the first value: they have no value yet, and count as at rest.
    waiting: Vec<usize>,
    begun: bool,
}

impl PeakLoad {
    /// Starts from a tare; a taxel's noise is at least `least`.
    pub(super) fn new(array: &Array, tare: Option<&Tare>, least: f64) -> Result<Self> {
        let tare = require_tare("peak", tare)?;
        let (rest, noise) = (tare.rest_of(array)?, tare.place_noise());
        let mut per_noise = vec![0.0; array.len()];
        let mut far = vec![f32::INFINITY; array.len()];
        for taxel in (0..array.len()).filter(|&taxel| rest.values()[taxel] != f64::NO_REST && array.has(taxel)) {
            let noise = noise[taxel].max(least);
            per_noise[taxel] = noise.recip() as f32;
            far[taxel] = (FAR_NOISE * noise) as f32;
        }
        let baseline = Baseline::tracked(rest.values().to_vec(), far);
        Ok(Self { baseline, per_noise, least, values: vec![0.0; array.len()], waiting: vec![], begun: false })
    }

    /// Reads the values of all taxels, row by row, at `t` us; returns the peak.
    pub(super) fn take(&mut self, t: i64, held: &[f32]) -> f64 {
        self.values.copy_from_slice(&held[..self.per_noise.len()]);
        if !self.begun {
            self.waiting = (0..self.values.len()).filter(|&taxel| self.values[taxel] == 0.0).collect();
            self.begun = true;
        }
        let (values, rest) = (&mut self.values, self.baseline.values());
        self.waiting.retain(|&taxel| values[taxel] == 0.0);
        for &taxel in &self.waiting {
            values[taxel] = if rest[taxel] == f64::NO_REST { 0.0 } else { rest[taxel] as f32 };
        }
        let (above, per_noise) = (self.baseline.take(t, &self.values), &self.per_noise[..]);
        // Those behind the last whole group stand in one of their own, beside zeros.
        let grouped = above.len() / LANES * LANES;
        let mut rest = [[0.0; LANES]; 2];
        for (group, values) in rest.iter_mut().zip([above, per_noise]) {
            group[..values.len() - grouped].copy_from_slice(&values[grouped..]);
        }
        let (first, last) = (extent(&above[..grouped], &per_noise[..grouped]), extent(&rest[0], &rest[1]));
        f64::from(first.0.max(last.0)).max((first.1 + last.1).sqrt())
    }

    /// Sets the rest of a taxel, by index, from now on.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        if self.per_noise[taxel] == 0.0 {
            self.per_noise[taxel] = self.least.recip() as f32;
            self.baseline.set_far(taxel, (FAR_NOISE * self.least) as f32);
        }
        self.baseline.set(taxel, rest);
    }
}

/// Crossings of levels by the peak.
#[derive(Clone)]
struct PeakCrossings {
    load: PeakLoad,
    levels: Vec<f64>,
    release: f64,
    reached: Vec<bool>,
}

impl Measure for PeakCrossings {
    fn trains(&self) -> usize {
        2 * self.levels.len()
    }

    fn drifts(&self) -> bool {
        true
    }

    fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.load.set_rest(taxel, rest);
    }

    fn emit(&mut self, t: i64, _loaded: &Loaded, held: &[Block], out: &mut Vec<Spike>) {
        // In single precision, as plain rules compare it.
        let now = f64::from(self.load.take(t, held.as_flattened()) as f32);
        let mut left = vec![];
        for (train, (&level, reached)) in self.levels.iter().zip(&mut self.reached).enumerate() {
            if !*reached && now >= level {
                *reached = true;
                out.push(Spike { t: ms(t), train: train as u32, value: 1.0 });
            } else if *reached && now < self.release * level {
                *reached = false;
                left.push(Spike { t: ms(t), train: (self.levels.len() + train) as u32, value: 1.0 });
            }
        }
        out.append(&mut left);
    }
}

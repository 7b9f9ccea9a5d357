//! The largest deviation of a taxel from a tracked rest, in units of its own noise, with what several taxels add.

use super::tare::Tare;
use crate::rest::{Baseline, FAR_NOISE, Value, Waiting};
use crate::vectors::{LANES, wide};
use crate::{Array, Result};

/// From so many units of noise on, what a taxel reads adds to what others read.
const ADDS_FROM: f32 = 4.0;

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
    waiting: Waiting,
}

impl PeakLoad {
    /// Starts from a tare; a taxel's noise is at least `least`.
    pub(super) fn new(array: &Array, tare: &Tare, least: f64) -> Result<Self> {
        let (rest, noise) = (tare.rest_of(array)?, tare.place_noise());
        let mut per_noise = vec![0.0; array.len()];
        let mut far = vec![f32::INFINITY; array.len()];
        for taxel in (0..array.len()).filter(|&taxel| rest.values()[taxel] != f64::NO_REST && array.has(taxel)) {
            let noise = noise[taxel].max(least);
            per_noise[taxel] = noise.recip() as f32;
            far[taxel] = (FAR_NOISE * noise) as f32;
        }
        let baseline = Baseline::tracked(rest.values().to_vec(), far);
        Ok(Self { baseline, per_noise, least, values: vec![0.0; array.len()], waiting: Waiting::default() })
    }

    /// Reads the values of all taxels, row by row, at `t` us; returns the peak.
    pub(super) fn take(&mut self, t: i64, held: &[f32]) -> f64 {
        self.values.copy_from_slice(&held[..self.per_noise.len()]);
        self.waiting.fill(&mut self.values, self.baseline.values());
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

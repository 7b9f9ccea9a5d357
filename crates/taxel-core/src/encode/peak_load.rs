//! The largest deviation of a taxel from its rest, in units of its own noise, with what several taxels add.

use super::tare::Tare;
use crate::rest::{Value, Waiting};
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

/// Computes the peak of values above the rest.
#[derive(Clone)]
pub(super) struct PeakLoad {
    /// The rest of each taxel; 0 of those left out.
    rest: Vec<f32>,
    /// 1 over each taxel's noise; 0 of those left out.
    per_noise: Vec<f32>,
    least: f64,
    above: Vec<f32>,
    waiting: Waiting,
}

impl PeakLoad {
    /// Starts from a tare; a taxel's noise is at least `least`.
    pub(super) fn new(array: &Array, tare: &Tare, least: f64) -> Result<Self> {
        let (rest, noise, zeros) = (tare.rest_of(array)?, tare.place_noise(), vec![0.0; array.len()]);
        let (per_noise, above) = (zeros.clone(), zeros.clone());
        let mut new = Self { rest: zeros, per_noise, least, above, waiting: Waiting::default() };
        for (taxel, &rest) in rest.values().iter().enumerate().filter(|(_, rest)| **rest != f64::NO_REST) {
            new.per_noise[taxel] = noise[taxel].max(least).recip() as f32;
            new.set_rest(taxel, rest);
        }
        Ok(new)
    }

    /// Reads the values of all taxels, row by row; returns the peak.
    pub(super) fn take(&mut self, held: &[f32]) -> f64 {
        let Self { rest, per_noise, above, .. } = self;
        above.copy_from_slice(&held[..rest.len()]);
        self.waiting.fill(above, rest);
        above.iter_mut().zip(&*rest).for_each(|(above, rest)| *above -= rest);
        // Those behind the last whole group stand in one of their own, beside zeros.
        let grouped = above.len() / LANES * LANES;
        let mut others = [[0.0; LANES]; 2];
        for (group, values) in others.iter_mut().zip([&above[..], per_noise]) {
            group[..values.len() - grouped].copy_from_slice(&values[grouped..]);
        }
        let (first, last) = (extent(&above[..grouped], &per_noise[..grouped]), extent(&others[0], &others[1]));
        f64::from(first.0.max(last.0)).max((first.1 + last.1).sqrt())
    }

    /// Sets the rest of a taxel, by index, from now on.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        if self.per_noise[taxel] == 0.0 {
            self.per_noise[taxel] = self.least.recip() as f32;
        }
        self.rest[taxel] = rest as f32;
    }
}

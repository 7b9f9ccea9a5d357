//! The load on a sensor: the sum of what its taxels read above rest, each alone, with and without the largest.

use super::blocks::{BLOCK, Block, blocks};
use super::driver::Sample;
use super::tare::Tare;
use crate::rest::{Rest, Value, touched_from};
use crate::vectors::wide;
use crate::{Array, Result};

/// A taxel is part of a load from so many times its own noise on, and from that part of the noise floor: above both, noise
/// hides loads of weak contacts, below them it adds up (six emulated boards, ten scenes learnt, 45 others).
const TIMES_NOISE: f64 = 4.0;
const OF_FLOOR: f64 = 0.75;

wide! {
    /// The sum of the values of loaded taxels above rest, and the largest of them.
    fn above_rest(held: &Block, rest: &Block, from: &Block) -> (f64, f32) {
        let (mut sum, mut largest) = (0.0, 0.0_f32);
        for lane in 0..BLOCK {
            let above = if held[lane] >= from[lane] { held[lane] - rest[lane] } else { 0.0 };
            largest = if above > largest { above } else { largest };
            sum += f64::from(above);
        }
        (sum, largest)
    }
}

/// Computes the load from the values of all taxels.
#[derive(Clone)]
pub(super) struct LoadSum {
    /// Each taxel's rest, and the smallest value at which it is loaded; infinite if there is none.
    rest: Vec<Block>,
    from: Vec<Block>,
    noise: Vec<f64>,
    floor: f64,
    /// Of each block the sum, and the largest value above rest.
    sums: Vec<(f64, f32)>,
}

impl LoadSum {
    /// Starts with no taxel loaded.
    pub(super) fn new(array: &Array, tare: &Tare, floor: f64) -> Result<Self> {
        let (rest, n): (Rest<f64>, _) = (tare.rest_of(array)?, blocks(array.len()));
        let empty = || vec![[f32::INFINITY; BLOCK]; n];
        let sums = vec![(0.0, 0.0); n];
        let mut new = Self { rest: empty(), from: empty(), noise: tare.place_noise(), floor, sums };
        for (taxel, &rest) in rest.values().iter().enumerate().filter(|(_, rest)| **rest != f64::NO_REST) {
            new.set_rest(taxel, rest);
        }
        Ok(new)
    }

    /// Changes the rest of a taxel; the caller must pass its value again.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        let floor = (OF_FLOOR * self.floor).max(TIMES_NOISE * self.noise[taxel]);
        let place = (taxel / BLOCK, taxel % BLOCK);
        self.rest[place.0][place.1] = rest as f32;
        self.from[place.0][place.1] = touched_from(rest, floor) as f32;
    }

    /// Reads the values of the blocks that changed; returns the load, and the load without its largest taxel.
    pub(super) fn take(&mut self, now: Sample<'_>) -> [f64; 2] {
        for (block, held) in now.held.iter().enumerate().filter(|&(block, _)| now.changed[block]) {
            self.sums[block] = above_rest(held, &self.rest[block], &self.from[block]);
        }
        let load: f64 = self.sums.iter().map(|sum| sum.0).sum();
        let largest = self.sums.iter().map(|sum| sum.1).fold(0.0, f32::max);
        [load, load - f64::from(largest)]
    }
}

//! Determines which taxels are loaded, and their number, for encoders that do not depend on position.

use super::blocks::{BLOCK, Block, blocks};
use super::tare::Tare;
use crate::rest::{Rest, touched_from};
use crate::vectors::wide;
use crate::{Array, Result, problem};

/// The smallest f32 that is not below `x`.
fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

wide! {
    /// Whether the same places are loaded as before.
    fn as_loaded(held: &Block, from: &Block, loaded: &[u32; BLOCK]) -> bool {
        let mut other = 0;
        for lane in 0..BLOCK {
            other |= u32::from(held[lane] >= from[lane]) ^ loaded[lane];
        }
        other == 0
    }
}

/// The loaded places of an array.
///
/// A place is loaded while its value exceeds its rest by more than the noise floor and half a tick; it counts only if
/// one of its 8 neighbours is loaded too, which rejects noise.
#[derive(Clone)]
pub(super) struct Loaded {
    rows: usize,
    columns: usize,
    /// Smallest value at which each place is loaded; infinite if its rest is not known.
    from: Vec<Block>,
    noise_floor: f64,
    rest: Rest<f64>,
    /// 1 for each loaded place, otherwise 0.
    loaded: Vec<[u32; BLOCK]>,
    /// Number of loaded neighbours of each place.
    neighbours: Vec<u8>,
    /// Number of loaded places with a loaded neighbour.
    area: u32,
}

/// Sums over the taxels that count.
#[derive(Default)]
pub(super) struct Sums {
    /// Sum of the values above rest.
    pub(super) total: f64,
    /// Largest value above rest.
    pub(super) peak: f64,
    /// Sum of the columns, weighted by the values above rest.
    pub(super) x: f64,
    /// Sum of the rows, likewise.
    pub(super) y: f64,
}

impl Loaded {
    /// Starts with no taxel loaded; `what` names the encoder in an error.
    pub(super) fn new(what: &str, array: &Array, tare: Option<&Tare>, noise_floor: f64) -> Result<Self> {
        let Some(tare) = tare else {
            return Err(problem!("{what} without a tare: take one at rest and give it as tare"));
        };
        let (rest, n) = (tare.rest_of(array)?, blocks(array.len()));
        let mut fresh = Self {
            rows: usize::from(array.rows),
            columns: usize::from(array.columns),
            loaded: vec![[0; BLOCK]; n],
            from: vec![[f32::INFINITY; BLOCK]; n],
            noise_floor,
            rest,
            neighbours: vec![0; array.len()],
            area: 0,
        };
        (0..array.len()).for_each(|place| fresh.rest_changed(place));
        Ok(fresh)
    }

    /// Changes the rest of a place; the caller must pass its value again.
    pub(super) fn set_rest(&mut self, place: usize, rest: f64) {
        self.rest.set(place, rest);
        self.rest_changed(place);
    }

    fn rest_changed(&mut self, place: usize) {
        let from = touched_from(self.rest.values()[place], self.noise_floor);
        self.from[place / BLOCK][place % BLOCK] = round_up(from);
    }

    /// The rest of a place; `None` if it is not known.
    pub(super) fn rest(&self, place: usize) -> Option<f64> {
        Some(self.rest.values()[place]).filter(|rest| rest.is_finite())
    }

    /// Difference between a value and a place's rest.
    fn above(&self, place: usize, value: f32) -> f64 {
        self.rest.above(place, f64::from(value))
    }

    /// Number of taxels that count.
    pub(super) fn area(&self) -> u32 {
        self.area
    }

    /// Whether any place of a block is loaded.
    fn any(&self, block: usize) -> bool {
        self.loaded[block].iter().any(|&l| l != 0)
    }

    /// Whether a place counts: it and one of its neighbours are loaded.
    fn counts(&self, place: usize) -> bool {
        self.is_loaded(place) && self.neighbours[place] > 0
    }

    /// Sums over the taxels that count, from the values of all places; they are added in the order of places.
    pub(super) fn sums(&self, held: &[Block]) -> Sums {
        let mut sums = Sums::default();
        if self.area == 0 {
            return sums;
        }
        let places = self.neighbours.len();
        for (block, values) in held.iter().enumerate().filter(|&(block, _)| self.any(block)) {
            for (place, &value) in (block * BLOCK..places).zip(values) {
                if self.counts(place) {
                    let above = self.above(place, value);
                    sums.total += above;
                    sums.peak = sums.peak.max(above);
                    sums.x += above * (place % self.columns) as f64;
                    sums.y += above * (place / self.columns) as f64;
                }
            }
        }
        sums
    }

    /// Updates the value of a place.
    pub(super) fn take(&mut self, place: usize, value: f32) {
        if (value >= self.from[place / BLOCK][place % BLOCK]) != self.is_loaded(place) {
            self.toggle(place);
        }
    }

    /// Updates the values of a block of places.
    pub(super) fn take_block(&mut self, block: usize, values: &Block) {
        if !as_loaded(values, &self.from[block], &self.loaded[block]) {
            let last = self.neighbours.len();
            for (place, &value) in (block * BLOCK..last).zip(values) {
                self.take(place, value);
            }
        }
    }

    fn is_loaded(&self, place: usize) -> bool {
        self.loaded[place / BLOCK][place % BLOCK] != 0
    }

    /// Toggles whether a place is loaded, and updates its neighbours' counts and the area.
    fn toggle(&mut self, place: usize) {
        let loaded = !self.is_loaded(place);
        self.loaded[place / BLOCK][place % BLOCK] = u32::from(loaded);
        let (row, column) = (place / self.columns, place % self.columns);
        for y in row.saturating_sub(1)..=(row + 1).min(self.rows - 1) {
            for x in column.saturating_sub(1)..=(column + 1).min(self.columns - 1) {
                let other = y * self.columns + x;
                if other == place {
                    continue;
                }
                let counted = self.neighbours[other] > 0;
                if loaded {
                    self.neighbours[other] += 1;
                } else {
                    self.neighbours[other] -= 1;
                }
                if self.is_loaded(other) && counted != (self.neighbours[other] > 0) {
                    self.area = if loaded { self.area + 1 } else { self.area - 1 };
                }
            }
        }
        if self.neighbours[place] > 0 {
            self.area = if loaded { self.area + 1 } else { self.area - 1 };
        }
    }
}

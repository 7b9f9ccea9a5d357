//! Determines which taxels are loaded, and their number, for encoders that do not depend on position.

use super::blocks::{BLOCK, Block, blocks};
use super::driver::Sample;
use super::tare::Tare;
use crate::rest::{Rest, TIMES_NOISE, touched_from};
use crate::vectors::wide;
use crate::{Array, Hint, Result, problem};

/// It is loaded until it is below this part of that, so that noise does not end a touch.
const RELEASE: f64 = 0.5;

/// The smallest value above rest at which it is loaded, where neither noise nor floor is known.
const LEAST: f64 = 1e-9;

/// The smallest f32 that is not below `x`.
fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

wide! {
    /// Whether the same taxels are loaded as before.
    fn as_loaded(held: &Block, from: &Block, loaded: &[u32; BLOCK]) -> bool {
        let mut changes = 0;
        for lane in 0..BLOCK {
            changes |= u32::from(held[lane] >= from[lane]) ^ loaded[lane];
        }
        changes == 0
    }
}

/// The taxels of an array at or above a value of their own, and how many of them have such a neighbour, or are channels,
/// which count alone.
#[derive(Clone)]
pub(super) struct Paired {
    rows: usize,
    columns: usize,
    /// Smallest value at which each taxel is loaded, or stays so; infinite if there is none.
    from: Vec<Block>,
    /// Of channels: the smallest value at which each is loaded, and at which it stays so; empty on a grid.
    alone: Vec<[f32; 2]>,
    /// 1 for each loaded taxel, otherwise 0.
    loaded: Vec<[u32; BLOCK]>,
    /// Number of loaded neighbours of each taxel.
    neighbours: Vec<u8>,
    /// Number of taxels that count.
    area: u32,
}

impl Paired {
    /// Starts with no taxel loaded, and no value at which one is.
    pub(super) fn new(rows: usize, columns: usize) -> Self {
        let n = blocks(rows * columns);
        Self {
            rows,
            columns,
            from: vec![[f32::INFINITY; BLOCK]; n],
            alone: vec![],
            loaded: vec![[0; BLOCK]; n],
            neighbours: vec![0; rows * columns],
            area: 0,
        }
    }

    /// Starts likewise with channels, each of which counts alone.
    fn alone(channels: usize) -> Self {
        Self { alone: vec![[f32::INFINITY; 2]; channels], neighbours: vec![1; channels], ..Self::new(1, channels) }
    }

    /// Sets the smallest value at which a taxel is loaded; the caller must pass its value again.
    pub(super) fn set_from(&mut self, taxel: usize, from: f64) {
        self.from[taxel / BLOCK][taxel % BLOCK] = round_up(from);
    }

    /// Sets the smallest value at which a channel is loaded, and at which it stays so; likewise.
    fn set_alone(&mut self, channel: usize, values: [f64; 2]) {
        self.alone[channel] = values.map(round_up);
        self.set_from(channel, values[usize::from(self.is_loaded(channel))]);
    }

    /// Number of blocks of taxels.
    pub(super) fn blocks(&self) -> usize {
        self.loaded.len()
    }

    /// Number of taxels that count.
    pub(super) fn area(&self) -> u32 {
        self.area
    }

    /// Whether any taxel of a block is loaded.
    fn any(&self, block: usize) -> bool {
        self.loaded[block].iter().any(|&l| l != 0)
    }

    /// Whether a taxel counts: it and one of its neighbours are loaded, or it is a channel.
    fn counts(&self, taxel: usize) -> bool {
        self.is_loaded(taxel) && self.neighbours[taxel] > 0
    }

    /// Updates the value of a taxel.
    pub(super) fn take(&mut self, taxel: usize, value: f32) {
        if (value >= self.from[taxel / BLOCK][taxel % BLOCK]) != self.is_loaded(taxel) {
            self.toggle(taxel);
        }
    }

    /// Updates the values of a block of taxels.
    pub(super) fn take_block(&mut self, block: usize, values: &Block) {
        if !as_loaded(values, &self.from[block], &self.loaded[block]) {
            let last = self.neighbours.len();
            for (taxel, &value) in (block * BLOCK..last).zip(values) {
                self.take(taxel, value);
            }
        }
    }

    fn is_loaded(&self, taxel: usize) -> bool {
        self.loaded[taxel / BLOCK][taxel % BLOCK] != 0
    }

    /// Toggles whether a taxel is loaded, and updates its neighbours' counts and the area.
    fn toggle(&mut self, taxel: usize) {
        let loaded = !self.is_loaded(taxel);
        let step = if loaded { 1 } else { -1 };
        self.loaded[taxel / BLOCK][taxel % BLOCK] = u32::from(loaded);
        if let Some(values) = self.alone.get(taxel) {
            self.from[taxel / BLOCK][taxel % BLOCK] = values[usize::from(loaded)];
        } else {
            let (row, column) = (taxel / self.columns, taxel % self.columns);
            for y in row.saturating_sub(1)..=(row + 1).min(self.rows - 1) {
                for x in column.saturating_sub(1)..=(column + 1).min(self.columns - 1) {
                    let neighbour = y * self.columns + x;
                    if neighbour == taxel {
                        continue;
                    }
                    let counted = self.neighbours[neighbour] > 0;
                    self.neighbours[neighbour] = self.neighbours[neighbour].wrapping_add_signed(step as i8);
                    if self.is_loaded(neighbour) && counted != (self.neighbours[neighbour] > 0) {
                        self.area = self.area.wrapping_add_signed(step);
                    }
                }
            }
        }
        if self.neighbours[taxel] > 0 {
            self.area = self.area.wrapping_add_signed(step);
        }
    }
}

/// The loaded taxels of an array.
///
/// A taxel is loaded while its value exceeds its rest by more than the noise floor and half a tick; it counts only if
/// one of its 8 neighbours is loaded too, which rejects noise. Channels, and a single taxel, have no neighbours and count
/// alone: from the noise floor and six times their own noise on, until they are below half of that.
#[derive(Clone)]
pub(super) struct Loaded {
    paired: Paired,
    noise_floor: f64,
    /// The noise of each channel; empty on a grid.
    noise: Vec<f64>,
    rest: Rest<f64>,
}

/// Sums over the taxels that count.
#[derive(Default)]
pub(super) struct LoadedSums {
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
    /// Starts with no taxel loaded; `subject` names the encoder in an error.
    pub(super) fn new(subject: &str, array: &Array, tare: Option<&Tare>, noise_floor: f64) -> Result<Self> {
        let tare = require_tare(subject, tare)?;
        let rest = tare.rest_of(array)?;
        let (paired, noise) = if array.has_neighbours() {
            (Paired::new(usize::from(array.rows), usize::from(array.columns)), vec![])
        } else {
            (Paired::alone(array.len()), tare.place_noise())
        };
        let mut fresh = Self { paired, noise_floor, noise, rest };
        (0..array.len()).for_each(|taxel| fresh.update_threshold(taxel));
        Ok(fresh)
    }

    /// Changes the rest of a taxel; the caller must pass its value again.
    pub(super) fn set_rest(&mut self, taxel: usize, rest: f64) {
        self.rest.set(taxel, rest);
        self.update_threshold(taxel);
    }

    fn update_threshold(&mut self, taxel: usize) {
        let rest = self.rest.values()[taxel];
        if let Some(noise) = self.noise.get(taxel) {
            let above = (TIMES_NOISE * noise).max(self.noise_floor).max(LEAST);
            self.paired.set_alone(taxel, [rest + above, rest + RELEASE * above]);
        } else {
            self.paired.set_from(taxel, touched_from(rest, self.noise_floor));
        }
    }

    /// The rest of a taxel; `None` if it is not known.
    pub(super) fn rest(&self, taxel: usize) -> Option<f64> {
        Some(self.rest.values()[taxel]).filter(|rest| rest.is_finite())
    }

    /// Number of taxels that count.
    pub(super) fn area(&self) -> u32 {
        self.paired.area
    }

    /// Whether a taxel counts.
    pub(super) fn counts(&self, taxel: usize) -> bool {
        self.paired.counts(taxel)
    }

    /// Sums over the taxels that count, from the values of all taxels; they are added in the order of taxels.
    pub(super) fn sums(&self, held: &[Block]) -> LoadedSums {
        let columns = self.paired.columns;
        self.sums_at(held, |taxel| [(taxel % columns) as f64, (taxel / columns) as f64])
    }

    /// The same, with x and y of each taxel.
    pub(super) fn sums_at(&self, held: &[Block], at: impl Fn(usize) -> [f64; 2]) -> LoadedSums {
        let mut sums = LoadedSums::default();
        if self.paired.area == 0 {
            return sums;
        }
        let taxels = self.paired.neighbours.len();
        for (block, values) in held.iter().enumerate().filter(|&(block, _)| self.paired.any(block)) {
            for (taxel, &value) in (block * BLOCK..taxels).zip(values) {
                if self.paired.counts(taxel) {
                    let above = self.rest.above(taxel, f64::from(value));
                    sums.total += above;
                    sums.peak = sums.peak.max(above);
                    let [x, y] = at(taxel);
                    sums.x += above * x;
                    sums.y += above * y;
                }
            }
        }
        sums
    }

    /// Updates the value of a taxel.
    pub(super) fn take(&mut self, taxel: usize, value: f32) {
        self.paired.take(taxel, value);
    }

    /// Updates the values of the blocks that a frame changed; those of events are passed to `take`.
    pub(super) fn take_frame(&mut self, now: Sample<'_>) {
        if now.of_frame {
            self.take_changed(now);
        }
    }

    /// Updates the values of the blocks that changed.
    pub(super) fn take_changed(&mut self, now: Sample<'_>) {
        for (block, values) in now.held.iter().enumerate().filter(|&(block, _)| now.changed[block]) {
            self.paired.take_block(block, values);
        }
    }
}

/// The tare of an encoder that needs one; `subject` names the encoder in an error.
pub(super) fn require_tare<'a>(subject: &str, tare: Option<&'a Tare>) -> Result<&'a Tare> {
    tare.ok_or_else(|| problem!("{subject} without a tare").with_hint("tare", Hint::Give))
}

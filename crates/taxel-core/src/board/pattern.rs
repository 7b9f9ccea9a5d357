//! The values of a ball that rolls over the array, in the place of the comparators' (docs: *Registers*).

use crate::Array;

/// Value of the ball's middle, ticks.
const HEIGHT: i32 = 128;
/// Parts of a taxel in which positions are counted.
const PARTS: i32 = 16;

/// The value of taxel (`x`, `y`) in frame `n` of the pattern, ticks: that of a ball on a ring of columns and a ring of rows.
#[must_use]
pub fn pattern(array: &Array, (x, y): (u16, u16), n: u16, ramp: u16) -> u16 {
    let a = distance(i32::from(n) / 16, x, array.columns);
    let b = distance(i32::from(n) / 2, y, array.rows);
    (HEIGHT.min(ramp.into()) - a.max(b) - a.min(b) / 2).max(0) as u16
}

/// How far a line is from a place, the shorter way around a ring of lines, of which there are a power of two.
fn distance(place: i32, line: u16, lines: u16) -> i32 {
    let around = PARTS * u32::from(lines).next_power_of_two() as i32;
    let ahead = (place - PARTS * i32::from(line)).rem_euclid(around);
    ahead.min(around - ahead)
}

/// The pattern of a board: how many frames ago it began.
#[derive(Debug, Clone, Default)]
pub(super) struct Ball(Option<u16>);

impl Ball {
    /// Begins a frame; returns all values by taxel if the pattern is on.
    pub(super) fn frame(&mut self, array: &Array, on: bool, ramp: u16) -> Option<Vec<u16>> {
        self.0 = on.then(|| self.0.map_or(0, |n| n.wrapping_add(1)));
        let places = (0..array.rows).flat_map(|y| (0..array.columns).map(move |x| (x, y)));
        self.0.map(|n| places.map(|place| pattern(array, place, n, ramp)).collect())
    }
}

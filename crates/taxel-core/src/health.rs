//! How often each taxel was touched, as its neighbours show it, and how often it changed by itself: what tells dead,
//! stuck and noisy taxels from sound ones.
//!
//! Reading: time is counted in bins of 50 ms. A taxel is touched while three in four of its up to 8 neighbours are
//! [`TOUCH`] above their rest, until all but one in four are back. It changes by itself in a bin in which it has
//! [`OFTEN`] changes or more, and more than [`BY_ITSELF`] times the changes of all but one of the up to 24 taxels around it.

use crate::Array;
use crate::held::UNKNOWN;
use crate::rest::{NOISE_FLOOR, TaxelGrid, TrackedRest};

/// Width of a bin, us.
pub const BIN_US: i64 = 50_000;

/// Most bins of a silence that are counted; the rest of a longer one is a single bin.
const SILENT_BINS: i64 = 64;

/// A touched taxel is so many ticks above its rest.
pub const TOUCH: f32 = 8.0;

/// How many times more often than its neighbours a taxel changes when it changes by itself.
pub const BY_ITSELF: u32 = 8;

/// A taxel changes by itself so often in a bin: the value of a sound one that lies between two ticks changes about once.
pub const OFTEN: u32 = 3;

/// What a taxel did in the present bin.
#[derive(Debug, Clone, Copy)]
struct Bin {
    held: f32,
    greatest: f32,
    changes: u32,
}

/// Counts of a taxel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TaxelCounts {
    /// Number of ended touches at the taxel, as its neighbours show them.
    pub touches: u32,
    /// Number of these touches in which the taxel did not change.
    pub missed: u32,
    /// Number of bins in which the taxel itself was [`TOUCH`] above its rest.
    pub pressed: u32,
    /// Number of bins in which the taxel changed.
    pub changed: u32,
    /// Bins in which it changed by itself.
    pub by_itself: u32,
}

/// The present touch of a taxel's position.
#[derive(Debug, Clone, Copy, Default)]
struct PresentTouch {
    present: bool,
    changed: bool,
}

/// Counts the touches and changes of each taxel while events or frames arrive.
#[derive(Debug, Clone)]
pub struct TouchCounts {
    grid: TaxelGrid,
    /// Number of each taxel's neighbours that exist.
    neighbours: Vec<u8>,
    rest: TrackedRest,
    bins: Vec<Bin>,
    counts: Vec<TaxelCounts>,
    touch: Vec<PresentTouch>,
    /// End of the present bin, us.
    end: Option<i64>,
}

impl TouchCounts {
    /// Counts of an array's taxels, which rest at `rest`, ticks; [`NO_REST`](crate::rest::Value::NO_REST) where it is tracked from their first
    /// values on.
    #[must_use]
    pub fn new(array: &Array, rest: f64) -> Self {
        let n = array.len();
        let grid = TaxelGrid { taxels: n, columns: usize::from(array.columns) };
        let others =
            |taxel: usize| grid.around(taxel, 1).filter(|&near| near != taxel && array.has(near)).count() as u8;
        Self {
            grid,
            neighbours: (0..n).map(|taxel| if array.has(taxel) { others(taxel) } else { 0 }).collect(),
            rest: TrackedRest::new(grid.columns, NOISE_FLOOR, vec![rest; n]),
            bins: vec![Bin { held: f32::NAN, greatest: f32::NAN, changes: 0 }; n],
            counts: vec![TaxelCounts::default(); n],
            touch: vec![PresentTouch::default(); n],
            end: None,
        }
    }

    /// The counts of each taxel, by index, up to the last whole bin.
    #[must_use]
    pub fn counts(&self) -> &[TaxelCounts] {
        &self.counts
    }

    /// Reads an event: its time (us), the taxel, the value ([`UNKNOWN`] if it has none: then a step of 4 ticks), and
    /// whether the taxel itself changed, not what a state of version 2 says of it.
    pub fn event(&mut self, t: i64, taxel: usize, ticks: u16, up: bool, changed: bool) {
        let value = if ticks == UNKNOWN {
            let held = self.bins[taxel].held;
            (if held.is_nan() { 0.0 } else { held }) + if up { 4.0 } else { -4.0 }
        } else {
            ticks.into()
        };
        self.value(t, taxel, value, changed);
    }

    /// Reads a taxel's value, ticks, at `t` us.
    #[inline]
    pub fn value(&mut self, t: i64, taxel: usize, value: f32, changed: bool) {
        if self.end.is_none_or(|end| t >= end) {
            self.advance(t);
        }
        let bin = &mut self.bins[taxel];
        bin.held = value;
        bin.greatest = bin.greatest.max(value);
        bin.changes += u32::from(changed);
    }

    /// Ends the bins before `t` us.
    pub fn advance(&mut self, t: i64) {
        let mut bins = 0;
        while let Some(end) = self.end.filter(|&end| end <= t) {
            bins += 1;
            self.end_bin(end);
            self.end = Some(if bins < SILENT_BINS { end + BIN_US } else { next(t) });
        }
        self.end = Some(self.end.unwrap_or_else(|| next(t)));
    }

    /// The taxels up to `reach` rows and columns around one.
    fn around(&self, taxel: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        self.grid.around(taxel, reach).filter(move |&neighbour| neighbour != taxel)
    }

    fn end_bin(&mut self, t: i64) {
        self.count_changes();
        let (mut near, mut down) = (vec![0_u8; self.bins.len()], vec![0_u8; self.bins.len()]);
        for (taxel, rest) in self.rest.rests().enumerate() {
            let bin = self.bins[taxel];
            // A taxel's first value is its rest.
            let Some(rest) = rest.map(|rest| rest as f32) else { continue };
            if bin.greatest.is_nan() || bin.greatest - rest < TOUCH {
                continue;
            }
            self.counts[taxel].pressed += 1;
            for neighbour in self.around(taxel, 1) {
                near[neighbour] += 1;
                down[neighbour] += u8::from(bin.held - rest >= TOUCH);
            }
        }
        for (taxel, &neighbours) in self.neighbours.iter().enumerate() {
            let (touch, counts) = (&mut self.touch[taxel], &mut self.counts[taxel]);
            let begins = !touch.present && neighbours >= 3 && 4 * near[taxel] >= 3 * neighbours;
            if begins {
                *touch = PresentTouch { present: true, changed: false };
            }
            touch.changed |= self.bins[taxel].changes > 0;
            if touch.present && 4 * down[taxel] <= neighbours {
                counts.touches += 1;
                counts.missed += u32::from(!touch.changed);
                touch.present = false;
            }
        }
        self.rest.take(t, self.bins.iter().map(|bin| bin.held));
        for bin in &mut self.bins {
            *bin = Bin { greatest: bin.held, changes: 0, ..*bin };
        }
    }

    fn count_changes(&mut self) {
        for taxel in 0..self.bins.len() {
            let changes = self.bins[taxel].changes;
            if changes == 0 {
                continue;
            }
            let (mut most, mut second) = (0, 0);
            for neighbour in self.around(taxel, 2) {
                let nearby = self.bins[neighbour].changes;
                (most, second) = if nearby > most { (nearby, most) } else { (most, second.max(nearby)) };
            }
            self.counts[taxel].changed += 1;
            self.counts[taxel].by_itself += u32::from(changes >= OFTEN && changes > BY_ITSELF * second);
        }
    }
}

/// The first end of a bin after `t`.
fn next(t: i64) -> i64 {
    (t.div_euclid(BIN_US) + 1).saturating_mul(BIN_US)
}

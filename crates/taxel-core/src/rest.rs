//! What taxels read at rest, and what of a value stands above it.

use std::collections::BTreeSet;

/// Half a tick, by which a value must exceed the noise floor: the rest is a mean, and values are whole ticks.
const HALF_TICK: f64 = 0.5;

/// The least value of a touched taxel that rests at `rest`, for a board's noise floor; all in the sensor's unit.
#[must_use]
pub fn touched_from(rest: f64, noise_floor: f64) -> f64 {
    rest + noise_floor + HALF_TICK
}

/// A number in which taxels are read.
pub trait Value: Copy + PartialOrd {
    /// The rest of a taxel whose rest is unknown: no value lies above it.
    const NO_REST: Self;

    /// This value less the rest; 0 where it is lower, or where either is unknown.
    #[must_use]
    fn less(self, rest: Self) -> Self;
}

impl Value for u16 {
    const NO_REST: Self = crate::held::UNKNOWN;

    #[inline(always)]
    fn less(self, rest: Self) -> Self {
        // No branch: which taxels are pressed is unpredictable.
        if self == crate::held::UNKNOWN { 0 } else { self.saturating_sub(rest) }
    }
}

impl Value for f64 {
    const NO_REST: Self = f64::INFINITY;

    #[inline(always)]
    fn less(self, rest: Self) -> Self {
        (self - rest).max(0.0)
    }
}

/// The rest of each taxel, by index: measured, or the lowest value so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest<V> {
    values: Vec<V>,
    /// Whether it follows the lowest value.
    lowest: bool,
    /// Taxels whose rest was set one by one: a lower value does not change it.
    zeroed: BTreeSet<usize>,
}

impl<V: Value> Rest<V> {
    /// The lowest value of each taxel so far, and from now on; [`Value::NO_REST`] of one without any.
    #[must_use]
    pub fn lowest(values: Vec<V>) -> Self {
        Self { values, lowest: true, zeroed: BTreeSet::new() }
    }

    /// Measured values, which do not change; [`Value::NO_REST`] where none is known, which the taxel's first value replaces.
    #[must_use]
    pub fn measured(values: Vec<V>) -> Self {
        Self { lowest: false, ..Self::lowest(values) }
    }

    /// Whether it follows the lowest value.
    #[must_use]
    pub fn is_lowest(&self) -> bool {
        self.lowest
    }

    /// By taxel index.
    #[must_use]
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// Sets the rest of one taxel, whatever its values are from now on.
    pub fn set(&mut self, taxel: usize, rest: V) {
        self.values[taxel] = rest;
        self.zeroed.insert(taxel);
    }

    /// Takes note of a taxel's value, which is not unknown; returns whether that changes its rest.
    #[inline(always)]
    pub fn follow(&mut self, taxel: usize, value: V) -> bool {
        let rest = self.values[taxel];
        let lower = (rest == V::NO_REST || self.lowest && value < rest) && !self.zeroed.contains(&taxel);
        if lower {
            self.values[taxel] = value;
        }
        lower
    }

    /// How far a taxel's value stands above its rest; 0 where it is lower, or where either is unknown.
    #[inline(always)]
    #[must_use]
    pub fn above(&self, taxel: usize, value: V) -> V {
        value.less(self.values[taxel])
    }
}

impl Rest<u16> {
    /// As [`Rest::above`], and 0 up to the noise floor: in whole ticks the same as [`touched_from`].
    #[inline(always)]
    #[must_use]
    pub fn above_noise(&self, taxel: usize, value: u16, noise_floor: u16) -> u16 {
        let above = self.above(taxel, value);
        if above > noise_floor { above } else { 0 }
    }
}

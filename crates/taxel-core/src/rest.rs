//! The taxels' values at rest, and the part of a value above its rest.

use std::collections::BTreeSet;

/// Half a tick, which is added to the noise floor as a threshold: the rest is a mean, and values are whole ticks.
const HALF_TICK: f64 = 0.5;

/// The smallest value of a touched taxel with this `rest`, for a board's noise floor; all in the sensor's unit.
#[must_use]
pub fn touched_from(rest: f64, noise_floor: f64) -> f64 {
    rest + noise_floor + HALF_TICK
}

/// A numeric type of taxels' values.
pub trait Value: Copy + PartialOrd {
    /// The rest of a taxel whose rest is unknown: no value is above it.
    const NO_REST: Self;

    /// This value minus the rest; 0 if it is lower, or if either is unknown.
    #[must_use]
    fn less(self, rest: Self) -> Self;
}

impl Value for u16 {
    const NO_REST: Self = crate::held::UNKNOWN;

    #[inline(always)]
    fn less(self, rest: Self) -> Self {
        // Branch-free: a processor cannot predict which taxels are pressed.
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
    /// Whether the rest follows the lowest value.
    lowest: bool,
    /// Taxels whose rest was set individually: lower values do not change it.
    zeroed: BTreeSet<usize>,
}

impl<V: Value> Rest<V> {
    /// A rest that follows the lowest value of each taxel; [`Value::NO_REST`] before its first value.
    #[must_use]
    pub fn lowest(values: Vec<V>) -> Self {
        Self { values, lowest: true, zeroed: BTreeSet::new() }
    }

    /// Measured rests, which do not change; [`Value::NO_REST`] if unknown, which the taxel's first value replaces.
    #[must_use]
    pub fn measured(values: Vec<V>) -> Self {
        Self { lowest: false, ..Self::lowest(values) }
    }

    /// Whether the rest follows the lowest value.
    #[must_use]
    pub fn is_lowest(&self) -> bool {
        self.lowest
    }

    /// The rests by taxel index.
    #[must_use]
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// Sets the rest of one taxel permanently: its later values do not change it.
    pub fn set(&mut self, taxel: usize, rest: V) {
        self.values[taxel] = rest;
        self.zeroed.insert(taxel);
    }

    /// Updates the rest with a taxel's value, which must be known; returns whether the rest changed.
    #[inline(always)]
    pub fn follow(&mut self, taxel: usize, value: V) -> bool {
        let rest = self.values[taxel];
        let lower = (rest == V::NO_REST || self.lowest && value < rest) && !self.zeroed.contains(&taxel);
        if lower {
            self.values[taxel] = value;
        }
        lower
    }

    /// Difference of a taxel's value from its rest; 0 if it is lower, or if either is unknown.
    #[inline(always)]
    #[must_use]
    pub fn above(&self, taxel: usize, value: V) -> V {
        value.less(self.values[taxel])
    }
}

impl Rest<u16> {
    /// As [`Rest::above`], but 0 up to the noise floor; for whole ticks equivalent to [`touched_from`].
    #[inline(always)]
    #[must_use]
    pub fn above_noise(&self, taxel: usize, value: u16, noise_floor: u16) -> u16 {
        let above = self.above(taxel, value);
        if above > noise_floor { above } else { 0 }
    }
}

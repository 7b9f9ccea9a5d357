//! The taxels' values at rest, and the part of a value above its rest.

use std::collections::BTreeSet;

/// The noise floor of the board's fast presets, ticks: by it a rest is found that was not measured.
pub const NOISE_FLOOR: f64 = 3.0;

/// A noise floor is so many standard deviations of the noise, so that two neighbours rarely exceed it together.
pub const TIMES_NOISE: f64 = 6.0;

/// Units of force and pressure, in which the rest of a taxel is 0.
pub const FORCE_UNITS: [&str; 20] = [
    "N", "mN", "kN", "gf", "kgf", "Pa", "hPa", "kPa", "MPa", "mbar", "bar", "psi", "mmHg", "N/cm2", "N/cm²", "N/mm2",
    "N/mm²", "N/m2", "N/m²", "kgf/cm2",
];

/// Half a tick, which is added to the noise floor as a threshold: the rest is a mean, and values are whole ticks.
const HALF_TICK: f64 = 0.5;

/// The step between values that a noise floor belongs to, in the sensor's unit: a tick; where the floor is below one tick
/// but not 0, the unit is coarser than the values, and the step is the floor.
#[must_use]
pub fn step_of(noise_floor: f64) -> f64 {
    if noise_floor > 0.0 { noise_floor.min(1.0) } else { 1.0 }
}

/// The smallest value of a touched taxel with this `rest`, for a board's noise floor; all in the sensor's unit.
#[must_use]
pub fn touched_from(rest: f64, noise_floor: f64) -> f64 {
    rest + noise_floor + HALF_TICK * step_of(noise_floor)
}

/// Difference of a value from its rest, ticks; 0 up to the noise floor, and if either is unknown.
#[inline(always)]
#[must_use]
pub fn above_noise(value: u16, rest: u16, noise_floor: u16) -> u16 {
    let above = value.above(rest);
    if above > noise_floor { above } else { 0 }
}

/// A numeric type of taxels' values.
pub trait Value: Copy + PartialOrd {
    /// The rest of a taxel whose rest is unknown: no value is above it.
    const NO_REST: Self;

    /// This value minus the rest; 0 if it is lower, or if either is unknown.
    #[must_use]
    fn above(self, rest: Self) -> Self;
}

impl Value for u16 {
    const NO_REST: Self = crate::held::UNKNOWN;

    #[inline(always)]
    fn above(self, rest: Self) -> Self {
        // Branch-free: a processor cannot predict which taxels are pressed.
        if self == crate::held::UNKNOWN { 0 } else { self.saturating_sub(rest) }
    }
}

impl Value for f64 {
    const NO_REST: Self = f64::INFINITY;

    #[inline(always)]
    fn above(self, rest: Self) -> Self {
        (self - rest).max(0.0)
    }
}

/// The rest of each taxel, by index.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest<V> {
    values: Vec<V>,
    /// Taxels whose rest was set individually: it stays.
    zeroed: BTreeSet<usize>,
}

impl<V: Value> Rest<V> {
    /// Rests by taxel index; [`Value::NO_REST`] if unknown, which the taxel's first value replaces.
    #[must_use]
    pub fn measured(values: Vec<V>) -> Self {
        Self { values, zeroed: BTreeSet::new() }
    }

    /// The rests by taxel index.
    #[must_use]
    pub fn values(&self) -> &[V] {
        &self.values
    }

    /// Sets the rest of one taxel permanently.
    pub fn set(&mut self, taxel: usize, rest: V) {
        self.values[taxel] = rest;
        self.zeroed.insert(taxel);
    }

    /// Sets the rest of one taxel, unless it was set permanently; returns whether it changed.
    pub fn track(&mut self, taxel: usize, rest: V) -> bool {
        let changed = self.values[taxel] != rest && !self.zeroed.contains(&taxel);
        if changed {
            self.values[taxel] = rest;
        }
        changed
    }

    /// Reads a taxel's value, which must be known and is its rest if none is known; returns whether the rest changed.
    #[inline(always)]
    pub fn follow(&mut self, taxel: usize, value: V) -> bool {
        self.values[taxel] == V::NO_REST && self.track(taxel, value)
    }

    /// Difference of a taxel's value from its rest; 0 if it is lower, or if either is unknown.
    #[inline(always)]
    #[must_use]
    pub fn above(&self, taxel: usize, value: V) -> V {
        value.above(self.values[taxel])
    }
}

impl Rest<u16> {
    /// As [`Rest::above`], but 0 up to the noise floor; for whole ticks equivalent to [`touched_from`].
    #[inline(always)]
    #[must_use]
    pub fn above_noise(&self, taxel: usize, value: u16, noise_floor: u16) -> u16 {
        above_noise(value, self.values[taxel], noise_floor)
    }
}

//! The ramp that the comparators compare with: voltage against ticks of the counter.

use serde::{Deserialize, Serialize};

/// The supply that the RC ramp charges towards, V.
pub const SUPPLY_V: f64 = 5.0;
/// Where the ramp ends, V. Reading: so 0.02 N, which is 0.1 V above 1.3 V, is 4.5 ticks of a ramp of 150.
pub const RAMP_END_V: f64 = 3.0;

/// How the ramp rises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RampShape {
    /// A resistor charges a capacitor towards the supply, as the board does (Appendix 1, 2.2.3).
    #[default]
    Rc,
    /// A current source does, as the board was meant to.
    Linear,
}

/// A ramp from 0 to 3 V, as long as so many ticks of 1/300 us; after its end it stays at its last voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    /// How it rises.
    pub shape: RampShape,
    /// How long it takes, ticks.
    pub ticks: f64,
}

impl Ramp {
    /// An RC ramp.
    #[must_use]
    pub fn rc(ticks: f64) -> Self {
        Self { shape: RampShape::Rc, ticks }
    }

    /// Its time constant, ticks, where it is an RC ramp.
    fn constant(&self) -> f64 {
        self.ticks / (SUPPLY_V / (SUPPLY_V - RAMP_END_V)).ln()
    }

    /// Its voltage after `ticks`, V.
    #[must_use]
    pub fn volts(&self, ticks: f64) -> f64 {
        let ticks = ticks.clamp(0.0, self.ticks);
        match self.shape {
            RampShape::Rc => -SUPPLY_V * (-ticks / self.constant()).exp_m1(),
            RampShape::Linear => RAMP_END_V * ticks / self.ticks,
        }
    }

    /// When it passes a voltage, ticks: the inverse of [`Ramp::volts`]; its whole time where it never does.
    #[must_use]
    pub fn ticks(&self, volts: f64) -> f64 {
        if volts >= RAMP_END_V { self.ticks } else { self.ticks_if_it_went_on(volts) }
    }

    /// The same of a ramp that does not end at 3 V; infinite where even that never passes.
    #[must_use]
    pub fn ticks_if_it_went_on(&self, volts: f64) -> f64 {
        match self.shape {
            RampShape::Rc if volts >= SUPPLY_V => f64::INFINITY,
            RampShape::Rc => self.constant() * (SUPPLY_V / (SUPPLY_V - volts.max(0.0))).ln(),
            RampShape::Linear => self.ticks * volts.max(0.0) / RAMP_END_V,
        }
    }

    /// How fast it rises at its slowest, V a tick.
    #[must_use]
    pub fn least_slope(&self) -> f64 {
        match self.shape {
            RampShape::Rc => (SUPPLY_V - RAMP_END_V) / self.constant(),
            RampShape::Linear => RAMP_END_V / self.ticks,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_of_either_shape_is_inverted_and_ends_at_three_volts() {
        for shape in [RampShape::Rc, RampShape::Linear] {
            let ramp = Ramp { shape, ticks: 150.0 };
            for tick in [0.0, 0.25, 1.0, 77.7, 149.9, 150.0] {
                assert!((ramp.ticks(ramp.volts(tick)) - tick).abs() < 1e-9, "{shape:?} {tick}");
            }
            assert!((ramp.volts(150.0) - 3.0).abs() < 1e-12 && ramp.volts(9e9) == ramp.volts(150.0));
            assert!(ramp.ticks(7.0) == 150.0 && ramp.ticks(-1.0) == 0.0);
        }
        // The ramp reaches half the supply after ln 2 time constants.
        let constant = 150.0 / 2.5_f64.ln();
        assert!((Ramp::rc(150.0).volts(constant * 2.0_f64.ln()) - 2.5).abs() < 1e-12);
    }
}

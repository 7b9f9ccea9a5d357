//! What a taxel of piezoresistive fabric conducts under a force.

use serde::{Deserialize, Serialize};

use crate::Result;
use crate::allowed::Range;
use crate::parameters::parameters;

/// The force at which [`Fabric::touch_us`] is stated, N: the least that the thesis could detect (4.4.1).
pub const TOUCH_N: f64 = 0.02;

parameters! {
    /// A law of conductance, `G = G0 + k F^n`, the same for each taxel. All three values are guesses: no maker
    /// publishes them.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Fabric {
        /// G0: conductance at rest, uS.
        pub rest_us: f64 = 0.1, "uS", Range::FROM_0;
        /// What 0.02 N adds, uS; the default is 0.1 V at 1.3 V and 47 kOhm.
        pub touch_us: f64 = 1.64, "uS", Range::ABOVE_0;
        /// n.
        pub exponent: f64 = 0.7, "", Range::within(0.5, 1.0);
    }
}

impl Fabric {
    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.check_ranges()
    }

    /// Conductance under a force, uS; a force below 0 is none.
    #[must_use]
    pub fn conductance_us(&self, force_n: f64) -> f64 {
        self.rest_us + self.conductance_gain_us(force_n)
    }

    /// What a force adds to the conductance at rest, uS.
    #[must_use]
    pub fn conductance_gain_us(&self, force_n: f64) -> f64 {
        self.touch_us * (force_n.max(0.0) / TOUCH_N).powf(self.exponent)
    }

    /// The force under which it conducts so much, N: the inverse of [`Fabric::conductance_us`]; 0 at rest and below.
    #[must_use]
    pub fn force_n(&self, conductance_us: f64) -> f64 {
        TOUCH_N * ((conductance_us - self.rest_us).max(0.0) / self.touch_us).powf(self.exponent.recip())
    }
}

//! The whole circuit of an array.

use serde::{Deserialize, Serialize};

use super::converter::Converter;
use super::readout::VirtualGround;
use crate::Result;
use crate::parameters::Described;

/// Lines under virtual ground and the converter behind them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Chain {
    /// How the lines are held.
    pub readout: VirtualGround,
    /// How their voltages become ticks.
    pub converter: Converter,
}

impl Chain {
    /// Its parameters, with their defaults.
    #[must_use]
    pub fn described() -> Described {
        Described::by(&Self::default(), &[], &[])
    }

    /// Checks every parameter.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.readout.check()?;
        self.converter.check()
    }
}

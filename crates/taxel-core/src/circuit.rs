//! The array's circuit: from the conductance of each taxel to the ticks of its counter (thesis 3.4.2, 4.3.2, Appendix
//! 1).
//!
//! The conductance of a [`fabric`] rises with pressure. The taxels share their lines, so the current of one affects the
//! others: [`grid`] solves this network exactly. A [`readout`] holds the lines at their voltages, and its amplifiers or
//! resistors convert the current of each sense line to a voltage; a [`converter`] multiplexes these voltages to its
//! comparators, whose [`ramp`] converts them to ticks and may be [`adaptive`]. [`Chain`] combines all of these, for an
//! emulated board.
//!
//! "Driven line" and "sense line" as for the board: columns are driven, one after the other, and all rows are read.

pub mod adaptive;
pub mod converter;
mod dense;
pub mod fabric;
pub mod grid;
pub mod ramp;
pub mod readout;

pub use adaptive::{Adaptive, Converted};
pub use converter::{Converter, ConverterScan, Moment};
pub use fabric::Fabric;
pub use grid::Crossbar;
pub use ramp::{Ramp, RampShape};
pub use readout::{Divider, VirtualGround};

use serde::{Deserialize, Serialize};

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

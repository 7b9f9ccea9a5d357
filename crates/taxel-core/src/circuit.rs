//! The array's circuit: from the conductance of each taxel to the ticks of its counter (thesis 3.4.2, 4.3.2, Appendix
//! 1).
//!
//! The conductance of a [`fabric`] rises with pressure. The taxels share their lines, so the current of one affects the
//! others: [`grid`] solves this network exactly. A [`readout`] holds the lines at their voltages, and its amplifiers or
//! resistors convert the current of each sense line to a voltage; a [`converter`] multiplexes these voltages to its
//! comparators, whose [`ramp`] converts them to ticks and may be [`adaptive`]. [`chain`] combines all of these, for an
//! emulated board.
//!
//! "Driven line" and "sense line" as for the board: columns are driven, one after the other, and all rows are read.

pub mod adaptive;
pub mod chain;
pub mod converter;
mod dense;
pub mod fabric;
pub mod grid;
pub mod limit;
pub mod ramp;
pub mod readout;

pub use adaptive::{Adaptive, Converted};
pub use chain::Chain;
pub use converter::{Converter, Moment, Scan};
pub use fabric::Fabric;
pub use grid::{Grid, Idle};
pub use limit::Limit;
pub use ramp::{Ramp, RampShape};
pub use readout::{Divider, VirtualGround};

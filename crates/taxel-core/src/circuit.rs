//! The array's circuit: from what each taxel conducts to the ticks of its counter (thesis 3.4.2, 4.3.2, Appendix 1).
//!
//! A [`fabric`] conducts more the harder it is pressed. All taxels share their lines, so that each current
//! depends on all taxels: [`grid`] solves that network exactly. A [`readout`] drives its lines, and its amplifiers or
//! resistors turn the current of each sense line into a voltage; a [`converter`] multiplexes these onto its comparators,
//! whose [`ramp`] turns them into ticks, and may be an [`adaptive`] one. [`chain`] is the whole circuit.
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

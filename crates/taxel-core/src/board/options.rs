//! A user's options of a board besides its registers: the reference of a change, the content of an event, version 2.

use serde::{Deserialize, Serialize};

use crate::wire::Registers;
use crate::wire::v2::{BodyKind, Settings};

/// The reference with which a new value is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Previous {
    /// The last value sent, 0 after reset. Reading: only this keeps the host's values within the noise floor.
    #[default]
    LastSent,
    /// The last value sampled, as in the text of the thesis, 4.3.
    LastSample,
}

/// The content of an intensity word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityWord {
    /// The new value.
    #[default]
    Value,
    /// The difference from the previous value ("delta intensity"); the polarity is its sign.
    Difference,
    /// No intensity word: a change has its taxel, time and polarity only.
    Nothing,
}

/// Options of a board that sends version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Version2 {
    /// Number of the board.
    pub board: u16,
    /// Seed of the session numbers; two resets of one board within 65 536 never have the same number.
    pub seed: u16,
    /// Longest time that an event may wait until its datagram is fuller, us.
    pub hold_us: u64,
    /// Interval between promises that nothing has happened, us; within 0.1 s after an event, each frame is promised.
    pub heartbeat_us: u64,
    /// Interval at which each value is repeated as a state and the board's totals are sent, us; 0 is never.
    pub states_us: u64,
}

impl Default for Version2 {
    fn default() -> Self {
        Self { board: 0, seed: 1, hold_us: 0, heartbeat_us: 10_000, states_us: 1_000_000 }
    }
}

impl Version2 {
    /// The settings that the datagrams of a session share, on a board with these registers.
    pub(super) fn settings(&self, registers: &Registers, intensity: IntensityWord, session: u16) -> Settings {
        let kind = if registers.mechanoreceptor {
            BodyKind::Large
        } else if intensity == IntensityWord::Nothing {
            BodyKind::Changes
        } else if registers.ramp <= 255 {
            BodyKind::Small
        } else {
            BodyKind::Large
        };
        Settings {
            board: self.board,
            session,
            kind,
            frame_sync: registers.frame_sync,
            differences: !registers.mechanoreceptor && intensity == IntensityWord::Difference,
            hold_us: self.hold_us,
            heartbeat_us: self.heartbeat_us,
        }
    }
}

//! What a user chooses about a board beside its registers: what a value is compared with, what an event holds, version 2.

use serde::{Deserialize, Serialize};

use crate::wire::Registers;
use crate::wire::v2::{Kind, Settings};

/// What a new value is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Previous {
    /// The last value sent, 0 after reset. Reading: only so does the host's picture stay within the floor.
    #[default]
    LastSent,
    /// The last value sampled, as the thesis words it in 4.3.
    LastSample,
}

/// What an intensity word holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntensityWord {
    /// The new value.
    #[default]
    Value,
    /// How far it is from the previous one ("delta intensity"); polarity is the sign.
    Difference,
    /// There is none: a change has its taxel, time and polarity only.
    Nothing,
}

/// Options of a board that sends version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Version2 {
    /// Its number.
    pub board: u16,
    /// What its session numbers are drawn from; two resets of one board never have the same within 65 536.
    pub seed: u16,
    /// For how long events may wait until their datagram is fuller, us.
    pub hold_us: u64,
    /// How often it promises that nothing has happened, us; each frame for 0.1 s after an event.
    pub heartbeat_us: u64,
    /// How often each value is repeated as a state and the board's totals are sent, us; 0: never.
    pub states_us: u64,
}

impl Default for Version2 {
    fn default() -> Self {
        Self { board: 0, seed: 1, hold_us: 0, heartbeat_us: 10_000, states_us: 1_000_000 }
    }
}

impl Version2 {
    /// What the datagrams of a session have in common, on a board with these registers.
    pub(super) fn settings(&self, registers: &Registers, intensity: IntensityWord, session: u16) -> Settings {
        let kind = if registers.mechanoreceptor {
            Kind::Large
        } else if intensity == IntensityWord::Nothing {
            Kind::Changes
        } else if registers.ramp <= 255 {
            Kind::Small
        } else {
            Kind::Large
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

//! A user's options of a board besides its registers: the reference of a change, the content of an event, version 2, the
//! queue, and whether it scans.

use serde::{Deserialize, Serialize};

use super::link::QUEUE_WORDS;
use crate::wire::Registers;
use crate::wire::v2::{BodyKind, Settings};
use crate::{Result, problem};

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

/// The options of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoardOptions {
    /// The reference with which a new value is compared.
    pub previous: Previous,
    /// The content of an intensity word.
    pub intensity: IntensityWord,
    /// The options of version 2.
    pub version_2: Version2,
    /// The capacity of the queue, in words; below 2 no event can be sent.
    pub queue: usize,
    /// Whether each taxel compares its value with that of its last event by itself: no scan, and stamps of 1 us (thesis 4.5,
    /// Table 7.1).
    ///
    /// Each step of `noise_floor + 1` ticks is an event, at the time at which the taxel's value reaches it. A taxel is
    /// read once per frame, at the time of its line, and its value is interpolated linearly between two readings, so
    /// events are sent a frame after they happened. At reset the reading of each taxel is sent. The order of lines has
    /// no effect. If `mechanoreceptor` is set later, lines are scanned while it is set.
    pub asynchronous: bool,
}

impl Default for BoardOptions {
    fn default() -> Self {
        let (previous, intensity, version_2) = (Previous::LastSent, IntensityWord::Value, Version2::default());
        Self { previous, intensity, version_2, queue: QUEUE_WORDS, asynchronous: false }
    }
}

impl BoardOptions {
    /// Checks that a board with these registers can do without a scan, if it shall.
    pub(super) fn check(&self, registers: &Registers) -> Result<()> {
        let fault = match registers {
            _ if !self.asynchronous => return Ok(()),
            Registers { wire_version: 1, .. } => "wire_version is 1: must be 2, whose stamps count 1 us",
            Registers { mechanoreceptor: true, .. } => {
                "mechanoreceptor is set: must not be set, because afferents are scanned"
            }
            _ if self.previous == Previous::LastSample => "previous is last_sample: must be last_sent",
            _ => return Ok(()),
        };
        Err(problem!("asynchronous"; ": {fault}"))
    }

    /// The settings that the datagrams of a session share, on a board with these registers.
    pub(super) fn settings(&self, registers: &Registers, session: u16) -> Settings {
        let Self { intensity, version_2: Version2 { board, hold_us, heartbeat_us, .. }, .. } = *self;
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
            board,
            session,
            kind,
            frame_sync: registers.frame_sync && !self.asynchronous,
            differences: !registers.mechanoreceptor && intensity == IntensityWord::Difference,
            hold_us,
            heartbeat_us,
        }
    }
}

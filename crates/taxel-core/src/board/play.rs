//! Acts played to a board that arms, is tared, starts and stops.

use super::{Board, session};
use crate::contact::{Act, Sensor, Stage, Taxels};
use crate::wire::{Command, Decoder, Registers, WORD_BYTES};
use crate::{Array, Events, Result, Stop};

/// What is played, and to which board.
#[derive(Debug, Clone, PartialEq)]
pub struct Play {
    /// Of the sensor and of the board.
    pub array: Array,
    /// What the board's registers hold from the start.
    pub registers: Registers,
    /// How taxels answer.
    pub sensor: Sensor,
    /// What taxels and their noise are drawn from.
    pub seed: u64,
    /// What touches the array, one act after the other.
    pub acts: Vec<Act>,
    /// How long the tare takes, ms.
    pub tare_ms: f64,
}

/// A board that has armed, what it is shown from its second frame on, and the commands of its session.
#[derive(Debug)]
pub struct Armed {
    /// Its first frame was the stage's.
    pub board: Board,
    /// The frames that are left.
    pub stage: Stage,
    /// Before which frame each comes.
    pub commands: Vec<(u64, Command)>,
}

/// What a host made of what a board sent.
#[derive(Debug, Clone)]
pub struct Played {
    /// What changed, when.
    pub events: Events,
    /// How many datagrams there were.
    pub datagrams: u64,
    /// How many words, of five bytes, they held.
    pub words: u64,
}

impl Play {
    /// The acts, ready to be played frame by frame.
    ///
    /// # Errors
    ///
    /// `Device` where registers break a rule, `Scene` where an act cannot be played.
    pub fn stage(&self) -> Result<Stage> {
        let Self { array, registers, .. } = self;
        registers.check(array)?;
        let taxels = Taxels::new(&self.sensor, array.len(), registers.ramp, self.seed)?;
        Stage::new(array, taxels, registers.frame_us(), &self.acts)
    }

    /// Arms a board with the first frame.
    ///
    /// # Errors
    ///
    /// As [`Play::stage`] and [`Board::new`]; `Problem` where the tare leaves no frame for the acts.
    pub fn arm(&self) -> Result<Armed> {
        let mut stage = self.stage()?;
        let commands = session(&self.registers, self.tare_ms, stage.frames() as u64)?;
        let mut board = Board::new(self.registers, &self.array)?;
        let mut first = vec![0; self.array.len()];
        stage.frame(&mut first)?;
        board.arm(&first)?;
        Ok(Armed { board, stage, commands })
    }

    /// Plays as fast as it goes and decodes what the board sends; `watch` hears once a second of the board's which share
    /// is played.
    ///
    /// # Errors
    ///
    /// As [`Play::arm`]; `Interrupted` where asked to stop.
    pub fn hear(&self, mut watch: impl FnMut(f64), stop: Stop<'_>) -> Result<Played> {
        let Armed { mut board, mut stage, commands } = self.arm()?;
        let mut decoder = Decoder::new(self.array.clone());
        let mut events = Events::empty(self.array.clone());
        let (mut datagrams, mut words) = (0, 0);
        let hear = |datagram: &[u8]| {
            decoder.push_into(datagram, None, &mut events);
            decoder.end_of_datagram_into(&mut events);
            datagrams += 1;
            words += (datagram.len() / WORD_BYTES) as u64;
            true
        };
        let (frames, second) = (stage.frames(), (1e6 / self.registers.frame_us()) as usize);
        let mut done = 0_usize;
        let touch = |ticks: &mut [u16]| {
            done += 1;
            if done.is_multiple_of(second) {
                watch(done as f64 / frames as f64);
            }
            stage.frame(ticks)
        };
        board.play(touch, &commands, hear, stop)?;
        Ok(Played { events, datagrams, words })
    }
}

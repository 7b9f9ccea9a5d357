//! Acts played to a board that arms, is tared, starts and stops.

use super::{Board, Crossed, session};
use crate::circuit::Chain;
use crate::contact::{Act, Narrow, Sensor, Stage, Taxels};
use crate::wire::{Command, Decoder, Registers, SenderDecoder, WORD_BYTES};
use crate::{Array, Events, Result, Stop};

/// What is played, and to which board.
#[derive(Debug, Clone, PartialEq)]
pub struct Play {
    /// Of the sensor and of the board.
    pub array: Array,
    /// What the board's registers hold from the start.
    pub registers: Registers,
    /// The law by which taxels turn force into readings.
    pub sensor: Sensor,
    /// What taxels and their noise are drawn from.
    pub seed: u64,
    /// What touches the array, one act after the other.
    pub acts: Vec<Act>,
    /// Duration of the tare, ms.
    pub tare_ms: f64,
    /// What taxels share and how they are converted; nothing: each reads by itself.
    pub circuit: Option<Chain>,
    /// Each taxel compares by itself: nothing is scanned.
    pub asynchronous: bool,
}

/// A board that has armed, what it is shown from its second frame on, and the commands of its session.
#[derive(Debug)]
pub struct Armed {
    /// Its first frame was the stage's.
    pub board: Board,
    /// The circuit through which it reads.
    pub crossed: Option<Crossed>,
    /// The frames that are left.
    pub stage: Stage,
    /// Before which frame each comes.
    pub commands: Vec<(u64, Command)>,
}

/// What a host decoded of a board's datagrams.
#[derive(Debug, Clone)]
pub struct Played {
    /// What changed, when.
    pub events: Events,
    /// How many datagrams there were.
    pub datagrams: u64,
    /// How many words of version 1, of five bytes, they held.
    pub words: u64,
    /// How many bytes they held.
    pub bytes: u64,
    /// The acts, numbered from 0, with a touch that is narrower than their cells resolve.
    pub narrow: Vec<(usize, Narrow)>,
}

impl Play {
    /// The acts, ready to be played frame by frame.
    ///
    /// # Errors
    ///
    /// `Device` where registers break a rule, `Scene` where an act cannot be played.
    pub fn stage(&self, stop: Stop<'_>) -> Result<Stage> {
        let Self { array, registers, .. } = self;
        registers.check(array)?;
        let taxels = Taxels::new(&self.sensor, array.len(), registers.ramp, self.seed)?;
        Stage::new(array, taxels, registers.frame_us(), &self.acts, stop)
    }

    /// Arms a board with the first frame.
    ///
    /// # Errors
    ///
    /// As [`Play::stage`], [`Board::new`], [`Board::asynchronous`], [`Crossed::new`] and [`Crossed::fits`]; `Problem` where
    /// the tare leaves no frame for the acts.
    pub fn arm(&self, stop: Stop<'_>) -> Result<Armed> {
        let mut stage = self.stage(stop)?;
        let commands = session(&self.registers, self.tare_ms, stage.frames() as u64)?;
        let mut board = Board::new(self.registers, &self.array)?;
        if self.asynchronous {
            board = board.asynchronous()?;
        }
        let mut crossed = None;
        if let Some(chain) = &self.circuit {
            Crossed::fits(chain, &self.sensor)?;
            crossed = Some(Crossed::new(chain.clone(), &self.registers, &self.array)?);
        }
        let mut first = vec![0; self.array.len()];
        stage.frame(&mut first, stop)?;
        if let Some(crossed) = &mut crossed {
            crossed.read(&self.registers, &mut first, stop)?;
        }
        board.arm(&first)?;
        Ok(Armed { board, crossed, stage, commands })
    }

    /// Plays as fast as it goes and decodes what the board sends; `watch` is called once a second of the board's with the share
    /// that is played.
    ///
    /// # Errors
    ///
    /// As [`Play::arm`]; `Interrupted` where asked to stop.
    pub fn run(&self, mut watch: impl FnMut(f64), stop: Stop<'_>) -> Result<Played> {
        let Armed { mut board, mut crossed, mut stage, commands } = self.arm(stop)?;
        let version = self.registers.wire_version;
        let mut decoder = SenderDecoder::new(Decoder::new(self.array.clone()), version);
        let mut events = Events::empty(self.array.clone());
        let (mut datagrams, mut bytes) = (0, 0);
        let sink = |datagram: &[u8]| {
            decoder.push(datagram, None, &mut events);
            datagrams += 1;
            bytes += datagram.len() as u64;
            true
        };
        let narrow = stage.narrow().to_vec();
        let (frames, second) = (stage.frames(), (1e6 / self.registers.frame_us()) as usize);
        let mut done = 0_usize;
        // The session writes the floor and the markers alone: neither moves the converter.
        let touch = |ticks: &mut [u16]| {
            done += 1;
            if done.is_multiple_of(second) {
                watch(done as f64 / frames as f64);
            }
            let more = stage.frame(ticks, stop)?;
            if let Some(crossed) = &mut crossed
                && more
            {
                crossed.read(&self.registers, ticks, stop)?;
            }
            Ok(more)
        };
        board.play(touch, &commands, sink, stop)?;
        let words = if version == 1 { bytes / WORD_BYTES as u64 } else { 0 };
        Ok(Played { events, datagrams, words, bytes, narrow })
    }
}

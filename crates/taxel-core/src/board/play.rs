//! Plays acts to a board that arms, is tared, starts and stops.

use super::{Board, BoardOptions, Crossed, session};
use crate::circuit::Chain;
use crate::contact::{Act, Narrow, Sensor, Stage, Taxels};
use crate::wire::{Command, Decoder, Registers, SenderDecoder, WORD_BYTES};
use crate::{Array, Events, Result, Stop};

/// The scene to play, and the board that receives it.
#[derive(Debug, Clone, PartialEq)]
pub struct Play {
    /// The array of the sensor and of the board.
    pub array: Array,
    /// The board's initial registers.
    pub registers: Registers,
    /// The model by which taxels convert force into readings.
    pub sensor: Sensor,
    /// Seed of the taxels' parameters and of their noise.
    pub seed: u64,
    /// The acts that touch the array, one after the other.
    pub acts: Vec<Act>,
    /// Duration of the tare, ms.
    pub tare_ms: f64,
    /// The circuit of shared lines and converter; without it each taxel is read by itself.
    pub circuit: Option<Chain>,
    /// Whether each taxel compares its value by itself, without a scan.
    pub asynchronous: bool,
}

/// A board that has armed, its input from the second frame on, and the commands of its session.
#[derive(Debug)]
pub struct Armed {
    /// The board; it has scanned the stage's first frame.
    pub board: Board,
    /// The circuit through which the board reads.
    pub crossed: Option<Crossed>,
    /// The remaining frames.
    pub stage: Stage,
    /// The commands, each with the frame before which it is sent.
    pub commands: Vec<(u64, Command)>,
}

/// The events that a host decoded from a board's datagrams, and their numbers.
#[derive(Debug, Clone)]
pub struct Played {
    /// The decoded events.
    pub events: Events,
    /// Number of datagrams.
    pub datagrams: u64,
    /// Number of words of version 1, of five bytes each, that the datagrams held.
    pub words: u64,
    /// Number of bytes in the datagrams.
    pub bytes: u64,
    /// Acts, by index from 0, with a touch that is narrower than their cells resolve.
    pub narrow: Vec<(usize, Narrow)>,
}

impl Play {
    /// Prepares the acts to be played frame by frame.
    ///
    /// # Errors
    ///
    /// `Device` if the registers break a rule, `Scene` if an act cannot be played.
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
    /// As [`Play::stage`], [`Board::with_options`], [`Crossed::new`] and [`Crossed::fits`]; `Problem` if
    /// the tare leaves no frame for the acts.
    pub fn arm(&self, stop: Stop<'_>) -> Result<Armed> {
        let mut stage = self.stage(stop)?;
        let commands = session(&self.registers, self.tare_ms, stage.frames() as u64)?;
        let options = BoardOptions { asynchronous: self.asynchronous, ..BoardOptions::default() };
        let mut board = Board::with_options(self.registers, &self.array, options)?;
        let mut crossed = None;
        if let Some(chain) = &self.circuit {
            Crossed::fits(chain, &self.sensor)?;
            crossed = Some(Crossed::new(chain.clone(), &self.registers, &self.array)?);
        }
        let mut first_frame = vec![0; self.array.len()];
        stage.frame(&mut first_frame, stop)?;
        if let Some(crossed) = &mut crossed {
            crossed.read(&self.registers, &mut first_frame)?;
        }
        board.arm(&first_frame)?;
        Ok(Armed { board, crossed, stage, commands })
    }

    /// Plays as fast as possible and decodes the board's datagrams; calls `watch` once per second of the board's time
    /// with the fraction played.
    ///
    /// # Errors
    ///
    /// As [`Play::arm`]; `Interrupted` if asked to stop.
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
        // The session writes only the noise floor and the markers, neither of which affects the converter.
        let touch = |ticks: &mut [u16]| {
            done += 1;
            if done.is_multiple_of(second) {
                watch(done as f64 / frames as f64);
            }
            let more = stage.frame(ticks, stop)?;
            if let Some(crossed) = &mut crossed
                && more
            {
                crossed.read(&self.registers, ticks)?;
            }
            Ok(more)
        };
        board.play(touch, &commands, sink, stop)?;
        let words = if version == 1 { bytes / WORD_BYTES as u64 } else { 0 };
        Ok(Played { events, datagrams, words, bytes, narrow })
    }
}

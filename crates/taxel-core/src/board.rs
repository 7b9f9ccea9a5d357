//! The emulated board, as a state machine: its inputs are trip times and commands, its outputs datagrams and status
//! lines.
//!
//! It implements the contract between board and logic literally (reference, section 3, "What makes an event"), so that
//! host, emulator and logic agree. It has no clock of its own: each frame advances its time.
//!
//! This file defines the board's parts, and how it is created and reset; `frame` runs the parts once per frame, and
//! `commands` answers the host. `scan` defines the order of taxels, `comparator`, `afferents` and `asynchronous` find
//! events, `pattern` makes values for a test of what follows, `link` encodes them as datagrams and queues these, `refresh` repeats values and totals.

mod afferents;
mod asynchronous;
mod commands;
mod comparator;
mod counts;
mod crossed;
mod flaws;
mod frame;
mod link;
mod network;
mod options;
mod pattern;
mod play;
mod refresh;
mod scan;
mod session;
#[cfg(test)]
mod tests;

use afferents::BoardAfferents;
use asynchronous::Asynchronous;
use comparator::Comparators;
use link::Link;
use pattern::Ball;
use refresh::Refresh;
use scan::ScanOrder;

pub use comparator::NOT_RETURNED;
pub use counts::BoardCounts;
pub use crossed::Crossed;
pub use flaws::{Flaw, Flawed, Flaws};
pub use link::{DATAGRAM_WORDS, PORT, QUEUE_WORDS};
pub use network::{Network, NetworkCounts, NetworkFaults};
pub use options::{BoardOptions, IntensityWord, Previous, Version2};
pub use pattern::pattern;
pub use play::{Armed, Play, Played};
pub use session::{opening, session};

use crate::wire::v2::Settings;
use crate::wire::{CommandReader, Registers};
use crate::{Array, Result};

/// The board: registers, previous values, time and queue.
///
/// # Examples
///
/// ```
/// use taxel_core::{Array, board::Board, wire::Registers};
/// let mut board = Board::new(Registers::preset("5.2 kHz")?, &Array::thesis())?;
/// let mut bytes = vec![];
/// board.frame(&[0; 4096], |datagram| { bytes.extend_from_slice(datagram); true })?;
/// assert!(bytes.is_empty());
/// let mut ticks = [0; 4096];
/// ticks[64 * 4 + 3] = 40;
/// board.frame(&ticks, |datagram| { bytes.extend_from_slice(datagram); true })?;
/// assert_eq!(bytes, [0xc0, 0, 1, 3, 4, 0xe0, 0, 40, 3, 4]);
/// # Ok::<(), taxel_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Board {
    array: Array,
    options: BoardOptions,
    /// Number of the session, drawn at reset, and the version of the wire after a reset.
    session: u16,
    first_version: u8,
    /// Registers as written by the host, and as the scan uses them: changes take effect at the end of a frame.
    written: Registers,
    active: Registers,
    reader: CommandReader,
    scan: ScanOrder,
    /// Time since reset, 10 ns.
    time: u64,
    comparators: Comparators,
    /// The afferent model, used instead of the comparators with `mechanoreceptor`.
    afferents: BoardAfferents,
    /// The ball whose values take the place of the comparators' with `pattern`.
    ball: Ball,
    /// The taxels' own comparators, for a board that does not scan.
    asynchronous: Asynchronous,
    link: Link,
    refresh: Refresh,
    counts: BoardCounts,
    /// The counts at the last reset.
    at_reset: BoardCounts,
    /// How many markers were dropped since then: they count among what was dropped, but not as changes.
    markers_dropped: u64,
    /// The counts in the last status lines, by fault.
    reported: [u64; 3],
}

impl Board {
    /// A board after reset, with the given registers.
    ///
    /// # Errors
    ///
    /// `Device` if the registers break a rule; `Problem` if the array has more positions than version 2 can name.
    pub fn new(registers: Registers, array: &Array) -> Result<Self> {
        Self::with_options(registers, array, BoardOptions::default())
    }

    /// A board after reset, with the given registers and options.
    ///
    /// # Errors
    ///
    /// Those of [`Board::new`]; `Problem` if the taxels are asynchronous and the registers hold version 1 of the wire, whose
    /// stamps are of 100 us, or `mechanoreceptor`, or the board compares with the last sample.
    pub fn with_options(registers: Registers, array: &Array, options: BoardOptions) -> Result<Self> {
        registers.check(array)?;
        options.check(&registers)?;
        let session = options.version_2.seed;
        Ok(Self {
            array: array.clone(),
            options,
            session,
            first_version: registers.wire_version,
            written: registers,
            active: registers,
            reader: CommandReader::default(),
            scan: ScanOrder::new(&registers, array),
            time: 0,
            comparators: Comparators::new(array.len(), array.columns),
            afferents: BoardAfferents::new(array.len()),
            ball: Ball::default(),
            asynchronous: Asynchronous::default(),
            link: Link::new(options.settings(&registers, session), array, options.queue)?,
            refresh: Refresh::default(),
            counts: BoardCounts::default(),
            at_reset: BoardCounts::default(),
            markers_dropped: 0,
            reported: [0; 3],
        })
    }

    /// Resets the board: registers as the logic resets them, with the version of the wire that it had at first; values,
    /// time and fault counts 0, in a new session. Datagrams that wait are still sent, the current one is discarded.
    ///
    /// # Errors
    ///
    /// Those of [`Board::new`].
    pub fn reset(&mut self) -> Result<()> {
        let registers = Registers::at_reset(&self.array, self.written.channels);
        let registers = Registers { wire_version: self.first_version, ..registers };
        self.session = self.session.wrapping_add(1);
        (self.written, self.active) = (registers, registers);
        (self.at_reset, self.markers_dropped) = (self.counts, 0);
        (self.reader, self.reported) = (CommandReader::default(), [0; 3]);
        self.scan.reset();
        (self.time, self.refresh) = (0, Refresh::default());
        self.comparators.values.fill(0);
        self.afferents.forget();
        self.ball = Ball::default();
        self.asynchronous = Asynchronous::default();
        self.link.reset(self.settings(), &self.array)
    }

    /// The settings that all datagrams of version 2 share at present.
    fn settings(&self) -> Settings {
        self.options.settings(&self.active, self.session)
    }

    /// Whether taxels compare their values by themselves.
    fn is_asynchronous(&self) -> bool {
        self.options.asynchronous && !self.active.mechanoreceptor
    }

    /// The registers as written; the scan applies them from the next frame on.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.written
    }

    /// Counts of what the board did and lost so far.
    #[must_use]
    pub fn counts(&self) -> &BoardCounts {
        &self.counts
    }

    /// The start of the next frame since reset, us.
    #[must_use]
    pub fn time_us(&self) -> f64 {
        self.time as f64 / 100.0
    }

    /// Time up to which all events of version 2 were sent, us: with asynchronous taxels one frame less than the time.
    fn now(&self) -> u64 {
        let behind = if self.is_asynchronous() { self.active.frame_10ns() } else { 0 };
        self.time.saturating_sub(behind) / 100
    }
}

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
pub use options::{IntensityWord, Previous, Version2};
pub use pattern::pattern;
pub use play::{Armed, Play, Played};
pub use session::{opening, session};

use crate::wire::v2::Settings;
use crate::wire::{CommandReader, Registers};
use crate::{Array, Result, problem};

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
    previous: Previous,
    intensity: IntensityWord,
    version_2: Version2,
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
    /// The taxels' own comparators, if the board does not scan.
    asynchronous: Option<Asynchronous>,
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
        registers.check(array)?;
        let (version_2, intensity) = (Version2::default(), IntensityWord::default());
        let settings = version_2.settings(&registers, intensity, version_2.seed);
        Ok(Self {
            array: array.clone(),
            previous: Previous::default(),
            intensity,
            version_2,
            session: version_2.seed,
            first_version: registers.wire_version,
            written: registers,
            active: registers,
            reader: CommandReader::default(),
            scan: ScanOrder::new(&registers, array),
            time: 0,
            comparators: Comparators::new(array.len(), array.columns),
            afferents: BoardAfferents::new(array.len()),
            ball: Ball::default(),
            asynchronous: None,
            link: Link::new(settings, array)?,
            refresh: Refresh::default(),
            counts: BoardCounts::default(),
            at_reset: BoardCounts::default(),
            markers_dropped: 0,
            reported: [0; 3],
        })
    }

    /// Sets the options of version 2.
    ///
    /// # Errors
    ///
    /// Those of [`Board::new`], for the same array.
    pub fn version_2(mut self, version_2: Version2) -> Result<Self> {
        (self.version_2, self.session) = (version_2, version_2.seed);
        self.link.reset(self.settings(), &self.array)?;
        Ok(self)
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
        self.asynchronous = self.asynchronous.take().map(|_| Asynchronous::default());
        self.link.reset(self.settings(), &self.array)
    }

    /// The settings that all datagrams of version 2 share at present.
    fn settings(&self) -> Settings {
        let frame_sync = self.active.frame_sync && self.asynchronous.is_none();
        self.version_2.settings(&Registers { frame_sync, ..self.active }, self.intensity, self.session)
    }

    /// Sets the reference with which a new value is compared.
    #[must_use]
    pub fn previous(mut self, previous: Previous) -> Self {
        self.previous = previous;
        self
    }

    /// Sets the content of an intensity word.
    #[must_use]
    pub fn intensity(mut self, intensity: IntensityWord) -> Self {
        self.intensity = intensity;
        self.link.follow(self.settings());
        self
    }

    /// Lets each taxel compare its value with that of its last event by itself: no scan, and stamps of 1 us (thesis
    /// 4.5,
    /// Table 7.1).
    ///
    /// Each step of `noise_floor + 1` ticks is an event, at the time at which the taxel's value reaches it. A taxel is
    /// read once per frame, at the time of its line, and its value is interpolated linearly between two readings, so
    /// events are sent a frame after they happened. At reset the reading of each taxel is sent. The order of lines has
    /// no effect. If `mechanoreceptor` is set later, lines are scanned while it is set.
    ///
    /// # Errors
    ///
    /// `Problem` if the registers hold version 1 of the wire, whose stamps are of 100 us, or `mechanoreceptor`, or the
    /// board compares with the last sample.
    pub fn asynchronous(mut self) -> Result<Self> {
        if self.written.wire_version != 2 {
            return Err(problem!("asynchronous"; ": wire_version is 1: must be 2, whose stamps count 1 us"));
        }
        if self.written.mechanoreceptor {
            return Err(problem!(
                "asynchronous"; ": mechanoreceptor is set: must not be set, because afferents are scanned"
            ));
        }
        if self.previous == Previous::LastSample {
            return Err(problem!("asynchronous"; ": previous is last_sample: must be last_sent"));
        }
        self.asynchronous = Some(Asynchronous::default());
        self.link.reset(self.settings(), &self.array)?;
        Ok(self)
    }

    /// Whether taxels compare their values by themselves.
    fn is_asynchronous(&self) -> bool {
        self.asynchronous.is_some() && !self.active.mechanoreceptor
    }

    /// Sets the capacity of the queue, in words; below 2 no event can be sent.
    #[must_use]
    pub fn queue(mut self, words: usize) -> Self {
        self.link.bound(words);
        self
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

//! The emulated board, as a state machine: trip times and commands in, datagrams and status lines out.
//!
//! It keeps the contract between board and logic word for word (reference, section 3, "What makes an event"), so that
//! host, emulator and logic agree. It has no clock of its own: each frame moves its time on.

mod afferents;
mod alone;
mod counts;
mod crossed;
mod flaws;
mod network;
mod outbox;
mod play;
mod scan;
mod session;

use afferents::Afferents;
use alone::{Alone, Crossing, Sample};
use outbox::Outbox;
use scan::Lfsr;
use serde::{Deserialize, Serialize};

pub use counts::BoardCounts;
pub use crossed::Crossed;
pub use flaws::{Flaw, Flawed, Flaws};
pub use network::{Faults, Network, NetworkCounts};
pub use play::{Armed, Play, Played};
pub use session::{opening, session};

use crate::wire::registers::Registers;
use crate::wire::v2::{self, Kind, Packer};
use crate::wire::{Command, CommandReader, WORD_BYTES, Word};
use crate::{Array, Result, problem};

/// Most words of a datagram of version 1: 1400 bytes (read).
pub const DATAGRAM_WORDS: usize = 280;

/// Where the board sends its datagrams (read).
pub const PORT: u16 = 5208;

/// A trip time that says: the comparator had not returned when the ramp began. A fault, not a value.
pub const NOT_RETURNED: u16 = u16::MAX;

/// Words that the queue holds by default (read): two frames of 4096 taxels, change and intensity.
pub const QUEUE_WORDS: usize = 16_384;

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
    /// There is none: a change says its taxel, time and polarity only.
    Nothing,
}

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
    capacity: usize,
    /// As written, and as the scan uses them: taken over at a frame's edge.
    written: Registers,
    active: Registers,
    reader: CommandReader,
    sense_lines: Vec<Vec<u16>>,
    lfsr: Lfsr,
    /// Since reset, 10 ns.
    time: u64,
    /// By taxel: what a new value is compared with.
    values: Vec<u16>,
    /// By taxel: whether this frame's value makes an event. By driven line: whether any of its taxels does.
    changed: Vec<bool>,
    line_changed: Vec<bool>,
    /// By taxel, with `mechanoreceptor`: the afferents, and the integrals that fired in this frame.
    afferents: Afferents,
    integrals: Vec<i64>,
    /// Where each taxel compares by itself and nothing is scanned: what they are at.
    alone: Option<Alone>,
    /// The datagram of version 1 that fills.
    filling: Vec<u8>,
    /// The datagrams of version 2.
    packer: Packer,
    version_2: Version2,
    /// Which reset this is, and the version that it leads back to.
    session: u16,
    first_version: u8,
    /// When totals were last told, 10 ns, and how many lines were told again.
    told_totals: u64,
    told_lines: u64,
    outbox: Outbox,
    counts: BoardCounts,
    /// What had been counted when it was last reset.
    at_reset: BoardCounts,
    /// What the last status lines said, by fault.
    told: [u64; 3],
}

/// How a board speaks version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Version2 {
    /// Its number.
    pub board: u16,
    /// What its session numbers are drawn from; two resets of one board never have the same within 65 536.
    pub seed: u16,
    /// For how long events may wait for company, us.
    pub hold_us: u64,
    /// How often it promises that nothing has happened, us; each frame for 0.1 s after an event.
    pub heartbeat_us: u64,
    /// How often each value is told again and the board's totals said, us; 0: never.
    pub states_us: u64,
}

impl Default for Version2 {
    fn default() -> Self {
        Self { board: 0, seed: 1, hold_us: 0, heartbeat_us: 10_000, states_us: 1_000_000 }
    }
}

impl Board {
    /// A board after reset, with the given registers.
    ///
    /// # Errors
    ///
    /// `Device` where the registers break a rule; `Problem` where the array has more positions than version 2 can name.
    pub fn new(registers: Registers, array: &Array) -> Result<Self> {
        registers.check(array)?;
        let (version_2, intensity) = (Version2::default(), IntensityWord::default());
        let settings = settings(&registers, intensity, &version_2, version_2.seed);
        Ok(Self {
            array: array.clone(),
            previous: Previous::default(),
            intensity,
            capacity: QUEUE_WORDS,
            written: registers,
            active: registers,
            reader: CommandReader::default(),
            sense_lines: scan::sense_lines(&registers, array),
            lfsr: Lfsr::new(),
            time: 0,
            values: vec![0; array.len()],
            changed: vec![false; array.len()],
            line_changed: vec![false; array.columns.into()],
            afferents: Afferents::default(),
            integrals: vec![0; array.len()],
            alone: None,
            filling: Vec::with_capacity(DATAGRAM_WORDS * WORD_BYTES),
            packer: Packer::new(settings, array)?,
            version_2,
            session: version_2.seed,
            first_version: registers.wire_version,
            told_totals: 0,
            told_lines: 0,
            outbox: Outbox::default(),
            counts: BoardCounts::default(),
            at_reset: BoardCounts::default(),
            told: [0; 3],
        })
    }

    /// Chooses how it speaks version 2.
    ///
    /// # Errors
    ///
    /// None that [`Board::new`] had not: the array is the same.
    pub fn version_2(mut self, version_2: Version2) -> Result<Self> {
        (self.version_2, self.session) = (version_2, version_2.seed);
        self.packer = Packer::new(self.settings(), &self.array)?;
        Ok(self)
    }

    /// Resets the board: registers, values and time as at the start, in a new session; what waits is still sent.
    ///
    /// # Errors
    ///
    /// None that [`Board::new`] had not.
    pub fn reset(&mut self) -> Result<()> {
        let registers = Registers::at_reset(&self.array, self.written.channels);
        let registers = Registers { wire_version: self.first_version, ..registers };
        self.session = self.session.wrapping_add(1);
        (self.written, self.active) = (registers, registers);
        self.at_reset = self.counts;
        self.lfsr = Lfsr::new();
        (self.time, self.told_totals, self.told_lines) = (0, 0, 0);
        self.values.fill(0);
        self.afferents.forget();
        self.alone = self.alone.take().map(|_| Alone::default());
        self.filling.clear();
        self.packer = Packer::new(self.settings(), &self.array)?;
        Ok(())
    }

    fn settings(&self) -> v2::Settings {
        let frame_sync = self.active.frame_sync && self.alone.is_none();
        settings(&Registers { frame_sync, ..self.active }, self.intensity, &self.version_2, self.session)
    }

    /// Chooses what a new value is compared with.
    #[must_use]
    pub fn previous(mut self, previous: Previous) -> Self {
        self.previous = previous;
        self
    }

    /// Chooses what an intensity word holds.
    #[must_use]
    pub fn intensity(mut self, intensity: IntensityWord) -> Self {
        self.intensity = intensity;
        self.packer.follow(self.settings());
        self
    }

    /// Lets each taxel compare by itself with what it sent last: no scan, and stamps of 1 us (thesis 4.5, Table 7.1).
    ///
    /// A taxel tells each step of `noise_floor + 1` ticks when it reaches it. What it reads is known once a frame, at the
    /// time of its line; between two readings it counts as a straight line, so events leave a frame after they happened.
    /// At reset each tells what it reads. The order of lines plays no part; while `mechanoreceptor` is set later, lines are
    /// scanned.
    ///
    /// # Errors
    ///
    /// `Problem` where the registers hold version 1 of the wire, whose stamps are of 100 us, or `mechanoreceptor`, or the
    /// board compares with the last sample.
    pub fn asynchronous(mut self) -> Result<Self> {
        if self.written.wire_version != 2 {
            return Err(problem!("asynchronous: wire_version is 1: must be 2, for stamps of 1 us"));
        }
        if self.written.mechanoreceptor {
            return Err(problem!("asynchronous: mechanoreceptor is set: must not be, afferents are scanned"));
        }
        if self.previous == Previous::LastSample {
            return Err(problem!("asynchronous: previous is last_sample: must be last_sent"));
        }
        self.alone = Some(Alone::default());
        self.packer = Packer::new(self.settings(), &self.array)?;
        Ok(self)
    }

    /// Bounds the queue, in words; below 2 nothing gets through.
    #[must_use]
    pub fn queue(mut self, words: usize) -> Self {
        self.capacity = words;
        self
    }

    /// What the board says at reset.
    #[must_use]
    pub fn greeting(&self) -> String {
        let Registers { wire_version, channels, .. } = self.written;
        format!("taxel-board v{wire_version} {}x{} {channels}ch\n", self.array.rows, self.array.columns)
    }

    /// The registers as written; the scan takes them over at the next frame's edge.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.written
    }

    /// What the board did and lost so far.
    #[must_use]
    pub fn counts(&self) -> &BoardCounts {
        &self.counts
    }

    /// The start of the next frame since reset, us.
    #[must_use]
    pub fn time_us(&self) -> f64 {
        self.time as f64 / 100.0
    }

    /// Takes command bytes as they come; gives the status lines that answer them, each with its line end.
    pub fn command(&mut self, bytes: &[u8]) -> String {
        bytes.iter().filter_map(|&byte| self.reader.push(byte)).collect::<Vec<_>>().into_iter().fold(
            String::new(),
            |mut lines, command| {
                lines += &self.execute(command);
                lines.push('\n');
                lines
            },
        )
    }

    fn execute(&mut self, command: Command) -> String {
        let Command { register, value } = command;
        if register == 6 && value == 8 {
            return self.greeting().trim_end().to_owned();
        }
        if register == 6 && value < 8 {
            return format!("ok REG{value}=0x{:08X}", self.written.word(value as u8));
        }
        let recording = self.written.record;
        match self.written.write(command, &self.array) {
            Err(refusal) => format!("bad REG{register} rule {}", refusal.rule),
            Ok(()) => {
                if self.written.record != recording {
                    self.mark(self.written.record);
                }
                format!("ok REG{register}=0x{value:08X}")
            }
        }
    }

    /// Starts or stops a recording, as a write of `record` does: a marker goes out where that changes anything.
    pub fn record(&mut self, start: bool) {
        if self.written.record != start {
            self.written.record = start;
            self.mark(start);
        }
    }

    fn mark(&mut self, start: bool) {
        if self.active.wire_version == 2 {
            let now = self.now();
            let Self { outbox, counts, packer, .. } = self;
            packer.marker(now, start, &mut |datagram, events| {
                counts.words += 2 * u64::from(events == 0);
                outbox.send(datagram, 2 * events.max(1), &mut |_| false, counts);
            });
        } else {
            let word = Word::Marker { stamp: stamp(self.time), start };
            self.enqueue(&word.to_bytes(), &mut |_| false);
        }
    }

    /// The faults whose count has moved since this was last asked, one status line each.
    pub fn faults(&mut self) -> String {
        let now = [
            ("queue", self.counts.dropped),
            ("comparator", self.counts.not_returned),
            ("command", self.reader.skipped()),
        ];
        let mut lines = String::new();
        for ((name, count), told) in now.into_iter().zip(&mut self.told) {
            if count != *told {
                lines += &format!("fault {name} {count}\n");
                *told = count;
            }
        }
        lines
    }

    /// Scans one frame and moves time on by it.
    ///
    /// `ticks` are the trip times of the comparators by taxel index, in 1/300 us from the ramp's start; one at or above
    /// the ramp's length reads as that length, and [`NOT_RETURNED`] is a fault. `sink` gets each datagram's payload and
    /// says whether it took it; what it does not take waits in the queue, and a full queue drops a taxel's words.
    ///
    /// # Errors
    ///
    /// `Problem` where there is not one trip time a taxel.
    pub fn frame(&mut self, ticks: &[u16], mut sink: impl FnMut(&[u8]) -> bool) -> Result<()> {
        if ticks.len() != self.array.len() {
            return Err(problem!("frame of {} trip times: the array has {} taxels", ticks.len(), self.array.len()));
        }
        self.outbox.offer(&mut sink, &mut self.counts);
        self.take_over(&mut sink);
        let registers = self.active;
        let mut lines: Vec<u16> = (0..registers.lines).collect();
        if registers.random_lines {
            self.lfsr.shuffle(&mut lines);
        }
        let any = if registers.mechanoreceptor { self.feel(ticks) } else { self.compare(ticks) };
        if self.is_alone() {
            self.tell_crossings(any, ticks, &mut sink);
        } else if any {
            for (place, &x) in (0_u64..).zip(&lines) {
                if self.line_changed[usize::from(x)] {
                    self.line(x, self.time + place * u64::from(registers.line_period), ticks, &mut sink);
                }
            }
        }
        if self.previous == Previous::LastSample && !registers.mechanoreceptor {
            self.sample(ticks, registers.lines.into());
        }
        self.time += registers.frame_10ns();
        self.counts.frames += 1;
        self.end_frame(&mut sink);
        Ok(())
    }

    /// Whether taxels compare by themselves.
    fn is_alone(&self) -> bool {
        self.alone.is_some() && !self.active.mechanoreceptor
    }

    /// Up to where all is told on version 2, us: where taxels compare by themselves a frame less than the time.
    fn now(&self) -> u64 {
        let behind = if self.is_alone() { self.active.frame_10ns() } else { 0 };
        self.time.saturating_sub(behind) / 100
    }

    /// Finds what taxels by themselves have to tell, and tells what happened before this frame.
    fn tell_crossings(&mut self, any: bool, ticks: &[u16], sink: &mut impl FnMut(&[u8]) -> bool) {
        let Some(mut alone) = self.alone.take() else { return };
        let (registers, columns, new) = (self.active, usize::from(self.array.columns), alone.is_new());
        if any {
            for taxel in (0..ticks.len()).filter(|&taxel| self.changed[taxel]) {
                let (x, y) = ((taxel % columns) as u16, (taxel / columns) as u16);
                let exists = self.array.exists.as_ref().is_none_or(|exists| exists[taxel]);
                if x >= registers.lines || !exists {
                    continue;
                }
                let after = u64::from(x) * u64::from(registers.line_period);
                let sample = Sample { taxel, x, y, after, ticks: ticks[taxel].min(registers.ramp) };
                alone.cross(self.time, sample, registers.noise_floor.into(), &mut self.values[taxel]);
            }
        }
        let values = &self.values;
        // One whose comparator is stuck stays as it was told.
        let read = ticks.iter().zip(values).map(|(&t, &value)| if t == NOT_RETURNED { value } else { t });
        let due = alone.over(self.time, read.map(|t| t.min(registers.ramp)));
        self.alone = Some(alone);
        // What all taxels tell at reset is of the first frame itself.
        debug_assert!(!new || due.is_empty());
        for Crossing { at, x, y, p, value, moved } in due {
            let told = if self.intensity == IntensityWord::Difference { moved } else { value };
            self.counts.changes += 1;
            self.queue_event(at, (x, y), p, told, sink);
        }
    }

    /// Takes over what was written, at a frame's edge.
    fn take_over(&mut self, sink: &mut impl FnMut(&[u8]) -> bool) {
        if self.active == self.written {
            return;
        }
        if self.active.wire_version != self.written.wire_version {
            self.flush(sink);
        }
        if self.active.mechanoreceptor != self.written.mechanoreceptor {
            self.afferents.forget();
            self.alone = self.alone.take().map(|_| Alone::default());
        }
        self.active = self.written;
        let (now, settings) = (self.now(), self.settings());
        let Self { outbox, counts, packer, .. } = self;
        packer.flush(now, &mut |datagram, events| outbox.send(datagram, 2 * events, sink, counts));
        packer.follow(settings);
    }

    /// Sends what is due at a frame's end: all of version 1; of version 2 events, promises, values and totals told again.
    fn end_frame(&mut self, sink: &mut impl FnMut(&[u8]) -> bool) {
        if self.active.wire_version == 1 {
            self.flush(sink);
            return;
        }
        let (now, next) = (self.now(), self.now() + self.active.frame_10ns() / 100);
        let every = self.version_2.states_us * 100;
        let Self { outbox, counts, packer, .. } = self;
        packer.over(now, next, &mut |datagram, events| outbox.send(datagram, 2 * events, sink, counts));
        if every == 0 {
            return;
        }
        let due = (u128::from(self.time) * u128::from(self.active.lines) / u128::from(every)) as u64;
        // A frame that is longer than the period tells each line once.
        let lines = u64::from(self.active.lines);
        for told in self.told_lines.max(due.saturating_sub(lines))..due {
            self.tell_again((told % lines) as u16, now, sink);
        }
        self.told_lines = due;
        if self.time / every > self.told_totals {
            self.told_totals = self.time / every;
            let (now_counts, then) = (self.counts, self.at_reset);
            let dropped = now_counts.dropped - then.dropped;
            let status = v2::Status {
                frames: now_counts.frames - then.frames,
                events: (now_counts.changes - then.changes).saturating_sub(dropped),
                dropped,
                datagrams: 0,
                faults: now_counts.not_returned - then.not_returned,
            };
            let Self { outbox, counts, packer, .. } = self;
            packer.status(now, &status, &mut |datagram, events| outbox.send(datagram, 2 * events, sink, counts));
        }
    }

    /// Tells the values of a line again: what the board compares with.
    fn tell_again(&mut self, x: u16, now: u64, sink: &mut impl FnMut(&[u8]) -> bool) {
        if self.active.mechanoreceptor || self.intensity == IntensityWord::Nothing {
            return;
        }
        let Self { outbox, counts, packer, array, values, .. } = self;
        let exists = |taxel: usize| array.exists.as_ref().is_none_or(|exists| exists[taxel]);
        let taxels = (0..array.rows)
            .map(|y| ((x, y), array.index(x, y)))
            .filter(|&(_, taxel)| exists(taxel))
            .map(|(place, taxel)| (place, values[taxel]));
        packer.states(now, taxels, &mut |datagram, events| outbox.send(datagram, 2 * events, sink, counts));
    }

    /// Lets the afferents feel a frame; says whether any of them fires.
    fn feel(&mut self, ticks: &[u16]) -> bool {
        self.afferents.begin(ticks, &self.active);
        self.line_changed.fill(false);
        let (columns, lines) = (usize::from(self.array.columns), usize::from(self.active.lines));
        let mut any = false;
        for (taxel, &t) in ticks.iter().enumerate() {
            let x = taxel % columns;
            self.changed[taxel] = false;
            if x >= lines {
                continue;
            }
            if t == NOT_RETURNED {
                self.counts.not_returned += 1;
                continue;
            }
            if let Some(integral) = self.afferents.sample(taxel, t.min(self.active.ramp), &self.active) {
                self.integrals[taxel] = integral;
                (self.changed[taxel], self.line_changed[x], any) = (true, true, true);
            }
        }
        any
    }

    /// Finds the taxels whose value makes an event, in one pass over the whole array; says whether there is any.
    fn compare(&mut self, ticks: &[u16]) -> bool {
        let columns = usize::from(self.array.columns);
        let (ramp, floor, lines) = (self.active.ramp, u16::from(self.active.noise_floor), self.active.lines.into());
        self.line_changed.fill(false);
        let rows = ticks.chunks_exact(columns).zip(self.values.chunks_exact(columns));
        for ((ticks, values), changed) in rows.zip(self.changed.chunks_exact_mut(columns)) {
            for x in 0..columns {
                let hit = ticks[x].min(ramp).abs_diff(values[x]) > floor && ticks[x] != NOT_RETURNED;
                changed[x] = hit;
                self.line_changed[x] |= hit;
            }
            self.counts.not_returned += ticks[..lines].iter().map(|&t| u64::from(t == NOT_RETURNED)).sum::<u64>();
        }
        self.line_changed[..lines].iter().any(|&hit| hit)
    }

    /// Queues the events of one driven line: step after step, channel after channel; of version 2 with all of a frame at one
    /// time row after row, as its words ask for.
    fn line(&mut self, x: u16, start: u64, ticks: &[u16], sink: &mut impl FnMut(&[u8]) -> bool) {
        let registers = self.active;
        if registers.wire_version == 2 && registers.frame_sync {
            for y in 0..self.array.rows {
                self.tell(self.time, (x, y), ticks, sink);
            }
            return;
        }
        for step in 0..self.sense_lines.len() {
            let at =
                if registers.frame_sync { self.time } else { start + step as u64 * u64::from(registers.step_period) };
            for channel in 0..self.sense_lines[step].len() {
                self.tell(at, (x, self.sense_lines[step][channel]), ticks, sink);
            }
        }
    }

    /// Queues the event of a taxel, where it has one.
    fn tell(&mut self, at: u64, (x, y): (u16, u16), ticks: &[u16], sink: &mut impl FnMut(&[u8]) -> bool) {
        let registers = self.active;
        let taxel = self.array.index(x, y);
        if !self.changed[taxel] || self.array.exists.as_ref().is_some_and(|exists| !exists[taxel]) {
            return;
        }
        let (value, before) = (ticks[taxel].min(registers.ramp), self.values[taxel]);
        let (p, told) = if registers.mechanoreceptor {
            (self.integrals[taxel] > 0, afferents::told(self.integrals[taxel]))
        } else {
            match self.intensity {
                IntensityWord::Value | IntensityWord::Nothing => (value >= before, value),
                IntensityWord::Difference => (value >= before, value.abs_diff(before)),
            }
        };
        self.counts.changes += 1;
        if self.queue_event(at, (x, y), p, told, sink) && !registers.mechanoreceptor {
            self.values[taxel] = value;
        }
    }

    /// Queues an event on the version that is spoken; false where the queue is full and it was dropped.
    fn queue_event(
        &mut self,
        at: u64,
        (x, y): (u16, u16),
        p: bool,
        told: u16,
        sink: &mut impl FnMut(&[u8]) -> bool,
    ) -> bool {
        if self.active.wire_version == 2 {
            return self.pack(at / 100, (x, y), p, told, sink);
        }
        // Rule 8: on version 1 columns and rows fit a byte.
        let (x, y) = (x as u8, y as u8);
        let mut words = [0; 2 * WORD_BYTES];
        words[..WORD_BYTES].copy_from_slice(&Word::Change { stamp: stamp(at), x, y, p }.to_bytes());
        words[WORD_BYTES..].copy_from_slice(&Word::Intensity { ticks: told, x, y, p }.to_bytes());
        let valued = self.active.mechanoreceptor || self.intensity != IntensityWord::Nothing;
        self.enqueue(&words[..if valued { 2 } else { 1 } * WORD_BYTES], sink)
    }

    /// Gives an event to the packer; false where the queue is full and it was dropped.
    fn pack(&mut self, t: u64, taxel: (u16, u16), p: bool, value: u16, sink: &mut impl FnMut(&[u8]) -> bool) -> bool {
        let Self { outbox, counts, packer, capacity, .. } = self;
        if outbox.words() + 2 * packer.waiting() + 2 > *capacity {
            counts.dropped += 1;
            packer.dropped();
            return false;
        }
        counts.words += 2;
        packer.event(t, taxel, p, value, &mut |datagram, events| outbox.send(datagram, 2 * events, sink, counts));
        true
    }

    /// Remembers this frame's samples, sent or not.
    fn sample(&mut self, ticks: &[u16], lines: usize) {
        let columns = usize::from(self.array.columns);
        for (ticks, values) in ticks.chunks_exact(columns).zip(self.values.chunks_exact_mut(columns)) {
            for x in 0..lines {
                if ticks[x] != NOT_RETURNED {
                    values[x] = ticks[x].min(self.active.ramp);
                }
            }
        }
    }

    /// Queues the words of a taxel, or a marker; false where the queue is full and they were dropped.
    fn enqueue(&mut self, words: &[u8], sink: &mut impl FnMut(&[u8]) -> bool) -> bool {
        if self.filling.len() + words.len() > DATAGRAM_WORDS * WORD_BYTES {
            self.flush(sink);
        }
        let count = words.len() / WORD_BYTES;
        if self.outbox.words() + self.filling.len() / WORD_BYTES + count > self.capacity {
            self.counts.dropped += 1;
            return false;
        }
        self.filling.extend_from_slice(words);
        self.counts.words += count as u64;
        true
    }

    /// Ends the datagram of version 1 that fills: sent after what waits, or left to wait.
    fn flush(&mut self, sink: &mut impl FnMut(&[u8]) -> bool) {
        self.outbox.offer(sink, &mut self.counts);
        let words = self.filling.len() / WORD_BYTES;
        if words > 0 {
            self.outbox.send(&self.filling, words, sink, &mut self.counts);
            self.filling.clear();
        }
    }
}

/// How a board with these registers speaks version 2.
fn settings(registers: &Registers, intensity: IntensityWord, how: &Version2, session: u16) -> v2::Settings {
    let kind = if registers.mechanoreceptor {
        Kind::Large
    } else if intensity == IntensityWord::Nothing {
        Kind::Changes
    } else if registers.ramp <= 255 {
        Kind::Small
    } else {
        Kind::Large
    };
    v2::Settings {
        board: how.board,
        session,
        kind,
        frame_sync: registers.frame_sync,
        differences: !registers.mechanoreceptor && intensity == IntensityWord::Difference,
        hold_us: how.hold_us,
        heartbeat_us: how.heartbeat_us,
    }
}

/// The stamp of a time in 10 ns.
fn stamp(time: u64) -> u16 {
    ((time / 10_000) & 0xffff) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Pairing, decode, registers::PRESETS};

    fn board() -> Board {
        Board::new(Registers::default(), &Array::thesis()).unwrap()
    }

    fn play(board: &mut Board, ticks: &[u16]) -> Vec<Vec<u8>> {
        let mut datagrams = vec![];
        board
            .frame(ticks, |datagram| {
                datagrams.push(datagram.to_vec());
                true
            })
            .unwrap();
        datagrams
    }

    fn words(datagrams: &[Vec<u8>]) -> Vec<Word> {
        let word = |w: &[u8]| Word::from_bytes(w.try_into().unwrap());
        datagrams.iter().flat_map(|d| d.chunks(WORD_BYTES)).map(word).collect()
    }

    #[test]
    fn a_full_frame_goes_line_by_line_step_by_step_channel_by_channel() {
        let datagrams = play(&mut board(), &[100; 4096]);
        assert!(datagrams.iter().all(|d| d.len() <= 1400 && d.len() % 10 == 0));
        assert_eq!(datagrams.len(), (8192_usize).div_ceil(280));
        let (events, _) = decode(&datagrams.concat(), Array::thesis(), Pairing::Direct);
        let order: Vec<(u16, u16)> = events.x.iter().copied().zip(events.y.iter().copied()).collect();
        let mut expected = vec![];
        for line in 0..64 {
            for step in 0..4 {
                expected.extend((0..16).map(|channel| (line, 4 * channel + step)));
            }
        }
        assert_eq!(order, expected);
    }

    #[test]
    fn a_change_must_exceed_the_floor_and_a_ramp_is_never_exceeded() {
        let mut board = board();
        let mut ticks = vec![0; 4096];
        ticks[7] = 3;
        assert!(play(&mut board, &ticks).is_empty());
        ticks[7] = 4;
        let change = Word::Change { stamp: 1, x: 7, y: 0, p: true };
        assert_eq!(words(&play(&mut board, &ticks)), [change, Word::Intensity { ticks: 4, x: 7, y: 0, p: true }]);
        ticks[7] = 9000;
        assert_eq!(words(&play(&mut board, &ticks))[1], Word::Intensity { ticks: 150, x: 7, y: 0, p: true });
        ticks[7] = NOT_RETURNED;
        assert!(play(&mut board, &ticks).is_empty());
        assert_eq!((board.faults(), board.faults()), ("fault comparator 1\n".to_owned(), String::new()));
    }

    #[test]
    fn a_slow_rise_is_sent_with_the_last_value_sent_and_never_with_the_last_sample() {
        let sent = |mut board: Board| -> usize {
            (0..20_u16).map(|frame| play(&mut board, &[frame; 4096]).concat().len() / 10).sum()
        };
        assert_eq!(sent(board()), 4 * 4096);
        assert_eq!(sent(board().previous(Previous::LastSample)), 0);
    }

    #[test]
    fn differences_carry_their_sign_in_the_polarity() {
        let mut board = board().intensity(IntensityWord::Difference);
        let mut ticks = vec![0; 4096];
        for (value, difference, p) in [(50, 50, true), (20, 30, false)] {
            ticks[0] = value;
            assert_eq!(words(&play(&mut board, &ticks))[1], Word::Intensity { ticks: difference, x: 0, y: 0, p });
        }
    }

    #[test]
    fn stamps_are_the_frames_with_sync_and_the_steps_without() {
        let slow = Registers { line_period: 10_000, ..Registers::default() };
        for (frame_sync, expected) in [(true, 0), (false, 63)] {
            let mut board = Board::new(Registers { frame_sync, ..slow }, &Array::thesis()).unwrap();
            let all = words(&play(&mut board, &[100; 4096]));
            let Some(Word::Change { stamp, .. }) = all.iter().rev().nth(1) else { panic!("a change") };
            assert_eq!(*stamp, expected);
        }
    }

    #[test]
    fn random_lines_visit_each_line_once_a_frame_in_an_order_of_its_own() {
        let registers = Registers { random_lines: true, noise_floor: 0, ..Registers::default() };
        let mut board = Board::new(registers, &Array::thesis()).unwrap();
        let mut orders = std::collections::HashSet::new();
        for frame in 0..50_u16 {
            let (events, _) = decode(&play(&mut board, &[frame + 1; 4096]).concat(), Array::thesis(), Pairing::Direct);
            let order: Vec<u16> = events.x.chunks(64).map(|line| line[0]).collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..64).collect::<Vec<u16>>());
            assert!(orders.insert(order), "frame {frame} repeats an order");
        }
    }

    #[test]
    fn a_full_queue_drops_both_words_of_a_taxel_and_counts_them() {
        let mut board = board().queue(1000);
        board.frame(&[100; 4096], |_| false).unwrap();
        assert_eq!((board.counts().words, board.counts().dropped), (1000, 4096 - 500));
        let later = play(&mut board, &[100; 4096]);
        // What was never sent still differs, so it comes with the next frame.
        assert_eq!(words(&later).len(), 2 * 4096);
        assert_eq!(board.counts().sent, board.counts().words);
        assert_eq!(board.faults(), "fault queue 3596\n");
    }

    #[test]
    fn commands_are_answered_and_taken_over_at_a_frames_edge() {
        let mut board = board();
        assert_eq!(board.greeting(), "taxel-board v1 64x64 16ch\n");
        let write = |register, value| Command { register, value }.to_bytes();
        assert_eq!(board.command(&write(4, 160)), "ok REG4=0x000000A0\n");
        assert_eq!(board.command(&write(4, 165)), "bad REG4 rule 3\n");
        assert_eq!(board.command(&write(6, 4)), "ok REG4=0x000000A0\n");
        assert_eq!(board.command(&write(6, 8)), board.greeting());
        assert_eq!(board.command(&write(6, 9)), "bad REG6 rule 4\n");
        assert_eq!(
            board.command(&[write(5, 0x003f_0a00), write(6, 5)].concat()),
            "ok REG5=0x003F0A00\nok REG5=0x003F0A00\n"
        );
        let bytes = write(1, 400);
        let answers: Vec<String> = bytes.iter().map(|&byte| board.command(&[byte])).collect();
        assert_eq!(answers.concat(), "ok REG1=0x00000190\n");
        play(&mut board, &[0; 4096]);
        assert_eq!(board.time_us(), 256.0);
    }

    #[test]
    fn record_marks_the_stream_once_each_way() {
        let mut board = board();
        play(&mut board, &[0; 4096]);
        board.command(&Command { register: 7, value: 1 << 16 }.to_bytes());
        board.record(true);
        assert_eq!(words(&play(&mut board, &[0; 4096])), [Word::Marker { stamp: 1, start: true }]);
        board.record(false);
        assert_eq!(words(&play(&mut board, &[0; 4096])), [Word::Marker { stamp: 3, start: false }]);
    }

    #[test]
    fn a_board_of_afferents_fires_as_equations_5_1_to_5_5_say() {
        use rand::{Rng, SeedableRng, rngs::StdRng};
        let mut random = StdRng::seed_from_u64(9);
        let registers = Registers::preset("5.2 kHz, FA-1").unwrap();
        let mut board = Board::new(registers, &Array::thesis()).unwrap();
        // In whole numbers of 2^-16, as the page of the registers says.
        let rest = i64::from(registers.threshold_rest) * 64;
        let jump = i64::from(registers.threshold_jump) * rest / 256;
        let decay = i64::from(registers.threshold_decay) * rest / 1024;
        let (mut base, mut theta, mut spikes) = (None, rest, 0);
        let mut ticks = vec![40_u16; 4096];
        for frame in 0..5000 {
            let step: u16 = [0, 0, 0, 1, 2, 40][random.random_range(0..6)];
            ticks[70] = if random.random() { ticks[70] + step } else { ticks[70].saturating_sub(step) }.min(150);
            let said = words(&play(&mut board, &ticks));
            let pressure = (f64::from(ticks[70]).powf(0.7) * 65_536.0).round() as i64;
            let integral = pressure - *base.get_or_insert(pressure);
            if integral.abs() > theta {
                spikes += 1;
                let [Word::Change { x, y, p, .. }, Word::Intensity { ticks: told, .. }] = said[..] else {
                    panic!("frame {frame}: {said:?}, {integral} against {theta}")
                };
                assert_eq!((x, y, p), (6, 1, integral > 0), "frame {frame}");
                assert_eq!(i64::from(told), integral.abs() / 64, "frame {frame}");
                (base, theta) = (Some(pressure), theta + jump);
            } else {
                assert!(said.is_empty(), "frame {frame}: {said:?}, {integral} against {theta}");
                theta = if theta > rest { theta - decay } else { rest };
            }
        }
        assert!(spikes > 50, "{spikes}");
    }

    #[test]
    fn presets_play_on_boards_that_fit_them() {
        for preset in PRESETS.iter().filter(|p| p.sense_lines == 64 && !p.registers.mechanoreceptor) {
            let mut board = Board::new(preset.registers, &Array::thesis()).unwrap();
            assert_eq!(words(&play(&mut board, &[50; 4096])).len(), 8192, "{}", preset.name);
        }
    }

    #[test]
    fn nonsense_is_refused() {
        let mut board = board();
        assert!(board.frame(&[0; 4095], |_| true).unwrap_err().to_string().contains("4095 trip times"));
        let wide = Array::new(2, 65, 1.0, "wide").unwrap();
        assert!(Board::new(Registers::default(), &wide).unwrap_err().to_string().contains("choose version 2 (rule 8)"));
        let huge = Array::new(257, 256, 1.0, "huge").unwrap();
        let refused = Board::new(Registers::at_reset(&huge, 64), &huge).unwrap_err().to_string();
        assert!(refused.contains("more than 65536 positions"), "{refused}");
        let small = Array::new(8, 8, 1.0, "small").unwrap();
        assert!(Board::new(Registers::default(), &small).unwrap_err().to_string().contains("8 columns to drive"));
    }
}

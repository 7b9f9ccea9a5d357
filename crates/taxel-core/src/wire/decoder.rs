//! Decodes bytes of version 1 to events as they arrive: resynchronises after damage, unwraps time, pairs intensities
//! and counts every loss.

mod blocks;
pub(in crate::wire) mod clock;
mod counts;

pub use clock::FARTHEST_BACK;
pub(in crate::wire) use clock::TURN;
pub use counts::Counts;

use blocks::Carried;
use clock::StampClock;

use crate::vectors::Instructions;
use crate::wire::columns::{BLOCK, Block, Columns, PendingChange};
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES, Word};
use crate::{Array, Events, Marker, Result, Stop, problem};

/// Decodes bytes to events as they arrive, however the stream is cut.
///
/// A change waits until the next word shows whether it has an intensity, until the end of its datagram
/// ([`Self::end_of_datagram`]), or until the end of the stream ([`Self::finish`]).
///
/// # Examples
///
/// ```
/// use taxel_core::{Array, Events, wire::Decoder};
/// let (mut decoder, mut events) = (Decoder::new(Array::thesis()), Events::empty(Array::thesis()));
/// decoder.push(&[0xc0, 0x00, 0x05, 0x03, 0x04], None, &mut events);
/// decoder.finish(&mut events);
/// assert_eq!((events.t[0], events.x[0], events.y[0], events.p[0]), (500, 3, 4, true));
/// ```
#[derive(Debug, Clone)]
pub struct Decoder {
    array: Array,
    instructions: Instructions,
    /// The bytes of an incomplete word.
    partial: [u8; WORD_BYTES],
    have: usize,
    clock: StampClock,
    /// The change whose intensity may be the next word.
    pending: Option<PendingChange>,
    block: Block,
    /// Each taxel's last value, if intensities are differences; none if it is unknown.
    held: Option<Vec<Option<u16>>>,
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array. It reads intensities as values.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            instructions: Instructions::best(),
            partial: [0; WORD_BYTES],
            have: 0,
            clock: StampClock::default(),
            pending: None,
            block: Block::new(),
            held: None,
            counts: Counts::default(),
        }
    }

    /// Sets whether intensities are differences from the last value sent (the panel's "delta intensity"); the bytes do
    /// not show this. The decoder then accumulates the differences from 0, signed by polarity, so that events hold
    /// values in both cases. The sums are correct from the board's reset on, where the board compares with the last
    /// value sent, and until an intensity is lost.
    #[must_use]
    pub fn differences(mut self, differences: bool) -> Self {
        self.held = differences.then(|| vec![Some(0); self.array.len()]);
        self
    }

    /// Sets each taxel's current value, by index, none if it is unknown; differences accumulate from these values. An
    /// event whose difference applies to an unknown value gets no intensity and counts as unpaired. Has no effect if
    /// intensities are values.
    pub fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        if let Some(values) = &mut self.held {
            values.iter_mut().zip(held).for_each(|(values, held)| *values = held);
        }
    }

    /// Whether intensities are values, not differences.
    pub(super) fn has_values(&self) -> bool {
        self.held.is_none()
    }

    /// Each taxel's current value, by index; none if it is unknown, and always none if intensities are values.
    #[must_use]
    pub fn held(&self) -> Vec<Option<u16>> {
        self.held.clone().unwrap_or_else(|| vec![None; self.array.len()])
    }

    /// Uses other vector instructions than the machine's best, for tests and measurements: the events are the same.
    ///
    /// # Errors
    ///
    /// `Problem` if this machine does not have them.
    pub fn instructions(mut self, instructions: Instructions) -> Result<Self> {
        self.instructions = instructions.checked()?;
        Ok(self)
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }

    /// What was read and dropped so far.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The newest time, and that of the last stamp, us; none before the first stamp.
    pub(in crate::wire) fn times(&self) -> Option<(i64, i64)> {
        let latest = self.clock.latest?;
        Some((latest * STAMP_US, self.clock.behind.unwrap_or(latest) * STAMP_US))
    }

    /// Decodes the next bytes; appends the events that they complete.
    ///
    /// `arrived` is the host's clock in us when the bytes came; it shows how long a silence of more than 6.45 s was.
    pub fn push(&mut self, bytes: &[u8], arrived: Option<i64>, out: &mut Events) {
        let mut block = std::mem::take(&mut self.block);
        // With the change that waits, and a word of which bytes came before.
        for piece in bytes.chunks((BLOCK - 2) * WORD_BYTES) {
            let mut columns = block.columns();
            self.decode(piece, arrived, &mut columns);
            out.append_columns(&columns);
        }
        self.block = block;
    }

    /// As [`Self::push`], but fills columns that the caller allocated; with `last` the stream ends after these bytes.
    ///
    /// # Errors
    ///
    /// `Problem` if the columns have less room than [`most_rows`] requires, in which case nothing is read;
    /// `Interrupted` if asked to stop.
    pub fn fill(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        columns: &mut Columns<'_>,
        last: bool,
        stop: Stop<'_>,
    ) -> Result<()> {
        /// Bytes between two checks of `stop`: some milliseconds of work.
        const PIECE: usize = 16 << 20;
        columns.check_room(bytes.len(), most_rows(bytes.len()))?;
        for piece in bytes.chunks(PIECE) {
            stop.check()?;
            self.decode(piece, arrived, columns);
        }
        if last {
            self.release(columns);
            self.as_new();
        }
        Ok(())
    }

    /// As [`Self::fill`] to the end of the stream, but decodes consecutive datagrams with these `lengths` separately: a
    /// change whose intensity is not in its datagram has none.
    ///
    /// # Errors
    ///
    /// `Problem` if the lengths together are not those of the bytes, or the columns have too little room, and nothing was
    /// read; `Interrupted` if asked to stop.
    pub fn fill_datagrams(
        &mut self,
        bytes: &[u8],
        lengths: &[i64],
        columns: &mut Columns<'_>,
        stop: Stop<'_>,
    ) -> Result<()> {
        /// Datagrams between two checks of `stop`: some milliseconds of work.
        const PIECE: usize = 1 << 14;
        let total = lengths.iter().try_fold(0, |sum: usize, &n| sum.checked_add(usize::try_from(n).ok()?));
        if total != Some(bytes.len()) {
            return Err(problem!("lengths"; ": each must be 0 or more, and their sum {} bytes", bytes.len()));
        }
        columns.check_room(bytes.len(), most_rows(bytes.len()))?;
        self.release(columns);
        let mut rest = bytes;
        for piece in lengths.chunks(PIECE) {
            stop.check()?;
            for &length in piece {
                let (datagram, later) = rest.split_at(length as usize);
                self.read(datagram, None, columns);
                columns.open = false;
                rest = later;
            }
        }
        self.as_new();
        Ok(())
    }

    /// Marks the end of a datagram: a change whose intensity has not arrived gets none, and is appended.
    pub fn end_of_datagram(&mut self, out: &mut Events) {
        let mut block = std::mem::take(&mut self.block);
        let mut columns = block.columns();
        self.release(&mut columns);
        out.append_columns(&columns);
        self.block = block;
    }

    /// Ends the stream: appends the remaining event and resets the decoder, except for its counts.
    pub fn finish(&mut self, out: &mut Events) {
        self.end_of_datagram(out);
        self.as_new();
    }

    /// Adds the change that waits for its intensity without one.
    fn release(&mut self, columns: &mut Columns<'_>) {
        if let Some(change) = self.pending.take() {
            columns.push(change);
            columns.open = false;
        }
    }

    /// Discards an incomplete word and the time, but not the counts.
    fn as_new(&mut self) {
        self.give_up_partial();
        self.clock = StampClock::default();
        if let Some(held) = &mut self.held {
            held.fill(Some(0));
        }
    }

    /// Decodes bytes to rows; a change whose intensity may be the next word waits.
    fn decode(&mut self, bytes: &[u8], arrived: Option<i64>, columns: &mut Columns<'_>) {
        if let Some(change) = self.pending.take() {
            columns.push(change);
        }
        self.read(bytes, arrived, columns);
        self.pending = columns.take_pending();
    }

    fn read(&mut self, bytes: &[u8], arrived: Option<i64>, columns: &mut Columns<'_>) {
        let mut at = 0;
        while at < bytes.len() {
            if self.have == 0 {
                at += self.plain(&bytes[at..], arrived, columns);
            }
            // The block loop stopped here: decode one word, or skip damaged bytes until the next first byte.
            for &byte in &bytes[at..] {
                self.byte(byte, arrived, columns);
                at += 1;
                if self.have == 0 {
                    break;
                }
            }
        }
    }

    /// Decodes the plain words at the start of `bytes`; returns how many bytes they have.
    ///
    /// None if the stamps alone do not unwrap the words: before the first stamp, and until this arrival time was used.
    fn plain(&mut self, bytes: &[u8], arrived: Option<i64>, columns: &mut Columns<'_>) -> usize {
        if self.held.is_some() || self.clock.arrived != arrived {
            return 0;
        }
        let Some(latest) = self.clock.latest else { return 0 };
        // After a step back (a reordered datagram), the words up to the latest time are plain too.
        let mut state = match self.clock.behind {
            Some(behind) => Carried { latest: behind, until: latest - 1, intensities: 0, unpaired: 0 },
            None => Carried { latest, until: i64::MAX, intensities: 0, unpaired: 0 },
        };
        let before = columns.rows;
        let done = blocks::plain(self.instructions, bytes, self.array.columns, self.array.rows, &mut state, columns);
        let changes = (columns.rows - before) as u64;
        match &mut self.clock.behind {
            Some(behind) => {
                *behind = state.latest;
                self.counts.back += changes;
            }
            None => self.clock.latest = Some(state.latest),
        }
        self.counts.bytes += done as u64;
        self.counts.words += (done / WORD_BYTES) as u64;
        self.counts.changes += changes;
        self.counts.intensities += state.intensities;
        self.counts.unpaired += state.unpaired;
        done
    }

    fn byte(&mut self, byte: u8, arrived: Option<i64>, columns: &mut Columns<'_>) {
        if byte & FIRST != 0 {
            self.give_up_partial();
        } else if self.have == 0 {
            self.counts.bytes += 1;
            self.counts.skipped += 1;
            return;
        }
        self.partial[self.have] = byte;
        self.have += 1;
        if self.have == WORD_BYTES {
            self.have = 0;
            self.counts.bytes += WORD_BYTES as u64;
            self.counts.words += 1;
            self.word(Word::from_bytes(self.partial), arrived, columns);
        }
    }

    fn give_up_partial(&mut self) {
        self.counts.bytes += self.have as u64;
        self.counts.skipped += self.have as u64;
        self.counts.short += u64::from(self.have > 0);
        self.have = 0;
    }

    fn word(&mut self, word: Word, arrived: Option<i64>, columns: &mut Columns<'_>) {
        let open = std::mem::take(&mut columns.open);
        match word {
            Word::Contradictory => self.counts.contradictory += 1,
            Word::Marker { stamp, start } => {
                self.counts.markers += 1;
                let t = self.time(stamp, arrived);
                columns.markers.push(Marker { t, start });
            }
            Word::Change { x, y, .. } | Word::Intensity { x, y, .. }
                if u16::from(x) >= self.array.columns || u16::from(y) >= self.array.rows =>
            {
                self.counts.outside += 1;
            }
            Word::Change { stamp, x, y, p } => {
                self.counts.changes += 1;
                columns.push(PendingChange { t: self.time(stamp, arrived), x: x.into(), y: y.into(), p });
            }
            Word::Intensity { ticks, x, y, p } => {
                let (x, y) = (u16::from(x), u16::from(y));
                let taxel = self.array.index(x, y);
                let ticks = match &mut self.held {
                    None => Some(ticks),
                    Some(held) => {
                        let add =
                            |before: u16| if p { before.saturating_add(ticks) } else { before.saturating_sub(ticks) };
                        held[taxel] = held[taxel].map(add);
                        held[taxel]
                    }
                };
                let paired = ticks.is_some_and(|ticks| open && columns.pair(ticks, x, y));
                *(if paired { &mut self.counts.intensities } else { &mut self.counts.unpaired }) += 1;
            }
        }
    }

    /// Unwraps a stamp to us.
    fn time(&mut self, stamp: u16, arrived: Option<i64>) -> i64 {
        let (time, back) = self.clock.unwrap(stamp, arrived);
        self.counts.back += u64::from(back);
        time * STAMP_US
    }
}

/// Most rows that this many bytes can complete, whatever preceded them.
#[must_use]
pub fn most_rows(bytes: usize) -> usize {
    bytes / WORD_BYTES + 2
}

/// Decodes a whole stream at once.
#[must_use]
pub fn decode(bytes: &[u8], array: Array) -> (Events, Counts) {
    let (mut decoder, mut events) = (Decoder::new(array.clone()), Events::empty(array));
    decoder.push(bytes, None, &mut events);
    decoder.finish(&mut events);
    (events, *decoder.counts())
}

#[cfg(test)]
mod tests;

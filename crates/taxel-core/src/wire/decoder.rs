//! Decodes bytes of version 1 to events as they arrive: resynchronises after damage, unwraps time, pairs intensities
//! and counts every loss.

mod blocks;
pub(in crate::wire) mod clock;
mod counts;
mod fill;
mod filling;
mod pairing;

pub use clock::FARTHEST_BACK;
pub use counts::Counts;
pub use pairing::Pairing;

use blocks::Carried;
use clock::StampClock;
use filling::{FilledColumns, PendingChange};
use pairing::{UnpairedChanges, append};

use crate::vectors::Instructions;
use crate::wire::columns::{self, Filled, Room};
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES, Word};
use crate::{Array, Events, Marker, Result};

/// Decodes bytes to events as they arrive, however the stream is cut.
///
/// A change waits until the next word shows whether it has an intensity, until the end of its datagram
/// ([`Self::end_of_datagram`]), or until the end of the stream ([`Self::finish`]).
///
/// # Examples
///
/// ```
/// use taxel_core::{Array, wire::Decoder};
/// let mut decoder = Decoder::new(Array::thesis());
/// let mut events = decoder.push(&[0xc0, 0x00, 0x05, 0x03, 0x04], None);
/// decoder.finish_into(&mut events);
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
    waiting: Option<PendingChange>,
    by_taxel: Option<UnpairedChanges>,
    /// Each taxel's last value, if intensities are differences; none if it is unknown.
    held: Option<Vec<Option<u16>>>,
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array. It pairs an intensity with the word before it and reads intensities as values.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            instructions: Instructions::best(),
            partial: [0; WORD_BYTES],
            have: 0,
            clock: StampClock::default(),
            waiting: None,
            by_taxel: None,
            held: None,
            counts: Counts::default(),
        }
    }

    /// Chooses which change an intensity belongs to.
    #[must_use]
    pub fn pairing(mut self, pairing: Pairing) -> Self {
        self.by_taxel = (pairing == Pairing::Taxel).then(|| UnpairedChanges::new(&self.array));
        self
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

    /// Decodes the next bytes; returns the events that they complete.
    ///
    /// `arrived` is the host's clock in us when the bytes came; it shows how long a silence of more than 6.45 s was.
    pub fn push(&mut self, bytes: &[u8], arrived: Option<i64>) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.push_into(bytes, arrived, &mut events);
        events
    }

    /// As [`Self::push`], but appends to columns that the caller reuses ([`Events::clear`]).
    pub fn push_into(&mut self, bytes: &[u8], arrived: Option<i64>, out: &mut Events) {
        let (before, most) = (out.len(), self.most_rows(bytes.len()));
        // SAFETY: `fill_columns` writes each row that it counts, and with `paired` its ticks and present.
        unsafe {
            columns::append(out, most, |room, paired, markers| {
                self.fill_columns(bytes, arrived, room, paired, markers)
            });
        }
        out.mark_repaired(before, false);
    }

    /// Most rows that the next `bytes` bytes can complete.
    #[must_use]
    pub fn most_rows(&self, bytes: usize) -> usize {
        (self.have + bytes) / WORD_BYTES + 1
    }

    /// Marks the end of a datagram: a change whose intensity has not arrived gets none.
    pub fn end_of_datagram(&mut self) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.end_of_datagram_into(&mut events);
        events
    }

    /// As [`Self::end_of_datagram`], but appends.
    pub fn end_of_datagram_into(&mut self, out: &mut Events) {
        if let Some(change) = self.waiting.take() {
            append(out, change, None);
            out.mark_repaired(out.len() - 1, false);
        }
    }

    /// Ends the stream: returns the remaining events and resets the decoder, except for its counts.
    pub fn finish(&mut self) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.finish_into(&mut events);
        events
    }

    /// As [`Self::finish`], but appends.
    pub fn finish_into(&mut self, out: &mut Events) {
        self.end_of_datagram_into(out);
        if let Some(by_taxel) = &mut self.by_taxel {
            let before = out.len();
            by_taxel.finish_into(out);
            out.mark_repaired(before, false);
        }
        self.as_new();
    }

    /// Discards an incomplete word and the time, but not the counts.
    fn as_new(&mut self) {
        self.give_up_partial();
        self.clock = StampClock::default();
        if let Some(held) = &mut self.held {
            held.fill(Some(0));
        }
    }

    fn fill_columns(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        room: Room<'_>,
        paired: bool,
        markers: &mut Vec<Marker>,
    ) -> Filled {
        let mut filling = FilledColumns { room, rows: 0, paired, open: false };
        if let Some(change) = self.waiting.take() {
            filling.change(change);
        }
        let mut at = 0;
        while self.have > 0 && at < bytes.len() {
            self.byte(bytes[at], arrived, &mut filling, markers);
            at += 1;
        }
        while at < bytes.len() {
            at += self.plain(&bytes[at..], arrived, &mut filling);
            // The block loop stopped here: decode one word, or skip damaged bytes until the next first byte.
            for &byte in &bytes[at..] {
                self.byte(byte, arrived, &mut filling, markers);
                at += 1;
                if self.have == 0 {
                    break;
                }
            }
        }
        if filling.open {
            self.waiting = Some(filling.take_last());
        }
        Filled { rows: filling.rows, paired: filling.paired }
    }

    /// Decodes the plain words at the start of `bytes`; returns how many bytes they have.
    ///
    /// None if the stamps alone do not unwrap the words: before the first stamp, and until this arrival time was used.
    fn plain(&mut self, bytes: &[u8], arrived: Option<i64>, filling: &mut FilledColumns<'_>) -> usize {
        if self.by_taxel.is_some() || self.held.is_some() || self.clock.arrived != arrived {
            return 0;
        }
        let Some(latest) = self.clock.latest else { return 0 };
        // After a step back (a reordered datagram), the words up to the latest time are plain too.
        let mut state = match self.clock.behind {
            Some(behind) => Carried { latest: behind, until: latest - 1, intensities: 0, unpaired: 0 },
            None => Carried { latest, until: i64::MAX, intensities: 0, unpaired: 0 },
        };
        let before = filling.rows;
        let done = blocks::plain(self.instructions, bytes, self.array.columns, self.array.rows, &mut state, filling);
        let changes = (filling.rows - before) as u64;
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

    fn byte(&mut self, byte: u8, arrived: Option<i64>, filling: &mut FilledColumns<'_>, markers: &mut Vec<Marker>) {
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
            self.word(Word::from_bytes(self.partial), arrived, filling, markers);
        }
    }

    fn give_up_partial(&mut self) {
        self.counts.bytes += self.have as u64;
        self.counts.skipped += self.have as u64;
        self.counts.short += u64::from(self.have > 0);
        self.have = 0;
    }

    fn word(&mut self, word: Word, arrived: Option<i64>, filling: &mut FilledColumns<'_>, markers: &mut Vec<Marker>) {
        let open = std::mem::take(&mut filling.open);
        match word {
            Word::Contradictory => self.counts.contradictory += 1,
            Word::Marker { stamp, start } => {
                self.counts.markers += 1;
                let t = self.time(stamp, arrived);
                markers.push(Marker { t, start });
            }
            Word::Change { x, y, .. } | Word::Intensity { x, y, .. }
                if u16::from(x) >= self.array.columns || u16::from(y) >= self.array.rows =>
            {
                self.counts.outside += 1;
            }
            Word::Change { stamp, x, y, p } => {
                self.counts.changes += 1;
                let change = PendingChange { t: self.time(stamp, arrived), x: x.into(), y: y.into(), p };
                match &mut self.by_taxel {
                    Some(by_taxel) => by_taxel.change(change),
                    None => filling.change(change),
                }
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
                let paired = match (ticks, &mut self.by_taxel) {
                    (None, _) => false,
                    (Some(ticks), Some(by_taxel)) => by_taxel.intensity(taxel, ticks),
                    (Some(ticks), None) => open && filling.pair(ticks, x, y),
                };
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
pub fn decode(bytes: &[u8], array: Array, pairing: Pairing) -> (Events, Counts) {
    let mut decoder = Decoder::new(array).pairing(pairing);
    let mut events = decoder.push(bytes, None);
    decoder.finish_into(&mut events);
    (events, *decoder.counts())
}

#[cfg(test)]
mod tests;

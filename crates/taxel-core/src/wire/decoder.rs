//! Bytes to events, as they come: finds its place after damage, unwraps time, pairs intensities, counts every loss.

mod blocks;
mod clock;
mod filling;

pub use clock::FARTHEST_BACK;

use blocks::Carried;
use clock::Clock;
use filling::{Change, Filling};
use serde::{Deserialize, Serialize};

use crate::vectors::Instructions;
use crate::wire::columns::{self, Filled, Room};
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES, Word};
use crate::{Array, Events, Intensities, Marker, Result, Stop, problem};

/// Which change an intensity belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pairing {
    /// The word directly before it, where that is a change of the same taxel. Reading: so the board sends them.
    #[default]
    Direct,
    /// The latest change of that taxel that has none yet, for boards that order otherwise. Every event waits for
    /// [`Decoder::finish`], for an intensity may come at any time: for whole recordings.
    Taxel,
}

/// What a decoder saw, and all that it dropped, by cause.
///
/// The sums close at any time: `bytes = 5 words + skipped`, and
/// `words = changes + intensities + unpaired + markers + contradictory + outside`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Bytes read; up to four of a word that is not complete count when it is, or when it is given up.
    pub bytes: u64,
    /// Complete words, of whatever kind.
    pub words: u64,
    /// Bytes that belong to no complete word: those of short events, and those before the next first byte.
    pub skipped: u64,
    /// Events cut off by the next first byte, or by the end.
    pub short: u64,
    /// Changes on the array: rows of `Events`.
    pub changes: u64,
    /// Intensities that found their change.
    pub intensities: u64,
    /// Intensities that found none.
    pub unpaired: u64,
    /// Starts and stops.
    pub markers: u64,
    /// Words of a contradictory kind.
    pub contradictory: u64,
    /// Changes and intensities outside the array.
    pub outside: u64,
    /// Changes and markers that lie behind the latest time; kept.
    pub back: u64,
}

impl Counts {
    /// What was counted since an earlier time.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            bytes: self.bytes - earlier.bytes,
            words: self.words - earlier.words,
            skipped: self.skipped - earlier.skipped,
            short: self.short - earlier.short,
            changes: self.changes - earlier.changes,
            intensities: self.intensities - earlier.intensities,
            unpaired: self.unpaired - earlier.unpaired,
            markers: self.markers - earlier.markers,
            contradictory: self.contradictory - earlier.contradictory,
            outside: self.outside - earlier.outside,
            back: self.back - earlier.back,
        }
    }
}

/// Turns bytes into events as they come, wherever they are cut.
///
/// A change waits for the next word (its intensity), the end of its datagram ([`Self::end_of_datagram`]) or the end of
/// the stream ([`Self::finish`]), and no longer.
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
    /// The bytes of a word that is not complete.
    partial: [u8; WORD_BYTES],
    have: usize,
    clock: Clock,
    waiting: Option<Change>,
    by_taxel: Option<ByTaxel>,
    /// What each taxel held last, where intensities are differences; none where that is not known.
    held: Option<Vec<Option<u16>>>,
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array: pairs directly, takes intensities as values.
    #[must_use]
    pub fn new(array: Array) -> Self {
        Self {
            array,
            instructions: Instructions::best(),
            partial: [0; WORD_BYTES],
            have: 0,
            clock: Clock::default(),
            waiting: None,
            by_taxel: None,
            held: None,
            counts: Counts::default(),
        }
    }

    /// Chooses which change an intensity belongs to.
    #[must_use]
    pub fn pairing(mut self, pairing: Pairing) -> Self {
        self.by_taxel = (pairing == Pairing::Taxel).then(|| ByTaxel::new(&self.array));
        self
    }

    /// Says whether intensities are differences from the last value sent (the panel's "delta intensity"), which the
    /// bytes do not show. They are then added up from 0 by polarity, so that events hold values either way; right from
    /// the board's reset on, where it compares with the last value sent, and until an intensity is lost.
    #[must_use]
    pub fn differences(mut self, differences: bool) -> Self {
        self.held = differences.then(|| vec![Some(0); self.array.len()]);
        self
    }

    /// Says what the taxels hold, by index, none where that is not known: differences add up from there. One that is added to
    /// what is not known gives no event an intensity, and counts as unpaired. Of no account where intensities are values.
    pub fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        if let Some(own) = &mut self.held {
            own.iter_mut().zip(held).for_each(|(own, held)| *own = held);
        }
    }

    /// Uses other vector instructions than the machine's best, for tests and measurements: the events are the same.
    ///
    /// # Errors
    ///
    /// `Problem` where this machine does not have them.
    pub fn instructions(mut self, instructions: Instructions) -> Result<Self> {
        self.instructions = instructions.checked()?;
        Ok(self)
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }

    /// What was seen and dropped so far.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Takes the next bytes; gives the events that they complete.
    ///
    /// `arrived` is the host's clock in us when the bytes came; it tells how long a silence of more than 6.45 s was.
    pub fn push(&mut self, bytes: &[u8], arrived: Option<i64>) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.push_into(bytes, arrived, &mut events);
        events
    }

    /// As [`Self::push`], into columns that are used again ([`Events::clear`]): appends.
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

    /// How many rows the next `bytes` bytes can give at most.
    #[must_use]
    pub fn most_rows(&self, bytes: usize) -> usize {
        (self.have + bytes) / WORD_BYTES + 1
    }

    /// Says that a datagram ends here: a change whose intensity has not come has none.
    pub fn end_of_datagram(&mut self) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.end_of_datagram_into(&mut events);
        events
    }

    /// As [`Self::end_of_datagram`]; appends.
    pub fn end_of_datagram_into(&mut self, out: &mut Events) {
        if let Some(change) = self.waiting.take() {
            append(out, change, None);
            out.mark_repaired(out.len() - 1, false);
        }
    }

    /// Ends the stream: gives the rest and is as new, but for the counts.
    pub fn finish(&mut self) -> Events {
        let mut events = Events::empty(self.array.clone());
        self.finish_into(&mut events);
        events
    }

    /// As [`Self::finish`]; appends.
    pub fn finish_into(&mut self, out: &mut Events) {
        self.end_of_datagram_into(out);
        if let Some(by_taxel) = &mut self.by_taxel {
            let before = out.len();
            by_taxel.finish_into(out);
            out.mark_repaired(before, false);
        }
        self.as_new();
    }

    /// Forgets half a word and the time, but not the counts.
    fn as_new(&mut self) {
        self.give_up_partial();
        self.clock = Clock::default();
        if let Some(held) = &mut self.held {
            held.fill(Some(0));
        }
    }

    /// As [`Self::push`], into columns that the caller lays out, from their first row on; where these bytes are the `last`,
    /// the stream ends behind them. Gives the markers too. With [`Pairing::Taxel`] all events wait for [`Self::finish`].
    ///
    /// # Errors
    ///
    /// `Problem` where a column has fewer entries than [`Self::most_rows`] asks for, and nothing was read; `Interrupted`
    /// where asked to stop.
    pub fn fill(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        mut room: Room<'_>,
        last: bool,
        stop: Stop<'_>,
    ) -> Result<(Filled, Vec<Marker>)> {
        /// Bytes between two looks at `stop`: some milliseconds of work.
        const PIECE: usize = 16 << 20;
        self.check_room(&room, bytes.len())?;
        let (mut done, mut markers) = (Filled { rows: 0, paired: false }, vec![]);
        for piece in bytes.chunks(PIECE) {
            stop.check()?;
            self.fill_behind(piece, arrived, &mut room, &mut done, &mut markers);
        }
        if last {
            self.release(&mut room, &mut done);
            self.as_new();
        }
        Ok((done, markers))
    }

    /// As [`Self::fill`] to the end of the stream, of datagrams that lie one behind the other, each as long as `lengths` say and
    /// heard by itself: a change whose intensity is not in its datagram has none.
    ///
    /// # Errors
    ///
    /// `Problem` where the lengths together are not those of the bytes, or a column has too few entries, and nothing was read;
    /// `Interrupted` where asked to stop.
    pub fn fill_datagrams(
        &mut self,
        bytes: &[u8],
        lengths: &[i64],
        mut room: Room<'_>,
        stop: Stop<'_>,
    ) -> Result<(Filled, Vec<Marker>)> {
        /// Datagrams between two looks at `stop`: some milliseconds of work.
        const PIECE: usize = 1 << 14;
        let total = lengths.iter().try_fold(0, |sum: usize, &n| sum.checked_add(usize::try_from(n).ok()?));
        if total != Some(bytes.len()) {
            return Err(problem!("lengths: must be 0 or more each, and {} bytes together", bytes.len()));
        }
        self.check_room(&room, bytes.len())?;
        let (mut done, mut markers, mut rest) = (Filled { rows: 0, paired: false }, vec![], bytes);
        for piece in lengths.chunks(PIECE) {
            stop.check()?;
            for &length in piece {
                let (datagram, later) = rest.split_at(length as usize);
                self.fill_behind(datagram, None, &mut room, &mut done, &mut markers);
                self.release(&mut room, &mut done);
                rest = later;
            }
        }
        self.as_new();
        Ok((done, markers))
    }

    /// Refuses columns with less room than so many bytes may need.
    fn check_room(&self, room: &Room<'_>, bytes: usize) -> Result<()> {
        let most = self.most_rows(bytes);
        if room.len() < most {
            return Err(problem!("columns have room for {} rows: {bytes} bytes may need {most}", room.len()));
        }
        Ok(())
    }

    /// Fills columns on from what is done.
    fn fill_behind(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        room: &mut Room<'_>,
        done: &mut Filled,
        markers: &mut Vec<Marker>,
    ) {
        let filled = self.fill_columns(bytes, arrived, room.behind(done.rows), done.paired, markers);
        if filled.paired && !done.paired {
            room.without_intensities(done.rows);
        }
        *done = Filled { rows: done.rows + filled.rows, paired: filled.paired };
    }

    /// Writes the change that waits for its intensity, if there is one: it has none.
    fn release(&mut self, room: &mut Room<'_>, done: &mut Filled) {
        if let Some(change) = self.waiting.take() {
            let mut filling = Filling { room: room.behind(done.rows), rows: 0, paired: done.paired, open: false };
            filling.change(change);
            done.rows += filling.rows;
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
        let mut filling = Filling { room, rows: 0, paired, open: false };
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
            // What is not plain: one word, or damage byte by byte to the next place.
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

    /// Decodes the plain words that lie ahead; gives how many bytes they had.
    ///
    /// None where stamps alone do not unwrap them: before the first, and until this arrival has been reckoned with.
    fn plain(&mut self, bytes: &[u8], arrived: Option<i64>, filling: &mut Filling<'_>) -> usize {
        if self.by_taxel.is_some() || self.held.is_some() || self.clock.heard != arrived {
            return 0;
        }
        let Some(latest) = self.clock.latest else { return 0 };
        // Behind a step back (a datagram that was overtaken) the words up to the latest time are plain too.
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

    fn byte(&mut self, byte: u8, arrived: Option<i64>, filling: &mut Filling<'_>, markers: &mut Vec<Marker>) {
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

    fn word(&mut self, word: Word, arrived: Option<i64>, filling: &mut Filling<'_>, markers: &mut Vec<Marker>) {
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
                let change = Change { t: self.time(stamp, arrived), x: x.into(), y: y.into(), p };
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

    /// Unwraps a stamp; us.
    fn time(&mut self, stamp: u16, arrived: Option<i64>) -> i64 {
        let (time, back) = self.clock.unwrap(stamp, arrived);
        self.counts.back += u64::from(back);
        time * STAMP_US
    }
}

/// Decodes a whole stream at once.
#[must_use]
pub fn decode(bytes: &[u8], array: Array, pairing: Pairing) -> (Events, Counts) {
    let mut decoder = Decoder::new(array).pairing(pairing);
    let mut events = decoder.push(bytes, None);
    decoder.finish_into(&mut events);
    (events, *decoder.counts())
}

fn append(out: &mut Events, change: Change, ticks: Option<u16>) {
    out.t.push(change.t);
    out.x.push(change.x);
    out.y.push(change.y);
    out.p.push(change.p);
    if ticks.is_some() || out.intensity.is_some() {
        let rows = out.t.len() - 1;
        let column =
            out.intensity.get_or_insert_with(|| Intensities { ticks: vec![0; rows], present: vec![false; rows] });
        column.ticks.push(ticks.unwrap_or(0));
        column.present.push(ticks.is_some());
    }
}

/// Changes that wait for intensities from anywhere later in the stream.
#[derive(Debug, Clone)]
struct ByTaxel {
    changes: Vec<Change>,
    ticks: Vec<Option<u16>>,
    /// For each change, the unpaired change of its taxel before it.
    before: Vec<Option<usize>>,
    /// For each taxel, its latest unpaired change.
    latest: Vec<Option<usize>>,
    columns: usize,
}

impl ByTaxel {
    fn new(array: &Array) -> Self {
        Self {
            changes: vec![],
            ticks: vec![],
            before: vec![],
            latest: vec![None; array.len()],
            columns: array.columns.into(),
        }
    }

    fn change(&mut self, change: Change) {
        let latest = &mut self.latest[usize::from(change.y) * self.columns + usize::from(change.x)];
        self.before.push(latest.replace(self.changes.len()));
        self.changes.push(change);
        self.ticks.push(None);
    }

    /// Whether there was a change to pair with.
    fn intensity(&mut self, taxel: usize, ticks: u16) -> bool {
        let Some(k) = self.latest[taxel] else { return false };
        self.ticks[k] = Some(ticks);
        self.latest[taxel] = self.before[k];
        true
    }

    fn finish_into(&mut self, out: &mut Events) {
        for (change, ticks) in self.changes.drain(..).zip(self.ticks.drain(..)) {
            append(out, change, ticks);
        }
        self.before.clear();
        self.latest.fill(None);
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng, seq::IndexedRandom};

    use super::clock::TURN;
    use super::*;

    fn change(stamp: u16, x: u8, y: u8) -> Word {
        Word::Change { stamp, x, y, p: true }
    }

    fn intensity(ticks: u16, x: u8, y: u8) -> Word {
        Word::Intensity { ticks, x, y, p: true }
    }

    fn bytes(words: &[Word]) -> Vec<u8> {
        words.iter().flat_map(|w| w.to_bytes()).collect()
    }

    fn decode(words: &[Word]) -> (Events, Counts) {
        crate::wire::decode(&bytes(words), Array::thesis(), Pairing::Direct)
    }

    fn intensities(events: &Events) -> Vec<Option<u16>> {
        let i = events.intensity.clone().unwrap_or_default();
        i.ticks.iter().zip(&i.present).map(|(&t, &p)| p.then_some(t)).collect()
    }

    #[test]
    fn a_word_comes_back_from_its_bytes() {
        for value in [0, 1, 0x7f, 0x80, 0x3fff, 0x4000, 0xc000, 0xffff] {
            for p in [false, true] {
                let (x, y) = (63, 21);
                for word in [
                    Word::Change { stamp: value, x, y, p },
                    Word::Intensity { ticks: value, x, y, p },
                    Word::Marker { stamp: value, start: p },
                ] {
                    assert_eq!(Word::from_bytes(word.to_bytes()), word);
                }
            }
        }
    }

    #[test]
    fn time_goes_on_over_the_wrap() {
        let (events, counts) = decode(&[change(65_000, 0, 0), change(65_535, 0, 0), change(3, 0, 0)]);
        assert_eq!(events.t, [6_500_000, 6_553_500, 6_553_900]);
        assert_eq!(counts.back, 0);
    }

    #[test]
    fn a_tenth_of_a_second_back_is_a_step_back_and_more_lies_ahead() {
        let (events, counts) = decode(&[change(1000, 0, 0), change(0, 0, 0), change(1001, 0, 0)]);
        assert_eq!((events.t, counts.back), (vec![100_000, 0, 100_100], 1));
        let (events, counts) = decode(&[change(1001, 0, 0), change(0, 0, 0)]);
        assert_eq!((events.t, counts.back), (vec![100_100, 6_553_600], 0));
        let (events, _) = decode(&[change(0, 0, 0), change(65_535, 0, 0)]);
        assert_eq!(events.t, [0, -100]);
    }

    #[test]
    fn arrival_times_tell_how_long_a_silence_was() {
        for turns in 0..4_i64 {
            for rest in [0, 1, 999, 40_000, 65_000, 65_535] {
                let silence = turns * TURN + rest;
                for late in [-200_000, 0, 200_000] {
                    let mut decoder = Decoder::new(Array::thesis());
                    let mut events = decoder.push(&bytes(&[change(7, 0, 0)]), Some(1_000_000));
                    let arrived = 1_000_000 + silence * STAMP_US + late;
                    let stamp = ((7 + silence) % TURN) as u16;
                    decoder.push_into(&bytes(&[change(stamp, 1, 0)]), Some(arrived), &mut events);
                    decoder.finish_into(&mut events);
                    assert_eq!(events.t[1] - events.t[0], silence * STAMP_US, "silence {silence}, late {late}");
                }
            }
        }
    }

    #[test]
    fn arrival_times_out_of_all_reason_do_no_harm() {
        let mut decoder = Decoder::new(Array::thesis());
        for arrived in [i64::MIN, i64::MAX, 0, i64::MAX, i64::MIN] {
            decoder.push(&bytes(&[change(7, 0, 0)]), Some(arrived));
        }
        assert_eq!(decoder.counts().words, 5);
    }

    #[test]
    fn an_intensity_belongs_to_the_change_directly_before_it() {
        let (events, counts) = decode(&[
            change(0, 1, 1),
            intensity(50, 1, 1),
            intensity(51, 1, 1),
            change(0, 2, 2),
            intensity(52, 3, 2),
            change(1, 3, 3),
            change(1, 4, 4),
            intensity(53, 4, 4),
            intensity(54, 3, 3),
        ]);
        assert_eq!(intensities(&events), [Some(50), None, None, Some(53)]);
        assert_eq!((counts.changes, counts.intensities, counts.unpaired), (4, 2, 3));
    }

    #[test]
    fn a_whole_recording_may_be_paired_by_taxel() {
        let words = [
            change(0, 1, 1),
            change(1, 1, 1),
            change(1, 2, 2),
            intensity(51, 1, 1),
            intensity(52, 2, 2),
            intensity(50, 1, 1),
            intensity(49, 1, 1),
        ];
        let (events, counts) = crate::wire::decode(&bytes(&words), Array::thesis(), Pairing::Taxel);
        assert_eq!(intensities(&events), [Some(50), Some(51), Some(52)]);
        assert_eq!((counts.intensities, counts.unpaired), (3, 1));
    }

    #[test]
    fn a_change_waits_no_longer_than_its_datagram() {
        let mut decoder = Decoder::new(Array::thesis());
        assert_eq!(decoder.push(&bytes(&[change(0, 1, 1)]), None).len(), 0);
        assert_eq!(decoder.end_of_datagram().len(), 1);
        assert_eq!(decoder.push(&bytes(&[intensity(5, 1, 1)]), None).len(), 0);
        assert_eq!(decoder.counts().unpaired, 1);
        assert_eq!(decoder.finish().len(), 0);
    }

    #[test]
    fn any_word_ends_the_wait() {
        let array = Array::new(8, 8, 1.0, "small").unwrap();
        let other = [
            change(0, 20, 1),
            intensity(0, 1, 20),
            Word::Marker { stamp: 0, start: true },
            Word::Contradictory,
            change(0, 1, 2),
        ];
        for word in other {
            let mut decoder = Decoder::new(array.clone());
            let events = decoder.push(&bytes(&[change(0, 1, 1), word]), None);
            assert_eq!(events.len(), 1, "{word:?}");
            assert!(decoder.push(&bytes(&[intensity(9, 1, 1)]), None).intensity.is_none());
            assert_eq!(decoder.counts().unpaired, 1);
        }
    }

    #[test]
    fn differences_add_up_to_held_values() {
        let words = [
            change(0, 1, 1),
            intensity(50, 1, 1),
            Word::Change { stamp: 1, x: 1, y: 1, p: false },
            Word::Intensity { ticks: 20, x: 1, y: 1, p: false },
            Word::Change { stamp: 2, x: 1, y: 1, p: false },
            Word::Intensity { ticks: 40, x: 1, y: 1, p: false },
        ];
        let mut decoder = Decoder::new(Array::thesis()).differences(true);
        let mut events = decoder.push(&bytes(&words), None);
        decoder.finish_into(&mut events);
        assert_eq!(intensities(&events), [Some(50), Some(30), Some(0)]);
    }

    #[test]
    fn differences_add_up_from_what_was_held_and_to_nothing_from_what_is_unknown() {
        let words = [change(0, 1, 1), intensity(50, 1, 1), change(1, 2, 1), intensity(7, 2, 1)];
        for pairing in [Pairing::Direct, Pairing::Taxel] {
            let mut decoder = Decoder::new(Array::thesis()).pairing(pairing).differences(true);
            let index = Array::thesis().index(1, 1);
            decoder.begin_with((0..4096).map(|taxel| (taxel == index).then_some(300)));
            let mut events = decoder.push(&bytes(&words), None);
            decoder.finish_into(&mut events);
            assert_eq!((events.len(), intensities(&events)), (2, vec![Some(350), None]));
            assert_eq!((decoder.counts().intensities, decoder.counts().unpaired), (1, 1));
        }
    }

    #[test]
    fn sums_close_over_damage() {
        let whole = bytes(&[change(0, 1, 1), intensity(5, 1, 1), Word::Contradictory, change(2, 1, 1)]);
        for at in 0..whole.len() {
            for damage in [0x00, 0x7f, 0x80, 0xff, 0xa8] {
                let mut spoilt = whole.clone();
                spoilt[at] = damage;
                spoilt.insert(at / 2, damage);
                let mut decoder = Decoder::new(Array::thesis());
                decoder.push(&spoilt, None);
                decoder.finish();
                let c = decoder.counts();
                assert_eq!(c.bytes, spoilt.len() as u64);
                assert_eq!(c.bytes, 5 * c.words + c.skipped);
                let kinds = c.changes + c.intensities + c.unpaired + c.markers + c.contradictory + c.outside;
                assert_eq!(c.words, kinds);
            }
        }
    }

    /// So many rounds; under Miri, which is thousands of times slower, two.
    fn rounds(many: u64) -> std::ops::Range<u64> {
        0..if cfg!(miri) { 2 } else { many }
    }

    /// A stream of runs: clean changes, pairs, a mix, stamps that jump or fall, rare kinds, damage.
    fn stream(random: &mut StdRng, words: usize) -> Vec<u8> {
        let mut bytes = vec![];
        let mut stamp: u16 = random.random();
        let mut last = (0, 0);
        while bytes.len() < 5 * words {
            let run = random.random_range(1..200);
            let (style, quiet) = (random.random_range(0..9), random.random_bool(0.5));
            let top = *[8, 63, 64].choose(random).unwrap();
            for k in 0..run {
                stamp = match style {
                    5 => stamp.wrapping_add(random.random()),
                    6 if random.random_bool(0.02) => stamp.wrapping_sub(*[1, 999, 1000, 1001].choose(random).unwrap()),
                    _ if quiet => stamp,
                    _ => stamp.wrapping_add(random.random_range(0..3)),
                };
                let p = random.random();
                let intensity = match style {
                    0 | 5 | 6 => false,
                    1 | 2 => k % 2 == 1,
                    _ => random.random(),
                };
                if !intensity || random.random_bool(0.05) {
                    last = (random.random_range(0..top), random.random_range(0..top));
                }
                let (x, y) = last;
                let mut word = if intensity {
                    Word::Intensity { ticks: random.random(), x, y, p }
                } else {
                    Word::Change { stamp, x, y, p }
                }
                .to_bytes();
                word[0] |= random.random::<u8>() & 0x14 & if style == 0 { 0xff } else { 0x10 };
                word[3] |= random.random::<u8>() & 0x40;
                match random.random_range(0..if style < 7 { 2000 } else { 30 }) {
                    0 => word[0] |= 0x08,
                    1 => word[0] |= 0x28,
                    2 => word[random.random_range(0..5)] ^= 0x80,
                    3 => bytes.truncate(bytes.len() - bytes.len().min(random.random_range(1..7))),
                    4 => bytes.extend((0..random.random_range(1..7)).map(|_| random.random::<u8>())),
                    _ => {}
                }
                bytes.extend(word);
            }
        }
        bytes
    }

    /// Decodes in pieces of at most `longest` bytes; arrivals are given where `heard` is.
    fn pieces(mut decoder: Decoder, bytes: &[u8], longest: usize, heard: bool, seed: u64) -> (Events, Counts) {
        let mut random = StdRng::seed_from_u64(seed);
        let mut events = Events::empty(decoder.array().clone());
        let (mut rest, mut now) = (bytes, 0);
        while !rest.is_empty() {
            let (piece, after) = rest.split_at(random.random_range(0..=longest.min(rest.len())));
            decoder.push_into(piece, heard.then_some(now), &mut events);
            now += if random.random_bool(0.02) { random.random_range(0..20_000_000) } else { 0 };
            rest = after;
        }
        decoder.finish_into(&mut events);
        events.view().check().unwrap();
        (events, *decoder.counts())
    }

    #[test]
    fn every_set_of_instructions_decodes_alike() {
        let mut random = StdRng::seed_from_u64(11);
        let mut seen = (0, 0);
        for round in rounds(250) {
            let side = *[8, 40, 63, 64, 200].choose(&mut random).unwrap();
            let decoder = Decoder::new(Array::new(side, 64, 1.0, "array").unwrap());
            let bytes = stream(&mut random, 3000);
            let (longest, heard) = (*[7, 300, 1400, 100_000].choose(&mut random).unwrap(), random.random());
            let with = |set| pieces(decoder.clone().instructions(set).unwrap(), &bytes, longest, heard, round);
            let (events, counts) = with(Instructions::Plain);
            seen.0 += counts.changes;
            seen.1 += counts.intensities;
            for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
                let (other, others) = with(set);
                assert!(other == events, "{set:?}, round {round}: other events");
                assert_eq!(others, counts, "{set:?}, round {round}");
            }
        }
        assert!(seen.0 > 300_000 && seen.1 > 60_000, "streams that say little: {seen:?}");
    }

    #[test]
    #[cfg_attr(miri, ignore = "takes Miri days")]
    fn long_stretches_into_aligned_columns_decode_alike() {
        let mut random = StdRng::seed_from_u64(18);
        let (mut bytes, mut stamp) = (vec![], 0_u16);
        while bytes.len() < 6 << 20 {
            stamp = stamp.wrapping_add(u16::from(random.random_bool(0.01)));
            let (x, y) = (random.random_range(0..64), random.random_range(0..64));
            bytes.extend(Word::Change { stamp, x, y, p: random.random() }.to_bytes());
            match random.random_range(0..4000) {
                0 => bytes.extend(Word::Intensity { ticks: random.random(), x, y, p: true }.to_bytes()),
                1 => bytes.extend(Word::Marker { stamp, start: true }.to_bytes()),
                2 => bytes.push(random.random()),
                _ => {}
            }
        }
        let rows = bytes.len() / WORD_BYTES + 100;
        /// A column that begins `shift` rows behind a line's edge.
        fn behind_edge<T>(column: &mut [T], shift: usize) -> &mut [T] {
            let edge = column.as_ptr().align_offset(64);
            let end = column.len() - 64 + edge;
            &mut column[edge + shift..end]
        }
        let fill = |set, shift: usize| {
            let (mut t, mut x, mut y, mut ticks) = (vec![0; rows], vec![0; rows], vec![0; rows], vec![0; rows]);
            let (mut p, mut present) = (vec![0; rows], vec![0; rows]);
            let (t, p, present) =
                (behind_edge(&mut t, shift), behind_edge(&mut p, shift), behind_edge(&mut present, shift));
            let [x, y, ticks] = [&mut x, &mut y, &mut ticks].map(|column| behind_edge(column, shift));
            let room = Room::new(t, [x, y, ticks], [p, present]).unwrap();
            let mut decoder = Decoder::new(Array::thesis()).instructions(set).unwrap();
            let (filled, markers) = decoder.fill(&bytes, None, room, true, Stop::never()).unwrap();
            let n = filled.rows;
            let columns = (t[..n].to_vec(), [x, y, ticks].map(|column| column[..n].to_vec()));
            (columns, [p, present].map(|column| column[..n].to_vec()), markers, *decoder.counts())
        };
        let plain = fill(Instructions::Plain, 0);
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            for shift in [0, 1, 7] {
                assert!(fill(set, shift) == plain, "{set:?}, {shift} rows behind a line's edge");
            }
        }
    }

    #[test]
    fn overtaken_datagrams_decode_as_byte_by_byte() {
        let mut random = StdRng::seed_from_u64(17);
        let mut back = 0;
        for round in rounds(60) {
            let mut datagrams: Vec<Vec<u8>> = Vec::new();
            let mut stamp: u16 = random.random();
            for _ in 0..40 {
                let mut datagram = Vec::new();
                for _ in 0..random.random_range(0..300) {
                    stamp = stamp.wrapping_add(u16::from(random.random_bool(0.05)));
                    let (x, y) = (random.random_range(0..65), random.random_range(0..64));
                    datagram.extend(Word::Change { stamp, x, y, p: random.random() }.to_bytes());
                    if random.random_bool(0.3) {
                        datagram.extend(Word::Intensity { ticks: random.random(), x, y, p: true }.to_bytes());
                    }
                }
                datagrams.push(datagram);
                stamp = stamp.wrapping_add(random.random_range(0..400));
            }
            for _ in 0..10 {
                let k = random.random_range(1..datagrams.len());
                datagrams.swap(k - 1, k);
            }
            let decode = |set, whole: bool| {
                let mut decoder = Decoder::new(Array::thesis()).instructions(set).unwrap();
                let mut events = Events::empty(Array::thesis());
                for (k, datagram) in datagrams.iter().enumerate() {
                    let arrived = Some(20_000 * k as i64);
                    for piece in datagram.chunks(if whole { usize::MAX } else { 1 }) {
                        decoder.push_into(piece, arrived, &mut events);
                    }
                    decoder.end_of_datagram_into(&mut events);
                }
                (events, *decoder.counts())
            };
            let slow = decode(Instructions::Plain, false);
            back += slow.1.back;
            for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
                assert!(decode(set, true) == slow, "{set:?}, round {round}");
            }
        }
        assert!(back > 20_000, "streams that say little: {back} back");
    }

    #[test]
    fn a_cut_changes_nothing() {
        let mut random = StdRng::seed_from_u64(12);
        for round in rounds(100) {
            let bytes = stream(&mut random, 500);
            for pairing in [Pairing::Direct, Pairing::Taxel] {
                for differences in [false, true] {
                    let decoder = Decoder::new(Array::thesis()).pairing(pairing).differences(differences);
                    let whole = pieces(decoder.clone(), &bytes, bytes.len(), false, round);
                    assert!(pieces(decoder, &bytes, 40, false, round) == whole, "round {round}, {pairing:?}");
                }
            }
        }
    }

    #[test]
    fn columns_filled_again_hold_the_same() {
        let mut random = StdRng::seed_from_u64(13);
        let mut columns = Events::empty(Array::thesis());
        for _ in rounds(20) {
            let bytes = stream(&mut random, 300);
            let fresh = Decoder::new(Array::thesis()).push(&bytes, None);
            columns.clear();
            Decoder::new(Array::thesis()).push_into(&bytes, None, &mut columns);
            assert_eq!((&columns.t, &columns.x, &columns.y), (&fresh.t, &fresh.x, &fresh.y));
            assert_eq!((&columns.p, intensities(&columns)), (&fresh.p, intensities(&fresh)));
        }
    }

    /// 10^9 random bytes; minutes without optimisation, seconds with.
    #[test]
    #[ignore = "long; run by make slow"]
    fn a_thousand_million_random_bytes_neither_panic_nor_grow() {
        let mut random = StdRng::seed_from_u64(14);
        let mut decoders = Instructions::ALL.map(|set| {
            let decoder = Decoder::new(Array::new(50, 60, 1.0, "array").unwrap());
            if set.present() { decoder.instructions(set).unwrap() } else { decoder }
        });
        let mut columns = Events::empty(decoders[0].array().clone());
        let mut bytes = vec![0; 1_000_000];
        let mut memory = 0;
        for round in 0..1000 {
            random.fill(&mut bytes[..]);
            if round % 2 == 1 {
                // Bytes that are nearly words reach further into the decoder.
                for (k, byte) in bytes.iter_mut().enumerate() {
                    *byte = if k % 5 == 0 { *byte | 0x80 } else { *byte & 0x7f } ^ (u8::from(k % 977 == 0) << 7);
                }
            }
            for decoder in &mut decoders {
                columns.clear();
                decoder.push_into(&bytes, (round % 3 == 0).then_some(round), &mut columns);
            }
            if round == 10 {
                memory = columns.t.capacity();
            }
        }
        assert_eq!(columns.t.capacity(), memory, "columns grew");
        let counts = decoders.map(|mut d| {
            d.finish();
            *d.counts()
        });
        assert!(counts.iter().all(|c| c == &counts[0]));
        assert_eq!(counts[0].bytes, 1_000_000_000);
        assert_eq!(counts[0].bytes, 5 * counts[0].words + counts[0].skipped);
    }
}

//! Decodes one sender's datagrams to events, whichever version of the wire it sends.

mod clock_jumps;
mod order;
mod recent;
mod totals;

use crate::wire::decoder::{Counts, Decoder, TURN};
use crate::wire::silence;
use crate::wire::v1::{FIRST, STAMP_US, WORD_BYTES};
use crate::wire::v2::{self, DatagramHeader, DatagramOutcome};
use crate::{Array, Events};
use clock_jumps::ClockJumps;
use order::Order;
pub use order::StepBack;
use recent::RecentDatagrams;
pub use totals::SenderTotals;

/// For how long only whole words of version 1 must arrive before a sender of version 2 counts as changed to version 1,
/// us.
const CHANGED_AFTER_US: i64 = 1_000_000;

/// Duration of a turn of the counter of version 1, us.
const TURN_US: i64 = TURN * STAMP_US;

/// What a datagram reports besides its events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DatagramInfo {
    /// The sender's version after this datagram.
    pub version: u8,
    /// Whether this datagram changed the version.
    pub changed: bool,
    /// Whether the board was reset before this datagram.
    pub reset: bool,
    /// No later datagram has an event before this time, us (version 2).
    pub until: Option<i64>,
    /// Missing sequence numbers so far (version 2).
    pub missing: u64,
    /// The latest received time, us.
    pub now: Option<i64>,
}

/// Decodes the datagrams of one sender (address and port).
///
/// A sender uses version 1 until its first intact datagram of version 2. From then on, datagrams of version 1 are
/// refused and counted, until [`Self::expect`] is called, or until only whole words of version 1 have arrived for a
/// second. After a change of version, time continues by the host's clock.
#[derive(Debug, Clone)]
pub struct SenderDecoder {
    array: Array,
    version: u8,
    version_1: Decoder,
    version_2: v2::Decoder,
    /// Added to times of version 1; known once the first event after a change was received.
    offset: Option<i64>,
    /// The latest time, and the host's clock when it was received.
    latest: Option<(i64, Option<i64>)>,
    /// Since when only whole words of version 1 have arrived.
    whole_since: Option<i64>,
    jumps: ClockJumps,
    order: Order,
    recent: RecentDatagrams,
    totals: SenderTotals,
}

impl SenderDecoder {
    /// A decoder of a sender that uses `version` at first; `version_1` decodes what is of version 1, and has the array.
    #[must_use]
    pub fn new(version_1: Decoder, version: u8) -> Self {
        let array = version_1.array().clone();
        let version_2 = v2::Decoder::new(array.clone());
        Self {
            array,
            version,
            version_1,
            version_2,
            offset: Some(0),
            latest: None,
            whole_since: None,
            jumps: ClockJumps::default(),
            order: Order::default(),
            recent: RecentDatagrams::default(),
            totals: SenderTotals::default(),
        }
    }

    /// The version that the sender uses.
    #[must_use]
    pub fn version(&self) -> u8 {
        self.version
    }

    /// Sets each taxel's current value, by index, as [`Decoder::begin_with`] and [`v2::Decoder::begin_with`] do.
    pub fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>> + Clone) {
        self.version_1.begin_with(held.clone());
        self.version_2.begin_with(held);
    }

    /// The decoder of version 2.
    #[must_use]
    pub fn version_2(&self) -> &v2::Decoder {
        &self.version_2
    }

    /// The counts of version 1.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        self.version_1.counts()
    }

    /// The counts that do not belong to the decoder of either version.
    #[must_use]
    pub fn totals(&self) -> &SenderTotals {
        &self.totals
    }

    /// The largest steps back of the times, in the order of arrival.
    #[must_use]
    pub fn steps_back(&self) -> &[StepBack] {
        self.order.steps()
    }

    /// Notes that a recording begins, as [`v2::Decoder::begin_recording`] does.
    pub fn begin_recording(&mut self) {
        self.version_2.begin_recording();
    }

    /// What a decoder that begins with the latest datagram lacks to this one's times, us; `None` if the datagram does not
    /// show it. `first` is the first time in the datagram, us.
    #[must_use]
    pub fn origin(&self, first: Option<i64>) -> Option<i64> {
        if self.version == 2 {
            return self.version_2.offset();
        }
        first.map(|first| first - (first - self.offset.unwrap_or(0)).rem_euclid(TURN_US))
    }

    /// Notes that the host has set the board to this version of the wire.
    pub fn expect(&mut self, version: u8, out: &mut Events) {
        if version != self.version {
            self.change(version, out);
        }
    }

    /// Decodes a datagram; appends its events.
    pub fn push(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Events) -> DatagramInfo {
        let (before, rows) = (self.version, out.len());
        let mut info = DatagramInfo::default();
        // An empty datagram is a short one of version 2, and no words of version 1.
        let second = match datagram.first() {
            None => self.version == 2,
            Some(&first) => first == v2::MAGIC && (self.version == 2 || DatagramHeader::read(datagram).is_ok()),
        };
        if second {
            if self.version == 1 {
                self.change(2, out);
            }
            if let DatagramOutcome::Intact { until, missing, reset } = self.version_2.push(datagram, arrived, out) {
                self.whole_since = None;
                (info.until, info.missing, info.reset) = (until, missing, reset);
            }
        } else if self.version == 2 && !self.has_changed_back(datagram, arrived) {
            self.totals.refused += datagram.len() as u64;
        } else {
            if self.version == 2 {
                self.change(1, out);
            }
            self.totals.empty += u64::from(datagram.is_empty());
            let repeated = self.recent.repeats(datagram, arrived, &self.array, self.version_1.has_values());
            self.totals.repeated += u64::from(repeated);
            let rows = out.len();
            let markers = out.markers.len();
            let before = self.version_1.times();
            self.version_1.push(datagram, arrived, out);
            self.version_1.end_of_datagram(out);
            self.carry(rows, markers, arrived, out);
            if let (Some((_, last)), Some(arrived)) = (self.version_1.times(), arrived) {
                let offset = self.offset.unwrap_or(0);
                let (newest, first) = (before.map(|(newest, _)| newest + offset), out.t.get(rows).copied());
                let first = first.unwrap_or(last + offset);
                if let Some(before) = self.jumps.note(newest, first, last + offset, arrived) {
                    self.totals.jumps += 1;
                    self.totals.doubtful_after.get_or_insert(before);
                }
            }
        }
        self.order.note(&out.t[rows..], second, &mut self.totals);
        if let Some(&t) = out.t[rows..].last() {
            let latest = self.latest.map_or(t, |(latest, _)| latest.max(t));
            self.latest = Some((latest, arrived));
        }
        info.now = if self.version == 2 { Some(self.version_2.latest()) } else { self.latest.map(|(t, _)| t) };
        info.version = self.version;
        info.changed = self.version != before;
        info
    }

    /// Ends the stream: appends the events that still waited.
    pub fn finish_into(&mut self, out: &mut Events) {
        let (rows, markers) = (out.len(), out.markers.len());
        self.version_1.finish(out);
        self.carry(rows, markers, None, out);
        self.order.note(&out.t[rows..], false, &mut self.totals);
    }

    /// Whether only whole words of version 1 have arrived for long enough.
    fn has_changed_back(&mut self, datagram: &[u8], arrived: Option<i64>) -> bool {
        let is_complete = !datagram.is_empty()
            && datagram.len().is_multiple_of(WORD_BYTES)
            && datagram.iter().enumerate().all(|(k, byte)| (byte & FIRST != 0) == k.is_multiple_of(WORD_BYTES));
        let (true, Some(now)) = (is_complete, arrived) else {
            self.whole_since = None;
            return false;
        };
        let since = *self.whole_since.get_or_insert(now);
        silence(since, now) >= CHANGED_AFTER_US
    }

    fn change(&mut self, version: u8, out: &mut Events) {
        self.version_1.end_of_datagram(out);
        (self.version, self.whole_since) = (version, None);
        self.totals.changes += 1;
        if version == 1 {
            self.offset = None;
        } else if let Some((latest, then)) = self.latest {
            self.version_2.go_on_from(latest, then);
        }
    }

    /// Shifts times of version 1 so that they follow what was received before the change.
    fn carry(&mut self, rows: usize, markers: usize, arrived: Option<i64>, out: &mut Events) {
        let first = out.t.get(rows).copied().or_else(|| out.markers.get(markers).map(|m| m.t));
        let Some(first) = first else { return };
        let offset = *self.offset.get_or_insert_with(|| match self.latest {
            Some((latest, then)) => {
                let passed = arrived.zip(then).map_or(0, |(now, then)| silence(then, now));
                latest + passed - first
            }
            None => 0,
        });
        if offset != 0 {
            out.t[rows..].iter_mut().for_each(|t| *t += offset);
            out.markers[markers..].iter_mut().for_each(|m| m.t += offset);
        }
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::Board;
    use crate::wire::{Command, Registers};

    fn play(board: &mut Board, frames: u16, mut each: impl FnMut(&[u8])) {
        for _ in 0..frames {
            let ticks = vec![20 + 10 * (board.counts().frames % 2) as u16; 4096];
            board
                .frame(&ticks, |datagram| {
                    each(datagram);
                    true
                })
                .unwrap();
        }
    }

    fn set_version(board: &mut Board, version: u8) {
        let registers = Registers { wire_version: version, ..*board.registers() };
        board.command(&Command { register: 0, value: registers.word(0) }.to_bytes());
    }

    #[test]
    fn arrivals_out_of_all_reason_carry_no_clock_away() {
        let mut decoder = SenderDecoder::new(Decoder::new(Array::thesis()), 2);
        let mut events = Events::empty(Array::thesis());
        let mut before = 0;
        for (session, arrived) in [0, i64::MAX, i64::MIN, i64::MAX, 0, i64::MAX].into_iter().enumerate() {
            // Only a promise, from a board that was reset each time.
            let header = DatagramHeader {
                kind: 0,
                board: 1,
                sequence: 0,
                base: 0,
                session: session as u16,
                stride: v2::stride(64),
                line: 0,
                flags: 0,
                span: 1,
            };
            let until = decoder.push(&header.datagram(&[]), Some(arrived), &mut events).until.unwrap();
            assert!((before..=before + 400 * 86_400_000_000).contains(&until), "{until} us after {before} us");
            before = until;
        }
    }

    #[test]
    fn a_sender_that_changes_its_version_is_heard_and_time_goes_on() {
        let array = Array::thesis();
        let mut board = Board::new(Registers::default(), &array).unwrap();
        let mut decoder = SenderDecoder::new(Decoder::new(array.clone()), 1);
        let mut events = Events::empty(array);
        let (mut now, mut changes) = (5_000_000, vec![]);
        for version in [1, 2, 1] {
            set_version(&mut board, version);
            for _ in 0..6000 {
                play(&mut board, 1, |datagram| {
                    let info = decoder.push(datagram, Some(now), &mut events);
                    if info.changed {
                        changes.push((info.version, now));
                    }
                });
                now += 192;
                // Keeps the test's memory small; the last event is kept because it shows the current time.
                if events.len() > 20_000 {
                    let last = events.len() - 1;
                    for column in [&mut events.x, &mut events.y] {
                        column.drain(..last);
                    }
                    events.t.drain(..last);
                    events.p.drain(..last);
                    events.intensity = None;
                    events.repaired = None;
                }
            }
        }
        assert_eq!(changes.iter().map(|c| c.0).collect::<Vec<_>>(), [2, 1]);
        let begun = 5_000_000 + 12_000 * 192;
        assert!((1_000_000..1_001_000).contains(&(changes[1].1 - begun)), "a second later: {}", changes[1].1 - begun);
        assert!(decoder.totals().refused > 0);
        let (t, expected) = (*events.t.last().unwrap(), 18_000 * 192);
        assert!((t - expected).abs() < 2000, "{t} for {expected}");
    }

    #[test]
    fn what_the_host_asked_for_is_believed_at_once() {
        let array = Array::thesis();
        let mut board = Board::new(Registers { wire_version: 2, ..Registers::default() }, &array).unwrap();
        let mut decoder = SenderDecoder::new(Decoder::new(array.clone()), 1);
        let mut events = Events::empty(array);
        play(&mut board, 3, |datagram| {
            decoder.push(datagram, Some(0), &mut events);
        });
        assert_eq!((decoder.version(), decoder.totals().changes), (2, 1));
        set_version(&mut board, 1);
        decoder.expect(1, &mut events);
        let before = events.len();
        play(&mut board, 2, |datagram| {
            decoder.push(datagram, Some(400), &mut events);
        });
        assert_eq!((decoder.version(), decoder.totals().refused), (1, 0));
        assert_eq!(events.len(), before + 2 * 4096);
    }

    #[test]
    fn a_damaged_datagram_changes_no_version() {
        let array = Array::thesis();
        let mut decoder = SenderDecoder::new(Decoder::new(array.clone()), 1);
        let mut events = Events::empty(array);
        let mut damaged = vec![v2::MAGIC, 0x21];
        damaged.resize(40, 7);
        decoder.push(&damaged, Some(0), &mut events);
        assert_eq!((decoder.version(), decoder.counts().skipped), (1, 40));
    }
}

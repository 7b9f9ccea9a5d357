//! Datagrams of version 2 to events: each intact one exactly once, whatever was lost, repeated, reordered or damaged.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::{DIFFERENCES, DROPPED, FRAME_SYNC, Header, Kind, Layout, Refused, START, STOP};
use crate::{Array, Events, Intensities, Marker};

/// How far behind the highest sequence number a datagram may come and still be told from a repeated one.
const WINDOW: usize = 65_536;

/// Sessions that are remembered, for datagrams that come behind a reset.
const SESSIONS: usize = 4;

/// The board's own totals since reset, as its status datagrams say them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Status {
    /// Frames scanned.
    pub frames: u64,
    /// Events put into datagrams.
    pub events: u64,
    /// Events dropped, because the queue was full.
    pub dropped: u64,
    /// Datagrams made before this one.
    pub datagrams: u64,
    /// Conversions whose comparator had not returned.
    pub faults: u64,
}

/// What a decoder heard, and all that it missed, by cause.
///
/// `datagrams = intact + repeated + old + refused by cause`; of each session `missing` numbers lie between the first and the last
/// intact one and never came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Datagrams given to the decoder.
    pub datagrams: u64,
    /// Those that were decoded.
    pub intact: u64,
    /// Came again, and were not decoded again.
    pub repeated: u64,
    /// Came more than 65 536 numbers late, so that nobody can tell whether they had come before; not decoded.
    pub old: u64,
    /// Refused: too short.
    pub short: u64,
    /// Refused: not of version 2, or of another board.
    pub foreign: u64,
    /// Refused: the checksum disagrees.
    pub checksum: u64,
    /// Sequence numbers that never came intact, between the first and the last of each session.
    pub missing: u64,
    /// Of a kind that is not known; skipped.
    pub unknown_kind: u64,
    /// With flags that are not known; decoded.
    pub unknown_flags: u64,
    /// Bodies that end within a word; what was whole is decoded.
    pub malformed: u64,
    /// Events on the array.
    pub events: u64,
    /// Of these, those that a state gave, because its value differed from the held one.
    pub repaired: u64,
    /// States on the array.
    pub states: u64,
    /// Events and states outside the array.
    pub outside: u64,
    /// Starts and stops.
    pub markers: u64,
    /// Times that the board said it had dropped events.
    pub dropped: u64,
    /// Resets that were noticed.
    pub resets: u64,
}

/// What one datagram was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heard {
    /// Decoded.
    Intact {
        /// Nothing before this comes with a higher number, us; none where nothing is promised.
        until: Option<i64>,
        /// Numbers between the first and this one that have not come.
        missing: u64,
        /// Whether the board was reset before it.
        reset: bool,
    },
    /// It had come before, or is too old to tell.
    Repeated,
    /// No datagram of this board.
    Refused(Refused),
}

#[derive(Debug, Clone)]
struct Session {
    number: u16,
    lowest: i64,
    highest: i64,
    received: u64,
    /// By number modulo the window: whether it came.
    seen: Vec<u64>,
    /// What is added to the board's times.
    offset: i64,
    /// The latest base time.
    latest: u64,
}

impl Session {
    fn new(header: &Header, offset: i64) -> Self {
        let first = i64::from(header.sequence);
        Self {
            number: header.session,
            lowest: first,
            highest: first,
            received: 0,
            seen: vec![0; WINDOW / 64],
            offset,
            latest: header.base,
        }
    }

    fn number_of(&self, sequence: u32) -> i64 {
        self.highest + i64::from(sequence.wrapping_sub(self.highest as u32) as i32)
    }

    fn missing(&self) -> u64 {
        (self.highest - self.lowest + 1) as u64 - self.received
    }

    /// Notes a number; none where it is too old, else whether it is new.
    fn note(&mut self, number: i64) -> Option<bool> {
        if number <= self.highest - WINDOW as i64 {
            return None;
        }
        if number > self.highest {
            let ahead = (number - self.highest).min(WINDOW as i64);
            for k in number - ahead + 1..=number {
                self.clear(k);
            }
            self.highest = number;
        }
        self.lowest = self.lowest.min(number);
        let (word, bit) = place(number);
        let new = self.seen[word] & bit == 0;
        self.seen[word] |= bit;
        self.received += u64::from(new);
        Some(new)
    }

    fn clear(&mut self, number: i64) {
        let (word, bit) = place(number);
        self.seen[word] &= !bit;
    }
}

fn place(number: i64) -> (usize, u64) {
    let at = number.rem_euclid(WINDOW as i64) as usize;
    (at / 64, 1 << (at % 64))
}

/// Turns one board's datagrams into events, in the order in which they come.
///
/// It keeps what each taxel holds, so that differences are added up and a state that says something else becomes an event,
/// marked as repaired. Memory is bounded, whatever comes.
#[derive(Debug, Clone)]
pub struct Decoder {
    array: Array,
    board: Option<u16>,
    sessions: VecDeque<Session>,
    /// Missing numbers of sessions that are remembered no more.
    missed_before: u64,
    /// When, by the host's clock, and what time, us, was heard last.
    heard: Option<(i64, i64)>,
    latest: i64,
    /// Whether there was time before the first session.
    goes_on: bool,
    held: Vec<Option<u16>>,
    held_at: Vec<i64>,
    status: Option<Status>,
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array; it belongs to the first board that it hears.
    #[must_use]
    pub fn new(array: Array) -> Self {
        let taxels = array.len();
        Self {
            array,
            board: None,
            sessions: VecDeque::new(),
            missed_before: 0,
            heard: None,
            latest: 0,
            goes_on: false,
            held: vec![None; taxels],
            held_at: vec![i64::MIN; taxels],
            status: None,
            counts: Counts::default(),
        }
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }

    /// What was heard and missed so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let missing = self.missed_before + self.sessions.iter().map(Session::missing).sum::<u64>();
        Counts { missing, ..self.counts }
    }

    /// What the board last said of itself.
    #[must_use]
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// Says that the board was heard before by other means: at `latest` us, by the host's clock at `heard`.
    pub(crate) fn go_on_from(&mut self, latest: i64, heard: Option<i64>) {
        self.latest = self.latest.max(latest);
        self.heard = heard.map(|now| (now, latest));
        self.goes_on = true;
    }

    /// The latest time that was heard or promised, us.
    pub(crate) fn latest(&self) -> i64 {
        self.latest
    }

    /// What each taxel holds as far as was heard, by index.
    #[must_use]
    pub fn held(&self) -> &[Option<u16>] {
        &self.held
    }

    /// Takes a datagram; appends its events.
    ///
    /// `arrived` is the host's clock in us. After a reset it says how much time has passed, else time goes on from the latest
    /// that was heard.
    pub fn push(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Events) -> Heard {
        self.counts.datagrams += 1;
        let (header, body) = match Header::read(datagram) {
            Ok(read) => read,
            Err(refused) => {
                *match refused {
                    Refused::Short => &mut self.counts.short,
                    Refused::Foreign => &mut self.counts.foreign,
                    Refused::Checksum => &mut self.counts.checksum,
                } += 1;
                return Heard::Refused(refused);
            }
        };
        if *self.board.get_or_insert(header.board) != header.board {
            self.counts.foreign += 1;
            return Heard::Refused(Refused::Foreign);
        }
        let (which, reset) = self.session(&header, arrived);
        let session = &mut self.sessions[which];
        match session.note(session.number_of(header.sequence)) {
            None => {
                self.counts.old += 1;
                return Heard::Repeated;
            }
            Some(false) => {
                self.counts.repeated += 1;
                return Heard::Repeated;
            }
            Some(true) => {}
        }
        session.latest = session.latest.max(header.base);
        let (base, missing) = (session.offset + header.base as i64, session.missing());
        self.counts.intact += 1;
        self.counts.dropped += u64::from(header.flags & DROPPED != 0);
        self.counts.unknown_flags += u64::from(header.flags & !(FRAME_SYNC | DIFFERENCES | DROPPED) != 0);
        self.latest = self.latest.max(base);
        self.body(&header, body, base, out);
        self.heard = arrived.map(|now| (now, self.latest)).or(self.heard);
        let until = (header.span > 0).then(|| base + i64::from(header.span));
        self.latest = self.latest.max(until.unwrap_or(i64::MIN));
        Heard::Intact { until, missing, reset }
    }

    /// Which session a datagram belongs to, and whether it begins one.
    fn session(&mut self, header: &Header, arrived: Option<i64>) -> (usize, bool) {
        // The latest of a number, should two have drawn it.
        if let Some(which) = self.sessions.iter().rposition(|session| session.number == header.session) {
            let session = &self.sessions[which];
            // The same number drawn twice: everything begins at 0 again.
            let again = session.number_of(header.sequence) <= session.highest - WINDOW as i64
                && header.sequence < 1024
                && header.base < session.latest;
            if !again {
                return (which, false);
            }
        }
        let began = self.sessions.is_empty();
        let offset = if began && !self.goes_on {
            0
        } else {
            let passed = match (arrived, self.heard) {
                (Some(now), Some((before, time))) => time + now.saturating_sub(before).max(0) - self.latest,
                _ => 0,
            };
            self.latest + passed.max(0) - header.base as i64
        };
        if !began {
            self.counts.resets += 1;
            // After its reset the board compares with 0, and tells every taxel that differs from it.
            self.held.fill(None);
            self.held_at.fill(i64::MIN);
        }
        if self.sessions.len() == SESSIONS
            && let Some(gone) = self.sessions.pop_front()
        {
            self.missed_before += gone.missing();
        }
        self.sessions.push_back(Session::new(header, offset));
        (self.sessions.len() - 1, !began)
    }

    fn body(&mut self, header: &Header, body: &[u8], base: i64, out: &mut Events) {
        let Some(kind) = Kind::of(header.kind) else {
            self.counts.unknown_kind += 1;
            return;
        };
        match kind {
            Kind::Changes | Kind::Small | Kind::Large | Kind::SmallStates | Kind::LargeStates => {
                let Some(word) = kind.layout() else { return };
                self.words(header, kind, word, body, base, out);
            }
            Kind::Markers => {
                self.counts.malformed += u64::from(!body.len().is_multiple_of(8));
                for marker in body.chunks_exact(8) {
                    let offset = u32::from_le_bytes([marker[0], marker[1], marker[2], marker[3]]);
                    let code = u16::from_le_bytes([marker[4], marker[5]]);
                    if code == START || code == STOP {
                        self.counts.markers += 1;
                        out.markers.push(Marker { t: base + i64::from(offset), start: code == START });
                    }
                }
            }
            Kind::Status => {
                let mut totals =
                    body.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
                let mut next = || totals.next().unwrap_or_default();
                let (frames, events, dropped, datagrams, faults) = (next(), next(), next(), next(), next());
                self.counts.malformed += u64::from(body.len() < 40);
                self.status = Some(Status { frames, events, dropped, datagrams, faults });
            }
        }
    }

    fn words(&mut self, header: &Header, kind: Kind, word: Layout, body: &[u8], base: i64, out: &mut Events) {
        let valued = word.value > 0;
        let states = matches!(kind, Kind::SmallStates | Kind::LargeStates);
        let differences = header.flags & DIFFERENCES != 0 && !states;
        let mask = (1_i64 << header.stride.min(31)) - 1;
        let (step, _) = word.advance();
        let (mut position, mut t) = (-1_i64, base);
        let mut words = body.chunks_exact(word.bytes).map(|bytes| match *bytes {
            [a, b] => u32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => 0,
        });
        let before = out.len();
        if valued {
            let column = out.intensity.get_or_insert_with(Intensities::default);
            column.ticks.resize(before, 0);
            column.present.resize(before, false);
        }
        let mut cut = !body.len().is_multiple_of(word.bytes);
        while let Some(bits) = words.next() {
            let p = bits >> (word.skip + word.value) & 1 == 1;
            let skip = bits >> word.value & word.control();
            let value = bits & ((1 << word.value) - 1);
            if skip == word.control() {
                if p {
                    let Some(offset) = words.next() else {
                        cut = true;
                        break;
                    };
                    (t, position) = (base + i64::from(offset), -1);
                } else {
                    position += i64::from(value + 1) * step;
                }
                continue;
            }
            position += i64::from(skip) + 1;
            let (x, y) = (position >> header.stride.min(31), position & mask);
            if x >= i64::from(self.array.columns) || y >= i64::from(self.array.rows) {
                self.counts.outside += 1;
                continue;
            }
            let (x, y) = (x as u16, y as u16);
            let taxel = self.array.index(x, y);
            let value = value as u16;
            let held = self.held[taxel];
            let newest = t >= self.held_at[taxel];
            let (p, told) = if states {
                self.counts.states += 1;
                if !newest || held == Some(value) {
                    continue;
                }
                self.counts.repaired += 1;
                (value >= held.unwrap_or_default(), value)
            } else if differences {
                let from = held.unwrap_or_default();
                (p, if p { from.saturating_add(value) } else { from.saturating_sub(value) })
            } else {
                (p, value)
            };
            if valued && (newest || differences) {
                self.held[taxel] = Some(told);
                self.held_at[taxel] = self.held_at[taxel].max(t);
            }
            self.counts.events += 1;
            self.latest = self.latest.max(t);
            out.t.push(t);
            out.x.push(x);
            out.y.push(y);
            out.p.push(p);
            if let Some(column) = &mut out.intensity {
                column.ticks.push(if valued { told } else { 0 });
                column.present.push(valued);
            }
        }
        out.mark_repaired(before, states);
        self.counts.malformed += u64::from(cut);
    }
}

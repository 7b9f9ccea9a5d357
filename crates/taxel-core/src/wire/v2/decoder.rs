//! Datagrams of version 2 to events: each intact one exactly once, whatever was lost, repeated, reordered or damaged.

mod held;
#[cfg(target_arch = "x86_64")]
mod run;
mod session;
mod taken;
mod words;

use super::counts::{Counts, Status};
use super::{DIFFERENCES, DROPPED, FRAME_SYNC, Header, Kind, Refused, START, STOP};
use crate::vectors::Instructions;
use crate::wire::columns::{Columns, Laid, Room, Table};
use crate::wire::silence::silence;
use crate::{Array, Events, Marker, Result, problem};
use held::Held;
#[cfg(target_arch = "x86_64")]
use run::Run;
use session::{Session, WINDOW};
use taken::Taken;
pub use words::stream_rows;
use words::{Body, Meaning};

/// Sessions that are remembered, for datagrams that come behind a reset.
const SESSIONS: usize = 4;

/// Five totals of 64 bits.
const STATUS_BYTES: usize = 40;

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

/// Turns one board's datagrams into events, in the order in which they come.
///
/// It keeps what each taxel holds, so that differences are added up and a state that says something else becomes an event,
/// marked as repaired. A difference from what was not heard gives an event without a value. Memory is bounded, whatever comes.
#[derive(Debug, Clone)]
pub struct Decoder {
    array: Array,
    instructions: Instructions,
    board: Option<u16>,
    sessions: Vec<Session>,
    /// Missing numbers of sessions that are remembered no more.
    missed_before: u64,
    /// When, by the host's clock, and what time, us, was heard last.
    heard: Option<(i64, i64)>,
    latest: i64,
    /// Whether there was time before the first session.
    goes_on: bool,
    held: Held,
    status: Option<Status>,
    /// The number of the datagram that told it, in the latest session.
    told: i64,
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array; it belongs to the first board that it hears.
    #[must_use]
    pub fn new(array: Array) -> Self {
        let held = Held::new(&array);
        Self {
            array,
            instructions: Instructions::best(),
            board: None,
            sessions: vec![],
            missed_before: 0,
            heard: None,
            latest: 0,
            goes_on: false,
            held,
            status: None,
            told: i64::MIN,
            counts: Counts::default(),
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

    /// Says what the taxels hold, by index, none where that is not known: differences add up from there, and a state that says the
    /// same is no event. It holds until the board's next reset.
    pub fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        self.held.begin_with(held);
    }

    /// What each taxel holds as far as was heard, by index.
    #[must_use]
    pub fn held(&self) -> Vec<Option<u16>> {
        self.held.by_index()
    }

    /// Takes a datagram; appends its events.
    ///
    /// `arrived` is the host's clock in us. After a reset it says how much time has passed, else time goes on from the latest
    /// that was heard.
    #[inline]
    pub fn push(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Events) -> Heard {
        self.push_table(datagram, arrived, out)
    }

    /// As [`Self::push`], into columns that the caller laid out, from their first row on.
    ///
    /// # Errors
    ///
    /// `Problem` where a column has fewer entries than [`stream_rows`] asks for, and nothing was read.
    pub fn fill(&mut self, datagram: &[u8], arrived: Option<i64>, room: Room<'_>) -> Result<(Columns, Heard)> {
        let mut laid = Laid::new(check_room(room, datagram.len())?);
        let heard = self.push_table(datagram, arrived, &mut laid);
        Ok((laid.end(), heard))
    }

    #[inline]
    fn push_table(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut impl Table) -> Heard {
        let latest = self.latest;
        let taken = self.plain(std::iter::once(datagram), stream_rows(datagram.len()), out);
        match self.sessions.last() {
            Some(session) if taken.datagrams > 0 => {
                let Taken { base, span, .. } = taken;
                self.heard = arrived.map(|now| (now, latest.max(base))).or(self.heard);
                let until = (span > 0).then(|| base + i64::from(span));
                Heard::Intact { until, missing: session.missing(), reset: false }
            }
            _ => self.push_any(datagram, arrived, out),
        }
    }

    fn push_any(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut impl Table) -> Heard {
        match Header::read(datagram) {
            Ok((header, body)) => self.push_read(&header, body, arrived, out),
            Err(refused) => {
                self.counts.datagrams += 1;
                *match refused {
                    Refused::Short => &mut self.counts.short,
                    Refused::Long => &mut self.counts.long,
                    Refused::Foreign => &mut self.counts.foreign,
                    Refused::Checksum => &mut self.counts.checksum,
                } += 1;
                Heard::Refused(refused)
            }
        }
    }

    /// As [`Self::push`], of a datagram that was read and found intact.
    pub(in crate::wire) fn push_read(
        &mut self,
        header: &Header,
        body: &[u8],
        arrived: Option<i64>,
        out: &mut impl Table,
    ) -> Heard {
        self.counts.datagrams += 1;
        if *self.board.get_or_insert(header.board) != header.board {
            self.counts.foreign += 1;
            return Heard::Refused(Refused::Foreign);
        }
        let (which, reset) = match self.sessions.last() {
            // As nearly all come.
            Some(last) if last.is_next(header) => (self.sessions.len() - 1, false),
            _ => self.session(header, arrived),
        };
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
        let number = session.number_of(header.sequence);
        if which + 1 == self.sessions.len() {
            self.body(header, body, base, Some(number), out);
        } else {
            // A straggler of before a reset says nothing of what the taxels hold since.
            let blank = self.held.blank();
            let since = std::mem::replace(&mut self.held, blank);
            self.body(header, body, base, None, out);
            self.held = since;
        }
        if let Some(now) = arrived {
            self.heard = Some((now, self.latest));
        }
        let until = (header.span > 0).then(|| base + i64::from(header.span));
        self.latest = self.latest.max(until.unwrap_or(i64::MIN));
        Heard::Intact { until, missing, reset }
    }

    /// Takes datagrams as far as they are plain and of a few words, where the machine has the instructions; `out` has room for
    /// `most` rows. As [`Self::push_read`] of each, without arrivals.
    #[inline]
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
    pub(in crate::wire::v2) fn plain<'d>(
        &mut self,
        datagrams: impl Iterator<Item = &'d [u8]> + Clone,
        most: usize,
        out: &mut impl Table,
    ) -> Taken {
        #[cfg(target_arch = "x86_64")]
        if self.instructions == Instructions::Avx512Bytes
            && let (Some(first), Some(board), Some(session)) =
                (datagrams.clone().next(), self.board, self.sessions.last_mut())
            && let Self { held, counts, latest, .. } = self
            && let Some((mut run, value)) = Run::new(first, board, session, held, latest, counts)
            && (value == 0 || out.paired())
        {
            // SAFETY: the machine has this set, as `instructions` and `best` see to. A run writes each row that it counts, and
            // with `paired` its ticks and present.
            unsafe {
                out.rows(most, false, false, |room, row, paired| match value {
                    0 => run.take::<0>(datagrams, room, row, paired),
                    8 => run.take::<8>(datagrams, room, row, paired),
                    _ => run.take::<16>(datagrams, room, row, paired),
                });
            }
            return run.taken;
        }
        Taken::default()
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
                (Some(now), Some((before, time))) => time + silence(before, now) - self.latest,
                _ => 0,
            };
            self.latest + passed.max(0) - header.base as i64
        };
        // After its reset the board compares with 0, and tells every taxel that differs from it. What it said first may not have
        // been heard, and where it spoke version 1 before there may have been no reset.
        let whole = header.sequence == 0 && !(began && self.goes_on);
        if whole || !began {
            self.held.forget(whole.then_some(0));
        }
        self.counts.resets += u64::from(!began);
        self.told = i64::MIN;
        if self.sessions.len() == SESSIONS {
            self.missed_before += self.sessions.remove(0).missing();
        }
        self.sessions.push(Session::new(header, offset));
        (self.sessions.len() - 1, !began)
    }

    /// `number` is the datagram's, where it is of the latest session.
    fn body(&mut self, header: &Header, body: &[u8], base: i64, number: Option<i64>, out: &mut impl Table) {
        let Some(kind) = Kind::of(header.kind) else {
            self.counts.unknown_kind += 1;
            return;
        };
        match kind {
            Kind::Changes | Kind::Small | Kind::Large | Kind::SmallStates | Kind::LargeStates => {
                let Some(word) = kind.layout() else { return };
                let meaning = match kind {
                    Kind::SmallStates | Kind::LargeStates if number.is_none() => Meaning::StaleStates,
                    Kind::SmallStates | Kind::LargeStates => Meaning::States,
                    _ if header.flags & DIFFERENCES != 0 && word.value > 0 => Meaning::Differences,
                    _ => Meaning::Changes,
                };
                self.words(Body::new(word, meaning, header, base, body), out);
            }
            Kind::Markers => {
                self.counts.malformed += u64::from(!body.len().is_multiple_of(8));
                for marker in body.chunks_exact(8) {
                    let offset = u32::from_le_bytes([marker[0], marker[1], marker[2], marker[3]]);
                    let code = u16::from_le_bytes([marker[4], marker[5]]);
                    if code != START && code != STOP {
                        self.counts.unknown_marker += 1;
                        continue;
                    }
                    let t = base + i64::from(offset);
                    self.counts.markers += 1;
                    self.latest = self.latest.max(t);
                    out.mark(Marker { t, start: code == START });
                }
            }
            Kind::Status if body.len() < STATUS_BYTES => self.counts.malformed += 1,
            Kind::Status => {
                let Some(number) = number.filter(|number| *number > self.told) else { return };
                self.told = number;
                let mut totals =
                    body.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
                let mut next = || totals.next().unwrap_or_default();
                let (frames, events, dropped, datagrams, faults) = (next(), next(), next(), next(), next());
                self.status = Some(Status { frames, events, dropped, datagrams, faults });
            }
        }
    }

    fn words(&mut self, mut body: Body<'_>, out: &mut impl Table) {
        let states = matches!(body.meaning, Meaning::States | Meaning::StaleStates);
        let valued = body.layout.value > 0;
        let Self { instructions, held, counts, latest, .. } = self;
        // SAFETY: `words::decode` writes each row that it counts, and with `paired` its ticks and present.
        unsafe {
            out.rows(words::most_rows(body.left()), valued, states, |room, first, paired| {
                body.rows = first;
                words::decode(&mut body, *instructions, held, room, paired, counts);
                *latest = body.latest.max(*latest);
                body.rows - first
            });
        }
    }
}

/// Columns with room for what so many bytes may give.
pub(in crate::wire::v2) fn check_room(room: Room<'_>, bytes: usize) -> Result<Room<'_>> {
    let most = stream_rows(bytes);
    if room.len() < most {
        return Err(problem!("columns have room for {} rows: {bytes} bytes may need {most}", room.len()));
    }
    Ok(room)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::Board;
    use crate::wire::Registers;

    /// A datagram with its checksum.
    fn datagram(kind: Kind, session: u16, sequence: u32, base: u64, body: &[u8]) -> Vec<u8> {
        let (kind, stride) = (kind as u8, crate::wire::v2::stride(64));
        let header = Header { kind, board: 0, sequence, base, session, stride, line: 0, flags: 0, span: 0 };
        let mut bytes = vec![];
        header.write(body, &mut bytes);
        bytes
    }

    #[test]
    fn changes_as_they_are_go_the_short_way_where_the_machine_has_it() {
        let short = usize::from(Instructions::best() == Instructions::Avx512Bytes);
        for (kind, body, flags, taken) in [
            (Kind::Small, vec![], 0, short),
            (Kind::Small, vec![5, 0x80, 7, 0x03], FRAME_SYNC, short),
            // Advances, and more words than eight.
            (Kind::Small, [1, 0x7f, 5, 0x83].repeat(6), 0, short),
            (Kind::Changes, vec![5, 0x80], 0, short),
            (Kind::Large, vec![5, 1, 0, 0x80], 0, short),
            // A time, differences, what the board dropped, states, a part of a word, a place beyond the array, a long one.
            (Kind::Small, vec![0, 0xff, 9, 0, 5, 0x83], 0, 0),
            (Kind::Small, vec![5, 0x80], DIFFERENCES, 0),
            (Kind::Small, vec![5, 0x80], DROPPED, 0),
            (Kind::SmallStates, vec![5, 0x80], 0, 0),
            (Kind::Small, vec![5, 0x80, 7], 0, 0),
            (Kind::Small, vec![63, 0x7f, 0, 0], 0, 0),
            (Kind::Small, [5, 0x80].repeat(30), 0, 0),
        ] {
            let mut decoder = Decoder::new(Array::thesis());
            let mut events = Events::empty(Array::thesis());
            decoder.push(&datagram(Kind::Small, 1, 0, 0, &[9, 0]), None, &mut events);
            let mut bytes = datagram(kind, 1, 1, 192, &body);
            bytes[17] |= flags;
            let sum = bytes.len() - 4;
            let sealed = crc32c::crc32c(&bytes[..sum]).to_le_bytes();
            bytes[sum..].copy_from_slice(&sealed);
            let plain = decoder.plain(std::iter::once(&bytes[..]), stream_rows(bytes.len()), &mut events);
            assert_eq!(plain.datagrams, taken, "{kind:?}, flags {flags}, {body:?}");
        }
    }

    #[test]
    fn the_newest_status_of_the_latest_session_counts() {
        let mut decoder = Decoder::new(Array::thesis());
        let mut events = Events::empty(Array::thesis());
        let totals = |n: u64| [n; 5].map(u64::to_le_bytes).concat();
        for (session, sequence, body, frames) in [
            (1, 5, totals(50), 50),
            (1, 4, totals(40), 50),
            (1, 7, totals(70)[..39].to_vec(), 50),
            (2, 0, totals(1), 1),
            (1, 9, totals(90), 1),
            (2, 1, totals(2), 2),
        ] {
            decoder.push(&datagram(Kind::Status, session, sequence, 1000, &body), None, &mut events);
            assert_eq!(decoder.status().unwrap().frames, frames, "session {session}, number {sequence}");
        }
        assert_eq!((decoder.counts().malformed, decoder.counts().intact), (1, 6));
    }

    #[test]
    fn a_straggler_of_before_a_reset_changes_nothing_that_is_held_since() {
        let array = Array::thesis();
        let registers = Registers { wire_version: 2, ..Registers::default() };
        let mut board = Board::new(registers, &array).unwrap();
        let mut said = |ticks: u16, taxels: usize| {
            let mut out = vec![];
            for level in [0, ticks, ticks + 20] {
                let mut pressed = vec![0; 4096];
                pressed[..taxels].fill(level);
                board
                    .frame(&pressed, |datagram| {
                        out.push(datagram.to_vec());
                        true
                    })
                    .unwrap();
            }
            board.reset().unwrap();
            out
        };
        let (before, since) = (said(50, 4096), said(200, 100));
        let (late, begun) = before.split_last().unwrap();
        let mut decoder = Decoder::new(array.clone());
        let mut events = Events::empty(array);
        for datagram in begun.iter().chain(&since) {
            decoder.push(datagram, None, &mut events);
        }
        let held = decoder.held();
        let heard = events.len();
        assert!(matches!(decoder.push(late, None, &mut events), Heard::Intact { reset: false, .. }));
        assert!(events.len() > heard, "its events are events");
        assert_eq!(decoder.held(), held);
    }
}

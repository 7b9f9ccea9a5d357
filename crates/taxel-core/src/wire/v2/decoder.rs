//! Decodes datagrams of version 2 to events: each intact one exactly once, whatever was lost, repeated, reordered or
//! damaged.

mod body;
mod held;
mod session;
mod words;

use super::counts::{BoardTotals, Counts};
use super::{DIFFERENCES, DROPPED, DatagramHeader, FRAME_SYNC, Refused, checksum};
use crate::events::FARTHEST_BACK_US;
use crate::vectors::Instructions;
use crate::wire::columns::{Block, Columns};
use crate::wire::silence;
use crate::{Array, Events};
use held::ValuesByLine;
use session::{BoardSession, Noted, WINDOW};

/// Number of repeated datagrams in turn, or of ones with other contents, after which a session has begun again.
const IN_TURN: u32 = 32;

/// A board that was reset was silent for at least so long before, us, where the host's clock is known. While a board sends,
/// its heartbeats come more often.
const SILENT_US: i64 = 50_000;

/// Number of sessions that are kept, for datagrams that arrive after a reset.
const SESSIONS: usize = 4;

/// The outcome of decoding one datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatagramOutcome {
    /// Decoded.
    Intact {
        /// No datagram with a higher number has an event before this time, us; none if nothing is promised.
        until: Option<i64>,
        /// Sequence numbers up to this one that have not arrived, from the session's first one on, or after a reset from 0 on.
        missing: u64,
        /// Whether the board was reset before this datagram.
        reset: bool,
    },
    /// Received before with the same contents, or too old to decide.
    Repeated,
    /// Not a datagram of this board.
    Refused(Refused),
}

/// Decodes one board's datagrams to events, in the order in which they arrive.
///
/// The decoder stores each taxel's value, so that differences accumulate and a state with another value becomes an
/// event, marked as repaired. A difference from an unknown value becomes an event without a value. Memory is bounded
/// for any input.
#[derive(Debug, Clone)]
pub struct Decoder {
    array: Array,
    instructions: Instructions,
    board: Option<u16>,
    /// What the last datagram of the latest session has in common with the next one, if it has plain changes.
    common: Option<u64>,
    sessions: Vec<BoardSession>,
    /// Missing sequence numbers of sessions that are no longer kept.
    missed_before: u64,
    /// Missing numbers of these sessions when a recording began, less those when they were dropped.
    filled_before: i64,
    /// The host's clock when the last datagram arrived, and the latest time at that moment, us.
    last_arrival: Option<(i64, i64)>,
    latest: i64,
    /// Whether events were received by other means before the first session.
    goes_on: bool,
    held: ValuesByLine,
    block: Block,
    status: Option<BoardTotals>,
    /// Sequence number of the datagram with the latest status, in the latest session.
    status_number: i64,
    /// Events that the board had dropped in its last totals, 0 at its reset; none if it is not known.
    dropped_before: Option<u64>,
    /// The number after that of the last repeated datagram, and how many were repeated in turn since an intact one.
    again: (i64, u32),
    counts: Counts,
}

impl Decoder {
    /// A decoder for the given array; it is bound to the first board from which it receives a datagram.
    #[must_use]
    pub fn new(array: Array) -> Self {
        let held = ValuesByLine::new(&array);
        Self {
            array,
            instructions: Instructions::best(),
            common: None,
            block: Block::new(),
            board: None,
            sessions: vec![],
            missed_before: 0,
            filled_before: 0,
            last_arrival: None,
            latest: 0,
            goes_on: false,
            held,
            status: None,
            status_number: i64::MIN,
            dropped_before: None,
            again: (0, 0),
            counts: Counts::default(),
        }
    }

    /// Uses other vector instructions than the machine's best, for tests and measurements: the events are the same.
    ///
    /// # Errors
    ///
    /// `Problem` if this machine does not have them.
    pub fn instructions(mut self, instructions: Instructions) -> crate::Result<Self> {
        self.instructions = instructions.checked()?;
        Ok(self)
    }

    /// The sensor.
    #[must_use]
    pub fn array(&self) -> &Array {
        &self.array
    }

    /// What was received and missed so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let missing = self.missed_before + self.sessions.iter().map(BoardSession::missing).sum::<u64>();
        let filled = self.filled_before + self.sessions.iter().map(|session| session.filled).sum::<i64>();
        Counts { missing, filled, ..self.counts }
    }

    /// Notes that a recording begins: what is missing so far is not missing in it, nor found again where it comes late.
    pub fn begin_recording(&mut self) {
        for session in &mut self.sessions {
            // Those that differ and came before it are counted before it.
            (session.from, session.unlike) = (session.highest + 1, 0);
        }
        // What the board dropped since its last totals may have been before.
        self.dropped_before = None;
    }

    /// The totals in the board's last status datagram.
    #[must_use]
    pub fn status(&self) -> Option<&BoardTotals> {
        self.status.as_ref()
    }

    /// Continues after events that were received by other means: the time was `latest` us when the host's clock was
    /// `arrived`.
    pub(crate) fn go_on_from(&mut self, latest: i64, arrived: Option<i64>) {
        self.latest = self.latest.max(latest);
        self.last_arrival = arrived.map(|now| (now, latest));
        self.goes_on = true;
    }

    /// What is added to the times of the latest session, us.
    pub(crate) fn offset(&self) -> Option<i64> {
        self.sessions.last().map(|session| session.offset)
    }

    /// The latest time that was received or promised, us.
    pub(crate) fn latest(&self) -> i64 {
        self.latest
    }

    /// Sets each taxel's value, by index, none if it is unknown: differences accumulate from these values, and a state
    /// with an equal value is no event. The values are valid until the board's next reset.
    pub fn begin_with(&mut self, held: impl IntoIterator<Item = Option<u16>>) {
        self.held.begin_with(held);
    }

    /// Each taxel's value, by index; none if it is unknown.
    #[must_use]
    pub fn held(&self) -> Vec<Option<u16>> {
        self.held.by_index()
    }

    /// Decodes a datagram; appends its events.
    ///
    /// `arrived` is the host's clock in us. After a reset it shows how much time has passed; without it, time continues
    /// from the latest received time.
    pub fn push(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Events) -> DatagramOutcome {
        let mut block = std::mem::take(&mut self.block);
        let mut columns = block.columns();
        let outcome = self.receive(datagram, arrived, &mut columns);
        out.append_columns(&columns);
        self.block = block;
        outcome
    }

    /// As [`Self::push`], but fills columns that the caller allocated.
    ///
    /// # Errors
    ///
    /// `Problem` if the columns have less room than [`most_rows`] requires; nothing is read then.
    pub fn fill(
        &mut self,
        datagram: &[u8],
        arrived: Option<i64>,
        columns: &mut Columns<'_>,
    ) -> crate::Result<DatagramOutcome> {
        columns.check_room(datagram.len(), most_rows(datagram.len()))?;
        Ok(self.receive(datagram, arrived, columns))
    }

    /// Decodes a datagram to rows.
    fn receive(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Columns<'_>) -> DatagramOutcome {
        match DatagramHeader::check(datagram) {
            Ok(()) => self.receive_intact(datagram, arrived, out),
            Err(refused) => {
                self.counts.datagrams += 1;
                *match refused {
                    Refused::Short => &mut self.counts.short,
                    Refused::Long => &mut self.counts.long,
                    Refused::Foreign => &mut self.counts.foreign,
                    Refused::Checksum => &mut self.counts.checksum,
                } += 1;
                DatagramOutcome::Refused(refused)
            }
        }
    }

    /// As [`Self::receive`], for a datagram that was found intact.
    #[inline]
    pub(in crate::wire::v2) fn receive_intact(
        &mut self,
        datagram: &[u8],
        arrived: Option<i64>,
        out: &mut Columns<'_>,
    ) -> DatagramOutcome {
        let header = DatagramHeader::of_intact(datagram);
        self.counts.datagrams += 1;
        let (base, missing, reset) = match self.usual(&header, datagram, out) {
            Some((base, missing)) => (base, missing, false),
            None => match self.any(header, datagram, arrived, out) {
                Ok(decoded) => decoded,
                Err(outcome) => return outcome,
            },
        };
        self.counts.intact += 1;
        if let Some(now) = arrived {
            self.last_arrival = Some((now, self.latest));
        }
        let until = (header.span > 0).then(|| base + i64::from(header.span));
        self.latest = self.latest.max(until.unwrap_or(i64::MIN));
        DatagramOutcome::Intact { until, missing, reset }
    }

    /// Decodes changes like those of the datagram before, next in the same session; returns their base time, us, and how
    /// many numbers are missing. None for any other datagram.
    #[inline(always)]
    fn usual(&mut self, header: &DatagramHeader, datagram: &[u8], out: &mut Columns<'_>) -> Option<(i64, u64)> {
        if self.common != Some(DatagramHeader::common(datagram)) {
            return None;
        }
        let session = self.sessions.last_mut()?;
        let base = session.take_ahead(header, checksum(datagram))?;
        let missing = session.missing();
        self.again.1 = 0;
        self.latest = self.latest.max(base);
        self.changes(header, datagram, base, out);
        Some((base, missing))
    }

    /// Decodes any intact datagram; returns its base time, us, how many numbers are missing, and whether the board was reset
    /// before it.
    ///
    /// # Errors
    ///
    /// The outcome for a datagram of which nothing is decoded.
    #[inline(never)]
    fn any(
        &mut self,
        header: DatagramHeader,
        datagram: &[u8],
        arrived: Option<i64>,
        out: &mut Columns<'_>,
    ) -> Result<(i64, u64, bool), DatagramOutcome> {
        if *self.board.get_or_insert(header.board) != header.board {
            return Err(self.refuse_other_board());
        }
        let sum = checksum(datagram);
        let (index, reset) = match self.sessions.last() {
            Some(last) if last.is_ahead(&header) && last.unlike == 0 => (self.sessions.len() - 1, false),
            _ => self.session(&header, sum, arrived),
        };
        let session = &mut self.sessions[index];
        let number = session.number_of(header.sequence);
        let ahead = number > session.highest;
        match session.note(number, sum) {
            Noted::Old => {
                self.counts.old += 1;
                return Err(DatagramOutcome::Repeated);
            }
            noted @ (Noted::Again | Noted::Unlike) => {
                let in_turn = if number == self.again.0 { self.again.1 + 1 } else { 1 };
                self.again = (number + 1, in_turn);
                if noted == Noted::Unlike {
                    session.unlike += 1;
                    return Err(self.refuse_other_board());
                }
                self.counts.repeated += 1;
                return Err(DatagramOutcome::Repeated);
            }
            Noted::New => self.again.1 = 0,
        }
        if ahead {
            session.unlike = 0;
        }
        session.latest = session.latest.max(header.base);
        let (base, missing) = (session.offset + header.base as i64, session.missing());
        self.counts.dropped += u64::from(header.flags & DROPPED != 0);
        self.counts.unknown_flags += u64::from(header.flags & !(FRAME_SYNC | DIFFERENCES | DROPPED) != 0);
        self.latest = self.latest.max(base);
        if index + 1 == self.sessions.len() {
            self.common = header.has_plain_changes().then(|| DatagramHeader::common(datagram));
            self.body(&header, datagram, base, Some(number), out);
        } else {
            // An event from before the latest reset must not change the taxels' current values.
            let blank = self.held.blank();
            let since = std::mem::replace(&mut self.held, blank);
            self.body(&header, datagram, base, None, out);
            self.held = since;
        }
        Ok((base, missing, reset))
    }

    /// Leaves out an intact datagram of another board.
    fn refuse_other_board(&mut self) -> DatagramOutcome {
        self.counts.foreign += 1;
        self.counts.other_board += 1;
        DatagramOutcome::Refused(Refused::Foreign)
    }

    /// The index of the session that a datagram with this checksum belongs to, and whether it is the session's first datagram.
    fn session(&mut self, header: &DatagramHeader, sum: u32, arrived: Option<i64>) -> (usize, bool) {
        // The latest session with this number, in case two resets drew the same one.
        if let Some(index) = self.sessions.iter().rposition(|session| session.number == header.session) {
            if !self.begins_again(&self.sessions[index], header, sum, arrived) {
                return (index, false);
            }
            // What was refused since the last new datagram is this board's: its numbers are missing in the session that
            // begins.
            let unlike = u64::from(std::mem::take(&mut self.sessions[index].unlike));
            self.counts.foreign -= unlike;
            self.counts.other_board -= unlike;
            self.counts.repeated += unlike;
        }
        self.again.1 = 0;
        let began = self.sessions.is_empty();
        let offset = if began && !self.goes_on {
            0
        } else {
            let passed = match (arrived, self.last_arrival) {
                (Some(now), Some((before, time))) => time + silence(before, now) - self.latest,
                _ => 0,
            };
            self.latest + passed.max(0) - header.base as i64
        };
        // After its reset the board compares with 0, and sends every taxel whose value differs. If its first datagrams
        // are lost, or if it only changed from version 1 without a reset, the other taxels' values are unknown.
        let from_start = header.sequence == 0 && !(began && self.goes_on);
        if from_start || !began {
            self.held.forget(from_start.then_some(0));
        }
        self.counts.resets += u64::from(!began);
        self.status_number = i64::MIN;
        self.dropped_before = from_start.then_some(0);
        if self.sessions.len() == SESSIONS {
            let session = self.sessions.remove(0);
            self.missed_before += session.missing();
            self.filled_before += session.filled;
        }
        self.common = None;
        self.sessions.push(BoardSession::new(header, offset, !began));
        (self.sessions.len() - 1, !began)
    }

    /// Whether a datagram of a session's number begins another session, as two successive resets drew the same number.
    fn begins_again(&self, session: &BoardSession, header: &DatagramHeader, sum: u32, arrived: Option<i64>) -> bool {
        let number = session.number_of(header.sequence);
        let behind = session.highest - number;
        let known = arrived.zip(self.last_arrival).map(|(now, (then, _))| silence(then, now) >= SILENT_US);
        // A network repeats single datagrams, and not so many in turn long after those, or while the board is silent.
        let in_turn = self.again.0 == number && self.again.1 >= IN_TURN;
        let repeats = in_turn && (behind >= 8 * i64::from(IN_TURN) || known == Some(true));
        // One whose number never came was delayed, unless it is farther behind than the network reorders.
        let far = session.latest.saturating_sub(header.base) > FARTHEST_BACK_US.unsigned_abs();
        let delayed = behind > 0 && far && known != Some(false) && !session.has(number);
        // No network changes contents: a board that goes on was not reset, else many differ, or all that came. While
        // nothing new comes, the first number does, or a second one, as a single one may be of another board.
        let contradicts = if behind < 0 {
            session.is_contradicted()
        } else {
            session.differs(number, sum)
                && (session.unlike >= IN_TURN || (known == Some(true) && (header.sequence == 0 || session.unlike > 0)))
        };
        let earlier = header.base < session.latest && (behind >= WINDOW as i64 || repeats || delayed);
        header.sequence < 1024 && (earlier || contradicts)
    }
}

/// Most rows that a stream of this many bytes can need: one a word of two bytes, and those that may be overwritten.
#[must_use]
pub fn most_rows(bytes: usize) -> usize {
    words::room(bytes / 2)
}

#[cfg(test)]
mod tests;

//! Decodes datagrams of version 2 to events: each intact one exactly once, whatever was lost, repeated, reordered or
//! damaged.

mod body;
mod held;
#[cfg(target_arch = "x86_64")]
mod run;
mod run_totals;
mod session;
mod words;

use super::checksum::split_checksum;
use super::counts::{BoardTotals, Counts};
use super::{DIFFERENCES, DROPPED, DatagramHeader, FRAME_SYNC, Refused};
use crate::events::FARTHEST_BACK_US;
use crate::vectors::Instructions;
use crate::wire::columns::{Columns, Laid, Room, Table};
use crate::wire::silence;
use crate::{Array, Events, Result, problem};
use held::ValuesByLine;
#[cfg(target_arch = "x86_64")]
use run::RunDecoder;
use run_totals::RunTotals;
use session::{BoardSession, Noted, WINDOW};
pub use words::stream_rows;

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
    pub fn instructions(mut self, instructions: Instructions) -> Result<Self> {
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
    #[inline]
    pub fn push(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut Events) -> DatagramOutcome {
        self.push_table(datagram, arrived, out)
    }

    /// As [`Self::push`], but fills columns that the caller allocated, from their first row on.
    ///
    /// # Errors
    ///
    /// `Problem` if a column has fewer entries than [`stream_rows`] returns; nothing is read then.
    pub fn fill(
        &mut self,
        datagram: &[u8],
        arrived: Option<i64>,
        room: Room<'_>,
    ) -> Result<(Columns, DatagramOutcome)> {
        let mut laid = Laid::new(check_room(room, datagram.len())?);
        let received = self.push_table(datagram, arrived, &mut laid);
        Ok((laid.end(), received))
    }

    #[inline]
    fn push_table(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut impl Table) -> DatagramOutcome {
        let latest = self.latest;
        let taken = self.plain(std::iter::once(datagram), stream_rows(datagram.len()), out);
        match self.sessions.last() {
            Some(session) if taken.datagrams > 0 => {
                let RunTotals { base, span, .. } = taken;
                self.last_arrival = arrived.map(|now| (now, latest.max(base))).or(self.last_arrival);
                let until = (span > 0).then(|| base + i64::from(span));
                DatagramOutcome::Intact { until, missing: session.missing(), reset: false }
            }
            _ => self.push_any(datagram, arrived, out),
        }
    }

    fn push_any(&mut self, datagram: &[u8], arrived: Option<i64>, out: &mut impl Table) -> DatagramOutcome {
        match DatagramHeader::read(datagram) {
            Ok((header, body)) => self.push_read(datagram, &header, body, arrived, out),
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

    /// As [`Self::push`], for a datagram that was already parsed and found intact.
    pub(in crate::wire) fn push_read(
        &mut self,
        datagram: &[u8],
        header: &DatagramHeader,
        body: &[u8],
        arrived: Option<i64>,
        out: &mut impl Table,
    ) -> DatagramOutcome {
        self.counts.datagrams += 1;
        if *self.board.get_or_insert(header.board) != header.board {
            return self.refuse_other_board();
        }
        let sum = split_checksum(datagram).1;
        let (index, reset) = match self.sessions.last() {
            // The usual case.
            Some(last) if last.is_next(header) && last.unlike == 0 => (self.sessions.len() - 1, false),
            _ => self.session(header, sum, arrived),
        };
        let session = &mut self.sessions[index];
        let number = session.number_of(header.sequence);
        let ahead = number > session.highest;
        match session.note(number, sum) {
            Noted::Old => {
                self.counts.old += 1;
                return DatagramOutcome::Repeated;
            }
            noted @ (Noted::Again | Noted::Unlike) => {
                let in_turn = if number == self.again.0 { self.again.1 + 1 } else { 1 };
                self.again = (number + 1, in_turn);
                if noted == Noted::Unlike {
                    session.unlike += 1;
                    return self.refuse_other_board();
                }
                self.counts.repeated += 1;
                return DatagramOutcome::Repeated;
            }
            Noted::New => self.again.1 = 0,
        }
        if ahead {
            session.unlike = 0;
        }
        session.latest = session.latest.max(header.base);
        let (base, missing) = (session.offset + header.base as i64, session.missing());
        self.counts.intact += 1;
        self.counts.dropped += u64::from(header.flags & DROPPED != 0);
        self.counts.unknown_flags += u64::from(header.flags & !(FRAME_SYNC | DIFFERENCES | DROPPED) != 0);
        self.latest = self.latest.max(base);
        if index + 1 == self.sessions.len() {
            self.body(header, body, base, Some(number), out);
        } else {
            // An event from before the latest reset must not change the taxels' current values.
            let blank = self.held.blank();
            let since = std::mem::replace(&mut self.held, blank);
            self.body(header, body, base, None, out);
            self.held = since;
        }
        if let Some(now) = arrived {
            self.last_arrival = Some((now, self.latest));
        }
        let until = (header.span > 0).then(|| base + i64::from(header.span));
        self.latest = self.latest.max(until.unwrap_or(i64::MIN));
        DatagramOutcome::Intact { until, missing, reset }
    }

    /// Leaves out an intact datagram of another board.
    fn refuse_other_board(&mut self) -> DatagramOutcome {
        self.counts.foreign += 1;
        self.counts.other_board += 1;
        DatagramOutcome::Refused(Refused::Foreign)
    }

    /// Decodes datagrams while they are plain and short, if the machine has the instructions; `out` has room for `most`
    /// rows. The result equals that of [`Self::push_read`] for each datagram, without arrival times.
    #[inline]
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
    pub(in crate::wire::v2) fn plain<'d>(
        &mut self,
        datagrams: impl Iterator<Item = &'d [u8]> + Clone,
        most: usize,
        out: &mut impl Table,
    ) -> RunTotals {
        #[cfg(target_arch = "x86_64")]
        if self.instructions >= Instructions::Avx2
            && let (Some(first), Some(board), Some(session)) =
                (datagrams.clone().next(), self.board, self.sessions.last_mut())
            && session.unlike == 0
            && let Self { held, counts, latest, again, .. } = self
            && let Some((mut run, value)) = RunDecoder::new(first, board, session, held, latest, counts)
            && (value == 0 || out.writes_intensity())
        {
            // SAFETY: `instructions` and `best` select a set only if the machine has it. A run writes each row that it
            // counts, and with `paired` its ticks and present.
            unsafe {
                out.rows(most, false, false, |room, row, paired| match value {
                    0 => run.take::<0>(datagrams, room, row, paired),
                    8 => run.take::<8>(datagrams, room, row, paired),
                    _ => run.take::<16>(datagrams, room, row, paired),
                });
            }
            if run.taken.datagrams > 0 {
                again.1 = 0;
            }
            return run.taken;
        }
        RunTotals::default()
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

/// The columns, if they have room for the rows of this many bytes.
pub(in crate::wire::v2) fn check_room(room: Room<'_>, bytes: usize) -> Result<Room<'_>> {
    let most = stream_rows(bytes);
    if room.len() < most {
        return Err(problem!("columns have room for {} rows: {bytes} bytes may need {most} rows", room.len()));
    }
    Ok(room)
}

#[cfg(test)]
mod tests;

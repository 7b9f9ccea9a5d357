//! Decodes plain datagrams of a few words, as scenes produce, one or many in a row, with AVX2.
//!
//! A datagram is plain if it is ahead in the latest session and has changes only (no differences, no word of time),
//! none earlier than the stored values and all on the array. Any other datagram ends the run, and the decoder decodes
//! it alone; only the decoder defines a datagram's meaning. So both ways return the same rows, values and counts.

use super::held::ValuesByLine;
use super::run_totals::RunTotals;
use super::session::BoardSession;
use super::words::{EIGHT, Eight, FULL};
use crate::wire::columns::Room;
use crate::wire::v2::checksum::{EVEN, even, split_checksum};
use crate::wire::v2::counts::Counts;
use crate::wire::v2::{BodyKind, DatagramHeader, HEADER_BYTES, TRAILER_BYTES};

/// Longest datagram of a run, bytes: all but the checksum fits the buffer of [`EVEN`] bytes.
const LONGEST: usize = EVEN + 4;

/// The state of a decoder during a run.
pub(super) struct RunDecoder<'a> {
    /// The part that is equal for all datagrams of the run: [`DatagramHeader::common`] of plain changes.
    common: u64,
    /// The latest session.
    session: &'a mut BoardSession,
    held: &'a mut ValuesByLine,
    latest: &'a mut i64,
    counts: &'a mut Counts,
    pub(super) taken: RunTotals,
}

/// Whether a datagram of this length can belong to a run.
#[inline(always)]
fn short(datagram: &[u8]) -> bool {
    (HEADER_BYTES + TRAILER_BYTES..=LONGEST).contains(&datagram.len())
}

/// Most rows that the stores for a body may touch: eight for each group of eight words, whole or not.
#[inline(always)]
fn rows_touched<const VALUE: u32>(body: &[u8]) -> usize {
    (body.len() / if VALUE == 16 { 4 } else { 2 }).next_multiple_of(EIGHT)
}

impl<'a> RunDecoder<'a> {
    /// A run that may begin with a datagram, and the number of value bits of its words; none if no run can begin there.
    #[inline]
    pub(super) fn new(
        datagram: &[u8],
        board: u16,
        session: &'a mut BoardSession,
        held: &'a mut ValuesByLine,
        latest: &'a mut i64,
        counts: &'a mut Counts,
    ) -> Option<(Self, u32)> {
        let kind = BodyKind::from_number(short(datagram).then(|| DatagramHeader::fields(datagram).0.kind)?)?;
        if !matches!(kind, BodyKind::Changes | BodyKind::Small | BodyKind::Large) {
            return None;
        }
        let value = kind.layout()?.value;
        // Positions and saturated sums must be distinct in 16 bits.
        if held.values.len() >= usize::from(FULL) {
            return None;
        }
        let common = DatagramHeader::common_of(kind, board, session.number, held.stride);
        Some((Self { common, session, held, latest, counts, taken: RunTotals::default() }, value))
    }

    /// Decodes datagrams whose words have `VALUE` bits of value into `room`, from a row on, while they are plain;
    /// returns the number of rows.
    ///
    /// # Safety
    ///
    /// The machine must have the features below, and `VALUE` must be the number that [`Self::new`] returned.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,popcnt,sse4.2")]
    pub(super) unsafe fn take<'d, const VALUE: u32>(
        &mut self,
        datagrams: impl Iterator<Item = &'d [u8]>,
        room: &mut Room<'_>,
        first: usize,
        paired: bool,
    ) -> usize {
        let (mut row, mut taken) = (first, RunTotals::default());
        for datagram in datagrams {
            if !short(datagram) || DatagramHeader::common(datagram) != self.common {
                break;
            }
            let (header, body) = DatagramHeader::fields(datagram);
            let number = self.session.number_of(header.sequence);
            let t = self.session.offset + header.base as i64;
            let start = u32::from(header.line) << header.stride;
            let plain = number > self.session.highest
                && start < u32::from(FULL)
                && (VALUE == 0 || t >= self.held.newest)
                && body.len().is_multiple_of(if VALUE == 16 { 4 } else { 2 })
                && room.len() - row >= rows_touched::<VALUE>(body);
            let (content, checksum) = split_checksum(datagram);
            // SAFETY: `short` has checked that there are 20 to 64 bytes.
            if !plain || unsafe { even(content) } != checksum {
                break;
            }
            // SAFETY: the machine has the features, `new` has checked the array, and the loop above has checked that
            // these rows fit after `row`.
            let Some(rows) = (unsafe { self.words::<VALUE>(datagram, start as u16, t, room, row, paired) }) else {
                break;
            };
            self.session.note(number, checksum);
            self.session.latest = self.session.latest.max(header.base);
            *self.latest = (*self.latest).max(t + i64::from(header.span));
            row += rows;
            let (datagrams, bytes) = (taken.datagrams + 1, taken.bytes + datagram.len());
            taken = RunTotals { datagrams, bytes, base: t, span: header.span };
        }
        self.counts.datagrams += taken.datagrams as u64;
        self.counts.intact += taken.datagrams as u64;
        self.counts.events += (row - first) as u64;
        self.taken = taken;
        row - first
    }

    /// Decodes a datagram's whole words, which begin at a position and share one time; returns the number of rows. None
    /// if a word is not plain: values of words before it may be stored already, and the decoder then stores the same
    /// values again.
    ///
    /// # Safety
    ///
    /// As for [`Self::take`]; [`rows_touched`] rows must fit after `first`.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,popcnt,sse4.2")]
    unsafe fn words<const VALUE: u32>(
        &mut self,
        datagram: &[u8],
        mut passed: u16,
        t: i64,
        room: &mut Room<'_>,
        first: usize,
        paired: bool,
    ) -> Option<usize> {
        let bytes = if VALUE == 16 { 4 } else { 2 };
        let (mut row, mut at, end) = (first, HEADER_BYTES, datagram.len() - TRAILER_BYTES);
        while at < end {
            let count = ((end - at) / bytes).min(EIGHT);
            // SAFETY: this many words follow the header; as the caller guarantees, the events are on the array, and so
            // in `held`, and 8 rows fit after those so far.
            unsafe {
                let eight = Eight::read::<VALUE>(datagram, at, count, passed, self.held)?;
                eight.write::<VALUE>(t, room, row, paired);
                if VALUE > 0 && eight.n > 0 {
                    eight.store(t, self.held);
                }
                (row, passed) = (row + eight.n, eight.passed);
            }
            at += bytes * count;
        }
        Some(row - first)
    }
}

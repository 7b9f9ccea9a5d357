//! Plain datagrams of a few words, as a scene's are: one, or many in one go, with AVX2.
//!
//! Plain is a datagram ahead in the latest session, with changes as they are (no differences, no time of their own), no
//! earlier than what is held and all on the array. Anything else ends the run, and the decoder takes it by itself, which alone
//! defines what a datagram means. So both ways give the same rows, held values and counts.

use super::held::Held;
use super::session::Session;
use super::taken::Taken;
use super::words::{EIGHT, Eight, FULL};
use crate::wire::columns::Room;
use crate::wire::v2::checksum::{EVEN, even};
use crate::wire::v2::counts::Counts;
use crate::wire::v2::{HEADER_BYTES, Header, Kind, TRAILER_BYTES};

/// Bytes of the longest datagram of a run: all but the checksum in one register.
const LONGEST: usize = EVEN + 4;

/// Rows that a datagram's stores may touch: a whole eight for each that is begun.
const ROWS: usize = ((LONGEST - HEADER_BYTES - TRAILER_BYTES) / 2).next_multiple_of(EIGHT);

/// What the decoder knows, as a run goes on with it.
pub(super) struct Run<'a> {
    /// What its datagrams have in common, as [`Header::common`] has it of plain ones.
    common: u64,
    /// The latest one.
    session: &'a mut Session,
    held: &'a mut Held,
    latest: &'a mut i64,
    counts: &'a mut Counts,
    pub(super) taken: Taken,
}

/// Whether a datagram's length is that of one of a run.
#[inline(always)]
fn short(datagram: &[u8]) -> bool {
    (HEADER_BYTES + TRAILER_BYTES..=LONGEST).contains(&datagram.len())
}

impl<'a> Run<'a> {
    /// A run that may begin with a datagram, and how many bits of value its words have; none where it surely does not.
    #[inline]
    pub(super) fn new(
        datagram: &[u8],
        board: u16,
        session: &'a mut Session,
        held: &'a mut Held,
        latest: &'a mut i64,
        counts: &'a mut Counts,
    ) -> Option<(Self, u32)> {
        let kind = Kind::of(short(datagram).then(|| Header::fields(datagram).0.kind)?)?;
        if !matches!(kind, Kind::Changes | Kind::Small | Kind::Large) {
            return None;
        }
        let value = kind.layout()?.value;
        // Positions, and sums that are too large, must be distinct in 16 bits.
        if held.values.len() >= usize::from(FULL) {
            return None;
        }
        let common = Header::common_of(kind, board, session.number, held.stride);
        Some((Self { common, session, held, latest, counts, taken: Taken::default() }, value))
    }

    /// Takes datagrams of words with so many bits of value into `room`, from a row on, as far as they are plain; gives how many rows they
    /// are.
    ///
    /// # Safety
    ///
    /// The machine must have the features below, and `VALUE` be that which [`Self::new`] gave.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,popcnt,sse4.2")]
    pub(super) unsafe fn take<'d, const VALUE: u32>(
        &mut self,
        datagrams: impl Iterator<Item = &'d [u8]>,
        room: &mut Room<'_>,
        first: usize,
        paired: bool,
    ) -> usize {
        let (mut row, mut taken) = (first, Taken::default());
        for datagram in datagrams {
            if !short(datagram) || Header::common(datagram) != self.common {
                break;
            }
            let (header, body) = Header::fields(datagram);
            let number = self.session.number_of(header.sequence);
            let t = self.session.offset + header.base as i64;
            let start = u32::from(header.line) << header.stride;
            let plain = number > self.session.highest
                && start < u32::from(FULL)
                && (VALUE == 0 || t >= self.held.newest)
                && body.len().is_multiple_of(if VALUE == 16 { 4 } else { 2 })
                && room.len() - row >= ROWS;
            let (summed, sum) = datagram.split_at(datagram.len() - 4);
            // SAFETY: 20 to 64 bytes, as `short` has seen to.
            if !plain || unsafe { even(summed) }.to_le_bytes() != sum {
                break;
            }
            // SAFETY: the machine has the features, `new` has seen to the array, and so many rows fit behind `row`, as was seen above.
            let Some(rows) = (unsafe { self.words::<VALUE>(datagram, start as u16, t, room, row, paired) }) else {
                break;
            };
            self.session.note(number);
            self.session.latest = self.session.latest.max(header.base);
            *self.latest = (*self.latest).max(t + i64::from(header.span));
            row += rows;
            let (datagrams, bytes) = (taken.datagrams + 1, taken.bytes + datagram.len());
            taken = Taken { datagrams, bytes, base: t, span: header.span };
        }
        self.counts.datagrams += taken.datagrams as u64;
        self.counts.intact += taken.datagrams as u64;
        self.counts.events += (row - first) as u64;
        self.taken = taken;
        row - first
    }

    /// Takes a datagram's whole words, which begin at a position and are of one time; gives how many rows they are. None where one
    /// is not plain: of those before it, eight by eight, some may be held by then, as the decoder will hold them again.
    ///
    /// # Safety
    ///
    /// As [`Self::take`]'s; [`ROWS`] must fit behind `first`.
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
            // SAFETY: so many words lie there, behind the header; with the caller's promises the events lie on the array, and so in
            // `held`, and 8 rows fit behind those so far.
            unsafe {
                let eight = Eight::read::<VALUE>(datagram, at, count, passed, self.held)?;
                eight.write::<VALUE>(t, room, row, paired);
                if VALUE > 0 && eight.n > 0 {
                    eight.hold(t, self.held);
                }
                (row, passed) = (row + eight.n, eight.passed);
            }
            at += bytes * count;
        }
        Some(row - first)
    }
}

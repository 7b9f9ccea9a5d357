//! Runs of plain datagrams of a few words, as a scene's are: many in one go, with AVX-512.
//!
//! Plain is a datagram ahead in the latest session, with changes as they are (no differences, no time of their own), no
//! earlier than what is held and all on the array. Anything else ends the run, untouched: the decoder takes it by itself,
//! which alone says what a datagram means. So both ways give the same rows, held values and counts.

use std::arch::x86_64::{_bzhi_u32, _mm512_adds_epu16, _mm512_set1_epi16};

use super::held::Held;
use super::session::Session;
use super::words::{Constants, FULL};
use crate::wire::columns::Room;
use crate::wire::v2::checksum::{EVEN, even};
use crate::wire::v2::counts::Counts;
use crate::wire::v2::{FRAME_SYNC, HEADER_BYTES, Header, Kind, LENGTH_BYTES, TRAILER_BYTES};

/// Bytes of the longest datagram of a run: all but the checksum in one register.
const LONGEST: usize = EVEN + 4;

/// Rows that a datagram's stores may touch.
const ROWS: usize = 32;

/// What the decoder knows, as a run goes on with it.
pub(super) struct Run<'a> {
    pub(super) kind: Kind,
    pub(super) board: u16,
    /// The latest one.
    pub(super) session: &'a mut Session,
    pub(super) held: &'a mut Held,
    pub(super) latest: &'a mut i64,
    pub(super) counts: &'a mut Counts,
    /// Bytes.
    pub(super) done: usize,
}

/// The datagram that lies ahead behind its length, where it may be one of a run.
#[inline(always)]
fn ahead(bytes: &[u8]) -> Option<&[u8]> {
    let (length, rest) = bytes.split_first_chunk::<LENGTH_BYTES>()?;
    let length = usize::from(u16::from_le_bytes(*length));
    if !(HEADER_BYTES + TRAILER_BYTES..=LONGEST).contains(&length) {
        return None;
    }
    rest.get(..length).filter(|datagram| Header::likely(datagram))
}

/// The kind of the datagram that lies ahead, where it may begin a run.
pub(super) fn first(bytes: &[u8]) -> Option<Kind> {
    let kind = Kind::of(Header::fields(ahead(bytes)?).0.kind)?;
    matches!(kind, Kind::Changes | Kind::Small | Kind::Large).then_some(kind)
}

/// Whether an array's positions, and sums that are too large, are told apart in 16 bits.
pub(super) fn fits(held: &Held) -> bool {
    held.values.len() < usize::from(FULL)
}

impl Run<'_> {
    /// Takes datagrams of words with so many bits of value into `room`, from a row on; gives how many rows they are.
    ///
    /// # Safety
    ///
    /// The machine must have the features below, [`fits`] must hold, and `VALUE` be that of the kind.
    #[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512vbmi2,bmi2,lzcnt,popcnt")]
    pub(super) unsafe fn take<const VALUE: u32>(
        &mut self,
        bytes: &[u8],
        room: &mut Room<'_>,
        first: usize,
        paired: bool,
    ) -> usize {
        let word = if VALUE == 16 { 4 } else { 2 };
        let constants = Constants::new(self.held.stride, self.held);
        let (kind, mut row, mut datagrams) = (self.kind.number(), first, 0);
        while let Some(datagram) = ahead(&bytes[self.done..]) {
            let (header, body) = Header::fields(datagram);
            let number = self.session.number_of(header.sequence);
            let t = self.session.offset + header.base as i64;
            let start = u32::from(header.line) << header.stride;
            let plain = header.kind == kind
                && header.board == self.board
                && header.session == self.session.number
                && number > self.session.highest
                && header.stride == self.held.stride
                && header.flags & !FRAME_SYNC == 0
                && start < u32::from(FULL)
                && (VALUE == 0 || t >= self.held.newest)
                && body.len().is_multiple_of(word)
                && room.len() - row >= ROWS;
            let (summed, sum) = datagram.split_at(datagram.len() - 4);
            // SAFETY: 20 to 64 bytes, as `ahead` has seen to.
            if !plain || unsafe { even(summed) }.to_le_bytes() != sum {
                break;
            }
            let lanes = _bzhi_u32(u32::MAX, (body.len() / word) as u32);
            // SAFETY: so many words lie in the body.
            let words = unsafe { constants.words::<VALUE>(body.as_ptr(), lanes) };
            if words.controls & words.polarity != 0 {
                break;
            }
            let steps = constants.sums::<VALUE>(&words, lanes, words.controls, false);
            // A sum that is too large is the position of none of these arrays.
            let from_1 = _mm512_adds_epu16(steps, _mm512_set1_epi16(start as i16));
            let Some(found) = constants.found(&words, lanes & !words.controls, from_1) else { break };
            // SAFETY: 32 rows fit behind `row`, as was seen above; the events lie on the array, and so in `held`.
            unsafe {
                found.write::<VALUE>(t, room, row, paired);
                if VALUE > 0 && found.n > 0 {
                    constants.hold(&found, t, self.held);
                }
            }
            self.session.note(number);
            self.session.latest = self.session.latest.max(header.base);
            *self.latest = (*self.latest).max(t + i64::from(header.span));
            row += found.n;
            datagrams += 1;
            self.done += LENGTH_BYTES + datagram.len();
        }
        self.counts.datagrams += datagrams;
        self.counts.intact += datagrams;
        self.counts.events += (row - first) as u64;
        row - first
    }
}

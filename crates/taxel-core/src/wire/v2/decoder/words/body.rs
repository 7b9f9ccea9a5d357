//! A datagram's body while it is decoded: the state of the decoding loops.

use crate::wire::v2::{DatagramHeader, HEADER_BYTES, LATEST_OFFSET, TRAILER_BYTES, before};

/// The meaning of a body's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Changes, with the taxel's new value if the kind has values.
    Changes,
    /// Changes whose value is a difference.
    Differences,
    /// Values that the board repeats.
    States,
    /// States of an earlier session: the taxels were reset since.
    StaleStates,
}

/// A body, and the position of the decoder in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyReader<'a> {
    pub(crate) meaning: Meaning,
    /// Bits of a position that name its row.
    pub(crate) stride: u8,
    /// Base time, us.
    pub(crate) base: i64,
    /// The header and the body.
    pub(super) bytes: &'a [u8],
    /// Index of the next word in `bytes`, or their length.
    pub(super) at: usize,
    /// The time of the next event, us.
    pub(super) t: i64,
    /// Position of the last word.
    pub(super) position: i64,
    /// Whether an offset was missing, or later than any valid one.
    pub(super) cut: bool,
    /// The latest time of a row, us; `i64::MIN` before the first.
    pub(crate) latest: i64,
}

impl<'a> BodyReader<'a> {
    /// The body of a datagram with this header, with nothing read yet; times count from `base`, us.
    pub(crate) fn new(meaning: Meaning, header: &DatagramHeader, base: i64, datagram: &'a [u8]) -> Self {
        let (stride, position) = (header.stride, before(header.line, header.stride));
        let bytes = &datagram[..datagram.len() - TRAILER_BYTES];
        Self { meaning, stride, base, bytes, at: HEADER_BYTES, t: base, position, cut: false, latest: i64::MIN }
    }

    /// Number of whole words left.
    #[inline(always)]
    pub(crate) fn words<const BYTES: usize>(&self) -> usize {
        (self.bytes.len() - self.at) / BYTES
    }

    /// The offset at an index, us; none if the body ends before it, or if it is later than any valid offset.
    #[inline(always)]
    pub(super) fn offset<const BYTES: usize>(&self, at: usize) -> Option<u32> {
        let offset = (self.bytes.len() - at >= BYTES).then(|| word::<BYTES>(self.bytes, at))?;
        (u64::from(offset) <= LATEST_OFFSET).then_some(offset)
    }
}

/// The word at an index, of 2 or 4 bytes.
#[inline(always)]
pub(super) fn word<const BYTES: usize>(bytes: &[u8], at: usize) -> u32 {
    let mut word = [0; 4];
    word[..BYTES].copy_from_slice(&bytes[at..at + BYTES]);
    u32::from_le_bytes(word)
}

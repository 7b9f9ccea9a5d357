//! A datagram's body as it is read, which is what its loops carry.

use crate::wire::v2::{Header, LATEST_OFFSET, Layout, before};

/// What a body's words mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Changes, with the value held where the kind has one.
    Changes,
    /// Changes by a value.
    Differences,
    /// Values that the board repeats.
    States,
    /// Those of a session before the latest: its reset is newer.
    StaleStates,
}

/// A body and how far it was read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body<'a> {
    pub(crate) layout: Layout,
    pub(crate) meaning: Meaning,
    /// Bits of a position that name its row.
    pub(crate) stride: u8,
    /// us.
    pub(crate) base: i64,
    pub(crate) bytes: &'a [u8],
    /// Read so far, bytes; never more than there are.
    pub(super) at: usize,
    /// The time of the next event, us.
    pub(super) t: i64,
    /// That of the last word.
    pub(super) position: i64,
    /// Whether an offset was missing, or later than any that a writer sends.
    pub(super) cut: bool,
    /// The latest time of a row, us; `i64::MIN` before the first.
    pub(crate) latest: i64,
    /// The row that is written next.
    pub(crate) rows: usize,
}

impl<'a> Body<'a> {
    /// A header's body whose times count from `base`, us, and of which nothing was read yet.
    pub(crate) fn new(layout: Layout, meaning: Meaning, header: &Header, base: i64, bytes: &'a [u8]) -> Self {
        let (at, rows, stride, position) = (0, 0, header.stride, before(header.line, header.stride));
        Self { layout, meaning, stride, base, bytes, at, t: base, position, cut: false, latest: i64::MIN, rows }
    }

    /// Whole words that are left.
    #[inline(always)]
    pub(crate) fn left(&self) -> usize {
        // Of 2 or 4 bytes each: no division.
        (self.bytes.len() - self.at) >> self.layout.bytes.trailing_zeros()
    }

    /// The offset that stands at a place, us; none where the body ends before it, or where it is later than a writer sends.
    #[inline(always)]
    pub(super) fn offset<const BYTES: usize>(&self, at: usize) -> Option<u32> {
        let offset = (self.bytes.len() - at >= BYTES).then(|| word::<BYTES>(self.bytes, at))?;
        (u64::from(offset) <= LATEST_OFFSET).then_some(offset)
    }
}

/// The word at a place, of 2 or 4 bytes.
#[inline(always)]
pub(super) fn word<const BYTES: usize>(bytes: &[u8], at: usize) -> u32 {
    let mut word = [0; 4];
    word[..BYTES].copy_from_slice(&bytes[at..at + BYTES]);
    u32::from_le_bytes(word)
}

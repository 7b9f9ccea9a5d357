//! Version 2 of the wire: self-contained datagrams with board, session, sequence number, and a promise that time has
//! advanced.
//!
//! `docs/wire-v2.md` specifies it. Little-endian throughout; byte 0 has its top bit clear, so that the first byte shows the
//! version. A datagram is a header, a body of words of one kind, a promise (*span*) and a checksum.
//!
//! | bytes | field |
//! |---|---|
//! | 0 | 0x54 |
//! | 1 | version (2) in the high four bits, kind in the low four |
//! | 2-3 | board |
//! | 4-7 | sequence: one more a datagram, 0 at reset |
//! | 8-13 | base time, us since reset |
//! | 14-15 | session: a random number, drawn at each reset |
//! | 16 | 5 bits of stride: position = line << stride \| row; 3 low bits of the first event's line, from where positions count |
//! | 17 | 4 bits of flags: 0 frame sync, 1 values are differences, 2 events were dropped since the last datagram; that line's 4 high bits |
//! | 18 ... | body |
//! | n-6, n-5 | span: no datagram of a higher sequence holds anything before base + span us; 0 = unknown |
//! | n-4 ... | CRC-32C of all bytes before |

mod counts;
mod crc;
mod decoder;
mod encode;
mod event_words;
mod packer;
mod stream;

pub use counts::{BoardTotals, Counts};
pub use decoder::{DatagramOutcome, Decoder, most_rows};
pub use encode::{Encoded, encode};
pub use packer::{Packer, Settings};
pub use stream::{StreamReader, decode};

use crate::{Array, problem};

/// The first byte of a datagram.
pub const MAGIC: u8 = 0x54;

/// Bytes before the body.
pub const HEADER_BYTES: usize = 18;

/// Bytes after the body: span and checksum.
pub const TRAILER_BYTES: usize = 6;

/// Largest datagram, bytes: fits a UDP datagram in one Ethernet frame, with room to spare.
pub const DATAGRAM_BYTES: usize = 1400;

/// Bytes of a body at most.
const BODY_BYTES: usize = DATAGRAM_BYTES - HEADER_BYTES - TRAILER_BYTES;

/// Before any time, us.
const NEVER: i64 = i64::MIN;

/// Size of the length that precedes each datagram in files and on streams, bytes.
const LENGTH_BYTES: usize = 2;

/// The latest offset from the base that a word can hold, us; later times begin a new datagram. A later offset could be
/// mistaken for a control word by a reader that examines all words alike.
pub const LATEST_OFFSET: u64 = 32_511;

/// The last line that a header can name; if the first event is in a later line, positions count from this line.
pub const LAST_LINE: u16 = 127;

/// Bits of a header's stride and of its flags, in a byte each; the bits above hold the low and the high bits of the
/// first line.
const STRIDE_BITS: u32 = 5;
const FLAG_BITS: u32 = 4;
const LOW_LINE_BITS: u32 = u8::BITS - STRIDE_BITS;

/// The base time has 48 bits: 8.9 years.
const BASE_BITS: u32 = 48;

/// What a datagram's body holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BodyKind {
    /// Changes without values: 16-bit words of polarity and 15 bits of skip.
    Changes = 0,
    /// Changes with values to 255: polarity, 7 bits of skip, 8 of value.
    Small = 1,
    /// Changes with values to 65 535: 32-bit words of polarity, 15 bits of skip, 16 of value.
    Large = 2,
    /// Markers: offset from the base (us, 32 bits), code (16), argument (16).
    Markers = 3,
    /// The board's own totals, 64 bits each, in the order of [`BoardTotals`].
    Status = 4,
    /// As [`BodyKind::Small`], values that the board repeats.
    SmallStates = 6,
    /// As [`BodyKind::Large`], values that the board repeats.
    LargeStates = 7,
}

impl BodyKind {
    /// The kind with this number; none if the number is unknown (yet).
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Changes,
            1 => Self::Small,
            2 => Self::Large,
            3 => Self::Markers,
            4 => Self::Status,
            6 => Self::SmallStates,
            7 => Self::LargeStates,
            _ => return None,
        })
    }

    /// The kind's number in the header.
    #[must_use]
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Bytes of a word, bits of its skip, bits of its value; none for a kind without taxels.
    #[must_use]
    pub(crate) fn layout(self) -> Option<Layout> {
        Some(match self {
            Self::Changes => Layout { bytes: 2, skip: 15, value: 0 },
            Self::Small | Self::SmallStates => Layout { bytes: 2, skip: 7, value: 8 },
            Self::Large | Self::LargeStates => Layout { bytes: 4, skip: 15, value: 16 },
            Self::Markers | Self::Status => return None,
        })
    }
}

/// The fields of a word, from its top bit down: polarity, skip, value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Layout {
    pub(crate) bytes: usize,
    pub(crate) skip: u32,
    pub(crate) value: u32,
}

impl Layout {
    /// The skip that marks a control word.
    pub(crate) const fn control(self) -> u32 {
        (1 << self.skip) - 1
    }

    /// How many positions a step of a control word advances, and how many steps it can hold.
    pub(crate) const fn advance(self) -> (i64, i64) {
        (1 << (self.skip - 1), 1 << self.value)
    }
}

/// Code of a marker that starts a recording.
pub(crate) const START: u16 = 1;
/// Code of a marker that stops a recording.
pub(crate) const STOP: u16 = 2;

/// A datagram's fields other than its body and checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DatagramHeader {
    /// Number of the kind, known or not.
    pub kind: u8,
    /// Number of the board.
    pub board: u16,
    /// Number of the datagram in its session.
    pub sequence: u32,
    /// Base time, us since reset.
    pub base: u64,
    /// Random number drawn at each reset.
    pub session: u16,
    /// Bits of a position that name the row: position = line << stride | row; 5 bits.
    pub stride: u8,
    /// The line from which the body's positions count; 7 bits.
    pub line: u8,
    /// Bit 0 frame sync, 1 differences, 2 dropped; bit 3 has no meaning yet.
    pub flags: u8,
    /// No datagram with a higher sequence number has an event before base + span, us; 0 promises nothing.
    pub span: u16,
}

/// All events of a frame carry its time.
pub const FRAME_SYNC: u8 = 1;
/// Values are differences from the last one sent.
pub const DIFFERENCES: u8 = 2;
/// Events were dropped since the last datagram.
pub const DROPPED: u8 = 4;

/// Why bytes are not a datagram of version 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Too short for header and trailer.
    #[error("shorter than 24 bytes")]
    Short,
    /// Longer than any datagram that a board sends.
    #[error("longer than 1400 bytes")]
    Long,
    /// The first byte or the version differs.
    #[error("has another first byte or version")]
    Foreign,
    /// The checksum does not match.
    #[error("has a wrong checksum")]
    Checksum,
}

impl DatagramHeader {
    /// Splits a datagram into header and body.
    ///
    /// # Errors
    ///
    /// [`Refused`], with the reason.
    pub fn read(datagram: &[u8]) -> Result<(Self, &[u8]), Refused> {
        Self::check(datagram)?;
        Ok((Self::of_intact(datagram), body_of(datagram)))
    }

    /// Checks that bytes are an intact datagram.
    #[inline]
    fn check(datagram: &[u8]) -> Result<(), Refused> {
        if datagram.first().is_some_and(|&byte| byte != MAGIC) || datagram.get(1).is_some_and(|byte| byte >> 4 != 2) {
            return Err(Refused::Foreign);
        }
        if datagram.len() < HEADER_BYTES + TRAILER_BYTES {
            return Err(Refused::Short);
        }
        if datagram.len() > DATAGRAM_BYTES {
            return Err(Refused::Long);
        }
        if crc::crc32c(&datagram[..datagram.len() - 4]) != checksum(datagram) {
            return Err(Refused::Checksum);
        }
        Ok(())
    }

    /// Whether bytes begin as a datagram does.
    fn likely(bytes: &[u8]) -> bool {
        bytes.first() == Some(&MAGIC) && bytes.get(1).is_some_and(|byte| byte >> 4 == 2)
    }

    /// The bits of an intact datagram that its successor has too, if both are of changes: board, session, kind, stride and
    /// flags.
    #[inline]
    fn common(datagram: &[u8]) -> u64 {
        let mut header = [0; HEADER_BYTES];
        header.copy_from_slice(&datagram[..HEADER_BYTES]);
        let sender = u32::from_le_bytes([header[0], header[1], header[2], header[3]]);
        let session = u16::from_le_bytes([header[14], header[15]]);
        let (stride, flags) = (header[16] & ((1 << STRIDE_BITS) - 1), header[17] & ((1 << FLAG_BITS) - 1));
        u64::from(sender) | u64::from(session) << 32 | u64::from(stride) << 48 | u64::from(flags) << 56
    }

    /// Whether the body has changes, of which no flag says more than that they are of one time.
    fn has_plain_changes(&self) -> bool {
        self.kind <= BodyKind::Large.number() && self.flags & !FRAME_SYNC == 0
    }

    /// The header of an intact datagram.
    #[inline]
    fn of_intact(datagram: &[u8]) -> Self {
        let (mut header, mut trailer) = ([0; HEADER_BYTES], [0; TRAILER_BYTES]);
        header.copy_from_slice(&datagram[..HEADER_BYTES]);
        trailer.copy_from_slice(&datagram[datagram.len() - TRAILER_BYTES..]);
        let eight = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| header[at + k]));
        let (sender, time, stride, flags) = (eight(0), eight(8), header[16], header[17]);
        Self {
            kind: (sender >> 8) as u8 & 0xf,
            board: (sender >> 16) as u16,
            sequence: (sender >> 32) as u32,
            base: time & ((1 << BASE_BITS) - 1),
            session: (time >> BASE_BITS) as u16,
            stride: stride & ((1 << STRIDE_BITS) - 1),
            line: stride >> STRIDE_BITS | flags >> FLAG_BITS << LOW_LINE_BITS,
            flags: flags & ((1 << FLAG_BITS) - 1),
            span: u16::from_le_bytes([trailer[0], trailer[1]]),
        }
    }

    /// The datagram with this header and body.
    #[must_use]
    pub fn datagram(&self, body: &[u8]) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES + body.len() + TRAILER_BYTES);
        out.extend([MAGIC, 2 << 4 | self.kind & 0xf]);
        out.extend(self.board.to_le_bytes());
        out.extend(self.sequence.to_le_bytes());
        out.extend(&(self.base & ((1 << BASE_BITS) - 1)).to_le_bytes()[..6]);
        out.extend(self.session.to_le_bytes());
        let (stride, flags) = (self.stride & ((1 << STRIDE_BITS) - 1), self.flags & ((1 << FLAG_BITS) - 1));
        out.extend([self.line << STRIDE_BITS | stride, self.line >> LOW_LINE_BITS << FLAG_BITS | flags]);
        out.extend(body);
        out.extend(self.span.to_le_bytes());
        out.extend(crc32c::crc32c(&out).to_le_bytes());
        out
    }
}

/// The body of an intact datagram.
fn body_of(datagram: &[u8]) -> &[u8] {
    &datagram[HEADER_BYTES..datagram.len() - TRAILER_BYTES]
}

/// The checksum of a datagram: its last four bytes.
#[inline]
fn checksum(datagram: &[u8]) -> u32 {
    let sum = &datagram[datagram.len() - 4..];
    u32::from_le_bytes([sum[0], sum[1], sum[2], sum[3]])
}

/// The position before the first word of a body whose positions count from this line.
#[must_use]
pub(crate) fn before(line: u8, stride: u8) -> i64 {
    (i64::from(line) << stride.min(31)) - 1
}

/// Whether bytes begin with an intact datagram of version 2 of any length, with or without the length that precedes it
/// on a stream.
#[must_use]
pub fn begins(bytes: &[u8]) -> bool {
    let is_datagram = |bytes: &[u8]| {
        bytes.first() == Some(&MAGIC)
            && (HEADER_BYTES + TRAILER_BYTES..=DATAGRAM_BYTES.min(bytes.len()))
                .any(|length| DatagramHeader::read(&bytes[..length]).is_ok())
    };
    is_datagram(bytes) || bytes.get(2..).is_some_and(is_datagram)
}

/// The stride of an array: the fewest bits that can name each of its rows.
#[must_use]
pub fn stride(rows: u16) -> u8 {
    (u16::BITS - rows.saturating_sub(1).leading_zeros()) as u8
}

/// The stride of an array, checked against what a board can have.
///
/// # Errors
///
/// `Problem` if the array's positions need more than 16 bits.
pub fn checked_stride(array: &Array) -> crate::Result<u8> {
    let stride = stride(array.rows);
    if u32::from(array.columns) << stride > 1 << 16 {
        let (rows, columns) = (array.rows, array.columns);
        return Err(problem!(
            "array of {rows} x {columns} taxels: has more than 65536 positions (columns times rows, with rows rounded \
             up to a power of 2)"
        ));
    }
    Ok(stride)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_comes_back_and_any_flipped_bit_is_seen() {
        let header = DatagramHeader {
            kind: 1,
            board: 0xbeef,
            sequence: 0xfedc_ba98,
            base: 0x1234_5678_9abc,
            session: 0x4321,
            stride: 17,
            line: 101,
            flags: 5,
            span: 192,
        };
        let bytes = header.datagram(&[1, 2, 3, 4]);
        assert_eq!(DatagramHeader::read(&bytes), Ok((header, &[1, 2, 3, 4][..])));
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(DatagramHeader::read(&flipped).is_err(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(DatagramHeader::read(&bytes[..length]).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn the_stride_names_each_row() {
        let strides: Vec<u8> =
            [1, 2, 3, 63, 64, 65, 128, 129, 256, u16::MAX].iter().map(|&rows| stride(rows)).collect();
        assert_eq!(strides, [0, 1, 2, 6, 6, 7, 7, 8, 8, 16]);
    }
}

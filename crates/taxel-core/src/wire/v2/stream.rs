//! Datagrams in files and on streams, each preceded by its length; a reader resynchronises after damage.

use super::counts::Counts;
use super::decoder::{Decoder, most_rows};
use super::{DATAGRAM_BYTES, DatagramHeader, HEADER_BYTES, LENGTH_BYTES, TRAILER_BYTES};
use crate::wire::columns::Columns;
use crate::{Array, Result, Stop};

/// Cuts a stream into datagrams. Bytes that belong to none are skipped and counted, up to the next place where length,
/// magic byte and checksum are valid.
#[derive(Debug, Clone, Default)]
pub struct StreamReader {
    /// Bytes that may still become part of a datagram.
    rest: Vec<u8>,
    skipped: u64,
}

impl StreamReader {
    /// Consumes the next bytes; passes each whole datagram to `take`.
    pub fn push(&mut self, bytes: &[u8], mut take: impl FnMut(&[u8])) {
        self.rest.extend_from_slice(bytes);
        let done = cut(&self.rest, false, &mut self.skipped, &mut take);
        self.rest.drain(..done);
    }

    /// Number of bytes that belonged to no datagram so far, without those that may still become part of one.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Ends the stream: the remaining bytes are not a datagram, but a whole datagram within them is passed to `take`.
    pub fn finish(&mut self, mut take: impl FnMut(&[u8])) {
        cut(&self.rest, true, &mut self.skipped, &mut take);
        self.rest.clear();
    }
}

/// Passes each whole datagram that begins in `bytes` to `take`; returns the number of bytes consumed: all of them if
/// the stream ends there.
fn cut(bytes: &[u8], ends: bool, skipped: &mut u64, mut take: impl FnMut(&[u8])) -> usize {
    let mut at = 0;
    while let Some(rest) = bytes.get(at..).filter(|rest| rest.len() >= LENGTH_BYTES + 2) {
        let length = usize::from(u16::from_le_bytes([rest[0], rest[1]]));
        let likely = (HEADER_BYTES + TRAILER_BYTES..=DATAGRAM_BYTES).contains(&length)
            && DatagramHeader::likely(&rest[LENGTH_BYTES..]);
        if likely {
            let datagram = rest.get(LENGTH_BYTES..LENGTH_BYTES + length);
            if datagram.is_none() && !ends {
                return at;
            }
            if let Some(datagram) = datagram.filter(|bytes| DatagramHeader::check(bytes).is_ok()) {
                take(datagram);
                at += LENGTH_BYTES + length;
                continue;
            }
        }
        at += 1;
        *skipped += 1;
    }
    if ends {
        *skipped += (bytes.len() - at) as u64;
        at = bytes.len();
    }
    at
}

/// Decodes a whole stream of one board's datagrams into columns that the caller allocated. Returns the counts of what was
/// received and missed, and the number of bytes that belonged to no datagram.
///
/// # Errors
///
/// `Problem` if the columns have less room than [`most_rows`] requires, in which case nothing is read; `Interrupted` if
/// asked to stop.
pub fn decode(bytes: &[u8], array: Array, columns: &mut Columns<'_>, stop: Stop<'_>) -> Result<(Counts, u64)> {
    /// Bytes between two checks of `stop`: some milliseconds of work, and more than a datagram.
    const PIECE: usize = 1 << 20;
    columns.check_room(bytes.len(), most_rows(bytes.len()))?;
    let (mut decoder, mut skipped, mut rest) = (Decoder::new(array), 0, bytes);
    while !rest.is_empty() {
        stop.check()?;
        let piece = &rest[..rest.len().min(PIECE)];
        let done = cut(piece, piece.len() == rest.len(), &mut skipped, |datagram| {
            decoder.receive_intact(datagram, None, columns);
        });
        rest = &rest[done..];
    }
    Ok((decoder.counts(), skipped))
}

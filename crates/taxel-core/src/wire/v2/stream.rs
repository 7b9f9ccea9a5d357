//! Datagrams in files and on streams, each preceded by its length; a reader resynchronises after damage.

use super::counts::Counts;
use super::decoder::{Decoder, check_room, stream_rows};
use super::{DATAGRAM_BYTES, DatagramHeader, HEADER_BYTES, LENGTH_BYTES, TRAILER_BYTES};
use crate::wire::columns::{Columns, Laid, Room};
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

/// The destination of a stream's datagrams.
trait DatagramSink {
    /// Consumes any number of the datagrams ahead; returns the number of their bytes, with their lengths.
    fn run(&mut self, ahead: &[u8]) -> usize;

    /// Consumes one intact datagram.
    fn take(&mut self, datagram: &[u8], header: &DatagramHeader, body: &[u8]);
}

impl<F: FnMut(&[u8])> DatagramSink for F {
    fn run(&mut self, _: &[u8]) -> usize {
        0
    }

    fn take(&mut self, datagram: &[u8], _: &DatagramHeader, _: &[u8]) {
        self(datagram);
    }
}

/// Passes each whole datagram that begins in `bytes` to a sink; returns the number of bytes consumed: all of them if
/// the stream ends there.
fn cut(bytes: &[u8], ends: bool, skipped: &mut u64, sink: &mut impl DatagramSink) -> usize {
    let mut at = 0;
    loop {
        at += sink.run(&bytes[at..]);
        let Some(rest) = bytes.get(at..).filter(|rest| rest.len() >= LENGTH_BYTES + 2) else { break };
        let length = usize::from(u16::from_le_bytes([rest[0], rest[1]]));
        let likely = (HEADER_BYTES + TRAILER_BYTES..=DATAGRAM_BYTES).contains(&length)
            && DatagramHeader::likely(&rest[LENGTH_BYTES..]);
        if likely {
            let datagram = rest.get(LENGTH_BYTES..LENGTH_BYTES + length);
            if datagram.is_none() && !ends {
                return at;
            }
            if let Some((datagram, (header, body))) =
                datagram.and_then(|bytes| Some((bytes, DatagramHeader::read(bytes).ok()?)))
            {
                sink.take(datagram, &header, body);
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

/// The result of decoding a whole stream, apart from the rows themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DecodedStream {
    /// Description of the filled columns.
    pub columns: Columns,
    /// Counts of what was received and missed.
    pub counts: Counts,
    /// Number of bytes that belonged to no datagram.
    pub skipped: u64,
}

/// Splits consecutive datagrams, each preceded by its length.
fn ahead(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    std::iter::from_fn(move || {
        let (length, rest) = bytes.split_first_chunk::<LENGTH_BYTES>()?;
        let (datagram, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
        bytes = rest;
        Some(datagram)
    })
}

/// A decoder, and the columns that it fills.
struct StreamDecoder<'a>(Decoder, Laid<'a>);

impl DatagramSink for StreamDecoder<'_> {
    fn run(&mut self, bytes: &[u8]) -> usize {
        let taken = self.0.plain(ahead(bytes), stream_rows(bytes.len()), &mut self.1);
        taken.bytes + LENGTH_BYTES * taken.datagrams
    }

    fn take(&mut self, datagram: &[u8], header: &DatagramHeader, body: &[u8]) {
        self.0.push_read(datagram, header, body, None, &mut self.1);
    }
}

/// Decodes a whole stream of one board's datagrams into columns that the caller allocated, from their first row on.
///
/// # Errors
///
/// `Problem` if a column has fewer entries than [`stream_rows`] returns, in which case nothing is read; `Interrupted`
/// if asked to stop.
pub fn decode(bytes: &[u8], array: Array, room: Room<'_>, stop: Stop<'_>) -> Result<DecodedStream> {
    /// Bytes between two checks of `stop`: some milliseconds of work, and more than a datagram.
    const PIECE: usize = 1 << 20;
    let laid = Laid::new(check_room(room, bytes.len())?);
    let (mut filling, mut skipped, mut rest) = (StreamDecoder(Decoder::new(array), laid), 0, bytes);
    while !rest.is_empty() {
        stop.check()?;
        let piece = &rest[..rest.len().min(PIECE)];
        let done = cut(piece, piece.len() == rest.len(), &mut skipped, &mut filling);
        rest = &rest[done..];
    }
    let StreamDecoder(decoder, laid) = filling;
    Ok(DecodedStream { columns: laid.end(), counts: decoder.counts(), skipped })
}

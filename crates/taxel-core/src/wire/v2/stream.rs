//! Datagrams in files and on streams, each behind its length: cut anywhere, and found again after damage.

use super::counts::Counts;
use super::decoder::{Decoder, check_room, stream_rows};
use super::{DATAGRAM_BYTES, HEADER_BYTES, Header, LENGTH_BYTES, TRAILER_BYTES};
use crate::wire::columns::{Columns, Laid, Room};
use crate::{Array, Result, Stop};

/// Cuts a stream into datagrams. What is none is skipped byte by byte and counted, to the next place where length, magic and
/// checksum agree.
#[derive(Debug, Clone, Default)]
pub struct StreamReader {
    /// What may still become a datagram.
    rest: Vec<u8>,
    skipped: u64,
}

impl StreamReader {
    /// Takes the next bytes; gives each whole datagram to `take`.
    pub fn push(&mut self, bytes: &[u8], mut take: impl FnMut(&[u8])) {
        self.rest.extend_from_slice(bytes);
        let done = cut(&self.rest, false, &mut self.skipped, &mut take);
        self.rest.drain(..done);
    }

    /// Bytes that belonged to no datagram so far; those that may still become one are not counted.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Ends the stream: what waited for more is no datagram, but one that lies within it is given to `take`.
    pub fn finish(&mut self, mut take: impl FnMut(&[u8])) {
        cut(&self.rest, true, &mut self.skipped, &mut take);
        self.rest.clear();
    }
}

/// Where the datagrams of a stream go.
trait Sink {
    /// Takes those that lie ahead, as many as it likes; gives how many bytes they have, with their lengths.
    fn run(&mut self, ahead: &[u8]) -> usize;

    /// Takes one that was found intact.
    fn take(&mut self, datagram: &[u8], header: &Header, body: &[u8]);
}

impl<F: FnMut(&[u8])> Sink for F {
    fn run(&mut self, _: &[u8]) -> usize {
        0
    }

    fn take(&mut self, datagram: &[u8], _: &Header, _: &[u8]) {
        self(datagram);
    }
}

/// Gives each whole datagram that begins in `bytes` to a sink; gives how many bytes are done with: all of them where the
/// stream ends there.
fn cut(bytes: &[u8], ends: bool, skipped: &mut u64, sink: &mut impl Sink) -> usize {
    let mut at = 0;
    loop {
        at += sink.run(&bytes[at..]);
        let Some(rest) = bytes.get(at..).filter(|rest| rest.len() >= LENGTH_BYTES + 2) else { break };
        let length = usize::from(u16::from_le_bytes([rest[0], rest[1]]));
        let likely =
            (HEADER_BYTES + TRAILER_BYTES..=DATAGRAM_BYTES).contains(&length) && Header::likely(&rest[LENGTH_BYTES..]);
        if likely {
            let whole = rest.get(LENGTH_BYTES..LENGTH_BYTES + length);
            if whole.is_none() && !ends {
                return at;
            }
            if let Some((datagram, (header, body))) = whole.and_then(|bytes| Some((bytes, Header::read(bytes).ok()?))) {
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

/// What a whole stream held, but for the rows themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decoded {
    /// What the columns hold.
    pub columns: Columns,
    /// What was received and missed.
    pub counts: Counts,
    /// Bytes that belonged to no datagram.
    pub skipped: u64,
}

/// What lies one behind the other, each behind its length.
fn ahead(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    std::iter::from_fn(move || {
        let (length, rest) = bytes.split_first_chunk::<LENGTH_BYTES>()?;
        let (datagram, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
        bytes = rest;
        Some(datagram)
    })
}

/// A decoder and the columns that it fills.
struct Filling<'a>(Decoder, Laid<'a>);

impl Sink for Filling<'_> {
    fn run(&mut self, bytes: &[u8]) -> usize {
        let taken = self.0.plain(ahead(bytes), stream_rows(bytes.len()), &mut self.1);
        taken.bytes + LENGTH_BYTES * taken.datagrams
    }

    fn take(&mut self, _: &[u8], header: &Header, body: &[u8]) {
        self.0.push_read(header, body, None, &mut self.1);
    }
}

/// Decodes a whole stream of one board's datagrams into columns that the caller laid out, from their first row on.
///
/// # Errors
///
/// `Problem` where a column has fewer entries than [`stream_rows`] asks for, and nothing was read; `Interrupted` where asked to
/// stop.
pub fn decode(bytes: &[u8], array: Array, room: Room<'_>, stop: Stop<'_>) -> Result<Decoded> {
    /// Bytes between two looks at `stop`: some milliseconds of work, and more than a datagram.
    const PIECE: usize = 1 << 20;
    let laid = Laid::new(check_room(room, bytes.len())?);
    let (mut filling, mut skipped, mut rest) = (Filling(Decoder::new(array), laid), 0, bytes);
    while !rest.is_empty() {
        stop.check()?;
        let piece = &rest[..rest.len().min(PIECE)];
        let done = cut(piece, piece.len() == rest.len(), &mut skipped, &mut filling);
        rest = &rest[done..];
    }
    let Filling(decoder, laid) = filling;
    Ok(Decoded { columns: laid.end(), counts: decoder.counts(), skipped })
}

//! Datagrams in files and on streams, each behind its length: cut anywhere, and found again after damage.

use super::{DATAGRAM_BYTES, HEADER_BYTES, Header, MAGIC, TRAILER_BYTES};

/// Bytes of a length.
const LENGTH_BYTES: usize = 2;

/// Cuts a stream into datagrams. What is none is skipped byte by byte and counted, to the next place where length, magic and
/// checksum agree.
#[derive(Debug, Clone, Default)]
pub struct StreamReader {
    bytes: Vec<u8>,
    skipped: u64,
}

impl StreamReader {
    /// Takes the next bytes; gives each whole datagram to `take`, with its header and body.
    pub fn push(&mut self, bytes: &[u8], mut take: impl FnMut(&[u8], &Header, &[u8])) {
        self.bytes.extend_from_slice(bytes);
        let mut at = 0;
        while let Some(rest) = self.bytes.get(at..).filter(|rest| rest.len() >= LENGTH_BYTES + 2) {
            let length = usize::from(u16::from_le_bytes([rest[0], rest[1]]));
            let likely = (HEADER_BYTES + TRAILER_BYTES..=DATAGRAM_BYTES).contains(&length)
                && rest[LENGTH_BYTES] == MAGIC
                && rest[LENGTH_BYTES + 1] >> 4 == 2;
            if likely {
                let Some(datagram) = rest.get(LENGTH_BYTES..LENGTH_BYTES + length) else { break };
                if let Ok((header, body)) = Header::read(datagram) {
                    take(datagram, &header, body);
                    at += LENGTH_BYTES + length;
                    continue;
                }
            }
            at += 1;
            self.skipped += 1;
        }
        self.bytes.drain(..at);
    }

    /// Bytes that belonged to no datagram so far; those that may still become one are not counted.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Ends the stream: what is left counts as skipped too.
    pub fn finish(&mut self) {
        self.skipped += self.bytes.len() as u64;
        self.bytes.clear();
    }
}

//! Limits of a recording in the live format. They are checked before memory is allocated, named in the error or the
//! verdict; docs/files.md lists those that users meet. In a damaged file a few bytes can claim a size of 2^64.

use std::path::Path;

use mcap::records::op;

use crate::{Error, Result};

/// Largest unpacked size of a chunk, bytes: 64 MiB. Our chunks have 1 MiB, those of other tools 1 to 8.
pub(super) const CHUNK: u32 = 1 << 26;

/// Bytes in memory of a byte of JSON that is read into objects, about.
pub(super) const OBJECTS: usize = 16;

/// Largest metadata record, bytes.
pub(super) const METADATA: u64 = 1 << 24;

/// Largest number of sources in a file.
pub(super) const SOURCES: usize = 64;

/// Largest number of taxels in a sensor: 2048 x 2048.
pub(super) const TAXELS: usize = 1 << 22;

/// Largest distance from 0 at which a converted file's time may begin, us: 142 years, so that ns fit in 64 bits too.
pub(super) const TIME_US: i64 = 1 << 52;

/// Refuses more bytes than there is memory for.
pub(super) fn in_memory(path: &Path, subject: &str, size: u64, most: u64) -> Result<()> {
    if size > most {
        let sizes = format!("{subject}: would take {size} bytes of memory or more; {most} are available");
        return Err(Error::format(path, &sizes));
    }
    Ok(())
}

/// Whether the strings in a channel or metadata record end within it: the parser allocates their memory before it
/// checks.
pub(super) fn texts_fit(opcode: u8, data: &[u8]) -> bool {
    fn text(data: &[u8]) -> Option<&[u8]> {
        let (length, rest) = data.split_first_chunk::<4>()?;
        rest.get(u32::from_le_bytes(*length) as usize..)
    }
    /// A table of strings by name, whose size in bytes precedes it.
    fn table(data: &[u8]) -> Option<()> {
        let (length, rest) = data.split_first_chunk::<4>()?;
        let mut pairs = rest.get(..u32::from_le_bytes(*length) as usize)?;
        while !pairs.is_empty() {
            pairs = text(text(pairs)?)?;
        }
        Some(())
    }
    match opcode {
        // Two 16-bit numbers, topic, encoding, table.
        op::CHANNEL => data.get(4..).and_then(text).and_then(text).and_then(table).is_some(),
        // Name, table.
        op::METADATA => text(data).and_then(table).is_some(),
        _ => true,
    }
}

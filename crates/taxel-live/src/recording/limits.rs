//! Limits of a recording in the live format. They are checked before memory is allocated, named in the error or the
//! verdict; docs/files.md lists those that users meet. A file may come from an untrusted source or a damaged disk, and a few
//! bytes can claim a size of 2^64.

use std::path::Path;

use mcap::records::op;

use taxel_core::Hint;

use crate::{Error, Result};

/// Largest size of what is read of a file into memory where the caller says no other, bytes: 4 GiB.
pub(super) const MEMORY: u64 = 1 << 32;

/// Largest unpacked size of a chunk, bytes: 64 MiB. Our chunks have 1 MiB, those of other tools 1 to 8.
pub(super) const CHUNK: u32 = 1 << 26;

/// Bytes in memory of a byte of JSON that is read into objects, about.
pub(super) const OBJECTS: usize = 16;

/// Largest metadata record, bytes.
pub(super) const METADATA: u64 = 1 << 24;

/// Largest number of sources in a file.
pub(super) const SOURCES: usize = 64;

/// Largest number of columns in a stream of numbers.
pub(super) const COLUMNS: usize = 1024;

/// Largest number of taxels in a sensor: 2048 x 2048.
pub(super) const TAXELS: usize = 1 << 22;

/// Largest distance from 0 at which a converted file's time may begin, us: 142 years, so that ns fit in 64 bits too.
pub(super) const TIME_US: i64 = 1 << 52;

/// Largest unpacked size of all chunks of a file of `length` bytes together, of which `memory` bytes may be read.
///
/// Frames of a board at rest compress by a factor of a few hundred; a factor of a thousand indicates a decompression
/// bomb, unless all of it fits into the memory: large frames without a touch compress by a factor of ten thousand.
pub(super) fn most_unpacked(length: u64, memory: u64) -> u64 {
    length.saturating_mul(1000).saturating_add(1 << 28).max(memory)
}

/// Largest total size of the datagrams in a file of `length` bytes.
///
/// Each datagram has 47 bytes of overhead that are not compressed, so a valid file's datagrams stay far below a hundred
/// times its length.
pub(super) fn datagrams(length: u64) -> u64 {
    length.saturating_mul(100).saturating_add(1 << 26)
}

/// The error of more bytes than are read unless the caller allows them.
pub(super) fn too_large(path: &Path, text: &str) -> Error {
    taxel_core::Error::format(text).at(taxel_core::Place::file(path)).with_hint("limit", Hint::Larger).into()
}

/// Refuses more bytes in memory than a caller allows.
pub(super) fn in_memory(path: &Path, subject: &str, size: u64, most: u64) -> Result<()> {
    if size > most {
        return Err(too_large(
            path,
            &format!("{subject} of {size} bytes or more when unpacked; at most {most} are read"),
        ));
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

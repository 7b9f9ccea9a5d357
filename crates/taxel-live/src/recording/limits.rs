//! What a recording of the live format may hold at most: asked before memory is asked for, named in the error or the
//! verdict, documented in docs/files.md. A file comes from strangers or from a damaged disk, and a few bytes can claim 2^64.

/// What one chunk may unpack to: 64 MiB. Ours are of 1 MiB, other tools' of 1 to 8.
pub(super) const CHUNK: u32 = 1 << 26;

/// Of a metadata record.
pub(super) const METADATA: u64 = 1 << 24;

/// Sources of a file.
pub(super) const SOURCES: usize = 64;

/// Columns of a stream of numbers.
pub(super) const COLUMNS: usize = 1024;

/// Taxels of a sensor: 2048 x 2048.
pub(super) const TAXELS: usize = 1 << 22;

/// How far from 0 a converted file's time may begin, us: 142 years, so that ns in 64 bits hold it too.
pub(super) const TIME_US: i64 = 1 << 52;

/// What all chunks of a file of `length` bytes may unpack to together.
///
/// Pictures of a board at rest pack by a few hundred; a thousand is a trap.
pub(super) fn unpacked(length: u64) -> u64 {
    length.saturating_mul(1000).saturating_add(1 << 28)
}

/// What its datagrams may hold, which become events in memory.
///
/// Each has 47 bytes beside it that are not packed, so that no sound file comes near a hundred times its own length.
pub(super) fn datagrams(length: u64) -> u64 {
    length.saturating_mul(100).saturating_add(1 << 26)
}

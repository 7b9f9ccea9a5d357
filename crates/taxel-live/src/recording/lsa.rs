//! The manual's raw recordings (Appendix 1, section 3): `NAME.lsa` contains all bytes as they arrived and nothing else,
//! an empty `NAME.lss` marks it as complete.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use taxel_core::wire::{self, Decoder};
use taxel_core::{Array, Events, Stop};

use super::limits;
use crate::{Error, Result, system_error};

/// Writes raw bytes as a new, complete `.lsa`: once all bytes are on the disk, its empty `.lss` is created.
///
/// # Errors
///
/// `File` if one of the two files exists, or the disk is full or not available.
pub fn write_lsa(path: &Path, bytes: &[u8]) -> Result<()> {
    let marker = completion_marker(path);
    if marker.exists() {
        return Err(Error::file(&marker)(system_error::exists()));
    }
    let write = || {
        let mut file = File::create_new(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(Error::file(path))?;
    File::create(&marker).map(drop).map_err(Error::file(&marker))
}

/// A `.lsa` that was read and decoded.
#[derive(Debug, Clone)]
pub struct DecodedLsa {
    /// The bytes of the file.
    pub bytes: Vec<u8>,
    /// The decoded events.
    pub events: Events,
    /// Counts of the decoder.
    pub counts: wire::Counts,
    /// Whether its `.lss` marks it as complete.
    pub complete: bool,
}

/// Reads and decodes a `.lsa`.
///
/// # Errors
///
/// `File` if it cannot be read; `Core` (format) if it contains datagrams of version 2, or makes more than `memory` bytes;
/// `Core(Interrupted)` if asked to
/// stop.
pub fn decode_lsa(path: &Path, array: Array, differences: bool, memory: u64, stop: Stop<'_>) -> Result<DecodedLsa> {
    /// Bytes between two checks of `stop`.
    const PIECE: usize = 1 << 22;
    let (mut bytes, file) = (vec![], File::open(path).map_err(Error::file(path))?);
    let length = file.metadata().map_err(Error::file(path))?.len();
    limits::in_memory(path, "raw data", length, memory)?;
    file.take(length).read_to_end(&mut bytes).map_err(Error::file(path))?;
    if wire::v2::begins(&bytes) {
        let reason = "begins with a datagram of wire version 2; a .lsa file contains only version 1";
        return Err(Error::format(path, &format!("{reason}: record version 2 to a .mcap file")));
    }
    let mut decoder = Decoder::new(array.clone()).differences(differences);
    let mut events = Events::empty(array);
    for piece in bytes.chunks(PIECE) {
        stop.check()?;
        decoder.push(piece, None, &mut events);
        limits::in_memory(path, "events", length + events.size() as u64, memory)?;
    }
    decoder.finish(&mut events);
    Ok(DecodedLsa { bytes, events, counts: *decoder.counts(), complete: completion_marker(path).exists() })
}

/// The path of the `.lss` of a `.lsa`.
fn completion_marker(path: &Path) -> PathBuf {
    path.with_extension("lss")
}

//! The manual's raw recordings (Appendix 1, section 3): `NAME.lsa` contains all bytes as they arrived and nothing else,
//! an empty `NAME.lss` marks it as complete. The manual's program overwrites files without a warning; this one refuses.

use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use taxel_core::wire::{self, Decoder};
use taxel_core::{Array, Events, Stop};

use super::{OutputFile, limits};
use crate::{Error, Result, system_error};

/// Writes a `.lsa`. Its `.lss` is created by [`LsaWriter::finish`] only.
#[derive(Debug)]
pub struct LsaWriter {
    out: BufWriter<RawFile>,
}

/// The file, written through a buffer.
#[derive(Debug)]
struct RawFile(OutputFile);

impl Write for RawFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.file().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.file().flush()
    }
}

impl LsaWriter {
    /// Begins a file.
    ///
    /// # Errors
    ///
    /// As [`OutputFile::open`]; `File` if its `.lss` exists (and `overwrite` is not set).
    pub fn create(path: &Path, overwrite: bool) -> Result<Self> {
        Self::begin(Self::reserve(path, overwrite)?)
    }

    /// Opens and locks the file without changing it.
    ///
    /// # Errors
    ///
    /// As [`LsaWriter::create`].
    pub(crate) fn reserve(path: &Path, overwrite: bool) -> Result<OutputFile> {
        let marker = completion_marker(path);
        if !overwrite && marker.exists() {
            return Err(Error::file(&marker)(system_error::exists()));
        }
        OutputFile::open(path, overwrite)
    }

    /// Starts to write a reserved file.
    ///
    /// # Errors
    ///
    /// `File` if the file, or an earlier `.lss`, cannot be replaced.
    pub(crate) fn begin(file: OutputFile) -> Result<Self> {
        file.begin()?;
        let marker = completion_marker(file.path());
        match std::fs::remove_file(&marker) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(Error::file(&marker)(error)),
            _ => {}
        }
        Ok(Self { out: BufWriter::new(RawFile(file)) })
    }

    fn path(&self) -> &Path {
        self.out.get_ref().0.path()
    }

    /// Appends the next bytes.
    ///
    /// # Errors
    ///
    /// `File` if the disk is full or not available.
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        let outcome = self.out.write_all(bytes);
        outcome.map_err(|error| Error::file(self.path())(error))
    }

    /// Passes buffered bytes to the operating system; to be called about every 100 ms.
    ///
    /// # Errors
    ///
    /// `File` if the disk is full or not available.
    pub fn flush(&mut self) -> Result<()> {
        let outcome = self.out.flush();
        outcome.map_err(|error| Error::file(self.path())(error))
    }

    /// Ends a recording that is incomplete: all bytes are on the disk, without an `.lss`.
    ///
    /// # Errors
    ///
    /// `File` if the disk is full or not available.
    pub fn end(&mut self) -> Result<()> {
        self.flush()?;
        let file = &self.out.get_ref().0;
        file.file().sync_all().map_err(Error::file(file.path()))
    }

    /// Marks the recording as complete: syncs all bytes to the disk, then creates the empty `.lss`.
    ///
    /// # Errors
    ///
    /// As [`LsaWriter::end`]; no `.lss` is created then.
    pub fn finish(mut self) -> Result<()> {
        self.end()?;
        let marker = completion_marker(self.path());
        File::create(&marker).map(drop).map_err(Error::file(&marker))
    }

    /// Ends an empty recording: removes a new file.
    ///
    /// # Errors
    ///
    /// `File` if the file cannot be removed.
    pub(crate) fn discard(self) -> Result<()> {
        let (file, _) = self.out.into_parts();
        file.0.discard()
    }
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

/// The name of a recording in automatic mode: an index is appended to the name, before the extension.
#[must_use]
pub fn numbered(path: &Path, index: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(index.to_string());
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The path of the `.lss` of a `.lsa`.
fn completion_marker(path: &Path) -> PathBuf {
    path.with_extension("lss")
}

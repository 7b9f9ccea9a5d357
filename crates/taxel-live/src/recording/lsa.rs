//! The manual's raw recordings (Appendix 1, section 3): `NAME.lsa` holds all bytes as they came and nothing else, an empty
//! `NAME.lss` says that it is complete. The manual's program overwrites without a warning; this one refuses.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use taxel_core::wire::{self, Decoder, Pairing};
use taxel_core::{Array, Events, Stop};

use super::create;
use crate::{Error, Result};

/// A `.lsa` being written. Its `.lss` appears with [`LsaWriter::finish`], and only then.
#[derive(Debug)]
pub struct LsaWriter {
    path: PathBuf,
    overwrite: bool,
    out: BufWriter<File>,
}

impl LsaWriter {
    /// Begins a file.
    ///
    /// # Errors
    ///
    /// `File` where the `.lsa` or its `.lss` exists (and `overwrite` is not set), or the file cannot be created.
    pub fn create(path: &Path, overwrite: bool) -> Result<Self> {
        let done = done(path);
        if !overwrite && done.exists() {
            return Err(Error::file(&done)(std::io::Error::from_raw_os_error(libc::EEXIST)));
        }
        let out = BufWriter::new(create(path, overwrite)?);
        if overwrite {
            match std::fs::remove_file(&done) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(Error::file(&done)(error)),
                _ => {}
            }
        }
        Ok(Self { path: path.to_owned(), overwrite, out })
    }

    /// Keeps the next bytes.
    ///
    /// # Errors
    ///
    /// `File` where the disk is full or gone.
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).map_err(Error::file(&self.path))
    }

    /// Hands over to the operating system what still waits in memory; call it each 100 ms or so.
    ///
    /// # Errors
    ///
    /// `File` where the disk is full or gone.
    pub fn flush(&mut self) -> Result<()> {
        self.out.flush().map_err(Error::file(&self.path))
    }

    /// Says that the recording is complete: all bytes are on the disk, then the empty `.lss` appears.
    ///
    /// # Errors
    ///
    /// `File` where the disk is full or gone; there is no `.lss` then.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        self.out.get_ref().sync_all().map_err(Error::file(&self.path))?;
        create(&done(&self.path), self.overwrite).map(drop)
    }
}

/// A `.lsa`, read and decoded.
#[derive(Debug, Clone)]
pub struct DecodedLsa {
    /// As they came.
    pub bytes: Vec<u8>,
    /// What changed, when.
    pub events: Events,
    /// What the decoder saw and dropped.
    pub counts: wire::Counts,
    /// Whether its `.lss` says that it is complete.
    pub complete: bool,
}

/// Reads a `.lsa` and decodes it.
///
/// # Errors
///
/// `File` where it cannot be read; `Core` (format) where it holds datagrams of version 2; `Core(Interrupted)` where asked to
/// stop.
pub fn decode_lsa(
    path: &Path,
    array: Array,
    pairing: Pairing,
    differences: bool,
    stop: Stop<'_>,
) -> Result<DecodedLsa> {
    /// Bytes between two looks at `stop`.
    const PIECE: usize = 1 << 22;
    let bytes = std::fs::read(path).map_err(Error::file(path))?;
    if wire::v2::begins(&bytes) {
        let name = path.display();
        let said = "begins with a datagram of wire version 2; a .lsa holds version 1";
        return Err(taxel_core::Error::Format(format!("{name}: {said}: record version 2 to a .mcap file")).into());
    }
    let mut decoder = Decoder::new(array.clone()).pairing(pairing).differences(differences);
    let mut events = Events::empty(array);
    for piece in bytes.chunks(PIECE) {
        stop.check()?;
        decoder.push_into(piece, None, &mut events);
    }
    decoder.finish_into(&mut events);
    Ok(DecodedLsa { bytes, events, counts: *decoder.counts(), complete: done(path).exists() })
}

/// The name of a recording in automatic mode: the index appended to the name, before the extension.
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

/// Where the `.lss` of a `.lsa` stands.
fn done(path: &Path) -> PathBuf {
    path.with_extension("lss")
}

//! Changes in a temporary file, block by block, each with the extents of the taxels.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use taxel_core::{Place, problem};
use taxel_live::pipeline::TaxelChange;
use taxel_live::read_at::read_exact_at;
use taxel_live::{Error, Result};

/// The least, the greatest and the last value of a taxel among changes; the last is [`UNKNOWN`] where it has none.
///
/// [`UNKNOWN`]: taxel_core::held::UNKNOWN
pub(super) type TaxelExtent = [u16; 3];

/// Bytes of a change, in memory and in the file.
pub(super) const BYTES: usize = size_of::<TaxelChange>();

/// `FILE_FLAG_DELETE_ON_CLOSE` of Windows.
#[cfg(windows)]
const DELETE_ON_CLOSE: u32 = 0x0400_0000;

/// A temporary file of changes.
#[derive(Debug)]
pub(super) struct ChangeFile {
    file: File,
    folder: PathBuf,
    /// Number of bytes in it.
    written: u64,
}

impl ChangeFile {
    /// An empty file in this folder or, where that cannot be written, in that of the system.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where no file can be made.
    pub(super) fn new(folder: &Path) -> Result<Self> {
        let of_system = std::env::temp_dir();
        let made = unnamed_file(folder).map(|file| (file, folder.to_owned()));
        let (file, folder) = made
            .or_else(|_| unnamed_file(&of_system).map(|file| (file, of_system.clone())))
            .map_err(|error| no_room(&of_system, 0, &error))?;
        Ok(Self { file, folder, written: 0 })
    }

    /// Appends the changes of a block, and then its extents; returns where it begins.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where there is no room.
    pub(super) fn push(&mut self, changes: &[TaxelChange], extents: &[TaxelExtent]) -> Result<u64> {
        let mut bytes: Vec<u8> = changes.iter().flat_map(to_bytes).collect();
        bytes.extend(extents.iter().flatten().flat_map(|value| value.to_le_bytes()));
        let begin = self.written;
        self.written += bytes.len() as u64;
        self.file.write_all(&bytes).map_err(|error| no_room(&self.folder, self.written, &error))?;
        Ok(begin)
    }

    /// The changes of a block that begins there.
    ///
    /// # Errors
    ///
    /// `File` where it cannot be read.
    pub(super) fn changes(&self, begin: u64, count: usize) -> Result<Vec<TaxelChange>> {
        let mut bytes = vec![0; count * BYTES];
        read_exact_at(&self.file, &mut bytes, begin).map_err(Error::file(&self.folder))?;
        Ok(bytes.as_chunks().0.iter().map(of_bytes).collect())
    }

    /// The extent of a taxel in a block of so many changes that begins there.
    ///
    /// # Errors
    ///
    /// `File` where it cannot be read.
    pub(super) fn extent(&self, begin: u64, count: usize, taxel: usize) -> Result<TaxelExtent> {
        let (mut bytes, at) = ([0; size_of::<TaxelExtent>()], count * BYTES + taxel * size_of::<TaxelExtent>());
        read_exact_at(&self.file, &mut bytes, begin + at as u64).map_err(Error::file(&self.folder))?;
        let [a, b, c, d, e, f] = bytes;
        Ok([[a, b], [c, d], [e, f]].map(u16::from_le_bytes))
    }
}

fn no_room(folder: &Path, bytes: u64, error: &io::Error) -> Error {
    let size = problem!("has no room for a temporary file of {bytes} bytes or more, which the view needs: {error}");
    size.at(Place::file(folder)).into()
}

/// A new file in a folder, which is gone as soon as it is closed.
fn unnamed_file(folder: &Path) -> io::Result<File> {
    static MADE: AtomicU64 = AtomicU64::new(0);
    let name = format!(".taxel-view-{}-{}", std::process::id(), MADE.fetch_add(1, Ordering::Relaxed));
    let mut options = File::options();
    options.read(true).write(true).create_new(true);
    #[cfg(windows)]
    std::os::windows::fs::OpenOptionsExt::custom_flags(&mut options, DELETE_ON_CLOSE);
    let file = options.open(folder.join(&name))?;
    #[cfg(unix)]
    std::fs::remove_file(folder.join(&name))?;
    Ok(file)
}

fn to_bytes(change: &TaxelChange) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    bytes[..8].copy_from_slice(&change.t.to_le_bytes());
    bytes[8..12].copy_from_slice(&change.taxel.to_le_bytes());
    bytes[12..14].copy_from_slice(&change.ticks.to_le_bytes());
    (bytes[14], bytes[15]) = (change.up.into(), change.repaired.into());
    bytes
}

fn of_bytes(bytes: &[u8; BYTES]) -> TaxelChange {
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, up, repaired] = *bytes;
    TaxelChange {
        t: i64::from_le_bytes([a, b, c, d, e, f, g, h]),
        taxel: u32::from_le_bytes([i, j, k, l]),
        ticks: u16::from_le_bytes([m, n]),
        up: up != 0,
        repaired: repaired != 0,
    }
}

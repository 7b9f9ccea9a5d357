//! The changes of a recording in blocks: in memory, or of a long recording in a temporary file.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use taxel_core::{Place, problem};
use taxel_live::pipeline::TaxelChange;
use taxel_live::read_at::read_exact_at;
use taxel_live::{Error, Result};

/// Bytes of a change, in memory and in the file.
const BYTES: usize = size_of::<TaxelChange>();

/// `FILE_FLAG_DELETE_ON_CLOSE` of Windows.
#[cfg(windows)]
const DELETE_ON_CLOSE: u32 = 0x0400_0000;

/// Blocks of changes.
#[derive(Debug)]
pub(super) struct ChangeBlocks {
    /// Number of changes before each block, and before the next one.
    begins: Vec<u64>,
    memory: Vec<Vec<TaxelChange>>,
    /// How many bytes may be in memory.
    most: u64,
    /// Where a temporary file is made, and that file once there is more.
    folder: PathBuf,
    file: Option<File>,
}

impl ChangeBlocks {
    /// No blocks; those of more than `most` bytes are in a temporary file in this folder or, where that cannot be written, in that
    /// of the system.
    pub(super) fn new(folder: &Path, most: u64) -> Self {
        Self { begins: vec![0], memory: vec![], most, folder: folder.to_owned(), file: None }
    }

    /// Number of blocks.
    pub(super) fn len(&self) -> usize {
        self.begins.len() - 1
    }

    /// Number of changes.
    pub(super) fn changes(&self) -> u64 {
        self.begins[self.len()]
    }

    /// Appends a block.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the temporary file cannot be made or has no room.
    pub(super) fn push(&mut self, changes: Vec<TaxelChange>) -> Result<()> {
        self.begins.push(self.changes() + changes.len() as u64);
        self.memory.push(changes);
        if self.file.is_none() && self.changes() * BYTES as u64 <= self.most {
            return Ok(());
        }
        let mut file = match self.file.take() {
            Some(file) => file,
            None => self.make_file()?,
        };
        for changes in std::mem::take(&mut self.memory) {
            let bytes: Vec<u8> = changes.iter().flat_map(to_bytes).collect();
            file.write_all(&bytes).map_err(|error| self.no_room(&error))?;
        }
        self.file = Some(file);
        Ok(())
    }

    fn make_file(&mut self) -> Result<File> {
        unnamed_file(&self.folder).or_else(|_| {
            self.folder = std::env::temp_dir();
            unnamed_file(&self.folder).map_err(|error| self.no_room(&error))
        })
    }

    fn no_room(&self, error: &io::Error) -> Error {
        let bytes = self.changes() * BYTES as u64;
        let size = problem!("has no room for a temporary file of {bytes} bytes or more, which the view needs: {error}");
        size.at(Place::file(&self.folder)).into()
    }

    /// The changes of a block; `None` after the last one.
    ///
    /// # Errors
    ///
    /// `File` where the temporary file cannot be read.
    pub(super) fn read(&self, block: usize) -> Result<Option<Vec<TaxelChange>>> {
        let begins = self.begins.get(block..).and_then(<[u64]>::first_chunk);
        let Some(&[begin, end]) = begins else { return Ok(None) };
        let Some(file) = &self.file else { return Ok(Some(self.memory[block].clone())) };
        let mut bytes = vec![0; usize::try_from(end - begin).unwrap_or(0) * BYTES];
        read_exact_at(file, &mut bytes, begin * BYTES as u64).map_err(Error::file(&self.folder))?;
        Ok(Some(bytes.as_chunks().0.iter().map(of_bytes).collect()))
    }
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

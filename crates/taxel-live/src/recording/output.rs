//! The file of a recording, locked while it is written.
//!
//! A second recorder that should replace the file of a running one is refused by the lock, which the system releases
//! when the process ends. In Unix other programs do not check the lock.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};

use crate::{Error, Result};
#[cfg(unix)]
use unix as reserved;
#[cfg(windows)]
use windows as reserved;

/// The code of a denied access: of Linux and its kin, and of Windows (winerror.h).
#[cfg(unix)]
const DENIED: i32 = libc::EACCES;
#[cfg(windows)]
const DENIED: i32 = 5;

/// A file that is reserved for one recording.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    /// The path from any current folder.
    place: PathBuf,
    file: File,
}

impl OutputFile {
    /// Opens and locks a new file; or with `overwrite` an existing one, which loses its contents once it is locked. A
    /// write-protected file is never replaced.
    ///
    /// # Errors
    ///
    /// `File` if the file exists (and `overwrite` is not set), cannot be created or written, or is being recorded by another
    /// program, or by another part of this one.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self> {
        if overwrite {
            replaceable(path)?;
        }
        let (file, new) = open(path, overwrite).map_err(Error::file(path))?;
        if !reserved::lock(&file).map_err(Error::file(path))? {
            let text = "is being recorded by another program; end that first, or name another file";
            return Err(Error::file(path)(IoError::new(ErrorKind::ResourceBusy, text)));
        }
        // A device has no length.
        if !new && file.metadata().map_err(Error::file(path))?.is_file() {
            file.set_len(0).map_err(Error::file(path))?;
        }
        let place = std::path::absolute(path).map_err(Error::file(path))?;
        Ok(Self { path: path.to_owned(), place, file })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The open file.
    #[must_use]
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Whether the path leads to the file of this metadata, which is this one's.
    #[must_use]
    pub fn is_in_place(&self, about: &Metadata) -> bool {
        reserved::is_at(about, &self.place)
    }

    /// Removes the file, which holds nothing; a device stays.
    ///
    /// # Errors
    ///
    /// `File` where the system refuses.
    pub fn discard(self) -> Result<()> {
        let is_file = self.file.metadata().map_err(Error::file(&self.path))?.is_file();
        if is_file { reserved::remove(self.file, &self.place).map_err(Error::file(&self.path)) } else { Ok(()) }
    }
}

/// Opens the file; also returns whether it is new.
fn open(path: &Path, overwrite: bool) -> IoResult<(File, bool)> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    if !overwrite {
        return reserved::open(options.create_new(true), path).map(|file| (file, true));
    }
    let new = !path.exists();
    reserved::open(options.create(true).truncate(false), path).map(|file| (file, new))
}

/// Refuses a write-protected file, also for the superuser, who could write to it.
fn replaceable(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(file) if file.permissions().readonly() => Err(Error::file(path)(IoError::from_raw_os_error(DENIED))),
        _ => Ok(()),
    }
}

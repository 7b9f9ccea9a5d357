//! The file of a recording: locked while it is written, and checked at the end.
//!
//! A second recorder that should replace the file of a running one is refused by the lock, which the system releases
//! when the process ends. In Unix other programs do not check the lock: they may remove, rename or replace the file, and
//! what is written then goes into a file without a name. Therefore the end of a recording checks that the name still refers
//! to the file that was written. In Windows they cannot.

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

use std::fs::{File, OpenOptions};
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};

use crate::{Error, Result, system_error};
#[cfg(unix)]
use unix as reserved;
#[cfg(windows)]
use windows as reserved;

/// A file that is reserved for one recording.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    file: File,
    new: bool,
}

impl OutputFile {
    /// Opens and locks a new file; or with `overwrite` an existing one, whose contents remain until
    /// [`OutputFile::begin`]. A write-protected file is never replaced.
    ///
    /// # Errors
    ///
    /// `File` if the file exists (and `overwrite` is not set), cannot be created or written, or is being recorded by another
    /// program, or by another part of this one.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self> {
        if overwrite {
            replaceable(path)?;
        }
        loop {
            let (file, new) = open(path, overwrite).map_err(Error::file(path))?;
            if !reserved::lock(&file).map_err(Error::file(path))? {
                let text = "is being recorded by another program; end that first, or name another file";
                return Err(Error::file(path)(IoError::new(ErrorKind::ResourceBusy, text)));
            }
            let output = Self { path: path.to_owned(), file, new };
            // The previous holder of the lock may have removed the file.
            if output.is_in_place()? {
                return Ok(output);
            }
        }
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file did not exist before.
    #[must_use]
    pub fn is_new(&self) -> bool {
        self.new
    }

    /// Truncates the file: its previous content is replaced from now on.
    ///
    /// # Errors
    ///
    /// `File` if the system refuses.
    pub fn begin(&self) -> Result<()> {
        // A device has no length.
        let is_file = self.file.metadata().map_err(Error::file(&self.path))?.is_file();
        if is_file { self.file.set_len(0).map_err(Error::file(&self.path)) } else { Ok(()) }
    }

    /// The open file.
    #[must_use]
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Whether the path still refers to this file.
    fn is_in_place(&self) -> Result<bool> {
        reserved::is_in_place(&self.file, &self.path).map_err(Error::file(&self.path))
    }

    /// Checks at the end of a recording that its path still refers to the file; `written` describes its content in the
    /// error.
    ///
    /// # Errors
    ///
    /// `File` if the file was removed, renamed or replaced, so that what was written is lost.
    pub fn check(&self, written: impl FnOnce() -> String) -> Result<()> {
        if self.is_in_place()? {
            return Ok(());
        }
        let text = format!("was removed, renamed or replaced while it was recorded; LOST: {}", written());
        Err(Error::file(&self.path)(IoError::other(text)))
    }

    /// Removes the file where it is new: nothing is to stay in it. An earlier one stays.
    ///
    /// # Errors
    ///
    /// `File` where the system refuses.
    pub fn discard(self) -> Result<()> {
        if self.new && self.is_in_place()? {
            reserved::remove(self.file, &self.path).map_err(Error::file(&self.path))?;
        }
        Ok(())
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
        Ok(file) if file.permissions().readonly() => Err(Error::file(path)(system_error::denied())),
        _ => Ok(()),
    }
}

//! The file that a recording is written to: locked as long as it is written, and looked for at the end.
//!
//! A second recorder that is to replace the file of a running one is refused by the lock, which the system takes away with the
//! process. Other programs know nothing of it: they remove, rename or replace the file, and what is written then goes into a
//! file without a name. So whoever ends a recording checks that the name still leads to the file that was written.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// A file that is reserved for one recording.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    file: File,
    new: bool,
}

impl OutputFile {
    /// Opens and locks a new file; or an existing one where `overwrite` is set, whose contents stay until
    /// [`OutputFile::begin`]. One that is write-protected is never replaced.
    ///
    /// # Errors
    ///
    /// `File` where the file exists (and `overwrite` is not set), cannot be created or written, or is being recorded by another
    /// program, or by another part of this one.
    pub fn open(path: &Path, overwrite: bool) -> Result<Self> {
        if overwrite {
            replaceable(path)?;
        }
        loop {
            let (file, new) = open(path, overwrite).map_err(Error::file(path))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let text = "is being recorded by another program; end that first, or name another file";
                    return Err(Error::file(path)(IoError::new(ErrorKind::ResourceBusy, text)));
                }
                // A file system without locks, as some of networks: what is lost there is found at the end.
                Err(TryLockError::Error(error))
                    if matches!(error.raw_os_error(), Some(libc::ENOLCK | libc::EOPNOTSUPP)) => {}
                Err(TryLockError::Error(error)) => return Err(Error::file(path)(error)),
            }
            let output = Self { path: path.to_owned(), file, new };
            // Whoever held the lock before may have removed the file.
            if output.is_in_place()? {
                return Ok(output);
            }
        }
    }

    /// Its name.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether there was no such file before.
    #[must_use]
    pub fn is_new(&self) -> bool {
        self.new
    }

    /// Empties it: what it held before is replaced from now on.
    ///
    /// # Errors
    ///
    /// `File` where the system refuses.
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

    /// Whether the name still leads to this file.
    fn is_in_place(&self) -> Result<bool> {
        let ours = self.file.metadata().map_err(Error::file(&self.path))?;
        match std::fs::metadata(&self.path) {
            Ok(named) => Ok((named.dev(), named.ino()) == (ours.dev(), ours.ino())),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(false),
            Err(error) => Err(Error::file(&self.path)(error)),
        }
    }

    /// Checks at the end of a recording that its name still leads to it; `written` is what it holds, for the error.
    ///
    /// # Errors
    ///
    /// `File` where the file was removed, renamed or replaced: what was written is lost.
    pub fn check(&self, written: impl FnOnce() -> String) -> Result<()> {
        if self.is_in_place()? {
            return Ok(());
        }
        let text = format!("was removed, renamed or replaced while it was recorded; LOST: {}", written());
        Err(Error::file(&self.path)(IoError::new(ErrorKind::NotFound, text)))
    }

    /// Removes the file where it is new: nothing is to stay in it. An earlier one stays.
    ///
    /// # Errors
    ///
    /// `File` where the system refuses.
    pub fn discard(self) -> Result<()> {
        if self.new && self.is_in_place()? {
            std::fs::remove_file(&self.path).map_err(Error::file(&self.path))?;
        }
        Ok(())
    }
}

/// The file, and whether it is new.
fn open(path: &Path, overwrite: bool) -> IoResult<(File, bool)> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    if !overwrite {
        return options.create_new(true).open(path).map(|file| (file, true));
    }
    let new = !path.exists();
    options.create(true).truncate(false).open(path).map(|file| (file, new))
}

/// Refuses a write-protected file, also to the superuser, who may write everywhere.
fn replaceable(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(file) if file.permissions().readonly() => Err(Error::file(path)(IoError::from_raw_os_error(libc::EACCES))),
        _ => Ok(()),
    }
}

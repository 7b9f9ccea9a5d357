//! A recording's file in Unix: a lock, which other programs may ignore.

use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::Result;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Opens the file for one recording.
pub(super) fn open(options: &mut OpenOptions, path: &Path) -> Result<File> {
    options.open(path)
}

/// Locks the file; false if another recording has locked it.
pub(super) fn lock(file: &File) -> Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        // Some file systems, for example of networks, have no locks: a loss is then detected at the end.
        Err(TryLockError::Error(error)) if matches!(error.raw_os_error(), Some(libc::ENOLCK | libc::EOPNOTSUPP)) => {
            Ok(true)
        }
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Removes the file while its lock is held.
pub(super) fn remove(_locked: File, path: &Path) -> Result<()> {
    std::fs::remove_file(path)
}

/// Whether the path still leads to the file.
pub(super) fn is_at(file: &Metadata, path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| (found.dev(), found.ino()) == (file.dev(), file.ino()))
}

//! A recording's file in Windows: while it is open, other programs can read it, and cannot write, rename or remove it.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Result};
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;

/// `FILE_SHARE_READ` of winnt.h.
const OTHERS_READ: u32 = 1;
/// `ERROR_SHARING_VIOLATION` of winerror.h.
const HELD: i32 = 32;

/// Opens the file for one recording.
pub(super) fn open(options: &mut OpenOptions, path: &Path) -> Result<File> {
    options.share_mode(OTHERS_READ).open(path).map_err(|error| match error.raw_os_error() {
        Some(HELD) => Error::new(
            ErrorKind::ResourceBusy,
            "another program has opened this file; close it there, or name another file",
        ),
        _ => error,
    })
}

/// Opening has reserved the file.
#[allow(clippy::unnecessary_wraps)]
pub(super) fn lock(_: &File) -> Result<bool> {
    Ok(true)
}

/// Closes the file, as an open one cannot be removed, and removes it.
pub(super) fn remove(file: File, path: &Path) -> Result<()> {
    drop(file);
    std::fs::remove_file(path)
}

/// No other program can take an open file away.
pub(super) fn is_at(_: &Metadata, _: &Path) -> bool {
    true
}

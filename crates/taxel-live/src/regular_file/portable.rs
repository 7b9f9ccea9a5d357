//! Files in a system where every file that can be opened can be read at once.

use std::fs::{File, FileType};
use std::io;
use std::path::Path;

use crate::{Error, Result, system_error};

/// Opens the file; a folder cannot be opened.
pub(super) fn open(path: &Path) -> Result<File> {
    if path.is_dir() {
        return Err(Error::file(path)(system_error::is_folder()));
    }
    File::open(path).map_err(Error::file(path))
}

/// Reads wait already.
#[allow(clippy::unnecessary_wraps)]
pub(super) fn set_blocking(_: &File) -> io::Result<()> {
    Ok(())
}

pub(super) fn kind_of(_: FileType) -> &'static str {
    "no file"
}

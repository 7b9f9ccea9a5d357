//! Opens files for reading: regular files alone, as a named pipe waits for its writer and a device may have no end.

use std::fs::File;
use std::path::Path;

use crate::{Error, Result, system_error};

/// Opens a regular file, or a link to one, for reading.
///
/// # Errors
///
/// `Core` (format) if it is a named pipe, a socket or a device; `File` if it cannot be opened, or is a folder.
pub fn open_regular(path: &Path) -> Result<File> {
    let about = std::fs::metadata(path).map_err(Error::file(path))?;
    if about.is_dir() {
        return Err(Error::file(path)(system_error::is_folder()));
    }
    if !about.is_file() {
        return Err(Error::format(path, "a pipe, a socket or a device; must be a file"));
    }
    File::open(path).map_err(Error::file(path))
}

//! Opens files for reading: regular files alone, as a named pipe waits for its writer and a device may have no end.

#[cfg(not(unix))]
mod portable;
#[cfg(unix)]
mod unix;

use std::fs::File;
use std::path::Path;

use crate::{Error, Result, system_error};
#[cfg(not(unix))]
use portable as system;
#[cfg(unix)]
use unix as system;

/// Opens a regular file, or a link to one, for reading.
///
/// The kind is that of the open file, so that nobody can replace the file in between.
///
/// # Errors
///
/// `Core` (format) if it is a named pipe, a socket or a device; `File` if it cannot be opened, or is a folder.
pub fn open_regular(path: &Path) -> Result<File> {
    let file = system::open(path)?;
    let about = file.metadata().map_err(Error::file(path))?;
    if about.is_dir() {
        return Err(Error::file(path)(system_error::is_folder()));
    }
    if !about.is_file() {
        return Err(Error::format(path, &format!("{}; must be a file", system::kind_of(about.file_type()))));
    }
    system::set_blocking(&file).map_err(Error::file(path))?;
    Ok(file)
}

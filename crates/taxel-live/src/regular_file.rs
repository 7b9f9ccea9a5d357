//! Opens files for reading: regular files alone, as a named pipe waits for its writer and a device may have no end.

use std::fs::File;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use crate::{Error, Result};

/// Opens a regular file, or a link to one, for reading.
///
/// The kind is that of the open file, so that nobody can replace the file in between.
///
/// # Errors
///
/// `Core` (format) if it is a named pipe, a socket or a device; `File` if it cannot be opened, or is a folder.
pub fn open_regular(path: &Path) -> Result<File> {
    // Without O_NONBLOCK a named pipe blocks until somebody writes; a terminal must not become this process's own.
    let opened = File::options().read(true).custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY).open(path);
    let (file, about) = match opened.and_then(|file| file.metadata().map(|about| (file, about))) {
        Ok(opened) => opened,
        // A socket, or a device that nothing drives, cannot be opened at all.
        Err(error) if error.raw_os_error() == Some(libc::ENXIO) => {
            let kind = std::fs::metadata(path).map_or("no file", |about| kind_of(about.file_type()));
            return Err(Error::format(path, &format!("{kind}; must be a file")));
        }
        Err(error) => return Err(Error::file(path)(error)),
    };
    if about.is_dir() {
        return Err(Error::file(path)(std::io::Error::from_raw_os_error(libc::EISDIR)));
    }
    if !about.is_file() {
        return Err(Error::format(path, &format!("{}; must be a file", kind_of(about.file_type()))));
    }
    // SAFETY: the descriptor is that of `file`, which is open.
    let cleared = unsafe {
        let flags = libc::fcntl(file.as_raw_fd(), libc::F_GETFL);
        flags >= 0 && libc::fcntl(file.as_raw_fd(), libc::F_SETFL, flags & !libc::O_NONBLOCK) >= 0
    };
    if !cleared {
        return Err(Error::file(path)(std::io::Error::last_os_error()));
    }
    Ok(file)
}

fn kind_of(kind: std::fs::FileType) -> &'static str {
    if kind.is_fifo() {
        "a named pipe"
    } else if kind.is_socket() {
        "a socket"
    } else if kind.is_char_device() || kind.is_block_device() {
        "a device"
    } else {
        "no file"
    }
}

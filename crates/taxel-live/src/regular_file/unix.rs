//! Files in Unix.

use std::fs::{File, FileType};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use crate::{Error, Result};

/// Opens whatever it is, without waiting.
pub(super) fn open(path: &Path) -> Result<File> {
    // Without O_NONBLOCK a named pipe blocks until a program writes; a terminal must not become this process's own.
    let opened = File::options().read(true).custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY).open(path);
    opened.map_err(|error| {
        // A socket, or a device that nothing drives, cannot be opened at all.
        if error.raw_os_error() == Some(libc::ENXIO) {
            let kind = std::fs::metadata(path).map_or("no file", |about| kind_of(about.file_type()));
            Error::format(path, &format!("{kind}; must be a file"))
        } else {
            Error::file(path)(error)
        }
    })
}

/// Lets reads wait for their bytes.
pub(super) fn set_blocking(file: &File) -> io::Result<()> {
    // SAFETY: the descriptor is that of `file`, which is open.
    let cleared = unsafe {
        let flags = libc::fcntl(file.as_raw_fd(), libc::F_GETFL);
        flags >= 0 && libc::fcntl(file.as_raw_fd(), libc::F_SETFL, flags & !libc::O_NONBLOCK) >= 0
    };
    if cleared { Ok(()) } else { Err(io::Error::last_os_error()) }
}

pub(super) fn kind_of(kind: FileType) -> &'static str {
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

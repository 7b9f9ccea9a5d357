//! Named pipes that lines are written to, as `mkfifo` makes them.

use std::fs::File;
use std::path::Path;

use taxel_core::problem;

use crate::Result;

/// Opens a pipe, which never blocks its writer; `None` if it has no reader.
///
/// # Errors
///
/// `File` if it cannot be opened, `Core(Problem)` if it is no pipe.
#[cfg(unix)]
pub(crate) fn open_to_write(path: &Path) -> Result<Option<File>> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};

    use crate::Error;

    if !std::fs::metadata(path).map_err(Error::file(path))?.file_type().is_fifo() {
        return Err(problem!("{}: is not a named pipe; mkfifo creates it", path.display()).into());
    }
    match File::options().write(true).custom_flags(libc::O_NONBLOCK).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.raw_os_error() == Some(libc::ENXIO) => Ok(None),
        Err(error) => Err(Error::file(path)(error)),
    }
}

/// Refuses the pipe: those of this system are no files.
///
/// # Errors
///
/// `Core(Problem)`, which names what this system has.
#[cfg(not(unix))]
pub(crate) fn open_to_write(path: &Path) -> Result<Option<File>> {
    let path = path.display();
    Err(problem!(
        "{path}: this system has no named pipes to write to; lines+udp:HOST:PORT and lines+tcp:HOST:PORT work"
    )
    .into())
}

//! Writes the edges of the board's sync line as lines of text.

use std::fs::{File, OpenOptions};
use std::io::Write;
#[cfg(unix)]
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

use crate::recording::now_ns;
use crate::{Error, Result};

/// The destination of the edges.
#[derive(Debug)]
pub(super) struct Sync {
    out: File,
    high: bool,
}

impl Sync {
    /// Opens a new file, or an existing pipe or terminal, and writes the line's level.
    ///
    /// # Errors
    ///
    /// `File` if the file cannot be opened, or if it exists and may not be replaced.
    pub(super) fn open(path: &Path, overwrite: bool) -> Result<Self> {
        let mut options = File::options();
        options.write(true);
        if set_up_for_pipe(path, &mut options) {
            // It exists, and keeps what was written to it.
        } else if overwrite {
            options.create(true).truncate(true);
        } else {
            options.create_new(true);
        }
        let out = options.open(path).map_err(Error::file(path))?;
        let mut sync = Self { out, high: false };
        sync.edge(0.0);
        Ok(sync)
    }

    /// Writes the level of the line at a time of the board, us, if it has changed.
    pub(super) fn follow(&mut self, time_us: f64, high: bool) {
        if high != self.high {
            self.high = high;
            self.edge(time_us);
        }
    }

    /// Writes an edge: the board's time in us, the level 1 or 0, the host's time in ns since 1970.
    fn edge(&mut self, time_us: f64) {
        let line = format!("{time_us} {} {}\n", u8::from(self.high), now_ns());
        // Without a reader the line of text is lost, as an edge is that no input samples.
        let _ = self.out.write_all(line.as_bytes());
    }
}

/// Whether the path is that of a pipe or a terminal; then it is opened for reading too, so that a pipe opens before it has a
/// reader, and non-blocking, so that a slow reader never delays the board.
#[cfg(unix)]
fn set_up_for_pipe(path: &Path, options: &mut OpenOptions) -> bool {
    let metadata = std::fs::metadata(path).ok();
    let is_pipe = metadata.is_some_and(|m| m.file_type().is_fifo() || m.file_type().is_char_device());
    if is_pipe {
        options.read(true).custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY);
    }
    is_pipe
}

/// Elsewhere a path is that of a file.
#[cfg(not(unix))]
fn set_up_for_pipe(_: &Path, _: &mut OpenOptions) -> bool {
    false
}

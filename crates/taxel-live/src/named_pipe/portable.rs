//! A system whose named pipes are no files.

use std::fs::File;
use std::path::Path;

use taxel_core::problem;

use crate::Result;

/// Refuses the pipe.
///
/// # Errors
///
/// `Core(Problem)`, which names what this system has.
pub(crate) fn open_to_write(path: &Path) -> Result<Option<File>> {
    let path = path.display();
    Err(problem!(
        "{path}: this system has no named pipes to write to; lines+udp:HOST:PORT and lines+tcp:HOST:PORT work"
    )
    .into())
}

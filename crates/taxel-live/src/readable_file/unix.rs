//! Reading with a time limit by `poll`.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

#[derive(Debug)]
pub(super) struct FileReader(File);

pub(super) fn open(path: &Path) -> io::Result<File> {
    // Without O_NONBLOCK a named pipe blocks until a program writes.
    File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path)
}

pub(super) fn standard_input() -> io::Result<File> {
    // Bypasses the program's own buffer, whose content `poll` does not see.
    io::stdin().as_fd().try_clone_to_owned().map(File::from)
}

impl FileReader {
    pub(super) fn new(file: File) -> Self {
        Self(file)
    }

    pub(super) fn read(&mut self, bytes: &mut [u8], within: Duration) -> io::Result<Option<usize>> {
        let mut asked = libc::pollfd { fd: self.0.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        let most = i32::try_from(within.as_millis()).unwrap_or(i32::MAX);
        // SAFETY: one entry, on our stack, of a descriptor that we hold open.
        if unsafe { libc::poll(&raw mut asked, 1, most) } <= 0 {
            return Ok(None);
        }
        match self.0.read(bytes) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
            read => read.map(Some),
        }
    }
}

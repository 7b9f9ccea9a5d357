//! Reading with a time limit by a thread: not every system can wait for a file and for a time at once.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
#[cfg(windows)]
use std::os::windows::io::AsHandle;
#[cfg(windows)]
use std::path::Path;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

/// Number of pieces that are read ahead.
const AHEAD: usize = 4;

/// Interval at which the end of a file is read again.
const AGAIN: Duration = Duration::from_millis(50);

#[derive(Debug)]
pub(super) struct FileReader {
    pieces: Receiver<io::Result<Vec<u8>>>,
    /// What was received and not yet read.
    rest: Vec<u8>,
}

#[cfg(windows)]
pub(super) fn open(path: &Path) -> io::Result<File> {
    File::open(path)
}

#[cfg(windows)]
pub(super) fn standard_input() -> io::Result<File> {
    io::stdin().as_handle().try_clone_to_owned().map(File::from)
}

impl FileReader {
    /// The thread ends after the reader was dropped, as soon as a read returns.
    pub(super) fn new(file: File) -> Self {
        let (sender, pieces) = bounded(AHEAD);
        std::thread::spawn(move || read_ahead(file, &sender));
        Self { pieces, rest: vec![] }
    }

    pub(super) fn read(&mut self, bytes: &mut [u8], within: Duration) -> io::Result<Option<usize>> {
        if self.rest.is_empty() {
            match self.pieces.recv_timeout(within) {
                Ok(piece) => self.rest = piece?,
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                // The thread has ended with an error, which was read.
                Err(RecvTimeoutError::Disconnected) => {}
            }
        }
        let n = self.rest.len().min(bytes.len());
        bytes[..n].copy_from_slice(&self.rest[..n]);
        self.rest.drain(..n);
        Ok(Some(n))
    }
}

/// Reads until the receiver is gone, or reading fails; an empty piece is the end of the file.
fn read_ahead(mut file: File, sender: &Sender<io::Result<Vec<u8>>>) {
    let mut piece = vec![0; 1 << 16];
    loop {
        let read = match file.read(&mut piece) {
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            // The writer of a pipe has closed it: in Windows this is an error.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(0),
            read => read,
        };
        let (is_end, failed) = (matches!(read, Ok(0)), read.is_err());
        if sender.send(read.map(|n| piece[..n].to_vec())).is_err() || failed {
            return;
        }
        if is_end {
            std::thread::sleep(AGAIN);
        }
    }
}
